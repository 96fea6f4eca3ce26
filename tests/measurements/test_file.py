"""Scans and truth from tables and from the examples that write them: what is read, and faults."""

import gzip
import json
import os
import pickle
import runpy
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from refusals import refused

from stixel_cli.config.compose import compose
from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import rectangle
from stixel_cli.measurements.file import read_scans
from stixel_cli.measurements.file_truth import differences, heading_note, read_truth
from stixel_cli.tracking.motion import transition
from stixel_cli.tracking.several import start_from_scans

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
        file.write_bytes(text.encode() if isinstance(text, str) else text)
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


def test_arrays_are_read_as_a_csv_is_and_refused_if_they_are_no_columns(write, tmp_path):
    np.savez(tmp_path / "a.npz", k=[0, 1], t=[0.0, 0.5], x=[1, 2], y=[3.0, 4.0], power=[7, 8])
    scans = read_scans(str(tmp_path / "a.npz"), None, 1.0)
    same = read_scans(write("k,t,x,y,power\n0,0,1,3,7\n1,0.5,2,4,8\n"), None, 1.0)
    assert all(np.array_equal(value, vars(same)[name]) for name, value in vars(scans).items())
    row = {"t": [0], "x": [0], "y": [0]}
    for k, fault in (([[0]], "must be a column"), ([0, 1], "equal lengths")):
        np.savez(tmp_path / "a.npz", k=k, **row)
        with pytest.raises(UserError, match=fault):
            read_scans(str(tmp_path / "a.npz"), None, 0.5)
    with pytest.raises(UserError, match="not a file of numeric arrays"):
        read_scans(write(b"no archive", "b.npz"), None, 0.5)


def same_scans(found, expected):
    """Whether both are the same scans, but for the time at which they begin."""
    names = vars(expected).keys() - {"epoch"}
    return all(np.array_equal(vars(found)[name], vars(expected)[name]) for name in names)


@pytest.mark.parametrize(
    ("separator", "comma"), [(";", "."), (";", ","), ("\t", ".")], ids=["semicolon", "comma", "tab"]
)
def test_tabs_semicolons_and_decimal_commas_are_read_as_commas_and_points(separator, comma, write):
    other = SCANS.replace(",", separator).replace(".", comma)
    expected = read_scans(write(SCANS), None, 0.5)
    for same in (other, "\ufeff" + SCANS + "\n\n"):
        assert same_scans(read_scans(write(same), None, 0.5), expected)


def test_without_k_the_rows_of_one_time_are_a_scan(write):
    points = "t,x,y\n0.2,1.5,9\n0.0,1,10\n0.0,2,11\n"
    scans = read_scans(write(points), None, 0.5)
    assert np.array_equal(scans.times, [0.0, 0.2])
    assert np.array_equal(scans.offsets, [0, 2, 3])
    assert np.array_equal(scans.points_world, [[1, 10], [2, 11], [1.5, 9]])
    poses = "t,x,y,heading\n0.1,0,1,1.6\n0.2004,0,2,1.7\n0,0,0,1.5\n"
    scans = read_scans(write(points), write(poses, "ego.csv"), 0.5)
    assert np.array_equal(scans.offsets, [0, 2, 2, 3])
    assert np.array_equal(scans.sensor_poses_world[:, 2], [1.5, 1.6, 1.7])
    truth = "t,x,y,heading,length,width\n0.2,1,9,0,4,2\n"
    assert np.array_equal(read_truth(scans, write(truth, "truth.csv")).known, [False, False, True])
    with pytest.raises(UserError, match=r"line 2: t = 0\.15 s, but scan k = \d is at"):
        read_truth(scans, write(truth.replace("0.2,1", "0.15,1"), "truth.csv"))
    with pytest.raises(UserError, match=r"the column k \(or t\) is missing"):
        read_truth(scans, write("x,y,heading\n1,9,0\n", "truth.csv"))


def test_a_row_without_x_and_y_is_a_scan_without_a_point_and_counted_once(write):
    notes = []
    text = "k,t,x,y,var_xx,var_xy,var_yy\n0,0,1,2,1,0,1\n1,0.3,,,,,\n2,0.4,nan,nan,1,0,1\n"
    text += "2,0.4,3,4,1,0,1\n"
    scans = read_scans(write(text), None, 0.5, note=notes.append)
    assert np.array_equal(scans.times, [0.0, 0.3, 0.4])
    assert np.array_equal(scans.points_world, [[1, 2], [3, 4]])
    assert np.array_equal(scans.offsets, [0, 1, 1, 2])
    (note,) = notes
    assert "scans.csv: 2 of 4 rows dropped" in note
    for half in (",5,", "5,,"):
        with pytest.raises(UserError, match=r"line 3: .: nan must be a finite number"):
            read_scans(write(text.replace("0.3,,,", f"0.3,{half}")), None, 0.5)


