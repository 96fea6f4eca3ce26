"""Errors of a scan's points against the true contour, one by one.

Conventions: directions and distances are relative to the sensor. A *column* is a real number, px:
the place in the row of the left image, from its principal point to the right, -f tan(bearing). The
silhouette is the contour's interval of columns, cut at the image's borders.

A point is the *target's* if its column is in the silhouette widened by `SIDE_MARGIN` px, and its
distance from the first crossing of its ray with the contour is at most `GROSS` px, or at most
`DISPARITY_REACH` px and `RANGE_REACH` m. A point next to the silhouette is compared with the
nearest ray that meets the contour. Other points in the silhouette's columns are clutter; points
elsewhere belong to other objects. Errors are measured minus true.

At long range one pixel is more than `RANGE_REACH` metres (7 m at 34 m with the default rig): a
limit only in metres would cut off the errors to be measured.
"""

from dataclasses import dataclass

import numpy as np

from stixel_cli.geometry.kernel import first_hits
from stixel_cli.geometry.pose import rotation
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.rays import range_sensitivity
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario

SIDE_MARGIN = 10.0
GROSS = 1.0
DISPARITY_REACH = 3.0
RANGE_REACH = 2.0
_BEHIND = 0.1
"""A contour that comes nearer to the sensor's plane than this depth, m, has no silhouette."""


@dataclass(frozen=True)
class PointErrors:
    """Errors of N points of the target, of C columns that see it, and of K scans."""

    times: np.ndarray
    """(K,) s."""
    spacing: float
    """Columns from one point to its neighbour, px: the median; NaN if there are no neighbours."""
    scans: np.ndarray
    """(N,) int64, the scan of each point; within a scan by column."""
    columns: np.ndarray
    """(N,) px."""
    along: np.ndarray
    """(N,) m, error of the range."""
    disparities: np.ndarray
    """(N,) px, error of the disparity."""
    range_sensitivities: np.ndarray
    """(N,) m/px, change of range with disparity."""
    inside: np.ndarray
    """(N,) px from the nearer end of the silhouette; negative outside it."""
    covered: np.ndarray
    """(C,) whether a point of the target is within half of `spacing` of each column of the image, a
    pixel wide round its pixels' middles, in the silhouette of each scan."""
    reach_left: np.ndarray
    reach_right: np.ndarray
    """`reach_left`, `reach_right`: (K,) px, how far the scan's points, half of `spacing` round the
    outermost, go beyond either end of the silhouette; negative if they fall short; NaN where that
    end is not in the image, or no point is the target's."""
    columns_per_metre: np.ndarray
    """(K,) px that a metre across the rays is worth at the silhouette's ends, their mean; NaN where
    the target is not seen."""
    clutter: np.ndarray
    """(K,) int64, points in front of or behind the target in its columns."""


def point_errors(scans: Scans, scenario: Scenario, rig: Rig) -> PointErrors:
    """Errors of the points of all scans; for the conventions see the module.

    ValueError unless the scans' times are the scenario's.
    """
    if not np.array_equal(scans.times, scenario.times):
        raise ValueError("the times of the scans differ from those of the scenario")
    found = []
    for k, pose in enumerate(scenario.ego_poses_world):
        turn, points = rotation(pose[2]), scans.points_world[scans.rows(k)]
        contour = scenario.contour_world(k)
        found.append(_of_scan((contour - pose[:2]) @ turn, (points - pose[:2]) @ turn, rig))
    rows, seeing, spans, clutter = zip(*found, strict=True)
    apart = np.concatenate([np.diff(own[0]) for own in rows])
    spacing = float(np.median(apart)) if len(apart) else np.nan
    reach, covered = np.full((2, len(scans)), np.nan), []
    for k, ((own, *_), middles, (first, last, _)) in enumerate(
        zip(rows, seeing, spans, strict=True)
    ):
        covered.append(np.zeros(len(middles), dtype=bool))
        if len(own) and np.isfinite(spacing):
            # How far the outermost points go beyond the silhouette's ends.
            reach[:, k] = first - own[0] + 0.5 * spacing, own[-1] + 0.5 * spacing - last
            away = np.abs(own - middles[:, None]).min(axis=1)
            covered[k] = away <= 0.5 * spacing + 1e-6
    column, along, disparities, sensitivities, inside = np.hstack(rows)
    return PointErrors(
        times=np.array(scenario.times, dtype=np.float64),
        spacing=spacing,
        scans=np.repeat(np.arange(len(scans)), [own.shape[1] for own in rows]),
        columns=column,
        along=along,
        disparities=disparities,
        range_sensitivities=sensitivities,
        inside=inside,
        covered=np.concatenate(covered),
        reach_left=reach[0],
        reach_right=reach[1],
        columns_per_metre=np.array([span[2] for span in spans], dtype=np.float64),
        clutter=np.array(clutter, dtype=np.int64),
    )


