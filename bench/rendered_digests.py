"""Print digests of what the ray caster renders, to compare versions of Python and of packages.

python bench/rendered_digests.py
"""

import hashlib
import platform
from importlib.metadata import PackageNotFoundError, version

from stixel_cli import compose
from stixel_cli.rendering.raycast import render
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.path import build_scenario

SCENES = {
    "car": [],
    "cyclist": ["road_user=cyclist"],
    "pedestrian": ["road_user=pedestrian"],
    "fences": ["world=fenced"],
    "roadside": ["world=roadside", "ego=straight", "road_user=cyclist", "path=crossing"],
    "drawn car": ["road_user.shape_seed=3", "path=s_curve"],
}
FIELDS = ("left", "right", "depth_high", "depth_low", "ids")


def digests(overrides: list[str]) -> dict[str, str]:
    """Digest of the true poses, and of each field of five frames."""
    p = compose(overrides).configuration
    ego = ego_motion(p.ego, p.path.duration, p.path.sample_time)
    scenario = build_scenario(ego, p.road_user, p.path)
    found = {name: hashlib.sha256() for name in FIELDS}
    last = len(ego.times) - 1
    for k in sorted({0, last // 4, last // 2, 3 * last // 4, last}):
        frames = render(scenario, p.road_user, p.world, p.rig, p.renderer, range(k, k + 1))
        for name in FIELDS:
            found[name].update(getattr(frames, name)[0].tobytes())
    found["poses"] = hashlib.sha256(scenario.target_poses_world.tobytes())
    return {name: digest.hexdigest()[:12] for name, digest in found.items()}


def main() -> None:
    print("Python", platform.python_version())
    for name in ("open3d-cpu", "open3d", "numpy", "scipy", "numba", "llvmlite"):
        try:
            print(name, version(name))
        except PackageNotFoundError:
            continue
    for name, overrides in SCENES.items():
        print(name, *(f"{field} {text}" for field, text in digests(overrides).items()))


if __name__ == "__main__":
    main()
