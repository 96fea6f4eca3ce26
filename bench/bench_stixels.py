"""Disparity to stixels on 1242 × 375 with 128 disparities, beside plain NumPy; and the matchers.

Run it with `pytest bench/bench_stixels.py`. The disparity is that of a real frame where the folder
named by STIXEL_DATA has one, else of a made street.
"""

import json
import os
import time
from dataclasses import replace
from itertools import repeat
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from pydantic import TypeAdapter
from scipy.special import ndtr
from small import sized

from stixel_cli import StixelStream
from stixel_cli.config.schema import StereoParameters
from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.image_files import grey, read_image
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.rendering.images import ImageStack, encode_png
from stixel_cli.stereo.matching import match
from stixel_cli.stixels.extraction import stixels_of_frame
from stixel_cli.stixels.free_space import expected_depth, obstacle_base, unknown_rows
from stixel_cli.stixels.height import Frame, top_rows
from stixel_cli.stixels.nearest_obstacle import cell_costs, cheapest_path, nearest_obstacle
from stixel_cli.stixels.occupancy import column_histograms, fill, layout
from stixel_cli.stixels.parameters import (
    ExtractionParameters,
    FreeSpaceParameters,
    HeightParameters,
    OccupancyParameters,
    RoadParameters,
)
from stixel_cli.stixels.road import find_road, obstacle_limits, road_line

ROOT = Path(__file__).parents[1]
COUNT = sized(128, 32)
CAMERA = sized((1242, 375, None, 721.5377, 609.5593, 172.854), (310, 94, None, 180.4, 152.4, 43.2))
RIG = Rig(*CAMERA, 0.5327254, 1.65, 0.0, None)
NEAREST = RIG.focal * RIG.baseline / (COUNT - 1.5)
"""m, for which `COUNT` disparities are searched."""
FOLDER = Path(os.environ.get("STIXEL_DATA", ROOT / "../shared/data")) / "kitti2015"


def shipped(schema, option):
    text = (ROOT / "conf" / f"{option}.yaml").read_text()
    return TypeAdapter(schema).validate_json(json.dumps(yaml.safe_load(text)))


STEREO = replace(shipped(StereoParameters, "stereo/sgm"), nearest=NEAREST)
BLOCKS = replace(shipped(StereoParameters, "stereo/bm"), nearest=NEAREST)
FREE_SPACE = shipped(FreeSpaceParameters, "free_space/default")
HEIGHT = shipped(HeightParameters, "height/default")
EXTRACTION = shipped(ExtractionParameters, "extraction/default")


@pytest.fixture(scope="module")
def pairs():
    if FOLDER.is_dir():
        views = [
            cv2.imread(str(FOLDER / f"000000_10_{side}.png"), cv2.IMREAD_GRAYSCALE)
            for side in ("left", "right")
        ]
    else:
        rows = made_street()
        texture = np.random.default_rng(0).integers(0, 256, rows.shape, dtype=np.uint8)
        texture = cv2.GaussianBlur(texture, (5, 5), 0)
        # The right view's texture, drawn to the left view by the disparity.
        u = np.arange(RIG.width) - np.maximum(rows, 0) / 16.0
        v = np.repeat(np.arange(RIG.height)[:, None], RIG.width, axis=1)
        left = cv2.remap(
            texture, u.astype(np.float32), v.astype(np.float32), cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REFLECT,
        )  # fmt: skip
        views = [left, texture]
    return StereoPairs(0, *(ImageStack.from_images([view]) for view in views))


def made_street():
    """Raw disparities (H, W) int16 of a road with boxes left and right and a wall at its end."""
    line = road_line(0.0, RIG.camera_height, RIG)
    v = np.arange(RIG.height)[:, None]
    disparity = np.maximum(line[0] * v + line[1], 0.0) + np.zeros((1, RIG.width))
    for u in range(0, RIG.width, 90):
        depth = 6.0 + 34.0 * (1.0 - abs(u / RIG.width - 0.5) * 2.0)
        d = RIG.disparity_from_depth(depth)
        tall = 1.5 if u % 180 else 6.0
        rows = (v >= RIG.v0 + (RIG.camera_height - tall) * d / RIG.baseline) & (
            v <= RIG.v0 + RIG.camera_height * d / RIG.baseline
        )
        box = disparity[:, u : u + 70]
        np.maximum(box, d, out=box, where=np.broadcast_to(rows, box.shape))
    noise = np.random.default_rng(0).normal(0.0, 4.0, disparity.shape)
    return np.where(disparity > 0, np.maximum(disparity * 16 + noise, 0), -1).astype(np.int16)


