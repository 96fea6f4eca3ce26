"""Tables of numbers from the user's files: columns of a `.csv` or of an `.npz`, and their units.

Sensors count seconds, milliseconds, microseconds or nanoseconds since 1970. float64 does not hold
such nanoseconds, so integers stay integers until the time of the first scan is subtracted.

What reads a file of the user, here and in the modules that use this, raises UserError in one line
that names file, place and cause.
"""

import csv
import io
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Literal

import numpy as np

from stixel_cli.border.files import read_arrays, read_text
from stixel_cli.errors import UserError, printable
from stixel_cli.measurements.scans import FARTHEST

MOST_SCANS = 100_000


def read_table(
    file: Path,
    needed: Sequence[str],
    together: Sequence[Sequence[str]] = (),
    other: str = "",
    gaps: Sequence[str] = (),
) -> dict[str, np.ndarray]:
    """The columns (n,) of a table, by name: float64, but a t of whole numbers int64.

    Unknown columns are left out, and the values of t are not checked.

    Args:
        file: `.csv` with a header, separated by commas, tabs, or semicolons (then also with decimal
            commas), or `.npz` with one array per column.
        needed: columns that must be there.
        together: groups of optional columns: all of a group, or no column of it.
        other: name of an array of an `.npz` of any shape, returned as it is.
        gaps: columns that may be empty, NaN, in rows in which the first two of them are: a
            sensor's returns without a point, and unknown rates.
    """
    suffix = file.suffix.lower()
    if suffix not in (".csv", ".npz"):
        raise UserError(f"{file}: must be a table with the suffix .csv or .npz")
    names = [*needed, *(name for group in together for name in group)]
    columns = _from_csv(file) if suffix == ".csv" else read_arrays(file)
    # `X [m]` means x.
    plain = {re.match(r"\w*", column.strip().lower())[0]: column for column in columns}
    for name in names:
        if name not in columns and name.lower() in plain:
            column = printable(plain[name.lower()])
            raise UserError(f"{file}: the column {column!r} must be named {name}")
    for name in (name for name in needed if name not in columns):
        raise UserError(f"{file}: the column {name} is missing (needed: {', '.join(needed)})")
    for group in together:
        absent = [name for name in group if name not in columns]
        if absent and len(absent) < len(group):
            raise UserError(
                f"{file}: the column {absent[0]} is missing: give all or none of {', '.join(group)}"
            )
    table = {name: _numbers(file, name, columns[name]) for name in names if name in columns}
    if len({len(column) for column in table.values()}) > 1:
        raise UserError(f"{file}: its columns must have equal lengths")
    empty = np.all([np.isnan(table[name]) for name in gaps[:2] if name in table], axis=0)
    must = f"must be a finite number, at most {FARTHEST:g}"
    for name, column in table.items():
        wrong = ~(np.abs(column) <= FARTHEST) & ~(empty & (name in gaps)) & (name != "t")
        refuse_rows(file, wrong, lambda i, n=name, c=column: f"{n}: {c[i]:g} {must}")
    if other in columns:
        table[other] = columns[other].astype(np.float64)
    return table


def indices(file: Path, name: str, column: np.ndarray, count: int = MOST_SCANS) -> np.ndarray:
    """The column `name` as int64; UserError unless all are whole numbers from 0 to `count` - 1."""
    refuse_rows(
        file,
        (column != np.floor(column)) | (column < 0) | (column >= count),
        lambda i: f"{name} must be a whole number from 0 to {count - 1}, got {column[i]:g}",
    )
    return column.astype(np.int64)


def refuse_rows(file: Path, wrong: np.ndarray, problem: Callable[[int], str]) -> None:
    """Raise UserError with the place and the `problem` of the first row that is `wrong` (n,) bool.

    The place is a line of a CSV, else an index in arrays.
    """
    if wrong.any():
        row = int(np.argmax(wrong))
        place = f"line {row + 2}" if file.suffix.lower() == ".csv" else f"row {row}"
        raise UserError(f"{file}: {place}: {problem(row)}")


def _from_csv(file: Path) -> dict[str, np.ndarray]:
    """The columns of a CSV as objects: texts, and NaN of empty cells."""
    import pandas

    text = read_text(file).rstrip("\r\n")
    header = text.partition("\n")[0]
    separator = max(",;\t", key=header.count)
    if separator == ";":  # Then commas are decimal commas.
        text = text.replace(",", ".")
    try:
        names = [name.strip() for name in next(csv.reader([header], delimiter=separator), ())]
        with warnings.catch_warnings():
            warnings.simplefilter("error", pandas.errors.ParserWarning)
            table = pandas.read_csv(
                io.StringIO(text),
                sep=separator,
                header=0,
                names=names,
                index_col=False,
                dtype=object,
                na_values=[""],
                keep_default_na=False,
                skip_blank_lines=False,
            )
    except (ValueError, csv.Error, pandas.errors.ParserWarning) as error:
        raise UserError(f"{file}: not a table: {printable(str(error), 200)}") from None
    return {name: column.to_numpy() for name, column in table.items()}


def _numbers(file: Path, name: str, column: np.ndarray) -> np.ndarray:
    if column.ndim != 1:
        raise UserError(f"{file}: {name} has shape {column.shape}, must be a column (n,)")
    if name == "t" and column.dtype.kind in "iuO":
        # As float64, ns since 1970 would be rounded to 256 ns.
        with suppress(ValueError, OverflowError):
            return column.astype(object).astype(np.int64)
    try:
        return column.astype(np.float64)
    except (ValueError, OverflowError):
        import pandas

        wrong = pandas.isna(pandas.to_numeric(column, errors="coerce")) & ~pandas.isna(column)
        refuse_rows(file, wrong, lambda i: f"{name}: {printable(str(column[i]))!r} is not a number")
        raise


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
    """The column t (n,) of a file in s; times since 1970 relative to `epoch`, ns since 1970."""
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

    def differs(i: int) -> str:
        return f"t = {t[i]:.6g} s, but scan k = {k[i]} is at {expected[i]:.6g} s"

    refuse_rows(file, np.abs(t - expected) > tolerance, differs)


def in_radians(angles: np.ndarray, unit: AngleUnit) -> np.ndarray:
    """Angles, or rates of angles, of a `unit` in rad."""
    return np.radians(angles) if unit == "deg" else angles


def _nanoseconds(t: np.ndarray, unit: str) -> np.ndarray:
    """Times (n,) since 1970 as int64 ns: exactly those of integers, the nearest of floats."""
    whole, rest = np.divmod(t, 1)
    factor = 10**9 // PER_SECOND[unit]
    return whole.astype(np.int64) * factor + np.rint(rest * factor).astype(np.int64)
