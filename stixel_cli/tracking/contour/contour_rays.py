"""The rays of a scan: how a sensor sees a class, and association."""

from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot

import numpy as np
from numba import njit

from stixel_cli.geometry.pose import rotation, wrap_angle
from stixel_cli.measurements.clusters import GAP
from stixel_cli.measurements.scans import BEARING, FieldOfView
from stixel_cli.tracking.association import GATE_STDS
from stixel_cli.tracking.contour.class_shape import (
    HEIGHTS,
    class_shape,
    height_insets,
    visible_shape,
    visible_table,
)
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.contour.ray_kernels import LEAST_COSINE, NEAR, expected
from stixel_cli.tracking.contour.ray_table import RayTable
from stixel_cli.tracking.contour.residual import Residual

EDGE_ON = 2.5
"""Baselines. A face whose plane passes the left camera by less is so short in the right image that
a matcher loses it: 39 columns of a car's side, .83 m aside, are 14 there with `rig=kitti`."""

FACES = 2
"""Errors of a target at the heights of its points: of its ends and of its sides."""

NEIGHBOURS = 3
"""So many of the next points, by bearing, may be of the same object."""


@dataclass(frozen=True)
class Sight:
    """How a sensor sees the class."""

    table: RayTable
    """The visible shape."""
    bias_per_std: float
    std_factor: float
    """`bias_per_std`, `std_factor`: see `VisibleShape`."""
    learned_inset: float
    """How far inside the limits the first and last ray were in the scans that the visible shape was
    learned from, m; 0: the sensor sees the outline itself; infinite: columns of stixels."""
    residual: Residual
    """How the outline may differ from the form."""
    height_insets: np.ndarray | None = None
    """See `class_shape.height_insets`; None: not known."""

    @property
    def outline(self) -> bool:
        """Whether the sensor sees the outline itself."""
        return self.learned_inset == 0.0


@dataclass(frozen=True)
class Rays:
    """The rays of a scan's points."""

    sensor: np.ndarray
    """(3,) pose of the sensor in the world."""
    directions: np.ndarray
    """(n, 2) unit vectors in the world."""
    bearings: np.ndarray
    """(n,) rad from the sensor's heading."""
    ranges: np.ndarray
    """(n,) m."""
    stds: np.ndarray
    """(n,) m, of the ranges."""
    across_variances: np.ndarray
    """(n,) m², of the points across their rays."""
    shared: np.ndarray
    """(n, 2, m) m, how far one standard deviation of each of m errors of the target's faces, which
    all scans share, moves a point in the world, see `at_heights`."""
    labels: np.ndarray
    """(n,) the stretch of neighbouring rays that a point is of, see `segments`."""
    others: np.ndarray
    """(n,) whether a point is known to be another object's."""
    heights: np.ndarray | None = None
    """(n,) m above the road; None: unknown."""
    field_of_view: FieldOfView | None = None
    """Of the sensor; None: unknown."""
    hidden: tuple[bool, bool] = (False, False)
    """Whether what is beside the first and the last ray is hidden, see `subset`."""

    @property
    def normals(self) -> np.ndarray:
        """Unit vectors (n, 2) to the left of the rays."""
        return np.stack([-self.directions[:, 1], self.directions[:, 0]], axis=-1)

    @cached_property
    def points_world(self) -> np.ndarray:
        """The points (n, 2) m."""
        return self.sensor[:2] + self.ranges[:, None] * self.directions

    def subset(self, indices: np.ndarray) -> "Rays":
        """The rays at `indices`, whose ends are hidden or not.

        A nearer object hides one, or a face at the left end is too nearly edge-on for the second
        camera to match it: its far end is not seen.
        """
        of_each = {
            name: value[indices]
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray) and name not in ("sensor", "points_world")
        }
        rays, (right, left) = replace(self, **of_each), self._hidden_ends(indices)
        return replace(rays, hidden=(right, left or rays._is_edge_on()))

    def _hidden_ends(self, indices: np.ndarray) -> tuple[bool, bool]:
        """Whether a nearer point that is not at `indices` is right beside an end of these rays."""
        others = np.delete(np.arange(len(self.ranges)), indices)[:, None]
        bearings = self.bearings[indices]
        ends = indices[[bearings.argmin(), bearings.argmax()]]
        apart = np.abs(wrap_angle(self.bearings[others] - self.bearings[ends]))
        near = (apart * self.ranges[ends] < NEAR) | (apart < 2.0 * BEARING)
        nearer = self.ranges[others] < self.ranges[ends] - NEAR
        return tuple((nearer & near).any(axis=0).tolist())

    def _is_edge_on(self) -> bool:
        """Whether the plane of the face at the left end is within `EDGE_ON` of the sensor."""
        last = np.argsort(self.bearings)[-3:]
        if self.field_of_view is None or len(last) < 3:
            return False
        begin, end = (self.points_world - self.sensor[:2])[last[[0, 2]]]
        along = end - begin
        apart = abs(along[0] * end[1] - along[1] * end[0])
        return bool(apart < EDGE_ON * self.field_of_view.baseline * np.hypot(*along))


