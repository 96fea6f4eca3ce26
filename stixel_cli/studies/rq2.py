"""RQ2: how does the tracker do on stixels against lidar?

Everything follows from the study's points: the trackers, measurements, road users and paths that
they have. Measurements and trackers are told apart by their kind where the question names one.
"""

from collections.abc import Sequence

import numpy as np

from stixel_cli.report.metrics import format_value
from stixel_cli.studies.nouns import Findings, Paragraph, Section, StudyData, Table
from stixel_cli.studies.rq2_answer import ERRORS, answer, capital, of_kind
from stixel_cli.studies.rq2_conditions import CONDITIONS, condition_table
from stixel_cli.studies.rq2_figures import boxes, by_condition, example_scans, over_time
from stixel_cli.studies.rq2_published import published
from stixel_cli.studies.rq2_runs import (
    LIDAR,
    STIXELS,
    Run,
    chosen,
    contour_distances,
    metric_over_seeds,
    names,
    paired_difference,
    runs_of,
    within_bounds,
)
from stixel_cli.studies.tables import over_seeds

NEAR = 2.0
"""Points within this distance of the true contour, m, are taken for the target's."""

_TITLES = {
    STIXELS: "Simulated measurements: stixels",
    "fabricated": "Fabricated measurements",
    LIDAR: "Lidar measurements",
}


def report(data: StudyData) -> Findings:
    """The findings of a study whose every point has scenario, scans and track."""
    runs = runs_of(data)
    measurements = names(runs, "measurement")
    users = names(runs, "road_user")
    chapters = [_chapter(user, chosen(runs, road_user=user), measurements) for user in users]
    appendix = [
        condition_table(
            f"{user}_by_{condition.name}", condition, chosen(runs, road_user=user), capital(user)
        )
        for user in users
        for condition in CONDITIONS
    ]
    sections = (
        Section("What was compared", _method(runs)),
        Section("Stixels against lidar, paired", _comparison(runs)),
        *chapters,
        published(),
        Section("Appendix: the numbers behind the figures by range, aspect and points", appendix),
    )
    return Findings(tuple(answer(runs)), sections, {})


def _method(runs: Sequence[Run]) -> tuple[Paragraph | Table, ...]:
    seeds = names(runs, "seed")
    listed = {
        what: ", ".join(names(runs, attribute))
        for what, attribute in (
            ("road users", "road_user"),
            ("paths", "path"),
            ("measurements", "measurement"),
            ("trackers", "tracker"),
        )
    }
    shown = "; ".join(f"{what}: {values}" for what, values in listed.items())
    return (
        Paragraph(f"{capital(shown)}; seeds: {', '.join(map(str, seeds))}."),
        Paragraph(
            "Every measurement is of the same scene: the motion and the noise of the start depend "
            "on the seed alone, so runs of one seed are pairs. Simulated measurements are stixels "
            "of rendered stereo images; fabricated ones are the camera's rays cut by the true "
            "contour, with noise; a lidar's are its beams cast against the same meshes, put to the "
            "ground plane. A tracker is given the scans and the noisy start, and no truth."
        ),
        Paragraph(
            "Centre error: distance of the estimated from the true centre. Orientation error: "
            "wrapped to ±180°, shown without its sign. IoU: of the areas within estimated and true "
            "contour; a scan with less than 0.2 counts as lost. RMSE is over the scans of a run, "
            "the empty ones included; means and deviations are over seeds. NEES is divided by 2 "
            "and NIS by its degrees of freedom: 1 is consistent, more says that the tracker "
            "claims to know more than it does."
        ),
    )


def _comparison(runs: Sequence[Run]) -> tuple[Paragraph | Table, ...]:
    stixels = of_kind(runs, STIXELS)
    others = [name for name in names(runs, "measurement") if name not in stixels]
    rows = []
    for user in names(runs, "road_user"):
        for tracker in names(runs, "tracker"):
            for base in stixels:
                for other in others:
                    one, two = (
                        chosen(runs, road_user=user, tracker=tracker, measurement=name)
                        for name in (base, other)
                    )
                    cells: list[str | float | int | None] = [
                        user,
                        tracker,
                        f"{base}\u00a0−\u00a0{other}",
                    ]
                    for metric in ERRORS:
                        difference = paired_difference(one, two, metric)
                        cells += [difference.mean, difference.low, difference.high]
                    rows.append((*cells, difference.n))
    if not rows:
        return (Paragraph("This study holds no stixels beside another measurement."),)
    columns = ["road user", "tracker", "difference"]
    for name, unit, _ in ERRORS.values():
        columns.append(f"{name} ({unit})" if unit else name)
        columns += [f"{name}: low", f"{name}: high"]
    return (
        Paragraph(
            "Of each seed, the mean over the paths of the difference of two runs that see the same "
            "motion; then the mean over the seeds and its 95 % interval (Student's t). An interval "
            "without 0 tells the two apart. Of the errors a positive difference, of the IoU a "
            "negative one, is worse for stixels."
        ),
        Table(
            "paired_differences",
            "Stixels minus another measurement, paired by road user, path and seed.",
            (*columns, "n"),
            tuple(rows),
        ),
    )


