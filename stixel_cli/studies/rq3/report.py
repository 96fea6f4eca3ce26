"""RQ3: how do fabricated and simulated measurements differ, and does a fitted noise help?"""

from collections.abc import Sequence
from dataclasses import asdict, fields, replace
from typing import Any

import numpy as np
import pandas as pd

from stixel_cli.measurements.noise import ConstantNoise, FittedNoise, StereoNoise
from stixel_cli.report.blocks import Material, Table
from stixel_cli.report.cost import SHARED, cost_of, cost_table
from stixel_cli.report.example_scans import scenes
from stixel_cli.report.intervals import DRAWS
from stixel_cli.report.metrics import listed_by_user, quantity
from stixel_cli.report.statistics import SIGNIFICANT, Paired, excludes_zero
from stixel_cli.report.tables import chosen, names
from stixel_cli.results.reader import listed
from stixel_cli.results.result import RunResult
from stixel_cli.studies.data import StudyData
from stixel_cli.studies.rq3.compare import (
    DECADES,
    FABRICATED,
    FITTED,
    SIMULATED,
    TRACKER_MEASURES,
    Comparison,
    compare,
    comparisons_forest,
    difference_table,
    noise_rows,
    reach_of,
    tracker_values,
)
from stixel_cli.studies.rq3.points import (
    LEAST_POINTS,
    POINT_MEASURES,
    RANGE_CLASS,
    point_figures,
    point_values,
    pools_of,
    runs_of,
)
from stixel_cli.sweeps.results import SweepResult
from stixel_cli.validation.point_statistics import fit_noise, neighbour_columns

