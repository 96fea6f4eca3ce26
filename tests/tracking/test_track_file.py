"""A track from a file: its rows, frames, times, and what is said of faults."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from refusals import refused
from tracking_cases import scans_of

from stixel_cli.config.compose import compose
from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import ego_from_world
from stixel_cli.tracking.file import FileTrackParameters, rows_of_scans, track
from stixel_cli.validation.track_doubts import track_doubts as doubts_of

COUNT = 11
TIMES = 0.1 * np.arange(COUNT)
TRUTH = np.array([2.0, 12.0, np.arctan2(6.0, 3.0)]) + np.outer(TIMES, [3.0, 6.0, 0.0])
SENSORS = np.stack([0.5 * TIMES, 2.0 * TIMES, 0.5 * np.pi - 0.3 * TIMES], axis=1)


# What the reader takes from a class.
PRIOR = SimpleNamespace(length=4.0, width=2.0)


@pytest.fixture
def scans():
    return replace(scans_of([np.zeros((0, 2))] * COUNT), sensor_poses_world=SENSORS)


def write(path: Path, columns: dict[str, np.ndarray], rows=slice(None)) -> Path:
    values = np.stack(list(columns.values()), axis=1)[rows]
    lines = [",".join(f"{value:.9g}" for value in row) for row in values]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n")
    return path


STATE = "x", "y", "heading"


def columns(poses=TRUTH, **further):
    return dict(zip(STATE, poses.T, strict=True)) | further


def parameters(path, frame="world", track_id=None):
    return FileTrackParameters("file", str(path), track_id, 0, frame)


def read(path, scans, frame="world", track_id=None):
    return track(scans, None, PRIOR, parameters(path, frame, track_id))


def doubts(path, scans, frame="world", track_id=None):
    chosen = parameters(path, frame, track_id)
    return doubts_of(chosen, scans, read(path, scans, frame, track_id), TRUTH)


K = {"k": np.arange(COUNT)}


def in_camera(poses=TRUTH):
    """Poses in the frame of the sensor at each k: x right, y ahead."""
    places = [ego_from_world(p[None, :2], s)[0] for p, s in zip(poses, SENSORS, strict=True)]
    headings = poses[:, 2] - (SENSORS[:, 2] - 0.5 * np.pi)
    return np.column_stack([places, headings])


def kitti(path, poses, sizes=(1.5, 2.0, 4.0), track_id=31, exchanged=False):
    """Rows of KITTI's results: 17 columns, places x right, y down, z ahead."""
    rows = []
    for k, (x, z, heading) in enumerate(poses[:, [1, 0, 2]] if exchanged else poses):
        numbers = " ".join(f"{n:.9g}" for n in [*sizes, x, 1.6, z, -heading])
        rows.append(f"{k} {track_id} Car 0 0 0 1 2 3 4 {numbers}")
    path.write_text("\n".join(rows) + "\n")
    return path


def tum(path, poses, w_first=False, camera=False):
    """Rows of a trajectory: t x y z qx qy qz qw."""
    rows = []
    for t, (x, y, heading) in zip(TIMES, poses, strict=True):
        quaternion = [0.0, 0.0, 0.0, np.cos(0.5 * heading)]
        # Of a camera, about the second axis, which points down.
        quaternion[1 if camera else 2] = np.sin(0.5 * heading)
        if w_first:
            quaternion = quaternion[3:] + quaternion[:3]
        rows.append(" ".join(f"{n:.9g}" for n in (t, x, y, 0.0, *quaternion)))
    path.write_text("# t x y z qx qy qz qw\n" + "\n".join(rows) + "\n")
    return path


def test_poses_of_a_table_and_of_a_trajectory(tmp_path, scans):
    found = read(write(tmp_path / "track.csv", K | columns()), scans)
    assert_allclose(found.means[:, :3], TRUTH, atol=1e-7)
    assert (found.means[:, 3:] == 0.0).all()
    assert (found.covariances == 0.0).all()
    assert not found.uses_scans and len(found.used_points) == 0
    sides = np.linalg.norm(np.diff(found.contours_world[0], axis=0), axis=1)
    assert_allclose(sides, [4.0, 2.0, 4.0])
    assert doubts(tmp_path / "track.csv", scans) == []
    found = read(tum(tmp_path / "track.tum", TRUTH), scans)
    assert_allclose(found.means[:, :3], TRUTH, atol=1e-7)
    with pytest.raises(UserError, match=r"z is not up: must be x y z qx qy qz qw \(w last\)"):
        read(tum(tmp_path / "w.tum", TRUTH, w_first=True), scans)
    with pytest.raises(UserError, match="z is not up"):
        read(tum(tmp_path / "camera.tum", TRUTH, camera=True), scans)


