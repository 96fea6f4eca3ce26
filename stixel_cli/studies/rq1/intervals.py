"""RQ1: estimates with bootstrap intervals over poses.

The unit is a pose: a frame of one road user, with all of its seeds, which may differ in the
shape of the road user. Pixels and stixels of a frame share its errors, so they are not independent.
Poses are drawn separately for each road user.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from stixel_cli.studies.inference import interval, weights
from stixel_cli.studies.rq1.pool import EDGES, LEAST, Group
from stixel_cli.studies.tables import quantity, with_interval
from stixel_cli.validation.stage_errors import GROSS
from stixel_cli.validation.stage_summary import column_kinds, in_range

Statistic = Callable[[np.ndarray], np.ndarray]
"""Returns a number (…) from sums (…, m) over frames."""


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval; NaN without values, and for the ends if all poses agree."""

    value: float
    low: float
    high: float

    def text(self, unit: str = "", sign: bool = False) -> str:
        """The number with its interval, as text."""
        if not np.isfinite(self.low):
            return quantity(self.value, unit, sign=sign)
        return with_interval(self.value, self.low, self.high, unit, sign)

    def scaled(self, factor: float) -> "Estimate":
        """In another unit."""
        return Estimate(*(factor * one for one in (self.value, self.low, self.high)))

    def share(self) -> str:
        """A share in per cent, as text."""
        return self.scaled(100.0).text("%")

    @property
    def cells(self) -> tuple[float | None, float | None, float | None]:
        """Value and ends for a table."""
        return tuple(
            float(one) if np.isfinite(one) else None for one in (self.value, self.low, self.high)
        )


NONE = Estimate(np.nan, np.nan, np.nan)


def estimate(group: Group, sums: np.ndarray, of: Statistic) -> Estimate:
    """A statistic of sums (n, m) over the group's frames; frames with only zeros do not count."""
    chosen = np.any(sums != 0.0, axis=1)
    if not chosen.any():
        return NONE
    poses, place = np.unique(group.poses[chosen], return_inverse=True)
    by_pose = np.zeros((len(poses), sums.shape[1]))
    np.add.at(by_pose, place, sums[chosen])
    value = float(of(by_pose.sum(axis=0)))
    strata = [group.pose_strata[pose] for pose in poses]
    if len(poses) - len(set(strata)) < 2:
        return Estimate(value, np.nan, np.nan)
    drawn = of(weights(strata, "poses") @ by_pose * len(poses))
    # Without scatter between the poses there is no interval.
    return _estimate(value, drawn, 1e-12 * max(1.0, abs(value)))


def cells(
    group: Group, sums: np.ndarray, columns: Mapping[str, Statistic]
) -> Iterator[float | None]:
    """Estimates and ends for the columns of a table; names that end in % are in per cent."""
    for name, of in columns.items():
        factor = 100.0 if name.endswith("%") else 1.0
        yield from estimate(group, sums, of).scaled(factor).cells


def difference(
    one: Group, other: Group, sums: Callable[[Group], np.ndarray], of: Statistic
) -> Estimate:
    """A statistic of one group minus that of another, paired by the poses that both have."""
    sides = [_by_pose(group, sums(group)) for group in (one, other)]
    both = sorted(set(sides[0]) & set(sides[1]))
    if not both:
        return NONE
    stacked = np.stack([np.concatenate([side[pose] for side in sides]) for pose in both])
    half = stacked.shape[1] // 2

    def apart(total: np.ndarray) -> np.ndarray:
        return of(total[..., :half]) - of(total[..., half:])

    strata = [user for user, _ in both]
    value = float(apart(stacked.sum(axis=0)))
    if len(both) - len(set(strata)) < 2:
        return Estimate(value, np.nan, np.nan)
    return _estimate(value, apart(weights(strata, "poses") @ stacked * len(both)), -1.0)


def _estimate(value: float, drawn: np.ndarray, least: float) -> Estimate:
    """The value with its interval, unless no draw is finite or their range is at most `least`."""
    drawn = drawn[np.isfinite(drawn)]
    if len(drawn) == 0 or np.ptp(drawn) <= least:
        return Estimate(value, np.nan, np.nan)
    return Estimate(value, *interval(drawn))


