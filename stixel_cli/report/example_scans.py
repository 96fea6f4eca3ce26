"""Figures of single scans next to the target, and of the scene that the camera sees."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from stixel_cli.engine.errors import MissingEntry
from stixel_cli.measurements.scans import Scans
from stixel_cli.pictures import style
from stixel_cli.report import tables
from stixel_cli.report.blocks import Figure
from stixel_cli.report.charts import Panel, chart
from stixel_cli.results.result import RunResult
from stixel_cli.scene.scenario import Scenario


def first_runs(*frames: pd.DataFrame) -> dict[str, RunResult]:
    """The first run of each road user and measurement, by their names."""
    return {
        f"{user}, {measurement}": own["run"].iloc[0]
        for frame in frames
        for (user, measurement), own in tables.groups(frame, ["road_user", "measurement"])
    }


def scenes(runs: Mapping[str, RunResult]) -> Figure | None:
    """The middle scan of each run, and the left image if the run has one.

    Runs whose results have left the cache are left out; None if none is left.
    """
    panels = []
    for title, run in runs.items():
        scans, scenario = _stored(run, "scans"), _stored(run, "scenario")
        if scans is None or scenario is None:
            continue
        pairs = _stored(run, "add_sensor_noise") or _stored(run, "pairs") or []
        k = len(scans) // 2
        images = [one.left[k - one.first] for one in pairs if 0 <= k - one.first < len(one)]
        panels.append(Panel(partial(_scan, scenario=scenario, scans=scans), title))
        panels += [Panel(partial(_image, image=image), f"{title}: left image") for image in images]
    return _chart("scenes", panels, 2) if panels else None


def example_scans(name: str, runs: pd.DataFrame) -> Figure:
    """The middle scan of the first seed: one row per measurement, one column per path."""
    panels = [
        Panel(partial(_scan, scenario=run.load("scenario"), scans=run.load("scans")), title)
        for (measurement, path), own in tables.groups(runs, ["measurement", "path"])
        for title, run in [(f"{measurement},\n{path}", own.sort_values("seed")["run"].iloc[0])]
    ]
    return _chart(name, panels, runs["path"].nunique())


def _chart(name: str, panels: Sequence[Panel], columns: int) -> Figure:
    return chart(name, panels, columns, 2.0, settings={"axes.titlesize": 8.0, "axes.grid": False})


def _stored(run: RunResult, stage: str) -> Any:
    """The result of a stage; None if the run has no such stage, or its result left the cache."""
    with suppress(MissingEntry):
        return run.load(stage) if stage in run.planned.graph.stages else None


def _image(axes: Axes, image: np.ndarray) -> None:
    axes.imshow(image, cmap="gray", vmin=0, vmax=255)
    axes.set_axis_off()


def _scan(axes: Axes, scenario: Scenario, scans: Scans) -> None:
    """The middle scan around the target's true contour, with the direction to the sensor."""
    k = len(scans) // 2
    pose = scenario.target_poses_world[k]
    contour = scenario.contour_world(k)
    points = scans.points_world[scans.rows(k)]
    axes.plot(*np.vstack([contour, contour[:1]]).T, color=style.TRUTH, linewidth=1.0)
    sensor = scans.sensor_poses_world[k, :2] - pose[:2]
    reach = 0.75 * np.ptp(contour, axis=0).max() + 0.5
    towards = pose[:2] + reach * sensor / np.hypot(*sensor)
    axes.plot(*np.stack([pose[:2], towards]).T, color=style.UNUSED, linewidth=0.8, linestyle="--")
    axes.plot(*points.T, ".", color=style.USED, markersize=3.5)
    axes.set_aspect("equal")
    axes.set_xlim(pose[0] - reach, pose[0] + reach)
    axes.set_ylim(pose[1] - reach, pose[1] + reach)
