"""Play back one run, or several of one scene, on a self-contained page.

The page consists of the files `templates/playback.*` and one block of JSON. Every run writes such
a page, so this module imports neither Matplotlib nor OpenCV.
"""

import base64
from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.evaluation.metric_table import MAIN, SMOOTHED, Metric, metric
from stixel_cli.evaluation.scores import LOW_OVERLAP, SERIES
from stixel_cli.evaluation.verdict import LEAST_ODDS, badges, verdict
from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.pictures import uncertainty
from stixel_cli.report.metrics import (
    LABEL_COLUMNS,
    filled_page,
    label_rows,
    shown_value,
    smoothed_label,
)
from stixel_cli.results.lineage import shown_revision
from stixel_cli.results.pictures import CameraFrames
from stixel_cli.results.result import RunResult
from stixel_cli.stixels.types import Objects
from stixel_cli.tracking.track import Track

SUMMARY = (*MAIN[:4], "low_overlap_share", "nees_position_mean", "nis_mean")
"""The metrics that the page shows of a whole run."""

FACTS = ("road_user", "path", "ego", "measurement", "tracker")
"""The groups whose choices the page names."""


def facts_of(run: RunResult) -> list[tuple[str, str]]:
    """(name, value) pairs that describe the run."""
    measurement, seed = run.settings["measurement"], ("seed", str(run.settings["seed"]))
    if measurement.get("kind") == "file":
        facts = [(group, run.choice(group)) for group in ("prior", "start", "tracker")]
        return [("scans", Path(measurement["path"]).name), *facts, seed]
    mesh = run.settings["road_user"].get("mesh")
    own = [] if mesh is None else [("mesh", Path(mesh).name)]
    return [*((group, run.choice(group)) for group in FACTS), *own, seed]


def origin_of(run: RunResult) -> dict[str, Any] | None:
    """What a page mailed to a colleague states of a run; None if it has no command.

    A run without a folder is about to be written into that of its page, so links begin there.
    """
    manifest, drawn = run.manifest, run.pictures.get("rig_error.png", b"")
    if "command" not in manifest:
        return None
    versions = manifest.get("versions") or {}
    made = [
        f"stixel {versions.get('stixel', 'unknown')}",
        f"revision {shown_revision(manifest.get('git') or {}) or 'unknown'}",
        str(manifest.get("created", "")),
    ]
    if "row_difference_px" in manifest:
        made.append(f"rows of the images {manifest['row_difference_px']} px apart")
    links = [["figures", "figures/"], ["metrics", "metrics.json"], ["configuration", "config.yaml"]]
    return {
        "command": str(manifest["command"]),
        "made": [one for one in made if one],
        "links": links if run.folder is None else [],
        "correction": manifest.get("correction", ""),
        "rigError": base64.b64encode(drawn).decode("ascii"),
    }


def summary_of(metrics: dict[str, float | int | None]) -> list[list[str]]:
    """[name, value with its unit, smoothed value] of the `SUMMARY`'s metrics that have a value."""
    rows, smoothed = [], smoothed_label(metrics)
    for row in (metric(name) for name in SUMMARY if metrics.get(name) is not None):
        value = _with_unit(row, metrics[row.name])
        if SMOOTHED + row.name in metrics:
            value += f" ({smoothed}: {shown_value(row.name, metrics[SMOOTHED + row.name])})"
        rows.append([row.short_label, value])
    return rows


def headline_of(run: RunResult) -> list[list[str]]:
    """[name, value, reference] of the main numbers of a run.

    The reference is that of the same scans: the IoU of the baseline, the mean of the used points
    for the centre, its direction of motion for the orientation; 1 for NEES.
    """
    metrics = run.metrics
    iou = "iou_mean" if metrics.get("iou_mean") is not None else "iou_box_mean"
    centre, orientation = _of_points(run)
    references = {
        iou: (metrics.get("iou_baseline"), "baseline"),
        "centre_rmse_m": (centre, "mean of its points"),
        "orientation_rmse_deg": (orientation, "motion of that mean, over 1 s"),
        "nees_position_mean": (1.0, "consistent"),
    }
    rows: list[list[str]] = []
    for name, (reference, words) in references.items():
        row, value = metric(name), metrics.get(name)
        if value is None:
            continue
        beside = "" if reference is None else f"{words}: {_with_unit(row, reference)}"
        rows.append([row.short_label, _with_unit(row, value), beside])
    return rows


