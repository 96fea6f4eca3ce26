"""Going on with a sweep: elsewhere, after changes, and in a folder that somebody else made."""

import json
import os
import shutil
from pathlib import Path

import pytest
import yaml
from result_folders import TETRAHEDRON

from stixel_cli.cli.app import main
from stixel_cli.engine.store import Store

FEW = ("measurement=fabricated", "path.duration=0.3")
TWO = (*FEW, "seed=0,1")
LOCAL = ("executor=local", "executor.workers=2", "executor.time_limit=100")


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """The folder of a sweep of two runs; not to be changed."""
    root = tmp_path_factory.mktemp("swept")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(root / "cache"))
        assert main(["sweep", *TWO, "--results", str(root), "--name", "mine"]) == 0
    return root / "mine"


@pytest.fixture
def folder(original, sweeps, monkeypatch):
    """A copy of it that lacks the second run, with the cache that it filled."""
    monkeypatch.setenv("STIXEL_CACHE", str(original.parent / "cache"))
    copy = Path(shutil.copytree(original, sweeps.results / "mine"))
    shutil.rmtree(copy / "runs" / "0001")
    return copy


def request_of(folder):
    return yaml.safe_load((folder / "sweep.yaml").read_text())


def test_another_executor_and_another_cache(sweeps, folder, tmp_path):
    before = request_of(folder)
    before["runs"] = [[*overrides, *LOCAL] for overrides in before["runs"]]
    (folder / "sweep.yaml").write_text(yaml.safe_dump(before))
    cache = tmp_path / "other"
    words = ["executor=threads", f"cache.folder={cache}"]
    again = sweeps.run("--resume", folder, *words, "--workers", "1")
    assert again["complete"]
    # The cache is empty, and the first run is in the folder.
    assert again["nodes"] == {"computed": 6, "cached": 0}
    config = yaml.safe_load((folder / "runs/0001/config.yaml").read_text())
    assert config["executor"] == {"kind": "threads", "workers": 1}
    manifest = json.loads((folder / "runs/0001/manifest.json").read_text())
    assert manifest["overrides"] == [*FEW, "seed=1", *words, "executor.workers=1"]
    request = request_of(folder)
    assert request["created"] == before["created"]
    assert request["runs"] == before["runs"]
    (entry,) = request["resumed"]
    assert entry.keys() == {"time", "command", "revision"}
    assert entry["command"].startswith(f"stixel sweep --resume {folder} executor=threads ")
    assert entry["revision"] == request["git"]["revision"]
    # Nothing is left to go on with.
    sweeps.run("--resume", folder)
    assert len(request_of(folder)["resumed"]) == 1
    shutil.rmtree(folder / "runs" / "0000")
    assert sweeps.run("--resume", folder, "executor.time_limit=50")["complete"]
    config = yaml.safe_load((folder / "runs/0000/config.yaml").read_text())
    assert config["executor"] == {"kind": "local", "workers": 2, "time_limit": 50.0}
    assert len(request_of(folder)["resumed"]) == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["seed=3"], "seed=3: --resume keeps the settings"),
        (["executor.workers=1,2"], "executor.workers=1,2: --resume: one value is needed"),
        (["executor=loacl"], "did you mean executor=local?"),
        (["executor.workers=1", "--workers", "2"], "executor.workers: is given twice"),
        (["executor.address=tcp://a:1"], "executor.address: unknown key"),
        (["--from", "prior_width"], "leave out --from"),
        (["--dry-run"], "leave out --dry-run"),
    ],
)
def test_resume_refuses_overrides_that_affect_results(sweeps, folder, words, said):
    before = request_of(folder)
    assert said in sweeps.refused("--resume", folder, *words)
    assert request_of(folder) == before


def test_nodes_are_counted_as_they_are_in_the_cache(sweeps, folder, tmp_path, monkeypatch):
    assert sweeps.run("--resume", folder)["nodes"] == {"computed": 0, "cached": 10}
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "empty"))
    assert sweeps.run("--resume", folder)["nodes"] == {"computed": 0, "cached": 0}


