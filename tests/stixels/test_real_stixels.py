"""Stixels of real frames, with the shipped parameters, against lidar and labelled disparity."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from boxed_road import parked
from pydantic import TypeAdapter
from real_data import real_data

from stixel_cli.config.folders import values_beside_groups
from stixel_cli.config.schema import StereoParameters
from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.image_files import read_disparity
from stixel_cli.recordings.kitti_tables import read_calibration
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.rendering.images import ImageStack
from stixel_cli.stereo.disparities import INVALID, SUBPIXELS, Disparities
from stixel_cli.stereo.matching import match
from stixel_cli.stixels.extraction import extract_stixels
from stixel_cli.stixels.free_space import find_free_space
from stixel_cli.stixels.parameters import (
    ExtractionParameters,
    FreeSpaceParameters,
    HeightParameters,
    OccupancyParameters,
    RoadParameters,
)
from stixel_cli.stixels.road import find_road
from stixel_cli.validation.pair_errors import called_free, true_obstacles

CONF = Path(__file__).parents[2] / "conf"


def shipped(schema, option):
    values = yaml.safe_load((CONF / f"{option}.yaml").read_text())
    group = option.partition("/")[0]
    # As `stixel run` sets them for recordings.
    sets = [one["set"] for one in values_beside_groups("recorded")["source"]["values"]]
    own = {key: one[f"{group}.{key}"] for one in sets for key in values if f"{group}.{key}" in one}
    return TypeAdapter(schema).validate_json(json.dumps(values | own))


SGM = shipped(StereoParameters, "stereo/sgm")
FREE_SPACE = shipped(FreeSpaceParameters, "free_space/default")
ESTIMATED = shipped(RoadParameters, "road/estimated")


@pytest.fixture(scope="module")
def data():
    return real_data("kitti2015").parent


def free_space_of(disparities, rig, road):
    """Free space of a single frame."""
    occupancy = shipped(OccupancyParameters, "occupancy/polar")
    parameters = shipped(RoadParameters, f"road/{road}"), occupancy, FREE_SPACE
    return find_free_space(disparities, parked(1), rig, *parameters, range(1), None)


def processed(rig, left, right, road="rig", **stereo):
    """Free space and stixels of a pair of files; `stereo` replaces values of that group."""
    pairs, parameters = pairs_of(left, right), replace(SGM, **stereo)
    disparities = match(pairs, parameters, rig, range(1))
    free_space = free_space_of(disparities, rig, road)
    height = shipped(HeightParameters, "height/default")
    parameters = rig, height, shipped(ExtractionParameters, "extraction/default")
    return free_space, extract_stixels(disparities, free_space, pairs, *parameters, range(1))


def pairs_of(left, right):
    grey = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in (left, right)]
    return StereoPairs(0, *(ImageStack.from_images([image]) for image in grey))


def errors_in_areas(stixels, u, v, disparity):
    """Stixel's disparity minus the median of the measured ones in its lower two thirds, px."""
    errors = []
    columns = stixels.left, stixels.right, stixels.top, stixels.base, stixels.disparity
    for left, right, top, base, d in zip(*columns, strict=True):
        # The lowest rows see the road as well, and the upper end may overlap what is behind.
        rows = base - top + 1
        inside = (u >= left) & (u < right) & (v >= base - 0.7 * rows) & (v <= base - 0.1 * rows)
        if np.count_nonzero(inside) >= 4:
            errors.append(d - np.median(disparity[inside]))
    return np.array(errors)


@pytest.mark.parametrize("road", ["rig", "estimated"])
def test_stixels_agree_with_the_labelled_disparity(data, road):
    rig, left, right, truth = pair_with_truth(data, "kitti2015")
    _, stixels = processed(rig, left, right, road)
    v, u = np.nonzero(np.isfinite(truth))
    errors = errors_in_areas(stixels, u, v, truth[v, u])
    print(f"\nlabelled: {summary(errors)}")
    assert len(errors) > 100
    assert np.median(np.abs(errors)) < 0.6
    assert np.mean(np.abs(errors) > 3) < 0.15


def rig_of(file, cameras, width=1242, height=375):
    """The rig of a calibration in KITTI's form."""
    found = read_calibration(file, cameras)
    values = found.focal_length, found.principal_u, found.principal_v, found.baseline
    return Rig(width, height, None, *values, 1.65, 0.0, None)


