"""Result folders of a run and of a sweep with one or two files damaged, read by every command."""

import random
from pathlib import Path

import pytest
from damage import damage, restore
from harness_of_fuzz import Answer, Kind, run_cases, settle

from stixel_cli.cli.app import main

SMALL = 40

TINY = ("measurement=fabricated", "path.duration=0.3", "executor=threads")
COMMANDS = (
    "show run",
    "show --json run",
    "explain run",
    "explain --json run",
    "compare run other",
    "compare --json run other",
    "report run other",
    "play run",
    "play run other",
    "rerun --json run",
    "verify --cached run",
    "verify --json --cached run",
    "verify run",
    "ls .",
    "ls --json .",
)
OF_A_SWEEP = (
    "show sweep",
    "show --json sweep",
    "explain sweep",
    "sweep --resume sweep",
    "sweep --json --resume sweep",
    "compare sweep/points/0000 other",
    "play sweep/points/0000",
    "verify --cached sweep/points/0000",
    "explain sweep/points/0000",
    "show sweep/points/0000",
    "rerun sweep/points/0000",
    "ls --json .",
)
NOT_READ = {"index.html", "errors.png", "errors.svg", "path.svg"}


@pytest.fixture(scope="module")
def folders(tmp_path_factory, shared_cache):
    """The folder of a run, another of a run, and of a sweep, all they hold in the cache."""
    place = tmp_path_factory.mktemp("folders")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(shared_cache))
        for seed, name in enumerate(("run", "other")):
            words = [*TINY, f"seed={seed}", "pictures.frames=[]"]
            assert main(["run", *words, "--results", str(place), "--name", name]) == 0
        words = [*TINY, "seed=0,1", "--results", str(place), "--name", "sweep"]
        assert main(["sweep", *words]) == 0
    return place


def draw_words(rng: random.Random, place: Path, original: Path) -> list[str]:
    """A command about a folder of which one or two files are damaged."""
    restore(place, original)
    name, commands = rng.choice((("run", COMMANDS), ("sweep", OF_A_SWEEP)))
    files = sorted(file for file in (place / name).rglob("*") if file.is_file())
    files = [
        file for file in files if file.name not in NOT_READ and "/points/0001/" not in str(file)
    ]
    for file in rng.sample(files, rng.choice((1, 1, 2))):
        damage(file, rng)
    return rng.choice(commands).split()


def unpickled(place: Path):
    """A check that nothing was unpickled."""

    def check(words: list[str], got: Answer) -> str:
        return "something was unpickled" if (place / "unpickled").exists() else ""

    return check


def test_each_is_answered(folders, tmp_path, monkeypatch):
    place = settle(monkeypatch, tmp_path)

    def make(rng, place):
        return draw_words(rng, place, folders)

    kind = Kind("damaged folder", make, place, unpickled(place), may_write=True)
    found = run_cases(kind, SMALL)
    assert not found, "\n".join(found)
