"""The Numba kernels, which `make setup` compiles.

A kernel is compiled when it is called, and kept next to its source, for the types of that call.
So this module, as a program, goes through the whole method with tiny images.
"""

import gc
import sys
from time import perf_counter

import numpy as np

TINY = ("rig.width=96", "rig.height=64", "path.duration=0.2", "pictures.frames=[0]")

OPTIONS = ("renderer=raycast", "road=estimated", "occupancy=cartesian", "extraction.layers=many")
"""They call the kernels of the default options too."""


def render_tiny_picture() -> None:
    """Call every kernel of `stixel_cli.rendering`."""
    from stixel_cli.config.compose import compose
    from stixel_cli.rendering.raycast import render
    from stixel_cli.scene.ego import ego_motion
    from stixel_cli.scene.path import build_scenario

    p = compose((*TINY, *OPTIONS)).configuration
    ego = ego_motion(p.ego, p.path.duration, p.path.sample_time)
    scenario = build_scenario(ego, p.road_user, p.path)
    render(scenario, p.road_user, p.world, p.rig, p.renderer, range(1))


def call_kernels() -> None:
    """Call every kernel."""
    from stixel_cli.config.compose import compose
    from stixel_cli.measurements.scans import Scans
    from stixel_cli.method import follow_road_user
    from stixel_cli.trackers import Contour
    from stixel_cli.tracking import gp_ekf
    from stixel_cli.tracking.track import InitialState

    p = compose((*TINY, *OPTIONS, "tracker=gp_ekf")).configuration
    follow_road_user(p, seed=0)
    # Those of the trackers' updates: the tiny images have no point of the target.
    points = np.stack([np.linspace(-2.0, 2.0, 9), np.full(9, 9.1)], axis=1)
    noise, start = np.tile(0.01 * np.eye(2), (9, 1, 1)), np.array([0.0, 10.0, 0.0])
    Contour("car", start=start).step(points, noise, np.zeros(3), time=0.0)
    scans = Scans.of_each(np.zeros(1), np.zeros((1, 3)), [(points, noise)])
    gp_ekf.track(scans, InitialState(np.append(start, np.zeros(3)), np.eye(6)), p.prior, p.tracker)


def main() -> None:
    """Compile the kernels in this process; report it on stderr.

    Several processes would each import and start Numba, and compile what kernels share.
    """
    print("compiling the kernels (once, about 30 s) …", file=sys.stderr)  # noqa: T201
    start = perf_counter()
    # The compiler makes millions of small objects: without the collection of cycles, which
    # would find few of them, it takes a fifth less time, and 0.3 GB of memory.
    gc.disable()
    call_kernels()
    print(f"kernels compiled in {perf_counter() - start:.0f} s", file=sys.stderr)  # noqa: T201


if __name__ == "__main__":
    main()
