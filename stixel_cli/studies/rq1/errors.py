"""RQ1: the errors of stages as tidy tables, one row per stixel, column, zone or frame.

`Errors.estimate` sums up a measure with its interval. The unit is a pose: a frame of one road user,
with all of its seeds, which may differ in the shape of the road user. Pixels and stixels of a frame
share its errors, so they are not independent. Poses are drawn separately for each road user.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
import pandas as pd

from stixel_cli.errors import counted
from stixel_cli.geometry.rig import Rig
from stixel_cli.report.intervals import bootstrap_interval, bootstrap_weights
from stixel_cli.report.statistics import Statistic
from stixel_cli.report.tables import chosen
from stixel_cli.results.result import RunResult
from stixel_cli.validation.stage_tables import stage_tables

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

    def mean(self, sums: np.ndarray) -> np.ndarray:
        """The measure (...) of sums (..., 2) of values and of what they are divided by."""
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = sums[..., 0] / sums[..., 1]
            return np.sqrt(mean) if self.root else mean

    def sums(self, rows: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
        """Poses (n,) and the sums (n, 2) of values and of what they are divided by."""
        poses, place = np.unique(rows["pose"].to_numpy(), return_inverse=True)
        values = rows[self.value].to_numpy(np.float64)
        known = np.isfinite(values)
        per = rows[self.per].to_numpy(np.float64) if self.per else known * 1.0
        if self.root and not self.per:
            values = values**2
        sums = (np.bincount(place, w, len(poses)) for w in (np.where(known, values, 0.0), per))
        return poses, np.stack(list(sums), axis=1)


@dataclass(frozen=True)
class Errors:
    """The errors of some runs.

    Attributes:
        runs: by their number.
        tables: `stixels` on the target without gross errors, `every_stixel` with them, `columns`,
            `pixels` of a zone, `frames`, and `target`, the frames that see it; each with `run`, its
            number, `pose` and `depth`, m.
        label: of the setting.
    """

    runs: Mapping[int, RunResult]
    tables: Mapping[str, pd.DataFrame] = field(repr=False)
    label: str = "all"

    @property
    def rig(self) -> Rig:
        """The rig of the first run."""
        return next(iter(self.runs.values())).configuration.rig

    def by(self, name: Callable[[RunResult], str]) -> list["Errors"]:
        """Parts of the runs with the same `name`, in order of appearance."""
        parts: dict[str, dict[int, RunResult]] = {}
        for i, run in self.runs.items():
            parts.setdefault(name(run), {})[i] = run
        return [
            Errors(
                runs, {key: t[t["run"].isin(list(runs))] for key, t in self.tables.items()}, label
            )
            for label, runs in parts.items()
        ]

    def between(self, low: float, high: float) -> "Errors":
        """The rows of a depth in [low, high) m: of a stixel its own, else the target's."""
        inside = {
            key: rows[rows["depth"].between(low, high, inclusive="left")]
            for key, rows in self.tables.items()
        }
        return replace(self, tables=inside)

    def rows(self, measure: Measure) -> pd.DataFrame:
        """The rows that a measure is about."""
        return chosen(self.tables[measure.table], **dict(measure.where))

    def poses(self, measure: Measure | None = None) -> int:
        """Number of poses that a measure is about; of all frames without one."""
        rows = self.tables["frames"] if measure is None else self.rows(measure)
        return rows["pose"].nunique()

    def estimate(self, measure: Measure, least: int = 1) -> Statistic:
        """The measure with its interval; without value from fewer than `least` rows or pixels."""
        rows = self.rows(measure)
        if (rows["pixels"].sum() if "pixels" in rows else len(rows)) < max(1, least):
            return Statistic()
        return _estimate(*measure.sums(rows), measure.mean, exact=False)

    def less(self, other: "Errors", measure: Measure) -> Statistic:
        """The measure minus that of another setting, at the poses where both have values."""
        (ours, our_sums), (theirs, their_sums) = (
            measure.sums(one.rows(measure)) for one in (self, other)
        )
        both, i, j = np.intersect1d(ours, theirs, return_indices=True)
        if not len(both):
            return Statistic()

        def apart(sums: np.ndarray) -> np.ndarray:
            return measure.mean(sums[..., :2]) - measure.mean(sums[..., 2:])

        return _estimate(both, np.concatenate([our_sums[i], their_sums[j]], axis=1), apart, True)


def errors_of(runs: Iterable[RunResult], columns: str = "") -> Errors:
    """The errors of runs; `columns`: "" without the image's columns, "target" or "all"."""
    runs = tuple(runs)
    users = sorted({road_user(run) for run in runs})
    parts: dict[str, list[pd.DataFrame]] = {}
    for i, run in enumerate(runs):
        for record in run.load("stage_errors"):
            k = record.first + np.arange(len(record.target_depth))
            poses = users.index(road_user(run)) * FRAMES_A_USER + k
            for name, rows in stage_tables(record, run.configuration.rig, columns).items():
                frame = rows.pop("frame")
                depth = rows.pop("depth", record.target_depth[frame])
                rows = {"run": i, "pose": poses[frame], "depth": depth, **rows}
                parts.setdefault(name, []).append(pd.DataFrame(rows))
    tables = {name: pd.concat(own, ignore_index=True) for name, own in parts.items()}
    tables["pixels"] = tables["pixels"][tables["pixels"]["pixels"] > 0]
    tables["target"] = tables["frames"][tables["frames"]["columns"] > 0]
    tables["stixels"] = chosen(tables["every_stixel"], gross=0.0)
    return Errors(dict(enumerate(runs)), tables)


