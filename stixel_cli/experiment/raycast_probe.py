"""Render one small picture by ray casting; run as a module, since a fault may end the process."""

from stixel_cli.config.compose import compose
from stixel_cli.rendering.raycast import render
from stixel_cli.scene.build import build_scenario
from stixel_cli.scene.ego import ego_motion


def main() -> None:
    """Render one frame of the default experiment at 64 × 64 pixels, whatever its renderer."""
    small = ("rig.width=64", "rig.height=64", "stereo.disparities=16", "path.duration=0.2")
    what = compose((*small, "pictures.frames=[0]", "renderer=raycast")).configuration
    ego = ego_motion(what.ego, what.path.duration, what.path.sample_time)
    scenario = build_scenario(ego, what.road_user, what.path)
    render(scenario, what.road_user, what.world, what.rig, what.renderer, range(1))


if __name__ == "__main__":
    main()
