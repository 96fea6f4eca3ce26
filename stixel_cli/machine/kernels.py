"""The Numba kernels, which `make setup` compiles.

A kernel is compiled when it is called, and kept next to its source, for the types of that call.
So this module, as a program, goes through the whole method with tiny images.
"""

import gc
import sys
from time import perf_counter

TINY = ("rig.width=96", "rig.height=64", "path.duration=0.2", "pictures.frames=[0]")

OPTIONS = ("renderer=raycast", "road=estimated", "occupancy=cartesian", "extraction.layers=many")
"""They call the kernels of the default options too."""


def render_tiny_picture() -> None:
    """Call every kernel of `stixel_cli.rendering`."""
    from stixel_cli.config.compose import compose
    from stixel_cli.rendering.raycast import render
    from stixel_cli.scene.path import build_scenario
    from stixel_cli.scene.scenario import ego_motion

    p = compose((*TINY, *OPTIONS)).configuration
    ego = ego_motion(p.ego, p.path.duration, p.path.sample_time)
    scenario = build_scenario(ego, p.road_user, p.path)
    render(scenario, p.road_user, p.world, p.rig, p.renderer, range(1))


def call_kernels() -> None:
    """Call every kernel."""
    from stixel_cli.config.compose import compose
    from stixel_cli.measurements.fabricated import fabricate_scans
    from stixel_cli.method import follow_road_user
    from stixel_cli.scene.path import build_scenario
    from stixel_cli.scene.scenario import ego_motion
    from stixel_cli.tracking import gp_ekf
    from stixel_cli.tracking.contour import contour
    from stixel_cli.tracking.start import noisy_start

    follow_road_user(compose((*TINY, *OPTIONS, "tracker=gp_ekf")).configuration, seed=0)
    # Those of the trackers: in tiny images there is no target.
    for tracker in (contour, gp_ekf):
        name = tracker.__name__.rpartition(".")[2]
        p = compose((*TINY, "measurement=fabricated", f"tracker={name}")).configuration
        ego = ego_motion(p.ego, p.path.duration, p.path.sample_time)
        scenario = build_scenario(ego, p.road_user, p.path)
        scans = fabricate_scans(scenario, p.rig, p.measurement, 0)
        tracker.track(scans, noisy_start(scenario, p.start, 0), p.prior, p.tracker)


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