def _by_pose(group: Group, sums: np.ndarray) -> dict[tuple, np.ndarray]:
    """Sums over the seeds, by road user and frame."""
    found: dict[tuple, np.ndarray] = {}
    for pose, row in zip(group.poses, sums, strict=True):
        key = (group.pose_strata[pose], group.pose_frames[pose])
        found[key] = found.get(key, 0.0) + row
    return found


STIXEL_SUMS = ("count", "depth", "depth²", "disparity²", "square", "square²")
STIXEL_SUMS += ("ratio²", "in 1", "in 2", "height", "height²", "lateral²", "top", "top²", "base²")
STIXEL_SUMS += ("square depth", "base", "slanted", "slanted depth", "slanted²")


def stixel_sums(group: Group, low: float, high: float) -> np.ndarray:
    """`STIXEL_SUMS` (n, 20) of the stixels of a true depth in [low, high) m, without gross errors.

    `square` and `slanted` count the stixels whose own pixels are on such a face.
    """
    errors = group.errors.stixels
    fine = in_range(errors.true_depth, low, high) & (np.abs(errors.disparity) <= GROSS)
    frame = np.repeat(np.arange(len(errors.offsets) - 1), np.diff(errors.offsets))[fine]
    depth, ratio = errors.depth[fine], errors.depth[fine] / errors.sigma[fine]
    own, square, slanted = errors.own_depth[fine], errors.square[fine], errors.slanted[fine]
    rows = np.stack(
        [
            np.ones(len(depth)),
            depth,
            depth**2,
            errors.disparity[fine] ** 2,
            square,
            np.where(square, own, 0.0) ** 2,
            ratio**2,
            np.abs(ratio) <= 1.0,
            np.abs(ratio) <= 2.0,
            errors.height[fine],
            errors.height[fine] ** 2,
            errors.lateral[fine] ** 2,
            errors.top[fine],
            errors.top[fine] ** 2,
            errors.base[fine] ** 2,
            np.where(square, own, 0.0),
            errors.base[fine],
            slanted,
            np.where(slanted, own, 0.0),
            np.where(slanted, own, 0.0) ** 2,
        ],
        axis=-1,
    )
    sums = np.zeros((len(errors.offsets) - 1, len(STIXEL_SUMS)))
    np.add.at(sums, frame, rows)
    return sums


def gross_sums(group: Group, low: float, high: float) -> np.ndarray:
    """Stixels of a true depth in [low, high) m, and those of them with a gross error (n, 2)."""
    errors = group.errors.stixels
    chosen = in_range(errors.true_depth, low, high)
    gross = chosen & (np.abs(errors.disparity) > GROSS)
    before = np.zeros((len(chosen) + 1, 2))
    before[1:] = np.cumsum(np.stack([chosen, gross], axis=-1), axis=0)
    return np.diff(before[errors.offsets], axis=0)


def pixel_sums(
    group: Group, zone: int, low: float = EDGES[0], high: float = EDGES[-1]
) -> np.ndarray:
    """Pixels, valid, gross, total px, squares px² (n, 5) of the frames that see the target.

    Frames are in the range [`low`, `high`) m.
    """
    names = ("pixels", "valid", "gross", "total", "squares")
    found = np.stack([getattr(group.errors.disparity, name)[:, zone] for name in names], axis=-1)
    return found.astype(np.float64) * group.frames(low, high)[:, None]


def phase_sums(group: Group, zone: int, phase: int) -> np.ndarray:
    """Pixels and total px (n, 2) of a fractional part of the true disparity; see `phase_bias`."""
    of = group.errors.disparity
    return np.stack([of.phase_count[:, zone, phase], of.phase_total[:, zone, phase]], axis=-1)


