"""Errors of estimated contours against true ones, one value per scan.

Conventions: K scans. The contours of all scans are polygons (K, M, 2) m in one frame, the first
vertex not repeated. Poses (K, 3) = x m, y m, heading rad in that frame. If a polygon is not finite,
its error is NaN. The functions compute all scans at once.
"""

from typing import Any

import numpy as np
import shapely

from stixel_cli.geometry.pose import rotations
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track

SAMPLES = 72
"""Points of a contour, even in arc length, where it is compared with another one."""

COVERED = 1.96
"""Standard deviations on both sides of the estimated contour: 95 % of a normal error."""

SHRUNK = 0.01
"""Parts of a target that are thinner than twice this, m, hide nothing of it."""

BESIDE = 0.5
"""A point this near to a used one, m, is likely to be of the same road user; one this near to the
true box is taken as measured on the target."""

RAYS = 720
"""Rays from the centre along which the best star-convex contour is sought."""

LIMB_SAMPLES = 4
"""Poses of the limbs, even in their cycle, that the upper bound is the mean over."""


def contour_errors(track: Track, scenario: Scenario) -> dict[str, np.ndarray]:
    """The errors of the contour at the n scans with a known truth, each (n,).

    The keys are fields of `ScanErrors`. All is computed in the frame of the true target, in which
    the truth is the same at all scans with equal poses of the limbs.
    """
    scans = np.flatnonzero(scenario.known)
    truth, limbs = scenario.target_poses_world[scans], scenario.limb_poses[scans]
    contours, true = scenario.contours_target, scenario.contours_target[limbs]
    places = in_frames(track.means[scans, None, :2], truth)[:, 0]
    headings = track.means[scans, 2] - truth[:, 2]
    estimated = in_frames(track.contours_world[scans], truth)
    sizes = None if track.box_sizes is None else track.box_sizes[scans]
    estimated_boxes, sides = boxes(estimated, np.column_stack([places, headings]), sizes)
    # The box of all poses of the limbs: that of a label.
    low, high = scenario.box_target
    corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    iou_box = overlaps(areas(estimated_boxes), areas(corners[None]))
    length, width = (sides - (high - low)).T
    errors: dict[str, Any] = {"iou_box": iou_box, "length": length, "width": width}
    if scenario.only_box or not len(scans):
        missing = ["iou", "gaussian_wasserstein", "hausdorff", "contour_distance", "seen_contour"]
        missing += ["hidden_contour", "band_coverage", "hidden_band_coverage"]
        return errors | {name: np.full(len(truth), np.nan) for name in missing}
    # The true outlines are made once for each pose of the limbs.
    outlines, true_outlines = areas(estimated), areas(contours)
    on_contours = even_points(contours)
    points = on_contours[limbs]
    to_true = boundary_distances(even_points(estimated), true)
    to_estimated = boundary_distances(points, estimated)
    both = np.concatenate([to_true, to_estimated], axis=1)
    sensors = in_frames(scenario.ego_poses_world[scans, None, :2], truth)[:, 0]
    seen = seen_points(on_contours, contours, limbs, sensors)
    directions = in_frames(track.contour_directions[scans], truth * [0.0, 0.0, 1.0])
    std = track.contour_std[scans]
    differences, std = differences_along_rays(places, directions, estimated, std, points)
    # A track of another program may have no standard deviations.
    covered = np.where(std > 0.0, np.abs(differences) <= COVERED * std, np.nan)
    return errors | {
        "iou": overlaps(outlines, true_outlines[limbs]),
        "gaussian_wasserstein": gaussian_wasserstein(estimated, true),
        "hausdorff": both.max(axis=1),
        "contour_distance": both.mean(axis=1),
        "seen_contour": _mean_where(seen, to_estimated),
        "hidden_contour": _mean_where(~seen, to_estimated),
        "band_coverage": covered.mean(axis=1),
        "hidden_band_coverage": _mean_where(~seen, covered),
    }