def test_rates_covariances_sizes_and_radii(tmp_path, scans):
    states = [*STATE, *(f"{name}_rate" for name in STATE)]
    constant = dict.fromkeys(states[3:], 1) | {f"std_{one}": i for i, one in enumerate(states, 1)}
    constant |= {"var_xx": 4, "var_xy": 1, "var_yy": 9, "length": 5, "width": 2}
    constant |= {f"radius_{i}": i + 1 for i in range(4)}
    table = K | columns(**{name: np.full(COUNT, value) for name, value in constant.items()})
    found = read(write(tmp_path / "track.csv", table), scans)
    assert (found.means[:, 3:] == 1.0).all()
    expected = np.diag([4.0, 9.0, 9.0, 16.0, 25.0, 36.0])
    expected[0, 1] = expected[1, 0] = 1.0
    assert_allclose(found.covariances[3], expected)
    assert (found.box_sizes == [5.0, 2.0]).all()
    arms = found.contours_world - found.means[:, None, :2]
    assert_allclose(np.linalg.norm(arms, axis=2), np.tile([1, 2, 3, 4], (COUNT, 1)))
    # The first radius is along the heading, the second to the left.
    ahead = np.stack([np.cos(TRUTH[:, 2]), np.sin(TRUTH[:, 2])], axis=1)
    assert_allclose(arms[:, 0], ahead, atol=1e-7)
    assert_allclose(arms[:, 1], 2 * ahead[:, ::-1] * [-1, 1], atol=1e-7)


def test_poses_in_the_frame_of_the_camera(tmp_path, scans):
    rates = {"x_rate": 0.0, "y_rate": 1.0, "heading_rate": 0.0}
    constant = rates | {"var_xx": 1.0, "var_xy": 0.0, "var_yy": 4.0}
    table = K | columns(in_camera(), **{name: np.full(COUNT, n) for name, n in constant.items()})
    path = write(tmp_path / "track.csv", table)
    found = read(path, scans, "camera")
    assert_allclose(found.means[:, :3], TRUTH, atol=1e-6)
    # Ahead of the sensor is its heading.
    ahead = np.stack([np.cos(SENSORS[:, 2]), np.sin(SENSORS[:, 2])], axis=1)
    assert_allclose(found.means[:, 3:5], ahead, atol=1e-6)
    assert_allclose(np.einsum("ki,kij,kj->k", ahead, found.covariances[:, :2, :2], ahead), 4.0)
    assert "and tracker.frame=camera the median distance" in doubts(path, scans)[0]


def test_results_of_kitti(tmp_path, scans):
    path = kitti(tmp_path / "0000.txt", in_camera())
    for track_id in (None, 31):
        found = read(path, scans, "camera", track_id)
        assert_allclose(found.means[:, :3], TRUTH, atol=1e-6)
        assert (found.box_sizes == [4.0, 2.0]).all()
    with pytest.raises(UserError, match=r"tracker\.id: .*: 31; got 7"):
        read(path, scans, "camera", 7)
    later = FileTrackParameters("file", str(path), 31, 4, "camera")
    assert rows_of_scans(scans, later).index.tolist() == [0, 1, 2, 3, 4, 5, 6]
    path.write_text(path.read_text() + path.read_text().replace(" 31 Car", " 5 Car"))
    with pytest.raises(UserError, match=r"tracker\.id: .*: 5, 31; got None"):
        read(path, scans, "camera")


def test_times_are_matched_within_half_an_interval(tmp_path, scans):
    for offset in (0.04, -0.04):
        path = write(tmp_path / "track.csv", columns(t=TIMES + offset))
        assert_allclose(read(path, scans).means[:, :3], TRUTH, atol=1e-7)
        differ = f"its times differ by {offset:+.3f} s (median) from those of the scans"
        assert doubts(path, scans) == [f"tracker.path: {path}: {differ}"]
    # Rows in any order, twice as many as scans.
    times = np.concatenate([TIMES + 0.05, TIMES])
    table = columns(np.concatenate([TRUTH + 1.0, TRUTH]), t=times)
    path = write(tmp_path / "track.csv", table)
    assert_allclose(read(path, scans).means[:, :3], TRUTH, atol=1e-7)
    write(path, columns(t=TIMES + 100.0))
    with pytest.raises(UserError, match="half an interval of a scan: t goes from 100 to"):
        read(path, scans)


