"""Scans and truth from tables: what is read, and one line for each fault."""

from pathlib import Path

import numpy as np
import pytest

from stixel_cli.errors import UserError
from stixel_cli.measurements.file import read_scans
from stixel_cli.measurements.file_truth import differences, read_truth

SCANS = """k,t,x,y,var_xx,var_xy,var_yy
2,0.2,1.5,9,0.04,0.01,0.09
0,0.0,1,10,0.01,0,0.02
0,0.0,2,11,0.01,0,0.02
"""

EGO = "k,t,x,y,heading\n0,0,0,0,1.5\n1,0.1,0,1,1.6\n2,0.2,0,2,1.7\n3,0.3,0,3,1.8\n"

TRUTH = "k,x,y,heading,length,width\n0,1,10,3.1,4,2\n1,1,9,-3.1,4,2\n2,1,8,-3.0,4,2\n"


@pytest.fixture
def write(tmp_path):
    def written(text, name="scans.csv"):
        file = tmp_path / name
        if isinstance(text, bytes):
            file.write_bytes(text)
        else:
            file.write_text(text, encoding="utf-8")
        return str(file)

    return written


def test_rows_become_scans_in_the_order_of_k_and_an_absent_k_is_an_empty_scan(write):
    scans = read_scans(write(SCANS), None, 0.5)
    assert np.array_equal(scans.times, [0.0, 0.1, 0.2])
    assert np.array_equal(scans.offsets, [0, 2, 2, 3])
    assert scans.field_of_view is None
    view = read_scans(write(SCANS), None, 0.5, horizontal_fov=90.0).field_of_view
    assert (view.right, view.left) == pytest.approx((-np.pi / 4, np.pi / 4))
    assert np.array_equal(scans.points_world, [[1, 10], [2, 11], [1.5, 9]])
    assert np.array_equal(scans.covariances_world[2], [[0.04, 0.01], [0.01, 0.09]])
    assert np.array_equal(scans.sensor_poses_world, [[0, 0, 0.5 * np.pi]] * 3)


def test_the_first_scans_may_be_empty(write):
    scans = read_scans(write("k,t,x,y\n2,1.2,0,5\n4,1.4,0,5\n"), None, 0.5)
    np.testing.assert_allclose(scans.times, [1.0, 1.1, 1.2, 1.3, 1.4])
    assert np.array_equal(np.diff(scans.offsets), [0, 0, 1, 0, 1])
    assert np.array_equal(scans.covariances_world[0], 0.25 * np.eye(2))


def test_poses_of_the_sensor_give_times_and_the_number_of_scans(write):
    scans = read_scans(write(SCANS), write(EGO, "ego.csv"), 0.5)
    assert np.array_equal(scans.times, [0.0, 0.1, 0.2, 0.3])
    assert np.array_equal(np.diff(scans.offsets), [2, 0, 1, 0])
    assert np.array_equal(scans.sensor_poses_world[3], [0, 3, 1.8])
    empty = read_scans(write("k,t,x,y\n"), write(EGO, "ego.csv"), 0.5)
    assert (len(empty), len(empty.points_world)) == (4, 0)


def test_arrays_and_unknown_columns_are_read_as_a_csv_is(write, tmp_path):
    np.savez(tmp_path / "a.npz", k=[0, 1], t=[0.0, 0.5], x=[1, 2], y=[3.0, 4.0], power=[7, 8])
    scans = read_scans(str(tmp_path / "a.npz"), None, 1.0)
    same = read_scans(write("k,t,x,y,power\n0,0,1,3,7\n1,0.5,2,4,8\n"), None, 1.0)
    assert all(np.array_equal(value, vars(same)[name]) for name, value in vars(scans).items())


