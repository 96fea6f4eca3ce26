"""What a result folder is called and holds, that it repeats to the byte, and what leaves none."""

import csv
import errno
import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml
from run_cli import FEW, SMALL, run_json
from short_runs import short_python

from stixel_cli.cli.app import main
from stixel_cli.config.compose import compose, from_resolved
from stixel_cli.engine.errors import writing
from stixel_cli.engine.store import Store
from stixel_cli.experiment import run
from stixel_cli.experiment.run_names import LONGEST_NAME, differences, joined_name
from stixel_cli.results.folder import check_plain_name

REPEATED = ("metrics.json", "scans.csv", "scans.npz", "track.csv", "track.npz", "scores.npz")
TABLES, FORMS = ("scores", "ego", "truth", "scans", "track"), ("csv", "npz")
FABRICATED = ("measurement=fabricated", "path.duration=0.5", "pictures.frames=[0]")


def test_a_smoothed_track_is_next_to_that_of_the_filter(results, capsys, told):
    for lag in (0, 2):
        overrides = (*FABRICATED, "tracker=gp_ekf", f"tracker.lag={lag}")
        run_json(capsys, results, *overrides, "--name", f"lag{lag}")
    plain, both = results / "lag0", results / "lag2"
    names, of_plain = ({path.name for path in folder.iterdir()} for folder in (both, plain))
    assert names - of_plain == {"smoothed.csv", "smoothed.npz"}
    for name in ("track.csv", "track.npz", "scores.npz"):
        assert (plain / name).read_bytes() == (both / name).read_bytes()
    filtered, smoothed = (np.load(both / name) for name in ("track.npz", "smoothed.npz"))
    assert set(filtered) == set(smoothed)
    assert not np.allclose(filtered["means"][:-2], smoothed["means"][:-2])
    assert "smoothed, lag 2" in told("ls", both)
    assert "IoU of the outline, mean, smoothed" in told("ls", plain, both)


@pytest.mark.sketched
def test_the_folder_holds_what_the_readme_lists(results, capsys):
    folder = results / "mine"
    run_json(capsys, results, *FEW, "--name", "mine")
    assert '"./mine/index.html"' in (results / "index.html").read_text(encoding="utf-8")
    tables = {f"{name}.{form}" for name in TABLES for form in FORMS}
    texts = {"lineage.json", "config.yaml", "manifest.json", "metrics.json", "index.html"}
    assert {path.name for path in folder.iterdir()} == tables | texts | {"figures"}
    resolved = yaml.safe_load((folder / "config.yaml").read_text())
    assert from_resolved(resolved) == compose(FEW).configuration
    manifest = json.loads((folder / "manifest.json").read_text())
    assert {"command", "seed", "git", "versions", "machine", "stages"} <= manifest.keys()
    assert {"name", "key", "status", "seconds"} <= manifest["stages"][0].keys()
    with np.load(folder / "scans.npz", allow_pickle=False) as scans:
        assert list(scans) == ["k", "t", "x", "y", "var_xx", "var_xy", "var_yy"]
        with (folder / "scans.csv").open() as file:
            rows = list(csv.DictReader(file))
        for name in scans:
            assert np.array_equal(scans[name], [float(row[name]) for row in rows])
    figures = {str(path.relative_to(folder / "figures")) for path in folder.rglob("*.png")}
    assert {"path.png", "errors.png", "k0001/stixels.png", "k0001/birds_eye.png"} <= figures


@pytest.mark.workers
def test_the_same_bytes_on_any_number_of_workers(results, capsys, tmp_path, monkeypatch):
    answers = []
    for workers in ("1", "2"):
        monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / f"cache{workers}"))
        # One worker is this process, two are processes of their own.
        how = ("executor=threads",) if workers == "1" else ()
        words = (*SMALL, "path.duration=1.2", *how, "--workers", workers, "--name", f"by{workers}")
        answers.append(run_json(capsys, results, *words))
    computed = [{stage["name"] for stage in answer["stages"]} for answer in answers]
    assert computed[0] == computed[1]
    for file in REPEATED:
        one, two = (results / name / file for name in ("by1", "by2"))
        assert one.read_bytes() == two.read_bytes(), file


