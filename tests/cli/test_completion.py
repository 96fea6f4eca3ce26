import pytest

from stixel_cli.cli.completion import complete_override
from stixel_cli.config.folders import group_options


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
    for name in ("COMP_WORDS", "COMP_CWORD", "_TYPER_COMPLETE_ARGS"):
        monkeypatch.delenv(name, raising=False)


def test_groups():
    assert complete_override("") == [f"{group}=" for group in group_options()]
    assert complete_override("ro") == ["road=", "road_user="]


def test_options_of_a_group():
    users = ["road_user=car", "road_user=cyclist", "road_user=pedestrian"]
    assert complete_override("road_user=") == users
    assert complete_override("road_u") == users
    assert complete_override("road_user=c") == users[:2]
    assert complete_override("nothing=") == []


def test_keys():
    offered = complete_override("rig.")
    assert "rig.width=" in offered
    assert "rig.kind=" not in offered
    assert complete_override("rig.wid") == ["rig.width=", "rig.width=640"]
    assert complete_override("renderer.light.sun_e")[0] == "renderer.light.sun_elevation="
    assert "seed=" in complete_override("se")


def test_keys_of_the_option_in_the_line(in_bash, monkeypatch):
    assert "path.points=" in in_bash("path", "=", "waypoints", "path.p")
    assert in_bash("path", "=", "nothing", "path.p") == []
    monkeypatch.delenv("COMP_WORDS")
    monkeypatch.setenv("_TYPER_COMPLETE_ARGS", "stixel run path=waypoints path.p")
    monkeypatch.delenv("COMP_CWORD")
    assert "path.points=" in complete_override("path.p")


def test_bash_takes_the_equals_sign_for_a_break(in_bash):
    assert in_bash("road_user", "=") == ["car", "cyclist", "pedestrian"]
    assert in_bash("road_user", "=", "c") == ["car", "cyclist"]
    assert in_bash("rig", "=", "kitti", "road_user", "=", "ped") == ["pedestrian"]
    assert in_bash("rig.width", "=") == ["640"]
    assert in_bash("path", "=", "turn", "") == [f"{group}=" for group in group_options()]


def test_no_folder_is_no_error(monkeypatch):
    def missing():
        raise OSError

    monkeypatch.setattr("stixel_cli.cli.completion.group_options", missing)
    assert complete_override("r") == []