def _of_points(run: RunResult) -> tuple[float | None, float | None]:
    """RMSE of the mean of the used points, m, and of its direction over a second, °."""
    scans, track, truth = run.scans, run.track, run.scenario.target_poses_world
    used = [track.used_points[slice(*ends)] for ends in pairwise(track.used_offsets)]
    nothing = np.full(2, np.nan)
    means = np.array([scans.points_world[u].mean(0) if len(u) else nothing for u in used])
    half = max(1, int(np.searchsorted(track.times - track.times[0], 0.5)))
    ways = means[2 * half :] - means[: -2 * half]
    turns = wrap_angle(np.arctan2(ways[:, 1], ways[:, 0]) - truth[half:-half, 2])
    errors = (np.linalg.norm(means - truth[:, :2], axis=1), np.degrees(turns))
    squares = (error[np.isfinite(error)] ** 2 for error in errors)
    return tuple(float(np.sqrt(square.mean())) if len(square) else None for square in squares)


def _with_unit(row: Metric, value: float | int) -> str:
    return f"{shown_value(row.name, value)} {row.shown_unit}".strip().replace(" °", "°")


FARTHEST = 1e7  # m; the page omits farther points


def ellipses(covariances: np.ndarray) -> list[int | None]:
    """Semi-axes (mm) and angle (1e-3 rad) of each 1σ ellipse, in one list."""
    semi_axes, angles = uncertainty.ellipse_axes(covariances)
    values = 1000.0 * np.stack([*semi_axes, angles], axis=1).ravel()
    known = np.abs(values) < 1e3 * FARTHEST
    whole = np.rint(np.where(known, values, 0.0)).astype(np.int64).tolist()
    return whole if known.all() else [w if k else None for w, k in zip(whole, known, strict=True)]


def rounded_poses(poses: np.ndarray) -> list[list[int] | None]:
    """x, y (mm) and heading (1e-4 rad) of poses (K, 3 or more)."""
    return [_integers(pose[:3] * (1e3, 1e3, 1e4)) for pose in poses]


def millimetres(values: np.ndarray) -> list[int] | None:
    """Lengths in m as whole millimetres; None if one is not finite or too large."""
    return _integers(1000.0 * values)


def _integers(values: np.ndarray) -> list[int] | None:
    """The values rounded to integers; None if one is not finite or too large."""
    if not (np.abs(values) < 1e3 * FARTHEST).all():
        return None
    return np.rint(values).astype(np.int64).tolist()


def numbers(values: np.ndarray, digits: int) -> list[float | None]:
    """The values, rounded to `digits`; None for one that is not finite."""
    return [round(v, digits) if np.isfinite(v) else None for v in np.asarray(values).tolist()]


MOST_OF_NOISE = 20_000
"""With more used points than this, the page shows the scan's covariances: it must stay small."""


def noise_of(run: RunResult) -> dict[str, Any]:
    """R of the used points of a computed run, for the playback page.

    Returns `text`, a description; `std`, mm, if R is the same for all points, else None;
    `ellipses`, for each scan the 1σ ellipses of its used points in their order, None if they are
    those of the scan; `known`, whether R is that of the tracker; `used`, whether it is known which
    points it used.
    """
    tracker = run.composition.configuration.tracker
    text, covariances, std = uncertainty.tracker_noise(tracker, run.scans)
    known = {"known": getattr(tracker, "kind", "own") != "own", "used": tracker is not None}
    shown, is_own = None, std is None and covariances is not run.scans.covariances_world
    if is_own and run.track is not None:
        rows, scans = run.track.used_points, pairwise(run.track.used_offsets)
        if len(rows) > MOST_OF_NOISE:
            text += "; too many points to show it"
        else:
            shown = [ellipses(covariances[rows[start:stop]]) for start, stop in scans]
    same = None if std is None else round(1000.0 * std)
    return {"text": text, "std": same, "ellipses": shown, **known}


