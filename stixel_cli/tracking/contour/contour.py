"""The tracker `contour`: one filter per class (`contour_filter.py`), and which one is reported.

The classes are equally probable at first. After the scans up to k, the log weight of a class is

    sum of log likelihoods  -  d²/2  -  v²/2(s² + V)  -  log(s² + V)/2

The likelihood is that of the measurements that the class's filter used, points and silhouettes, in
1/m each. The classes gate different points, so each measurement is compared with clutter that is
even over the gate of a point of a target whose place is known, and has a density of 1/m at an end:
a class that leaves out a point pays for it as if it were clutter, and points that no class uses
cancel. At one density for all, the far points of a car, uncertain by 1 m, are less likely than
clutter, and its front becomes a pedestrian. Size and speed are facts of the state, not of a scan,
so they count once: d is how far the estimated length or width is from the mean of the class, in its
standard deviations; v is the speed, V its variance, and s how fast the class moves. Seen from the
front, little but the speed separates cyclists from pedestrians. A start with the sensor's motion
has a speed that says nothing yet: V is large.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stixel_cli.geometry.pose import rotation, wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.parameters import ROAD_USER_CLASSES
from stixel_cli.tracking.association import GATE_STDS
from stixel_cli.tracking.background import Background
from stixel_cli.tracking.contour.class_size import ClassSize, class_size, states_size
from stixel_cli.tracking.contour.contour_filter import ClassFilter
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.contour.contour_rays import FACES, Rays, rays_of
from stixel_cli.tracking.contour.contour_update import CONTRADICTED, Hypothesis
from stixel_cli.tracking.contour.forms import forms_of, free_form
from stixel_cli.tracking.kalman import smooth
from stixel_cli.tracking.loop import each_scan
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import (
    OTHER,
    REPORTED,
    InitialState,
    Track,
    used_rows,
    widened,
    with_sensor_errors,
)

Key = tuple[str, str]
"""Class and form of a filter."""


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: ContourParameters
) -> Track:
    """Track one target through `scans`, of the prior's class or of one that is found.

    The state starts as `initial`, one sample before the first scan.
    """
    scans, used = scans.nearest_returns()
    bank = ClassBank(initial, prior, tracker, 0 if scans.heights is None else FACES)
    reports = [
        bank.step(interval, rays_of(*points, sensor, scans.field_of_view, heights))
        for _, interval, *points, sensor, heights in each_scan(scans)
    ]
    track = bank.joined(reports, scans)
    return with_sensor_errors(track, scans).of_points(used)


class ClassBank:
    """One filter for each class and form that the target may have, and one of no class.

    A filter tracks the target until the scans rule its class out. If the prior's class is
    `unknown`, each scan reports the most probable class. A known class is reported until the scans
    contradict it; until then the others change how certain the track is, and no estimate.
    """

    def __init__(
        self,
        initial: InitialState,
        prior: PriorShape,
        tracker: ContourParameters,
        face_errors: int = 0,
    ):
        self._filters, self._lag = {}, tracker.lag
        self._own = None if prior.road_user == "unknown" else prior.road_user
        for road_user in ROAD_USER_CLASSES if prior.class_file is None else (prior.class_file,):
            if may_be(road_user, prior, tracker.road_user):
                start, of_class = _of_class(road_user, initial, prior)
                for form, seen in forms_of(road_user, prior, tracker).items():
                    self._filters[road_user, form] = ClassFilter(
                        start, of_class, *seen, tracker, face_errors
                    )
        if tracker.road_user == "estimated" and not (prior.class_file or states_size(prior)):
            of_none = free_form(prior)
            self._filters[OTHER, "free"] = ClassFilter(initial, *of_none, tracker, face_errors)
        self._kept, self._steps = dict(self._filters), list[tuple[ClassFilter, Hypothesis]]()
        self._background = Background()
        self._start = next((key for key in self._filters if key[0] == self._own), None)
        self._assumed, self._chosen, self._log_weights = self._own, [], []

    def step(self, interval: float, rays: Rays) -> Track:
        """The next scan, an `interval` in s after the one before, with the `rays` of its points.

        Returns the track of this scan alone, at time 0, from no later one.
        """
        leader = self._kept.get(self._chosen[-1] if self._chosen else self._start)
        if leader:
            free = self._kept.get((OTHER, "free"), leader)
            places, reaches = zip(leader.expected(interval), free.expected(interval), strict=True)
            others = self._background.others(rays, np.array(places), np.array(reaches))
            rays = replace(rays, others=others)
        if leader and leader.unseen and self._chosen:
            # What appears may be of another class: the reported one looks.
            used = leader.step(interval, rays)
            rays = replace(rays, others=~np.isin(np.arange(len(rays.ranges)), used))
        else:
            leader = None
        for one in self._kept.values():
            if one is not leader:
                one.step(interval, rays)
        likelihoods = {
            key: -1e9 if _is_far(one) else one.log_weight for key, one in self._kept.items()
        }
        self._choose(likelihoods)
        spread = self._spread(np.array([*likelihoods.values()]))
        one = self._kept[self._chosen[-1]]
        self._kept = not_ruled_out(self._kept, self._own)
        if self._lag != 0:
            self._steps.append((one, one.best))
        return replace(widened(one.report(), spread), **self._classes(slice(-1, None)))

    def _choose(self, likelihoods: Mapping[Key, float]) -> None:
        """Choose which filter is reported at this scan.

        An outline that the user states is believed until the scans contradict it, and that the
        target is of no known class once they contradict all classes.
        """
        odds = {"outline": CONTRADICTED, "free": -CONTRADICTED}
        weights = {key: one + odds.get(key[1], 0.0) for key, one in likelihoods.items()}
        of_class = dict[str, float]()
        for (road_user, _), weight in weights.items():
            of_class[road_user] = float(np.logaddexp(of_class.get(road_user, -np.inf), weight))
        name = reported_class(of_class, self._assumed)
        if name != self._own:
            self._assumed = None
        self._chosen.append(max((key for key in weights if key[0] == name), key=weights.get))
        self._log_weights.append(of_class)

    def _spread(self, log_likelihoods: np.ndarray) -> np.ndarray:
        """How far the filters are from the reported one, as probable as they are: (1, 8, 8).

        The odds do not count here: they delay what is reported, not what is known.
        """
        shares = np.exp(log_likelihoods - np.logaddexp.reduce(log_likelihoods))
        states = {key: one.reported for key, one in self._kept.items()}
        away = np.stack([*states.values()]) - states[self._chosen[-1]]
        away[:, 2], away[:, 6:] = wrap_angle(away[:, 2]), 0.0
        return ((away.T * shares) @ away)[None]

    def joined(self, reports: Sequence[Track], scans: Scans) -> Track:
        """The track of all `scans`, from the report of each."""
        first = next(iter(self._filters.values())).report()
        of_all = {
            name: np.concatenate([getattr(one, name) for one in (first, *reports)])[1:]
            for name, value in vars(first).items()
            if isinstance(value, np.ndarray) and not name.startswith("used_")
        }
        used = zip(reports, scans.offsets[:-1], strict=True)
        offsets, rows = used_rows([one.used_points + offset for one, offset in used])
        of_all |= {"times": scans.times, "used_offsets": offsets, "used_points": rows}
        track = replace(first, **of_all, **self._classes(slice(None)))
        return replace(track, smoothed=self._smoothed(track)) if self._steps else track

    def _smoothed(self, track: Track) -> Track:
        """The `track`, smoothed: at k of the class reported after the scans up to k + lag."""
        means, covariances = smooth([one.step for _, one in self._steps], self._lag)
        last, described = len(means) - 1, []
        for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
            reporter, _ = self._steps[last if self._lag is None else min(k + self._lag, last)]
            # Smoothing leaves the same share of the stated covariance as of the gain's.
            one = self._steps[k][1]
            share = np.diag(one.stated) / np.maximum(np.diag(one.state[1]), 1e-12)
            scale = np.sqrt(np.maximum(share, 0.0))
            described.append(reporter.described(mean, np.outer(scale, scale) * covariance))
        of_all = {name: np.concatenate([one[name] for one in described]) for name in described[0]}
        return replace(track, **of_all, lag=self._lag)

    def _classes(self, scans: slice) -> dict[str, Any]:
        """What a track of the `scans` says of classes: nothing, if the prior's is reported."""
        if self._assumed is not None or not self._chosen:
            return {"class_probabilities": None, "class_replaced": None}
        chosen, log_weights = self._chosen[scans], self._log_weights[scans]
        names = list(dict.fromkeys(road_user for road_user, _ in self._filters))
        weights = {
            name: np.array([one.get(name, -np.inf) for one in log_weights]) for name in names
        }
        replaced = np.array([road_user != self._own for road_user, _ in chosen])
        return {
            "class_probabilities": probabilities_of(weights),
            "class_replaced": None if self._own is None else replaced,
        }