FAULTS = {
    "": "the column k is missing",
    "k,t,x\n0,0,1\n": "the column y is missing",
    "k;t;x;y\n0;0;1;1\n": "separated by commas",
    "k,t,x,x,y\n0,0,1,1,1\n": "two columns have one name",
    "k,t,x,y\n0,0,1\n": "line 2: 3 values, but the header has 4",
    "k,t,x,y\n0,0,1,1\n0,0,one,1\n": "line 3: x: 'one' is not a number",
    "k,t,x,y\n0,0,nan,1\n": "line 2: x: nan must be a finite number",
    "k,t,x,y\n0,0,1e300,1\n": "line 2: x: 1e+300 must be",
    "k,t,x,y\n0.5,0,1,1\n": "line 2: k must be a whole number",
    "k,t,x,y\n-1,0,1,1\n": "line 2: k must be a whole number",
    "k,t,x,y\n10000000,0,1,1\n": "line 2: k must be a whole number",
    "k,t,x,y\n0,0,1,1\n0,0.1,1,1\n": "line 3: t = 0.1 s, but scan k = 0 is at 0 s",
    "k,t,x,y\n0,1,1,1\n1,0.5,1,1\n": "t must increase with k",
    "k,t,x,y\n": "has no points: give the times of the scans, measurement.ego=FILE",
    "k,t,x,y\n5,0,1,1\n": "give measurement.ego=FILE",
    "k,t,x,y,var_xx\n0,0,1,1,1\n": "the column var_xy is missing: give all of var_xx",
    "k,t,x,y,var_xx,var_xy,var_yy\n0,0,1,1,1,2,1\n": "line 2: var_xx, var_xy, var_yy must be",
    'k,t,x,y\n0,0,"1,1\n': "not a table",
    b"k,t,x,y\n\xff,0,1,1\n": "not a text in UTF-8",
}


@pytest.mark.parametrize("text", FAULTS, ids=range(len(FAULTS)))
def test_a_fault_is_one_line_with_file_place_and_cause(text, write):
    with pytest.raises(UserError) as error:
        read_scans(write(text), None, 0.5)
    message = str(error.value)
    assert "scans.csv: " in message
    assert FAULTS[text] in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("ego", "fault"),
    [
        ("k,t,x,y,heading\n", "has no rows"),
        ("k,t,x,y,heading\n1,0,0,0,0\n", "each number from 0 to 0 once"),
        ("k,t,x,y,heading\n0,0,0,0,0\n1,0,0,0,0\n", "t must increase"),
        ("k,t,x,y,heading\n0,0,0,0,0\n1,1,0,0,0\n", "line 2: k = 2, but"),
        (EGO.replace("0.2,0,2", "0.25,0,2"), "line 2: t = 0.2 s, but scan k = 2 is at 0.25 s"),
    ],
)
def test_scans_and_poses_of_the_sensor_must_agree(ego, fault, write):
    with pytest.raises(UserError, match=fault):
        read_scans(write(SCANS), write(ego, "ego.csv"), 0.5)


@pytest.mark.parametrize("name", ["scans.txt", "absent.csv", "absent.npz"])
def test_a_file_that_is_no_table_or_missing(name, tmp_path):
    (tmp_path / "scans.txt").write_text("k,t,x,y\n")
    with pytest.raises(UserError, match=name):
        read_scans(str(tmp_path / name), None, 0.5)


def test_arrays_that_are_no_columns(tmp_path):
    for arrays, fault in (
        ({"k": [[0]], "t": [0], "x": [0], "y": [0]}, "must be a column"),
        ({"k": [0, 1], "t": [0], "x": [0], "y": [0]}, "equal lengths"),
    ):
        np.savez(tmp_path / "a.npz", **arrays)
        with pytest.raises(UserError, match=fault):
            read_scans(str(tmp_path / "a.npz"), None, 0.5)
    Path(tmp_path / "b.npz").write_bytes(b"no archive")
    with pytest.raises(UserError, match="not a file of numeric arrays"):
        read_scans(str(tmp_path / "b.npz"), None, 0.5)


@pytest.fixture
def scans(write):
    return read_scans(write(SCANS), write(EGO, "ego.csv"), 0.5)