def test_of_two_in_one_second_both_are_written(results, capsys, told, monkeypatch):
    def taken_meanwhile(folder, *arguments):
        if not folder.name.endswith("-2"):
            folder.mkdir(parents=True)
        write_folder(folder, *arguments)

    write_folder = run.write_folder
    monkeypatch.setattr(run, "write_folder", taken_meanwhile)
    folder = Path(run_json(capsys, results, *FABRICATED)["folder"])
    assert folder.name.endswith("-2")
    assert (folder / "metrics.json").is_file()
    said = told("run", *FABRICATED, "--results", results, "--name", "mine", code=2)
    assert "mine: was created by another process meanwhile\n" in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--name", "taken"), "exists; choose another --name"),
        (("--name", "link"), "exists; choose another --name"),
        (("--name", "a/b"), "is not a valid folder name"),
        (("--name", ""), "is not a valid folder name"),
        (("--name", "x" * 201), "at most 200 characters"),
        (("--results", "file"), "--results: file: not a writable folder; name another"),
        (("--results", "file/below"), "--results: file/below: cannot be created"),
        (("--results", "new/" + "x" * 300), "cannot be created: File name too long"),
    ],
)
def test_a_folder_that_cannot_be_written_is_refused(arguments, said, tmp_path, told, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results" / "taken").mkdir(parents=True)
    (tmp_path / "results" / "link").symlink_to("nowhere")
    (tmp_path / "file").write_text("mine")
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    for command in (["run"], ["run", "--dry-run"], ["sweep", "--dry-run", "seed=1,2"]):
        error = told(*command, *FABRICATED, *arguments, code=2)
        assert said in error and error.count("\n") == 1
    assert sorted(os.listdir(tmp_path)) == ["file", "results"]
    assert sorted(os.listdir(tmp_path / "results")) == ["link", "taken"]
    assert not os.listdir(tmp_path / "results" / "taken")


@pytest.mark.parametrize(
    ("place", "number"),
    [("write_bytes", errno.ENOSPC), ("write_bytes", errno.EROFS), ("rename", errno.EROFS)],
)
def test_a_full_disk_leaves_no_half_folder(place, number, results, capsys, told, monkeypatch):
    def fault(*_, **__):
        raise OSError(number, said)

    said = os.strerror(number)
    run_json(capsys, results, *FABRICATED, "--name", "there")  # so that all is cached
    monkeypatch.setattr(Path, place, fault)
    error = told("run", *FABRICATED, "--results", results, "--name", "new", code=2)
    assert f"stixel: {results}/new: cannot be written: {said}\n" in error
    beside_runs = {"index.html", ".index.lock"}
    assert {*os.listdir(results)} - beside_runs == {"there"}


def test_results_that_are_read_only_are_refused_before_anything_runs(
    results, told, monkeypatch, tmp_path
):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    results.mkdir()
    monkeypatch.setattr("os.access", lambda path, mode, **_: not mode & os.W_OK)
    said = told("run", *FABRICATED, "--results", results, code=2)
    assert "not a writable folder; name another" in said
    assert not (tmp_path / "cache").exists()


def test_dry_run_prints_the_plan_and_writes_nothing(results, told):
    plan = json.loads(told("run", *FABRICATED, "--dry-run", "--json", "--results", results))
    assert plan["config"]["measurement"]["kind"] == "fabricated"
    assert "track" in {stage["name"] for stage in plan["stages"]}
    assert not results.exists()


def test_a_fabricated_run_imports_neither_open3d_nor_opencv_nor_numba(results, tmp_path):
    words = ["run", *FABRICATED, "--results", str(results)]
    # The second is all cached.
    (tmp_path / "script.py").write_text(
        "import sys\nfrom stixel_cli.cli.app import main\n"
        f"code = main({words}) or main({words})\n"
        "heavy = {'open3d', 'cv2', 'numba', 'dash'} & sys.modules.keys()\n"
        "sys.exit(f'imported {heavy}' if heavy else code)"
    )
    command = short_python(str(tmp_path / "script.py"), "sketched", "workers")
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


DEFAULT = {"road_user": "car", "path": "turn", "rig": "default", "tracker": "gp_ekf"}


def run_name(*given):
    return joined_name(differences(*given))


@pytest.mark.parametrize(
    ("overrides", "name"),
    [
        ([], "car-turn"),
        (["rig=kitti", "stereo=bm"], "car-turn-rig=kitti-stereo=bm"),
        (["measurement=fabricated", "tracker=point"], "car-turn-fabricated-point"),
        (["measurement=stixels", "tracker=gp_ekf", "rig=default"], "car-turn"),
        (["tracker.sigma_f=0.5", "seed=3"], "car-turn-sigma_f=0.5-seed=3"),
        (["tracker.basis_points=50", "rig.baseline=0.3"], "car-turn"),
        (["prior=car"], "car-turn-prior=car"),
        (["executor.workers=1", "cache.folder=x", "pictures.frames=[1]"], "car-turn"),
        (["measurement/noise=constant"], "car-turn-noise=constant"),
        (["road_user.mesh=/home/me/my van.obj"], "car-turn-mesh=myvan.obj"),
        (["tracker=my_module:track"], "car-turn-my_module_track"),
    ],
)
def test_what_differs_is_in_the_name(overrides, name):
    assert run_name(DEFAULT, overrides) == name
    check_plain_name(name)


def test_names_have_road_user_and_path_but_of_a_file_and_are_short_and_printable():
    choices = DEFAULT | {"road_user": "cyclist", "path": "crossing"}
    assert run_name(choices, ["road_user=cyclist", "path=crossing"]) == "cyclist-crossing"
    choices = DEFAULT | {"measurement": "file"}
    overrides = ["measurement=file", "measurement.path=a/scans.csv"]
    assert run_name(choices, overrides) == "car-file-path=scans.csv"
    overrides = ["path=waypoints", f"path.points={[[0, k] for k in range(99)]}"]
    name = run_name(DEFAULT | {"path": "waypoints"}, overrides)
    assert name.startswith("car-waypoints-points=0,0,0,1,") and name.endswith("..")
    many = [f"tracker.some_long_key_{k}={k}" for k in range(20)]
    name = run_name(DEFAULT, many)
    assert len(name) < LONGEST_NAME + 5 and name.endswith("+16")
    check_plain_name(name)
    found = differences({"road_user": "a\nb\x1b"}, ["=", "x\n=\t\u202e1", "stereo=" + "y" * 99])
    assert all(part.isprintable() for part in found)
    check_plain_name("x" + joined_name(["ä\x00/.."]))


NOBODY = ("executor=dask", "executor.address=tcp://127.0.0.1:9")


@pytest.fixture
def refusing(monkeypatch, tmp_path):
    """A cache that is read-only once this is called."""
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))

    def refuse(self):
        with writing(self.folder):
            raise OSError(errno.EROFS, "Read-only file system")

    return lambda: monkeypatch.setattr(Store, "check_writable", refuse)


