"""Units of times and angles in the user's tables, and the scans at these times.

Sensors count seconds, milliseconds, microseconds or nanoseconds since 1970. float64 does not hold
such nanoseconds, so integers stay integers until the time of the first scan is subtracted.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.measurements.scans import FARTHEST
from stixel_cli.measurements.tables import indices, refuse_rows

TimeUnit = Literal["s", "ms", "us", "ns"]
AngleUnit = Literal["rad", "deg"]

PER_SECOND: dict[str, int] = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}

SINCE_1970 = (FARTHEST, 4.1e9)
"""Range of times since 1970, s: years 1973 to 2099; Argoverse 2 has times of 1980."""

SAME_TIME = 1e-3
"""The times of one scan in two files may differ by this, s: files have rounded numbers."""


def unit_and_epoch(t: np.ndarray, unit: TimeUnit | None) -> tuple[str, int | None]:
    """The unit of times (n,), and the earliest in ns since 1970; None for other times.

    The user may state the `unit`; with None it is seconds, or the unit that gives times since 1970.
    """
    for name in PER_SECOND if unit is None else (unit,):
        size = t / PER_SECOND[name]
        if len(t) and SINCE_1970[0] < size.min() and size.max() < SINCE_1970[1]:
            return name, int(_nanoseconds(t, name).min())
    return unit or "s", None


def seconds(file: Path, t: np.ndarray, unit: TimeUnit | None, epoch: int | None) -> np.ndarray:
    """The column t (n,) of a file in s; times since 1970 relative to `epoch`, ns since 1970.

    Raises:
        UserError: if a time is too large, or only one of two files counts from 1970.
    """
    name, first = unit_and_epoch(t, unit)
    if len(t) and (first is None) != (epoch is None):
        raise UserError(f"{file}: t must count from 1970 in scans, ego and truth, or in none")
    if first is not None:
        return (_nanoseconds(t, name) - epoch) / 1e9
    hint = "" if unit else "; if its unit is not s, set measurement.time_unit=ms, us or ns"
    refuse_rows(
        file,
        ~(np.abs(t) <= FARTHEST * PER_SECOND[name]),
        lambda i: (
            f"t: {t[i]:g} {name} must be a number up to {FARTHEST:g} s, or a time since 1970{hint}"
        ),
    )
    return t / PER_SECOND[name]


def scan_indices(
    file: Path,
    table: Mapping[str, np.ndarray],
    times: np.ndarray,
    unit: TimeUnit | None,
    epoch: int | None,
) -> np.ndarray:
    """The scan (n,) int64 of each row of a table: its k, or without k the scan at its t.

    The scans are at `times` (K,) s. UserError if no scan has such a k, or the t is not its time.
    """
    if not table.keys() & {"k", "t"}:
        raise UserError(f"{file}: the column k (or t) is missing")
    if "k" in table:
        k, last = indices(file, "k", table["k"]), len(times) - 1
        refuse_rows(file, k > last, lambda i: f"k = {k[i]}, but the last scan is {last}")
    if "t" in table:
        t = seconds(file, table["t"], unit, epoch)
        if "k" not in table:
            k = np.searchsorted(0.5 * (times[1:] + times[:-1]), t)
        refuse_other_times(file, k, t, times[k], SAME_TIME)
    return k


def refuse_other_times(
    file: Path, k: np.ndarray, t: np.ndarray, expected: np.ndarray, tolerance: float
) -> None:
    """Raise UserError unless the t (n,) s of each row is that of its scan k, to `tolerance` s."""
    refuse_rows(
        file,
        np.abs(t - expected) > tolerance,
        lambda i: f"t = {t[i]:.6g} s, but scan k = {k[i]} is at {expected[i]:.6g} s",
    )


def in_radians(angles: np.ndarray, unit: AngleUnit) -> np.ndarray:
    """Angles, or rates of angles, of a `unit` in rad."""
    return np.radians(angles) if unit == "deg" else angles


def _nanoseconds(t: np.ndarray, unit: str) -> np.ndarray:
    """Times (n,) since 1970 as int64 ns: exactly those of integers, the nearest of floats."""
    whole, rest = np.divmod(t, 1)
    factor = 10**9 // PER_SECOND[unit]
    return whole.astype(np.int64) * factor + np.rint(rest * factor).astype(np.int64)
