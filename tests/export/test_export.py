"""`stixel export`: a rendered run becomes a clip, and the clip gives the same scans again."""

import csv
import importlib.util
import shlex
import sys

import cv2
import numpy as np
import pytest
from made_stixels import made_stixels

from stixel_cli.cli.app import main
from stixel_cli.export.export import tum_rows
from stixel_cli.export.stx1 import used_stixels
from stixel_cli.measurements.scans import Scans

RUN = ("path=depart", "path.duration=0.4", "ego=turning", "rig.width=200", "rig.height=120")
RUN += ("pictures.frames=[]", "executor=threads", "road=estimated")
OWN = ("stereo.block_size=9", "occupancy=cartesian", "extraction.width=4")
OWN += ("measurement.height_max=2",)
"""Values that are not those of a recording."""


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return tmp_path_factory.mktemp("results")


@pytest.fixture(autouse=True)
def own_cache(cache, monkeypatch):
    monkeypatch.setenv("STIXEL_CACHE", cache)


@pytest.fixture(scope="module")
def rendered(results, cache):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", cache)
        assert main(["run", *RUN, *OWN, "--results", str(results), "--name", "rendered"]) == 0
    return results / "rendered"


def test_a_clip_gives_the_scans_and_the_truth_of_its_run(rendered, results, tmp_path, told):
    clip = tmp_path / "clip"
    printed, command = told("export", rendered, "--format", "kitti", "--output", clip).splitlines()
    assert printed == str(clip)
    words = shlex.split(command)
    assert words[:2] == ["stixel", "run"]
    # Recordings have another value.
    assert "stereo.disparities_at_full_size=null" in words
    more = ("pictures.frames=[]", "executor=threads")
    again = ["--results", str(results), "--name", "again"]
    assert main([*words[1:], *more, *again]) == 0
    for name in ("scans", "ego"):
        old, new = (np.load(folder / f"{name}.npz") for folder in (rendered, results / "again"))
        with old, new:
            for column in old:
                # The focal length of the calibration differs in its last digit, which moves the
                # end of one stixel by 0.06 mm.
                np.testing.assert_allclose(new[column], old[column], atol=1e-4, err_msg=column)
    with np.load(rendered / "truth.npz") as old, np.load(results / "again/truth.npz") as new:
        for name, tolerance in (("x", 0.05), ("y", 0.05), ("heading", 1e-9)):
            np.testing.assert_allclose(new[name], old[name], atol=tolerance)
    disparity = cv2.imread(str(clip / "disparity/0000/000003.png"), cv2.IMREAD_UNCHANGED)
    assert disparity.shape == (120, 200) and disparity.dtype == np.uint16
    assert 1.0 < np.median(disparity[disparity > 0]) / 256 < 60.0


def test_trajectories_are_those_that_evo_reads_without_rows_of_unknown_poses(rendered, tmp_path):
    out = tmp_path / "tum"
    assert main(["export", str(rendered), "--format", "tum", "--output", str(out)]) == 0
    assert sorted(file.name for file in out.iterdir()) == ["ego.tum", "track.tum", "truth.tum"]
    rows = np.loadtxt(out / "truth.tum")
    assert rows.shape == (4, 8)
    with np.load(rendered / "truth.npz") as truth:
        np.testing.assert_allclose(rows[:, 1], truth["x"], atol=1e-6)
        np.testing.assert_allclose(2.0 * np.arctan2(rows[:, 6], rows[:, 7]), truth["heading"])
    rows = tum_rows(np.array([0.0, 0.1]), np.array([[1.0, 2.0, 0.0], [np.nan] * 3]))
    assert rows.tolist() == [[0, 1, 2, 0, 0, 0, 0, 1]]


def read_table(file):
    with file.open(encoding="utf-8") as opened:
        rows = list(csv.DictReader(opened))
    return {name: [row[name] for row in rows] for name in rows[0]}


def test_tables_have_documented_columns_and_the_runs_values(rendered, tmp_path):
    out = tmp_path / "csv"
    assert main(["export", str(rendered), "--format", "csv", "--output", str(out)]) == 0
    names = {"scans", "track", "truth", "ego", "start", "contour", "true_contour"}
    assert {file.stem for file in out.iterdir()} == names | {"columns"}
    columns = read_table(out / "columns.csv")
    documented = set(zip(columns["table"], columns["column"], strict=True))
    tables = {name: read_table(out / f"{name}.csv") for name in names}
    assert documented == {(name, column) for name in names for column in tables[name]}
    assert all(columns["meaning"])
    with np.load(rendered / "track.npz") as track, np.load(rendered / "scans.npz") as scans:
        np.testing.assert_array_equal(np.float64(tables["scans"]["x"]), scans["x"])
        used = np.flatnonzero(np.int64(tables["scans"]["used"]))
        np.testing.assert_array_equal(used, np.sort(track["used_points"]))
        contour = np.float64([tables["contour"]["x"], tables["contour"]["y"]]).T
        np.testing.assert_array_equal(contour, track["contours_world"].reshape(-1, 2))
    assert set(tables["true_contour"]["k"]) == {"0", "1", "2", "3"}