def column_sums(
    group: Group,
    step: str,
    low: float = EDGES[0],
    high: float = EDGES[-1],
    of_target: bool = True,
) -> np.ndarray:
    """Sums (n, 10) over columns, of the frames that see the target, of a step (grid or path).

    Columns with an obstacle, missed ones, hits, and sums over the hits of error px, error² px²,
    depth error² m² and depth error m; then all columns, those with an obstacle below the threshold,
    and false positives: see `ColumnKinds`. `of_target`: only the target's columns.
    """
    columns = group.errors.columns
    true, found = columns.true.astype(np.float64), getattr(columns, step).astype(np.float64)
    chosen = group.frames(low, high)[:, None] & (columns.of_target if of_target else True)
    kinds = column_kinds(true, found, getattr(columns, f"{step}_there"))
    hit = kinds.hit & chosen
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.where(hit, found - true, 0.0)
        metres = group.rig.depth_from_disparity(found) - group.rig.depth_from_disparity(true)
    metres = np.where(hit, metres, 0.0)
    parts = (kinds.real & chosen, kinds.missed & chosen, hit, error, error**2, metres**2, metres)
    parts += (
        np.broadcast_to(chosen, true.shape),
        kinds.below_threshold & chosen,
        kinds.false_positive & chosen,
    )
    return np.stack([part.sum(axis=1) for part in parts], axis=-1).astype(np.float64)


def cover_sums(group: Group, low: float = EDGES[0], high: float = EDGES[-1]) -> np.ndarray:
    """Coverage of the target (n, 8), of the frames that see it.

    Frames; columns of the target; those in no stixel; those in a stixel elsewhere; stixels on the
    target; columns next to the target with its disparity; columns that show any of the target;
    those of them in no stixel of it.
    """
    errors = group.errors.stixels
    found = np.stack(
        [
            np.ones(len(errors.columns)),
            errors.columns,
            errors.columns - errors.covered,
            errors.covered - errors.matched,
            np.diff(errors.offsets),
            errors.overhang.sum(axis=1),
            errors.shown,
            errors.unseen,
        ],
        axis=-1,
    )
    return found * (group.frames(low, high) & (errors.columns > 0))[:, None]


def over_range(
    sums: Callable[[Group, float, float], np.ndarray], of: Statistic, least: int = LEAST
) -> Callable[[Group, float, float], Estimate]:
    """A function of a group and the ends of a range, m, that returns the estimate.

    It is NaN if the first of the `sums` is below `least`.
    """

    def value(group: Group, low: float, high: float) -> Estimate:
        found = sums(group, low, high)
        if found[:, 0].sum() < least:
            return NONE
        return estimate(group, found, of)

    return value


def ratio(part: int, whole: int = 0) -> Statistic:
    """A sum over another."""

    def of(sums: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore", divide="ignore"):
            return sums[..., part] / sums[..., whole]

    return of


def root(part: int, whole: int = 0, less: int | None = None) -> Statistic:
    """Root of a sum over another, or over the difference of another and a third."""

    def of(sums: np.ndarray) -> np.ndarray:
        count = sums[..., whole] - (sums[..., less] if less is not None else 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.sqrt(sums[..., part] / count)

    return of


def pixel_bias(sums: np.ndarray) -> np.ndarray:
    """Mean error px of `pixel_sums`."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return sums[..., 3] / (sums[..., 1] - sums[..., 2])


PIXEL_RMS = root(4, 1, less=2)
PIXEL_GROSS = ratio(2, 1)
PIXEL_DENSITY = ratio(1, 0)
STIXEL_BIAS, STIXEL_RMS, STIXEL_RMS_PX = ratio(1), root(2), root(3)
SQUARE_BIAS, SQUARE_RMS = ratio(15, 4), root(5, 4)
SLANTED_BIAS, SLANTED_RMS = ratio(18, 17), root(19, 17)
STIXEL_GROSS, NEES, WITHIN_1, WITHIN_2 = ratio(1), ratio(6), ratio(7), ratio(8)
HEIGHT_BIAS, HEIGHT_RMS, LATERAL_RMS = ratio(9), root(10), root(11)
TOP_BIAS, TOP_RMS, BASE_BIAS, BASE_RMS = ratio(12), root(13), ratio(16), root(14)
COLUMN_MISSED, COLUMN_BIAS = ratio(1, 0), ratio(3, 2)
COLUMN_RMS, COLUMN_RMS_M, COLUMN_BIAS_M = root(4, 2), root(5, 2), ratio(6, 2)
COLUMN_BELOW_THRESHOLD, COLUMN_FALSE_POSITIVE = ratio(8, 7), ratio(9, 7)
UNCOVERED, ELSEWHERE, UNSEEN = ratio(2, 1), ratio(3, 1), ratio(7, 6)
STIXELS_A_FRAME, OVERHANG = ratio(4), ratio(5)
PHASE_BIAS = ratio(1)