@pytest.fixture(scope="module")
def raw(pairs):
    return match(pairs, STEREO, RIG, range(1)).raw(0)


def segment(raw, expected, road, occupancy, grid, images=None, layers="one"):
    """One frame from disparity to stixels, as the two stages do it."""
    columns = cv2.transpose(raw)
    line = find_road(columns, COUNT, RIG, road)
    obstacle = nearest_obstacle(columns, line, expected, road, grid, FREE_SPACE)
    base = obstacle_base(obstacle, line, RIG)
    columns = cv2.transpose(raw)
    extraction = replace(EXTRACTION, layers=layers)
    if images is None:
        extraction = replace(extraction, refinement=0.0)
    unknown_rows(columns, base, line, road, grid, FREE_SPACE)
    frame = Frame(columns, COUNT, obstacle, base, line, RIG)
    stixels = stixels_of_frame(frame, HEIGHT, extraction, images)
    return obstacle, base, line, stixels


def prepared(raw, road="rig", occupancy="polar"):
    road = shipped(RoadParameters, f"road/{road}")
    occupancy = shipped(OccupancyParameters, f"occupancy/{occupancy}")
    grid = layout(occupancy, RIG, COUNT)
    obstacle, base, line, _ = segment(raw, None, road, occupancy, grid)
    poses = np.array([[0.0, 0.0, np.pi / 2], [0.0, 1.0, np.pi / 2]])
    expected = expected_depth(obstacle, base, line, RIG, *poses)
    return road, occupancy, grid, expected


@pytest.mark.parametrize("occupancy", ["polar", "column_disparity", "cartesian"])
@pytest.mark.parametrize("road", ["rig", "estimated"])
def test_disparity_to_stixels(benchmark, raw, pairs, road, occupancy):
    benchmark.group = "disparity to stixels"
    road, occupancy, grid, expected = prepared(raw, road, occupancy)
    obstacle, *_ = benchmark(
        segment, raw, expected, road, occupancy, grid, (pairs.left[0], pairs.right[0])
    )
    assert np.isfinite(obstacle).mean() > 0.3


def test_disparity_to_stixels_of_many_layers(benchmark, raw, pairs):
    benchmark.group = "disparity to stixels"
    road, occupancy, grid, expected = prepared(raw)
    images = pairs.left[0], pairs.right[0]
    *_, stixels = benchmark(segment, raw, expected, road, occupancy, grid, images, "many")
    *_, one = segment(raw, expected, road, occupancy, grid, images)
    assert len(stixels["left"]) >= len(one["left"])


STEPS = ("histogram", "grid", "costs", "path", "unknown", "height", "stixels", "refined stixels")
STEPS += ("refined stixels, many layers",)


