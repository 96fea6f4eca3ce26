"""Single pairs of images: their layouts, `stixel assess`, and errors against true disparities."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas
import pytest
from made_stixels import made_stixels
from made_street import poses_ahead, stereo_view, street_rig

from stixel_cli import compose, stixels_from_pair, sweep
from stixel_cli.calibration.road_pose import compared_rows, road_pose
from stixel_cli.cli.app import main
from stixel_cli.errors import UserError
from stixel_cli.export.export import calibration_text
from stixel_cli.live.pairs import stixels_from_disparity
from stixel_cli.recordings.find import find_recording, guess_layout
from stixel_cli.recordings.image_files import grey, read_disparity, read_image
from stixel_cli.recordings.kitti_tables import read_labels
from stixel_cli.recordings.parameters import KittiPair
from stixel_cli.rendering.images import encode_png
from stixel_cli.stixels.parameters import FreeSpaceParameters, RigRoad
from stixel_cli.stixels.road import pitch_factors, road_line
from stixel_cli.stixels.types import FreeSpace, Stixels
from stixel_cli.validation.pair_errors import (
    area_errors,
    called_free,
    compensated,
    found_columns,
    is_outlier,
    nearest_disparity,
    road_plane,
    true_obstacles,
)

RIG = street_rig()
OFFSET = 0.3
BOXES = [(-0.9, 0.9, 9.0, 1.5), (2.0, 3.8, 5.0, 1.5)]
ROAD = RigRoad(kind="rig")
FREE_SPACE = FreeSpaceParameters(0.3, 0.2, 0.03)
LABEL = "Car 0.00 0 0.0 100.0 50.0 200.0 100.0 1.5 1.8 4.0 0.0 1.6 11.0 -1.5708"


@pytest.fixture(scope="module")
def images():
    """Left, right and disparity of a street with two boxes; the images are `OFFSET` px off."""
    rig = replace(RIG, disparity_error=(OFFSET, 0.0, 0.0))
    return stereo_view(rig, poses_ahead(1, 1.0)[0], BOXES)


@pytest.fixture(scope="module")
def pair(images, tmp_path_factory):
    """Folder of the pair in the layout of the stereo benchmark of 2012."""
    folder = tmp_path_factory.mktemp("pair")
    left, right, disparity = images
    written = {"image_0": left, "image_1": right}
    written["disp_occ"] = np.rint(256.0 * disparity).astype(np.uint16)
    for name, image in written.items():
        (folder / name).mkdir()
        (folder / name / "000007_10.png").write_bytes(encode_png(image))
    (folder / "calib").mkdir()
    (folder / "calib" / "000007.txt").write_text(calibration_text(RIG))
    return folder


def files_of(pair):
    """Left and right image, true disparities and calibration."""
    images = [f"{pair}/{name}/000007_10.png" for name in ("image_0", "image_1", "disp_occ")]
    return [*images, f"{pair}/calib/000007.txt"]


def source(folder, sequence="7"):
    given = {"folder": str(folder), "frames": None, "sample_time": 0.1}
    return KittiPair(kind="kitti_pair", sequence=sequence, **given)


def test_the_pair_of_a_benchmark_is_found_and_needs_no_poses(pair):
    assert guess_layout(pair) == "kitti_pair"
    found = find_recording(source(pair))
    assert found.left[0].name == "000007_10.png" and found.count == 1
    assert (found.width, found.height) == (RIG.width, RIG.height)
    assert found.true_disparities[0].parent.name == "disp_occ" and found.label_files == ()
    with pytest.raises(UserError, match=r"source\.sequence: .* has no image_2/000008\.png"):
        find_recording(source(pair, "000008"))
    more = ("road_user=car", "start.range=[5,20]")
    made = compose([f"source.folder={pair}", "source.sequence=000007", *more])
    assert made.choices["source"] == "kitti_pair" and made.choices["ego"] == "parked"
    assert made.configuration.rig.focal == pytest.approx(RIG.focal)


def test_a_pair_without_a_calibration_is_refused(pair, tmp_path):
    for name in ("image_0", "image_1"):
        (tmp_path / name).symlink_to(pair / name)
    with pytest.raises(UserError, match=r"calib: 000007\.txt is missing"):
        find_recording(source(tmp_path))


def test_the_object_benchmark_has_labels_without_tracks(pair, tmp_path):
    for camera, name in (("image_2", "image_0"), ("image_3", "image_1")):
        (tmp_path / camera).mkdir()
        data = (pair / name / "000007_10.png").read_bytes()
        (tmp_path / camera / "000003.png").write_bytes(data)
    for name, text in (("calib", calibration_text(RIG)), ("label_2", f"{LABEL}\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "000003.txt").write_text(text)
    found = find_recording(source(tmp_path, "3"))
    assert found.true_disparities == ()
    labels = read_labels(*found.label_files)
    assert list(labels) == [0] and labels[0].kind == "Car" and labels[0].frames.tolist() == [0]
    np.testing.assert_array_equal(labels[0].sizes, [[1.5, 1.8, 4.0]])


def test_true_disparities_are_read_and_a_wrong_file_is_refused(pair, images, tmp_path):
    found = read_disparity(pair / "disp_occ" / "000007_10.png")
    np.testing.assert_allclose(found, images[2], atol=1.0 / 256.0)
    with pytest.raises(UserError, match="not a grey PNG of 16 bits"):
        read_disparity(pair / "image_0" / "000007_10.png")
    cut = tmp_path / "cut.png"
    cut.write_bytes((pair / "disp_occ" / "000007_10.png").read_bytes()[:500])
    with pytest.raises(UserError, match="damaged or incomplete"):
        read_disparity(cut)


def test_an_empty_name_or_a_jpeg_is_no_file_of_disparities(pair, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    left, right, _, calibration = files_of(pair)
    named = ("source=pair", f"source.left={left}", f"source.right={right}")
    named += (f"source.calibration={calibration}",)
    with pytest.raises(UserError, match=r"\.: "):
        compose([*named, "source.disparity=''"])
    (tmp_path / "true.jpg").write_bytes(b"\xff\xd8\xff")
    with pytest.raises(UserError, match=r"true\.jpg: a damaged or incomplete JPEG"):
        compose([*named, f"source.disparity={tmp_path}/true.jpg"])


def test_assess_measures_errors_and_obstacles(pair, tmp_path, monkeypatch, capsys, told):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "labels.txt").write_text(f"{LABEL}\n")
    left, right, truth, calibration = files_of(pair)
    given = ["assess", left, right, "--calib", calibration]
    given += ["--disparity", truth, "--labels", "labels.txt", "executor=threads"]
    found = json.loads(told(*given, "--json"))
    values = found["values"]
    # Measured although the results are in the cache, or were compiled by this run.
    assert all(0.0 < found["seconds"][name] < 60.0 for name in ("match", "free_space", "stixels"))
    assert values["square_median_px"] == pytest.approx(OFFSET, abs=0.1)
    assert values["square_beyond_1px_share"] < 0.1 and values["square_compared"] > 30
    # The box 5 m ahead is seen from u0 + 2 f / 5 to the image's border.
    assert values["near_columns"] == pytest.approx(RIG.width - RIG.u0 - 0.4 * RIG.focal, abs=2)
    assert values["near_called_free"] == 0
    assert values["stixel_share"] > 0.9
    assert values["row_difference_px"] < 0.3
    wrong, mends = "rig.camera_height=1.2", "set rig.camera_height=1."
    assert main([*given, wrong]) == 0
    said, noted = capsys.readouterr()
    assert mends in noted
    page = (tmp_path / "assess.html").read_text()
    assert "0 of 5" in said and said.splitlines()[-1] == "assess.html"
    assert page.count("data:image/png") == 4 and "of the columns have a stixel" in page
    # A pair shows no motion.
    found = [f"source.folder={pair}", "source.sequence=000007", "executor=threads"]
    assert main(["assess", "--calibrate", *found, wrong]) == 0
    printed, noted = capsys.readouterr()
    assert mends in noted and "pairs of images are needed" in printed


def test_rows_that_are_apart_are_said_once_or_refused(pair, images, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    shutil.copytree(pair, "apart")
    given = ["source.folder=apart", "source.sequence=7", "road_user=car", "start.range=[5,20]"]
    given += ["executor=threads", "pictures.frames=[]"]
    for rows, *more in ((1, "--name", "near"), (6, "source.check_rectification=false"), (6,)):
        moved = encode_png(np.roll(images[1], rows, axis=0))
        Path("apart/image_1/000007_10.png").write_bytes(moved)
        compared_rows.cache_clear()
        road_pose.cache_clear()
        code = main(["run", *given, *more])
        said = capsys.readouterr().err
        assert said.count("the rows of the two images differ by") == 1
        assert code == (0 if more else 2)
    assert said.startswith("stixel: source: ") and said.count("\n") == 1
    assert "set source.check_rectification=false" in said
    with pytest.raises(UserError, match=r"check_rectification"):
        sweep(*given, "stereo.block_size=3,5", results="sweeps")
    manifest = json.loads(Path("results/near/manifest.json").read_text())
    assert manifest["row_difference_px"] == pytest.approx(1.0, abs=0.1)
    assert "rows of the images " in Path("results/near/index.html").read_text()
    assert main(["ls", "results/near"]) == 0
    assert "row_difference_px" in capsys.readouterr().out
    # Without a height, the road is not to blame.
    with pytest.raises(UserError, match=r"^source: the rows"):
        files = ("apart/image_0/000007_10.png", "apart/image_1/000007_10.png")
        Path("rig.yaml").write_text("{fx: 260, fy: 260, cx: 158, cy: 56, baseline: 0.5}")
        named = zip(("left", "right", "calibration"), (*files, "rig.yaml"), strict=True)
        compose([*given[2:], "source=pair", *(f"source.{key}={file}" for key, file in named)])


def test_stixels_from_a_file_have_the_scores_of_ours(pair, tmp_path, monkeypatch, told):
    monkeypatch.chdir(tmp_path)
    left, right, truth, calibration = files_of(pair)
    images = [grey(read_image(Path(file))) for file in (left, right)]
    found = stixels_from_pair(*images, calibration)
    found.to_frame().to_csv("ours.csv", index=False)
    given = ["stixels", left, right, "--rig", calibration, "executor=threads"]
    assert main([*given, "--output", "written"]) == 0
    assert [file.name for file in sorted(Path("written").iterdir())] == ["k0000.png", "stixels.csv"]
    written = pandas.read_csv("written/stixels.csv").drop(columns="k")
    pandas.testing.assert_frame_equal(written, found.to_frame(), check_dtype=False)
    assert "written exists and is not overwritten" in told(*given, "--output", "written", code=2)
    given = ["assess", left, right, "--calib", calibration, "--disparity", truth]
    given += ["executor=threads", "--json"]
    ways = ([], ["--stixels", "ours.csv"])
    ours, theirs = (json.loads(told(*given, *more))["values"] for more in ways)
    assert theirs["stixels"] == len(found) and theirs["found_share"] > 0.9
    # A file does not state what is unknown.
    of_the_file = {name: value for name, value in theirs.items() if value is not None}
    unknown = {"unknown_share", "disparity_share", "row_difference_px"}
    assert ours.keys() - of_the_file.keys() == unknown
    near = {name: ours.pop(name) - theirs.pop(name) for name in ("near_called_free", "free_share")}
    assert near["near_called_free"] <= 0
    both = ours.keys() & of_the_file.keys()
    assert [ours[name] for name in both] == pytest.approx([of_the_file[name] for name in both])
    wide = found.to_frame().assign(right=RIG.width + 1)
    wide.to_csv("wide.csv", index=False)
    said = told(*given, "--stixels", "wide.csv", code=2)
    assert f"--stixels: reach over {RIG.width + 1} × " in said


def stixel_at(left, disparity, top, base):
    area = {"left": [left], "right": [left + 3], "top": [top], "base": [base]}
    depth = RIG.depth_from_disparity(disparity)
    return made_stixels(**area, disparity=[disparity], depth=[depth], height=[1.5])


def test_truth_behind_an_object_is_not_its_own():
    truth = np.full((RIG.height, RIG.width), np.nan)
    # 26 px a metre: from 20 to 100, seen through a window in the upper half only.
    stixel = stixel_at(60, 13.0, 60, 100)
    truth[65:70, 60:63] = 9.0
    assert len(area_errors(stixel, 0, truth, RIG).errors) == 0
    truth[80:93, 60:63] = 12.8
    found = area_errors(stixel, 0, truth, RIG)
    assert found.stixels.tolist() == [0]
    assert found.errors[0] == pytest.approx(0.2) and not found.square[0]


def test_an_outlier_is_beyond_both_limits_and_a_phantom_is_one_that_is_too_near():
    errors, truths = np.array([3.1, -3.1, 2.9, 3.1, 4.1]), np.array([10.0, 10.0, 10.0, 80.0, 80.0])
    assert is_outlier(errors, truths).tolist() == [True, True, False, False, True]
    truth = np.full((RIG.height, RIG.width), np.nan)
    truth[60:93, 60:63] = 12.8
    for disparity, outlier, phantom in ((13.0, 0, 0), (16.0, 1, 1), (9.0, 1, 0)):
        found = area_errors(stixel_at(60, disparity, 60, 100), 0, truth, RIG)
        assert found.truths.tolist() == [12.8] and found.stixels.tolist() == [0]
        assert found.outliers.sum() == outlier
        assert np.sum(found.outliers & (found.errors > 0)) == phantom


def test_a_column_is_found_if_one_of_its_stixels_is_no_outlier():
    obstacles = np.full(RIG.width, np.nan)
    obstacles[60:64] = RIG.depth_from_disparity(20.0)
    right, wrong = stixel_at(60, 19.0, 40, 90), stixel_at(60, 30.0, 40, 90)
    for stixels, columns in ((right, [60, 61, 62]), (wrong, [])):
        found = np.flatnonzero(found_columns(stixels, 0, obstacles, RIG))
        assert found.tolist() == columns
    pairs = zip([*vars(wrong).values()][2:], [*vars(right).values()][2:], strict=True)
    both = Stixels(0, np.array([0, 2]), *map(np.concatenate, pairs))
    assert found_columns(both, 0, obstacles, RIG).sum() == 3
    nearest = nearest_disparity(both, 0, RIG.width)
    assert np.nanmax(nearest) == np.nanmin(nearest) == 30.0 and np.isfinite(nearest).sum() == 3


@pytest.mark.parametrize("pitch", [0.0, 3.0])
def test_a_pitched_camera_adds_no_error(pitch):
    """A low wall at 8 m along the road: exact disparities give stixels without an error."""
    rig, depth = replace(RIG, pitch=pitch), 8.0
    line = road_line(rig.pitch_radians, rig.camera_height, rig)
    wall = rig.disparity_from_depth(depth) / pitch_factors(line, rig)
    road = line[0] * np.arange(rig.height) + line[1]
    # Above the wall's top, 0.8 m above the road, nothing is seen.
    wall[wall * (1.0 - 0.8 / rig.camera_height) > road] = 0.0
    truth = np.repeat(np.maximum(wall, road)[:, None], rig.width, axis=1)
    found = stixels_from_disparity(truth, rig)
    errors = area_errors(found.stixels, 0, compensated(truth, rig, ROAD), rig).errors
    assert len(errors) > 10
    # Disparities are whole sixteenths of a pixel.
    assert np.median(errors) == pytest.approx(0.0, abs=0.03)
    raw = area_errors(found.stixels, 0, truth, rig).errors
    assert (np.median(raw) > 0.05) == (pitch > 0.0)
    obstacles = true_obstacles(truth, rig, ROAD, FREE_SPACE)
    np.testing.assert_allclose(obstacles, depth, rtol=1e-3)


def test_the_road_of_the_truth_may_roll():
    v, u = np.mgrid[: RIG.height, : RIG.width].astype(float)
    flat = RIG.baseline * (v - RIG.v0) / RIG.camera_height
    rolled = np.where(v > 65, flat + 0.01 * (u - RIG.u0), np.nan)
    line = np.array([1.0, -RIG.v0]) * RIG.baseline / RIG.camera_height
    plane = road_plane(rolled, line, RIG)
    np.testing.assert_allclose(plane[90:], rolled[90:], atol=0.01)
    assert np.isnan(true_obstacles(rolled, RIG, ROAD, FREE_SPACE)).all()


def test_an_obstacle_is_called_free_unless_it_is_found_or_its_place_is_unknown():
    obstacles = np.full(RIG.width, np.nan)
    obstacles[10:14] = 5.0
    found = np.full((1, RIG.width), RIG.disparity_from_depth(12.0), dtype=np.float32)
    found[0, 10] = RIG.disparity_from_depth(5.2)
    found[0, 11] = np.nan
    unknown = np.full((1, RIG.width), -1, dtype=np.int32)
    unknown[0, 12] = RIG.height - 1
    slope = RIG.baseline / RIG.camera_height
    road = np.array([[slope, -slope * RIG.v0]])
    free_space = FreeSpace(0, found, np.zeros((1, RIG.width), dtype=np.int32), road, unknown)
    columns = np.flatnonzero(called_free(free_space, 0, obstacles, RIG, 6.0))
    assert columns.tolist() == [11, 13]


@pytest.mark.parametrize("depth", [2.5, 3.0, 4.0])
def test_a_near_van_without_texture_is_unknown_and_not_free(depth):
    """Its bonnet has no match of its own, and a tree is seen through the windows above it."""
    van, tree = (-1.0, 0.9, depth, 1.1, True), (-0.5, 0.5, 15.0, 5.0)
    views = np.array(stereo_view(RIG, poses_ahead(1, 0.0)[0], [van, tree])[:2])
    noisy = views + np.random.default_rng(0).normal(0.0, 1.0, views.shape)
    found = stixels_from_pair(*np.clip(np.rint(noisy), 0, 255).astype(np.uint8), RIG)
    x = depth * (np.arange(RIG.width) - RIG.u0) / RIG.focal
    obstacles = np.where((x > van[0]) & (x < van[1]), depth, np.nan)
    assert not called_free(found.free_space, 0, obstacles, RIG, 6.0).any()
    assert found.unknown.mean() < 0.9
