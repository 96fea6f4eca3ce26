"""RQ1: the errors of stages as tidy tables, one row per stixel, column, zone or frame.

`Errors.estimate` sums up a measure with its interval. The unit is a pose: a frame of one road user,
with all of its seeds, which may differ in the shape of the road user. Pixels and stixels of a frame
share its errors, so they are not independent. Poses are drawn separately for each road user.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.report.metrics import counted
from stixel_cli.report.statistics import interval, weights
from stixel_cli.report.tables import chosen
from stixel_cli.studies.data import StudyRun

if TYPE_CHECKING:
    import pandas as pd

EDGES = tuple(float(edge) for edge in range(5, 51, 5))
"""Ends of the ranges in the figures, m: true depth of the target's nearest surface."""
COARSE = ((5.0, 10.0), (10.0, 20.0), (20.0, 30.0), (30.0, 40.0), (40.0, 50.0))
"""The ranges of the tables, m."""
INSIDE, AT_BORDER, OTHERS = 0, 1, 2
"""Zones of the pixels, see `stage_errors.ZONES`."""
SW_DEPTH, SW_STD = 28.0, 0.1
"""Badino, Franke, Pfeiffer 2009 state an uncertainty below 0.1 m at 28 m."""
ROUND = (25.0, 31.0)
"""Range in which their value is compared, m."""
DEPTHS = {8.0: (6.0, 10.0), 15.0: (12.0, 18.0), 28.0: ROUND, 40.0: (36.0, 44.0)}
"""Depths at which rigs are compared, m, each with the ends of its range."""
LEAST = 5
"""A mean of fewer values is not shown."""
FRAMES_A_USER = 100_000
"""Number of a pose: that of its road user times this, plus that of its frame."""


