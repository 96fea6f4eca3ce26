"""The modules with Numba kernels, which `make setup` compiles.

A kernel is compiled when it is called, and kept next to its source, for the types of that call.
So this module, as a program, renders a tiny picture of two boxes, and takes stixels from a tiny
disparity image.
"""

import gc
import sys
from dataclasses import replace
from functools import cache
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from stixel_cli.config.schema import Configuration

TINY = ("rig.width=96", "rig.height=64", "path.duration=0.2", "pictures.frames=[0]")

OPTIONS = ("renderer=raycast", "road=estimated", "occupancy=cartesian")
"""They call the kernels of the default options too."""


@cache
def _configuration() -> "Configuration":
    from stixel_cli.config.compose import compose

    return compose((*TINY, *OPTIONS)).configuration


def call_rendering_kernels() -> None:
    """Call every kernel of `stixel_cli.rendering`."""
    from stixel_cli.rendering.frames import BACKGROUND_ID
    from stixel_cli.rendering.raycast import StaticScene, Target, render_frame
    from stixel_cli.scene.mesh import Mesh
    from stixel_cli.scene.scenario import Scenario
    from stixel_cli.scene.shapes import box, part

    p = _configuration()
    ego = np.array([[0.0, 0.0, np.pi / 2]])
    target = np.array([[0.0, 10.0, 0.0]])
    scenario = Scenario(np.zeros(1), ego, target, np.zeros((1, 3)), np.eye(3, 2)[None])
    texture = np.zeros((1, 1, 3), dtype=np.uint8)
    ground, car = (
        Mesh((part("box", [box(low, high)], texture, 1.0),))
        for low, high in (((-20.0, 1.0, -1.0), (20.0, 40.0, 0.0)), ((-1, -1, 0), (1, 1, 2)))
    )
    static = StaticScene([(BACKGROUND_ID, ground)], p.rig, p.renderer)
    render_frame(static, Target([car]), scenario, 0)


def call_stixel_kernels() -> None:
    """Call every kernel of `stixel_cli.stixels`."""
    from stixel_cli.images import ImageStack
    from stixel_cli.rendering.frames import StereoPairs
    from stixel_cli.scene.ego import ego_motion
    from stixel_cli.stereo.disparities import Disparities
    from stixel_cli.stereo.matching import disparity_count
    from stixel_cli.stixels.extraction import extract_stixels
    from stixel_cli.stixels.free_space import find_free_space

    p = _configuration()
    ego = ego_motion(p.ego, p.path.duration, p.path.sample_time)
    frames, random = range(2), np.random.default_rng(0)
    raw = random.integers(0, 200, (2, p.rig.height, p.rig.width)).astype(np.int16)
    disparities = Disparities.from_raw(0, disparity_count(p.stereo, p.rig), raw)
    free_space = find_free_space(
        disparities, ego, p.rig, p.road, p.occupancy, p.free_space, frames, None
    )
    views = random.integers(0, 256, (2, 2, p.rig.height, p.rig.width)).astype(np.uint8)
    pairs = StereoPairs(0, *(ImageStack.from_images(list(view)) for view in views))
    extraction = replace(p.extraction, layers="many")
    extract_stixels(disparities, free_space, pairs, p.rig, p.height, extraction, frames)


def call_tracking_kernels() -> None:
    """Call every kernel of `stixel_cli.tracking`."""
    from stixel_cli.tracking.contour.ray_table import expected, outline_table

    table = outline_table(np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 0.0]]))
    rays = np.array([[1.0, 0.0]])
    expected(np.zeros((1, 5)), np.array([-9.0, 0.0]), rays, np.zeros(1), 0, 0, *table.arrays())


CALLS = (call_rendering_kernels, call_stixel_kernels, call_tracking_kernels)


def main() -> None:
    """Compile the kernels in this process; report it on stderr.

    Several processes would each import and start Numba, and compile what kernels share.
    """
    print("compiling the kernels (once, about 10 s) …", file=sys.stderr)  # noqa: T201
    start = perf_counter()
    # The compiler makes millions of small objects: without the collection of cycles, which
    # would find few of them, it takes a fifth less time, and 0.3 GB of memory.
    gc.disable()
    for call in CALLS:
        call()
    print(f"kernels compiled in {perf_counter() - start:.0f} s", file=sys.stderr)  # noqa: T201


if __name__ == "__main__":
    main()
