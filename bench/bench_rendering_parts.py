"""Parts of a rendered pair next to the plain way to do the same: CPU time as a ratio, and accuracy.

Both ways take turns in the same run, and the least time of each counts, so that other work on the
machine falls on both. Run it with `pytest -s bench/bench_rendering_parts.py`.
"""

import os
import resource
import subprocess
import sys
from dataclasses import replace
from itertools import product

import cv2
import numpy as np
import pytest
from bench_raycast import SIZE, motion, preset
from small import sized

from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering import tracing
from stixel_cli.rendering.frames import DEPTH_STEP
from stixel_cli.rendering.images import encode_png, encode_pnm
from stixel_cli.rendering.parameters import RaycastParameters
from stixel_cli.rendering.placement import numbered_objects, rig_cameras, world_from_target_3d
from stixel_cli.rendering.raycast import StaticScene, Target, render_frame
from stixel_cli.rendering.sensor_noise import LUMA, grey_levels, normal_quantiles
from stixel_cli.rendering.supersampling import (
    Centres,
    edge_pixels,
    sample_offsets,
    supersampled,
)
from stixel_cli.rendering.surfaces import srgb_from_linear
from stixel_cli.rendering.tracing import Body, Shot
from stixel_cli.scene.parameters import RoadUser, World
from stixel_cli.scene.road_user import road_user_meshes


def cpu(who: int = resource.RUSAGE_SELF) -> float:
    """CPU time so far, s."""
    used = resource.getrusage(who)
    return used.ru_utime + used.ru_stime


def compare(benchmark, title: str, rounds: int, who: int = resource.RUSAGE_SELF, **ways) -> None:
    """Print and record the CPU times of `ways`, and each one's ratio to the first."""
    times = {name: [] for name in ways}
    for _ in range(sized(rounds, 1)):
        for name, way in ways.items():
            start = cpu(who)
            way()
            times[name].append(cpu(who) - start)
    least = {name: min(found) for name, found in times.items()}
    first = next(iter(least.values()))
    print(f"\n{title}:")
    for name, time in least.items():
        print(f"  {name:18} {1e3 * time:9.2f} ms  {time / first:5.2f}")
    benchmark.extra_info.setdefault("ways", {})[title] = {
        name: {"seconds": time} for name, time in least.items()
    }
    if not benchmark.stats:
        benchmark.pedantic(lambda: None, rounds=1)


def record(benchmark, title: str, way: str, accuracy: str) -> None:
    """Print and record the accuracy or size of a way of `compare`."""
    print(f"  {way:18} {accuracy}")
    benchmark.extra_info["ways"][title][way]["accuracy"] = accuracy


@pytest.fixture(scope="module")
def scene():
    rig = replace(preset("rig", "default", Rig), **SIZE)
    renderer = preset("renderer", "raycast", RaycastParameters)
    static = StaticScene(numbered_objects(preset("world", "street", World)), rig, renderer)
    return static, Target(road_user_meshes(preset("road_user", "car", RoadUser)))


def test_import_of_open3d(benchmark):
    """Next to `import open3d`; and that of the stixels of one pair, which needs no Open3D."""

    def imports(statement: str):
        subprocess.run([sys.executable, "-c", sized(statement, "")], check=True)

    module = "from stixel_cli.scene.open3d_import import"
    compare(
        benchmark,
        "import, in a new process",
        5,
        resource.RUSAGE_CHILDREN,
        whole=lambda: imports(f"{module} import_open3d; import_open3d()"),
        bindings=lambda: imports(f"{module} import_open3d_bindings; import_open3d_bindings()"),
        stixels_from_pair=lambda: imports("from stixel_cli import stixels_from_pair"),
    )


def test_png(benchmark, scene):
    """Next to OpenCV with the compression level 1, which changes its filter and strategy.

    Of a rendered pair, the pictures are stored without compression.
    """
    left, right, depth, ids = render_frame(*scene, motion(False), 0)
    steps = np.where(np.isfinite(depth), np.rint(depth / DEPTH_STEP), 0).astype(np.uint32)
    high, low = (steps >> 16).astype(np.uint16), (steps & 0xFFFF).astype(np.uint16)
    noise = np.random.default_rng(0).normal(0.0, 2.0, ids.shape)
    grey = np.clip(grey_levels(left) + noise, 0, 255).astype(np.uint8)
    for name, images in {"a rendered pair": (left, right, high, low, ids), "grey": (grey,)}.items():
        plain = [(cv2.IMWRITE_PNG_COMPRESSION, 1)] * len(images)

        def level(images=images, plain=plain):
            return [cv2.imencode(".png", i, p)[1] for i, p in zip(images, plain, strict=True)]

        def default(images=images):
            return [encode_png(image) for image in images]

        def stored(images=images):
            return [(encode_png if image.ndim == 2 else encode_pnm)(image) for image in images]

        title = f"PNG of {name}"
        ways = {"level_1": level, "default": default}
        if len(images) > 1:
            ways["pictures plain"] = stored
        compare(benchmark, title, 9, **ways)
        for label, way in ways.items():
            size = sum(len(data) for data in way()) / 1e3
            record(benchmark, title, label, f"{size:.0f} kB")


