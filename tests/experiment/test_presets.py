"""Every file of conf/ runs: the real command line, few frames."""

import json

import pytest
from run_cli import FEW, run_json

from stixel_cli.config.folders import group_options, outer_options

DRAWN = {"measurement", "occupancy", "pictures"}
"""Groups whose options show in the pictures of a scan; those of each kind: tests/report."""

PLANNED = {("rig", rig) for rig in group_options()["rig"] if rig not in ("default", "kitti")}
PLANNED |= {("renderer", "filament"), ("executor", "dask")}
"""No stage runs of presets of large images that differ from `rig=kitti` in numbers alone, of a
renderer whose stage is called in `tests/rendering/test_filament.py`, and with Dask, which needs a
scheduler: `tests/engine`."""

OWN_PRESETS = {"road_user", "pace", "prior", "source"}
OF_FILES = {("measurement", "file"), ("path", "recorded"), ("tracker", "file")}
OF_FILES |= {("experiment", "lidarrm"), ("experiment", "pandaset")}
"""Presets that need files: `test_file_run.py`, tests/recordings, `tests/studies`."""

PRESETS = [(group, option) for group, options in group_options().items() for option in options]
PRESETS = [one for one in PRESETS if one[0] not in OWN_PRESETS and one not in OF_FILES]
PATHS = [option for group, option in PRESETS if group == "path"]
USERS = group_options()["road_user"]
RUNS = [("car", path) for path in PATHS] + [(user, "stop_and_go") for user in USERS[1:]]
"""Each path and each road user once; every pair's motion: `tests/scene/test_path.py`."""


def check(answer: dict) -> None:
    assert answer["metrics"]["scans"] >= 2
    assert answer["metrics"]["centre_rmse_m"] is not None
    assert {stage["status"] for stage in answer["stages"]} <= {"computed", "cached"}


def preset(group, option):
    """With the marks of what its run needs."""
    drawn = pytest.mark.drawn if group == "pictures" else pytest.mark.sketched
    marks = [drawn] if group in DRAWN else []
    marks += [pytest.mark.workers] if group == "executor" else []
    return pytest.param(group, option, marks=marks, id=f"{group}-{option}")


@pytest.mark.parametrize(("group", "option"), [preset(*o) for o in PRESETS if o[0] != "path"])
def test_every_preset_runs(group, option, results, capsys):
    if option == "pyrecest":
        pytest.importorskip("pyrecest")
    few = FEW[:-1] if group != "rig" else ("path.duration=0.2",)
    pictures = "pictures.frames=[1]" if group in DRAWN else "pictures.frames=[]"
    outer = group.rpartition("/")[0]
    around = (f"{outer}={outer_options(group)[0]}",) if outer else ()
    # Rendered images have few points on the target, too few to start from.
    around += ("measurement=fabricated",) if group == "start" else ()
    choice = (*around, f"{group}={option}")
    if (group, option) in PLANNED:
        assert run_json(capsys, results, "--dry-run", *few, *choice)["nodes"]
        return
    check(run_json(capsys, results, *few, pictures, *choice))


@pytest.mark.parametrize(("road_user", "path"), RUNS)
def test_road_users_and_paths_run_with_fabricated_measurements(road_user, path, results, capsys):
    choice = (f"road_user={road_user}", f"path={path}", "measurement=fabricated")
    # There is no time to close a circle.
    choice += ("path.radius=6",) if path == "circle" else ()
    answer = run_json(capsys, results, *choice, "path.duration=0.5", "pictures.frames=[]")
    check(answer)
    assert answer["metrics"]["points_per_scan_mean"] > 1


@pytest.mark.parametrize("road_user", USERS)
def test_every_road_user_is_rendered_and_measured(road_user, results, capsys):
    few = ("path.duration=0.2", "rig.width=320", "rig.height=240", "pictures.frames=[]")
    answer = run_json(capsys, results, f"road_user={road_user}", *few)
    check(answer)
    assert answer["metrics"]["points_used_mean"] >= 1


def test_json_is_all_that_is_on_stdout_and_the_manifest_agrees(results, capsys):
    answer = run_json(capsys, results, *FEW)
    assert set(answer) == {"folder", "metrics", "verdict", "stages"}
    folder = results / answer["folder"].rpartition("/")[2]
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["stages"] == answer["stages"]
    assert json.loads((folder / "metrics.json").read_text()) == answer["metrics"]