def test_stixels_come_back_from_the_format_of_pystixel_lib(rendered, tmp_path):
    library = pytest.importorskip("stixel")
    out = tmp_path / "stx1"
    assert main(["export", str(rendered), "--format", "stx1", "--output", str(out)]) == 0
    assert [file.name for file in sorted(out.iterdir())] == [f"{k:06d}.stx1" for k in range(4)]
    with np.load(rendered / "track.npz") as track:
        used = np.diff(track["used_offsets"])
    for k in range(4):
        world = library.read(str(out / f"{k:06d}.stx1"))
        found = {name: np.array([getattr(one, name) for one in world.stixel]) for name in OF_STX1}
        assert len(found["u"]) > 10 and found["idx"].tolist() == list(range(len(found["u"])))
        assert (found["u"] >= 0).all() and (found["u"] + found["width"] <= 200).all()
        assert (found["vT"] < found["vB"]).all() and (found["vB"] <= 120).all()
        assert ((found["confidence"] > 0.0) & (found["confidence"] <= 1.0)).all()
        target = found["cluster"] == 0
        assert target.sum() == used[k] and set(found["cluster"]) == {-1, 0}
        assert set(found["label"][target]) == {library.Segmentation.TYPE_CAR}
        assert set(found["label"][~target]) == {0}
        # The car's rear is 6 m ahead at the start, and drives away.
        assert 4.0 < np.median(found["d"][target]) < 15.0
        assert library.decode_img(world).size == (200, 120)
        assert (world.context.name, world.context.clusters) == (f"{k:06d}", 0)
        # The library's own reading of d: depth along the camera's axis.
        points = library.convert_to_3d_stixel(world)
        np.testing.assert_allclose(points[:, 2], found["d"], rtol=1e-4)


def test_a_recording_of_rerun_is_written(rendered, tmp_path):
    if importlib.util.find_spec("rerun") is None:
        pytest.skip("rerun is not installed")
    out = tmp_path / "rerun"
    assert main(["export", str(rendered), "--format", "rerun", "--output", str(out)]) == 0
    assert (out / "run.rrd").stat().st_size > 5000


@pytest.mark.parametrize(("form", "module"), [("stx1", "stixel"), ("rerun", "rerun")])
def test_a_missing_library_is_named(form, module, rendered, tmp_path, monkeypatch, told):
    monkeypatch.setitem(sys.modules, module, None)
    error = told("export", rendered, "--format", form, "--output", tmp_path / "x", code=2)
    assert f"pip install 'stixel[{form}]'" in error and error.count("\n") == 1
    assert not (tmp_path / "x").exists()


def test_scans_without_images_have_no_stixels(results, tmp_path, told):
    pytest.importorskip("stixel")
    few = ("measurement=fabricated", "path.duration=0.3", "pictures.frames=[]", "executor=threads")
    assert main(["run", *few, "--results", str(results), "--name", "rays"]) == 0
    words = ("--format", "stx1", "--output", str(tmp_path / "x"))
    assert "has no stixels to export" in told("export", results / "rays", *words, code=2)


def test_what_cannot_be_exported_is_refused_in_one_line(rendered, tmp_path, told):
    for words, said in (
        (["--format", "xyz"], "'xyz' is not one of 'kitti', 'csv', 'tum', 'stx1', 'rerun'"),
        (["--format", "tum", "--output", str(tmp_path)], "exists and is not overwritten"),
    ):
        error = told("export", rendered, *words, code=2)
        assert said in error and error.count("\n") == 1


OF_STX1 = ("u", "vT", "vB", "d", "label", "width", "confidence", "idx", "cluster")
GATES = (0.3, 2.5, 1.0, 40.0)


def stixels_of(first, heights_of_each):
    """Stixels of frames from `first` on, 10 m ahead; one below 0.3 m is no candidate."""
    heights = np.concatenate(heights_of_each)
    points = np.tile([0.0, 10.0], (len(heights), 1))
    offsets = np.cumsum([0, *map(len, heights_of_each)])
    return made_stixels(first, offsets, height=heights, points_ego=points)


def test_clutter_and_dropouts_do_not_shift_the_stixels_of_the_target():
    # Frame 2 has two candidates and one clutter point, frame 3 a dropout, frame 4 no clutter.
    chunk = stixels_of(2, [[1.0, 0.1, 1.0], [1.0], [1.0, 1.0]])
    points = [(np.zeros((n, 2)), np.tile(np.eye(2), (n, 1, 1))) for n in (1, 0, 3, 0, 2)]
    scans = Scans.of_each(np.arange(5), np.zeros((5, 3)), points)
    used = np.array([0, 2, 3, 4])  # In frame 2 the second candidate and the clutter.
    assert used_stixels(chunk, GATES, scans, used).tolist() == [0, 0, 1, 0, 1, 0]
