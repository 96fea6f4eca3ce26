"""The tracker `contour`: one filter per class (`contour_filter.py`), and which one is reported."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.classes import ROAD_USER_CLASSES
from stixel_cli.tracking.contour.class_probabilities import (
    CONTRADICTED,
    RULED_OUT,
    probabilities_of,
    reported_classes,
    start_of_other,
)
from stixel_cli.tracking.contour.class_size import class_size
from stixel_cli.tracking.contour.contour_filter import ClassFilter
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.contour.contour_rays import rays_of
from stixel_cli.tracking.contour.forms import FORM_ODDS, forms_of
from stixel_cli.tracking.motion import intervals
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState, Track, used_rows

FITS = 5.0
"""A size that the user states fits a class within so many standard deviations of both."""

GREATEST_DEVIATION = 4.0
"""A class whose size is estimated farther from its mean, in its standard deviations, replaces none.
"""


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: ContourParameters
) -> Track:
    """Track one target through `scans`, of the prior's class or of one that is found.

    One filter for each class tracks the target, until the scans rule its class out. If the prior's
    class is `unknown`, each scan reports the most probable class, see `class_probabilities`. A
    known class is reported until the scans contradict it; if they do not, the others change
    nothing.
    """
    filters = {}
    for road_user in ROAD_USER_CLASSES if prior.class_file is None else (prior.class_file,):
        if may_be(road_user, prior, tracker.road_user):
            start, of_class, parameters = _of_class(road_user, initial, prior, tracker)
            for form, seen in forms_of(road_user, prior, parameters).items():
                filters[road_user, form] = ClassFilter(scans, start, of_class, *seen)
    kept, best = dict(filters), 0.0
    for k, interval in enumerate(intervals(scans.times)):
        rows = scans.rows(k)
        rays = rays_of(
            scans.points_world[rows],
            scans.covariances_world[rows],
            scans.sensor_poses_world[k],
            scans.field_of_view,
        )
        for one in kept.values():
            # Re-detection costs nine updates; skip it for classes that the scans rule out.
            probable = k == 0 or one.log_weights[k - 1] > best - CONTRADICTED
            one.step(k, interval, rays, recovers=probable)
        best = max(one.log_weights[k] for one in kept.values())
        kept = {
            (road_user, form): one
            for (road_user, form), one in kept.items()
            if one.log_weights[k] >= best - RULED_OUT
            or (one.sight.residual and road_user == prior.road_user)
        }
    class_of_prior = None if prior.road_user == "unknown" else prior.road_user
    return _reported(filters, class_of_prior, tracker.lag)


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
    stated, size = np.array([prior.length, prior.width]), class_size(road_user)
    if np.allclose(stated, class_size(prior.road_user).mean, rtol=5e-3):
        return True
    stds = np.hypot(stated * [prior.length_std, prior.width_std], size.mean * size.stds)
    return bool((np.abs(stated - size.mean) <= FITS * stds).all())


def _of_class(
    road_user: str, initial: InitialState, prior: PriorShape, tracker: ContourParameters
) -> tuple[InitialState, PriorShape, ContourParameters]:
    """Start, prior and parameters of the filter of a class."""
    if road_user == prior.road_user:
        return initial, prior, tracker
    size = class_size(road_user)
    if prior.road_user != "unknown":
        initial = start_of_other(initial, np.array([prior.length, prior.width]), size)
    length, width = size.mean.tolist()
    length_std, width_std = size.stds.tolist()
    return (
        initial,
        replace(prior, road_user=road_user, length=length, width=width),
        replace(tracker, length_std=length_std, width_std=width_std),
    )


def _reported(
    filters: dict[tuple[str, str], ClassFilter], class_of_prior: str | None, lag: int | None
) -> Track:
    """The track that is, at each scan, that of the class and the form that are reported there."""
    keys, names = list(filters), list(dict.fromkeys(road_user for road_user, _ in filters))
    of_class = np.array([names.index(road_user) for road_user, _ in keys])
    weights = np.stack([one.log_weights for one in filters.values()])
    weights += np.array([[FORM_ODDS.get(form, 0.0)] for _, form in keys])
    for row, ((road_user, _), one) in zip(weights, filters.items(), strict=True):
        # The points of another class stretch or shrink the size before they contradict the shape.
        if one.sight.residual and class_of_prior not in (None, road_user):
            row[one.size_deviations > GREATEST_DEVIATION] = -1e9
    log_weights = {
        name: np.logaddexp.reduce(weights[of_class == i], axis=0) for i, name in enumerate(names)
    }
    best = reported_classes(log_weights, class_of_prior)
    chosen_keys = np.where(of_class[:, None] == best, weights, -np.inf).argmax(axis=0)
    own = None if class_of_prior is None else names.index(class_of_prior)
    replaced = None if own is None else best != own
    known = replaced is not None and not replaced.any()
    if known and len(set(chosen_keys)) == 1:
        return filters[keys[chosen_keys[0]]].track()
    tracks = {i: filters[keys[i]].track() for i in np.unique(chosen_keys)}
    probabilities, replaced = (None, None) if known else (probabilities_of(log_weights), replaced)
    classes = {"class_probabilities": probabilities, "class_replaced": replaced}
    filtered = replace(_joined([tracks[i] for i in chosen_keys]), **classes)
    if lag == 0:
        return filtered
    # What is smoothed at k is of the class that is reported after the scans up to k + lag.
    last = len(chosen_keys) - 1
    then = np.minimum(np.arange(last + 1) + (last if lag is None else lag), last)
    smoothed = _joined([tracks[i].smoothed for i in chosen_keys[then]])
    return replace(filtered, smoothed=replace(smoothed, **classes))


def _joined(tracks: Sequence[Track]) -> Track:
    """The track that has at each scan k what the k-th of `tracks` has there."""
    values = {
        name: np.stack([getattr(one, name)[k] for k, one in enumerate(tracks)])
        for name, value in vars(tracks[0]).items()
        if isinstance(value, np.ndarray) and not name.startswith("used_")
    }
    offsets, rows = used_rows(
        [one.used_points[slice(*one.used_offsets[k : k + 2])] for k, one in enumerate(tracks)]
    )
    return replace(tracks[0], **values, used_offsets=offsets, used_points=rows)
