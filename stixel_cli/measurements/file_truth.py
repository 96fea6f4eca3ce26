"""The truth about scans from a file: the `truth.csv` or `truth.npz` that a run writes, or such a
table of another source.

One row per scan with a known pose: k (or t, s), x, y (m), heading (rad), optionally x_rate, y_rate,
heading_rate (m/s, rad/s; empty: unknown). The size is in the columns length and width (m), the same
in each row: then only the box is known. Or an `.npz` has the array `contour`, m, in the target's
frame: (M, 2), or (L, M, 2) for L poses of the limbs, of which the column limb_pose names one for
each row.
"""

from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import STATE, rectangle
from stixel_cli.measurements import tables
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario

POSE, RATES = STATE[:3], STATE[3:]
SIZE = ("length", "width")
LIMBS = ("limb_pose",)

SAME_SIZE = 1e-3
"""The size may differ between rows by this, m: files have rounded numbers."""

LEAST_SPEED = 0.5
"""A slower target has no direction of motion, m/s."""

GREATEST_ANGLE = 20.0
"""Degrees between a target's heading and its motion, above which a truth contradicts itself."""

MOST_RADIANS = 6.3
"""Greatest heading in radians, unless they are counted on over several turns."""

MOST_CORNERS = 100_000


def read_truth(
    scans: Scans,
    truth: str | None,
    time_unit: tables.TimeUnit | None = None,
    angle_unit: tables.AngleUnit = "rad",
) -> Scenario:
    """The truth in the file `truth` at the times of `scans`, and the sensor's poses.

    Poses of scans that the file lacks are NaN; without a file (None), all of them. Rates that the
    file lacks are differences of the poses over three known scans (two at the ends). The units are
    those of `read_scans`.
    """
    count = len(scans)
    poses, rates = np.full((2, count, 3), np.nan)
    contours, limb_poses, only_box = np.zeros((1, 0, 2)), np.zeros(count, np.int64), False
    if truth is not None:
        file = Path(truth)
        groups = (("k",), ("t",), RATES, SIZE, LIMBS)
        table = tables.read_table(file, POSE, groups, "contour", RATES)
        if "k" in table:
            table.pop("t", None)
        k = tables.scan_indices(file, table, scans.times, time_unit, scans.epoch)
        if len(np.unique(k)) < len(k):
            raise UserError(f"{file}: each scan must have one row only: give one target")
        if len(k) == 0:
            raise UserError(f"{file}: has no rows: without a truth leave out measurement.truth")
        for name in {"heading", "heading_rate"} & table.keys():
            table[name] = tables.in_radians(table[name], angle_unit)
        poses[k] = np.stack([table[name] for name in POSE], axis=1)
        if RATES[0] in table:
            rates[k] = np.stack([table[name] for name in RATES], axis=1)
        else:
            known = np.sort(k)
            rates[known] = differences(poses[known], scans.times[known])
        contours, only_box = _contours(file, table), "contour" not in table
        if len(contours) > 1:
            if LIMBS[0] not in table:
                has = f"contour has {len(contours)} poses"
                raise UserError(f"{file}: the column limb_pose is missing: {has}")
            limb_poses[k] = tables.indices(file, LIMBS[0], table[LIMBS[0]], len(contours))
    return Scenario(
        times=scans.times,
        ego_poses_world=scans.sensor_poses_world,
        target_poses_world=poses,
        target_rates_world=rates,
        contours_target=contours,
        limb_poses=limb_poses,
        only_box=only_box,
    )


def differences(poses_world: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Rates (n, 3) m/s, m/s, rad/s of poses (n, 3) at `times` (n,) s; zeros for a single pose."""
    if len(times) < 2:
        return np.zeros((len(times), 3))
    unwound = np.column_stack([poses_world[:, :2], np.unwrap(poses_world[:, 2])])
    return np.gradient(unwound, times, axis=0, edge_order=2 if len(times) > 2 else 1)


def heading_note(scenario: Scenario, angle_unit: tables.AngleUnit) -> str | None:
    """One line if the headings, read as `angle_unit`, contradict the motion or are no radians.

    A target that turns on and on may have headings beyond 2 pi rad, but along its motion.
    """
    headings = scenario.target_poses_world[scenario.known, 2]
    other: tables.AngleUnit = "rad" if angle_unit == "deg" else "deg"
    others = np.degrees(headings) if other == "rad" else np.radians(headings)
    angle, other_angle = _angle_to_motion(scenario, headings), _angle_to_motion(scenario, others)
    beyond = angle_unit == "rad" and np.abs(headings).max(initial=0.0) > MOST_RADIANS
    if beyond and not angle <= other_angle:
        return (
            f"measurement.truth: headings up to {np.abs(headings).max():.4g} are degrees and not "
            "radians: set measurement.angle_unit=deg"
        )
    if angle > GREATEST_ANGLE:
        return (
            f"measurement.truth: headings are {angle:.0f}° (median) away from the direction of "
            f"motion; with measurement.angle_unit={other} they are {other_angle:.0f}° away"
        )
    return None


def _angle_to_motion(scenario: Scenario, headings: np.ndarray) -> float:
    """Median angle between `headings` (n,) rad of the known scans and the target's motion, 0 … 90°;
    NaN if it is too slow."""
    velocity = scenario.target_rates_world[scenario.known, :2]
    moves = np.linalg.norm(velocity, axis=1) > LEAST_SPEED
    if not moves.any():
        return np.nan
    angles = headings[moves] - np.arctan2(*velocity[moves, ::-1].T)
    return float(np.degrees(np.median(np.abs(np.arcsin(np.sin(angles))))))


def _contours(file: Path, table: dict[str, np.ndarray]) -> np.ndarray:
    """The contours (L, M, 2) m, counter-clockwise: the array `contour`, else the box."""
    if "contour" in table:
        given = table["contour"]
        contours = given[None] if given.ndim == 2 else given
        corners = contours.shape[1] if contours.ndim == 3 and contours.shape[2] == 2 else 0
        if corners < 3 or not 1 <= len(contours) <= MOST_CORNERS // corners:
            raise UserError(
                f"{file}: contour has shape {given.shape}, must be (M, 2) or (L, M, 2) with M ≥ 3"
            )
        if not np.isfinite(contours).all():
            raise UserError(f"{file}: contour must have finite numbers only")
        import shapely  # Every run's tables import this module.

        areas = shapely.polygons(contours)
        if not (shapely.is_valid(areas) & (shapely.area(areas) > 0.0)).all():
            raise UserError(f"{file}: contour must be a polygon that does not cross itself")
        forward = shapely.is_ccw(shapely.get_exterior_ring(areas))[:, None, None]
        return np.where(forward, contours, contours[:, ::-1])
    if SIZE[0] not in table:
        raise UserError(f"{file}: the columns length and width are missing (or an array contour)")
    for name in SIZE:
        if table[name].min() <= 0.0:
            raise UserError(f"{file}: {name}: must be > 0 m, got {table[name].min():g}")
        if np.ptp(table[name]) > SAME_SIZE:
            raise UserError(f"{file}: {name}: must be the same in each row: the target is rigid")
    return rectangle(*(table[name][0] for name in SIZE))[None]
