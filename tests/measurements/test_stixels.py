"""Scans from stixels, and stixels in files of other tools and of our own."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from made_stixels import made_stixels
from real_data import real_data
from refusals import refused

from stixel_cli.cli.app import main
from stixel_cli.config.compose import compose
from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import rotation
from stixel_cli.images import encode_png
from stixel_cli.measurements.scans import FieldOfView
from stixel_cli.measurements.stixel_file import read_stixels
from stixel_cli.measurements.stixels import StixelsParameters, gather_scans
from stixel_cli.scene.scenario import EgoMotion

UNDISTURBED = {"dropout": None, "clutter_rate": 0.0}
HEIGHTS = {"height_min": 0.3, "height_max": 2.5}
GATES = StixelsParameters(kind="stixels", range_max=40.0, **UNDISTURBED, **HEIGHTS)
RIG = compose([]).configuration.rig


def stixels(first, per_frame, points, heights, covariances=None):
    if covariances is None:
        covariances = np.tile(np.diag([0.01, 0.25]), (len(points), 1, 1))
    columns = {"left": [0] * len(points), "right": [7] * len(points), "height": heights}
    columns |= {"points_ego": points, "covariances_ego": covariances}
    return made_stixels(first, np.cumsum([0, *per_frame]), **columns)


def ego(poses):
    return EgoMotion(0.1 * np.arange(len(poses)), np.array(poses, float))


def test_points_and_covariances_are_in_the_world_frame():
    poses = [[0, 0, np.pi / 2], [3, 4, np.pi / 2 + 0.4], [0, 0, 0.0]]
    first = stixels(0, [1, 2], [[1, 10], [2, 20], [0, 5]], [1, 1, 1])
    chunks = [first, stixels(2, [1], [[0, 5]], [1])]
    scans = gather_scans(iter(chunks), ego(poses), GATES, RIG)
    assert scans.offsets.tolist() == [0, 1, 3, 4]
    turn = rotation(0.4)
    expected = [[1, 10], [3, 4] + turn @ [2, 20], [3, 4] + turn @ [0, 5], [5, 0]]
    np.testing.assert_allclose(scans.points_world, expected, atol=1e-12)
    np.testing.assert_allclose(scans.covariances_world[1], turn @ np.diag([0.01, 0.25]) @ turn.T)
    # Ahead is now along x.
    np.testing.assert_allclose(scans.covariances_world[3], np.diag([0.25, 0.01]), atol=1e-12)


def test_scans_share_the_error_that_the_rig_states():
    """1 px at the right border and none elsewhere: a far point there moves by z² / (f B)."""
    right = (RIG.width - 1 - RIG.u0) / RIG.focal
    points = [[20.0 * right, 20.0], [0.0, 20.0]]
    moved = 400.0 / (RIG.focal * RIG.baseline)
    for std, expected in ((1.0, [[moved], [0.0]]), (0.0, np.zeros((2, 0)))):
        rig = dataclasses.replace(RIG, disparity_error_std=(0.0, 0.0, std))
        chunks = [stixels(0, [2], points, [1, 1])]
        scans = gather_scans(chunks, ego([[0, 0, np.pi / 2]]), GATES, rig)
        found = scans.shared_directions(0, scans.points_world)
        np.testing.assert_allclose(np.abs(found[:, 1]), expected, rtol=1e-6, atol=1e-9)


def test_gates_use_only_height_and_range_and_drop_what_has_no_finite_position():
    points = [[0, 10]] * 4 + [[0, 0.9], [0, 1], [0, 40], [30, 30]]
    heights = [0.29, 0.3, 2.5, 2.51, 1, 1, 1, 1]
    chunks = [stixels(0, [8, 0], points, heights)]
    scans = gather_scans(chunks, ego([[0, 0, np.pi / 2]] * 2), GATES, RIG)
    assert scans.field_of_view == FieldOfView(*RIG.field_of_view, RIG.baseline)
    np.testing.assert_allclose(scans.points_world, [[0, 10], [0, 10], [0, 1], [0, 40]])
    assert scans.offsets.tolist() == [0, 4, 4]
    covariances = np.tile(np.eye(2), (3, 1, 1))
    covariances[1, 0, 0] = np.inf
    chunk = stixels(0, [3], [[0, 10], [0, 11], [np.nan, 12]], [1, 1, 1], covariances)
    scans = gather_scans([chunk], ego([[0, 0, np.pi / 2]]), GATES, RIG)
    np.testing.assert_allclose(scans.points_world, [[0, 10]])


@pytest.mark.parametrize("firsts", [(0,), (0, 2), (0, 1, 2)])
def test_frames_must_match_the_ego_motion(firsts):
    chunks = [stixels(first, [1], [[0, 10]], [1]) for first in firsts]
    with pytest.raises(ValueError, match="frame"):
        gather_scans(chunks, ego([[0, 0, np.pi / 2]] * 2), GATES, RIG)


OWN = "left,right,top,base,disparity,depth\n"


def written(folder, text, name="stixels.csv"):
    (folder / name).write_bytes(text.encode() if isinstance(text, str) else text)
    return folder / name


def test_tables_of_ours_and_of_theirs_are_read(tmp_path):
    read = read_stixels(written(tmp_path, OWN + "6,9,10,20,12.5,8\n0,3,11,21,12,9\n"))
    stixels = read.stixels
    assert stixels.left.tolist() == [0, 6] and stixels.right.tolist() == [3, 9]
    assert stixels.base.tolist() == [21, 20] and stixels.disparity.tolist() == [12.0, 12.5]
    assert stixels.depth.tolist() == [9.0, 8.0] and stixels.offsets.tolist() == [0, 2]
    assert read.image.shape == (22, 9, 3) and not read.has_size
    text = "img,u,vT,vB,d,label\na.png,16,10,20,7.5,1\na.png,0,8,16,9.5,1\na.png,8,8,16,9.5,1\n"
    stixels = read_stixels(written(tmp_path, text)).stixels
    assert stixels.left.tolist() == [0, 8, 16] and stixels.right.tolist() == [8, 16, 24]
    assert stixels.base.tolist() == [15, 15, 19] and np.isnan(stixels.disparity).all()


def test_stx1_has_widths_and_the_image(tmp_path):
    library = pytest.importorskip("stixel")
    world = library.StixelWorld()
    world.image = encode_png(np.full((40, 60), 7, np.uint8))
    world.stixel.add(u=5, vT=10, vB=20, d=7.5, width=4)
    read = read_stixels(written(tmp_path, world.SerializeToString(), "one.stx1"))
    assert read.has_size and read.image.shape == (40, 60, 3) and (read.image == 7).all()
    assert (read.stixels.right[0], read.stixels.base[0]) == (9, 19)
    world.stixel.add(u=58, vT=10, vB=20, d=7.5, width=4)
    with pytest.raises(UserError, match=r"one\.stx1: row 1: its columns are not in 0 to 60"):
        read_stixels(written(tmp_path, world.SerializeToString(), "one.stx1"))
    with pytest.raises(UserError, match=r"not a \.stx1 file"):
        read_stixels(written(tmp_path, b"\xff\xff no protobuf", "one.stx1"))


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("a,b\n1,2\n", "must be .stx1, or have the columns left, "),
        ("u,vT,vB\n1,2,3\n", "the column d is missing"),
        (OWN + "3,3,1,2,9,9\n", "line 2: its columns are not in"),
        (OWN + "0,3,1,2,9,9\n0,3,5,4,9,9\n", "line 3: its rows are not in"),
        (OWN + "0,9000,1,2,9,9\n", "line 2: its columns are not in 0 to 4096"),
        (OWN + "0,3,1,2,9,-9\n", "line 2: its depth is not in"),
        (OWN + "0,3,1,2,0,9\n", "line 2: its disparity is not > 0"),
        (OWN + "0,3,1,2,nan,9\n", "must be a finite number"),
        (OWN + "0,3,1,x,9,9\n", "base: 'x' is not a number"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(text, fault, tmp_path):
    with refused(fault):
        read_stixels(written(tmp_path, text))


def test_without_truth_the_page_has_a_picture_and_names_what_is_missing(
    tmp_path, monkeypatch, capsys, told
):
    monkeypatch.chdir(tmp_path)
    file = written(tmp_path, OWN + "0,3,10,20,12.5,8\n6,12,11,21,12,9\n")
    said = told("assess", "--stixels", file)
    assert "75.0 % of the columns have a stixel." in said and "--disparity" in said
    page = Path("assess.html").read_text()
    assert page.count("data:image/png") == 1 and "<h2>Time</h2>" not in page
    assert main(["assess"]) == 2 and "--stixels FILE" in capsys.readouterr().err


@pytest.mark.parametrize(("suffix", "count"), [("stx1", 1022), ("csv", 624)])
def test_files_of_another_tool_are_read(suffix, count):
    if suffix == "stx1":
        pytest.importorskip("stixel")
    (file,) = real_data("stixel_formats").glob(f"*.{suffix}")
    read = read_stixels(file)
    assert len(read.stixels.left) == count
    assert np.all(read.stixels.right - read.stixels.left == 8)