def _estimate(
    poses: np.ndarray, sums: np.ndarray, of: Callable[[np.ndarray], np.ndarray], exact: bool
) -> Statistic:
    """What `of` makes of the sums over all poses, with the interval of a bootstrap.

    Without interval if every road user has one pose, no draw is finite, or all draws are equal
    (unless `exact`).
    """
    value = float(of(sums.sum(axis=0)))
    mean = value if np.isfinite(value) else None
    users = poses // FRAMES_A_USER
    if len(users) - len(np.unique(users)) < 2:
        return Statistic(mean)
    drawn = of(_weights(tuple(users.tolist())) @ sums * len(poses))
    drawn = drawn[np.isfinite(drawn)]
    least = -1.0 if exact else 1e-12 * max(1.0, abs(value))
    if len(drawn) == 0 or np.ptp(drawn) <= least:
        return Statistic(mean)
    return Statistic(mean, *bootstrap_interval(drawn))


@lru_cache(maxsize=16)
def _weights(strata: tuple[int, ...]) -> np.ndarray:
    return bootstrap_weights(strata, "poses")


def road_user(run: RunResult) -> str:
    """The class of the run's road user."""
    return run.configuration.road_user.kind


def matcher(run: RunResult) -> str:
    """Name of the run's stereo matcher."""
    stereo = run.configuration.stereo
    kinds = {"phase_table": " (phase table)", "parabola": " (one match)"}
    return "SGM" + kinds.get(stereo.subpixel, "") if stereo.kind == "sgm" else "BM"


def grid(run: RunResult) -> str:
    """Name of the run's occupancy grid."""
    return run.configuration.occupancy.kind.replace("_", "-")


def rig(run: RunResult) -> str:
    """Name of the run's rig: the option's, or its size if the study has only one rig."""
    of = run.configuration.rig
    name = run.setting.get("rig", f"{of.width} × {of.height}")
    return {"kitti": "KITTI"}.get(name, name.replace("_", "-"))


def contrast(run: RunResult) -> str:
    """Contrast of the road user's paint, 0 … 1."""
    return f"{run.configuration.road_user.contrast:g}"


def needed_disparity(rig: Rig) -> float:
    """Disparity's standard deviation, px, that gives `SW_STD` at `SW_DEPTH`: f B σ_z / z²."""
    return rig.focal * rig.baseline * SW_STD / SW_DEPTH**2


def counts(lines: Iterable[Errors], poses: bool = True) -> str:
    """Numbers of poses and seeds behind a line of a figure or table, for its caption."""
    lines = list(lines)
    seeds = _numbers({len({run.seed for run in one.runs.values()}) for one in lines}, "seed")
    per_line = f"{_numbers({one.poses() for one in lines}, 'pose')} per line, " if poses else ""
    return f"{per_line}{seeds} per pose"


def _numbers(numbers: set[int], what: str) -> str:
    least, most = min(numbers), max(numbers)
    return counted(most, what) if least == most else f"{least} to {most} {what}s"


def of_pixels(zone: int) -> dict[str, Measure]:
    """Density, gross share, bias and RMS of the disparities in a zone."""
    where = (("zone", zone),)
    return {
        "density": Measure("pixels", "valid", "pixels", where=where),
        "gross": Measure("pixels", "gross", "valid", where=where),
        "bias": Measure("pixels", "total", "fine", where=where),
        "RMS": Measure("pixels", "squares", "fine", True, where),
    }


def phase(zone: int, i: int) -> Measure:
    """Mean error of the disparities of one fractional part, in a zone."""
    return Measure("pixels", f"phase {i}", f"in phase {i}", where=(("zone", zone),))


def of_columns(value: str, step: str = "path", root: bool = False, all_: bool = False) -> Measure:
    """A measure of columns, of the target or of the whole image, after a step."""
    where = (("step", step), *(() if all_ else (("of_target", True),)))
    return Measure("columns", value, "", root, where)


def bias(value: str) -> Measure:
    """Mean of a column of the stixels on the target."""
    return Measure("stixels", value)


def rms(value: str) -> Measure:
    """Root of the mean square of a column of the stixels on the target."""
    return Measure("stixels", value, root=True)


PIXELS = of_pixels(INSIDE)
BIAS, RMS, RMS_PX = bias("error"), rms("error"), rms("disparity")
NEES, SIGMA, WITHIN_1, WITHIN_2 = bias("ratio²"), bias("sigma"), bias("in 1"), bias("in 2")
STIXEL_GROSS = Measure("every_stixel", "gross")
UNCOVERED, UNSEEN = Measure("target", "uncovered", "columns"), Measure("target", "unseen", "shown")
ELSEWHERE = Measure("target", "elsewhere", "columns")
STIXELS_A_FRAME, OVERHANG = Measure("target", "stixels"), Measure("target", "overhang")
