"""Folders of a run, a sweep and a study with one or two files damaged, read by every command."""

import random
from functools import partial
from pathlib import Path

import pytest
from damage import damage, restore
from harness_of_fuzz import Answer, Kind, no_computing, run_cases, settle

from stixel_cli.cli.app import main

SMALL = 30

TINY = ("measurement=fabricated", "path.duration=0.3", "executor=threads")
COMMANDS = (
    "ls run", "ls --json run", "explain run", "explain --json run", "ls run other",
    "ls --json run other", "report run other", "report --play run", "report --play run other",
    "run --json run", "verify --cached run", "verify --json --cached run", "verify run", "ls .",
    "ls --json .",
)  # fmt: skip
OF_A_SWEEP = (
    "ls sweep", "ls --json sweep", "explain sweep", "sweep --resume sweep",
    "sweep --json --resume sweep", "ls sweep/runs/0000 other", "report --play sweep/runs/0000",
    "verify --cached sweep/runs/0000", "explain sweep/runs/0000", "ls sweep/runs/0000",
    "run sweep/runs/0000", "ls --json .",
)  # fmt: skip
DRY = "sweep --dry-run --from axes.yaml"
OF_A_FILE = ("explain --from axes.yaml", DRY, f"{DRY} road_user=car,pedestrian")
AXES = """\
fixed: {measurement: fabricated, path.duration: 0.3}
axes:
  tracker.length_scale: [0.2, 0.4]
  start.velocity: range(1,3)
zipped:
  - path: [turn, circle]
    rig.width: [320, 640]
seeds: 2
leave_out:
  - {path: turn, start.velocity: 1}
"""
OF_A_STUDY = (
    "study --dry-run small.yaml", "study --dry-run --results . small.yaml",
    "study --results . small.yaml", "study --json --results . small.yaml",
    "study --fresh --results . small.yaml", "ls small/sweeps/first", "explain small/sweeps/first",
    "sweep --resume small/sweeps/first", "ls --json small",
)  # fmt: skip
STUDY = """\
title: A small study
question: Which?
text: "IoU: {widths}."
sweeps:
  first:
    fixed: {measurement: fabricated, path.duration: 0.3, executor: threads}
    axes: {tracker.sigma_f: [0.7, 0.8]}
    seeds: 2
  second:
    zipped: [{path: [turn, circle], road_user: [car, cyclist]}]
questions:
  widths: {sweeps: first, compare: tracker.sigma_f, metrics: [iou_mean], reference: "0.7"}
"""
READ_MOST = ("config.yaml", "manifest.json", "metrics.json", "scores.npz", "lineage.json")
READ_MOST_OF_A_STUDY = ("small.yaml", "small.yaml", "small/study.yaml", "small/sweeps/*/*.*")
READ_MOST_OF_A_SWEEP = ("sweep.yaml", "sweep.yaml", "runs.csv", "summary.md", "code/*.json")


@pytest.fixture(scope="module")
def folders(tmp_path_factory, shared_cache):
    """Folders of two runs, a sweep and a study; all but the study's runs are in the cache."""
    place = tmp_path_factory.mktemp("folders")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(shared_cache))
        for seed, name in enumerate(("run", "other")):
            words = [*TINY, f"seed={seed}", "pictures.frames=[]"]
            assert main(["run", *words, "--results", str(place), "--name", name]) == 0
        words = [*TINY, "seed=0,1", "--results", str(place), "--name", "sweep"]
        assert main(["sweep", *words]) == 0
        (place / "axes.yaml").write_text(AXES, encoding="utf-8")
        (place / "small.yaml").write_text(STUDY, encoding="utf-8")
        no_computing(patch)
        assert main(["study", str(place / "small.yaml"), "--results", str(place)]) == 2
        assert (place / "small/sweeps/first/sweep.yaml").is_file()
    return place


def draw_words(rng: random.Random, place: Path, original: Path) -> list[str]:
    """A command about a folder of which one or two files are damaged."""
    restore(place, original)
    how = rng.random()
    if how < 0.1:
        damage(place / "axes.yaml", rng)
        return rng.choice(OF_A_FILE).split()
    if how < 0.2:
        files = [f for name in READ_MOST_OF_A_STUDY for f in sorted(place.glob(name))]
        damage(rng.choice(files), rng)
        return rng.choice(OF_A_STUDY).split()
    folder, commands = (place / "run", COMMANDS) if how < 0.6 else (place / "sweep", OF_A_SWEEP)
    if rng.random() < 0.2:
        # Pictures and tables, which few commands read.
        files = sorted(file for file in folder.rglob("*") if file.is_file())
    elif folder.name == "run":
        files = [folder / name for name in READ_MOST]
    else:
        files = [one for name in READ_MOST_OF_A_SWEEP for one in sorted(folder.glob(name))]
        files += [folder / "runs" / "0000" / name for name in READ_MOST]
    for file in dict.fromkeys(rng.choices(files, k=rng.choice((1, 1, 2)))):
        damage(file, rng)
    return rng.choice(commands).split()


def test_each_is_answered(folders, tmp_path, monkeypatch):
    place = settle(monkeypatch, tmp_path)

    def unpickled(words: list[str], got: Answer) -> str:
        return "something was unpickled" if (place / "unpickled").exists() else ""

    make = partial(draw_words, original=folders)
    run_cases(Kind("damaged folder", make, place, unpickled, may_write=True), SMALL)