@pytest.mark.parametrize("step", STEPS)
def test_step(benchmark, raw, pairs, step):
    benchmark.group = "steps, polar grid"
    road, occupancy, grid, expected = prepared(raw)
    columns = cv2.transpose(raw)
    obstacle, base, line, _ = segment(raw, expected, road, occupancy, grid)
    bins = len(grid.likelihoods)
    scale = np.full(RIG.height, 1 / 16, dtype=np.float32)
    count = (columns, *obstacle_limits(line, RIG, road, COUNT), 2 * scale, bins)
    fill_grid = (column_histograms(*count), grid.likelihoods, grid.first, grid.last)
    need = FREE_SPACE.obstacle_height * grid.disparities / RIG.baseline * grid.peaks
    bounds = np.float32(FREE_SPACE.cost_bound), np.float32(FREE_SPACE.free_cost)
    weigh = (fill(*fill_grid), (1 / need).astype(np.float32), *bounds)
    depths = np.append(grid.depths, 2 * grid.depths[-1] - grid.depths[-2])
    limits = np.float32(FREE_SPACE.spatial_cost), np.float32(FREE_SPACE.spatial_limit)
    frame = Frame(columns, COUNT, obstacle, base, line, RIG)
    images = pairs.left[0], pairs.right[0]
    work = {
        "histogram": lambda: column_histograms(*count),
        "grid": lambda: fill(*fill_grid),
        "costs": lambda: cell_costs(*weigh),
        "path": (lambda costs: lambda: cheapest_path(costs, depths, *limits))(cell_costs(*weigh)),
        "height": lambda: top_rows(frame, HEIGHT),
        "unknown": lambda: unknown_rows(columns, base, line, road, grid, FREE_SPACE),
        "stixels": lambda: stixels_of_frame(frame, HEIGHT, replace(EXTRACTION, refinement=0.0)),
        "refined stixels": lambda: stixels_of_frame(frame, HEIGHT, EXTRACTION, images),
        "refined stixels, many layers": lambda: stixels_of_frame(
            frame, HEIGHT, replace(EXTRACTION, layers="many"), images
        ),
    }
    benchmark(work[step])


def test_disparity_to_stixels_plain(benchmark, raw):
    benchmark.group = "disparity to stixels"
    road, occupancy, grid, _ = prepared(raw)
    obstacle, top = benchmark.pedantic(plain, args=(raw, road, occupancy, grid), rounds=2)
    fast, base, line, _ = segment(raw, None, road, occupancy, grid)
    both = np.isfinite(fast) & np.isfinite(obstacle)
    # The plain one is not refined within the row.
    depth = RIG.focal * RIG.baseline / fast[both]
    assert np.mean(np.abs(RIG.focal * RIG.baseline / obstacle[both] - depth) < 1.0) > 0.9
    columns = cv2.transpose(raw)
    assert (
        np.mean(np.abs(top_rows(Frame(columns, COUNT, fast, base, line, RIG), HEIGHT) - top) <= 3)
        > 0.8
    )