def sight_of(
    road_user: str, tracker: ContourParameters, vertices: np.ndarray | None = None
) -> Sight:
    """What the sensor sees of a class: stixels and lidars less than the outline.

    The outline is the class's, or `vertices` (n, 2) m of another one.
    """
    kind = tracker.seen_by if tracker.seen_by in ("stixels", "lidar") else "outline"
    seen = visible_shape(road_user, kind)
    shape = class_shape(road_user).outline if vertices is None else vertices
    table = visible_table(shape, seen)
    learned = {"outline": 0.0, "stixels": np.inf}.get(kind, float(seen.insets.mean()))
    residual, insets = Residual(class_shape(road_user)), height_insets(road_user)
    return Sight(table, seen.bias_per_std, seen.std_factor, learned, residual, insets)


def rays_of(
    points_world: np.ndarray,
    covariances: np.ndarray,
    sensor: np.ndarray,
    field_of_view: FieldOfView | None = None,
    heights: np.ndarray | None = None,
) -> Rays:
    """The rays from a `sensor` (3,) through points (n, 2) m with covariances (n, 2, 2) m².

    `heights` (n,) m are above the road.
    """
    offsets = points_world - sensor[:2]
    ranges = np.hypot(offsets[:, 0], offsets[:, 1])
    directions = offsets / np.maximum(ranges, 1e-9)[:, None]
    variances = np.einsum("ni,nij,nj->n", directions, covariances, directions)
    across = covariances[:, 0, 0] + covariances[:, 1, 1] - variances
    bearings = wrap_angle(np.arctan2(directions[:, 1], directions[:, 0]) - sensor[2])
    stds = np.sqrt(np.maximum(variances, 0.0))
    return Rays(
        # A copy: kernels are compiled for arrays that may be written to.
        np.array(sensor),
        directions,
        bearings,
        ranges,
        stds,
        np.maximum(across, 0.0),
        np.zeros((len(offsets), 2, 0)),
        segments(bearings, points_world, stds),
        np.zeros(len(offsets), bool),
        heights,
        field_of_view=field_of_view,
    )


def at_heights(
    rays: Rays,
    pose_and_size: np.ndarray,
    table: RayTable,
    insets: np.ndarray | None,
    of_class: bool = True,
) -> Rays:
    """The rays as if all points were low: a windscreen is behind the bumper, a roof is narrower.

    A ray ends no sooner than where it enters the box that the predicted target, at `pose_and_size`
    (5,), has at the height of the point. If that is behind what the `table` expects, the point
    moves by the difference, at most from the one box to the other; if the target is not `of_class`,
    it is only less certain. `insets` are those of `class_shape.height_insets`; `shared` is how far
    a target's own are off.
    """
    if rays.heights is None or insets is None:
        return rays
    turn = rotation(pose_and_size[2])
    ahead, sensor = rays.directions @ turn, (rays.sensor[:2] - pose_and_size[:2]) @ turn
    half = 0.5 * table.extents * np.exp(pose_and_size[3:])
    rear, front, sides = (
        np.stack([np.interp(rays.heights, HEIGHTS, one) for one in face]) for face in insets
    )
    means, stds = np.stack([np.where(ahead[:, 0] < 0.0, front, rear), sides], axis=-1)
    # Where the ray meets the faces: it enters through the last one.
    steepness = np.maximum(np.abs(ahead), LEAST_COSINE)
    distances = -(np.sign(ahead) * sensor + half)
    lowest, here = (distances / steepness).max(axis=1), (distances + means) / steepness
    entered = here.argmax(axis=1)[:, None]
    entry, std = (
        np.take_along_axis(one, entered, axis=1)[:, 0] for one in (here, stds / steepness)
    )
    ranges = expected(pose_and_size, rays.sensor, rays.directions, table.arrays)[0]
    moved = np.clip(entry - ranges, 0.0, entry - lowest)
    std[moved == 0.0] = 0.0
    # Its own ends and sides differ from the class's in all scans alike. Along a face, none moves.
    inwards = np.sign(ahead) * stds
    shared, stds = inwards[:, None] * turn, np.hypot(rays.stds, std)
    ranges = rays.ranges - moved if of_class else rays.ranges
    return replace(rays, ranges=ranges, stds=stds, shared=shared)