FIRST = 1_584_532_800_123_456_789
"""A time in ns since 1970, which float64 does not hold."""


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
@pytest.mark.parametrize(
    ("unit", "per_second"), [("s", 1), ("ms", 10**3), ("us", 10**6), ("ns", 10**9)]
)
def test_times_since_1970_are_relative_to_the_first_scan(unit, per_second, suffix, tmp_path):
    first = FIRST // (10**9 // per_second)
    steps = [0, 7, 123_456]
    notes, rows = [], {"t": [first + step for step in steps], "x": [1, 2, 3], "y": [4, 5, 6]}
    file = tmp_path / f"scans{suffix}"
    if suffix == ".npz":
        np.savez(file, **{name: np.array(values) for name, values in rows.items()})
    else:
        lines = [",".join(map(str, row)) for row in zip(*rows.values(), strict=True)]
        file.write_text("\n".join([",".join(rows), *lines]))
    scans = read_scans(str(file), None, 0.5, note=notes.append)
    assert np.array_equal(scans.times, [step / per_second for step in steps])
    assert scans.epoch == first * (10**9 // per_second)
    (note,) = notes
    assert f"t is read as {unit} since 1970 (first scan: 2020-03-18)" in note
    stated = read_scans(str(file), None, 0.5, time_unit=unit, note=notes.append)
    assert same_scans(stated, scans) and len(notes) == 1


def test_files_may_count_from_1970_in_different_units_but_all_or_none(write):
    points = f"t,x,y\n{FIRST},1,2\n{FIRST + 10**8},3,4\n"
    poses = "k,t,x,y,heading\n0,1584532800.1234,0,0,1.5\n1,1584532800.2234,0,1,1.5\n"
    scans = read_scans(write(points), write(poses, "ego.csv"), 0.5)
    np.testing.assert_allclose(scans.times, [0.0, 0.1], atol=1e-6)
    assert np.array_equal(scans.offsets, [0, 1, 2])
    truth = f"t,x,y,heading,length,width\n{FIRST // 1000},1,9,0,4,2\n"
    assert np.array_equal(read_truth(scans, write(truth, "truth.csv")).known, [True, False])
    for text in (truth.replace(str(FIRST // 1000), "0.0"), truth.replace("t,", "s,t,", 1)):
        with pytest.raises(UserError):
            read_truth(scans, write(text, "truth.csv"))
    with pytest.raises(UserError, match=r"scans\.csv: t must count from 1970 in scans"):
        read_scans(write("t,x,y\n0,1,2\n"), write(poses, "ego.csv"), 0.5)


def test_a_stated_unit_holds_for_times_that_do_not_count_from_1970(write):
    scans = read_scans(write("t,x,y\n5000000000,1,2\n5200000000,3,4\n"), None, 0.5, time_unit="ns")
    assert np.array_equal(scans.times, [5.0, 5.2]) and scans.epoch is None
    with pytest.raises(UserError, match=r"t: 1e.12 ms must be a number up to"):
        read_scans(write("t,x,y\n0,1,2\n1000000000000,3,4\n"), None, 0.5, time_unit="ms")


def test_headings_in_degrees_are_taken_as_stated_and_recognised(scans, write):
    text = "k,x,y,heading,length,width\n0,1,10,{},4,2\n1,1,9,{},4,2\n2,1,8,{},4,2\n"
    degrees = write(text.format(270, -90, 271), "truth.csv")
    stated = read_truth(scans, degrees, angle_unit="deg")
    np.testing.assert_allclose(stated.target_poses_world[:2, 2], np.radians([270, -90]))
    assert heading_note(stated, "deg") is None
    assert "angle_unit=deg" in heading_note(read_truth(scans, degrees), "rad")
    # More than one turn in radians, along the motion.
    radians = write(text.format(4.7 + 4 * np.pi, 4.7, 4.71), "truth.csv")
    assert heading_note(read_truth(scans, radians), "rad") is None
    wrong = read_truth(scans, radians, angle_unit="deg")
    assert "angle_unit=rad they are 1° away" in heading_note(wrong, "deg")
    # Across the motion in either unit.
    across = write(text.format(0.01, 0.01, 0.01), "truth.csv")
    assert "° (median) away" in heading_note(read_truth(scans, across), "rad")
    # A target that stands: nothing but the size of the numbers tells.
    parked = "k,x,y,heading,length,width\n0,1,10,{0},4,2\n1,1,10,{0},4,2\n"
    for heading, expected in ((95, True), (3, False)):
        found = read_truth(scans, write(parked.format(heading), "truth.csv"))
        assert (heading_note(found, "rad") is not None) == expected
    ego = write(EGO.replace(",1.5\n", ",90\n"), "ego.csv")
    poses = read_scans(write(SCANS), ego, 0.5, angle_unit="deg")
    assert poses.sensor_poses_world[0, 2] == pytest.approx(0.5 * np.pi)
    rates = "k,x,y,heading,length,width,x_rate,y_rate,heading_rate\n0,1,9,90,4,2,0,1,180\n"
    turning = read_truth(scans, write(rates, "truth.csv"), angle_unit="deg")
    assert turning.target_rates_world[0, 2] == pytest.approx(np.pi)


FAULTS = {
    "": "not a table",
    "k,x,y\n0,1,1\n": "the column t is missing",
    "k,t,x\n0,0,1\n": "the column y is missing",
    "k,t,X [m],y\n0,0,1,1\n": "the column 'X [m]' must be named x",
    "K,t,x,y\n0,0,1,1\n": "the column 'K' must be named k",
    "k,t,x,y,Var_XX(m2)\n0,0,1,1,1\n": "the column 'Var_XX(m2)' must be named var_xx",
    "k,t,x,x,y\n0,0,1,1,1\n": "not a table: Duplicate names",
    "k,t,x,y\n0,0,1\n": "line 2: y: nan must be a finite number",
    "k,t,x,y\n0,0,1,1,1\n0,0,1,1,1\n": "not a table",
    "k,t,x,y\n0,0,1,1\n0,0,1,1,1\n": "not a table",
    "k,t,x,y\n0,0,True,1\n": "line 2: x: 'True' is not a number",
    "k,t,x,y\n0,0,1,1\n,,,\n": "line 3: k: nan must be a finite number",
    "k,t,x,y\n0,0,1,1\n0,,1,1\n": "line 3: t: nan s must be a number",
    "k,t,x,y\n0,0,1,1\n1,5e9,1,1\n": "line 3: t: 5e+09 s must be a number up to 1e+08 s",
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
    "k,t,x,y,var_xx\n0,0,1,1,1\n": "the column var_xy is missing: give all or none of var_xx",
    "k,t,x,y,var_xx,var_xy,var_yy\n0,0,1,1,1,2,1\n": "line 2: var_xx, var_xy, var_yy must be",
    'k,t,x,y\n0,0,"1,1\n': "not a table",
    b"k,t,x,y\n\xff,0,1,1\n": "not a text in UTF-8",
}


@pytest.mark.parametrize("text", FAULTS, ids=range(len(FAULTS)))
def test_a_fault_is_one_line_with_file_place_and_cause(text, write):
    with refused("scans.csv: ", FAULTS[text]):
        read_scans(write(text), None, 0.5)


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
    # A run on a recording with two labels writes such rows.
    unknown = "k,x,y,heading,length,width,x_rate,y_rate,heading_rate\n0,1,9,1,4,2,,,\n"
    unknown = read_truth(scans, write(unknown, "truth.csv"))
    assert unknown.known[0] and np.isnan(unknown.target_rates_world).all()
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


def test_contours_are_read_from_arrays_one_for_each_pose_of_the_limbs(scans, tmp_path):
    contour = rectangle(2.0, 2.0)[::-1]
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
    contours = np.stack([rectangle(2.0, 2.0), rectangle(1.0, 1.0)])
    pose = {"k": [0, 2], "x": [0.0, 1.0], "y": [9.0, 9.0], "heading": [0.0, 0.0]}
    file = tmp_path / "truth.npz"
    np.savez(file, contour=contours, limb_pose=[0, 1], **pose)
    scenario = read_truth(scans, str(file))
    assert np.array_equal(scenario.contour_target(0), contours[0])
    assert np.array_equal(scenario.contour_target(2), contours[1])
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


EXAMPLE = Path(__file__).parents[2] / "examples" / "radar_scans.py"


def test_the_example_is_a_run_s_input(tmp_path):
    runpy.run_path(str(EXAMPLE))["main"](tmp_path)
    scans = read_scans(str(tmp_path / "scans.csv"), str(tmp_path / "ego.csv"), 0.2)
    truth = read_truth(scans, str(tmp_path / "truth.csv"))
    assert len(scans) == 60
    assert np.all(np.diff(scans.offsets)[9::10] == 0)
    configuration = compose(["start=scans"]).configuration
    state = start_from_scans(scans, configuration.start, configuration.prior)
    first = transition(scans.times[1]) @ state.mean
    assert np.hypot(*(first[:2] - truth.target_poses_world[0, :2])) < 1.0
    assert np.hypot(*(first[3:5] - truth.target_rates_world[0, :2])) < 2.0


PANDASET = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "pandaset_scans.py"))
LEFT = {"w": np.sqrt(0.5), "x": 0.0, "y": 0.0, "z": np.sqrt(0.5)}


def written(file, value):
    file.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(value, pd.DataFrame):  # Texts as in the version of pandas that wrote PandaSet.
        value.columns = value.columns.astype(object)
    file.write_bytes(gzip.compress(pickle.dumps(value, protocol=4)))


@pytest.fixture
def sequence(tmp_path):
    """Three frames: a car drives along x, a sensor at the origin looks along -x, a wall is near."""
    random = np.random.default_rng(0)
    for k in range(3):
        x = 20.0 + 2.0 * k
        car = [x + random.uniform(-2, 2, 50), np.full(50, -0.9), np.linspace(0, 1.5, 50)]
        sky, far = [x, 0.0, 5.0], [x + 8.0, 0.0, 1.0]
        points = np.vstack([np.column_stack(car), sky, far])
        frame = pd.DataFrame(points, columns=["x", "y", "z"]).assign(i=1.0, t=0.0, d=0)
        written(tmp_path / f"lidar/{k:02d}.pkl.gz", pd.concat([frame, frame.assign(d=1, y=-0.8)]))
        values = {"uuid": "a", "label": "Car", "yaw": -0.5 * np.pi, "position.x": x}
        values |= {"position.y": 0.0, "dimensions.x": 1.8, "dimensions.y": 4.4}
        values |= {"position.z": 0.75, "dimensions.z": 1.5}
        label = pd.DataFrame([values, values]).astype({"uuid": object, "label": object})
        written(tmp_path / f"annotations/cuboids/{k:02d}.pkl.gz", label)
    pose = {"position": {"x": 0.0, "y": 0.0, "z": 1.8}, "heading": LEFT}
    (tmp_path / "lidar/poses.json").write_text(json.dumps([pose] * 3))
    (tmp_path / "lidar/timestamps.json").write_text(json.dumps([1e9, 1e9 + 0.1, 1e9 + 0.2]))
    return tmp_path


def test_its_tables_are_a_run_s_input(sequence, tmp_path, capsys):
    assert PANDASET["moving"](PANDASET["cuboids"](sequence)).loc["a", "frames"] == 3
    PANDASET["main"](sequence, "a", tmp_path / "out")
    assert capsys.readouterr().out == "measurement.road_z=0.00\n"
    tables = (str(tmp_path / f"out/{name}.csv") for name in ("scans", "ego"))
    scans = read_scans(*tables, 0.1, road_z=0.0)
    truth = read_truth(scans, str(tmp_path / "out/truth.csv"))
    assert 0.35 <= scans.heights.min() < scans.heights.max() <= 1.5
    np.testing.assert_allclose(scans.times, [0.0, 0.1, 0.2])
    np.testing.assert_allclose(np.cos(scans.sensor_poses_world[:, 2]), -1.0)
    expected = [[20.0, 0.0], [22.0, 0.0], [24.0, 0.0]]
    np.testing.assert_allclose(truth.target_poses_world[:, [0, 2]], expected, atol=1e-12)
    # Only the rotating lidar, the car's heights, and one point of each bearing.
    np.testing.assert_array_equal(scans.points_world[:, 1], -0.9)
    bearings = np.arctan2(*scans.points_world[scans.rows(0)].T[::-1])
    assert 0 < len(bearings) == len(np.unique(np.round(bearings / PANDASET["BEARING"])))


def test_a_pickle_of_anything_else_is_refused(tmp_path, capsys):
    class Evil:
        def __reduce__(self):
            return os.system, ("false",)

    file = tmp_path / "evil.pkl.gz"
    for value, words in ((Evil(), "is no part of a data frame"), ([1], "is no data frame")):
        written(file, value)
        with pytest.raises(SystemExit, match=words):
            PANDASET["read_frame"](file)
    file.write_bytes(b"text")
    with pytest.raises(SystemExit, match=r"evil\.pkl\.gz"):
        PANDASET["read_frame"](file)
