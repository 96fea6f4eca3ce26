"""RQ1: what it takes to set up a scene, and stixels of several widths, judged by the tracker."""

import dataclasses
import re
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
import pandas as pd

from stixel_cli.config.folders import shipped_folder
from stixel_cli.config.schema import Configuration
from stixel_cli.evaluation.evaluate import evaluate
from stixel_cli.measurements.scans import Scans
from stixel_cli.rendering.surfaces import build_surfaces
from stixel_cli.report.blocks import Cell, Table
from stixel_cli.report.cost import seconds_frame
from stixel_cli.report.statistics import Statistic, statistic
from stixel_cli.report.tables import ends, spread
from stixel_cli.results.result import RunResult
from stixel_cli.scene.mesh import Mesh
from stixel_cli.scene.road_user import road_user_meshes
from stixel_cli.scene.world import world_objects
from stixel_cli.studies.data import StudyData
from stixel_cli.studies.rq1.errors import grid, matcher, rig, road_user
from stixel_cli.sweeps.results import SweepResult
from stixel_cli.tracking import gp_ekf

SCENE = ("road_user", "path", "ego", "rig", "world", "renderer", "sensor")
"""The groups of the configuration that describe a scene and its cameras."""
STAGES = {
    "render": "render",
    "add_sensor_noise": "sensor noise",
    "match": "match",
    "free_space": "free space",
    "stixels": "stixels",
}
"""Stages with their recorded CPU time, and their labels."""


def setup_values(data: StudyData) -> dict[str, Any]:
    """The template's values on setting up a scene.

    The time to build the meshes is measured here, on this machine.
    """
    runs = data.sweeps["ranges"].runs
    first = runs[0].configuration
    built = {"street": timed_building(lambda: [item.mesh for item in world_objects(first.world)])}
    users = {road_user(run): run.configuration.road_user for run in reversed(runs)}
    for label, user in reversed(users.items()):
        built[label] = timed_building(lambda user=user: road_user_meshes(user)[:1])
    return {
        "street_seconds": built["street"]["CPU seconds"],
        "render_seconds": seconds_a_frame(runs)["render"],
        "values_of_a_scene": values_of(first),
        "study_lines": _lines_of(data.name),
        "building_table": Table.of("building", ({"what": w} | own for w, own in built.items())),
        "seconds_table": Table.of("seconds", _seconds(data)),
    }


def timed_building(meshes: Callable[[], Iterable[Mesh]]) -> dict[str, Cell]:
    """CPU seconds, on one thread, to build meshes and the surfaces that rays meet; triangles."""
    start = time.thread_time()
    made = list(meshes())
    build_surfaces([(1, mesh) for mesh in made])
    cpu_seconds = time.thread_time() - start
    triangles = sum(len(part.triangles) for mesh in made for part in mesh.parts)
    return {"CPU seconds": cpu_seconds, "triangles": triangles}


def values_of(configuration: Configuration) -> int:
    """Number of values in the groups of the configuration that describe a scene."""

    def leaves(value) -> int:
        if dataclasses.is_dataclass(value):
            return sum(leaves(getattr(value, f.name)) for f in dataclasses.fields(value))
        return 1

    return sum(leaves(getattr(configuration, group)) for group in SCENE)


def seconds_a_frame(runs: Iterable[RunResult]) -> dict[str, float | None]:
    """Mean recorded CPU seconds of each of `STAGES` per frame; None if no run has any."""
    return {
        stage: statistic("", own).mean for stage, own in seconds_frame(list(runs), STAGES).items()
    }


def _seconds(data: StudyData) -> Iterator[dict[str, Cell]]:
    for name, label in (("rigs", rig), ("matchers", matcher), ("grids", grid)):
        runs = data.sweeps[name].runs if name in data.sweeps else ()
        for setting in dict.fromkeys(map(label, runs)):
            seconds = seconds_a_frame(run for run in runs if label(run) == setting)
            yield {"sweep": name, "setting": setting} | {STAGES[s]: v for s, v in seconds.items()}


def _lines_of(study: str) -> int:
    """Lines of a shipped study's file without comments and empty lines; 0 if it is not shipped."""
    path = shipped_folder("pipelines") / "studies" / f"{study}.yaml"
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    return len(re.findall(r"^ *[^ #\n]", text, re.MULTILINE))


def width_values(sweep: SweepResult) -> dict[str, dict[str, Statistic]]:
    """Label of a width to its statistics over the seeds: `iou`, `nees`, `points`, `bias`, `std`.

    The widths as they are; then the narrowest, with so few of its points that a scan has about as
    many as with the widest: every m-th in order of the bearing. `bias` and `std` are those of the
    points along the ray, m.
    """
    by_width: dict[int, list[RunResult]] = {}
    for run in sorted(sweep.runs, key=lambda run: run.configuration.extraction.width):
        by_width.setdefault(run.configuration.extraction.width, []).append(run)
    found = {f"{width} px": _statistics(runs, 1) for width, runs in by_width.items()}
    least, step = min(by_width), round(max(by_width) / min(by_width))
    if step > 1:
        found[f"{least} px, one point of {step}"] = _statistics(by_width[least], step)
    return found


def _statistics(runs: list[RunResult], step: int) -> dict[str, Statistic]:
    """Statistics of the runs' results with every `step`-th point."""
    rows = []
    for run in runs:
        errors, metrics, scans = run.load("point_errors"), run.metrics, run.load("scans")
        if step > 1:
            scans = every(scans, step)
            tracker, prior = run.configuration.tracker, run.configuration.prior
            track = gp_ekf.track(scans, run.load("start"), prior, tracker)
            metrics = evaluate(track, run.load("scenario"), scans).metrics
        rows.append(
            {
                "points": float(np.diff(scans.offsets).mean()),
                "bias": float(errors.along.mean()) if len(errors.along) else None,
                "std": float(errors.along.std()) if len(errors.along) else None,
                "iou": metrics["iou_mean"],
                "nees": metrics["nees_position_mean"],
            }
        )
    return {name: statistic("", values) for name, values in pd.DataFrame(rows).items()}


def every(scans: Scans, step: int) -> Scans:
    """The scans with every `step`-th point, in order of the bearing from the sensor."""
    kept = []
    for k, pose in enumerate(scans.sensor_poses_world):
        rows = scans.rows(k)
        points, covariances = scans.points_world[rows], scans.covariances_world[rows]
        away = points - pose[:2]
        order = np.argsort(np.arctan2(away[:, 1], away[:, 0]), kind="stable")[step // 2 :: step]
        kept.append((points[order], covariances[order]))
    return Scans.of_each(
        scans.times, scans.sensor_poses_world, kept, field_of_view=scans.field_of_view
    )


def width_table(values: dict[str, dict[str, Statistic]]) -> Table:
    """One row for each width of `width_values`."""
    return Table.of(
        "widths",
        (
            {
                "width": label,
                "points a scan": own["points"].mean,
                "bias along the ray (m)": own["bias"].mean,
                **spread("std along the ray (m)", own["std"]),
                "n": own["iou"].n,
                **ends("mean IoU", own["iou"]),
                **ends("mean NEES / 2", own["nees"]),
            }
            for label, own in values.items()
        ),
    )
