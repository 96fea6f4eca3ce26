"""A rendered stereo pair of 640 × 480 px, one thread, next to 2 × 2 rays everywhere.

The plain reference has the same rays, textures and light, but samples every pixel alike and keeps
nothing from frame to frame. Run it with `pytest bench/bench_raycast.py`.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf
from pydantic import TypeAdapter
from small import sized

from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.parameters import RaycastParameters
from stixel_cli.rendering.placement import numbered_objects, rig_cameras, world_from_target_3d
from stixel_cli.rendering.raycast import StaticScene, Target, render_frame
from stixel_cli.rendering.supersampling import sample_offsets
from stixel_cli.rendering.surfaces import srgb_from_linear
from stixel_cli.rendering.tracing import Body, Shot, light_of, nearest, sunlit
from stixel_cli.scene.parameters import RoadUser, World
from stixel_cli.scene.road_user import road_user_meshes
from stixel_cli.scene.scenario import Scenario

CONF = Path(__file__).parents[1] / "conf"
CHUNK = sized(10, 2)
SIZE = sized({}, {"width": 160, "height": 120})
PAIR = "A rendered pair, 640 × 480 px, one thread"


def preset(group: str, option: str, schema):
    plain = OmegaConf.to_container(OmegaConf.load(CONF / group / f"{option}.yaml"))
    return TypeAdapter(schema).validate_json(json.dumps(plain))


def motion(moving: bool) -> Scenario:
    k = np.arange(CHUNK)
    ego = np.tile([0.0, 0.0, 0.5 * np.pi], (CHUNK, 1))
    if moving:
        ego[:, 1] = 0.05 * k
    target = np.stack([-4.0 + 0.3 * k, np.full(CHUNK, 12.0), 0.05 * k - 0.5], axis=1)
    return Scenario(0.1 * k, ego, target, 0.0 * target, np.zeros((1, 0, 2)))


@pytest.fixture(scope="module")
def scene():
    rig = replace(preset("rig", "default", Rig), **SIZE)
    renderer = preset("renderer", "raycast", RaycastParameters)
    static = StaticScene(numbered_objects(preset("world", "street", World)), rig, renderer)
    target = Target(road_user_meshes(preset("road_user", "car", RoadUser)))
    render_frame(static, target, motion(False), 0)
    return static, target


def forget(static: StaticScene) -> None:
    """Let go of the views that the scene keeps."""
    static._pose = None


@pytest.mark.parametrize("ego", ["parked", "moving"])
def test_chunk_of_ten_pairs(benchmark, scene, ego):
    static, target = scene
    scenario = motion(ego == "moving")
    pairs = benchmark.pedantic(
        lambda: [render_frame(static, target, scenario, k) for k in range(CHUNK)],
        setup=lambda: forget(static),
        rounds=5,
    )
    benchmark.extra_info["seconds_per_pair"] = benchmark.stats.stats.median / CHUNK
    assert [pair[0].shape for pair in pairs] == [(static.rig.height, static.rig.width, 3)] * CHUNK


def test_first_pair(benchmark, scene):
    benchmark.group = PAIR
    static, target = scene
    scenario = motion(False)
    benchmark.pedantic(
        lambda: render_frame(static, target, scenario, 0), setup=lambda: forget(static), rounds=9
    )


def test_plain_pair_with_four_rays_everywhere(benchmark, scene):
    benchmark.group = PAIR
    static, target = scene
    scenario = motion(False)

    def pair():
        pose = world_from_target_3d(scenario.target_poses_world[0])
        bodies = static.body, Body(target.surfaces(0), pose)
        pictures = []
        rows, columns = np.divmod(np.arange(static.rig.height * static.rig.width), static.rig.width)
        right, down = sample_offsets(2)
        u, v = np.add.outer(columns, right).ravel(), np.add.outer(rows, down).ravel()
        cameras = rig_cameras(static.rig, scenario.ego_poses_world[0])
        shots = [Shot(bodies, camera) for camera in cameras]
        for shot in shots:
            hits = nearest(shot, u, v)
            linear = light_of(shot, hits, sunlit(shot, hits, (0, 1)), 0.5)
            pictures.append(srgb_from_linear(linear.reshape(len(rows), 4, 3).mean(axis=1)))
        return pictures, nearest(shots[0], columns.astype(float), rows.astype(float)).depth

    benchmark.pedantic(pair, rounds=3)
