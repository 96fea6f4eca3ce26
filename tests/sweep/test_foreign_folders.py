"""A folder that somebody else made never says where to compute: no cache, no scheduler of its own.

A cache holds pickles, which run code when they are loaded; a scheduler gets the code of every node.
"""

import os
import shutil
from pathlib import Path

import pytest
import yaml

from stixel_cli.cli.app import main
from stixel_cli.engine.store import Store

FEW = ("measurement=fabricated", "path.duration=0.3")


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


def test_a_foreign_folder_names_no_cache(foreign, tmp_path, capsys):
    for number, command in enumerate(
        (
            "explain FOLDER",
            "explain FOLDER/runs/0000",
            "ls FOLDER",
            "report FOLDER --output OUT",
            "report --play FOLDER/runs/0000 --output OUT",
            "run FOLDER/runs/0000 --results OUT",
            "verify FOLDER/runs/0000 --cached",
            "export FOLDER/runs/0000 --format csv --output OUT",
            "sweep --resume FOLDER",
        )
    ):
        out = str(tmp_path / f"out{number}.html")
        line = [w.replace("FOLDER", str(foreign)).replace("OUT", out) for w in command.split()]
        code = main(line)
        said = capsys.readouterr()
        assert code == 0, f"{command}: {said.err}"
        assert not (tmp_path / "ran").exists(), command
        # This machine's cache is empty.
        assert number > 0 or said.out.startswith("ego_motion: new")
    # Nor is the machine's part an axis.
    file = foreign / "sweep.yaml"
    request = yaml.safe_load(file.read_text())
    file.write_text(yaml.safe_dump(request | {"axes": [["cache.folder"]]}))
    assert main(["sweep", "--resume", str(foreign)]) == 2
    assert "axes: must be keys" in capsys.readouterr().err
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
