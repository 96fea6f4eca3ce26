"""Columns of Feather files (version 2: Arrow's IPC format) of any origin."""

from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.files import read_bytes
from stixel_cli.recordings.rows import MOST_ROWS

GREATEST = 16 * 2**20
"""Bytes of a file."""


def read_columns(
    file: Path, numbers: tuple[str, ...], words: tuple[str, ...] = ()
) -> dict[str, np.ndarray]:
    """Columns by their names: `numbers` as (n,) float64 or int64, `words` as (n,) str.

    Raises:
        UserError: if the file is missing, damaged or too long, pyarrow is not installed, a column
            is missing or of another type, or a number is not finite.
    """
    data = read_bytes(file, GREATEST)
    try:
        import pyarrow
        from pyarrow import ipc
    except ImportError:
        raise UserError("source=argoverse needs pyarrow: pip install 'stixel[argoverse]'") from None
    if not data.startswith(b"ARROW1"):
        raise UserError(f"{file}: not a Feather file")
    try:
        table = ipc.open_file(pyarrow.BufferReader(data)).read_all()
        table.validate(full=True)
    except (pyarrow.ArrowException, OSError, ValueError) as fault:
        raise UserError(f"{file}: a damaged Feather file: {str(fault).splitlines()[0]}") from None
    if table.num_rows > MOST_ROWS:
        raise UserError(f"{file}: more than {MOST_ROWS} rows")
    found = {}
    for name in (*numbers, *words):
        if table.column_names.count(name) != 1:
            raise UserError(f"{file}: the column {name} is missing")
        column = table.column(name)
        kind = column.type
        if pyarrow.types.is_dictionary(kind):
            kind = kind.value_type
        is_text = pyarrow.types.is_string(kind) or pyarrow.types.is_large_string(kind)
        is_number = pyarrow.types.is_integer(kind) or pyarrow.types.is_floating(kind)
        if column.null_count or not (is_text if name in words else is_number):
            wanted = "text" if name in words else "numbers"
            raise UserError(f"{file}: the column {name} must be of {wanted} in each row")
        values = np.array(column.to_pylist())
        if name in words:
            values = values.astype(np.str_)
        elif not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            raise UserError(f"{file}: row {row + 1}: {name} is not finite")
        found[name] = values
    return found