def test_dark_car_beside_the_camera_is_unknown_and_not_free(data):
    rig, left, right, _ = pair_with_truth(data, "kitti_object")
    free_space, _ = processed(rig, left, right, "estimated", disparities_at_full_size=None)
    unknown = free_space.unknown_row[0] >= 0
    # The car is in the last 400 columns, from the bottom of the image on; at full size, 80 % of its
    # pixels have no disparity. The road ahead is known.
    assert np.mean(unknown[-400:]) > 0.6
    assert np.mean(unknown[100:800]) < 0.02
    # What the right image does not show of the left border is unknown as well.
    assert unknown[:20].all()


def test_half_the_size_finds_more_of_a_dark_car(data):
    rig, left, right, truth = pair_with_truth(data, "kitti_object")
    true = true_obstacles(truth, rig, ESTIMATED, FREE_SPACE)
    columns = {}
    for count in (None, 64):
        found, _ = processed(rig, left, right, "estimated", disparities_at_full_size=count)
        depth = rig.depth_from_disparity(found.disparity[0])
        with np.errstate(invalid="ignore"):
            right_depth = np.abs(depth - true) < 0.1 * true
            columns[count] = int(np.sum(right_depth & (true < 6.0)))
    print(f"\nnearer than 6 m and right to 10 %, columns by disparities at full size: {columns}")
    assert columns[64] > 2 * columns[None]


def lidar_disparities(folder, rig):
    """Places (u, v) and disparities of the laser's points, px."""
    rows = [line.split() for line in (folder / "calib.txt").read_text().splitlines() if line]
    matrices = {name.removesuffix(":"): np.array(numbers, float) for name, *numbers in rows}
    left, to_camera = (matrices[name].reshape(3, 4) for name in ("P2", "Tr_velo_to_cam"))
    scan = np.fromfile(folder / "lidar.bin", dtype=np.float32).reshape(-1, 4)[:, :3]
    points = to_camera[:, :3] @ scan.T + to_camera[:, 3:]
    points = matrices["R0_rect"].reshape(3, 3) @ points
    points = points[:, points[2] > 2.0]
    u, v, w = left[:, :3] @ points + left[:, 3:]
    return u / w, v / w, rig.focal * rig.baseline / w


def test_stixels_agree_with_the_lidar(data):
    rig, left, right, _ = pair_with_truth(data, "kitti_object")
    _, stixels = processed(rig, left, right)
    u, v, disparity = lidar_disparities(left.parent, rig)
    errors = errors_in_areas(stixels, u, v, disparity)
    print(f"\nlidar: {summary(errors)}")
    assert len(errors) > 100
    # The disparities themselves are 0.5 px off, up to 1 px at the image's left border.
    assert np.median(np.abs(errors)) < 0.8
    # A dark car beside the camera has no disparity: what stands behind it is seen instead.
    assert np.mean(np.abs(errors) > 3) < 0.3


FIRST = tuple(f"000000_10_{name}" for name in ("left", "right", "disp_occ"))
TRUE_PAIRS = {"kitti2012": FIRST, "kitti2015": FIRST}
for number in ("000074", "000174"):
    files = tuple(f"{name}/{number}_10" for name in ("image_0", "image_1", "disp_occ"))
    TRUE_PAIRS[f"kitti2012_more {number}"] = files
CALIBRATIONS = {
    "kitti2012": (707.0912, 601.8873, 183.1104, 0.5379),
    "kitti2015": (721.5377, 609.5593, 172.854, 0.5327254),
}


def pair_with_truth(data, name):
    """Rig, left and right image, and true disparities (H, W) px of a pair; NaN where unknown."""
    if name == "kitti_object":
        folder = data / name
        rig = rig_of(folder / "calib.txt", ("P2", "P3"))
        u, v, d = lidar_disparities(folder, rig)
        truth = np.full((rig.height, rig.width), np.nan, dtype=np.float32)
        inside = (u >= 0) & (u < rig.width - 0.5) & (v >= 0) & (v < rig.height - 0.5)
        # The nearest point of a pixel is written last.
        for i in np.flatnonzero(inside)[np.argsort(d[inside])]:
            truth[round(v[i]), round(u[i])] = d[i]
        return rig, folder / "left.png", folder / "right.png", truth
    folder = data / name.split()[0]
    left, right, disparity = (folder / f"{file}.png" for file in TRUE_PAIRS[name])
    truth = read_disparity(disparity)
    height, width = truth.shape
    if name in CALIBRATIONS:
        rig = Rig(width, height, None, *CALIBRATIONS[name], 1.65, 0.0, None)
    else:
        calibration = folder / "calib" / f"{name.split()[1]}.txt"
        rig = rig_of(calibration, ("P0", "P1"), width, height)
    return rig, left, right, truth