def test_noise(benchmark):
    """Next to NumPy's normal deviates."""
    random, shape = np.random.default_rng(0), (480, 640)
    normal_quantiles()
    compare(
        benchmark,
        "normal deviates of an image",
        15,
        numpy=lambda: random.standard_normal(shape, dtype=np.float32),
        table=lambda: normal_quantiles()[random.integers(0, 65536, shape, dtype=np.uint16)],
    )


def rays(shot, centres, at_shadow, samples):
    """As `supersampled`, with a ray and a colour for each sample.

    A sample on the triangle of the pixel's centre keeps the light of that, unless `at_shadow` is
    None: then all samples are shaded.
    """
    right, down = sample_offsets(samples)
    result = np.empty((len(centres.rows), 3), dtype=np.float32)
    step = (1 << 21) // samples**2
    for start in range(0, len(result), step):
        block = slice(start, start + step)
        some = centres.at(block)
        u = np.add.outer(some.columns, right).ravel()
        v = np.add.outer(some.rows, down).ravel()
        hits = tracing.nearest(shot, u, v)
        pixel = np.repeat(np.arange(len(some.rows)), len(right))
        alike = np.zeros(len(pixel), dtype=bool)
        asked = np.arange(len(pixel))
        if at_shadow is not None:
            alike = hits.body == some.hits.body[pixel]
            alike &= hits.triangle == some.hits.triangle[pixel]
            asked = np.flatnonzero(~alike | at_shadow[block][pixel])
        hits = hits.at(asked)
        lit = tracing.sunlit(shot, hits, (0, 1))
        other = np.flatnonzero(~alike[asked] | (lit != some.lit[pixel[asked]]))
        colours = some.light[pixel]
        colours[asked[other]] = tracing.light_of(shot, hits.at(other), lit[other], 1 / samples)
        result[block] = colours.reshape(-1, len(right), 3).mean(axis=1)
    return result


def test_edges(benchmark, scene):
    """Next to rays; the error is that of grey levels, against 256 rays in a pixel."""
    static, target = scene
    pose = world_from_target_3d(np.array([-1.0, 14.0, -0.5]))
    bodies = static.body, Body(target.surfaces(0), pose)
    camera = rig_cameras(static.rig, np.array([0.0, 0.0, 0.5 * np.pi]))[0]
    shot = Shot(bodies, camera)
    rows, columns = np.divmod(np.arange(camera.height * camera.width), camera.width)
    hits = tracing.nearest(shot, columns.astype(float), rows.astype(float))
    lit = tracing.sunlit(shot, hits, (0, 1))
    plain = tracing.light_of(shot, hits, lit, 1.0)
    edge, at_shadow = edge_pixels(hits, shot.tables, lit, srgb_from_linear(plain), camera.width)
    edge = np.flatnonzero(edge)
    centres, at_shadow = Centres(rows, columns, hits, lit, plain).at(edge), at_shadow[edge]
    ways = {
        f"{way.__name__} {n}": lambda n=n, way=way: way(shot, centres, at_shadow, n)
        for way, n in product([rays, supersampled], sized([2, 4, 8], [2]))
    }
    for way in ways.values():
        way()
    title = f"{len(edge)} pixels at edges"
    compare(benchmark, title, 3, **ways)
    exact = srgb_from_linear(rays(shot, centres, None, sized(16, 4))) @ LUMA
    for name, way in ways.items():
        error = srgb_from_linear(way()) @ LUMA - exact
        record(benchmark, title, name, f"{np.sqrt((error**2).mean()):.2f} grey levels RMS")


def test_compilation(benchmark, tmp_path):
    """Of all kernels, with an empty cache, in one process."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, *sized(("-m", "stixel_cli.machine.kernels"), ("-c", ""))]
    ways = dict.fromkeys(
        ("without", "cached"), lambda: subprocess.run(command, env=environment, check=True)
    )
    title = "compilation of all kernels, from the cache and without"
    compare(benchmark, title, 1, resource.RUSAGE_CHILDREN, **ways)
