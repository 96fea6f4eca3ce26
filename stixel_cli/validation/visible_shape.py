"""What is known of a class, estimated from drawn shapes, simulated scans and their ground truth.

All shapes are scaled to one box, that of the class, in all poses of the limbs: what differs between
road users of one size, and what swings, is then an error of the class's shape.

The outline is the mean over the drawn outlines. The visible shape is a regression of the points'
distance behind this outline, along their rays, on aspect and offset: bilinear between nodes, with a
penalty on differences of neighbouring nodes, which fills aspects without points; mirrored, as road
users have two equal sides; and with weights that fall for outliers (Cauchy), since points of the
background are among the scans.
"""

from collections.abc import Sequence

import numpy as np

from stixel_cli.geometry.pose import target_from_world
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.mesh import Mesh, corners
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.contour.class_shape import (
    HEIGHTS,
    LIMB_MODES,
    MODE_ANGLES,
    MODES,
    NODES,
    ClassShape,
    OutlineModes,
    VisibleShape,
)
from stixel_cli.tracking.contour.ray_table import REACH, first_depths, outermost_radii, widths
from stixel_cli.tracking.contour.user_shape import RADII

_ANGLES = 2.0 * np.pi * np.arange(RADII) / RADII
_ALONG = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=-1)
"""Unit vectors (360, 2) along the rays at these angles."""

NEAR_OFFSET, NEAR_DEPTH = 0.3, 1.0
"""A point within this of the outline, m, across and along its ray, is taken as the target's."""

SMOOTHNESS, PULL = 10.0, 3.0
"""Weights, in points, of the difference of neighbouring nodes and of a node from the mean."""

LEAST_DEPTH_STD, LEAST_INSET_STD = 0.03, 0.015
"""Least standard deviations, m."""

ROUNDS = 4

TOWARDS_BOX = 2.0 / 3.0
"""How far the outline's extents are from the mean outline's (0) to the box's (1).

Of drawn pedestrians, 0 gives the best outlines and 1 the best boxes. Cars are best at 0.5.
"""

DRAWN_RAYS = (24, 10)
"""Even aspects, and even offsets over an outline's width, of the rays on drawn outlines."""


def class_shape_of(scenarios: Sequence[Scenario]) -> ClassShape:
    """The mean outline of the road users of `scenarios`, and the mean of their boxes.

    A mean of radii is smaller than the outlines that it is the mean of, where limbs swing or the
    place of mirrors differs. The outline is compared with that of an instant, its box with one that
    contains the limbs in all poses. So its extents are `TOWARDS_BOX` of the way from the mean's to
    the box.
    """
    size = np.mean([np.ptp(scenario.box_target, axis=0) for scenario in scenarios], axis=0)
    drawn = radii_of(_of_size(scenarios, size))
    outline = drawn.mean(axis=0)[:, None] * _ALONG
    extents = np.ptp(outline, axis=0)
    radii = outermost_radii(outline * (1.0 + TOWARDS_BOX * (size / extents - 1.0)), RADII)
    return ClassShape(outline=radii[:, None] * _ALONG, outline_stds=drawn.std(axis=0), size=size)


