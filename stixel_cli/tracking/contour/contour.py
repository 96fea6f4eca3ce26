"""The tracker `contour`: one filter per class (`contour_filter.py`), and which one is reported."""

from dataclasses import fields, replace

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
from stixel_cli.tracking.motion import intervals
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState, Track, used_rows


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: ContourParameters
) -> Track:
    """Track one target through `scans`, of the prior's class or of one that is found.

    One filter for each class tracks the target, until the scans rule its class out. If the prior's
    class is `unknown`, each scan reports the most probable class, see `class_probabilities`. A
    known class is reported until the scans contradict it; if they do not, the others change
    nothing.
    """
    filters = {
        road_user: ClassFilter(scans, *_of_class(road_user, initial, prior, tracker))
        for road_user in ROAD_USER_CLASSES
    }
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
            road_user: one
            for road_user, one in kept.items()
            if one.log_weights[k] > best - RULED_OUT
        }
    return _reported(filters, None if prior.road_user == "unknown" else prior.road_user)


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


def _reported(filters: dict[str, ClassFilter], class_of_prior: str | None) -> Track:
    """The track that is, at each scan, that of the class that is reported there."""
    names = list(filters)
    log_weights = {name: one.log_weights for name, one in filters.items()}
    best = reported_classes(log_weights, class_of_prior)
    own = None if class_of_prior is None else names.index(class_of_prior)
    if own is not None and (best == own).all():
        return filters[names[own]].track()
    tracks = {i: filters[names[i]].track() for i in np.unique(best)}
    chosen = [tracks[i] for i in best]
    values = {
        field.name: np.stack([getattr(one, field.name)[k] for k, one in enumerate(chosen)])
        for field in fields(Track)
        if field.name not in SHARED
    }
    offsets, rows = used_rows(
        [one.used_points[slice(*one.used_offsets[k : k + 2])] for k, one in enumerate(chosen)]
    )
    return replace(
        chosen[0],
        **values,
        used_offsets=offsets,
        used_points=rows,
        class_probabilities=probabilities_of(log_weights),
        class_replaced=None if own is None else best != own,
    )


SHARED = (
    "used_offsets",
    "used_points",
    "class_probabilities",
    "class_replaced",
    "uses_scans",
)
"""Fields of a track without one row for each scan."""
