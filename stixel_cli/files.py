"""Files of result folders: whole or not at all, and a failure of the disk told in one line."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from stixel_cli.errors import UserError


def write_whole(file: Path, content: str | bytes) -> None:
    """Write a file, a text in UTF-8: what stands under its name is whole at any time.

    The folder it lies in is made where it is not there.

    Raises:
        OSError: if it cannot be written; what stood there stays.
    """
    partial = file.with_name(f".{file.name}.partial-{os.getpid()}")
    file.parent.mkdir(parents=True, exist_ok=True)
    try:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)
        partial.replace(file)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def written(folder: Path) -> Iterator[None]:
    """Where `folder` is written to.

    Raises:
        UserError: for an OSError inside, naming the folder.
    """
    try:
        yield
    except OSError as error:
        raise UserError(f"{folder}: cannot be written: {error.strerror or error}") from error
