"""RQ2: what is kept of every run, and how runs are put together."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.stats import chi2

from stixel_cli.config.schema import Configuration
from stixel_cli.geometry.pose import world_from_target, wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.studies.field_names import measurement_name, tracker_name
from stixel_cli.studies.tables import over_seeds, with_none
from stixel_cli.studies.types import StudyData, StudyRun
from stixel_cli.sweeps.statistics import CONFIDENCE, Statistic

if TYPE_CHECKING:
    import pandas as pd

_PAIR = ("road_user", "path", "seed")
"""What the two runs of a pair have in common."""


@dataclass(frozen=True)
class Run:
    """One run; K scans.

    Attributes:
        road_user, path: as they are called in the study.
        measurement, tracker: as the field calls them, see `studies.field_names`.
        kind, tracker_kind: of measurement and tracker, whatever the options are called.
        seed: of the run.
        point: what it comes from.
        times: (K,) s.
        errors: centre m, orientation degrees (absolute) and IoU, (K,) each, by name.
        nees: (K,) position NEES / 2.
        nis, nis_degrees: (K,) NIS / degrees of freedom, and these.
        ranges: (K,) m from the sensor to the target's centre.
        aspects: (K,) degrees 0 … 180 between the heading and the way to the sensor: 0 where the
            front is seen, 180 where the rear is.
        used: (K,) points used of each scan.
        scan_points: (K,) points of each scan.
    """

    road_user: str
    path: str
    measurement: str
    tracker: str
    kind: str
    tracker_kind: str
    seed: int
    point: StudyRun
    times: np.ndarray
    errors: dict[str, np.ndarray]
    nees: np.ndarray
    nis: np.ndarray
    nis_degrees: np.ndarray
    ranges: np.ndarray
    aspects: np.ndarray
    used: np.ndarray
    scan_points: np.ndarray


def runs_of(data: StudyData) -> list[Run]:
    """Every run of the study."""
    points = [point for sweep in data.sweeps.values() for point in sweep.runs]
    called = {
        "measurement": _called(points, "measurement", measurement_name),
        "tracker": _called(points, "tracker", tracker_name),
    }
    return [_run(point, called) for point in points]


def _called(
    points: Sequence[StudyRun], group: str, name: Callable[[str, Configuration], str]
) -> dict[tuple, str]:
    """What each option of a group, with what else of the run is swept, is called; all differ."""
    found: dict[tuple, tuple[str, str]] = {}
    for point in points:
        key = _setting(point, group)
        if key not in found:
            option = point.setting.get(group, getattr(point.configuration, group).kind)
            found[key] = (name(option, point.configuration), option)
    plain = [text for text, _ in found.values()]
    return {
        key: ", ".join(
            [
                text if plain.count(text) == 1 else f"{text} ({option})",
                *(f"{name} {value}" for name, value in key[1:]),
            ]
        )
        for key, (text, option) in found.items()
    }


def _setting(point: StudyRun, group: str) -> tuple:
    """The option of a group and other swept keys: a tracker's own to it, the rest to the scans."""
    rest = [
        (key, value)
        for key, value in point.setting.items()
        if key not in ("road_user", "path", "measurement", "tracker")
        and key.startswith("tracker.") == (group == "tracker")
    ]
    return (point.setting.get(group), *rest)


def _run(point: StudyRun, called: Mapping[str, Mapping[tuple, str]]) -> Run:
    scenario, scans, track = (point.load(step) for step in ("scenario", "scans", "track"))
    configuration, scores = point.configuration, point.scores
    to_sensor = scans.sensor_poses_world[:, :2] - scenario.target_poses_world[:, :2]
    bearing = np.arctan2(to_sensor[:, 1], to_sensor[:, 0])
    aspects = np.abs(np.degrees(wrap_angle(bearing - scenario.target_poses_world[:, 2])))
    return Run(
        road_user=point.setting.get("road_user", configuration.road_user.kind),
        path=point.setting.get("path", configuration.path.kind),
        **{group: names[_setting(point, group)] for group, names in called.items()},
        kind=configuration.measurement.kind,
        tracker_kind=configuration.tracker.kind,
        seed=point.seed,
        point=point,
        times=scores.times,
        errors={
            "centre": scores.centre_error,
            "orientation": np.abs(np.degrees(scores.orientation_error)),
            "iou": scores.iou,
        },
        nees=scores.nees_position,
        nis=scores.nis,
        nis_degrees=track.nis_degrees_of_freedom,
        ranges=np.hypot(to_sensor[:, 0], to_sensor[:, 1]),
        aspects=aspects,
        used=np.diff(track.used_offsets),
        scan_points=np.diff(scans.offsets),
    )


