"""KITTI tracking's labels: one row per frame and object.

Its columns: frame, track id, type, truncated, occluded, alpha, box in the left colour image (left,
top, right, bottom, px), size (height, width, length, m), place of the bottom's centre (x, y, z, m,
in the frame of camera 0), rotation_y (rad). https://www.cvlibs.net/datasets/kitti/eval_tracking.php
The labels of the object benchmark have no frame and no track id, and a share of truncation: they
are of frame 0, and the track id is the number of the row, from 0.
"""

from functools import lru_cache
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError, printable
from stixel_cli.recordings.rows import check_columns, numbers, text_rows
from stixel_cli.recordings.types import Labels

COLUMNS = 17
OBJECT_COLUMNS = 15
CLASSES = {
    "Car": "car",
    "Van": "car",
    "Cyclist": "cyclist",
    "Pedestrian": "pedestrian",
    "Person_sitting": "pedestrian",
}
"""The class of road user of each type of label that has one."""

Tracks = dict[int | str, Labels]


def read_labels(file: Path) -> Tracks:
    """The labels of each target by its track id; regions of the type `DontCare` are left out.

    Raises:
        UserError: if a row is short, has a value that is not finite, or repeats a frame.
    """
    stat = file.stat() if file.exists() else None
    return _read(file, None if stat is None else (stat.st_mtime_ns, stat.st_size))


@lru_cache(maxsize=32)
def _read(file: Path, state: tuple[int, int] | None) -> Tracks:
    """Parsed once per process while the file's `state` is the same."""
    rows: dict[int, list[list[float]]] = {}
    kinds: dict[int, str] = {}
    seen: set[tuple[int, int]] = set()
    found = text_rows(file)
    of_object = bool(found) and len(found[0][1]) == OBJECT_COLUMNS
    for row, words in found:
        check_columns(file, row, words, OBJECT_COLUMNS if of_object else COLUMNS)
        if of_object:
            words = ["0", str(row - 1), *words]
        kind = words[2]
        if kind == "DontCare":
            continue
        values = numbers(file, row, words[:2] + words[3:])
        frame, target = int(values[0]), int(values[1])
        if (frame, target) != (values[0], values[1]) or frame < 0 or target < 0:
            raise UserError(f"{file}: row {row}: frame and track id must be whole numbers ≥ 0")
        if (frame, target) in seen:
            raise UserError(f"{file}: row {row}: track {target} is labelled twice in frame {frame}")
        if min(values[9:12]) <= 0.0:
            raise UserError(f"{file}: row {row}: height, width and length must be > 0")
        if kinds.setdefault(target, kind) != kind:
            raise UserError(
                f"{file}: row {row}: track {target} is a {printable(kind)}, "
                f"but was a {printable(kinds[target])} before"
            )
        seen.add((frame, target))
        rows.setdefault(target, []).append(values)
    return {target: labels_in(np.array(rows[target]), kinds[target]) for target in sorted(rows)}


def labels_in(values: np.ndarray, kind: str) -> Labels:
    """The labels of one target in rows (n, 16): KITTI's columns but for the type."""
    values = values[np.argsort(values[:, 0], kind="stable")]
    return Labels(
        frames=values[:, 0].astype(np.int64),
        truncated=np.ceil(values[:, 2]).astype(np.int64),
        occluded=values[:, 3].astype(np.int64),
        boxes=values[:, 5:9],
        sizes=values[:, 9:12],
        places=values[:, 12:15],
        yaws=values[:, 15],
        kind=kind,
    )


def labels_of(file: Path, target: int, key: str = "source.target") -> Labels:
    """The labels of one target; `key` is the setting that names it, for messages.

    Raises:
        UserError: if the file has no such track; the line lists tracks that it has.
    """
    return track_of(read_labels(file), target, file, key)


def track_of(tracks: Tracks, target: int | str, file: Path, key: str = "source.target") -> Labels:
    """The labels of one of the `tracks` in a file; errors as in `labels_of`."""
    if target not in tracks:
        known = ", ".join(f"{i} ({labels.kind})" for i, labels in list(tracks.items())[:12])
        more = ", …" if len(tracks) > 12 else ""
        raise UserError(f"{key}: {file} has no track {target}; it has {known}{more}")
    return tracks[target]
