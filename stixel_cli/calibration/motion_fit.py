"""What the motion of its camera tells of a rig: its disparity error, and the length of its way."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from stixel_cli.calibration.tracks import Tracks, places_of, points_at
from stixel_cli.geometry.rig import Rig
from stixel_cli.geometry.rig_calibration import UNKNOWN_STD, RigCalibration, with_error
from stixel_cli.recordings.tables import read_poses
from stixel_cli.recordings.types import Tables

PLACE_STD = 0.3
"""Of a place and of a disparity, px: residuals of this size count half (Cauchy's weights).
Residuals show both to be as noisy: .12 and .12 px on a real clip, .06 and .07 px rendered."""

ROUNDS = 30

MATCHER_STD = 0.05
"""Error of matching over a whole recording, px: what an exact, rendered rig shows."""

LEAST_PAIRS = 6
"""Of images."""

LEAST_SHARE = 0.05
"""Of the points, in each third of the image."""

STRETCHES = 4
"""Of a recording, one after the other; each is held out once."""

RANGES = (8.0, 20.0)
"""Disparities between far, middle and near points, px."""

DISAGREEMENT = 0.2
"""Of far and near points, or of both halves, px, that is said."""


def calibrate_rig(
    tracks: Tracks, files: tuple[Path, ...], rig: Rig, tables: Tables, by_motion: bool
) -> RigCalibration:
    """The disparity error of a rig that its tracks show.

    With a rig that states its error, or not `by_motion`, that is the rig's.

    An error is found if pairs of images fit better, by more than twice the standard error, with the
    error that the pairs of other stretches of the recording show. Its standard deviations are such
    that far and near points, and both halves of the recording, agree.

    `files`, written as `tables` say, are those of the poses, to compare lengths; may be empty.
    """
    if not by_motion or rig.states_error:
        return RigCalibration(rig, "as the rig states")
    rig, count = replace(rig, disparity_error_std=UNKNOWN_STD), len(tracks.frames)
    found = RigCalibration(rig, f"{len(tracks.pairs)} points in {count} pairs of images")
    if count < LEAST_PAIRS:
        too_few = f"{LEAST_PAIRS} pairs of images are needed, with a motion of 1.5 m in ten frames"
        return replace(found, note=f"{too_few} and static points; {count} found")
    before = solve(tracks, rig)
    found = replace(found, median_before=_median(before))
    thirds = np.bincount((3 * tracks.places[:, 0] / rig.width).astype(int), minlength=3)
    if thirds.min() < LEAST_SHARE * thirds.sum():
        third = ("left", "middle", "right")[thirds.argmin()]
        found = replace(found, note=f"the {third} third of the image has too few points")
        return replace(found, **_length_ratio(before, rig, files, tables))
    together = np.zeros(len(tracks.pairs), dtype=int)
    after = solve(before.tracks, rig, together)
    stretch, gains = np.arange(count) * STRETCHES // count, np.zeros(count)
    for one in range(STRETCHES):
        held_out = stretch == one
        points = held_out[tracks.pairs]
        error = solve(after.tracks.chosen(~held_out), rig, together[~points]).error
        others = _corrected(after.tracks.chosen(held_out), error, rig)
        gain = _costs(before.residuals[points]) - _costs(solve(others, rig).residuals)
        gains[held_out] = np.bincount(others.pairs, gain) / np.bincount(others.pairs)
    halves = (2 * stretch >= STRETCHES).astype(int)[tracks.pairs]
    parts = np.digitize(tracks.disparities, RANGES), halves
    apart = np.max([_disagreement(after, one, rig) for one in parts], axis=0)
    calibrated = with_error(rig, after.error, after.covariance, np.hypot(apart, MATCHER_STD))
    differ = "near and far points, or the halves of the recording, differ by"
    note = f"{differ} {apart.max():.1f} px" if apart.max() > DISAGREEMENT else ""
    found = replace(found, columns=tracks.places[:, 0], errors=after.errors, note=note)
    # Both pairs of one first image have much in common.
    scatter = gains.std(ddof=1) / np.sqrt(len(np.unique(tracks.frames[:, 0])))
    if gains.mean() < 2.0 * scatter:
        error = rig.disparity_error_basis(rig.disparity_error_columns) @ after.error
        stds = np.minimum(np.hypot(calibrated.disparity_error_std, error), UNKNOWN_STD)
        rig = replace(rig, disparity_error_std=tuple(stds.round(3).tolist()))
        found = replace(found, note="pairs of images that are held out fit no better with it")
        return replace(found, rig=rig, **_length_ratio(before, rig, files, tables))
    lengths = _length_ratio(after, calibrated, files, tables)
    return replace(found, rig=calibrated, median_after=_median(after), **lengths)


def _corrected(tracks: Tracks, error: np.ndarray, rig: Rig) -> Tracks:
    """The tracks without an `error` (3,) px of their disparities."""
    errors = rig.disparity_error_basis(tracks.places[:, 0]) @ error
    return replace(tracks, disparities=tracks.disparities - errors)


def _median(solution: "Solution") -> float:
    return float(np.median(np.linalg.norm(solution.residuals, axis=1)))


def _costs(residuals: np.ndarray) -> np.ndarray:
    """Cauchy's cost (n,) of residuals (n, 2) px."""
    return np.log1p(np.sum(residuals**2, axis=1) / PLACE_STD**2)


def _length_ratio(
    solution: "Solution", rig: Rig, files: tuple[Path, ...], tables: Tables
) -> dict[str, float]:
    """The fields of `RigCalibration` on lengths; empty without poses that move.

    The standard deviation is of the pairs' scatter, and of the error that the `rig` states.
    """
    if not files:
        return {}
    places = read_poses(files, tables)[tables.first :, :, 3]
    first, second = solution.tracks.frames.T
    given = np.linalg.norm(places[second] - places[first], axis=1)
    if not (given > 0.0).all():
        return {}
    ratios = np.linalg.norm(solution.tracks.shifts, axis=1) / given
    ratio, variance = ratios.mean(), ratios.var(ddof=1) / len(np.unique(first))
    for change in rig.disparity_error_factor.T:
        moved = _corrected(solution.tracks, rig.disparity_error + change, rig)
        shifts = solve(moved, rig).tracks.shifts
        variance += (np.mean(np.linalg.norm(shifts, axis=1) / given) - ratio) ** 2
    return {"length_ratio": float(ratio), "length_ratio_std": float(np.sqrt(variance))}


def _disagreement(after: "Solution", groups: np.ndarray, rig: Rig) -> np.ndarray:
    """How far errors of `groups` (n,) of points are from that of all, (3,) px RMS.

    All groups share the motions, each has its own error; the mean counts each by its information.
    The columns are those of `disparity_error_std`.
    """
    found = solve(_corrected(after.tracks, after.error, rig), rig, groups)
    count = groups.max() + 1
    at = np.kron(np.eye(count), rig.disparity_error_basis(rig.disparity_error_columns))
    values = (at @ found.error).reshape(count, 3)
    weights = (1.0 / np.einsum("ni,ij,nj->n", at, found.covariance, at)).reshape(count, 3)
    return np.sqrt(np.sum(weights * values**2, axis=0) / np.sum(weights, axis=0))


@dataclass(frozen=True)
class Solution:
    """Coefficients (m,) of a disparity error with their covariance (m, m), and the motions.

    `tracks` have the new motions. `residuals` (n, 2) px are of the places in the second image,
    less what the noise of the disparities explains, and `errors` (n,) px are the disparity errors
    that would remove them.
    """

    error: np.ndarray
    covariance: np.ndarray
    tracks: Tracks
    residuals: np.ndarray
    errors: np.ndarray


def solve(tracks: Tracks, rig: Rig, groups: np.ndarray | None = None) -> Solution:
    """The disparity errors that all pairs of images share, and their motions, by least squares.

    Gauss-Newton with Cauchy's weights; the motions are eliminated pair by pair (Schur's
    complement). The true disparity of each point is estimated, too: with the measured one, ways
    would be too short. The covariance is that of independent residuals.

    Args:
        tracks: with at least one pair of images.
        rig: of the images, with the standard deviations of an error before it is estimated.
        groups: (n,) 0, 1, …, of the points; each group has its own three of the m coefficients.
            None: no error is estimated.
    """
    import cv2

    groups = np.full(len(tracks.pairs), -1) if groups is None else groups
    count = groups.max() + 1
    m, members = 3 * count, np.equal.outer(groups, np.arange(count))
    basis = members[:, :, None] * rig.disparity_error_basis(tracks.places[:, 0])[:, None]
    basis = basis.reshape(len(groups), m)
    prior = np.linalg.inv(rig.disparity_error_factor @ rig.disparity_error_factor.T)
    information = np.kron(np.eye(count), prior)
    error, measured, found = np.zeros(m), tracks.disparities, tracks
    ends = 2 * np.searchsorted(tracks.pairs, np.arange(1, len(tracks.frames)))
    for _ in range(ROUNDS):
        by_motion, by_error, residuals, true = _linearised(found, measured, rig)
        # The unknowns: a pair's motion, the coefficients; last, what they shall explain.
        slopes = np.concatenate([by_motion, by_error * basis[:, None, :], residuals], axis=2)
        weighted = slopes / (1.0 + np.sum(residuals**2, axis=1) / PLACE_STD**2)[:, None]
        rows = (np.split(one.reshape(-1, m + 7), ends) for one in (weighted, slopes))
        normal = np.array([left.T @ right for left, right in zip(*rows, strict=True)])
        # Relative damping, for unknowns of such different sizes.
        own, cross = normal[:, :6, :6] * (1.0 + 1e-9 * np.eye(6)), normal[:, :6, 6:]
        gain = np.linalg.solve(own, cross)
        reduced = np.sum(normal[:, 6:-1, 6:] - cross[:, :, :m].transpose(0, 2, 1) @ gain, axis=0)
        whole = reduced[:, :m] / PLACE_STD**2 + information
        side = reduced[:, m] / PLACE_STD**2 + information @ error
        change = -np.linalg.solve(whole, side)
        move = -gain[:, :, m] - gain[:, :, :m] @ change
        turns = np.array([cv2.Rodrigues(vector)[0] for vector in move[:, :3]])
        rotations, shifts = turns @ found.rotations, found.shifts + move[:, 3:]
        found = replace(found, disparities=true, rotations=rotations, shifts=shifts)
        error = error + change
        measured = tracks.disparities - basis @ error
        if np.abs(change).max(initial=0.0) < 1e-3 and np.abs(move).max() < 1e-4:
            break
    _, by_error, residuals, _ = _linearised(found, measured, rig)
    apart = np.sum(by_error * residuals, axis=(1, 2)) / np.sum(by_error**2, axis=(1, 2))
    found = replace(found, disparities=tracks.disparities)
    return Solution(error, np.linalg.inv(whole), found, residuals[:, :, 0], basis @ error - apart)


def _linearised(
    tracks: Tracks, measured: np.ndarray, rig: Rig
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives of the residuals (n, 2) px, the residuals, and the true disparities (n,) px.

    The derivatives are (n, 2, 6) by a further turn (rad) and shift (m), and (n, 2, 1) by the
    disparity error; the residuals are (n, 2, 1), of points with `measured` (n,) px. The disparities
    of the `tracks` are those by which to linearise: those that the last round returned.
    """
    linear = np.maximum(tracks.disparities, 0.5)
    points = points_at(tracks.places, linear, rig)
    turned = (tracks.rotations[tracks.pairs] @ points[:, :, None])[:, :, 0]
    points = turned + tracks.shifts[tracks.pairs]
    x, y, z = points[:, 0], points[:, 1], np.maximum(points[:, 2], 0.1)
    view = np.zeros((len(z), 2, 3))
    view[:, 0, 0], view[:, 0, 2] = rig.focal / z, -rig.focal * x / z**2
    view[:, 1, 1], view[:, 1, 2] = rig.focal_v / z, -rig.focal_v * y / z**2
    # Under a disparity error a point moves along its ray by p / d per px, under a turn w by w × p.
    by_error = view @ (turned / linear[:, None])[:, :, None]
    residuals = (places_of(points, rig) - tracks.moved)[:, :, None]
    residuals -= by_error * (measured - linear)[:, None, None]
    parts = np.concatenate([np.cross(turned[:, None, :], view), view, by_error, residuals], axis=2)
    # A disparity is measured as well as a place: a change of it explains a part of the residual.
    square = np.sum(by_error**2, axis=1)
    true = measured + (np.sum(by_error * residuals, axis=1) / (1.0 + square))[:, 0]
    share = (1.0 - 1.0 / np.sqrt(1.0 + square)) / square
    parts -= share[:, :, None] * by_error * (by_error.transpose(0, 2, 1) @ parts)
    return parts[:, :, :6], parts[:, :, 6:7], parts[:, :, 7:], true
