"""Every file of conf/ runs: the real command line, few frames."""

import json

import pytest
from run_cli import FEW, run_json

from stixel_cli.config.folders import group_options, outer_options
from stixel_cli.rendering.filament import probe_filament

PICTURED = {"renderer", "stereo", "road", "occupancy", "measurement", "measurement/noise"}
"""Groups whose options show in the pictures of a scan; paths are drawn in a test of their own."""

DRAWN = PICTURED | {"rig", "pictures", "tracker", "start", "experiment"}
"""Groups whose options show in any picture."""

SIZES = ("default", "long_range")
"""Rigs whose images are drawn, the smallest and the largest; all rigs have their whole size."""

PATHS = ("approach", "circle", "stop_and_go")
"""Paths that are drawn: towards the camera, round, and with a stop."""

OWN_PRESETS = {"road_user", "pace", "prior", "source"}
OF_FILES = {
    *(("measurement", "file"), ("path", "recorded"), ("tracker", "file")),
    *(("experiment", "lidarrm"), ("experiment", "pandaset")),
}
"""Presets that need files: `test_file_run.py`, tests/recordings, `test_robustness.py`."""

PRESETS = [
    (group, option)
    for group, options in group_options().items()
    for option in options
    if group not in OWN_PRESETS and (group, option) not in OF_FILES
]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return tmp_path_factory.mktemp("results")


def few_seconds(option: str) -> tuple[str, ...]:
    """What an option needs in a few frames: no time to close a circle, few points on the target."""
    return {"circle": ("path.radius=6",), "scans": ("measurement=fabricated",)}.get(option, ())


def check(answer: dict) -> None:
    assert answer["metrics"]["scans"] >= 2
    assert answer["metrics"]["centre_rmse_m"] is not None
    assert {stage["status"] for stage in answer["stages"]} <= {"computed", "cached"}


def preset(group, option):
    """With the marks of what its run needs: Filament has a process of its own."""
    drawn = group in DRAWN and (group != "rig" or option in SIZES)
    marks = [pytest.mark.drawn] if drawn else []
    if group == "executor" or option == "filament":
        marks.append(pytest.mark.workers)
    return pytest.param(group, option, marks=marks, id=f"{group}-{option}")


@pytest.mark.parametrize(("group", "option"), [preset(*one) for one in PRESETS])
def test_every_preset_runs(group, option, results, capsys):
    if option == "pyrecest":
        pytest.importorskip("pyrecest")
    few = FEW[:-1] if group != "rig" else ("path.duration=0.2",)
    pictured = group in PICTURED or (group == "rig" and option in SIZES)
    pictures = "pictures.frames=[1]" if pictured else "pictures.frames=[]"
    outer = group.rpartition("/")[0]
    around = (f"{outer}={outer_options(group)[0]}",) if outer else ()
    choice = (*few_seconds(option), *around, f"{group}={option}")
    try:
        check(run_json(capsys, results, *few, pictures, *choice))
    except AssertionError:
        reason = probe_filament(timeout=600) if option == "filament" else None
        if reason is None:
            raise
        pytest.skip(reason)


# Drawing takes longer than the rest.
@pytest.mark.parametrize(
    ("road_user", "path"),
    [
        pytest.param(
            name, path, marks=[pytest.mark.drawn] if name == "car" and path in PATHS else []
        )
        for name in group_options()["road_user"]
        for group, path in PRESETS
        if group == "path"
    ],
)
def test_every_road_user_runs_every_path_with_fabricated_measurements(
    road_user, path, results, capsys
):
    choice = (f"road_user={road_user}", f"path={path}", "measurement=fabricated")
    choice += few_seconds(path)
    answer = run_json(capsys, results, *choice, "path.duration=0.5", "pictures.frames=[2]")
    check(answer)
    assert answer["metrics"]["points_per_scan_mean"] > 1


@pytest.mark.drawn
@pytest.mark.parametrize("road_user", group_options()["road_user"])
def test_every_road_user_is_rendered_and_measured(road_user, results, capsys):
    few = ("path.duration=0.2", "pictures.frames=[1]")
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
