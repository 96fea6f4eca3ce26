"""What `stixel describe` says of groups, options and keys, and what the shell completes."""

import json
import subprocess
import sys

import pytest

from stixel_cli.cli.app import main
from stixel_cli.cli.options import (
    complete_folder,
    complete_override,
    complete_run_or_override,
    complete_setting,
)
from stixel_cli.config.folders import group_options
from stixel_cli.config.keys import (
    describe_key,
    keys_of_option,
    known_keys,
    meaning_of_group,
    meaning_of_option,
)


def printed(capsys, *words):
    assert main(["describe", *words]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    return captured.out


TEXTS = {
    "tracker.sigma_f": [
        "standard deviation of the radius", "a number > 0 and ≤ 20", "0.1, from prior.sigma_f",
        "tracker=gp_ekf",
    ],
    "rig.width": ["default", "1242 (kitti)", "match"],
    "prior.sigma_f": ["tracker.sigma_f"],
    "start.rates": ["one of truth, zero"],
    "tracker": [*(f"tracker={one}" for one in group_options()["tracker"]), "read by",
                "Extended Kalman filter", "tracker.basis_points"],
    "stereo=bm": ["stereo.block_size"],
    "measurement/noise=stereo": ["measurement.noise.disparity_std"],
    "iou_mean": ["IoU of the outline, mean", "0 to 1", "better more", "iou_baseline of the same"],
    "nis_mean": ["near 1, as a factor", "below 0.33, above 3"],
    "track_lost": ["over runs track_loss_rate"],
}  # fmt: skip
"""Key, group, option or metric to what is said of it."""


@pytest.mark.parametrize("word", TEXTS)
def test_what_it_says(word, capsys):
    said = " ".join(printed(capsys, word).split())
    assert [text for text in TEXTS[word] if text not in said] == []
    assert word != "stereo=bm" or "stereo.disparities_at_full_size" not in said


def test_of_several_variants_the_default_comes_first_and_all_groups_are_listed(capsys):
    first, *others = describe_key("tracker.sigma_q")
    assert "tracker=gp_ekf" in first.belongs_to and others
    assert first.default == "1.5"
    said = printed(capsys)
    assert all(f"\n{group} " in said for group in group_options() if "/" not in group)
    assert "\nseed " in said


def test_every_group_option_and_key_has_a_meaning_and_a_value():
    """The schema's docstrings are the help: none may be missing."""
    for group, options in group_options().items():
        assert "/" in group or meaning_of_group(group), group
        for option in options:
            assert meaning_of_option(group, option), (group, option)
            for one in keys_of_option(group, option):
                assert one.meaning, one
    for name in known_keys():
        for one in describe_key(name):
            assert one.meaning and one.range, one
            assert one.values, one


USERS = list(group_options()["road_user"])


@pytest.fixture
def in_bash(monkeypatch):
    """What is offered at the end of a line that Bash has cut into words."""

    def offered(*words):
        monkeypatch.setenv("COMP_WORDS", "\n".join(("stixel", "run", *words)))
        monkeypatch.setenv("COMP_CWORD", str(len(words) + 1))
        return complete_override("" if words[-1] == "=" else words[-1])

    return offered


@pytest.fixture(autouse=True)
def _no_shell(monkeypatch):
    for name in ("COMP_WORDS", "COMP_CWORD", "_TYPER_COMPLETE_ARGS", "_STIXEL_COMPLETE"):
        monkeypatch.delenv(name, raising=False)


def test_groups_options_and_keys_are_completed():
    assert complete_override("") == [f"{group}=" for group in group_options()]
    assert complete_override("ro") == ["road=", "road_user="]
    users = [f"road_user={user}" for user in USERS]
    assert complete_override("road_user=") == users
    assert complete_override("road_u") == users
    assert complete_override("road_user=c") == users[:2]
    assert complete_override("nothing=") == []
    assert complete_setting("rig.wid") == ["rig.width"]
    offered = complete_override("rig.")
    assert "rig.width=" in offered
    assert "rig.kind=" not in offered
    assert complete_override("rig.wid") == ["rig.width=", "rig.width=640"]
    assert complete_override("rig.camera_h")[0] == "rig.camera_height="
    assert "seed=" in complete_override("se")


def test_keys_of_a_group_within_another_and_of_the_option_in_the_line(in_bash, monkeypatch):
    assert "measurement.noise.disparity_std=" in in_bash(
        "measurement", "=", "fabricated", "measurement."
    )
    line = ("measurement", "=", "fabricated", "measurement/noise", "=", "constant")
    assert in_bash(*line, "measurement.noise.") == [
        "measurement.noise.range_std=",
        "measurement.noise.range_std=0.1",
    ]
    assert "measurement/noise=constant" in complete_override("measurement/")
    assert "path.points=" in in_bash("path", "=", "waypoints", "path.p")
    assert in_bash("path", "=", "nothing", "path.p") == []
    monkeypatch.delenv("COMP_WORDS")
    monkeypatch.setenv("_TYPER_COMPLETE_ARGS", "stixel run path=waypoints path.p")
    monkeypatch.delenv("COMP_CWORD")
    assert "path.points=" in complete_override("path.p")


def test_further_values_of_a_sweep_and_where_bash_breaks_a_word(in_bash, monkeypatch):
    further = [f"car,{user}" for user in USERS if user != "car"]
    assert complete_override("road_user=car,") == [f"road_user={values}" for values in further]
    assert "road_user=car,cyclist,pedestrian" in complete_override("road_user=car,cyclist,")
    assert complete_override("road_user=car,c") == ["road_user=car,cyclist"]
    assert complete_override("seed=0,") == []
    monkeypatch.setenv("COMP_WORDS", "stixel sweep road_user = car,")
    monkeypatch.setenv("COMP_CWORD", "4")
    assert complete_override("car,") == further
    assert in_bash("road_user", "=") == USERS
    assert in_bash("road_user", "=", "c") == ["car", "cyclist"]
    assert in_bash("rig", "=", "kitti", "road_user", "=", "ped") == ["pedestrian"]
    assert in_bash("rig.width", "=") == ["640"]
    assert in_bash("path", "=", "turn", "") == [f"{group}=" for group in group_options()]


def test_result_folders(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for run in ("results/one", "results/other"):
        (tmp_path / run).mkdir(parents=True)
        (tmp_path / run / "manifest.json").touch()
    (tmp_path / "results" / ".hidden").mkdir()
    (tmp_path / "results" / "file").touch()
    (tmp_path / "else").mkdir()
    runs = ["results/one", "results/other"]
    assert complete_folder("") == ["else/", "results/", *runs]
    assert complete_folder("results/o") == runs
    assert complete_folder("res") == ["results/"]
    assert complete_folder("nowhere/") == []
    assert complete_folder(f"{tmp_path}/results/one") == [f"{tmp_path}/results/one"]
    assert "results/one" in complete_run_or_override("results/o")
    assert "road_user=car" in complete_run_or_override("road_u")


COMPLETES = """
import json, os, sys
from stixel_cli.cli.app import main
for line in json.loads(sys.argv.pop()):
    asked = {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split()) - 1)}
    os.environ |= asked | {"_STIXEL_COMPLETE": "complete_bash"}
    try:
        main()
    except SystemExit as answered:
        assert answered.code == 0
    print()
sys.exit([name for name in ("numpy", "hydra", "omegaconf", "yaml") if name in sys.modules] or 0)
"""


def test_the_shell_is_answered_without_heavy_imports(tmp_path):
    """As Bash asks: for commands, for overrides of `sweep`, for folders."""
    (tmp_path / "results").mkdir()
    offered = {
        "stixel ex": "explain",
        "stixel cache ve": "verify",
        "stixel sweep road_user=car,c": "cyclist",
        "stixel ls resul": "results/",
        "stixel run --wor": "--workers",
    }
    command = [sys.executable, "-c", COMPLETES, json.dumps([*offered])]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    answers = dict(zip(offered, done.stdout.split("\n\n"), strict=False))
    assert [line for line, word in offered.items() if word not in answers[line]] == []


def test_formats_of_export_and_that_no_folder_is_no_error(monkeypatch):
    from typer.main import get_command

    from stixel_cli.cli.app import application
    from stixel_cli.export.export import FORMATS

    (option,) = (
        p for p in get_command(application("")).commands["export"].params if p.name == "format"
    )
    offered = [item.value for item in option.shell_complete(None, "")]
    assert offered == [*FORMATS, "mlflow"]
    assert [item.value for item in option.shell_complete(None, "k")] == ["kitti"]

    def missing():
        raise OSError

    monkeypatch.setattr("stixel_cli.config.folders.group_options", missing)
    assert complete_override("r") == []