@pytest.mark.parametrize("unit", [1, 10**3, 10**6, 10**9])
def test_times_since_1970_are_those_of_the_scans(tmp_path, scans, unit):
    epoch = 1_700_000_000
    since = replace(scans, epoch=epoch * 10**9)
    times = [f"{(epoch + t) * unit:.{2 if unit == 1 else 0}f}" for t in TIMES]
    rows = [",".join([t, *map(str, pose)]) for t, pose in zip(times, TRUTH, strict=True)]
    path = tmp_path / "track.csv"
    path.write_text("\n".join(["t,x,y,heading", *rows]))
    assert_allclose(read(path, since).means[:, :3], TRUTH, atol=1e-7)
    assert not doubts(path, since)
    with pytest.raises(UserError, match="no t within half an interval of a scan"):
        read(path, scans)


def test_a_scan_without_a_row_keeps_the_estimate_before(tmp_path, scans):
    path = write(tmp_path / "track.csv", K | columns(), [2, 3, 7])
    found = read(path, scans)
    expected = TRUTH[[2, 2, 2, 3, 3, 3, 3, 7, 7, 7, 7]]
    assert_allclose(found.means[:, :3], expected, atol=1e-7)
    assert "8 of 11 scans have no row" in doubts(path, scans)[0]
    assert rows_of_scans(scans, parameters(path)).index.tolist() == [2, 3, 7]


FAULTS = {
    "the headings are probably off by 180°": columns(TRUTH - [0.0, 0.0, np.pi]),
    "the headings are probably off by 90°": columns(TRUTH - [0.0, 0.0, 0.5 * np.pi]),
    "the headings are probably in degrees": columns(TRUTH * [1.0, 1.0, 180.0 / np.pi]),
    "length and width are probably exchanged": columns(
        length=2.0 + 0 * TIMES, width=4.0 + 0 * TIMES
    ),
    "x and y (of KITTI: x and z) exchanged": columns(TRUTH[:, [1, 0, 2]]),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_gets_a_line(tmp_path, scans, fault):
    path = write(tmp_path / "track.csv", K | FAULTS[fault])
    assert fault in doubts(path, scans)[0]


def test_exchanged_places_of_kitti_get_a_line(tmp_path, scans):
    (line,) = doubts(kitti(tmp_path / "0000.txt", in_camera(), exchanged=True), scans, "camera")
    assert "x and z) exchanged and tracker.frame=camera the median distance" in line


WRONG = {
    "has no rows": ("track.csv", "k,x,y,heading\n"),
    "the column heading is missing": ("track.csv", "k,x,y\n0,1,2\n"),
    "the column k or t is missing": ("track.csv", "x,y,heading\n1,2,3\n"),
    "k = 0 is given twice": ("track.csv", "k,x,y,heading\n0,1,2,3\n0,1,2,3\n"),
    "k must be a whole number from 0 to 10": ("track.csv", "k,x,y,heading\n11,1,2,3\n"),
    "t = 0.3 s, but scan k = 0 is at 0 s": ("track.csv", "k,t,x,y,heading\n0,0.3,1,2,3\n"),
    "length must be > 0": ("track.csv", "k,x,y,heading,length,width\n0,1,2,3,0,1\n"),
    "radius_0, radius_1, … must be": ("track.csv", "k,x,y,heading,radius_1\n0,1,2,3,4\n"),
    "row 1: 17 columns are needed": ("track.txt", "0 31 Car\n"),
    "nan must be within": ("track.txt", "0 1 nan 0 0 0 0 1\n"),
    "qw, qx, qy, qz must have the length 1": ("track.txt", "0 1 2 0 0 0 0 0\n"),
    "track.csv is missing": ("other.csv", ""),
}


@pytest.mark.parametrize("message", WRONG)
def test_a_wrong_file_gets_one_line(tmp_path, scans, message):
    name, text = WRONG[message]
    (tmp_path / name).write_text(text)
    path = tmp_path / ("track.csv" if name == "other.csv" else name)
    with refused(message):
        read(path, scans)


@pytest.mark.parametrize(
    "words", [[], ["tracker.path="], ["tracker.path=/no/such.csv"], ["tracker.path=/"]]
)
def test_a_missing_file_is_refused_before_the_run(words):
    with pytest.raises(UserError):
        compose(["tracker=file", *words])