def _of_scan(
    contour: np.ndarray, points: np.ndarray, rig: Rig
) -> tuple[np.ndarray, np.ndarray, tuple[float, float, float], int]:
    """Rows of the target's points (5, n) and its columns (c,), the silhouette's span, clutter."""
    unseen = np.zeros((5, 0)), np.zeros(0), (np.nan, np.nan, np.nan), 0
    if contour[:, 0].min() < _BEHIND:
        return unseen
    left, right = -0.5 - rig.u0, rig.width - 0.5 - rig.u0
    outline = -rig.focal * contour[:, 1] / contour[:, 0]
    first, last = outline.min(), outline.max()
    low, high = max(first, left), min(last, right)
    middles = np.arange(rig.width) - rig.u0
    seeing = middles[(middles >= low) & (middles <= high)]
    if len(seeing) == 0:
        return unseen
    points = points[points[:, 0] > _BEHIND]
    column = -rig.focal * points[:, 1] / points[:, 0]
    order = np.argsort(column, kind="stable")
    points, column = points[order], column[order]
    near = (column > low - SIDE_MARGIN) & (column < high + SIDE_MARGIN)
    points, column = points[near], column[near]

    met = np.clip(column, seeing[0], seeing[-1])
    met = np.where((column > low) & (column < high), column, met)
    bearing = -np.arctan(column / rig.focal)
    true = ranges_along(contour, -np.arctan(met / rig.focal))
    measured = np.hypot(points[:, 0], points[:, 1])
    along = measured - true
    disparity = rig.disparity_from_depth(points[:, 0])
    disparity = disparity - rig.disparity_from_depth(true * np.cos(bearing))
    sensitivity = range_sensitivity(true, bearing, rig)
    inside = np.minimum(column - low, high - column)
    own = (np.abs(disparity) <= DISPARITY_REACH) & (np.abs(along) <= RANGE_REACH)
    own |= np.abs(disparity) <= GROSS
    rows = np.vstack([column, along, disparity, sensitivity, inside])[:, own]

    ends = seeing[[0, -1]]
    # f / (r cos²) at a bearing, the inverse of the metres r cos² / f across one column.
    at_ends = ranges_along(contour, -np.arctan(ends / rig.focal))
    per_metre = (rig.focal + ends**2 / rig.focal) / at_ends
    margin = np.minimum(seeing - low, high - seeing)
    its_columns = seeing[margin >= 0.5 - 1e-9]
    first, last = np.where([first > left, last < right], [first, last], np.nan)
    span = first, last, float(per_metre.mean())
    return rows, its_columns, span, np.count_nonzero(~own & (inside > 0.0))


def ranges_along(contour_sensor: np.ndarray, bearings: np.ndarray) -> np.ndarray:
    """Range (n,) m to the first crossing along `bearings` (n,) rad, infinite without a crossing."""
    directions = np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
    return first_hits(contour_sensor, np.zeros_like(directions), directions)
