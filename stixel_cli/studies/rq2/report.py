"""RQ2: how does the tracker do on stixels against lidar?

Everything follows from the study's points: the trackers, measurements, road users and paths that
they have. Measurements and trackers are told apart by their kind where the question names one.
"""

from collections.abc import Sequence

import numpy as np

from stixel_cli.results.text import listed
from stixel_cli.studies.field_names import LIDAR, STIXELS
from stixel_cli.studies.prose import capital, number, percent
from stixel_cli.studies.rq2.answer import answer, answer_tables
from stixel_cli.studies.rq2.conditions import CONDITIONS, condition_table
from stixel_cli.studies.rq2.contrasts import ERRORS, contrasts_section
from stixel_cli.studies.rq2.figures import boxes, by_condition, example_scans, over_time
from stixel_cli.studies.rq2.runs import (
    Run,
    chosen,
    contour_distances,
    metric_over_seeds,
    names,
    runs_of,
    within_bounds,
)
from stixel_cli.studies.tables import over_seeds
from stixel_cli.studies.types import Findings, Paragraph, Section, StudyData, Table

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
        contrasts_section(runs),
        *chapters,
        Section("Appendix: the numbers behind the figures by range, aspect and points", appendix),
    )
    return Findings(tuple(answer(runs)), sections, {}, answer_tables(runs))


def _method(runs: Sequence[Run]) -> tuple[Paragraph | Table, ...]:
    seeds, paths = names(runs, "seed"), names(runs, "path")
    return (
        Paragraph(
            f"Road users: {listed(names(runs, 'road_user'))}. Paths: {listed(paths)}. "
            f"Measurements: {listed(names(runs, 'measurement'))}. "
            f"Trackers: {listed(names(runs, 'tracker'))}. "
            f"Seeds: {listed(seeds)}; {len(runs)} runs."
        ),
        Paragraph(
            "Every measurement is of the same scene. Stixels are what the camera pipeline makes of "
            "rendered stereo images (the thesis's simulated measurements); fabricated ones are the "
            "camera's rays cut by the true contour, with noise; a lidar's are its beams cast "
            "against the same meshes, put to the ground plane. A tracker is given the scans and "
            "the noisy start, and no truth. Its settings are those of its option and of the road "
            "user, whatever is measured: where the NIS is below 1, the tracker assumes "
            "more noise than there is, and weighs points less than it could."
        ),
        Paragraph(
            f"The unit of replication is the seed, n = {len(seeds)}. A seed draws the noise of "
            "the sensors and of the tracker's start; motion, road user, street and light are the "
            "same for all. So intervals speak of these scenes under other noise, not of other "
            "scenes. Runs of one road user, path and seed are a pair. Scans of a run follow each "
            "other and are not counted as independent: a run gives one number, and a seed the "
            f"mean of its {len(paths)} paths where paths are put together."
        ),
        Paragraph(
            "Centre error: distance of the estimated from the true centre. Orientation error: "
            "wrapped to ±180°, shown without its sign. IoU: of the areas within estimated and true "
            "contour; a scan with less than 0.2 has low overlap. RMSE is over the scans of a run, "
            "the empty ones included. NEES is divided by 2 and NIS by its degrees of freedom: 1 is "
            "consistent, more says that the tracker claims to know more than it does, less that it "
            "knows more than it claims. The point tracker's contour is a circle of the class's "
            "size and its orientation that of its velocity."
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
        Section(
            "Over time",
            (
                Paragraph(
                    "Means over the seeds; coloured bands: 95 % interval of that mean at each time "
                    "by itself (Student's t, cut at 0). NEES and NIS are 1 (dashed) where the "
                    "filter is consistent; grey: 95 % chi-square bounds of the NEES of a mean "
                    "over as many runs. Scales differ between trackers."
                ),
                *(
                    over_time(f"{user}_{path}_over_time", chosen(runs, path=path), measurements)
                    for path in names(runs, "path")
                ),
            ),
        ),
        Section(
            "By range, by the sides that are seen, by the number of points",
            (
                Paragraph(
                    "Of each seed the mean over its scans of all paths, then mean and 95 % "
                    "interval over the seeds (Student's t). Which paths a class has scans of "
                    "differs, so classes differ by more than what they are named for. Scales "
                    "differ between trackers. The numbers stand in the appendix."
                ),
                *(
                    by_condition(f"{user}_by_{condition.name}", condition, runs, measurements)
                    for condition in CONDITIONS
                ),
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
                    on_target.std,
                    unseen.mean,
                    bias.mean,
                    bias.std,
                    spread.mean,
                    spread.std,
                )
            )
        own = [row for row in rows if row[0] == measurement]
        none = max((row[7] for row in own), default=0.0)
        lacking = f"up to {percent(none, 1)} of a path's scans have" if none else "no scan has"
        sentences.append(
            f"{capital(measurement)}: {_range([row[5] for row in own])} points of a scan, as the "
            f"path may be, are within {NEAR:g} m of the true contour and lie "
            f"{_range([row[10] for row in own])} m (RMS) from it; {lacking} none there."
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
            best[tracker] = ", ".join(f"{m} {number(known[m], 2)}" for m in ranked)
    return "Mean IoU over all paths and seeds, the best first. " + " ".join(
        f"{capital(tracker)}: {ranking}." for tracker, ranking in best.items()
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
                for metric in (*ERRORS, "low_overlap_share"):
                    one = metric_over_seeds(same, metric)
                    cells += [one.mean, one.std]
                nees, nis = within_bounds(same)
                cells += [metric_over_seeds(same, "nees_position_mean").mean, nees]
                cells += [metric_over_seeds(same, "nis_mean").mean, nis]
                rows.append(tuple(cells))
    return Table(
        f"{user}_tracking",
        f"{capital(user)}: mean ± standard deviation over n seeds. Where a tracker is consistent, "
        "NEES / 2 and NIS / d.o.f. are 1 in the mean, and at 95 % of the times the mean over the "
        "n seeds is within the chi-square bounds of a sum over n runs (columns “within”).",
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
            "share of low overlap",
            "± share of low overlap",
            "NEES / 2",
            "NEES within",
            "NIS / d.o.f.",
            "NIS within",
        ),
        tuple(rows),
    )


def _range(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return "–"
    low, high = number(min(known)), number(max(known))
    return low if low == high else f"{low} to {high}"
