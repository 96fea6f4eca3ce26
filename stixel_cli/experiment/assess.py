"""Assess the stixels of one pair, and estimate the disparity error of a recording's rig."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from stixel_cli.config.compose import Composition
from stixel_cli.engine.parameters import ThreadsExecutor
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import Store
from stixel_cli.errors import UserError
from stixel_cli.evaluation.scores import finite_mean, finite_median
from stixel_cli.experiment.stages import compared_rows, computed_stages
from stixel_cli.geometry.rig import Rig
from stixel_cli.geometry.rig_calibration import RigCalibration
from stixel_cli.pictures import style
from stixel_cli.pictures.camera import painted
from stixel_cli.recordings.image_files import read_disparity
from stixel_cli.recordings.stereo_images import read_left
from stixel_cli.recordings.tables import read_labels
from stixel_cli.rendering.images import encode_png
from stixel_cli.report.assess import ERROR_MAP, LABELS, Assessment, error_map
from stixel_cli.scene.parameters import CLASS_OF_KITTI_TYPE
from stixel_cli.stixels.types import FreeSpace, Stixels
from stixel_cli.validation.pair_errors import (
    area_errors,
    called_free,
    compensated,
    found_columns,
    label_obstacles,
    nearest_disparity,
    true_obstacles,
)
from stixel_cli.validation.stixel_file import StixelFile

NEAR = 6.0
"""No obstacle nearer than this, m, may be called free."""

STAGES = ("pairs", "match", "free_space", "stixels")
"""Whose times are reported: from the files to the stixels."""
IN_THIS_PROCESS = ThreadsExecutor("threads", 1)


def assess(composition: Composition, progress: Progress) -> Assessment:
    """Assess the first frame of a recording; UserError if the composition has none."""
    configuration = composition.configuration
    if configuration.source.kind == "rendered":
        raise UserError(
            "assess needs a recording or two images; rendered runs are scored by stixel run"
        )
    wanted = ["camera_pictures", "rig_pictures", "calibration"]
    rows = compared_rows(composition, progress.note)
    with computed_stages(composition, wanted, progress) as (_, load):
        first = {name: load(name)[0] for name in (*STAGES, *wanted)}
    image = first["pairs"].left[0]
    values = {
        "row_difference_px": rows and rows.difference,
        "unknown_share": float((first["free_space"].unknown_row[0] >= 0).mean()),
        "disparity_share": float((first["match"].raw(0) >= 0).mean()),
    }
    drawn = first["camera_pictures"].files | first["rig_pictures"].files
    pictures = {Path(name).stem: data for name, data in drawn.items() if name.endswith(".png")}
    rig = {"text": first["calibration"].text, **first["calibration"].values}
    seconds = _seconds(composition, first["calibration"].rig)
    found, maps = _against_truth(first["stixels"], first["free_space"], image, composition)
    return Assessment(dict.fromkeys(LABELS) | found | values, pictures | maps, seconds, rig)


def _seconds(composition: Composition, rig: Rig) -> dict[str, float]:
    """Seconds of each stage the second time in this process: without loading or compiling code.

    The `rig` states its error, so that it is not calibrated again.
    """
    known = replace(composition.configuration, executor=IN_THIS_PROCESS, rig=rig)
    composition = replace(composition, configuration=known)
    for _ in range(2):
        with TemporaryDirectory() as folder:
            empty = Store(Path(folder, "cache"))
            with computed_stages(composition, STAGES, store=empty) as (done, _):
                records = {record["name"]: record["seconds"] for record in done.stage_records()}
    return {name: records[name] for name in STAGES}


def assess_stixels(file: StixelFile, composition: Composition | None) -> Assessment:
    """Assess stixels that anybody has made, with the truth of a recording if one is given.

    `composition` is that of a recording whose first frame has the stixels. UserError if the file is
    of an image of another size.
    """
    stixels, image = file.stixels, file.image
    if composition is not None:
        recording = composition.recording
        rectification = recording.calibration.rectification
        image = read_left(recording.left, 0, rectification, recording.messages)[0]
        sizes = file.image.shape[:2], image.shape[:2]
        if sizes[0] != sizes[1] if file.has_size else (np.subtract(*sizes) > 0).any():
            (height, width), (other_height, other_width) = sizes
            raise UserError(
                f"--stixels: reach over {width} × {height} px, but the images have "
                f"{other_width} × {other_height} px"
            )
    picture = painted(image, stixels, style.depth_colours(stixels.depth))
    pictures = {"stixels": encode_png(picture)}
    if composition is None:
        covered = nearest_disparity(replace(stixels, disparity=stixels.depth), 0, image.shape[1])
        values = {"stixels": len(stixels.left), "stixel_share": float(np.isfinite(covered).mean())}
        return Assessment(dict.fromkeys(LABELS) | values, pictures, {})
    rig, disparity = composition.configuration.rig, stixels.disparity
    of_depth = rig.disparity_from_depth(stixels.depth)
    stixels = replace(stixels, disparity=np.where(np.isnan(disparity), of_depth, disparity))
    nearest = nearest_disparity(stixels, 0, rig.width)[None]
    nothing = np.full(nearest.shape, -1, dtype=np.int32)
    free_space = FreeSpace(0, nearest.astype(np.float32), nothing, np.zeros((1, 2)), nothing)
    values, maps = _against_truth(stixels, free_space, image, composition)
    return Assessment(dict.fromkeys(LABELS) | values, pictures | maps, {})


def _against_truth(
    stixels: Stixels, free_space: FreeSpace, image: np.ndarray, composition: Composition
) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The values of the first frame; by its name the map of errors, if the truth is known."""
    maps: dict[str, bytes] = {}
    configuration, recording = composition.configuration, composition.recording
    rig = configuration.rig
    covered = np.isfinite(nearest_disparity(stixels, 0, rig.width))
    values: dict[str, Any] = {
        "stixels": int(stixels.offsets[1]),
        "stixel_share": float(covered.mean()),
        "free_share": float(np.isnan(free_space.disparity[0]).mean()),
    }
    obstacles = np.full(rig.width, np.nan)
    if recording.true_disparities:
        truth = read_disparity(recording.true_disparities[0])
        errors = area_errors(stixels, 0, compensated(truth, rig, configuration.road), rig)
        maps[ERROR_MAP] = error_map(image, stixels, errors)
        obstacles = true_obstacles(truth, rig, configuration.road, configuration.free_space)
        seen = np.isfinite(obstacles)
        found = found_columns(stixels, 0, obstacles, rig)
        values |= {
            "obstacle_columns": int(seen.sum()),
            "obstacle_covered_share": finite_mean(covered[seen]),
            "found_share": finite_mean(found[seen]),
            "compared_share": len(errors.errors) / max(int(stixels.offsets[1]), 1),
            "stixels_compared": len(errors.errors),
            **_sizes(errors.errors),
            "outlier_share": finite_mean(errors.outliers),
            "phantoms": int(np.sum(errors.outliers & (errors.errors > 0))),
            "square_compared": int(errors.square.sum()),
            **_sizes(errors.errors[errors.square], "square_"),
        }
    if recording.label_files:
        tracks = read_labels(recording.label_files, recording.tables)
        labels = [one for one in tracks.values() if one.kind in CLASS_OF_KITTI_TYPE]
        boxes = label_obstacles(labels, recording.frames.start, rig, recording.tables.left_camera)
        obstacles = np.fmin(obstacles, boxes)
    if recording.true_disparities or recording.label_files:
        with np.errstate(invalid="ignore"):
            near = obstacles < NEAR
        free = called_free(free_space, 0, obstacles, rig, NEAR)
        values |= {"near_columns": int(near.sum()), "near_called_free": int(free.sum())}
    return values, maps


def _sizes(errors: np.ndarray, prefix: str = "") -> dict[str, float | None]:
    """Median size, and share beyond 1 px, of errors (n,) px; None without an error."""
    size = np.abs(errors)
    return {
        f"{prefix}median_px": finite_median(size),
        f"{prefix}beyond_1px_share": finite_mean(size > 1.0),
    }


def calibrate(composition: Composition, progress: Progress) -> RigCalibration:
    """The disparity error of a recording's rig, also of one that states an error.

    UserError if the composition has no recording.
    """
    configuration = composition.configuration
    if configuration.source.kind == "rendered":
        raise UserError("source: rendered is exact: choose a recording, source.folder=DIR")
    source = replace(configuration.source, calibration="motion")
    nothing = (0.0, 0.0, 0.0)
    exact = replace(configuration.rig, disparity_error=nothing, disparity_error_std=nothing)
    configuration = replace(configuration, source=source, rig=exact)
    composition = replace(composition, configuration=configuration)
    compared_rows(composition, progress.note)
    with computed_stages(composition, ["calibration"], progress) as (_, load):
        return load("calibration")[0]