def test_relative_file_names_work_from_another_directory(sweeps, tmp_path, told, monkeypatch):
    there, here = tmp_path / "there", tmp_path / "here"
    there.mkdir()
    here.mkdir()
    (there / "mine.obj").write_text(TETRAHEDRON.format(1.5))
    (here / "mine.obj").write_text("another one, and no mesh")
    monkeypatch.chdir(there)
    given = ("road_user.mesh=mine.obj", "cache.folder=kept")
    whole = sweeps.run(*FEW, *given, "seed=0,1", "--name", "mine")
    folder = sweeps.results / "mine"
    shutil.rmtree(folder / "runs" / "0001")
    monkeypatch.chdir(here)
    monkeypatch.setenv("STIXEL_CACHE", str(there / "kept"))
    assert told("explain", folder) == "nothing to recompute: all results are cached\n"
    again = sweeps.run("--resume", folder)
    assert again["summary"] == whole["summary"]
    assert again["nodes"]["computed"] == 0
    assert sweeps.error == ""
    # What is typed now is meant here.
    shutil.rmtree(folder / "runs" / "0001")
    elsewhere = sweeps.run("--resume", folder, "cache.folder=other")
    assert elsewhere["nodes"]["computed"] > 0
    assert elsewhere["summary"] == whole["summary"]
    assert sorted(path.name for path in here.iterdir()) == ["mine.obj", "other"]


def test_a_changed_mesh_is_named_by_resume_and_verify(sweeps, tmp_path, told):
    mesh = tmp_path / "mine.obj"
    mesh.write_text(TETRAHEDRON.format(1.5))
    sweeps.run(*FEW, f"road_user.mesh=null,{mesh}", "--name", "mine")
    folder = sweeps.results / "mine"
    mesh.write_text(TETRAHEDRON.format(1.5).replace("v 2 1 0", "v 2.2 1 0"))
    found = json.loads(told("verify", folder / "runs/0001", "--cached", "--json", code=1))
    assert found["first_by_key"]["stage"] == "scenario"
    assert found["first_by_key"]["causes"] == ([f"the content of {mesh} changed"])
    assert found["first_by_value"]["stage"] == "scenario"
    again = sweeps.run("--resume", folder)
    assert again["complete"]
    assert "1 of 2 finished runs out of date" in sweeps.error
    sweeps.run("--resume", folder)
    assert sweeps.error == ""


def test_resume_counts_runs_of_changed_settings_and_keys(sweeps, monkeypatch):
    from stixel_cli.engine import keys

    sweeps.run(*FEW, "tracker.sigma_f=0.1,0.2", "--name", "mine")
    folder = sweeps.results / "mine"
    (folder / "runs" / "0000" / "lineage.json").unlink()
    file = folder / "sweep.yaml"
    # As if the option's file in conf/ had changed.
    file.write_text(file.read_text().replace("- tracker.sigma_f=0.2\n", "- tracker.sigma_f=0.3\n"))
    sweeps.run("--resume", folder)
    assert "1 of 2 finished runs out of date" in sweeps.error
    monkeypatch.setattr(keys, "LAYOUT", keys.LAYOUT + 1)
    sweeps.run("--resume", folder)
    assert "2 of 2 finished runs" in sweeps.error


def test_runs_refer_to_one_file_of_code(folder, sweeps):
    sweeps.run("--resume", folder)
    (code,) = (folder / "code").iterdir()
    for run in (folder / "runs").iterdir():
        lineage = json.loads((run / "lineage.json").read_text())
        assert lineage["code"] == code.stem
        assert all(digest for stage in lineage["stages"].values() for digest in stage["digests"])
        assert (run / "lineage.json").stat().st_size < 2500
    text = (folder / "runs/0000/lineage.json").read_text()
    for strange in ("../../../etc/passwd", "0" * 15, "Z" * 16):
        (folder / "runs/0000/lineage.json").write_text(text.replace(code.stem, strange))
        assert main(["verify", str(folder / "runs/0000"), "--cached"]) == 2


def test_an_interrupted_verify_keeps_nothing_and_says_so(original, capsys, monkeypatch):
    run = str(original / "runs/0000")

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("stixel_cli.experiment.stored.verify_run", interrupted)
    assert main(["verify", run]) == 130
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "--cached" in said
    assert main(["verify", run, "--cached"]) == 130
    assert "what was computed is kept" in capsys.readouterr().err


