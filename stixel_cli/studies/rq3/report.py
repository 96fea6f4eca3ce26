"""RQ3: how do fabricated and simulated measurements differ, and does a fitted noise help?"""

from dataclasses import asdict, fields, replace
from typing import Any

import pandas as pd

from stixel_cli.measurements.noise import ConstantNoise, FittedNoise, Noise, StereoNoise
from stixel_cli.report.blocks import Material, Table
from stixel_cli.report.bootstrap import DRAWS
from stixel_cli.report.cost import SHARED, cost_of, cost_table
from stixel_cli.report.metrics import quantity
from stixel_cli.report.tables import chosen, names
from stixel_cli.results.reader import listed
from stixel_cli.results.result import RunResult
from stixel_cli.studies.data import StudyData
from stixel_cli.studies.rq3.answer import answer_values
from stixel_cli.studies.rq3.compare import (
    compare,
    comparisons_forest,
    difference_table,
    noise_rows,
)
from stixel_cli.studies.rq3.figures import LEAST_POINTS, RANGE_CLASS, Pools, point_figures
from stixel_cli.studies.rq3.measures import (
    FABRICATED,
    FITTED,
    POINT_MEASURES,
    SIMULATED,
    TRACKER_MEASURES,
    point_values,
    runs_of,
    tracker_values,
)
from stixel_cli.sweeps.results import SweepResult
from stixel_cli.validation.noise_fit import fit_noise
from stixel_cli.validation.point_statistics import neighbour_columns

TRAINING = "training"
COMMAND = "stixel study rq3"
_PARAMETERS = tuple(field.name for field in fields(FittedNoise) if field.name != "kind")
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


def fitted_noise(data: StudyData) -> list[dict[str, list]]:
    """The axis of the fitted sweep: road user and path, with a noise fitted to the other paths."""
    noises = held_out_noises(runs_of(data.sweeps[TRAINING]))
    axis: dict[str, list] = {
        "road_user": [user for user, _ in noises],
        "path": [path for _, path in noises],
    }
    for key in _PARAMETERS:
        axis[f"measurement.noise.{key}"] = [getattr(noise, key) for noise in noises.values()]
    return [axis]


def held_out_noises(training: pd.DataFrame) -> dict[tuple[str, str], FittedNoise]:
    """Road user and path to the noise fitted to the user's runs on all other paths.

    Seeds of one path share their images except for the sensor's noise, so other seeds are not
    enough to test a fit. With only one path, the noise is fitted to that path.
    """
    found = {}
    for user in names(training, "road_user"):
        own = chosen(training, road_user=user)
        for path in names(own, "path"):
            others = own[own["path"] != path]
            found[user, path] = fit_noise((own if others.empty else others)["errors"].tolist())
    return found


def report(data: StudyData) -> Material:
    """Values, tables and figures of the template; all runs have the result `point_errors`."""
    # Of several noise values, the first is compared in full.
    parts = _by_noise(data.sweeps[FABRICATED])
    fabricated, levels = next(iter(parts.values())), {n: runs_of(own) for n, own in parts.items()}
    sweeps = {
        SIMULATED: runs_of(data.sweeps[SIMULATED]),
        FABRICATED: next(iter(levels.values())),
        FITTED: runs_of(data.sweeps[FITTED]),
    }
    runs, pools = sweeps[SIMULATED], _pools(sweeps)
    lag = neighbour_columns([run for pool in pools.values() for run in pool[SIMULATED]])
    points = compare({n: point_values(own, lag) for n, own in sweeps.items()}, POINT_MEASURES)
    tracks = compare({n: tracker_values(own) for n, own in sweeps.items()}, TRACKER_MEASURES)
    by_level = {name: tracker_values(own) for name, own in levels.items()}
    cost = cost_of(simulated=data.sweeps[SIMULATED].runs, fabricated=fabricated.runs)
    training = runs_of(data.sweeps[TRAINING])
    noise_values, presets = _fitted(training, sorted(names(runs, "seed")))
    seeds, paths = (len(names(runs, name)) for name in ("seed", "path"))
    values = {
        **answer_values(points, tracks, cost, seeds, paths),
        **noise_values,
        "users": names(runs, "road_user"),
        "path_names": names(runs, "path"),
        "trackers": names(runs, "tracker"),
        "noises": noises_of(fabricated),
        "lag": f"{lag:.2g}",
        "draws": DRAWS,
        "range_class": f"{RANGE_CLASS:g}",
        "least_points": LEAST_POINTS,
        "target_points": {
            name: sum(len(run.scans) for pool in pools.values() for run in pool[name])
            for name in sweeps
        },
        "figures": {
            **point_figures(pools),
            "trackers": comparisons_forest("tracker_differences", tracks, (FABRICATED, FITTED)),
        },
        "point_table": difference_table("point_differences", points),
        "tracker_table": difference_table("tracker_differences", tracks),
        "noise_levels": list(levels),
        "noise_table": Table.of("noise_levels", noise_rows(tracker_values(runs), by_level)),
        "shared_stages": SHARED,
        "cost_table": cost_table(cost, {kind: sweeps[kind] for kind in (SIMULATED, FABRICATED)}),
        "sample_time": runs["run"].iloc[0].configuration.path.sample_time,
    }
    return Material(values, presets)


