"""The user's files of scans and truth, read before a run for their faults and number of scans."""

import os
from functools import lru_cache
from typing import Any

from stixel_cli.errors import UserError
from stixel_cli.measurements.file_parameters import FileParameters
from stixel_cli.measurements.scans import Scans


def check_files(measurement: Any) -> None:
    """Read scans and truth from the files of `measurement`, if it has files.

    Raises:
        UserError: in one line, if a file is missing or not valid.
    """
    if not isinstance(measurement, FileParameters) or measurement.path is None:
        return
    scans = file_scans(measurement)
    if measurement.truth is not None:
        # Shapely is imported for it.
        from stixel_cli.measurements.file_truth import read_truth

        read_truth(scans, measurement.truth)


def file_scans(measurement: FileParameters) -> Scans:
    """The scans from the files; UserError in one line if they are missing or not valid."""
    if measurement.path is None:
        raise UserError("measurement.path: is missing: give the file of the scans, .csv or .npz")
    names = (measurement.path, measurement.ego)
    return _scans(*names, measurement.range_std, *(_state(name) for name in names))


def _state(name: str | None) -> tuple[int, ...]:
    """What changes when a file changes; () if it cannot be read, which its reader reports."""
    try:
        stat = os.stat(name) if name is not None else None
    except OSError:
        return ()
    return () if stat is None else (stat.st_mtime_ns, stat.st_size, stat.st_ino)


@lru_cache(maxsize=16)
def _scans(path: str, ego: str | None, range_std: float, *state: tuple[int, ...]) -> Scans:
    """The scans of a file, read once per process while its `state` is the same."""
    from stixel_cli.measurements.file import read_scans

    return read_scans(path, ego, range_std)
