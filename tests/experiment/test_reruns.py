"""What would be computed again, and what not: real stages, real command line, edited code."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from stixel_cli.config.compose import compose
from stixel_cli.experiment.stages import experiment_graph

ROOT = Path(__file__).resolve().parents[2]
AFTER_SCANS = {"track", "scores", "track_pictures", "run_pictures"}


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of the package whose files a test may edit."""
    folder = tmp_path_factory.mktemp("checkout")
    # Numba's compiled kernels go along, if there are any: it compiles anew what is edited.
    leave = shutil.ignore_patterns("*.pyc*", "*.tmp.*")
    for name in ("stixel_cli", "conf", "pipelines"):
        shutil.copytree(ROOT / name, folder / name, ignore=leave)
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def stixel(checkout: Path, *words: str, code: int = 0) -> subprocess.CompletedProcess:
    """A command line in `checkout`, which must end with `code`."""
    environment = os.environ | {
        "PYTHONPATH": str(checkout),
        "STIXEL_CACHE": str(checkout / "cache"),
    }
    done = subprocess.run(
        [sys.executable, "-m", "stixel_cli", *words],
        cwd=checkout,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == code, done.stderr + done.stdout
    return done


@pytest.fixture
def edited(checkout):
    """A function that edits a file of the checkout until the test is over."""
    originals = {}

    def edit(file: str, old: str, new: str) -> None:
        path = checkout / "stixel_cli" / file
        text = originals.setdefault(path, path.read_text(encoding="utf-8"))
        assert text.count(old) == 1, f"{file} has {text.count(old)} times {old!r}"
        path.write_text(text.replace(old, new), encoding="utf-8")

    yield edit
    for path, text in originals.items():
        path.write_text(text, encoding="utf-8")


def changed(*words):
    """The stages whose keys are others with `words`."""
    before, after = (experiment_graph(compose(line)) for line in ([], words))
    stages = [name for name in before.stages if before.of_stage(name)]
    return {one for one in stages if before.of_stage(one)[0].key != after.of_stage(one)[0].key}


def test_a_setting_recomputes_its_stage_and_what_depends_on_it():
    assert changed() == set()
    assert changed("tracker.sigma_q=0.7") == AFTER_SCANS


def test_the_seed_recomputes_what_draws_and_what_depends_on_it():
    again = changed("seed=5")
    assert {"add_sensor_noise", "match", "start", "track"} <= again
    assert again.isdisjoint({"scenario", "render", "ego_motion"})


def test_an_edit_is_named_by_verify_and_by_resume(checkout, edited):
    few = ("measurement=fabricated", "path.duration=0.3", "pictures.frames=[]", "executor=threads")
    stixel(checkout, "sweep", *few, "seed=0,1", "--name", "mine")
    transition = "def transition(interval: float) -> np.ndarray:"
    edited("tracking/motion.py", transition, f"UNUSED = 1\n\n\n{transition}")
    done = stixel(checkout, "verify", "results/mine/runs/0000", "--cached")
    assert "stixel_cli.tracking.motion was edited" in done.stdout
    edited("tracking/motion.py", transition, transition)

    edited("tracking/start.py", "generator(seed,", "generator(seed + 1,")
    run = checkout / "results/mine/runs/0001"
    found = json.loads(stixel(checkout, "verify", str(run), "--cached", "--json", code=1).stdout)
    assert found["first_by_key"]["stage"] == found["first_by_value"]["stage"] == "start"
    edit = "stixel_cli.tracking.start was edited"
    assert found["first_by_value"]["causes"] == [edit]
    assert "values differ, by up to" in found["first_by_value"]["what"]
    assert "metrics.json" in {file["file"] for file in found["files"]}
    # Outside its sweep's folder a run has keys but no code digests.
    alone = shutil.copytree(run, checkout / "alone" / "run")
    found = json.loads(stixel(checkout, "verify", str(alone), "--cached", "--json", code=1).stdout)
    assert found["first_by_value"]["stage"] == "start"
    assert found["first_by_value"]["causes"] == [
        "unknown code changes: the folder does not record its code"
    ]
    done = stixel(checkout, "sweep", "--resume", "results/mine")
    assert "2 of 2 finished runs" in done.stderr
