"""Tables of numbers from the user's files: columns of a `.csv` or of an `.npz`."""

import csv
import io
import re
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError, printable
from stixel_cli.files import read_arrays, read_text
from stixel_cli.measurements.scans import FARTHEST

MOST_SCANS = 100_000


def read_table(
    file: Path,
    needed: Sequence[str],
    together: Sequence[Sequence[str]] = (),
    other: str = "",
    returns: Sequence[str] = (),
) -> dict[str, np.ndarray]:
    """The columns (n,) of a table, by name: float64, but a t of whole numbers int64.

    Unknown columns are left out.

    Args:
        file: `.csv` with a header, separated by commas, tabs, or semicolons (then also with decimal
            commas), or `.npz` with one array per column.
        needed: columns that must be there.
        together: groups of optional columns: all of a group, or no column of it.
        other: name of an array of an `.npz` of any shape, returned as it is.
        returns: columns that may be empty, NaN, in rows in which the first two are: a sensor's
            returns without a point.

    Raises:
        UserError: in one line that names file, place and cause. The values of t are not checked.
    """
    suffix = file.suffix.lower()
    if suffix not in (".csv", ".npz"):
        raise UserError(f"{file}: must be a table with the suffix .csv or .npz")
    groups = [group for group in together if group]
    names = [*needed, *(name for group in groups for name in group)]
    columns = _from_csv(file) if suffix == ".csv" else read_arrays(file)
    # `X [m]` means x.
    plain = {re.match(r"\w*", column.strip().lower())[0]: column for column in columns}
    for name in names:
        if name not in columns and name.lower() in plain:
            column = printable(plain[name.lower()])
            raise UserError(f"{file}: the column {column!r} must be named {name}")
    missing = [name for name in needed if name not in columns]
    if missing:
        raise UserError(f"{file}: the column {missing[0]} is missing (needed: {', '.join(needed)})")
    for group in groups:
        absent = [name for name in group if name not in columns]
        if absent and len(absent) < len(group):
            raise UserError(
                f"{file}: the column {absent[0]} is missing: give all of {', '.join(group)}, or "
                "leave out all of them"
            )
    table = {name: _numbers(file, name, columns[name]) for name in names if name in columns}
    if len({len(column) for column in table.values()}) > 1:
        raise UserError(f"{file}: its columns must have equal lengths")
    pointless = np.all([np.isnan(table[name]) for name in returns[:2]], axis=0)
    for name in names:
        if name in table and name != "t":
            _check_numbers(file, name, table[name], pointless & (name in returns))
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


def _check_numbers(file: Path, name: str, values: np.ndarray, may_lack: np.ndarray) -> None:
    refuse_rows(
        file,
        ~(np.abs(values) <= FARTHEST) & ~may_lack,
        lambda i: f"{name}: {values[i]:g} must be a finite number, at most {FARTHEST:g}",
    )
