"""Stixels of real frames, with the shipped parameters, against lidar and labelled disparity."""

import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from pydantic import TypeAdapter

from stixel_cli.config.schema import StereoParameters
from stixel_cli.geometry.rig import Rig
from stixel_cli.images import ImageStack
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stereo import sgm
from stixel_cli.stixels.extraction import extract_stixels
from stixel_cli.stixels.extraction_parameters import ExtractionParameters, HeightParameters
from stixel_cli.stixels.free_space import find_free_space
from stixel_cli.stixels.free_space_parameters import (
    FreeSpaceParameters,
    OccupancyParameters,
    RoadParameters,
)

CONF = Path(__file__).parents[2] / "conf"


def shipped(schema, option):
    return TypeAdapter(schema).validate_json(
        json.dumps(yaml.safe_load((CONF / f"{option}.yaml").read_text()))
    )


@pytest.fixture(scope="module")
def data():
    folder = Path(os.environ.get("STIXEL_DATA", CONF.parent / "../shared/data"))
    if not (folder / "kitti2015").is_dir():
        pytest.skip(f"no real frames: STIXEL_DATA names no folder with kitti2015 ({folder})")
    return folder


def stixels_of(rig, left, right, road="rig"):
    return processed(rig, left, right, road)[1]


def processed(rig, left, right, road="rig"):
    """Free space and stixels of a pair of files."""
    grey = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in (left, right)]
    pairs = StereoPairs(0, *(ImageStack.from_images([image]) for image in grey))
    frames = range(1)
    disparities = sgm.match(pairs, shipped(StereoParameters, "stereo/sgm"), rig, frames)
    free_space = find_free_space(
        disparities,
        EgoMotion(np.zeros(1), np.array([[0.0, 0.0, np.pi / 2]])),
        rig,
        shipped(RoadParameters, f"road/{road}"),
        shipped(OccupancyParameters, "occupancy/polar"),
        shipped(FreeSpaceParameters, "free_space/default"),
        frames,
        None,
    )
    return free_space, extract_stixels(
        disparities,
        free_space,
        pairs,
        rig,
        shipped(HeightParameters, "height/default"),
        shipped(ExtractionParameters, "extraction/default"),
        frames,
    )


def errors_in_areas(stixels, u, v, disparity):
    """Stixel's disparity minus the median of the measured ones in its lower two thirds, px."""
    errors = []
    for left, right, top, base, d in zip(
        stixels.left, stixels.right, stixels.top, stixels.base, stixels.disparity, strict=True
    ):
        # The lowest rows see the road as well, and the upper end may overlap what is behind.
        rows = base - top + 1
        inside = (u >= left) & (u < right) & (v >= base - 0.7 * rows) & (v <= base - 0.1 * rows)
        if np.count_nonzero(inside) >= 4:
            errors.append(d - np.median(disparity[inside]))
    return np.array(errors)


@pytest.mark.parametrize("road", ["rig", "estimated"])
def test_stixels_agree_with_the_labelled_disparity(data, road):
    rig = Rig(1242, 375, None, 721.5377, 609.5593, 172.854, 0.5327254, 1.65, 0.0, None)
    folder = data / "kitti2015"
    stixels = stixels_of(rig, folder / "000000_10_left.png", folder / "000000_10_right.png", road)
    truth = cv2.imread(str(folder / "000000_10_disp_occ.png"), cv2.IMREAD_UNCHANGED) / 256.0
    v, u = np.nonzero(truth)
    errors = errors_in_areas(stixels, u, v, truth[v, u])
    print(f"\nlabelled: {summary(errors)}")
    assert len(errors) > 100
    assert np.median(np.abs(errors)) < 0.6
    assert np.mean(np.abs(errors) > 3) < 0.15


def object_rig(folder):
    """The rig of kitti_object, and its calibration matrices by name."""
    matrices = {}
    for line in (folder / "calib.txt").read_text().splitlines():
        name, _, numbers = line.partition(":")
        matrices[name] = np.array(numbers.split(), dtype=float)
    left, right = (matrices[name].reshape(3, 4) for name in ("P2", "P3"))
    focal = left[0, 0]
    rig = Rig(
        1242,
        375,
        None,
        focal,
        left[0, 2],
        left[1, 2],
        (left[0, 3] - right[0, 3]) / focal,
        1.65,
        0.0,
        None,
    )
    return rig, left, matrices


def test_dark_car_beside_the_camera_is_unknown_and_not_free(data):
    folder = data / "kitti_object"
    rig, _, _ = object_rig(folder)
    images = folder / "left.png", folder / "right.png"
    free_space, stixels = processed(rig, *images, road="estimated")
    unknown = free_space.unknown_row[0] >= 0
    # The car is in the last 400 columns, from the bottom of the image on; 80 % of its pixels have
    # no disparity. The road ahead is known.
    assert np.mean(unknown[-400:]) > 0.6
    assert np.mean(unknown[100:800]) < 0.02
    # What the right image does not show of the left border is unknown as well.
    assert unknown[:20].all()
    assert len(stixels.unknown_ego) > 1 and np.all(np.diff(stixels.unknown_ego.ravel()) > 0)


def test_stixels_agree_with_the_lidar(data):
    folder = data / "kitti_object"
    rig, left, matrices = object_rig(folder)
    stixels = stixels_of(rig, folder / "left.png", folder / "right.png")
    scan = np.fromfile(folder / "lidar.bin", dtype=np.float32).reshape(-1, 4)[:, :3]
    turn, to_camera = matrices["R0_rect"].reshape(3, 3), matrices["Tr_velo_to_cam"].reshape(3, 4)
    points = turn @ (to_camera[:, :3] @ scan.T + to_camera[:, 3:])
    points = points[:, points[2] > 2.0]
    u, v, w = left[:, :3] @ points + left[:, 3:]
    u, v = u / w, v / w
    errors = errors_in_areas(stixels, u, v, rig.focal * rig.baseline / w)
    print(f"\nlidar: {summary(errors)}")
    assert len(errors) > 100
    # The disparities themselves are 0.5 px off, up to 1 px at the image's left border.
    assert np.median(np.abs(errors)) < 0.8
    # A dark car beside the camera has no disparity: what stands behind it is seen instead.
    assert np.mean(np.abs(errors) > 3) < 0.3


def summary(errors):
    size = np.abs(errors)
    return (
        f"{len(size)} stixels, median {np.median(errors):+.2f} px, median size "
        f"{np.median(size):.2f} px, above 3 px {np.mean(size > 3):.2f}"
    )