def associate(
    rays: Rays, pose_and_size: np.ndarray, covariance: np.ndarray, sight: Sight
) -> np.ndarray:
    """Indices (m,) of the points in the gate round the predicted target, ascending.

    `pose_and_size` (5,) is a state as `expected` takes it, `covariance` (5, 5) its covariance. A
    point is in the gate if its range fits, and its ray passes by the visible shape by no more than
    the state's uncertainty allows.
    """
    if not len(rays.ranges):
        return np.zeros(0, np.int64)
    ranges, misses, stds = expected(pose_and_size, rays.sensor, rays.directions, sight.table.arrays)
    across = np.einsum("ni,ij,nj->n", rays.normals, covariance[:2, :2], rays.normals)
    along = covariance[0, 0] + covariance[1, 1] - across
    turned = 0.25 * np.hypot(*sight.table.extents) ** 2 * covariance[2, 2]
    grown = (0.5 * sight.table.extents * np.exp(pose_and_size[3:])) ** 2 * np.diag(covariance)[3:]
    along, across = along + turned, across + turned
    along += (rays.directions @ rotation(pose_and_size[2])) ** 2 @ grown
    errors = rays.ranges - ranges - sight.bias_per_std * rays.stds
    fits = np.abs(errors) < NEAR + GATE_STDS * np.sqrt(rays.stds**2 + stds**2 + along)
    meets = misses < 0.5 * NEAR + GATE_STDS * np.sqrt(across)
    inside = fits & meets & ~rays.others
    if inside.any():
        inside &= _of_target(rays.labels, inside)
    return np.flatnonzero(inside)


def _of_target(labels: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Which points (n,) are of a segment that may be the target's.

    Half of its points are in the gate, or it has half of the points that are: the target may touch
    a wall.
    """
    counts = np.bincount(labels)
    within = np.bincount(labels, weights=inside, minlength=len(counts))
    return ((within >= 0.5 * counts) | (within >= 0.5 * inside.sum()))[labels]


def segments(bearings: np.ndarray, points_world: np.ndarray, stds: np.ndarray) -> np.ndarray:
    """Labels (n,) of the stretches of neighbouring rays whose points are near each other.

    They are so up to `GAP` and four standard deviations, `stds` (n,) m. A label is the place of its
    first point in the order of `bearings` (n,). A neighbour is one of the next few: between them
    may be points of clutter, or of other objects at the same bearing.
    """
    order, labels = np.argsort(bearings, kind="stable"), np.arange(len(bearings))
    _join(labels, points_world[order], stds[order], GAP)
    labels[order] = labels.copy()
    return labels


@njit(cache=True)
def _join(labels, points, stds, gap):
    """Give points the label of one of the `NEIGHBOURS` before them that is near, and join both."""
    for i in range(len(labels)):
        for j in range(max(i - NEIGHBOURS, 0), i):
            apart = hypot(points[i, 0] - points[j, 0], points[i, 1] - points[j, 1])
            if apart <= gap + 2.0 * (stds[i] + stds[j]):
                first, second = min(labels[i], labels[j]), max(labels[i], labels[j])
                for k in range(second, i + 1):
                    if labels[k] == second:
                        labels[k] = first


def sampling_inset(rays: Rays, sight: Sight) -> tuple[float, float]:
    """How far inside the visible shape's limits the first and last ray fall, m; its variance, m².

    A limit is anywhere between the last ray that hits and its neighbour, which does not. Far away,
    where the rays are farther apart than where the shape was learned, that is more than it knows.
    """
    if len(rays.bearings) < 2 or np.isinf(sight.learned_inset):
        return 0.0, 0.0
    gaps = np.diff(np.sort(rays.bearings)) * rays.ranges.mean()
    gap, root = np.median(gaps), np.sqrt(np.mean(gaps**2))
    inset = max(0.5 * gap - sight.learned_inset, 0.0)
    # Where gaps are uneven, the points are anywhere on the target, as those of a radar.
    of_outline = root**2 / 12.0 + (root - gap) ** 2
    return inset, of_outline if sight.outline else inset**2 / 3.0
