"""RQ3: how far are fabricated measurements from simulated ones, and can a fitted noise mend it?"""

from collections.abc import Sequence
from dataclasses import asdict

from stixel_cli.measurements.noise import FittedNoise
from stixel_cli.results.text import listed
from stixel_cli.studies.inference import DRAWS, SIGNIFICANT
from stixel_cli.studies.prose import quantity
from stixel_cli.studies.rq3.answer import answer, answer_table
from stixel_cli.studies.rq3.compare import Comparison, compare, difference_table
from stixel_cli.studies.rq3.cost import cost_of, cost_section
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
from stixel_cli.studies.types import Material, Paragraph, Section, StudyData, StudySweep, Table

TRAINING = "training"
COMMAND = "stixel study rq3"


def fitted_noise(data: StudyData) -> list[dict[str, list]]:
    """The axis of the fitted sweep: road user and path, with a noise that has not seen the path."""
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
    of a fit. Where there is one path alone, the noise is fitted to that.
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
    """The findings of a study whose points all have their `point_errors`."""
    sweeps = {name: runs_of(data.sweeps[name]) for name in (SIMULATED, FABRICATED, FITTED)}
    noises = fitted_noises(data.sweeps[TRAINING])
    pools = _pools(sweeps)
    lag = neighbour_columns([run for pool in pools.values() for run in pool[SIMULATED]])
    points = compare(sweeps, point_measures(lag), by_tracker=False)
    tracks = compare(sweeps, TRACKER_MEASURES, by_tracker=True)
    cost = cost_of(data.sweeps[SIMULATED], data.sweeps[FABRICATED])
    seeds, paths = (len(names(sweeps[SIMULATED], name)) for name in ("seed", "path"))
    sections = (
        Section("What was compared, and how", _method(data, sweeps, lag)),
        Section("The points", _points(points, pools, lag)),
        Section("The tracker", _tracker(tracks)),
        Section("The noise that was fitted", _fit(data, noises)),
        cost_section(cost),
    )
    return Material(
        {
            "answer": answer(points, tracks, cost, seeds, paths),
            "summary": answer_table(points, tracks),
            "sections": sections,
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


def _method(data: StudyData, sweeps: dict[str, Runs], lag: float) -> tuple[Paragraph, ...]:
    runs = sweeps[SIMULATED]
    seeds = sorted(names(runs, "seed"))
    trained = sorted(names(runs_of(data.sweeps[TRAINING]), "seed"))
    common = sorted(set(seeds) & set(trained))
    apart = f"seeds {listed(common)} are in both" if common else "no seed is in both"
    folds = (
        "the noise that a run is judged with was fitted to the training runs of the other paths"
        if len(names(runs, "path")) > 1
        else "there is one path, so the fit is judged on the path that it was fitted to"
    )
    return (
        Paragraph(
            f"Road users: {listed(names(runs, 'road_user'))}. Paths: "
            f"{listed(names(runs, 'path'))}. Trackers: {listed(names(runs, 'tracker'))}. Seeds: "
            f"{listed(seeds)}. The noise was fitted on seeds {listed(trained)}, {apart}. Seeds "
            "share motion and rendering, and differ in the sensor's noise and the tracker's "
            f"start, so other seeds alone would be no test: {folds}."
        ),
        Paragraph(
            "Three kinds of scan of the same poses. Simulated: rendered stereo images, matching, "
            "free space, stixels, points. Fabricated: the camera's rays cut by the true contour, "
            f"{listed(noises_of(data.sweeps[FABRICATED]))} along the ray. Fitted: fabricated with "
            "the noise whose parameters were estimated from simulated points."
        ),
        Paragraph(
            "A point is the target's if its column is in the true silhouette widened by 10 px and "
            "it lies within 1 px of disparity, or within 3 px and 2 m, of where its ray meets the "
            "contour first. "
            "Its error along the ray is measured minus true range; a point beside the silhouette "
            "is compared with the nearest ray that meets it. Across the ray a point has no error "
            "of its own, for the ray is that of its column: the bias across is the shift of both "
            "ends of the scan against those of the silhouette. The reach is how far the outermost "
            "points, with half a spacing, go beyond the silhouette: positive is edge fattening. "
            "A column without a point has none within half a spacing: dropouts, and ends that fall "
            f"short. Neighbours are compared {lag:.2g} columns apart in every kind of scan."
        ),
        Paragraph(
            "The unit is a pair of runs of the same road user, path and seed, n of them; scans of "
            "one run follow each other and are not counted as independent. Intervals of a mean: "
            "Student's t, 95 %; the paths are given, so the variance is that of the seeds within "
            "each path, with Satterthwaite's degrees of freedom. One seed in a path gives no "
            "interval. They hold for these paths, not for all, and are not corrected for their "
            "number. Tests: Wilcoxon's signed rank, two-sided, with Holm's correction over all "
            "tests of a table. At n pairs its p is at least 2 / 2ⁿ, times the number of tests; "
            f"where that is above {SIGNIFICANT:g}, the answer says so first. The tests take the "
            "pairs as exchangeable; pairs of one path share its motion, so a test that is clear "
            "here is clear for these paths. Effect: matched-pairs rank-biserial correlation, −1 "
            "to 1."
        ),
        Paragraph(
            "Gap closed: 1 − sum over the paths of |mean of fitted minus simulated| / the same of "
            "fabricated minus simulated. 1: nothing of the gap is left, 0: all of it, below 0: it "
            "became wider. It is not given where the interval of the gap holds 0. Its own "
            f"interval: 95 % percentiles of {DRAWS} draws of a paired bootstrap; seeds are drawn "
            "within each path, one less than there are and weighted up (Rao and Wu 1988). The size "
            "is taken path by path: a noise that is fitted to the other paths errs the one way on "
            "one path and the other way on the next, and in the mean over all paths, as the "
            "differences in the tables are, such errors cancel."
        ),
    )


def _points(points: Sequence[Comparison], pools: Pools, lag: float) -> tuple:
    counts = {
        sweep: sum(len(run.scans) for pool in pools.values() for run in pool[sweep])
        for sweep in (SIMULATED, FABRICATED, FITTED)
    }
    shown = ", ".join(f"{sweep} {count}" for sweep, count in counts.items())
    return (
        Paragraph(f"Points of the targets in all runs: {shown}."),
        error_histograms(pools),
        range_law(pools),
        neighbours(pools),
        edges(pools),
        difference_table(
            "point_differences",
            "Errors of the points by road user: mean over the runs, and paired differences. "
            f"Neighbours: {lag:.2g} columns apart.",
            points,
        ),
    )


def _tracker(tracks: Sequence[Comparison]) -> tuple:
    return (
        Paragraph(
            "NEES is divided by 2 and NIS by its degrees of freedom: 1 is consistent. They are "
            "compared in decades, since a diverging run's would outweigh all others: 0 is "
            "consistent, 1 is ten times too much, and a difference of 0.3 a factor of 2."
        ),
        tracker_differences(tracks),
        difference_table(
            "tracker_differences", "The tracker by road user, over all paths and seeds.", tracks
        ),
    )


def _fit(data: StudyData, noises: dict[str, FittedNoise]) -> tuple:
    users = list(noises)
    held_out = held_out_noises(data.sweeps[TRAINING])
    keys = [key for key in asdict(noises[users[0]]) if key != "kind"]
    rows = [(key, *(getattr(noise, key) for noise in noises.values())) for key in keys]
    folds = [
        (f"{user}, without {path}", *(getattr(noise, key) for key in keys))
        for (user, path), noise in held_out.items()
    ]
    biases = listed([f"{user} {quantity(noise.range_bias, 'm')}" for user, noise in noises.items()])
    return (
        Paragraph(
            "One set for each road user, since the bias is mostly its shape's: the contour is the "
            "outermost outline over all heights, and the surface that a stixel sees lies behind "
            f"it. Bias of the range: {biases}. Estimated by moments: means for bias and spread, "
            "neighbouring residuals for the correlation, how far points reach beyond the "
            "silhouette for the ends, counts for what is missed."
        ),
        Table(
            "fitted_noise",
            "Parameters of the fitted noise, all paths together, as the presets have them; units "
            "as in conf/measurement/noise.",
            ("parameter", *users),
            tuple(rows),
        ),
        Table(
            "held_out_noise",
            "The noises that the comparisons above were made with: each fitted without the path "
            "that it is judged on (where there is more than one). Rows that differ little say that "
            "a fit carries over from path to path.",
            ("fitted to", *keys),
            tuple(folds),
        ),
        Paragraph(
            "The files are beside this page: "
            + ", ".join(f"noise/fitted_{user}.yaml" for user in users)
            + ". Put them into conf/measurement/noise/ and say measurement=fabricated "
            f"measurement/noise=fitted_{users[0]}."
        ),
        Paragraph(
            "What the model leaves out: a shift of both ends to one side, so its bias across the "
            "ray is none; how the bias grows with the range (the figure of the error along the "
            "ray) and changes with the side that is seen, so that it is another on another path; "
            "and an error that scans share. Its noise is new in every scan, while the relief of a "
            "road user stays with it; see the correlation of successive scans' means above. How "
            "well the noise would do on the very paths that it was fitted to was not tried, so how "
            "much of a gap stays for the model's form and how much for the path is not known."
        ),
    )


def _what(data: StudyData, user: str) -> str:
    runs = runs_of(data.sweeps[TRAINING])
    own = [key for key in runs if key.road_user == user]
    points = sum(len(runs[key].load("point_errors").scans) for key in own)
    paths = listed(list(dict.fromkeys(key.path for key in own)))
    seeds = listed(list(dict.fromkeys(key.seed for key in own)))
    return f"{points} simulated points: {user}; paths {paths}; seeds {seeds}"
