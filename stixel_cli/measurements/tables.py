"""Tables of numbers from the user's files: columns of a `.csv` or of an `.npz`."""

import csv
import io
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError, printable
from stixel_cli.files import read_arrays, read_text
from stixel_cli.measurements.scans import FARTHEST

MOST_SCANS = 100_000


def read_table(
    file: Path, needed: Sequence[str], together: Sequence[Sequence[str]] = (), other: str = ""
) -> dict[str, np.ndarray]:
    """The columns (n,) float64 of a table, by name; unknown columns are left out.

    Args:
        file: `.csv` with a header and commas, or `.npz` with one array per column.
        needed: columns that must be there.
        together: groups of optional columns: all of a group, or no column of it.
        other: name of an array of an `.npz` of any shape, returned as it is.

    Raises:
        UserError: in one line that names file, place and cause.
    """
    suffix = file.suffix.lower()
    if suffix not in (".csv", ".npz"):
        raise UserError(f"{file}: must be a table with the suffix .csv or .npz")
    groups = [group for group in together if group]
    names = [*needed, *(name for group in groups for name in group)]
    table = _from_csv(file, names) if suffix == ".csv" else _from_arrays(file, names, other)
    missing = [name for name in needed if name not in table]
    if missing:
        raise UserError(f"{file}: the column {missing[0]} is missing (needed: {', '.join(needed)})")
    for group in groups:
        absent = [name for name in group if name not in table]
        if absent and len(absent) < len(group):
            raise UserError(
                f"{file}: the column {absent[0]} is missing: give all of {', '.join(group)}, or "
                "leave out all of them"
            )
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


def _from_csv(file: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    text = read_text(file).removeprefix("\ufeff")
    try:
        rows = list(csv.reader(io.StringIO(text), strict=True))
    except csv.Error as error:
        raise UserError(f"{file}: not a table: {printable(str(error))}") from None
    while rows and not rows[-1]:
        rows.pop()
    header = [name.strip() for name in rows[0]] if rows else []
    if len(set(header)) < len(header):
        raise UserError(f"{file}: two columns have one name")
    if len(header) == 1 and (";" in header[0] or "\t" in header[0]):
        raise UserError(f"{file}: the columns must be separated by commas")
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise UserError(
                f"{file}: line {number}: {len(row)} values, but the header has {len(header)}"
            )
    return {
        name: _numbers(file, name, [row[header.index(name)] for row in rows[1:]])
        for name in names
        if name in header
    }


def _numbers(file: Path, name: str, cells: list[str]) -> np.ndarray:
    try:
        values = np.array(cells, dtype=np.float64)
    except ValueError:
        for number, cell in enumerate(cells, start=2):
            try:
                float(cell)
            except ValueError:
                shown = printable(cell)
                raise UserError(
                    f"{file}: line {number}: {name}: {shown!r} is not a number"
                ) from None
        raise
    return _checked(file, name, values)


def _from_arrays(file: Path, names: Sequence[str], other: str) -> dict[str, np.ndarray]:
    arrays = read_arrays(file)
    table = {}
    for name in names:
        if name not in arrays:
            continue
        if arrays[name].ndim != 1:
            raise UserError(f"{file}: {name} has shape {arrays[name].shape}, must be a column (n,)")
        table[name] = _checked(file, name, arrays[name].astype(np.float64))
    if len({len(column) for column in table.values()}) > 1:
        raise UserError(f"{file}: its columns must have equal lengths")
    if other in arrays:
        table[other] = arrays[other].astype(np.float64)
    return table


def _checked(file: Path, name: str, values: np.ndarray) -> np.ndarray:
    refuse_rows(
        file,
        ~(np.abs(values) <= FARTHEST),
        lambda i: f"{name}: {values[i]:g} must be a finite number, at most {FARTHEST:g}",
    )
    return values
