"""`stixel export`: a rendered run becomes a clip, and the clip gives the same scans again."""

import shlex

import cv2
import numpy as np
import pytest

from stixel_cli.cli.app import main
from stixel_cli.experiment.export import tum_text

RUN = ("path=depart", "path.duration=0.4", "ego=turning", "rig.width=200", "rig.height=120")
RUN += ("pictures.frames=[]", "executor=threads", "road=estimated")


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
        assert main(["run", *RUN, "--results", str(results), "--name", "rendered"]) == 0
    return results / "rendered"


def test_a_clip_gives_the_scans_and_the_truth_of_its_run(rendered, results, tmp_path, capsys):
    capsys.readouterr()
    clip = tmp_path / "clip"
    assert main(["export", str(rendered), "--format", "kitti", "--output", str(clip)]) == 0
    printed, command = capsys.readouterr().out.splitlines()
    assert printed == str(clip)
    words = shlex.split(command)
    assert words[:2] == ["stixel", "run"]
    more = ("pictures.frames=[]", "executor=threads", "road.pitch_range=2")
    again = ["--results", str(results), "--name", "again"]
    assert main([*words[1:], *more, *again]) == 0
    for name in ("scans", "ego"):
        with (
            np.load(rendered / f"{name}.npz") as old,
            np.load(results / f"again/{name}.npz") as new,
        ):
            for column in old:
                np.testing.assert_allclose(new[column], old[column], atol=1e-9, err_msg=column)
    with np.load(rendered / "truth.npz") as old, np.load(results / "again/truth.npz") as new:
        np.testing.assert_allclose(new["x"], old["x"], atol=0.05)
        np.testing.assert_allclose(new["y"], old["y"], atol=0.05)
        np.testing.assert_allclose(new["heading"], old["heading"], atol=1e-9)
    disparity = cv2.imread(str(clip / "disparity/0000/000003.png"), cv2.IMREAD_UNCHANGED)
    assert disparity.shape == (120, 200) and disparity.dtype == np.uint16
    assert 1.0 < np.median(disparity[disparity > 0]) / 256 < 60.0


def test_trajectories_are_those_that_evo_reads(rendered, tmp_path, capsys):
    out = tmp_path / "tum"
    assert main(["export", str(rendered), "--format", "tum", "--output", str(out)]) == 0
    assert sorted(file.name for file in out.iterdir()) == ["ego.tum", "track.tum", "truth.tum"]
    rows = np.loadtxt(out / "truth.tum")
    assert rows.shape == (4, 8)
    with np.load(rendered / "truth.npz") as truth:
        np.testing.assert_allclose(rows[:, 1], truth["x"], atol=1e-6)
        np.testing.assert_allclose(2.0 * np.arctan2(rows[:, 6], rows[:, 7]), truth["heading"])


def test_a_time_without_a_pose_has_no_row():
    text = tum_text(np.array([0.0, 0.1]), np.array([[1.0, 2.0, 0.0], [np.nan] * 3]))
    assert text == "0 1 2 0 0 0 0 1\n"


def test_what_cannot_be_exported_is_refused_in_one_line(rendered, tmp_path, capsys):
    capsys.readouterr()
    for words, said in (
        (["--format", "xyz"], "--format: 'xyz' is not known: must be one of kitti, tum"),
        (["--format", "tum", "--output", str(tmp_path)], "exists; choose another folder"),
    ):
        assert main(["export", str(rendered), *words]) == 2
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1