def _by_noise(sweep: SweepResult) -> dict[str, SweepResult]:
    """The values of the swept keys of the measurement, to the part of the sweep that has them.

    Without such a key there is one part, and its name is empty.
    """
    parts: dict[str, list[RunResult]] = {}
    for run in sweep.runs:
        keys = [key for key in run.setting if key.startswith("measurement")]
        parts.setdefault(", ".join(f"{key}={run.setting[key]}" for key in keys), []).append(run)
    return {name: replace(sweep, runs=tuple(runs)) for name, runs in parts.items()}


def _pools(sweeps: dict[str, pd.DataFrame]) -> Pools:
    """The errors of each road user and sweep, of one tracker: the others have the same."""
    first = names(sweeps[SIMULATED], "tracker")[0]
    return {
        user: {
            sweep: chosen(runs, road_user=user, tracker=first)["errors"].tolist()
            for sweep, runs in sweeps.items()
        }
        for user in names(sweeps[SIMULATED], "road_user")
    }


def _fitted(training: pd.DataFrame, test_seeds: list[int]) -> tuple[dict[str, Any], dict[str, str]]:
    """The template's values on the fitted noises, and their presets by file."""
    users, fit_seeds = names(training, "road_user"), sorted(names(training, "seed"))
    errors = {user: chosen(training, road_user=user)["errors"].tolist() for user in users}
    noises = {user: fit_noise(own) for user, own in errors.items()}
    by_parameter = (
        {"parameter": key, **{user: getattr(noise, key) for user, noise in noises.items()}}
        for key in _PARAMETERS
    )
    held_out = (
        {"fitted to": f"{user}, without {path}"} | {key: getattr(own, key) for key in _PARAMETERS}
        for (user, path), own in held_out_noises(training).items()
    )
    values = {
        "test_seeds": test_seeds,
        "fit_seeds": fit_seeds,
        "common_seeds": sorted(set(test_seeds) & set(fit_seeds)),
        "biases": {user: noise.range_bias for user, noise in noises.items()},
        "fitted_table": Table.of("fitted_noise", by_parameter),
        "held_out_table": Table.of("held_out_noise", held_out),
    }
    presets = {}
    for user, noise in noises.items():
        points = sum(len(own.scans) for own in errors[user])
        own = chosen(training, road_user=user)
        paths, seeds = (listed(names(own, column)) for column in ("path", "seed"))
        what = f"{points} simulated points: {user}; paths {paths}; seeds {seeds}"
        presets[f"noise/fitted_{user}.yaml"] = preset(noise, what, COMMAND)
    return values, presets


def preset(noise: FittedNoise, what: str, command: str) -> str:
    """The text of a file of `conf/measurement/noise/` with this noise, and where it comes from."""
    lines = [f"# Fitted to {what}.", f"# Made by: {command}"]
    for name, value in asdict(noise).items():
        lines.append(f"{name}: {value}" + (f" # {_UNITS[name]}" if name in _UNITS else ""))
    return "\n".join(lines) + "\n"


def noises_of(sweep: SweepResult) -> list[str]:
    """What noise the fabricated runs of a sweep have along the ray, as prose has it."""
    return list(dict.fromkeys(_told(p.configuration.measurement.noise) for p in sweep.runs))


def _told(noise: Noise) -> str:
    match noise:
        case StereoNoise(disparity_std=std):
            return f"white noise of the disparity ({quantity(std, 'px')})"
        case ConstantNoise(range_std=std):
            return f"white noise of the range ({quantity(std, 'm')})"
        case _:
            return "a fitted noise"