IMAGE_BUDGET = 6_300_000
"""Characters of encoded images on a page. Longer runs show every 2nd, 3rd, … frame."""

MOST_ELLIPSES = 60_000
"""With more points than this, the page shows no standard deviations of points."""

SCRIPTS = ("paths", "map", "camera", "charts", "legend", "time")
"""The files `templates/playback_*.js`, in the order of the page's one function."""


def playback_html(
    runs: Sequence[RunResult], title: str, notes: Sequence[str] = (), folders: Sequence[str] = ()
) -> str:
    """The page of one or more computed runs of one scene; the same runs give the same bytes.

    Their `label` is their name in the legend, and that in `folders`, unless empty, of their folder;
    `notes` are lines below the title.
    """
    scripts = [f"playback_{name}.js" for name in SCRIPTS]
    data = playback_data(runs, title, notes, folders)
    style = ["playback.css"]
    return filled_page(__package__, "playback.html", title, data, style=style, script=scripts)


def playback_data(
    runs: Sequence[RunResult], title: str, notes: Sequence[str] = (), folders: Sequence[str] = ()
) -> dict[str, Any]:
    """The page's data in JSON's types; None for values that are not finite.

    Lengths are whole millimetres and headings 1e-4 rad. Scans and images that several runs share
    are stored once, and each run has their index.
    """
    scans: list[dict[str, Any]] = []
    cameras: list[dict[str, Any]] = []
    played = []
    for i, run in enumerate(runs):
        facts = [("folder", folders[i])] if folders else []
        shared = {
            "scan": _place(scans, _scan(run.scans)),
            "camera": _place(cameras, _camera(run.camera)) if run.camera else None,
        }
        shared["headline"] = headline_of(run) if len(runs) == 1 and run.track else []
        played.append(_run(run, [*facts, *facts_of(run)]) | shared)
    scenario, first = runs[0].scenario, runs[0].track or runs[0].tracks[0].track
    with_truth = bool(scenario.known.any())
    return {
        "title": title,
        "notes": list(notes),
        "times": numbers(scenario.times, 6),
        "ego": rounded_poses(scenario.ego_poses_world),
        "target": rounded_poses(scenario.target_poses_world),
        "contours": [millimetres(contour.ravel()) for contour in scenario.contours_target],
        "limbPoses": scenario.limb_poses.tolist(),
        "known": with_truth,
        "truths": [
            {"name": one.name, "boxes": [millimetres(b.ravel()) for b in one.scenario.boxes_world]}
            for one in runs[0].truths
        ],
        "extent": round(1000.0 * uncertainty.target_radius(first, scenario)),
        "lowOverlap": LOW_OVERLAP,
        "leastOdds": LEAST_ODDS,
        "series": [
            asdict(series) | {"name": name}
            for name, series in SERIES.items()
            if any(np.isfinite(getattr(run.scores, name)).any() for run in runs)
        ],
        "neesBounds": numbers(uncertainty.normalised_chi_square_bounds(np.array([2])).ravel(), 4),
        "runs": played,
        "scans": scans,
        "cameras": cameras,
    }


