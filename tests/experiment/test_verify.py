"""`stixel run FOLDER` and `verify`: what is the same, what differs, and folders to distrust."""

import dataclasses
import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from stixel_cli import __version__
from stixel_cli.cli.app import main
from stixel_cli.results.lineage import first_difference

pytestmark = pytest.mark.drawn

# A seed of its own: a `sketched` test of the same run leaves empty pictures in the cache.
FABRICATED = ("measurement=fabricated", "path.duration=0.5", "pictures.frames=[0]", "seed=78")
REPEATED = ("metrics.json", "scans.csv", "scans.npz", "track.csv", "track.npz", "scores.npz")


@pytest.fixture(scope="module")
def original(tmp_path_factory, shared_cache):
    """A result folder; not to be changed."""
    folder = tmp_path_factory.mktemp("results") / "original"
    words = ["run", *FABRICATED, "--results", str(folder.parent), "--name", "original"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(shared_cache))
        assert main(words) == 0
    return folder


@pytest.fixture
def folder(original, tmp_path):
    """A copy of it, to be tampered with."""
    return Path(shutil.copytree(original, tmp_path / "copy"))


def verified(capsys, folder, *options):
    """Exit code and answer of `stixel verify`, with what is cached taken from there."""
    capsys.readouterr()
    code = main(["verify", str(folder), "--json", "--cached", *options])
    return code, json.loads(capsys.readouterr().out)


def refused(capsys, *words) -> str:
    """The one line with which a command refuses."""
    capsys.readouterr()
    assert main(list(words)) == 2
    out, error = capsys.readouterr()
    assert out == "" and error.count("\n") == 1 and "Traceback" not in error
    return error


def into(folder) -> tuple[str, str]:
    return ("--results", str(folder))


def edit_json(file, change):
    content = json.loads(file.read_text())
    change(content)
    file.write_text(json.dumps(content))


def test_a_rerun_gives_the_same_bytes(folder, tmp_path, told, monkeypatch):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "empty"))
    answer = json.loads(told("run", folder, *into(tmp_path), "--name", "again", "--json"))
    again = tmp_path / "again"
    assert answer["folder"] == str(again)
    assert answer["metrics"] == json.loads((folder / "metrics.json").read_text())
    assert {stage["status"] for stage in answer["stages"]} == {"computed"}
    for file in (*REPEATED, "config.yaml", "lineage.json", "figures/path.png"):
        assert (folder / file).read_bytes() == (again / file).read_bytes(), file
    manifest = json.loads((again / "manifest.json").read_text())
    assert manifest["rerun_of"] == str(folder)
    assert manifest["command"] == f"stixel run {folder}"
    assert manifest["choices"]["measurement"] == "fabricated"


def test_a_folder_is_known_by_its_files_where_its_name_has_an_equals_sign(
    folder, capsys, told, tmp_path, monkeypatch
):
    named = folder.rename(tmp_path / "rig=kitti")
    monkeypatch.chdir(tmp_path)
    for words in (["run", named.name, "--name", "again"], ["run", "--dry-run", str(named)]):
        assert main(words) == 0
    assert json.loads(Path("results/again/manifest.json").read_text())["rerun_of"] == named.name
    assert main(["explain", named.name]) == 0
    said = refused(capsys, "run", named.name, "seed=1")
    assert "name either one result folder or overrides" in said
    (named / "manifest.json").unlink()
    said = told("run", "--dry-run", "--json", named.name)
    assert json.loads(said)["config"]["rig"]["width"] == 1242


def test_a_rerun_s_name_follows_the_folder_s(folder, capsys, tmp_path):
    assert main(["run", str(folder), *into(tmp_path), "--workers", "1"]) == 0
    (again,) = folder.parent.glob("copy-rerun-*")
    assert json.loads((again / "manifest.json").read_text())["workers"] == 1


def test_an_untouched_folder_is_identical_computed_anew(folder, told, tmp_path, monkeypatch):
    # There is no cache, and none is made.
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "missing"))
    found = json.loads(told("verify", folder, "--json"))
    assert found["identical"] and found["files_compared"] >= 8
    assert found["first_by_key"] is found["first_by_value"] is None
    assert {stage["status"] for stage in found["stages"]} == {"computed"}
    assert not (tmp_path / "missing").exists()


def test_text_for_the_eye(folder, told):
    assert told("verify", folder, "--cached").startswith("identical: ")
    edit_json(folder / "metrics.json", lambda metrics: metrics.update(iou_mean=0.5))
    said = told("verify", folder, "--cached", code=1)
    assert said.startswith("differs: 1 of ")
    assert "  metrics.json: iou_mean: 0.5 became 0." in said
    assert "metrics.json was altered after the run" in said


def test_altered_arrays_are_named_with_the_amount(folder, capsys):
    with np.load(folder / "track.npz") as arrays:
        track = dict(arrays)
    track["means"][2, 0] += 0.25
    np.savez(folder / "track.npz", **track)
    code, found = verified(capsys, folder)
    first = found["first_by_value"]
    assert (code, first["stage"]) == (1, "track")
    assert [file["file"] for file in found["files"]] == ["track.npz"]
    assert "means: 1 of" in first["what"] and "by up to 0.25" in first["what"]
    assert "altered after the run" in first["causes"][0]