def not_ruled_out(filters: Mapping[Key, ClassFilter], own: str | None) -> dict[Key, ClassFilter]:
    """Those that the scans do not contradict, and those of the prior's `own` class."""
    # A class that a stretched size keeps likely does not rule out others.
    likely = [one.log_weight for one in filters.values() if not _is_far(one)]
    least = max(likely, default=-np.inf) - CONTRADICTED
    return {key: one for key, one in filters.items() if one.log_weight >= least or key[0] == own}


def _is_far(one: ClassFilter) -> bool:
    """Whether another target's points stretched the size before they contradict the shape."""
    return one.size_deviation > GATE_STDS


def may_be(road_user: str, prior: PriorShape, choice: str) -> bool:
    """Whether a target with this prior may turn out to be a `road_user`.

    A size that is not that of the prior's class is the user's, and excludes the classes that it
    does not fit, given the standard deviations that the prior and the class state. The tracker's
    `choice` is `estimated` or `fixed`, see `ContourParameters`.
    """
    if prior.road_user in ("unknown", road_user):
        return True
    if choice == "fixed":
        return False
    if not states_size(prior):
        return True
    stated, size = np.array([prior.length, prior.width]), class_size(road_user)
    stds = np.hypot(stated * [prior.length_std, prior.width_std], size.mean * size.stds)
    return bool((np.abs(stated - size.mean) <= GATE_STDS * stds).all())


