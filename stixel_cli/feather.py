"""Columns of Feather files (version 2: Arrow's IPC format) of any origin."""

import struct
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.files import read_bytes

if TYPE_CHECKING:
    import pyarrow

GREATEST = 16 * 2**20
"""Bytes of a file."""

GREATEST_UNPACKED = 256 * 2**20
"""Bytes of its columns: a million rows of 20 numbers take 160 MB."""

MOST_ROWS = 1_000_000

LARGEST = 1e9
"""Greatest absolute value of a number, in its unit: products of larger ones overflow."""

LONGEST_TEXT = 64
"""Bytes of a text in a row."""

_MAGIC = b"ARROW1\0\0"


def read_columns(
    file: Path, numbers: tuple[str, ...], words: tuple[str, ...] = ()
) -> dict[str, np.ndarray]:
    """Columns by their names: `numbers` as (n,) float64 or int64, `words` as (n,) str.

    Raises:
        UserError: if the file is missing, damaged or too large, also when unpacked, pyarrow is not
            installed, a column is missing or of another type, or a number is too large.
    """
    data = read_bytes(file, GREATEST)
    try:
        import pyarrow
        from pyarrow import ipc
    except ImportError:
        raise UserError("source=argoverse needs pyarrow: pip install 'stixel[argoverse]'") from None
    if not data.startswith(_MAGIC):
        raise UserError(f"{file}: not a Feather file")
    # The messages follow each other as in a stream. The footer, which repeats where they are, may
    # name others than those whose size is checked.
    stream = pyarrow.py_buffer(data)[len(_MAGIC) :]
    try:
        size = sum(map(_unpacked, ipc.MessageReader.open_stream(stream)))
        if size > GREATEST_UNPACKED:
            raise UserError(
                f"{file}: too large: {size} bytes when unpacked, at most {GREATEST_UNPACKED}"
            )
        table = ipc.open_stream(stream).read_all()
        table.validate(full=True)
    except (pyarrow.ArrowException, OSError, ValueError, struct.error) as fault:
        raise UserError(f"{file}: a damaged Feather file: {str(fault).splitlines()[0]}") from None
    if table.num_rows > MOST_ROWS:
        raise UserError(f"{file}: more than {MOST_ROWS} rows")
    return {
        **{name: _numbers(file, name, _column(file, table, name, "numbers")) for name in numbers},
        **{name: _texts(file, name, _column(file, table, name, "text")) for name in words},
    }


def _column(file: Path, table: "pyarrow.Table", name: str, kind: str) -> "pyarrow.ChunkedArray":
    """A column of `numbers` or of `text`, without gaps."""
    from pyarrow import types

    if table.column_names.count(name) != 1:
        raise UserError(f"{file}: the column {name} is missing")
    column = table.column(name)
    content = column.type.value_type if types.is_dictionary(column.type) else column.type
    if kind == "text":
        suits = types.is_string(content) or types.is_large_string(content)
    else:
        suits = types.is_integer(content) or types.is_floating(content)
    if column.null_count or not suits:
        raise UserError(f"{file}: the column {name} must be of {kind} in each row")
    return column


def _numbers(file: Path, name: str, column: "pyarrow.ChunkedArray") -> np.ndarray:
    values = np.array(column.to_pylist())
    wrong = np.flatnonzero(~(np.abs(values) <= LARGEST)) if values.dtype.kind == "f" else ()
    if len(wrong):
        raise UserError(
            f"{file}: row {wrong[0] + 1}: {name} is {values[wrong[0]]:g}, "
            f"must be within ±{LARGEST:g}"
        )
    return values


def _texts(file: Path, name: str, column: "pyarrow.ChunkedArray") -> np.ndarray:
    """(n,) str; UserError beyond `LONGEST_TEXT`: each row takes the size of the longest one."""
    import pyarrow
    from pyarrow import compute

    for chunk in column.chunks:
        values = chunk.dictionary if pyarrow.types.is_dictionary(chunk.type) else chunk
        longest = compute.max(compute.binary_length(values)).as_py() or 0
        if longest > LONGEST_TEXT:
            raise UserError(
                f"{file}: the column {name}: a text of {longest} bytes, at most {LONGEST_TEXT}"
            )
    return np.array(column.to_pylist()).astype(np.str_)


def _unpacked(message: "pyarrow.Message") -> int:
    """Bytes of the buffers of an Arrow message when unpacked, before anything is unpacked.

    Arrow's Message.fbs and Schema.fbs, in FlatBuffers' layout: a packed buffer begins with its
    unpacked size as int64, or with -1 if it is not packed after all.
    """
    if message.type not in ("record batch", "dictionary"):
        return 0
    data, body = message.metadata.to_pybytes(), message.body.to_pybytes()
    (root,) = struct.unpack_from("<I", data)
    batch_at = _field(data, root, 2)
    if batch_at is not None and message.type == "dictionary":
        batch_at = _field(data, batch_at, 1)
    buffers = None if batch_at is None else _field(data, batch_at, 2)
    if buffers is None:
        return 0
    packed = _field(data, batch_at, 3) is not None
    (count,) = struct.unpack_from("<I", data, buffers)
    total = 0
    for offset, length in struct.iter_unpack("<qq", data[buffers + 4 : buffers + 4 + 16 * count]):
        size = struct.unpack_from("<q", body, offset)[0] if packed and length >= 8 else -1
        total += length if size < 0 else size
    return total


def _field(data: bytes, table: int, number: int) -> int | None:
    """Place of what a field of a FlatBuffers table refers to; None without the field."""
    fields = table - struct.unpack_from("<i", data, table)[0]
    (size,) = struct.unpack_from("<H", data, fields)
    if size < 6 + 2 * number:
        return None
    (offset,) = struct.unpack_from("<H", data, fields + 4 + 2 * number)
    if offset == 0:
        return None
    return table + offset + struct.unpack_from("<I", data, table + offset)[0]