_LED_BY = (
    "bias along the ray",
    "correlation of neighbours",
    "share of the target's columns without a point",
)
"""Measures of the points in the answer's text."""
_LED_BY_OF_TRACKS = ("centre RMSE", "orientation RMSE", "mean IoU")
THESIS = 60.0
"""The thesis states that simulated scans take more than this many times as long."""
LEAD = "centre RMSE"
"""The measure of the answer's first sentences."""
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
    runs, pools = sweeps[SIMULATED], pools_of(sweeps)
    lag = neighbour_columns([run for pool in pools.values() for run in pool[SIMULATED]])
    points = compare({n: point_values(own, lag) for n, own in sweeps.items()}, POINT_MEASURES)
    tracks = compare({n: tracker_values(own) for n, own in sweeps.items()}, TRACKER_MEASURES)
    by_level = {name: tracker_values(own) for name, own in levels.items()}
    cost = cost_of(simulated=data.sweeps[SIMULATED].runs, fabricated=fabricated.runs)
    training = runs_of(data.sweeps[TRAINING])
    noise_values, presets = _fitted(training, sorted(names(runs, "seed")))
    values = {
        "scenes": scenes({kind: data.sweeps[kind].runs[0] for kind in sweeps}),
        **answer_values(points, tracks),
        "cost": cost,
        "seeds": len(names(runs, "seed")),
        "paths": len(names(runs, "path")),
        **noise_values,
        "users": names(runs, "road_user"),
        "path_names": names(runs, "path"),
        "trackers": names(runs, "tracker"),
        "noises": list(dict.fromkeys(map(_noise_of, fabricated.runs))),
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


def answer_values(points: Sequence[Comparison], tracks: Sequence[Comparison]) -> dict[str, Any]:
    """What the template's answer says of the two families of comparisons.

    `leads`: the comparisons of `LEAD`, `headlines`: their differences by tracker; `forest`: the
    plot of the trackers' differences. `effects`: owner (points or a tracker) to road user to label,
    unit and paired difference. `few`: the families without any possibly significant test.
    `points_test`, `tracker_tests`: results of the other families' tests. `closed`: fraction of the
    gaps that the fitted noise closes.
    """
    families = {"points": points, "trackers": tracks}
    reaches = {name: reach_of(found) for name, found in families.items()}
    by_tracker: dict[str, list[Comparison]] = {}
    for one in tracks:
        by_tracker.setdefault(one.tracker, []).append(one)
    led = [one for one in tracks if one.measure.label in _LED_BY_OF_TRACKS]
    points_test = {
        "comparisons": len(points),
        "shown": sum(one.differs(FABRICATED) for one in points),
        "tests": reaches["points"].tests,
    }
    tracker_tests = {tracker: _verdict(own) for tracker, own in by_tracker.items()}
    return {
        "leads": [one for one in tracks if one.measure.label == LEAD],
        "headlines": {
            tracker: [
                (one.road_user, "", one.apart[FABRICATED])
                for one in own
                if one.measure.label == LEAD
            ]
            for tracker, own in by_tracker.items()
        },
        "forest": comparisons_forest("answer_forest", led, (FABRICATED,)),
        "effects": {
            "points": _effects(points, _LED_BY),
            **{tracker: _effects(own, _LED_BY_OF_TRACKS) for tracker, own in by_tracker.items()},
        },
        "few": {name: reach for name, reach in reaches.items() if not reach.enough},
        "significant": SIGNIFICANT,
        "points_test": points_test if reaches["points"].enough else None,
        "tracker_tests": tracker_tests if reaches["trackers"].enough else {},
        "closed": [_closed(name, own, reaches[name].enough) for name, own in families.items()],
        "thesis": THESIS,
    }


def _effects(
    found: Sequence[Comparison], labels: Sequence[str]
) -> dict[str, list[tuple[str, str, Paired]]]:
    """Road user to label, unit and paired difference of fabricated minus simulated."""
    effects: dict[str, list[tuple[str, str, Paired]]] = {one.road_user: [] for one in found}
    for label in labels:
        for one in found:
            if one.measure.label == label:
                effects[one.road_user].append((label, one.measure.unit, one.apart[FABRICATED]))
    return effects


def _verdict(found: Sequence[Comparison]) -> dict[str, str]:
    """The road users and measures whose difference is shown, leaning or not shown."""
    sorts: dict[str, list[tuple[str, str]]] = {"shown": [], "leaning": [], "alike": []}
    for one in found:
        leaning = "leaning" if excludes_zero(one.apart[FABRICATED]) else "alike"
        label = one.measure.label.removeprefix(DECADES).partition(" / ")[0]
        label = label.removeprefix("mean ").removesuffix(" RMSE").replace(", ", " of the ")
        sorts["shown" if one.differs(FABRICATED) else leaning].append((one.road_user, label))
    return {name: listed_by_user(own) for name, own in sorts.items()}


def _closed(owner: str, found: Sequence[Comparison], tested: bool) -> dict[str, Any]:
    """Fraction of a family's gaps that the fitted noise closes, and the remaining gaps."""
    known = [one for one in found if one.closed.mean is not None]
    gaps = [one for one in known if one.differs(FABRICATED)] if tested else known
    certain = [one.closed for one in gaps if one.closed.low is not None]
    return {
        "owner": owner,
        "tested": tested,
        "gaps": len(gaps),
        "share": float(np.median([one.closed.mean for one in gaps])) if gaps else None,
        "certain": len(certain),
        "narrowed": sum(one.low > 0.0 for one in certain),
        "widened": sum(one.high < 0.0 for one in certain),
        "comparisons": len(found),
        "apart": sum(excludes_zero(one.apart[FITTED]) for one in found),
        "left": sum(one.differs(FITTED) for one in found),
    }


def _by_noise(sweep: SweepResult) -> dict[str, SweepResult]:
    """The values of the swept keys of the measurement, to the part of the sweep that has them.

    Without such a key there is one part, and its name is empty.
    """
    parts: dict[str, list[RunResult]] = {}
    for run in sweep.runs:
        keys = [key for key in run.setting if key.startswith("measurement")]
        parts.setdefault(", ".join(f"{key}={run.setting[key]}" for key in keys), []).append(run)
    return {name: replace(sweep, runs=tuple(runs)) for name, runs in parts.items()}


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


def _noise_of(run: RunResult) -> str:
    """What noise a fabricated run has along the ray, as prose has it."""
    match run.configuration.measurement.noise:
        case StereoNoise(disparity_std=std):
            return f"white noise of the disparity ({quantity(std, 'px')})"
        case ConstantNoise(range_std=std):
            return f"white noise of the range ({quantity(std, 'm')})"
        case _:
            return "a fitted noise"