def test_an_altered_configuration_is_seen_by_the_keys(folder, capsys):
    config = yaml.safe_load((folder / "config.yaml").read_text())
    config["tracker"]["sigma_f"] *= 2
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    code, found = verified(capsys, folder)
    by_key, by_value = found["first_by_key"], found["first_by_value"]
    assert (code, by_key["stage"], by_value["stage"]) == (1, "track", "track")
    # The result of the old run is cached, so by how much it differs is told.
    assert "by up to" in by_value["what"]
    assert "config.yaml" in by_key["causes"][0] and by_value["causes"] == by_key["causes"]


def test_changed_versions_and_revision_are_told_and_an_altered_picture_differs(folder, capsys):
    git = {"revision": "0" * 40, "dirty": False}
    edit_json(folder / "manifest.json", lambda one: one["versions"].update(numpy="1.0"))
    edit_json(folder / "manifest.json", lambda one: one.update(git=git))
    code, found = verified(capsys, folder)
    assert code == 0
    assert f"numpy 1.0 → {np.__version__}" in found["changes"]
    assert any(change.startswith("git revision 000000000000 → ") for change in found["changes"])
    (folder / "figures" / "path.png").write_bytes(b"no picture")
    code, found = verified(capsys, folder)
    assert code == 1
    assert [file["file"] for file in found["files"]] == ["figures/path.png"]


def test_a_folder_of_an_older_version(folder, capsys, told, tmp_path):
    """It says nothing of executor, cache and lineage, and can be run and compared all the same."""
    config = yaml.safe_load((folder / "config.yaml").read_text())
    del config["executor"], config["cache"]
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    (folder / "lineage.json").unlink()
    (folder / "manifest.json").write_text('{"versions": {"stixel": "0.0.1"}}')
    code, found = verified(capsys, folder)
    assert code == 0
    assert f"stixel 0.0.1 → {__version__}" in found["changes"]
    assert main(["run", str(folder), *into(tmp_path), "--name", "again"]) == 0
    said = told("verify", folder, "--cached")
    assert "the keys of the stages are unknown: lineage.json is missing" in said
    del config["tracker"]["sigma_f"]
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    said = refused(capsys, "verify", str(folder))
    assert "tracker.sigma_f: is missing" in said
    assert f"made by stixel 0.0.1, this is {__version__}" in said


def test_a_small_folder_is_compared_by_its_files(folder, capsys):
    for name in ("scans.npz", "track.npz", "truth.npz"):
        (folder / name).unlink()
    shutil.rmtree(folder / "figures")
    code, found = verified(capsys, folder)
    assert (code, found["files_compared"]) == (0, 3)


class Trap:
    """Leaves a mark if it is unpickled."""

    def __reduce__(self):
        return (os.mkdir, ("unpickled",))


def _pickled_track(folder):
    np.savez(folder / "track.npz", means=np.array([Trap()], dtype=object))


def _strange_key(folder):
    strange = {"keys": ["../../../etc"]}
    edit_json(folder / "lineage.json", lambda lineage: lineage["stages"]["track"].update(strange))


@pytest.mark.parametrize(
    ("tamper", "said"),
    [
        (_pickled_track, "track.npz: not a file of numeric arrays"),
        (_strange_key, "lineage.json: not a valid lineage of a run"),
    ],
)
def test_folders_to_distrust(tamper, said, folder, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tamper(folder)
    assert said in refused(capsys, "verify", str(folder), "--cached")
    assert not (tmp_path / "unpickled").exists()


def test_a_place_that_cannot_be_written(folder, capsys, monkeypatch):
    def read_only(self, *_, **__):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(Path, "mkdir", read_only)
    said = refused(capsys, "run", str(folder), *into(folder.parent / "new"))
    assert "Read-only file system" in said
    monkeypatch.undo()
    monkeypatch.setattr("tempfile.mkdtemp", read_only)
    assert "Read-only file system" in refused(capsys, "verify", str(folder))


@dataclasses.dataclass(frozen=True)
class Noun:
    values: np.ndarray
    name: str = "a"


def test_what_is_the_same():
    values = np.array([1.0, np.nan, -0.0])
    for one in (Noun(values), {"a": values}, [values], 3, float("nan"), b"x", None):
        assert first_difference(one, one) is None
    assert first_difference(Noun(values), Noun(values.copy())) is None
    assert first_difference(float("nan"), float("nan")) is None


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (np.zeros(3), np.array([0.0, 0.5, -2.0]), "2 of 3 values differ, by up to 2"),
        (np.zeros(3), np.zeros(4), "its shape (3,) became (4,)"),
        (np.zeros(3), np.zeros(3, np.float32), "its type float64 became float32"),
        (np.zeros(1), np.array([np.nan]), "1 of 1 values differ, not finite"),
        (np.zeros(1), np.array([-0.0]), "zeros of other signs"),
        (np.array([True]), np.array([False]), "1 of 1 values differ, by up to 1"),
        (np.array([0], np.uint8), np.array([255], np.uint8), "by up to 255"),
        (Noun(np.zeros(2)), Noun(np.ones(2)), "values: 2 of 2 values differ, by up to 1"),
        (Noun(np.zeros(1)), Noun(np.zeros(1), "b"), "name: 'a' became 'b'"),
        ({"a": 1}, {"b": 1}, "a is in only one of the two"),
        ([1, [2, 3]], [1, [2, 4]], "1.1: 3 became 4"),
        (1, 1.0, "a int became a float"),
        (b"one", b"two", "other bytes"),
    ],
)
def test_what_differs(old, new, said):
    assert said in first_difference(old, new)
    assert first_difference(old, new, "it").startswith("it")