def outline_modes_of(scenarios: Sequence[Scenario], size: np.ndarray) -> OutlineModes:
    """How the outlines of road users, all of a box of `size` (2,) m, differ from their mean.

    Principal components, of the mean over the poses of the limbs and of what differs from it. Each
    road user counts twice, as it is and mirrored.
    """
    means, changes = [], []
    for scenario in scenarios:
        radii = radii_of(_of_size([scenario], size))
        for one in (radii, np.roll(radii[:, ::-1], 1, axis=1)):
            sampled = one[:, :: RADII // MODE_ANGLES]
            means.append(sampled.mean(axis=0))
            changes.append(sampled - means[-1])
    return OutlineModes(
        _principal(np.stack(means) - np.mean(means, axis=0), MODES),
        _principal(np.concatenate(changes), LIMB_MODES),
    )


def _principal(differences: np.ndarray, count: int) -> np.ndarray:
    """The first `count` principal components (count, N) of `differences` (n, N), with their std."""
    scaled = differences / np.sqrt(len(differences))
    _, stds, directions = np.linalg.svd(scaled, full_matrices=False)
    components = (stds[:, None] * directions)[:count]
    return np.pad(components, ((0, count - len(components)), (0, 0)))


BODY = 2
"""Index of the height at which a road user's sides are its body's."""


def height_insets_of(road_users: Sequence[Sequence[Mesh]]) -> np.ndarray:
    """How far inside its box a class is at each height: `class_shape.height_insets`.

    Of each road user the mean over its limb poses. A roof closes at the next height above it;
    higher up, only taller road users count. Sides are compared with those at `BODY`: a car's
    mirrors are wider.
    """
    found = []
    for meshes in road_users:
        reach = np.ma.mean([_reach_at_heights(corners(mesh)) for mesh in meshes], axis=0)
        widest = reach.max(axis=1, keepdims=True)
        widest[2] = reach[2, BODY]
        found.append(np.ma.maximum(widest - reach, 0.0))
    insets = np.ma.stack([np.ma.mean(found, axis=0), np.ma.std(found, axis=0)], axis=1)
    known = np.flatnonzero(~insets.mask.any(axis=(0, 1)))
    return insets.filled(0.0)[..., np.minimum(np.arange(len(HEIGHTS)), known.max(initial=0))]


def _reach_at_heights(triangles: np.ndarray) -> np.ma.MaskedArray:
    """How far (3, 16) m `triangles` (n, 3, 3) m reach to the rear, front and sides at `HEIGHTS`.

    0 at the next height above them, and masked higher up.
    """
    edges = np.roll(triangles, -1, axis=1) - triangles
    begin, edge = triangles.reshape(-1, 3, 1), edges.reshape(-1, 3, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (HEIGHTS - begin[:, 2]) / edge[:, 2]
        x, y = (begin[:, axis] + share * edge[:, axis] for axis in (0, 1))
    cut = (share >= 0.0) & (share <= 1.0)
    reach = np.stack([np.where(cut, one, -np.inf).max(axis=0) for one in (-x, x, np.abs(y))])
    top = np.flatnonzero(cut.any(axis=0)).max(initial=-1)
    reach[:, top + 1 : top + 2] = 0.0
    return np.ma.masked_invalid(reach)


def visible_outline_of(scenarios: Sequence[Scenario], shape: ClassShape) -> VisibleShape:
    """What a sensor sees that measures the outlines of the road users of `scenarios` themselves."""
    aspects = 2.0 * np.pi * (np.arange(DRAWN_RAYS[0]) + 0.5) / DRAWN_RAYS[0]
    share = (np.arange(DRAWN_RAYS[1]) + 0.5) / DRAWN_RAYS[1]
    low, high = (limit[:, None] for limit in widths(shape.outline, aspects))
    rows, ends = [], []
    for outline in _of_size(scenarios, shape.size):
        own_low, own_high = (limit[:, None] for limit in widths(outline, aspects))
        offsets = own_low + share * (own_high - own_low)
        behind = first_depths(outline, aspects, offsets)
        behind -= first_depths(shape.outline, aspects, offsets)
        place = (2.0 * offsets - low - high) / (high - low)
        columns = (aspects[:, None], offsets, low, high, behind, LEAST_DEPTH_STD, place)
        rows.append(np.stack(np.broadcast_arrays(*columns), axis=-1).reshape(-1, len(columns)))
        ends.append(np.column_stack([aspects, own_low - low]))
        ends.append(np.column_stack([-aspects, high - own_high]))
    found = np.concatenate(rows)
    found = found[np.abs(found[:, 4]) < NEAR_DEPTH]
    biases, _, depth_stds, _ = _depths(np.concatenate([found, _mirrored(found)]))
    aspect, inset = np.concatenate(ends).T
    insets, inset_stds = _insets(aspect, inset, np.zeros(len(inset)))
    return VisibleShape(biases, 0.0, depth_stds, 1.0, insets, inset_stds)


def visible_shape_of(samples: Sequence[tuple[Scenario, Scans]], shape: ClassShape) -> VisibleShape:
    """What a sensor sees of a class, from scenarios with its road users, and their scans."""
    scenes = [
        _points(scenario, scans, k, shape) for scenario, scans in samples for k in range(len(scans))
    ]
    seen = [points for points in scenes if len(points)]
    rows = np.concatenate(seen)
    biases, per_std, depth_stds, factor = _depths(np.concatenate([rows, _mirrored(rows)]))
    low = np.stack([points[np.argmin(points[:, 1])] for points in seen])
    high = np.stack([points[np.argmax(points[:, 1])] for points in seen])
    ends = np.concatenate([low, _mirrored(high)])
    sides = np.repeat([1.0, -1.0], len(low))
    insets, inset_stds = _insets(ends[:, 0], ends[:, 1] - ends[:, 2], sides)
    return VisibleShape(biases, per_std, depth_stds, factor, insets, inset_stds)


def radii_of(outlines: Sequence[np.ndarray]) -> np.ndarray:
    """Radii (n, 360) m of n outlines (M, 2) m."""
    return np.stack([outermost_radii(outline, RADII) for outline in outlines])


def _of_size(scenarios: Sequence[Scenario], size: np.ndarray) -> list[np.ndarray]:
    """The outlines (M, 2) m, one for each pose of the limbs, of road users with a box of `size`."""
    return [
        contour * (size / np.ptp(scenario.box_target, axis=0))
        for scenario in scenarios
        for contour in scenario.contours_target
    ]


def _points(scenario: Scenario, scans: Scans, k: int, shape: ClassShape) -> np.ndarray:
    """The target's points of scan k: rows (n, 7).

    The outline is that of the class, with the size of the target. Aspect rad; offset m; the
    outline's least and greatest offset m at that aspect; distance behind the outline m; standard
    deviation of the range m; offset in halves of the outline's width from its middle.
    """
    pose, sensor = scenario.target_poses_world[k], scans.sensor_poses_world[k]
    points = scans.points_world[scans.rows(k)]
    covariances = scans.covariances_world[scans.rows(k)]
    sight = points - sensor[:2]
    ranges = np.hypot(*sight.T)
    sight = sight / ranges[:, None]
    stds = np.sqrt(np.einsum("ni,nij,nj->n", sight, covariances, sight))
    origin = target_from_world(sensor[None, :2], pose)[0]
    body = target_from_world(points, pose)
    along = (body - origin) / ranges[:, None]
    aspect = np.arctan2(-along[:, 1], -along[:, 0])
    offset = along[:, 0] * origin[1] - along[:, 1] * origin[0]
    depth = np.einsum("ni,ni->n", body, along)
    scaled = shape.outline * (np.ptp(scenario.box_target, axis=0) / shape.size)
    low, high = widths(scaled, aspect)
    outline = first_depths(scaled, aspect, offset[:, None])[:, 0]
    behind = depth - outline
    place = (2.0 * offset - low - high) / (high - low)
    near = (offset > low - NEAR_OFFSET) & (offset < high + NEAR_OFFSET)
    near &= np.abs(behind) < np.maximum(NEAR_DEPTH, 3.0 * stds)
    return np.stack([aspect, offset, low, high, behind, stds, place], axis=-1)[near]


def _mirrored(rows: np.ndarray) -> np.ndarray:
    """The rows of `_points` as seen of the mirrored target."""
    aspect, offset, low, high, behind, stds, place = rows.T
    return np.stack([-aspect, -offset, -high, -low, behind, stds, -place], axis=-1)


def _aspect_weights(aspect: np.ndarray) -> np.ndarray:
    """Weights (n, 24) of the aspects' nodes, linear between two of them."""
    position = (aspect / (2.0 * np.pi) * NODES[0]) % NODES[0]
    gap = np.abs(position[:, None] - np.arange(NODES[0]))
    return np.maximum(1.0 - np.minimum(gap, NODES[0] - gap), 0.0)


def _penalty(aspects: int, offsets: int) -> np.ndarray:
    """Sum of squared differences of neighbouring nodes as a matrix."""
    turn = 2.0 * np.eye(aspects) - np.roll(np.eye(aspects), 1, 0) - np.roll(np.eye(aspects), -1, 0)
    steps = np.diff(np.eye(offsets), axis=0)
    return np.kron(turn, np.eye(offsets)) + np.kron(np.eye(aspects), steps.T @ steps)


def _regression(matrix: np.ndarray, weights: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Coefficients of nodes, a constant and one more column, with the penalty on the nodes."""
    penalty = np.zeros((matrix.shape[1],) * 2)
    nodes = NODES[0] * NODES[1]
    # The last two are one if all points of a sensor have the same standard deviation.
    penalty[-1, -1] = PULL * np.mean(matrix[:, -1] ** 2)
    penalty[:nodes, :nodes] = SMOOTHNESS * _penalty(*NODES) + PULL * np.eye(nodes)
    weighted = matrix * (weights / weights.mean())[:, None]
    return np.linalg.solve(weighted.T @ matrix + penalty, weighted.T @ values)


def _depths(rows: np.ndarray) -> tuple[np.ndarray, float, np.ndarray, float]:
    """`depth_biases`, `bias_per_std`, `depth_stds` and `std_factor` of rows as of `_points`."""
    behind, stds = rows[:, 4], rows[:, 5]
    # Weights (n, 9) of the offsets' nodes, linear between two of them.
    position = np.clip((rows[:, 6] / REACH + 1.0) * 0.5 * (NODES[1] - 1), 0.0, NODES[1] - 1)
    offsets = np.maximum(1.0 - np.abs(position[:, None] - np.arange(NODES[1])), 0.0)
    nodes = np.einsum("ni,nj->nij", _aspect_weights(rows[:, 0]), offsets)
    nodes = nodes.reshape(len(rows), -1)
    size = nodes.shape[1]
    matrix = np.column_stack([nodes, np.ones(len(rows)), stds])
    weights = 1.0 / (stds**2 + 0.1**2)
    for _ in range(ROUNDS):
        found = _regression(matrix, weights, behind)
        left = behind - matrix @ found
        scale = 0.5 * stds**2 + 0.1**2
        weights = 1.0 / (scale * (1.0 + left**2 / (4.0 * scale)))
    biases = (found[:size] + found[size]).reshape(NODES)

    # The variance of what is left: the nodes' own, and a share of the point's.
    matrix[:, -1] = stds**2
    squares = np.minimum(left**2, (0.25 + 2.0 * stds) ** 2)
    spread = _regression(matrix, 1.0 / (stds**2 + 0.1**2) ** 2, squares)
    variances = np.maximum((spread[:size] + spread[size]).reshape(NODES), LEAST_DEPTH_STD**2)
    return biases, float(found[-1]), np.sqrt(variances), float(np.sqrt(max(spread[-1], 0.1)))


def _insets(
    aspect: np.ndarray, inset: np.ndarray, side: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`insets` (2, 24) m and `inset_stds` of the insets (n,) m of low ends at `aspect` (n,) rad.

    The high ends are those of the mirrored target. `side` (n,) is 1 for a right end and -1 for a
    left one, by which the sensor differs: what is left of an object is hidden from the right camera
    of a stereo rig, and its matcher takes some of it for the object. 0: the sides are alike.
    """
    nodes, count = np.column_stack([_aspect_weights(aspect), side]), NODES[0]
    penalty = np.eye(count + 1)
    penalty[:count, :count] = 2.0 * _penalty(count, 1) + 0.3 * np.eye(count)
    pull = np.append(np.full(count, 0.3 * np.median(inset)), 0.0)
    weights = np.ones(len(nodes))
    for _ in range(ROUNDS + 2):
        weighted = nodes * weights[:, None]
        inverse = np.linalg.inv(weighted.T @ nodes + penalty)
        found = inverse @ (weighted.T @ inset + pull)
        left = inset - nodes @ found
        weights = 1.0 / (1.0 + (left / 0.08) ** 2)
    squares = inverse @ (weighted.T @ np.minimum(left**2, 0.3**2) + 0.3 * 0.06**2)
    stds = np.sqrt(np.maximum(squares[:count], LEAST_INSET_STD**2))
    other_side, (found, by_side) = -np.arange(count) % count, np.split(found, [count])
    insets = np.stack([found + by_side, found[other_side] - by_side])
    return insets, np.stack([stds, stds[other_side]])