@pytest.mark.parametrize("name", [*TRUE_PAIRS, "kitti_object"])
def test_no_obstacle_nearer_than_6_m_is_called_free(data, name):
    rig, left, right, truth = pair_with_truth(data, name)
    free_space, _ = processed(rig, left, right, "estimated")
    obstacles = true_obstacles(truth, rig, ESTIMATED, FREE_SPACE)
    free = called_free(free_space, 0, obstacles, rig, 6.0)
    with np.errstate(invalid="ignore"):
        near = np.count_nonzero(obstacles < 6.0)
    print(f"\n{name}: {free.sum()} of {near} columns with an obstacle nearer than 6 m")
    assert near > 100 or "kitti_object" not in name
    assert free.sum() == 0


def rows_per_column(raw, rig, line):
    """Rows by which the road's line moves from one column to the next: a plane near `line` (2,)."""
    v, u = np.nonzero(raw > 0)
    disparities, u = raw[v, u] / SUBPIXELS, u - rig.u0
    plane = np.array([*line, 0.0])
    for tolerance in (3.0, 3.0, 2.0, 1.5, 1.0, 1.0, 1.0):
        road = plane[0] * v + plane[1] + plane[2] * u
        near = (road > 1.0) & (np.abs(disparities - road) < tolerance)
        of_pixels = np.stack([v[near], np.ones(near.sum()), u[near]], axis=1)
        plane = np.linalg.lstsq(of_pixels, disparities[near], rcond=None)[0]
    return plane[2] / plane[0]


def without_roll(raw, rig, rows):
    """The disparities (H, W) with each column moved, so that the road has one line in all."""
    moved = np.arange(rig.height)[:, None] - np.rint(rows * (np.arange(rig.width) - rig.u0))
    inside = (moved >= 0) & (moved < rig.height)
    found = np.take_along_axis(raw, np.where(inside, moved, 0).astype(np.int64), axis=0)
    return np.where(inside, found, INVALID).astype(np.int16)


@pytest.mark.parametrize("name", TRUE_PAIRS)
def test_the_roll_of_the_road_does_not_matter(data, name):
    # docs/real-data.md has these figures, and the reason why the road has no roll.
    rig, left, right, truth = pair_with_truth(data, name)
    level = match(pairs_of(left, right), SGM, rig, range(1))
    raw = level.raw(0)
    line = find_road(np.ascontiguousarray(raw.T), level.count, rig, ESTIMATED)
    rows = rows_per_column(raw, rig, line)
    turned = Disparities.from_raw(0, level.count, [without_roll(raw, rig, rows)])
    obstacles = true_obstacles(truth, rig, ESTIMATED, FREE_SPACE)
    seen, found = np.isfinite(obstacles), []
    for disparities in (level, turned):
        free_space = free_space_of(disparities, rig, "estimated")
        depth = rig.focal * rig.baseline / free_space.disparity[0].astype(np.float64)
        right_ones = seen & (np.abs(depth / obstacles - 1.0) < 0.1)
        found.append((right_ones.sum(), (seen & np.isnan(depth)).sum()))
        assert not called_free(free_space, 0, obstacles, rig, 6.0).any()
    print(f"\n{name}: roll {np.degrees(np.arctan(rows)):.2f}°; of {seen.sum()} columns with an "
          f"obstacle, within 10 % of its depth: {found[0][0]}, with roll {found[1][0]}; free: "
          f"{found[0][1]}, with roll {found[1][1]}")  # fmt: skip
    assert abs(found[0][0] - found[1][0]) < 0.03 * seen.sum()


def summary(errors):
    size = np.abs(errors)
    medians = f"median {np.median(errors):+.2f} px, median size {np.median(size):.2f} px"
    return f"{len(size)} stixels, {medians}, above 3 px {np.mean(size > 3):.2f}"
