"""Columns of Feather files (version 2: Arrow's IPC format) of any origin."""

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.files import read_bytes
from stixel_cli.recordings.kitti_tables import GREATEST, MOST_ROWS

if TYPE_CHECKING:
    import pyarrow

LARGEST = 16 * 2**20
"""Bytes of a file."""


def read_columns(
    file: Path, numbers: tuple[str, ...], words: tuple[str, ...] = ()
) -> dict[str, np.ndarray]:
    """Columns by their names: `numbers` as (n,) float64 or int64, `words` as (n,) objects.

    Raises:
        UserError: if the file is missing, not valid or too large, pyarrow is not installed, a
            column is missing or of another type, or a number is too large.
    """
    data = read_bytes(file, LARGEST)
    try:
        import pyarrow
        from pyarrow.dataset import IpcFileFormat
    except ImportError:
        raise UserError("source=argoverse needs pyarrow: pip install 'stixel[argoverse]'") from None
    try:
        content = IpcFileFormat().make_fragment(pyarrow.BufferReader(data))
        # The heads of the batches have the numbers of rows: nothing is unpacked for them.
        if content.count_rows() > MOST_ROWS:
            raise UserError(f"{file}: more than {MOST_ROWS} rows")
        table = content.to_table(use_threads=False)
        table.validate(full=True)
    except (pyarrow.ArrowException, OSError, ValueError) as fault:
        cause = str(fault).splitlines()[0]
        raise UserError(f"{file}: not a valid Feather file: {cause}") from None
    found = {name: _column(file, table, name, "numbers") for name in numbers}
    for name, values in found.items():
        if values.dtype == float and not (np.abs(values) <= GREATEST).all():
            raise UserError(f"{file}: the column {name} must be within ±{GREATEST:g} in each row")
    return found | {name: _column(file, table, name, "text") for name in words}


def _column(file: Path, table: "pyarrow.Table", name: str, kind: str) -> np.ndarray:
    """A column of `numbers` (int64 or float64) or of `text` (objects), without gaps."""
    from pyarrow import ArrowException, types

    if name not in table.column_names:
        raise UserError(f"{file}: the column {name} is missing")
    column = table.column(name)
    wanted = "int64" if types.is_integer(column.type) else "float64"
    with suppress(ArrowException):
        if not column.null_count:
            return column.cast(wanted if kind == "numbers" else "string").to_numpy()
    raise UserError(f"{file}: the column {name} must be of {kind} in each row")
