"""Stixels in files of other tools, and in our own tables."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.border.files import read_bytes
from stixel_cli.errors import UserError, located
from stixel_cli.measurements.tables import read_table, refuse_rows
from stixel_cli.recordings.image_files import GREATEST_SIDE, decoded, rgb
from stixel_cli.rendering.images import eight_bits
from stixel_cli.stixels.types import Stixels

OWN = ("left", "right", "top", "base", "disparity", "depth")
FOREIGN = ("u", "vT", "vB", "d")

FARTHEST = 10_000.0
"""Greatest depth, m."""

MOST = 100_000
"""Stixels of a file."""


@dataclass(frozen=True)
class StixelFile:
    """The stixels of one frame."""

    stixels: Stixels
    """Their columns, rows and depths; a disparity is NaN if the file has none."""
    image: np.ndarray
    """(H, W, 3) uint8 RGB; black if the file has none."""
    has_size: bool
    """Whether the file states the image's size; else all stixels are inside of it."""


def stx1_library(asked_by: str) -> Any:
    """pyStixel-lib; UserError without it, that names what needs it."""
    needs = f"{asked_by} needs pyStixel-lib: pip install 'stixel[stx1]'"
    with located(needs, caught=ImportError):
        import stixel
    return stixel


def read_stixels(file: Path) -> StixelFile:
    """The stixels in a `.stx1`, in the CSV of the same tools, or in a table of `to_frame`.

    In the first two the row vB is the one below the stixel, and the depth is along the optical
    axis. A CSV of theirs has no widths: they are the least distance of two columns.
    """
    if file.suffix.lower() == ".stx1":
        return _read_stx1(file)
    columns = read_table(file, (), [OWN, FOREIGN])
    if OWN[0] in columns:
        return _stixel_file(file, columns)
    if FOREIGN[0] not in columns:
        needed = " or ".join(", ".join(names) for names in (OWN, FOREIGN))
        raise UserError(f"{file}: must be .stx1, or have the columns {needed}")
    steps = np.diff(np.unique(columns["u"]))
    return _stixel_file(file, _as_own(columns, steps.min(initial=GREATEST_SIDE)))


def _as_own(columns: Mapping[str, np.ndarray], width: np.ndarray | float) -> dict[str, np.ndarray]:
    """The columns `FOREIGN` under the names of `OWN`."""
    u, top, below, depth = (columns[name] for name in FOREIGN)
    unknown = np.full(len(u), np.nan)
    own = (u, u + width, top, below - 1.0, unknown, depth)
    return dict(zip(OWN, own, strict=True))


def _read_stx1(file: Path) -> StixelFile:
    library: Any = stx1_library(str(file))
    try:
        world = library.StixelWorld.FromString(read_bytes(file))
    except Exception as fault:
        # protobuf's own error; only pyStixel-lib depends on it.
        if type(fault).__name__ != "DecodeError":
            raise
        raise UserError(f"{file}: not a .stx1 file") from None
    names = (*FOREIGN, "width")
    values = [[getattr(one, name) for name in names] for one in world.stixel]
    columns = dict(zip(names, np.array(values, dtype=np.float64).reshape(-1, 5).T, strict=True))
    image = None
    if world.image:
        (image,) = map(rgb, eight_bits({"image": decoded(file, world.image)}))
    return _stixel_file(file, _as_own(columns, columns["width"]), image)


def _stixel_file(
    file: Path, columns: Mapping[str, np.ndarray], image: np.ndarray | None = None
) -> StixelFile:
    """The checked stixels of a file, in ascending order of their columns."""
    left, right, top, base, disparity, depth = (columns[name] for name in OWN)
    if len(left) > MOST:
        raise UserError(f"{file}: {len(left)} stixels, at most {MOST}")
    height, width = (GREATEST_SIDE, GREATEST_SIDE) if image is None else image.shape[:2]
    for valid, problem in (
        ((left >= 0) & (left < right) & (right <= width), f"its columns are not in 0 to {width}"),
        ((top >= 0) & (top <= base) & (base < height), f"its rows are not in 0 to {height}"),
        ((depth > 0) & (depth <= FARTHEST), f"its depth is not in 0 to {FARTHEST:g} m"),
        (np.isnan(disparity) | (disparity > 0), "its disparity is not > 0 px"),
    ):
        refuse_rows(file, ~valid, lambda row, problem=problem: problem)
    order = np.argsort(left, kind="stable")
    whole = [values[order].astype(np.int32) for values in (left, right, top, base)]
    n = len(order)
    # Variances, heights, points and their covariances are unknown.
    unknown, *points = (np.full((n, *shape), np.nan) for shape in ((), (2,), (2, 2)))
    depths = disparity[order], unknown, depth[order], unknown
    stixels = Stixels(0, np.array([0, n]), *whole, *depths, *points)
    if image is not None:
        return StixelFile(stixels, image, True)
    size = (whole[3].max(initial=0) + 1, whole[1].max(initial=1))
    return StixelFile(stixels, np.zeros((*size, 3), dtype=np.uint8), False)