def test_truth_has_poses_and_rates_where_they_are_known(scans, write):
    scenario = read_truth(scans, write(TRUTH, "truth.csv"))
    assert np.array_equal(scenario.known, [True, True, True, False])
    assert np.isnan(scenario.target_poses_world[3]).all()
    assert np.isnan(scenario.target_rates_world[3]).all()
    # The heading passes pi.
    turn = (2.0 * np.pi - 6.2) / 0.1
    np.testing.assert_allclose(scenario.target_rates_world[1], [0, -10, (turn + 1.0) / 2.0])
    np.testing.assert_allclose(np.ptp(scenario.contour_target(0), axis=0), [4.0, 2.0])
    assert scenario.star_convex and scenario.only_box
    assert np.array_equal(scenario.ego_poses_world, scans.sensor_poses_world)


def test_without_a_file_nothing_is_known(scans):
    scenario = read_truth(scans, None)
    assert not scenario.known.any()
    assert scenario.contour_target(0).shape == (0, 2)


def test_differences_are_exact_for_a_parabola_and_defined_for_few_poses():
    times = np.array([0.0, 0.1, 0.3, 0.4])
    poses = np.stack([times**2, -times, 3.0 + times], axis=1)
    expected = np.stack([2.0 * times, np.full(4, -1.0), np.ones(4)], axis=1)
    np.testing.assert_allclose(differences(poses, times), expected, atol=1e-12)
    np.testing.assert_allclose(differences(poses[:2], times[:2])[:, 1], -1.0)
    assert np.array_equal(differences(poses[:1], times[:1]), np.zeros((1, 3)))


def test_a_contour_is_read_from_arrays_and_made_counter_clockwise(scans, tmp_path):
    contour = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]])
    pose = {"k": [1], "x": [0.0], "y": [9.0], "heading": [0.0]}
    np.savez(tmp_path / "truth.npz", contour=contour, **pose)
    scenario = read_truth(scans, str(tmp_path / "truth.npz"))
    assert np.array_equal(scenario.contour_target(0), contour[::-1])
    assert not scenario.only_box
    assert np.array_equal(scenario.known, [False, True, False, False])
    for wrong in (contour[:2], contour[[0, 2, 1, 3]], contour * np.nan, contour[:, :1]):
        np.savez(tmp_path / "truth.npz", contour=wrong, **pose)
        with pytest.raises(UserError, match="contour"):
            read_truth(scans, str(tmp_path / "truth.npz"))


def test_each_pose_of_the_limbs_has_its_contour(scans, tmp_path):
    box = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    contours = np.stack([box, 0.5 * box])
    pose = {"k": [0, 2], "x": [0.0, 1.0], "y": [9.0, 9.0], "heading": [0.0, 0.0]}
    file = tmp_path / "truth.npz"
    np.savez(file, contour=contours, limb_pose=[0, 1], **pose)
    scenario = read_truth(scans, str(file))
    assert np.array_equal(scenario.contour_target(0), box)
    assert np.array_equal(scenario.contour_target(2), 0.5 * box)
    np.savez(file, contour=contours, **pose)
    with pytest.raises(UserError, match="column limb_pose is missing"):
        read_truth(scans, str(file))
    np.savez(file, contour=contours, limb_pose=[0, 2], **pose)
    with pytest.raises(UserError, match="row 1: limb_pose must be a whole number from 0 to 1"):
        read_truth(scans, str(file))


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("k,x,y,heading\n0,0,0,0\n", "length and width are missing"),
        ("k,x,y,heading,length\n0,0,0,0,4\n", "column width is missing"),
        ("k,x,y,heading,length,width\n", "has no rows"),
        ("k,x,y,heading,length,width\n9,0,0,0,4,2\n", "line 2: k = 9, but the last scan is 3"),
        ("k,x,y,heading,length,width\n0,0,0,0,4,2\n0,1,1,0,4,2\n", "give one target"),
        ("k,x,y,heading,length,width\n0,0,0,0,4,0\n", "width: must be > 0 m"),
        ("k,x,y,heading,length,width\n0,0,0,0,4,2\n1,0,0,0,5,2\n", "length: must be the same"),
    ],
)
def test_a_fault_of_the_truth(text, fault, scans, write):
    with pytest.raises(UserError, match=fault):
        read_truth(scans, write(text, "truth.csv"))