@dataclass(frozen=True)
class Measure:
    """What is summed up of a table's rows.

    Attributes:
        table: one of `Errors.tables`.
        value: column whose mean it is; rows without a value do not count.
        per: column whose sum the sum of the values is divided by, in place of their number.
        root: whether it is the root of the mean square; with `per`, the values are squares.
        where: columns, each with the value that the rows have there.
    """

    table: str
    value: str
    per: str = ""
    root: bool = False
    where: tuple[tuple[str, Any], ...] = ()


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval; None without values, and for the ends if all poses agree."""

    mean: float | None = None
    low: float | None = None
    high: float | None = None

    def scaled(self, factor: float) -> "Estimate":
        """In another unit."""
        values = (self.mean, self.low, self.high)
        return Estimate(*(None if one is None else factor * one for one in values))


@dataclass(frozen=True)
class Errors:
    """The errors of some runs.

    Attributes:
        runs: in their order.
        tables: `stixels` on the target without gross errors, `every_stixel` with them, `columns`,
            `pixels` of a zone, `frames`, and `target`, the frames that see it; each with `run`, its
            place in `runs`, `pose` and `depth`, m.
        label: of the setting.
    """

    runs: tuple[StudyRun, ...]
    tables: "Mapping[str, pd.DataFrame]" = field(repr=False)
    label: str = "all"

    @property
    def rig(self) -> Rig:
        """The rig of the first run."""
        return self.runs[0].configuration.rig

    def by(self, name: Callable[[StudyRun], str]) -> list["Errors"]:
        """Parts of the runs with the same `name`, in order of appearance."""
        labels = [name(run) for run in self.runs]
        parts = []
        for label in dict.fromkeys(labels):
            kept = [i for i, own in enumerate(labels) if own == label]
            place = np.full(len(labels), -1)
            place[kept] = range(len(kept))
            tables = {
                key: rows[place[rows["run"]] >= 0].assign(run=lambda own, p=place: p[own["run"]])
                for key, rows in self.tables.items()
            }
            parts.append(Errors(tuple(self.runs[i] for i in kept), tables, label))
        return parts

    def between(self, low: float, high: float) -> "Errors":
        """The rows of a depth in [low, high) m: of a stixel its own, else the target's."""
        tables = {
            key: rows[(rows["depth"] >= low) & (rows["depth"] < high)]
            for key, rows in self.tables.items()
        }
        return replace(self, tables=tables)

    def rows(self, measure: Measure) -> "pd.DataFrame":
        """The rows that a measure is about."""
        return chosen(self.tables[measure.table], **dict(measure.where))

    def poses(self, measure: Measure) -> int:
        """Number of poses that a measure is about."""
        return self.rows(measure)["pose"].nunique()

    def estimate(self, measure: Measure, least: int = 1) -> Estimate:
        """The measure with its interval; without value from fewer than `least` rows or pixels."""
        rows = self.rows(measure)
        if (rows["pixels"].sum() if "pixels" in rows else len(rows)) < max(1, least):
            return Estimate()
        poses, sums = _pose_sums(rows, measure)
        if len(poses) - len(np.unique(poses // FRAMES_A_USER)) < 2:
            return Estimate(_finite(_mean(sums.sum(axis=0), measure)))
        return _estimate(poses, sums, lambda total: _mean(total, measure), False)

    def less(self, other: "Errors", measure: Measure) -> Estimate:
        """The measure minus that of another setting, at the poses where both have values."""
        sides = [_pose_sums(one.rows(measure), measure) for one in (self, other)]
        both, ours, theirs = np.intersect1d(sides[0][0], sides[1][0], return_indices=True)
        if not len(both):
            return Estimate()
        sums = np.concatenate([sides[0][1][ours], sides[1][1][theirs]], axis=1)

        def apart(total: np.ndarray) -> np.ndarray:
            return _mean(total[..., :2], measure) - _mean(total[..., 2:], measure)

        if len(both) - len(np.unique(both // FRAMES_A_USER)) < 2:
            return Estimate(_finite(apart(sums.sum(axis=0))))
        return _estimate(both, sums, apart, True)


def _pose_sums(rows: "pd.DataFrame", measure: Measure) -> tuple[np.ndarray, np.ndarray]:
    """Poses (n,) and the sums (n, 2) of values and of what they are divided by."""
    poses, place = np.unique(rows["pose"].to_numpy(), return_inverse=True)
    values = rows[measure.value].to_numpy(np.float64)
    known = np.isfinite(values)
    per = rows[measure.per].to_numpy(np.float64) if measure.per else known * 1.0
    if measure.root and not measure.per:
        values = values**2
    sums = (np.bincount(place, w, len(poses)) for w in (np.where(known, values, 0.0), per))
    return poses, np.stack(list(sums), axis=1)


def _mean(sums: np.ndarray, measure: Measure) -> np.ndarray:
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = sums[..., 0] / sums[..., 1]
        return np.sqrt(mean) if measure.root else mean


def _estimate(
    poses: np.ndarray, sums: np.ndarray, of: Callable[[np.ndarray], np.ndarray], exact: bool
) -> Estimate:
    """The value with its interval, unless no draw is finite; one without scatter if `exact`."""
    value = float(of(sums.sum(axis=0)))
    drawn = of(_weights(tuple((poses // FRAMES_A_USER).tolist())) @ sums * len(poses))
    drawn = drawn[np.isfinite(drawn)]
    least = -1.0 if exact else 1e-12 * max(1.0, abs(value))
    if len(drawn) == 0 or np.ptp(drawn) <= least:
        return Estimate(_finite(value))
    return Estimate(_finite(value), *interval(drawn))


@lru_cache(maxsize=16)
def _weights(strata: tuple[int, ...]) -> np.ndarray:
    return weights(strata, "poses")


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def road_user(run: StudyRun) -> str:
    """The class of the run's road user."""
    return run.configuration.road_user.kind


def phase(zone: int, i: int) -> Measure:
    """Mean error of the disparities of one fractional part, in a zone."""
    return Measure("pixels", f"phase {i}", f"in phase {i}", where=(("zone", zone),))


def matcher(run: StudyRun) -> str:
    """Name of the run's stereo matcher."""
    stereo = run.configuration.stereo
    kinds = {"phase_table": " (phase table)", "parabola": " (one match)"}
    return "SGM" + kinds.get(stereo.subpixel, "") if stereo.kind == "sgm" else "BM"


def grid(run: StudyRun) -> str:
    """Name of the run's occupancy grid."""
    return run.configuration.occupancy.kind.replace("_", "-")


def rig(run: StudyRun) -> str:
    """Name of the run's rig: the option's, or its size if the study has only one rig."""
    of = run.configuration.rig
    name = run.setting.get("rig", f"{of.width} × {of.height}")
    return {"kitti": "KITTI"}.get(name, name.replace("_", "-"))


def contrast(run: StudyRun) -> float:
    """Contrast of the road user's paint, 0 … 1."""
    return float(run.configuration.road_user.contrast)


def needed_disparity(rig: Rig, std: float, depth: float) -> float:
    """Disparity's standard deviation, px, that gives `std` m at `depth` m: f B σ_z / z²."""
    return rig.focal * rig.baseline * std / depth**2


def seeds(lines: Iterable[Errors]) -> str:
    """Number of seeds per pose."""
    return f"{_numbers({len({run.seed for run in one.runs}) for one in lines}, 'seed')} per pose"


def counts(lines: Iterable[Errors]) -> str:
    """Numbers of poses and seeds behind a line of a figure or table, for its caption."""
    lines = list(lines)
    poses = {one.tables["frames"]["pose"].nunique() for one in lines}
    return f"{_numbers(poses, 'pose')} per line, {seeds(lines)}"


def _numbers(numbers: set[int], what: str) -> str:
    least, most = min(numbers), max(numbers)
    return counted(most, what) if least == most else f"{least} to {most} {what}s"


def of_pixels(zone: int) -> tuple[Measure, Measure, Measure, Measure]:
    """Density, gross share, bias and RMS of the disparities in a zone."""
    where = (("zone", zone),)
    return (
        Measure("pixels", "valid", "pixels", where=where),
        Measure("pixels", "gross", "valid", where=where),
        Measure("pixels", "total", "fine", where=where),
        Measure("pixels", "squares", "fine", True, where),
    )


PIXEL_DENSITY, PIXEL_GROSS, PIXEL_BIAS, PIXEL_RMS = of_pixels(INSIDE)
BIAS, RMS = Measure("stixels", "error"), Measure("stixels", "error", root=True)
RMS_PX = Measure("stixels", "disparity", root=True)
SQUARE_BIAS, SQUARE_RMS = Measure("stixels", "square"), Measure("stixels", "square", root=True)
SLANTED_BIAS, SLANTED_RMS = Measure("stixels", "slanted"), Measure("stixels", "slanted", root=True)
STIXEL_GROSS, SIGMA = Measure("every_stixel", "gross"), Measure("stixels", "sigma")
NEES = Measure("stixels", "ratio²")
WITHIN_1, WITHIN_2 = Measure("stixels", "in 1"), Measure("stixels", "in 2")
HEIGHT_BIAS, HEIGHT_RMS = Measure("stixels", "height"), Measure("stixels", "height", root=True)
LATERAL_RMS = Measure("stixels", "lateral", root=True)
TOP_BIAS, TOP_RMS = Measure("stixels", "top"), Measure("stixels", "top", root=True)
BASE_BIAS, BASE_RMS = Measure("stixels", "base"), Measure("stixels", "base", root=True)
UNCOVERED, UNSEEN = Measure("target", "uncovered", "columns"), Measure("target", "unseen", "shown")
ELSEWHERE = Measure("target", "elsewhere", "columns")
STIXELS_A_FRAME, OVERHANG = Measure("target", "stixels"), Measure("target", "overhang")


def of_columns(value: str, step: str = "path", root: bool = False, all_: bool = False) -> Measure:
    """A measure of columns, of the target or of the whole image, after a step."""
    where = (("step", step), *(() if all_ else (("of_target", True),)))
    return Measure("columns", value, "", root, where)
