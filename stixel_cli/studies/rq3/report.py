"""RQ3: how do fabricated and simulated measurements differ, and does a fitted noise help?"""

from dataclasses import asdict

from stixel_cli.measurements.noise import FittedNoise
from stixel_cli.results.text import listed
from stixel_cli.studies.inference import DRAWS
from stixel_cli.studies.rq3.answer import answer_table, answer_values
from stixel_cli.studies.rq3.compare import compare, difference_table
from stixel_cli.studies.rq3.cost import SHARED, cost_of, cost_table
from stixel_cli.studies.rq3.figures import (
    Pools,
    edges,
    error_histograms,
    neighbours,
    range_law,
    tracker_differences,
)
from stixel_cli.studies.rq3.fit import fit_noise, noises_of, preset
from stixel_cli.studies.rq3.runs import (
    FABRICATED,
    FITTED,
    SIMULATED,
    TRACKER_MEASURES,
    Errors,
    Runs,
    names,
    neighbour_columns,
    point_measures,
    runs_of,
)
from stixel_cli.studies.types import Material, StudyData, StudySweep, Table

TRAINING = "training"
COMMAND = "stixel study rq3"


def fitted_noise(data: StudyData) -> list[dict[str, list]]:
    """The axis of the fitted sweep: road user and path, with a noise fitted to the other paths."""
    noises = held_out_noises(data.sweeps[TRAINING])
    keys = [name for name in asdict(next(iter(noises.values()))) if name != "kind"]
    axis: dict[str, list] = {
        "road_user": [user for user, _ in noises],
        "path": [path for _, path in noises],
    }
    for key in keys:
        axis[f"measurement.noise.{key}"] = [getattr(noise, key) for noise in noises.values()]
    return [axis]


def held_out_noises(training: StudySweep) -> dict[tuple[str, str], FittedNoise]:
    """Road user and path to the noise fitted to the user's runs on all other paths.

    Seeds share their images but for the sensor's noise, so other seeds of one path would be no test
    of a fit. With only one path, the noise is fitted to that path.
    """
    runs = runs_of(training)
    found = {}
    for user in names(runs, "road_user"):
        own = {key: point for key, point in runs.items() if key.road_user == user}
        for path in names(own, "path"):
            others = [point for key, point in own.items() if key.path != path]
            used = others or list(own.values())
            found[user, path] = fit_noise([point.load("point_errors") for point in used])
    return found


def fitted_noises(training: StudySweep) -> dict[str, FittedNoise]:
    """Road user to the noise that is fitted to all of its runs."""
    runs = runs_of(training)
    return {
        user: fit_noise(
            [point.load("point_errors") for key, point in runs.items() if key.road_user == user]
        )
        for user in names(runs, "road_user")
    }


def report(data: StudyData) -> Material:
    """What the template is filled with; all points have their `point_errors`."""
    sweeps = {name: runs_of(data.sweeps[name]) for name in (SIMULATED, FABRICATED, FITTED)}
    noises = fitted_noises(data.sweeps[TRAINING])
    pools = _pools(sweeps)
    lag = neighbour_columns([run for pool in pools.values() for run in pool[SIMULATED]])
    points = compare(sweeps, point_measures(lag), by_tracker=False)
    tracks = compare(sweeps, TRACKER_MEASURES, by_tracker=True)
    cost = cost_of(data.sweeps[SIMULATED], data.sweeps[FABRICATED])
    seeds, paths = (len(names(sweeps[SIMULATED], name)) for name in ("seed", "path"))
    runs, training = sweeps[SIMULATED], runs_of(data.sweeps[TRAINING])
    test_seeds, fit_seeds = (sorted(names(own, "seed")) for own in (runs, training))
    return Material(
        {
            **answer_values(points, tracks, cost, seeds, paths),
            "answer_table": answer_table(points, tracks),
            "users": names(runs, "road_user"),
            "path_names": names(runs, "path"),
            "trackers": names(runs, "tracker"),
            "test_seeds": test_seeds,
            "fit_seeds": fit_seeds,
            "common_seeds": sorted(set(test_seeds) & set(fit_seeds)),
            "noises": noises_of(data.sweeps[FABRICATED]),
            "lag": f"{lag:.2g}",
            "draws": DRAWS,
            "target_points": {
                name: sum(len(run.scans) for pool in pools.values() for run in pool[name])
                for name in sweeps
            },
            "figures": {
                "errors": error_histograms(pools),
                "range": range_law(pools),
                "neighbours": neighbours(pools),
                "edges": edges(pools),
                "trackers": tracker_differences(tracks),
            },
            "point_table": difference_table("point_differences", points),
            "tracker_table": difference_table("tracker_differences", tracks),
            "biases": {user: noise.range_bias for user, noise in noises.items()},
            "fitted_table": _noise_table("fitted_noise", noises),
            "held_out_table": _held_out_table(held_out_noises(data.sweeps[TRAINING])),
            "shared_stages": SHARED,
            "cost_table": cost_table(cost),
        },
        {
            f"noise/fitted_{user}.yaml": preset(noise, _what(data, user), COMMAND)
            for user, noise in noises.items()
        },
    )


def _pools(sweeps: dict[str, Runs]) -> Pools:
    errors = Errors()
    pools: dict[str, dict[str, list]] = {}
    for user in names(sweeps[SIMULATED], "road_user"):
        pools[user] = {}
        for sweep, runs in sweeps.items():
            # Trackers share the scans: one is enough.
            own = [key for key in runs if key.road_user == user]
            own = [key for key in own if key.tracker == own[0].tracker]
            pools[user][sweep] = [errors.of(sweep, runs[key]) for key in own]
    return pools


def _noise_table(name: str, noises: dict[str, FittedNoise]) -> Table:
    """A row for each parameter, a column for each road user."""
    keys = [key for key in asdict(next(iter(noises.values()))) if key != "kind"]
    rows = tuple((key, *(getattr(noise, key) for noise in noises.values())) for key in keys)
    return Table(name, "", ("parameter", *noises), rows)


def _held_out_table(noises: dict[tuple[str, str], FittedNoise]) -> Table:
    """A row for each road user and path that was left out of the fit."""
    keys = [key for key in asdict(next(iter(noises.values()))) if key != "kind"]
    rows = tuple(
        (f"{user}, without {path}", *(getattr(noise, key) for key in keys))
        for (user, path), noise in noises.items()
    )
    return Table("held_out_noise", "", ("fitted to", *keys), rows)


def _what(data: StudyData, user: str) -> str:
    runs = runs_of(data.sweeps[TRAINING])
    own = [key for key in runs if key.road_user == user]
    points = sum(len(runs[key].load("point_errors").scans) for key in own)
    paths = listed(list(dict.fromkeys(key.path for key in own)))
    seeds = listed(list(dict.fromkeys(key.seed for key in own)))
    return f"{points} simulated points: {user}; paths {paths}; seeds {seeds}"