class _Payload:
    """Creates a folder when it is unpickled."""

    def __init__(self, mark: Path):
        self.mark = mark

    def __reduce__(self):
        return os.mkdir, (str(self.mark),)


@pytest.fixture
def foreign(sweeps, tmp_path):
    """A sweep with a cache in its folder: each result is a payload, one run is left to do."""
    folder = sweeps.results / "theirs"
    cache = f"cache.folder={tmp_path}/kept"
    sweeps.run(*FEW, "seed=0,1", cache, "executor=threads", "--name", "theirs")
    shutil.rmtree(folder / "runs" / "0001")
    (tmp_path / "kept").rename(folder / "kept")
    for file in (folder / "sweep.yaml", folder / "runs" / "0000" / "config.yaml"):
        file.write_text(file.read_text().replace(f"{tmp_path}/kept", f"{folder}/kept"))
    store = Store(folder / "kept")
    for entry in (folder / "kept").glob("??/*"):
        notes = store.meta(entry.name)
        for name in ("key", "size", "digest", "notes_digest"):
            notes.pop(name, None)
        shutil.rmtree(entry)
        store.save(entry.name, _Payload(tmp_path / "ran"), **notes)
    return folder


def test_a_foreign_folder_names_no_cache(foreign, tmp_path, capsys, told):
    commands = ["explain FOLDER", "explain RUN", "ls FOLDER", "report FOLDER --output OUT"]
    commands += ["report --play RUN --output OUT", "run RUN --results OUT", "verify RUN --cached"]
    commands += ["export RUN --format csv --output OUT", "sweep --resume FOLDER"]
    for number, command in enumerate(commands):
        places = {"FOLDER": foreign, "RUN": foreign / "runs/0000"}
        places["OUT"] = tmp_path / f"{number}.html"
        code = main([str(places.get(word, word)) for word in command.split()])
        said = capsys.readouterr()
        assert code == 0, f"{command}: {said.err}"
        assert not (tmp_path / "ran").exists(), command
        # This machine's cache is empty.
        assert number > 0 or said.out.startswith("ego_motion: new")
    # Nor is the machine's part an axis.
    file = foreign / "sweep.yaml"
    request = yaml.safe_load(file.read_text())
    file.write_text(yaml.safe_dump(request | {"axes": [["cache.folder"]]}))
    assert "axes: must be keys" in told("sweep", "--resume", foreign, code=2)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("command", ["sweep --resume FOLDER", "run FOLDER/runs/0000"])
def test_a_foreign_folder_names_no_scheduler(command, foreign, tmp_path, capsys):
    request = foreign / "sweep.yaml"
    given = "  - executor=dask\n  - executor.address=tcp://127.0.0.1:9\n"
    request.write_text(request.read_text().replace("  - executor=threads\n", given))
    assert given in request.read_text()
    config = foreign / "runs" / "0000" / "config.yaml"
    settings = yaml.safe_load(config.read_text())
    settings["executor"] |= {"kind": "dask", "time_limit": None, "address": "tcp://127.0.0.1:9"}
    config.write_text(yaml.safe_dump(settings))
    line = [*command.replace("FOLDER", str(foreign)).split(), "--results", str(tmp_path)]
    assert main(line) == 0, capsys.readouterr().err


def test_the_line_that_resumes_repeats_where_the_user_computes(sweeps, tmp_path, bad_mesh):
    cache = tmp_path / "mine"
    words = [f"cache.folder={cache}", "executor=threads", "executor.workers=1"]
    sweeps.run(*FEW, f"road_user.mesh=null,{bad_mesh}", *words, "--name", "mine", code=1)
    folder = sweeps.results / "mine"
    assert sweeps.error.endswith(f"stixel sweep --resume {folder} {' '.join(words)}\n")
    sweeps.run("--resume", folder, *words[:2], code=1)
    assert sweeps.error.endswith(f"stixel sweep --resume {folder} {' '.join(words[:2])}\n")
