"""Stixels of your own images in one call: those of `stixel run`, and clear errors."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from refusals import refused
from rendered_clip import assert_same, results_of_run

from stixel_cli import StixelStream, compose, stixels_from_disparity, stixels_from_pair
from stixel_cli.config.folders import real_image_parameters
from stixel_cli.errors import ArgumentError
from stixel_cli.live.pairs import check_rows, grey_pair
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.stereo.rectification import compare_rows

sys.path.append(str(Path(__file__).parents[1] / "recordings"))
from made_street import stereo_view, street_rig

NUMBERS = {"focal_length": 200.0, "baseline": 0.4, "camera_height": 1.5}


def files_of(clip, k=0):
    return *(clip / f"image_0{side}/0000/00000{k}.png" for side in (2, 3)), clip / "calib/0000.txt"


@pytest.fixture(scope="module")
def pair(clip):
    left, right, calibration = files_of(clip)
    return cv2.imread(str(left))[..., ::-1], cv2.imread(str(right))[..., ::-1], calibration


def composed(left, right, calibration):
    files = (f"source.left={left}", f"source.right={right}", f"source.calibration={calibration}")
    scene = ("road_user=car", "start.range=[1,80]", "executor=threads")
    return compose(["source=pair", *files, *scene])


def test_a_rendered_pair_has_the_parameters_and_stixels_of_stixel_run(clip, pair):
    configuration = composed(*files_of(clip)).configuration
    for group, parameters in vars(real_image_parameters()).items():
        assert parameters == getattr(configuration, group), group
    found = stixels_from_pair(*pair)
    free_space, stixels = results_of_run(composed(*files_of(clip)), "free_space", "stixels")
    assert len(found) > 20
    assert_same(found.stixels, stixels)
    assert_same(found.free_space, free_space)


def test_a_disparity_has_the_stixels_of_its_images(clip, pair):
    left, right, calibration = pair
    (disparities,) = results_of_run(composed(*files_of(clip)), "match")
    # In the arrays of others 0 is unknown, in ours far away.
    disparity = np.maximum(disparities.pixels(0), 0.01)
    found = stixels_from_disparity(disparity, calibration, images=(left, right))
    assert_same(found.stixels, stixels_from_pair(*pair).stixels)
    # Rounded to 1/16 px; beyond those that are searched, unknown.
    moved = np.where(np.isnan(disparity), 10_000.0, disparity + 0.03)
    alone = stixels_from_disparity(moved, calibration)
    assert_same(alone.free_space, found.free_space)
    assert alone.image is None and not np.array_equal(alone.depth, found.depth)


def test_the_frame_before_holds_the_free_space(clip, pair):
    first = stixels_from_pair(*pair)
    left, right = (cv2.imread(str(file)) for file in files_of(clip, 2)[:2])
    alone = stixels_from_pair(left, right, pair[2])
    after = stixels_from_pair(left, right, pair[2], previous=first)
    assert not np.array_equal(alone.free_space.disparity, after.free_space.disparity, True)


def test_a_rig_is_numbers_or_a_file_or_a_rig(pair, tmp_path):
    left, right, _ = pair
    expected = stixels_from_pair(*pair)
    rig = expected.rig
    numbers = {"focal_length": rig.focal, "principal_u": rig.u0, "principal_v": rig.v0}
    numbers |= {"baseline": rig.baseline, "camera_height": np.float64(rig.camera_height)}
    file = tmp_path / "rig.yaml"
    file.write_text("".join(f"{name}: {float(value)!r}\n" for name, value in numbers.items()))
    others = {"K": [[rig.focal, 0, rig.u0], [0, rig.focal, rig.v0], [0, 0, 1]]}
    others |= {"baseline": rig.baseline, "camera_height": rig.camera_height}
    for same in (numbers, others, file, str(file), rig):
        assert_same(stixels_from_pair(left, right, same).stixels, expected.stixels)
    file.write_text(file.read_text().replace("camera_height", "# camera_height"))
    seen = stixels_from_pair(left, right, file).rig
    # KITTI's height counts as stated; the clip was rendered with the default rig's.
    assert rig.camera_height == 1.65
    assert seen.camera_height == pytest.approx(1.2, abs=0.02)
    del numbers["camera_height"]
    assert stixels_from_pair(left, right, numbers).rig == seen
    noise = np.random.default_rng(0).integers(0, 256, left.shape, dtype=np.uint8)
    with pytest.raises(ArgumentError, match=r"^rig: camera_height: is required.* no road: "):
        stixels_from_pair(noise, noise[::-1].copy(), file)


@pytest.mark.parametrize("distance", [20.0, -8.0])
def test_principal_points_that_differ_are_no_depth(distance):
    rig = street_rig()
    apart = replace(rig, principal_u_right=rig.u0 + distance)
    pose, boxes = np.eye(4)[:3], [(-1.5, 1.0, 11.8, 1.5)]
    depths = []
    for one, stated in ((rig, rig), (apart, apart)):
        left, right, disparity = stereo_view(one, pose, boxes)
        tables = [stixels_from_pair(left, right, stated).to_frame()]
        # Disparities as they are measured between these images.
        disparity = disparity + stated.far_disparity
        tables.append(stixels_from_disparity(disparity, stated, images=(left, right)).to_frame())
        for table in tables if one is rig or distance < 0 else tables[:1]:
            ahead = table.query("left >= 130 and right <= 175 and depth < 30")
            depths.append(ahead["depth"].median())
    assert depths == pytest.approx([11.8] * len(depths), rel=0.02)
    if distance > 0:
        with pytest.raises(ArgumentError, match=r"^right: .* negative.*principal_u_right"):
            stixels_from_pair(left, right, rig)


@pytest.fixture(scope="module")
def street():
    """Left and right image, disparity and rig of a street with a box, exact."""
    rig = street_rig(width=640, height=256, focal_length=520, principal_u=316, principal_v=112)
    return *stereo_view(rig, np.eye(4)[:3], [(-1.5, 1.0, 11.8, 1.5)]), rig


@pytest.mark.parametrize(
    ("rows", "roll", "scale", "said"),
    [(1.0, 0.0, 1.0, "1.0 px"), (0.0, 0.3, 1.0, "roll 0.3°"), (0.0, 0.0, 1.02, "scale .(1.9|2.0)")],
)
def test_rows_that_are_a_little_apart_are_said(street, rows, roll, scale, said):
    left, right, _, rig = street
    assert check_rows(StereoPairs(1, (left,), (right,)), rig, True)  # A warning is an error here.
    with pytest.warns(UserWarning, match=said) as caught:
        stixels_from_pair(left, moved(right, rows, roll, scale), rig)
    assert len(caught) == 1 and "rectify them" in str(caught[0].message)


def test_rows_far_apart_and_exchanged_images_are_refused(street):
    left, right, _, rig = street
    for pair, said in (
        ((left, moved(right, 6.0)), "differ by 6.0 px"),
        ((left, moved(right, -3.0, 0.5)), "roll 0.5°"),
        ((right, left), "100% of the disparities are negative: exchange left and right"),
    ):
        with pytest.raises(ArgumentError, match=f"^right: .*{said}.*check_rectification=False"):
            stixels_from_pair(*pair, rig)
        with pytest.raises(ArgumentError, match=said):
            StixelStream(rig).step(*pair)
        with pytest.warns(UserWarning, match=said):
            stixels_from_pair(*pair, rig, check_rectification=False)
    # Said once, of the first pair that shows it.
    stream = StixelStream(rig, check_rectification=False)
    stream.step(np.zeros_like(left), np.zeros_like(left))
    with pytest.warns(UserWarning) as caught:
        for _ in range(2):
            stream.step(left, moved(right, 6.0))
    assert len(caught) == 1


def test_images_that_show_no_rows_are_not_judged():
    noise = np.random.default_rng(0).integers(0, 256, (2, 256, 640), dtype=np.uint8)
    for pair in (noise, np.zeros_like(noise), noise[:, :64, :64]):
        assert compare_rows(*np.ascontiguousarray(pair), 0.0) is None


@pytest.mark.parametrize("times", [0.5, 3.0])
def test_the_height_is_found_in_images_of_every_size(street, times):
    left, right, _, rig = street
    pair = [cv2.resize(i, None, fx=times, fy=times) for i in (left, right)]
    scaled = {"fx": times * rig.focal, "cx": times * rig.u0, "cy": times * rig.v0}
    found = stixels_from_pair(*pair, scaled | {"fy": times * rig.focal, "baseline": rig.baseline})
    assert found.rig.camera_height == pytest.approx(rig.camera_height, abs=0.05)


def test_images_of_every_kind_have_the_stixels_of_eight_bits(pair):
    left, right, calibration = pair
    wide = [np.where(image == image.max(), 255, image) for image in (left, right)]
    expected = stixels_from_pair(*wide, calibration).stixels
    alpha = np.full((*left.shape[:2], 1), 7, np.uint8)
    for same in (
        [np.dstack([image, alpha]) for image in wide],
        [257 * image.astype(np.uint16) for image in wide],
        [image.astype(np.float32) for image in wide],
        [image / 255.0 for image in wide],
    ):
        assert_same(stixels_from_pair(*same, calibration).stixels, expected)
    grey = [cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in wide]
    assert_same(stixels_from_pair(*(i[..., None] for i in grey), calibration).stixels, expected)
    # One scale: the darker image stays darker.
    pair = grey_pair(wide[0].astype(np.uint16) * 257, wide[1].astype(np.uint16) * 100)
    bright, darker = pair.left[0], pair.right[0]
    assert darker.max() == pytest.approx(int(bright.max()) * 100 / 257, abs=1)


def test_unknown_disparities_and_integers_are_taken_as_their_makers_mean_them(street):
    *_, disparity, rig = street
    nothing = np.random.default_rng(1).random(disparity.shape) < 0.3
    expected = stixels_from_disparity(np.where(nothing, np.nan, disparity), rig)
    for unknown in (0.0, -1.0, np.inf, -np.inf):
        found = stixels_from_disparity(np.where(nothing, unknown, disparity), rig)
        assert_same(found.stixels, expected.stixels)
    for kind, unit in ((np.int16, 16), (np.uint16, 256)):
        rounded = np.where(nothing, 0, np.rint(unit * disparity)).astype(kind)
        known = np.where(nothing, np.nan, rounded / unit)
        expected = stixels_from_disparity(known, rig).stixels
        with pytest.warns(UserWarning, match=f"in units of 1/{unit} px"):
            assert_same(stixels_from_disparity(rounded, rig).stixels, expected)
        assert_same(stixels_from_disparity(rounded, rig, scale=1 / unit).stixels, expected)
    tenths = stixels_from_disparity(10.0 * np.where(nothing, 0, disparity), rig, scale=0.1)
    assert len(tenths) == len(stixels_from_disparity(np.where(nothing, 0, disparity), rig))
    with pytest.raises(ArgumentError, match=r"^scale: must be > 0"):
        stixels_from_disparity(disparity, rig, scale=-1.0)


def moved(image, rows=0.0, roll=0.0, scale=1.0):
    """The image rolled, scaled and moved down, as by a right camera that is not rectified."""
    height, width = image.shape
    turn = cv2.getRotationMatrix2D((width / 2, height / 2), -roll, scale)
    turn[1, 2] += rows
    border = cv2.BORDER_REPLICATE
    return cv2.warpAffine(image, turn, (width, height), flags=cv2.INTER_CUBIC, borderMode=border)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"left": np.zeros((160, 240), int)}, "left: must be uint8, uint16 or float, got int64"),
        ({"left": np.full((160, 240), 300.0)}, "left: must have values in .*255"),
        ({"left": np.zeros((160, 240, 5), np.uint8)}, "left: must be .*, got \\(160, 240, 5\\)"),
        ({"left": np.zeros(9, np.uint8)}, "left: must be .*, got \\(9,\\)"),
        ({"right": np.zeros((160, 241), np.uint8)}, "right: must be \\(160, 240\\) px, as left"),
        ({"rig": {"focal_length": 200.0}}, "rig: baseline: "),
        ({"rig": NUMBERS | {"baseline": -0.4}}, "rig: baseline: .*, got -0.4"),
        ({"rig": NUMBERS | {"tx": 3}}, "rig: tx: is unknown; did you mean baseline"),
        ({"rig": NUMBERS | {"fx": 3}}, "rig: a number is given twice.*: focal_length"),
        ({"rig": NUMBERS | {"fy": 0.0}}, "rig: focal_length_v: must be > 0, got 0"),
        ({"rig": {"K": [1, 2], "baseline": 0.4}}, "rig: K: must be a camera matrix of 3 × 3"),
        ({"rig": NUMBERS | {"principal_u_right": 400}}, "rig: principal_u_right: must be 0 to 239"),
        ({"rig": NUMBERS | {"horizontal_fov": 60.0}}, "rig: focal_length: set either"),
        ({"rig": NUMBERS | {"principal_u": 400.0}}, "rig: principal_u: must be 0 to 239"),
        ({"rig": NUMBERS | {"width": 640}}, "rig: is of 640 × 160 px, but the image has 240 × 160"),
        ({"rig": NUMBERS | {"baseline": 5}}, "rig: stereo.nearest: "),
        ({"rig": "no.yaml"}, "rig: .*no.yaml is missing"),
        ({"rig": 3}, "rig: "),
    ],
)
def test_a_wrong_argument_is_named(change, message):
    arguments = dict.fromkeys(("left", "right"), np.zeros((160, 240), np.uint8)) | {"rig": NUMBERS}
    with refused(match=f"^{message}", error=ArgumentError):
        stixels_from_pair(**arguments | change)


@pytest.mark.parametrize(
    ("disparity", "images", "message"),
    [
        (np.zeros((160, 240), int), None, "disparity: must be float, int16 or uint16 "),
        (np.zeros((160, 240)), (np.zeros((160, 240), np.uint8),), "images: .*, got 1"),
        (np.zeros((160, 240)), [np.zeros((80, 240), np.uint8)] * 2, "images: must be .*\\(80"),
    ],
)
def test_a_wrong_disparity_is_named(disparity, images, message):
    with pytest.raises(ArgumentError, match=f"^{message}"):
        stixels_from_disparity(disparity, NUMBERS, images=images)


def test_an_image_without_texture_has_no_stixels():
    found = stixels_from_pair(*np.zeros((2, 160, 240), np.uint8), NUMBERS)
    assert len(found) == 0 and found.unknown.all()
    assert len(found.to_frame()) == len(found.to_scan().points_world) == 0
    assert found.draw().shape == (160, 240, 3) and "0 stixels" in repr(found)


def test_the_result_is_arrays_a_table_a_scan_a_file_and_a_picture(pair):
    found = stixels_from_pair(*pair)
    n = len(found)
    assert found.columns.shape == found.rows.shape == found.points.shape == (n, 2)
    assert found.depth.shape == found.variance.shape == found.height.shape == (n,)
    np.testing.assert_array_equal(found.points[:, 1], found.depth)
    table = found.to_frame()
    np.testing.assert_array_equal(table[["left", "right"]], found.columns)
    np.testing.assert_array_equal(table["var_yy"], found.variance)
    scan = found.to_scan(pose=np.array([5.0, 0.0, np.pi / 2]), time=2.0)
    inside = found.stixels.inside(real_image_parameters().measurement.gates)
    np.testing.assert_allclose(scan.points_world, found.points[inside] + [5.0, 0.0])
    assert scan.times.tolist() == [2.0]
    grey = cv2.cvtColor(pair[0], cv2.COLOR_RGB2GRAY)
    picture = found.draw()
    changed = np.flatnonzero((picture != grey[..., None]).any(axis=(0, 2)))
    assert {*changed} == {u for left, right in found.columns for u in range(left, right)}
    assert found._repr_png_().startswith(b"\x89PNG") and f"<{n} stixels" in repr(found)


def test_a_stx1_file_has_every_stixel(pair):
    library = pytest.importorskip("stixel")
    found = stixels_from_pair(*pair)
    world = library.StixelWorld.FromString(found.to_stx1())
    assert [one.u for one in world.stixel] == found.columns[:, 0].tolist()
    assert world.context.calibration.width == 240 and world.image


def test_neither_import_nor_call_needs_hydra_open3d_or_the_engine():
    program = f"""
import sys, numpy as np
from stixel_cli import stixels_from_pair
heavy = {{"numba", "cv2", "scipy", "pandas", "pydantic", "matplotlib", "sklearn"}}
assert not heavy & set(sys.modules), heavy & set(sys.modules)
image = np.random.default_rng(0).integers(0, 255, (160, 240), dtype=np.uint8)
stixels_from_pair(image, image, {NUMBERS}).to_scan()
foreign = [m for m in ("hydra", "omegaconf", "open3d", "stixel_cli.engine") if m in sys.modules]
sys.exit(foreign or 0)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
