"""The modules with Numba kernels, and which of them are still to be compiled on this machine."""

import os
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]

KERNELS = (
    *("rendering.edges", "rendering.rasteriser", "rendering.shading", "rendering.tracing"),
    "stixels.grouping",
    *("stixels.height", "stixels.nearest_obstacle", "stixels.occupancy", "stixels.refinement"),
    *("stixels.road", "stixels.unknown", "tracking.contour.ray_table"),
)
"""Modules of the package that import `njit`. A run need not read all files to know them."""


def uncompiled() -> frozenset[str]:
    """Full names of the modules whose kernels the next run compiles.

    Numba keeps compiled kernels next to the source, unless its environment or the folder's
    permissions say otherwise: then nothing is known, and the result is empty.
    """
    if os.environ.get("NUMBA_CACHE_DIR") or not os.access(PACKAGE, os.W_OK):
        return frozenset()
    files = {name: PACKAGE.joinpath(*name.split(".")).with_suffix(".py") for name in KERNELS}
    return frozenset(f"stixel_cli.{name}" for name, file in files.items() if not _compiled(file))


def _compiled(source: Path) -> bool:
    """Whether there is an index of Numba's cache that is not older than the source."""
    changed = source.stat().st_mtime
    found = (source.parent / "__pycache__").glob(f"{source.stem}.*.nbi")
    return any(index.stat().st_mtime >= changed for index in found)
