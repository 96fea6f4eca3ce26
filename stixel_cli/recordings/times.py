"""Frames that files share, and frames and poses by their time in ns where none is numbered."""

from bisect import bisect
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.recordings.parameters import chosen_frames
from stixel_cli.recordings.types import Recording

PAIRED = 5_000_000
"""The images of a pair are at most this far apart, ns."""

JITTER = 0.2
"""Of the time between images, as a share of it."""

GREATEST_GAP = 250_000_000
"""Between two poses, or two labels of a track, ns: with more, there is no line between them."""


def common_frames(
    text: str | None, images: Collection[int], limits: dict[str, tuple[int, int]]
) -> range:
    """The frames that the images and each of the `limits` have, or those in `source.frames`.

    `limits` are the first frame and the stop of other files, by a name for messages.
    """
    spans = {"the images": (min(images), max(images) + 1), **limits}
    common = range(max(start for start, _ in spans.values()), min(end for _, end in spans.values()))
    chosen = chosen_frames(text)
    for name, (start, end) in spans.items() if chosen else ():
        if chosen.start < start or chosen.stop > end:
            raise UserError(
                f"source.frames: {text} is not within {start}:{end}, the frames of {name}"
            )
    if not chosen and not common:
        words = "; ".join(f"{name} {start}:{end}" for name, (start, end) in spans.items())
        raise UserError(f"source.frames: no common frame: {words}")
    return chosen or common


def check_steps(recording: Recording, sample_time: float, root: Path, group: str) -> None:
    """Raise UserError unless successive frames of a log are `sample_time` s apart."""
    times = recording.tables.times
    for k in recording.frames[1:]:
        step = 1e-9 * (times[k] - times[k - 1])
        if abs(step - sample_time) > JITTER * sample_time:
            raise UserError(
                f"{group}.frames: frames {k - 1} and {k} of {root} are {step:.3f} s apart, but "
                f"{group}.sample_time is {sample_time:g} s"
            )


def pairs_by_time(left: Sequence[int], right: Sequence[int]) -> dict[int, int]:
    """The nearest of the times `right`, ns, for each of `left` that has one within `PAIRED`.

    Both are in ascending order.
    """
    pairs = {}
    for time in left if right else ():
        i = bisect(right, time)
        pairs[time] = min(right[max(i - 1, 0) : i + 1], key=lambda one: abs(one - time))
    return {time: other for time, other in pairs.items() if abs(other - time) <= PAIRED}


def poses_at(
    name: Path | str, times: np.ndarray, stamps: np.ndarray, turns: np.ndarray, places: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (n, 3, 3) and places (n, 3) m at `times` (n,) ns, on straight lines between poses.

    Each has a pose before and after it. The poses are at `stamps` (m,) ns, in any order: `turns`
    (m, 4) are quaternions w, x, y, z, `places` (m, 3) in m. Errors have the `name` of the file.
    """
    stamps, rows = np.unique(stamps, return_index=True)
    after = np.clip(np.searchsorted(stamps, times), 1, max(len(stamps) - 1, 1))
    if len(stamps) < 2:
        raise UserError(f"{name}: must have two poses or more")
    span = stamps[after] - stamps[after - 1]
    far = (times < stamps[0]) | (times > stamps[-1]) | (span > GREATEST_GAP)
    if far.any():
        raise UserError(f"{name}: has no pose round {int(times[far][0])} ns")
    share = ((times - stamps[after - 1]) / span)[:, None]
    turns, places = turns[rows], places[rows]
    earlier, later = turns[after - 1], turns[after]
    # q and −q are one rotation. Between poses some milliseconds apart a line is as good as an arc.
    later = np.where((earlier * later).sum(axis=1, keepdims=True) < 0.0, -later, later)
    between = (1.0 - share) * places[after - 1] + share * places[after]
    mixed = (1.0 - share) * earlier + share * later
    unit_rotations(name, turns)
    return unit_rotations(name, mixed / np.linalg.norm(mixed, axis=1, keepdims=True)), between


def unit_rotations(file: Path | str, quaternions: np.ndarray) -> np.ndarray:
    """Rotations (n, 3, 3) of quaternions (n, 4) w, x, y, z, which must have the length 1."""
    lengths = np.linalg.norm(quaternions, axis=1)
    wrong = np.flatnonzero(~(np.abs(lengths - 1.0) <= 0.01))
    if len(wrong):
        raise UserError(f"{file}: row {wrong[0] + 1}: qw, qx, qy, qz must have the length 1")
    w, x, y, z = (quaternions / lengths[:, None]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
