"""RQ3: how do fabricated and simulated measurements differ, and does a fitted noise help?"""

from dataclasses import fields
from typing import TYPE_CHECKING

from stixel_cli.measurements.noise import FittedNoise
from stixel_cli.report.blocks import Material, Table
from stixel_cli.report.statistics import DRAWS
from stixel_cli.report.tables import chosen, names
from stixel_cli.results.reader import listed
from stixel_cli.studies.data import StudyData
from stixel_cli.studies.rq3.answer import answer_values, comparisons_forest
from stixel_cli.studies.rq3.compare import compare, difference_table, noise_table
from stixel_cli.studies.rq3.figures import LEAST_POINTS, RANGE_CLASS, Pools, point_figures
from stixel_cli.studies.rq3.fit import fit_noise, noises_of, preset
from stixel_cli.studies.rq3.runs import (
    FABRICATED,
    FITTED,
    SHARED,
    SIMULATED,
    TRACKER_MEASURES,
    by_noise,
    cost_of,
    cost_table,
    neighbour_columns,
    point_measures,
    runs_of,
)

if TYPE_CHECKING:
    import pandas as pd

TRAINING = "training"
COMMAND = "stixel study rq3"
_PARAMETERS = tuple(field.name for field in fields(FittedNoise) if field.name != "kind")


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


def held_out_noises(training: "pd.DataFrame") -> dict[tuple[str, str], FittedNoise]:
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
    levels = {name: runs_of(part) for name, part in by_noise(data.sweeps[FABRICATED]).items()}
    fabricated = next(iter(by_noise(data.sweeps[FABRICATED]).values()))
    sweeps = {
        SIMULATED: runs_of(data.sweeps[SIMULATED]),
        FABRICATED: next(iter(levels.values())),
        FITTED: runs_of(data.sweeps[FITTED]),
    }
    runs, training = sweeps[SIMULATED], runs_of(data.sweeps[TRAINING])
    noises = {
        user: fit_noise(chosen(training, road_user=user)["errors"].tolist())
        for user in names(training, "road_user")
    }
    pools = _pools(sweeps)
    lag = neighbour_columns([run for pool in pools.values() for run in pool[SIMULATED]])
    points = compare(sweeps, point_measures(lag), by_tracker=False)
    tracks = compare(sweeps, TRACKER_MEASURES, by_tracker=True)
    cost = cost_of(data.sweeps[SIMULATED], fabricated)
    seeds, paths = (len(names(runs, name)) for name in ("seed", "path"))
    test_seeds, fit_seeds = (sorted(names(own, "seed")) for own in (runs, training))
    return Material(
        {
            **answer_values(points, tracks, cost, seeds, paths),
            "users": names(runs, "road_user"),
            "path_names": names(runs, "path"),
            "trackers": names(runs, "tracker"),
            "test_seeds": test_seeds,
            "fit_seeds": fit_seeds,
            "common_seeds": sorted(set(test_seeds) & set(fit_seeds)),
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
            "biases": {user: noise.range_bias for user, noise in noises.items()},
            "fitted_table": Table.of("fitted_noise", _noise_rows(noises)),
            "held_out_table": Table.of("held_out_noise", _held_out_rows(held_out_noises(training))),
            "noise_levels": list(levels),
            "noise_table": noise_table(runs, levels),
            "shared_stages": SHARED,
            "cost_table": cost_table(cost, sweeps),
            "sample_time": runs["run"].iloc[0].configuration.path.sample_time,
        },
        {
            f"noise/fitted_{user}.yaml": preset(noise, _what(training, user), COMMAND)
            for user, noise in noises.items()
        },
    )


def _pools(sweeps: "dict[str, pd.DataFrame]") -> Pools:
    """The errors of each road user and sweep, of one tracker: the others have the same."""
    first = names(sweeps[SIMULATED], "tracker")[0]
    return {
        user: {
            sweep: chosen(runs, road_user=user, tracker=first)["errors"].tolist()
            for sweep, runs in sweeps.items()
        }
        for user in names(sweeps[SIMULATED], "road_user")
    }


def _noise_rows(noises: dict[str, FittedNoise]) -> list[dict]:
    """A row for each parameter, a column for each road user."""
    return [
        {"parameter": key, **{user: getattr(noise, key) for user, noise in noises.items()}}
        for key in _PARAMETERS
    ]


def _held_out_rows(noises: dict[tuple[str, str], FittedNoise]) -> list[dict]:
    """A row for each road user and each path that was left out of the fit."""
    return [
        {
            "fitted to": f"{user}, without {path}",
            **{key: getattr(noise, key) for key in _PARAMETERS},
        }
        for (user, path), noise in noises.items()
    ]


def _what(training: "pd.DataFrame", user: str) -> str:
    """The points that the noise of a road user was fitted to."""
    training = chosen(training, road_user=user)
    points = sum(len(errors.scans) for errors in training["errors"])
    paths, seeds = (listed(names(training, column)) for column in ("path", "seed"))
    return f"{points} simulated points: {user}; paths {paths}; seeds {seeds}"