def names(runs: Iterable[Run], attribute: str) -> list[str]:
    """The values of an attribute, in the order in which they come first."""
    return list(dict.fromkeys(getattr(run, attribute) for run in runs))


def chosen(runs: Iterable[Run], **attributes: str | int) -> list[Run]:
    """The runs with the given attributes."""
    return [
        run
        for run in runs
        if all(getattr(run, name) == value for name, value in attributes.items())
    ]


def metric_frame(runs: Sequence[Run], name: str) -> "pd.DataFrame":
    """A row for each run: its road user, path and seed, and a metric as `value` (or NaN)."""
    import pandas as pd

    rows = [(run.road_user, run.path, run.seed, run.point.metrics.get(name)) for run in runs]
    return pd.DataFrame(rows, columns=[*_PAIR, "value"]).astype({"value": float})


def metric_over_seeds(runs: Sequence[Run], name: str) -> Statistic:
    """A metric over seeds: each seed's mean over its runs; seeds with a missing value left out."""
    by_seed = (
        metric_frame(runs, name)
        .groupby("seed")["value"]
        .agg(lambda values: values.mean(skipna=False))
    )
    return over_seeds(with_none(by_seed))


def paired_difference(one: Sequence[Run], other: Sequence[Run], name: str) -> Statistic:
    """A metric of `one` minus that of `other`: of each seed the mean over what both have.

    Runs are pairs where road user, path and seed are the same: these have the same motion.
    """
    pairs = metric_frame(one, name).merge(metric_frame(other, name), on=list(_PAIR)).dropna()
    difference = (pairs["value_x"] - pairs["value_y"]).groupby(pairs["seed"]).mean()
    return over_seeds(with_none(difference))


def within_bounds(runs: Sequence[Run]) -> tuple[float | None, float | None]:
    """Share of scans at which the mean over seeds of NEES, and of NIS, is within chi-square bounds.

    Bar-Shalom, Li & Kirubarajan 2001, *Estimation with Applications to Tracking and Navigation*,
    section 5.4: the sum of n normalised squares is chi-square with n times their degrees of
    freedom. Of a consistent filter, 0.95 are within.
    """
    found: list[list[bool]] = [[], []]
    for path in names(runs, "path"):
        same = chosen(runs, path=path)
        nees = np.stack([run.nees for run in same])
        nis = np.stack([run.nis for run in same])
        degrees = np.stack([run.nis_degrees for run in same])
        for values, freedom, inside in (
            (nees, np.full(nees.shape, 2), found[0]),
            (nis, degrees, found[1]),
        ):
            known = np.isfinite(values) & (freedom > 0)
            total = np.where(known, freedom, 0).sum(axis=0)
            summed = np.where(known, values * freedom, 0.0).sum(axis=0)
            low, high = chi_square_bounds(total[total > 0])
            inside += list((summed[total > 0] >= low) & (summed[total > 0] <= high))
    nees_share, nis_share = (float(np.mean(inside)) if inside else None for inside in found)
    return nees_share, nis_share


def chi_square_bounds(degrees: np.ndarray | int) -> tuple[np.ndarray, np.ndarray]:
    """Bounds that a chi-square sum leaves by chance in 5 % of all cases, half at each end.

    They have the shape of `degrees`.
    """
    edge = 0.5 * (1.0 - CONFIDENCE)
    return chi2.ppf(edge, degrees), chi2.ppf(1.0 - edge, degrees)


def contour_distances(scans: Scans, scenario: Scenario) -> np.ndarray:
    """Distance (P,) m of every scan's points from the true contour, negative inside it."""
    distances = np.empty(len(scans.points_world))
    for k in range(len(scans)):
        rows = scans.rows(k)
        if rows.start == rows.stop:
            continue
        truth = shapely.Polygon(
            world_from_target(scenario.contour_target, scenario.target_poses_world[k])
        )
        points = shapely.points(scans.points_world[rows])
        away = shapely.distance(truth.exterior, points)
        distances[rows] = np.where(shapely.contains(truth, points), -away, away)
    return distances