def _chapter(user: str, runs: Sequence[Run], measurements: Sequence[str]) -> Section:
    measured = [
        _measurement_section(user, kind, chosen(runs, kind=kind)) for kind in names(runs, "kind")
    ]
    tracking = [
        Paragraph(_tracking_text(runs)),
        _tracking_table(user, runs),
        boxes(f"{user}_boxes", runs, measurements),
        *(
            Section(
                f"Over time: {path}",
                (over_time(f"{user}_{path}_over_time", chosen(runs, path=path), measurements),),
            )
            for path in names(runs, "path")
        ),
        Section(
            "By range, by the sides that are seen, by the number of points",
            tuple(
                by_condition(f"{user}_by_{condition.name}", condition, runs, measurements)
                for condition in CONDITIONS
            ),
        ),
    ]
    return Section(capital(user), (*measured, Section("Tracking", tuple(tracking))))


def _measurement_section(user: str, kind: str, runs: Sequence[Run]) -> Section:
    """What the scans of one kind of measurement are like; they are the same for every tracker."""
    runs = chosen(runs, tracker=names(runs, "tracker")[0])
    rows, sentences = [], []
    for measurement in names(runs, "measurement"):
        for path in names(runs, "path"):
            same = chosen(runs, measurement=measurement, path=path)
            if not same:
                continue
            near = [_near_points(run) for run in same]
            points = over_seeds([float(run.scan_points.mean()) for run in same])
            on_target = over_seeds([float(counts.mean()) for counts, _ in near])
            unseen = over_seeds([float((counts == 0).mean()) for counts, _ in near])
            away = [distances for _, distances in near if len(distances)]
            bias = over_seeds([float(d.mean()) for d in away])
            spread = over_seeds([float(np.sqrt(np.mean(np.square(d)))) for d in away])
            ranges = np.concatenate([run.ranges for run in same])
            rows.append(
                (
                    measurement,
                    path,
                    float(ranges.min()),
                    float(ranges.max()),
                    points.mean,
                    on_target.mean,
                    on_target.deviation,
                    unseen.mean,
                    bias.mean,
                    bias.deviation,
                    spread.mean,
                    spread.deviation,
                )
            )
        own = [row for row in rows if row[0] == measurement]
        sentences.append(
            f"{measurement}: by path, {_range([row[5] for row in own])} points of a scan are "
            f"within {NEAR:g} m of the true contour, a share of {_range([row[7] for row in own])} "
            f"of the scans has none there, and these points lie {_range([row[10] for row in own])} "
            "m (RMS) from the contour."
        )
    table = Table(
        f"{user}_{kind}_scans",
        f"{capital(user)}: the scans, mean ± standard deviation over seeds. A scan holds all that "
        f"the sensor saw within its gates; on the target: within {NEAR:g} m of the true contour. "
        "Distances of these points from the contour: positive outside it.",
        (
            "measurement",
            "path",
            "range from (m)",
            "range to (m)",
            "points a scan",
            "points on the target",
            "± points",
            "share of scans without",
            "mean distance from the contour (m)",
            "± mean distance",
            "RMS distance (m)",
            "± RMS distance",
        ),
        tuple(rows),
    )
    figure = example_scans(f"{user}_{kind}_examples", runs)
    return Section(_TITLES.get(kind, kind), (Paragraph(" ".join(sentences)), figure, table))


def _near_points(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """How many points of each scan (K,) are near the true contour, and their distances m."""
    scans = run.point.load("scans")
    distances = contour_distances(scans, run.point.load("scenario"))
    near = distances < NEAR
    k = np.repeat(np.arange(len(scans)), np.diff(scans.offsets))
    return np.bincount(k[near], minlength=len(scans)), distances[near]


def _tracking_text(runs: Sequence[Run]) -> str:
    best = {}
    for tracker in names(runs, "tracker"):
        found = {
            m: metric_over_seeds(chosen(runs, tracker=tracker, measurement=m), "iou_mean").mean
            for m in names(runs, "measurement")
        }
        known = {m: value for m, value in found.items() if value is not None}
        if known:
            ranked = sorted(known, key=known.get, reverse=True)
            best[tracker] = ", ".join(f"{m} {format_value(known[m])}" for m in ranked)
    return "Mean IoU over all paths and seeds, the best first. " + " ".join(
        f"{tracker}: {ranking}." for tracker, ranking in best.items()
    )


def _tracking_table(user: str, runs: Sequence[Run]) -> Table:
    rows = []
    for path in names(runs, "path"):
        for tracker in names(runs, "tracker"):
            for measurement in names(runs, "measurement"):
                same = chosen(runs, path=path, tracker=tracker, measurement=measurement)
                if not same:
                    continue
                cells: list[str | float | int | None] = [path, tracker, measurement, len(same)]
                for metric in (*ERRORS, "lost_share"):
                    one = metric_over_seeds(same, metric)
                    cells += [one.mean, one.deviation]
                nees, nis = within_bounds(same)
                cells += [metric_over_seeds(same, "nees_position_mean").mean, nees]
                cells += [metric_over_seeds(same, "nis_mean").mean, nis]
                rows.append(tuple(cells))
    return Table(
        f"{user}_tracking",
        f"{capital(user)}: mean ± standard deviation over n seeds. NEES and NIS are 1, and 0.95 "
        "of the scans within the 95 % chi-square bounds, where the tracker is consistent.",
        (
            "path",
            "tracker",
            "measurement",
            "n",
            "centre RMSE (m)",
            "± centre",
            "orientation RMSE (°)",
            "± orientation",
            "mean IoU",
            "± IoU",
            "share lost",
            "± share lost",
            "NEES / 2",
            "NEES within bounds",
            "NIS / d.o.f.",
            "NIS within bounds",
        ),
        tuple(rows),
    )


def _range(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return "–"
    low, high = format_value(min(known)), format_value(max(known))
    return low if low == high else f"{low} to {high}"