def plain(raw, road, occupancy, grid):
    """The same steps in plain NumPy: dense products, O(rows²) paths, no compiled loop."""
    line = road_line(0.0, RIG.camera_height, RIG)
    lowest, highest = obstacle_limits(line, RIG, road, COUNT)
    v, u = np.nonzero((raw >= lowest[:, None]) & (raw <= highest[:, None]))
    bins = 2 * COUNT + 1
    votes = np.bincount(u * bins + (raw[v, u] + 4) // 8, minlength=RIG.width * bins)
    z = grid.depths.astype(float)
    near, far = (RIG.disparity_from_depth(z + s * occupancy.depth_step) for s in (-0.5, 0.5))
    sigma = np.hypot(occupancy.disparity_std, occupancy.relief * grid.disparities / z)
    centres = np.arange(bins)[:, None] / 2
    matrix = (ndtr((near - centres) / sigma) - ndtr((far - centres) / sigma)) / (near - far)
    values = votes.reshape(RIG.width, bins) @ matrix
    pixels = FREE_SPACE.obstacle_height * grid.disparities / RIG.baseline
    evidence = values / (np.maximum(FREE_SPACE.obstacle_pixels, pixels) * grid.peaks)
    for column in evidence:
        peaks = np.flatnonzero((column[:-1] >= 1) & (column[1:] < column[:-1]))
        if len(peaks):
            rises = np.flatnonzero(np.diff(column[peaks[0] :]) > 0)
            column[peaks[0] + rises[0] + 1 if len(rises) else len(column) :] = 0
    with np.errstate(divide="ignore", over="ignore"):
        cost = np.minimum(1 / evidence, FREE_SPACE.cost_bound)
    cost = np.hstack([cost, np.full((RIG.width, 1), FREE_SPACE.free_cost)])
    z = np.append(z, 2 * z[-1] - z[-2])
    step = FREE_SPACE.spatial_cost * np.minimum(abs(z[:, None] - z), FREE_SPACE.spatial_limit)
    path = viterbi(cost, [step] * (RIG.width - 1))
    obstacle = np.append(grid.disparities, np.nan)[path]
    base = obstacle_base(obstacle, line, RIG)
    rows = np.arange(RIG.height)
    window = obstacle - RIG.disparity_from_depth(
        RIG.depth_from_disparity(obstacle) + HEIGHT.depth_margin
    )
    member = np.exp2(1 - ((raw / 16 - obstacle) / window) ** 2) - 1
    member = np.where((raw >= 0) & np.isfinite(member) & (rows[:, None] <= base), member, 0)
    above = np.vstack([np.zeros(RIG.width), np.cumsum(member, axis=0)[:-1]])
    cost = (2 * above - member.sum(axis=0)).T
    cost[(rows > np.maximum(base, 0)[:, None])] = 1e9
    depth = np.nan_to_num(RIG.depth_from_disparity(obstacle), nan=1e9)
    tied = HEIGHT.smoothness * np.maximum(0, 1 - abs(np.diff(depth)) / HEIGHT.depth_scale)
    away = abs(rows[:, None] - rows)
    return obstacle, np.where(base < 0, -1, viterbi(cost, (t * away for t in tied)))


def viterbi(cost, steps):
    """Rows of least cost, every pair of rows tried."""
    total, back = cost[0], []
    for of_column, step in zip(cost[1:], steps, strict=True):
        together = total + step
        back.append(np.argmin(together, axis=1))
        total = of_column + together.min(axis=1)
    path = [int(np.argmin(total))]
    for row in reversed(back):
        path.append(int(row[path[-1]]))
    return np.array(path[::-1])


@pytest.mark.parametrize("mode", ["3way", "sgbm", "hh4", "hh"])
def test_match_sgm(benchmark, pairs, mode):
    benchmark.group = "match"
    other = type("OtherMode", (type(STEREO),), {"mode": mode})
    stereo = other(**vars(STEREO))
    benchmark.pedantic(match, args=(pairs, stereo, RIG, range(1)), rounds=3)


def test_match_bm(benchmark, pairs):
    benchmark.group = "match"
    benchmark.pedantic(match, args=(pairs, BLOCKS, RIG, range(1)), rounds=3)


IMAGES = (
    f"Images to stixels, {RIG.width} × {RIG.height} px, {COUNT} disparities, one thread, CPU time"
)


@pytest.mark.benchmark(group=IMAGES, timer=time.process_time)
@pytest.mark.parametrize(
    ("subpixel", "at_full_size"),
    [
        pytest.param("phase_table", None, id="phase_table"),
        pytest.param("phase_table", 64, id="phase_table, 64 at full size"),
        pytest.param("parabola", None, id="parabola"),
    ],
)
def test_images_to_stixels(benchmark, pairs, raw, subpixel, at_full_size):
    road, occupancy, grid, expected = prepared(raw)
    stereo = replace(STEREO, subpixel=subpixel, disparities_at_full_size=at_full_size)

    def frame():
        found = match(pairs, stereo, RIG, range(1)).raw(0)
        segment(found, expected, road, occupancy, grid)
        return found

    benchmark.extra_info["accuracy"] = accuracy(benchmark.pedantic(frame, rounds=7))


@pytest.mark.benchmark(group=IMAGES, timer=time.process_time)
def test_images_to_stixels_plain(benchmark, pairs, raw):
    road, occupancy, grid, _ = prepared(raw)

    def frame():
        found = plain_match(pairs.left[0], pairs.right[0])
        plain(found, road, occupancy, grid)
        return found

    benchmark.extra_info["accuracy"] = accuracy(benchmark.pedantic(frame, rounds=1))


TRACK = f"PNG files to the track, {RIG.width} × {RIG.height} px, a pair on two cores"


@pytest.mark.benchmark(group=TRACK)
def test_files_to_track(benchmark, pairs, tmp_path):
    """A stream of the same pair, a parked car: two threads match ahead."""
    files = written(pairs, tmp_path)
    frames = StixelStream(RIG).steps(
        [grey(read_image(file)) for file in one] for one in repeat(files)
    )
    benchmark.pedantic(next, args=(frames,), rounds=sized(40, 2), warmup_rounds=3)
    frames.close()
    benchmark.extra_info["accuracy"] = f"{1.0 / benchmark.stats.stats.mean:.1f} pairs a second"


@pytest.mark.benchmark(group=TRACK)
def test_files_to_track_plain(benchmark, pairs, raw, tmp_path):
    """One thread, and no track."""
    files = written(pairs, tmp_path)
    road, occupancy, grid, _ = prepared(raw)

    def frame():
        plain(plain_match(*(grey(read_image(file)) for file in files)), road, occupancy, grid)

    benchmark.pedantic(frame, rounds=1)


def written(pairs, folder):
    """PNG files of the left and the right image."""
    files = folder / "left.png", folder / "right.png"
    for file, image in zip(files, (pairs.left[0], pairs.right[0]), strict=True):
        file.write_bytes(encode_png(image))
    return files


def accuracy(raw):
    """Errors of raw disparities against the pair's ground truth, as text."""
    if FOLDER.is_dir():
        path = str(FOLDER / "000000_10_disp_occ.png")
        true = cv2.imread(path, cv2.IMREAD_UNCHANGED) / 256.0
    else:
        true = made_street() / 16.0
    known = true > 0
    error = np.abs(raw / 16 - true)[known & (raw >= 0)]
    fine = error[error <= 1.0]
    return (
        f"{np.sqrt(np.mean(fine**2)):.3f} px RMS, {1 - len(fine) / len(error):.1%} beyond 1 px, "
        f"{len(error) / known.sum():.0%} dense"
    )


def plain_match(left, right):
    """Semi-global matching in plain NumPy: the same three directions and block, no checks."""
    half = STEREO.block_size // 2
    prepared = []
    for image in (left, right):
        wide = np.pad(image.astype(np.int32), ((1, 1), (1, 1)), mode="edge")
        slope = wide[:, 2:] - wide[:, :-2]
        sobel = slope[:-2] + 2 * slope[1:-1] + slope[2:]
        prepared.append(np.clip(sobel, -STEREO.pre_filter_cap, STEREO.pre_filter_cap))
    cost = np.full((*left.shape, COUNT), 1 << 14, dtype=np.int32)
    for d in range(COUNT):
        difference = np.abs(prepared[0][:, d:] - prepared[1][:, : left.shape[1] - d])
        total = np.pad(difference, ((half + 1, half), (half + 1, half)), mode="edge")
        total = total.cumsum(axis=0).cumsum(axis=1)
        side = STEREO.block_size
        total = total[side:] - total[:-side]
        cost[:, d:, d] = total[:, side:] - total[:, :-side]
    whole = np.zeros_like(cost)
    for lines, sums in (
        (cost, whole),
        (cost.swapaxes(0, 1), whole.swapaxes(0, 1)),
        (cost.swapaxes(0, 1)[::-1], whole.swapaxes(0, 1)[::-1]),
    ):
        before = lines[0]
        sums[0] += before
        for line, into in zip(lines[1:], sums[1:], strict=True):
            least = before.min(axis=1, keepdims=True)
            best = np.minimum(before, least + STEREO.p2)
            best[:, 1:] = np.minimum(best[:, 1:], before[:, :-1] + STEREO.p1)
            best[:, :-1] = np.minimum(best[:, :-1], before[:, 1:] + STEREO.p1)
            before = line + best - least
            into += before
    at = whole.argmin(axis=2)[..., None]
    below, here, above = (
        np.take_along_axis(whole, np.clip(at + step, 0, COUNT - 1), axis=2)[..., 0]
        for step in (-1, 0, 1)
    )
    curve = np.maximum(below + above - 2 * here, 1)
    found = 16 * at[..., 0] + 8 * (below - above) // curve
    return np.where(found > 16 * np.arange(left.shape[1]), -1, found).astype(np.int16)