def start_of_other(initial: InitialState, size: np.ndarray, other: ClassSize) -> InitialState:
    """A start that was made with the `size` (2,) m of one class, for another class.

    The sides that were seen may be those of either class, so the place is uncertain by half of the
    differences in length and width.
    """
    heading = initial.mean[2]
    turn = rotation(heading)
    covariance = initial.covariance.copy()
    covariance[:2, :2] += turn @ np.diag((0.5 * (size - other.mean)) ** 2) @ turn.T
    return InitialState(initial.mean, covariance)


def _of_class(
    road_user: str, initial: InitialState, prior: PriorShape
) -> tuple[InitialState, PriorShape]:
    """Start and prior of the filter of a class."""
    if road_user == prior.road_user:
        return initial, prior
    size = class_size(road_user)
    if prior.road_user != "unknown":
        initial = start_of_other(initial, np.array([prior.length, prior.width]), size)
    names, values = ("length", "width", "length_std", "width_std"), (*size.mean, *size.stds)
    of_class = dict(zip(names, map(float, values), strict=True))
    return initial, replace(prior, road_user=road_user, **of_class)


def probabilities_of(log_weights: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What is reported to probability (K,), given the scans up to k; 0 without a weight."""
    weights = np.stack(list(log_weights.values()))
    odds = np.exp(weights - weights.max(axis=0))
    excluded = dict.fromkeys(REPORTED, np.zeros(weights.shape[1]))
    return excluded | dict(zip(log_weights, odds / odds.sum(axis=0), strict=True))


def reported_class(log_weights: Mapping[str, float], assumed: str | None) -> str:
    """The most probable class; but that which is `assumed`, until the scans contradict it."""
    best = max(log_weights, key=log_weights.__getitem__)
    if assumed is None or log_weights[best] - log_weights[assumed] > CONTRADICTED:
        return best
    return assumed