@pytest.mark.parametrize("words", [("run", *FABRICATED), ("sweep", *FABRICATED, "seed=0,1")])
def test_a_read_only_cache_and_a_scheduler_that_is_not_there(
    refusing, monkeypatch, results, told, words
):
    pytest.importorskip("distributed", reason="Dask is not installed")
    monkeypatch.setattr("stixel_cli.engine.dask_pool.PATIENCE", 0.5)
    for more, faults in (
        (NOBODY, ["no Dask scheduler at tcp://127.0.0.1:9"]),
        ((), ["Read-only file system: choose another (cache.folder or STIXEL_CACHE)"]),
    ):
        if not more:
            refusing()
        said = told(*words, *more, "--results", results, code=2)
        assert said.count("\n") == 1
        assert all(fault in said for fault in faults)
        assert not results.exists()


def test_a_read_only_cache_that_holds_all_serves(refusing, results, capsys):
    sweep = ("sweep", *FABRICATED, "seed=0,1", "--results", str(results), "--name")
    assert main([*sweep, "first"]) == 0
    refusing()
    assert main([*sweep, "again"]) == 0
    # Nothing is lacking, so that nobody needs to be there to compute it.
    assert main([*sweep[:-3], *NOBODY, *sweep[-3:], "alone"]) == 0
    capsys.readouterr()
    for name in ("again", "alone"):
        runs = [(results / which / "summary.csv").read_text() for which in ("first", name)]
        assert runs[0] == runs[1]
