"""Compile all Numba kernels: `make setup` runs this module, so that no run has to wait for it.

A kernel is compiled when it is called, and kept next to its source, for the types of that call.
So this renders a tiny picture, and takes stixels from a tiny disparity image with all options of
their stages.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from time import perf_counter

import numpy as np

from stixel_cli.config.compose import compose
from stixel_cli.images import ImageStack
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.rendering.raycast import render
from stixel_cli.scene.build import build_scenario
from stixel_cli.scene.ego import ego_motion
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.extraction import extract_stixels
from stixel_cli.stixels.free_space import find_free_space
from stixel_cli.tracking.ray_table import expected, outline_table

TINY = ("rig.width=96", "rig.height=64", "stereo.disparities=16", "path.duration=0.2")
TINY += ("pictures.frames=[0]",)


def call_rendering_kernels() -> None:
    """Call every kernel of `stixel_cli.rendering`."""
    p = compose(TINY).configuration
    ego = ego_motion(p.ego, p.path.duration, p.path.sample_time)
    scenario = build_scenario(ego, p.road_user, p.path)
    render(scenario, p.road_user, p.world, p.rig, p.renderer, range(1))


def call_stixel_kernels() -> None:
    """Call every kernel of `stixel_cli.stixels`."""
    for options in ((), ("road=estimated", "occupancy=cartesian")):
        p = compose((*TINY, *options)).configuration
        ego = ego_motion(p.ego, p.path.duration, p.path.sample_time)
        frames, random = range(2), np.random.default_rng(0)
        raw = random.integers(0, 200, (2, p.rig.height, p.rig.width)).astype(np.int16)
        disparities = Disparities.from_raw(0, p.stereo.disparities, raw)
        free_space = find_free_space(
            disparities, ego, p.rig, p.road, p.occupancy, p.free_space, frames, None
        )
        views = random.integers(0, 256, (2, 2, p.rig.height, p.rig.width)).astype(np.uint8)
        pairs = StereoPairs(0, *(ImageStack.from_images(list(view)) for view in views))
        extract_stixels(disparities, free_space, pairs, p.rig, p.height, p.extraction, frames)


def call_tracking_kernels() -> None:
    """Call every kernel of `stixel_cli.tracking`."""
    table = outline_table(np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 0.0]]), 0.1)
    rays = np.array([[1.0, 0.0]])
    expected(np.zeros((1, 5)), np.array([-9.0, 0.0]), rays, 0, 0, *table.arrays())


CALLS = (call_rendering_kernels, call_stixel_kernels, call_tracking_kernels)


def main() -> None:
    """Compile the kernels in one process for each of `CALLS`; say so on stderr."""
    print("compiling the kernels (once, about 10 s) …", file=sys.stderr)  # noqa: T201
    start = perf_counter()
    with ProcessPoolExecutor(len(CALLS), mp_context=get_context("spawn")) as pool:
        for done in [pool.submit(call) for call in CALLS]:
            done.result()
    print(f"kernels compiled in {perf_counter() - start:.0f} s", file=sys.stderr)  # noqa: T201


if __name__ == "__main__":
    main()