def _mean_where(chosen: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Means (n,) of the chosen values of each row of (n, S); NaN where none is chosen."""
    return np.ma.masked_array(values, ~chosen).mean(axis=1).filled(np.nan)


def in_frames(points: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Points (K, N, 2) m in the frames whose poses are (K, 3)."""
    return (points - poses[:, None, :2]) @ rotations(poses[:, 2])


def centre_errors(estimated_world: np.ndarray, true_world: np.ndarray) -> np.ndarray:
    """Distance (K,) m of the centres, the first two columns of (K, …)."""
    return np.hypot(*(estimated_world[:, :2] - true_world[:, :2]).T)


def points_of_target(scenario: Scenario, scans: Scans, k: int) -> np.ndarray:
    """Points (n, 2) m of scan `k` in the true target's frame, less than `BESIDE` off its box."""
    pose, (low, high) = scenario.target_poses_world[k : k + 1], scenario.box_target
    points = in_frames(scans.points_world[None, scans.rows(k)], pose)[0]
    return points[((points > low - BESIDE) & (points < high + BESIDE)).all(axis=1)]


def boxes(
    polygons: np.ndarray, poses: np.ndarray, sizes: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The least boxes along the headings: corners (K, 4, 2) m, counter-clockwise; sides (K, 2) m.

    The sides are the length along the heading and the width across it. With `sizes` (K, 2) m the
    boxes have these sides, and the poses as their centres.
    """
    if sizes is None:
        body = in_frames(polygons, poses)
        low, high = body.min(axis=1), body.max(axis=1)
    else:
        low, high = -0.5 * sizes, 0.5 * sizes
    x, y = np.stack([low, high], axis=-1).transpose(1, 0, 2)
    corners = np.stack([x[:, [0, 1, 1, 0]], y[:, [0, 0, 1, 1]]], axis=-1)
    return corners @ rotations(poses[:, 2]).transpose(0, 2, 1) + poses[:, None, :2], high - low


def area_moments(polygons: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean (K, 2) m and covariance (K, 2, 2) m² of the uniform density inside simple polygons.

    By Green's theorem, about each polygon's first vertex, so that the distance from the origin does
    not cost digits. A polygon without an area has the mean of its vertices, and covariance zero.
    """
    first = polygons[:, :1]
    a = polygons - first
    b = np.roll(a, -1, axis=1)
    # Cross products.
    parts = (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])[:, None]
    doubled, total = parts.sum(axis=2)[..., None], a + b
    flat = doubled[:, 0, 0] == 0.0
    doubled[flat] = 1.0
    means = parts @ total / (3.0 * doubled)
    second = sum((ends.transpose(0, 2, 1) * parts) @ ends for ends in (a, b, total))
    covariances = second / (12.0 * doubled) - means.transpose(0, 2, 1) * means
    means[flat], covariances[flat] = a[flat].mean(axis=1, keepdims=True), 0.0
    return (means + first)[:, 0], covariances


def gaussian_wasserstein(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Gaussian-Wasserstein distance (K,) m of the uniform areas inside two polygons each.

    d² = ‖m₁ - m₂‖² + tr(C₁ + C₂ - 2 (C₁^½ C₂ C₁^½)^½), Yang, Baum, Granström 2016, *Metrics for
    performance evaluation of elliptic extended object tracking methods*. For 2 × 2 matrices the
    last trace is √(tr(C₁ C₂) + 2 √(det C₁ det C₂)).
    """
    (m1, c1), (m2, c2) = area_moments(estimated), area_moments(true)
    determinants = np.maximum(_determinant(c1) * _determinant(c2), 0.0)
    inner = np.einsum("kij,kji->k", c1, c2) + 2.0 * np.sqrt(determinants)
    traces = np.trace(c1, axis1=1, axis2=2) + np.trace(c2, axis1=1, axis2=2)
    square = ((m1 - m2) ** 2).sum(axis=1) + traces - 2.0 * np.sqrt(np.maximum(inner, 0.0))
    return np.sqrt(np.maximum(square, 0.0))


def _determinant(matrices: np.ndarray) -> np.ndarray:
    return matrices[:, 0, 0] * matrices[:, 1, 1] - matrices[:, 0, 1] * matrices[:, 1, 0]


def even_points(polygons: np.ndarray, count: int = SAMPLES) -> np.ndarray:
    """Points (K, count, 2) m on polygons, even in arc length, the first vertex first."""
    closed = np.concatenate([polygons, polygons[:, :1]], axis=1) @ [1.0, 1j]
    lengths = np.cumsum(np.abs(np.diff(closed, axis=1, prepend=closed[:, :1])), axis=1)
    wanted = lengths[:, -1:] * (np.arange(count) / count)
    found = np.empty((len(polygons), count), dtype=complex)
    for k in range(len(polygons)):
        found[k] = np.interp(wanted[k], lengths[k], closed[k])
    return np.stack([found.real, found.imag], axis=-1)


def boundary_distances(points: np.ndarray, polygons: np.ndarray) -> np.ndarray:
    """Distances (K, S) m of points (K, S, 2) from the outlines of polygons; NaN if not finite."""
    found = np.full(points.shape[:2], np.nan)
    finite = np.isfinite(polygons).all(axis=(1, 2)) & np.isfinite(points).all(axis=(1, 2))
    rings = shapely.linearrings(polygons[finite])
    found[finite] = shapely.distance(rings[:, None], shapely.points(points[finite]))
    return found


def seen_points(
    points: np.ndarray, contours: np.ndarray, poses: np.ndarray, sensors: np.ndarray
) -> np.ndarray:
    """Which points of a target's outline a sensor sees, (K, S).

    The target hides only itself. Its outline is first shrunk by `SHRUNK`, so that it does not hide
    its own points from a ray along it. A point is hidden if the line to the sensor meets the rest.

    Args:
        points: (L, S, 2) m, on the outlines of the L poses of its limbs.
        contours: (L, M, 2) m, these outlines.
        poses: (K,), index of the pose of its limbs at each scan.
        sensors: (K, 2) m, in the frame of the outlines.
    """
    bodies = shapely.buffer(shapely.polygons(contours), -SHRUNK, quad_segs=1)
    shapely.prepare(bodies)
    ends = points[poses]
    lines = np.stack([np.broadcast_to(sensors[:, None], ends.shape), ends], axis=2)
    return ~shapely.intersects(bodies[poses, None], shapely.linestrings(lines))


def differences_along_rays(
    centres: np.ndarray,
    directions: np.ndarray,
    contours: np.ndarray,
    std: np.ndarray,
    points: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """How far points are outside estimated star-convex contours, along rays from their centres.

    Args:
        centres: (K, 2) m.
        directions: (K, M, 2) unit vectors to the contours' points, counter-clockwise, over one
            turn.
        contours: (K, M, 2) m.
        std: (K, M) m, standard deviations of the contours' distances from the centres.
        points: (K, S, 2) m.

    Returns:
        The differences (K, S) m, negative inside, and standard deviations (K, S) m, interpolated
        by angle.
    """
    turn = 2.0 * np.pi
    offsets = points - centres[:, None]
    bearings = np.arctan2(directions[..., 1], directions[..., 0])
    starts = np.mod(bearings - bearings[:, :1], turn)
    angles = np.mod(np.arctan2(offsets[..., 1], offsets[..., 0]) - bearings[:, :1], turn)
    before = np.empty(angles.shape, dtype=np.int64)
    for k in range(len(angles)):
        before[k] = np.searchsorted(starts[k], angles[k], side="right")
    before = np.maximum(before - 1, 0)
    after = (before + 1) % contours.shape[1]
    start = np.take_along_axis(starts, before, 1)
    width = np.mod(np.take_along_axis(starts, after, 1) - start, turn)
    along = angles - start
    radii = np.hypot(*np.moveaxis(contours - centres[:, None], -1, 0))
    first, second = (np.take_along_axis(radii, at, 1) for at in (before, after))
    # The edge between two vertices at the angles 0 and `width`, met by the ray at `along`.
    sines = first * np.sin(along) + second * np.sin(width - along)
    with np.errstate(divide="ignore", invalid="ignore"):
        met = np.where(sines > 0.0, first * second * np.sin(width) / sines, 0.0)
        weight = along / width
    std_before, std_after = (np.take_along_axis(std, at, 1) for at in (before, after))
    deviations = (1.0 - weight) * std_before + weight * std_after
    return np.hypot(offsets[..., 0], offsets[..., 1]) - met, deviations


def areas(polygons: np.ndarray) -> np.ndarray:
    """Valid shapely geometries (K,) of polygons; empty where a polygon is not finite.

    A polygon that crosses itself is repaired by shapely's `make_valid`: its area consists of the
    points that it encloses an odd number of times.
    """
    found = np.full(len(polygons), shapely.Polygon(), dtype=object)
    finite = np.isfinite(polygons).all(axis=(1, 2))
    found[finite] = shapely.polygons(polygons[finite])
    crossed = ~shapely.is_valid(found)
    found[crossed] = shapely.make_valid(found[crossed])
    return found


def overlaps(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Intersection over union (K,), 0 … 1, of geometries (K,) as of `areas`; 0 for two empty ones.

    `true` may be (1,), for all scans.
    """
    common = shapely.area(shapely.intersection(estimated, true))
    union = shapely.area(estimated) + shapely.area(true) - common
    return np.clip(np.divide(common, union, out=np.zeros_like(common), where=union > 0.0), 0.0, 1.0)


def baseline_overlaps(scenario: Scenario, scans: Scans) -> np.ndarray:
    """IoU (K,) of the true outline with itself, moved to the mean of the target's points.

    That is an estimate of the right shape and heading that takes the visible side, where the points
    are, for the whole target. NaN where the truth is unknown and at a scan without such points.
    """
    found = np.full(len(scans), np.nan)
    middle = 0.5 * np.sum(scenario.box_target, axis=0)
    for k in np.flatnonzero(scenario.known):
        points = points_of_target(scenario, scans, k)
        if len(points):
            true = scenario.contours_target[scenario.limb_poses[k]]
            moved = true - middle + points.mean(axis=0)
            (found[k],) = overlaps(areas(moved[None]), areas(true[None]))
    return found


def star_convex_upper_bound(scenario: Scenario) -> float:
    """The greatest IoU of the outline that a star-convex contour can have, such as `gp_ekf`'s.

    The mean over `LIMB_SAMPLES` poses of the limbs; NaN where the outline is unknown.
    """
    if scenario.only_box or not scenario.known.any():
        return np.nan
    contours = scenario.contours_target
    chosen = contours[:: max(1, len(contours) // LIMB_SAMPLES)]
    return float(np.mean([best_star_convex_iou(contour) for contour in chosen]))


def best_star_convex_iou(contour: np.ndarray) -> float:
    """The greatest IoU of the polygon `contour` (M, 2) m with a shape that is star-convex about 0.

    Such a shape has one radius along each ray. With the areas I inside and O outside the polygon
    and its area A, the IoU is I / (A + O). Its maximum is the s at which the greatest I - s (A + O)
    is 0 (Dinkelbach 1967, *On nonlinear fractional programming*), and that sum has its greatest
    value along each ray on its own.
    """
    angles = 2.0 * np.pi * (np.arange(RAYS) + 0.5) / RAYS
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    start, end = contour, np.roll(contour, -1, axis=0)
    # An edge is met where its ends are on different sides of the ray's line, in front of it.
    normals = np.stack([-directions[:, 1], directions[:, 0]], axis=-1)
    a, b = normals @ start.T, normals @ end.T
    along = directions @ start.T, directions @ end.T
    crossed = (a < 0.0) != (b < 0.0)
    weight = np.divide(a, a - b, out=np.zeros_like(a), where=crossed)
    ranges = along[0] + weight * (along[1] - along[0])
    ranges = np.where(crossed & (ranges > 0.0), ranges, np.inf)
    ranges = np.sort(ranges, axis=1)[:, : int((np.isfinite(ranges)).sum(axis=1).max())]
    # A ray from inside the polygon leaves it first; one from outside enters it first.
    inside = np.isfinite(ranges).sum(axis=1) % 2 == 1
    half = 0.5 * np.where(np.isfinite(ranges), ranges, 0.0) ** 2
    sign = np.where(np.arange(half.shape[1]) % 2 == 0, 1.0, -1.0) * np.where(inside, 1, -1)[:, None]
    leaves = np.isfinite(ranges) & (sign > 0.0)
    within = np.cumsum(sign * half, axis=1)
    outside = half - within
    area = float(np.where(leaves, within, 0.0).max(axis=1).sum())
    share = 0.0
    for _ in range(20):
        gains = np.where(leaves, within - share * outside, -np.inf)
        best = np.argmax(gains, axis=1)
        rows = np.arange(RAYS)
        used = gains[rows, best] > 0.0
        found = within[rows, best][used].sum() / (area + outside[rows, best][used].sum())
        if found <= share:
            break
        share = float(found)
    return share