def _run(run: RunResult, facts: Sequence[tuple[str, str]]) -> dict[str, Any]:
    scores = run.scores
    configuration = run.composition.configuration
    field_of_view, rig = configuration.field_of_view, configuration.rig
    several = [
        {
            "first": one.first,
            "nis": numbers(one.track.normalised_nis, 4),
            "classes": {c: float(p[-1]) for c, p in (one.track.class_probabilities or {}).items()},
            **_track(one.track, run.scans, one.first),
        }
        for one in run.tracks
    ]
    return {
        **({} if run.track is None else _track(run.track, run.scans)),
        "noise": noise_of(run),
        "label": run.label,
        "facts": [list(fact) for fact in facts],
        "fieldOfView": field_of_view and [round(bearing, 6) for bearing in field_of_view],
        "rig": {
            "focal": rig.focal,
            "focalV": rig.focal_v,
            "u0": rig.u0,
            "v0": rig.v0,
            "height": rig.camera_height,
            "pitch": rig.pitch_radians,
        },
        "badges": badges(scores.metrics),
        "origin": origin_of(run),
        "summary": summary_of(scores.metrics),
        "verdict": verdict(scores.metrics),
        "labels": [list(LABEL_COLUMNS), *map(list, label_rows(scores.labels))],
        "errors": {
            name: numbers(series.factor * getattr(scores, name), 4)
            for name, series in SERIES.items()
        },
        "boxes": _boxes(run.objects),
        "tracks": several,
    }


def _track(track: Track, scans: Scans, first: int = 0) -> dict[str, Any]:
    """What the page shows of a track from scan `first` on."""
    used = [
        track.used_points[start:stop] - scans.offsets[first + i]
        for i, (start, stop) in enumerate(pairwise(track.used_offsets))
    ]
    low, high = uncertainty.normalised_chi_square_bounds(track.nis_degrees_of_freedom)
    return {
        "poses": rounded_poses(track.means),
        "centre": ellipses(track.covariances[:, :2, :2]),
        "contours": [millimetres(c.ravel()) for c in track.contours_world],
        "std": [millimetres(row) for row in track.contour_std],
        "used": [rows.tolist() for rows in used],
        "nisBounds": [numbers(low, 3), numbers(high, 3)],
    }


def _boxes(objects: Sequence[Objects]) -> list[list[int]] | None:
    """left, right, top, base (px) of the objects of each frame, in one list; None without any."""
    frames = ((one, i) for one in objects for i in range(len(one.offsets) - 1))
    return [one.boxes[one.rows(i)].ravel().tolist() for one, i in frames] if objects else None


def _scan(scans: Scans) -> dict[str, Any]:
    rows, shown = [scans.rows(k) for k in range(len(scans))], None
    if len(scans.points_world) <= MOST_ELLIPSES:
        shown = [ellipses(scans.covariances_world[these]) for these in rows]
    points = [millimetres(scans.points_world[these].ravel()) or [] for these in rows]
    return {"points": points, "ellipses": shown}


def _camera(chunks: tuple[CameraFrames, ...]) -> dict[str, Any]:
    """Images and stixels of every n-th frame, for the smallest n that keeps to the budget."""
    where = [(chunk, i) for chunk in chunks for i in range(len(chunk.offsets) - 1)]
    images = {
        name: [base64.b64encode(one).decode("ascii") for c in chunks for one in c.images[name]]
        for name in chunks[0].images
    }
    sizes = np.sum([list(map(len, texts)) for texts in images.values()], axis=0)
    every = 1
    while every < len(where) and sizes[::every].sum() > IMAGE_BUDGET:
        every += 1
    shown = where[::every]
    return {
        "width": chunks[0].width,
        "height": chunks[0].height,
        "every": every,
        "frames": [chunk.first + i for chunk, i in shown],
        "images": {name: texts[::every] for name, texts in images.items()},
        "stixels": [_stixels(chunk, i) for chunk, i in shown],
    }


def _stixels(chunk: CameraFrames, index: int) -> list[int]:
    """left, right, top, base (px) and depth (cm) of each stixel, in one list."""
    rows = slice(int(chunk.offsets[index]), int(chunk.offsets[index + 1]))
    depth = np.rint(100.0 * np.clip(np.nan_to_num(chunk.depth[rows]), 0.0, 1e4))
    columns = (chunk.left[rows], chunk.right[rows], chunk.top[rows], chunk.base[rows], depth)
    return np.stack(columns, axis=1).astype(np.int64).ravel().tolist()


def _place(known: list[dict[str, Any]], value: dict[str, Any]) -> int:
    """Index of a value among the known ones; a new value is added to them."""
    if value not in known:
        known.append(value)
    return known.index(value)
