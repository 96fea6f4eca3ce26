"""`stixel study rq3`: statistics of the points, and the noise that is fitted to them."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np
import pandas as pd

from stixel_cli.answers.runs import Runs
from stixel_cli.measurements.rays import FittedNoise
from stixel_cli.results.result import RunResult, listed
from stixel_cli.studies.report import Material, StudyData, frame_of, with_columns
from stixel_cli.validation.point_errors import PointErrors
from stixel_cli.validation.point_statistics import fit_noise, neighbour_columns, point_statistics

TRAINING = "training"
POINTS = {
    "bias_along": "bias_along_the_ray_m",
    "std": "std_along_the_ray_m",
    "bias_disparity": "disparity_bias_px",
    "std_disparity": "disparity_std_px",
    "neighbours": "correlation_of_neighbours",
    "scans": "correlation_of_successive_scans",
    "reach": "reach_beyond_the_silhouette_px",
    "missed": "missed_columns_share",
    "points": "points_per_scan",
    "clutter": "clutter_points_per_scan",
}
"""Statistic of a run's points to its column."""
_UNITS = {
    "columns_per_point": "columns",
    "range_bias": "m",
    "disparity_std": "px",
    "correlation_columns": "columns",
    "edge_metres": "m",
    "edge_metres_std": "m",
    "edge_disparity_std": "px",
    "missed_share": "of the points",
    "missed_columns": "columns",
}
"""Of all parameters of the noise."""


def fitted_noise(data: StudyData) -> list[dict[str, list]]:
    """The axis of the fitted sweep: road user and path, with a noise fitted to the other paths."""
    noises = held_out_noises(_errors(data))
    axis: dict[str, list] = {
        "road_user": [user for user, _ in noises],
        "path": [path for _, path in noises],
    }
    for key in _UNITS:
        axis[f"measurement.noise.{key}"] = [getattr(noise, key) for noise in noises.values()]
    return [axis]


def held_out_noises(
    errors: Mapping[tuple[str, str], Sequence[PointErrors]],
) -> dict[tuple[str, str], FittedNoise]:
    """Road user and path to the noise fitted to the user's runs on all other paths.

    Seeds of one path share their images except for the sensor's noise, so other seeds are not
    enough to test a fit. With only one path, the noise is fitted to that path.
    """
    found = {}
    for user, path in errors:
        others = [one for (u, p), own in errors.items() if u == user and p != path for one in own]
        found[user, path] = fit_noise(others or [*errors[user, path]])
    return found


def columns(name: str, runs: Runs, results: Sequence[RunResult]) -> Runs:
    """The runs with the statistics of their points; runs of several trackers share them."""
    loaded: dict[tuple, PointErrors] = {}
    keys = list(zip(*(runs.frame[c] for c in ("road_user", "path", "seed")), strict=True))
    for key, run in zip(keys, results, strict=True):
        if key not in loaded:
            loaded[key] = run.load("point_errors")
    lag = neighbour_columns(list(loaded.values()))
    found = {key: point_statistics(errors, lag) for key, errors in loaded.items()}
    axes = tuple(axis for axis in runs.axes if not axis.startswith("measurement"))
    statistics = {
        column: np.array([found[key][statistic] for key in keys], dtype=np.float64)
        for statistic, column in POINTS.items()
    }
    return with_columns(Runs(runs.frame, axes), **statistics)


def material(data: StudyData) -> Material:
    """The fitted noises: a table, those of each held-out path, and their presets as files."""
    errors = _errors(data)
    users = list(dict.fromkeys(user for user, _ in errors))
    by_user = {
        u: [one for (user, _), own in errors.items() if user == u for one in own] for u in users
    }
    noises = {user: fit_noise(own) for user, own in by_user.items()}
    rows = [{"parameter": key, **{u: getattr(noises[u], key) for u in users}} for key in _UNITS]
    held_out = [
        {"fitted to": f"{user}, without {path}", **{k: getattr(own, k) for k in _UNITS}}
        for (user, path), own in held_out_noises(errors).items()
    ]
    seeds = sorted({run.seed for run in data.sweeps[TRAINING].runs})
    files = {}
    for user, noise in noises.items():
        points = sum(len(own.scans) for own in by_user[user])
        paths = listed([path for u, path in errors if u == user])
        what = f"{points} simulated points: {user}; paths {paths}; seeds {listed(seeds)}"
        files[f"noise/fitted_{user}.yaml"] = preset(noise, what)
    tables = {"Fitted noise": rows, "Noise of held-out paths": held_out}
    return Material({name: pd.DataFrame(own) for name, own in tables.items()}, files)


def _errors(data: StudyData) -> dict[tuple[str, str], list[PointErrors]]:
    """Road user and path to the errors of the training runs' points."""
    sweep = data.sweeps[TRAINING]
    frame = frame_of(sweep).frame
    found: dict[tuple[str, str], list[PointErrors]] = {}
    keys = zip(frame["road_user"], frame["path"], strict=True)
    for key, run in zip(keys, sweep.runs, strict=True):
        found.setdefault(key, []).append(run.load("point_errors"))
    return found


def preset(noise: FittedNoise, what: str, command: str = "stixel study rq3") -> str:
    """The text of a file of `conf/measurement/noise/` with this noise, and where it comes from."""
    lines = [f"# Fitted to {what}.", f"# Made by: {command}"]
    for name, value in asdict(noise).items():
        lines.append(f"{name}: {value}" + (f" # {_UNITS[name]}" if name in _UNITS else ""))
    return "\n".join(lines) + "\n"
