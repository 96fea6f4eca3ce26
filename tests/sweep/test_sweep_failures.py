"""Sweeps on their way: what is shown, what fails, Ctrl-C, what is gone; and going on."""

import json
import shutil
from pathlib import Path

import pytest
import yaml
from result_folders import TETRAHEDRON
from runs_of import sweep_runs

from stixel_cli import sweep
from stixel_cli.engine.cache_folder import make_folder
from stixel_cli.engine.errors import CacheError, MissingEntry, StageFailure
from stixel_cli.engine.parameters import duration
from stixel_cli.sweeps.folder import SweepRequest
from stixel_cli.sweeps.graphs import plan_runs
from stixel_cli.sweeps.run import Sweep

FEW = ("measurement=fabricated", "path.duration=0.3")
STATISTICS = ("summary.csv", "summary.md", "index.html")


def test_a_result_that_is_gone_after_its_computation_is_one_line(tmp_path, monkeypatch):
    def take(*_):
        raise MissingEntry("a" * 64, "was removed")

    monkeypatch.setattr("stixel_cli.sweeps.run.Sweep.take", take)
    with pytest.raises(CacheError, match="aaaaaaaaaaaa: was removed; resume with: stixel sweep"):
        sweep([*FEW, "seed=0,1"], results=tmp_path / "results", cache=tmp_path / "cache")


def test_a_failing_run_stops_no_other_and_resume_retries_it(sweeps, bad_mesh):
    axes = (f"road_user.mesh=null,{bad_mesh}", "seed=0,1", "tracker.sigma_q=0.5,0.6")
    swept = sweeps.run(*FEW, *axes, "--name", "mine", code=1)
    folder = sweeps.results / "mine"
    # The mesh is a scenario, not an option; a failed run counts as lost.
    found = {row["tracker.sigma_q"]: row for row in swept["summary"]}
    assert not swept["complete"] and {*found} == {"0.5", "0.6"}
    assert found["0.5"]["lost_share"] == 0.5 and found["0.5"]["failed"] == 2
    statuses = [row["status"] for row in swept["runs"]]
    assert statuses == ["done"] * 4 + ["failed"] + ["skipped"] * 3
    assert sweeps.error.splitlines()[-1] == f"stixel sweep --resume {folder}"
    assert "4 of 8 runs are not done" in sweeps.error and "run 4 failed" in sweeps.error
    assert "failed" in (folder / "summary.md").read_text()
    failed = folder / swept["runs"][4]["folder"]
    assert failed == folder / "failed" / "0004"
    failure = json.loads((failed / "failure.json").read_text())
    assert failure["stage"] == swept["runs"][4]["failed_stage"] == "scenario"
    assert failure["status"] == "failed"
    assert json.loads((folder / "failed/0005/failure.json").read_text())["failed_in_run"] == 4
    assert "Traceback" in (failed / "traceback.txt").read_text()
    config = yaml.safe_load((failed / "config.yaml").read_text())
    assert config["road_user"]["mesh"] == str(bad_mesh)
    # Nothing has changed: it fails again, and the rest is not looked at.
    again = sweeps.run("--resume", folder, code=1)
    assert [row["status"] for row in again["runs"]] == statuses
    assert again["nodes"]["computed"] == 0
    bad_mesh.write_text(TETRAHEDRON.format(1.5), encoding="utf-8")
    mended = sweeps.run("--resume", folder)
    assert mended["complete"]
    assert mended["runs"][:4] == swept["runs"][:4]
    assert mended["nodes"]["computed"] == 1 + 4 + 4 + 2 * 2
    assert not (folder / "failed").exists()
    assert {path.name for path in folder.iterdir()} >= {*STATISTICS}
    assert sweeps.run("--resume", folder)["nodes"]["computed"] == 0


def test_resume_recomputes_removed_and_damaged_runs(sweeps):
    first = sweeps.run(*FEW, "seed=0,1,2", "--name", "mine")
    folder = sweeps.results / "mine"
    shutil.rmtree(folder / "runs" / "0001")
    (folder / "runs" / "0002" / "metrics.json").write_text("{")
    (folder / "runs" / ".0000.partial-1").mkdir()
    (folder / "runs.csv").unlink()
    again = sweeps.run("--resume", folder, "--workers", "1")
    for one, other in zip(again["runs"], first["runs"], strict=True):
        # The workers of the second are among its overrides, and change nothing.
        assert one | {"overrides": other["overrides"]} == other
    assert again["nodes"]["computed"] == 0
    assert sorted(path.name for path in (folder / "runs").iterdir()) == ["0000", "0001", "0002"]


def test_ctrl_c_names_the_command_that_resumes(sweeps, monkeypatch):
    """That a signal in the midst of waiting ends it and its workers: `tests/engine`."""
    take = Sweep.take

    def interrupted(sweep, planned):
        take(sweep, planned)
        if len(sweep.runs) == 2:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Sweep, "take", interrupted)
        line = (*FEW, "seed=range(0,4)", "--workers", 2, "--name", "mine")
        assert sweeps.run(*line, code=130) is None
    folder = sweeps.results / "mine"
    said = sweeps.messages[-1]
    assert said.startswith("stixel: interrupted: 2 of 4 runs are done; ")
    assert said.endswith(f"resume with: stixel sweep --resume {folder} executor.workers=2")
    assert "Traceback" not in sweeps.error
    assert sorted(row["status"] for row in sweeps.rows("mine")) == ["done"] * 2 + ["missing"] * 2
    again = sweeps.run("--resume", folder)
    assert again["complete"] and again["nodes"]["computed"] <= 2 * 4


def test_an_unwritable_folder_ends_the_sweep_in_one_line(sweeps, monkeypatch):
    rename = Path.rename

    def full(path, target):
        if path.parent.name == "runs":
            raise OSError(28, "No space left on device")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", full)
    assert sweeps.run(*FEW, "seed=0,1", "--name", "mine", code=2) is None
    # Lines of progress may stand before it, where the machine is busy.
    last = sweeps.error.splitlines()[-1]
    assert "cannot be written: No space left on device; resume with: stixel sweep" in last
    assert "Traceback" not in sweeps.error
    assert list((sweeps.results / "mine/runs").iterdir()) == []


def test_a_full_disk_leaves_no_empty_folder(sweeps, monkeypatch):
    make_folder(sweeps.results.parent / "cache", "tmp")

    def full(folder, files, **_):
        folder.mkdir(parents=True, exist_ok=True)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("stixel_cli.results.folder.write_below", full)
    said = sweeps.refused(*FEW, "seed=0,1", "--name", "mine")
    assert said.endswith("mine: cannot be written: No space left on device\n")
    monkeypatch.undo()
    assert not (sweeps.results / "mine").exists()


def test_fail_fast_stops_at_the_first_failed_run(sweeps, bad_mesh):
    axes = (f"road_user.mesh={bad_mesh},null", "seed=0,1", "executor=threads", "--workers", 1)
    swept = sweeps.run(*FEW, *axes, "--fail-fast", "--name", "mine", code=1)
    assert [row["status"] for row in swept["runs"]] == ["failed"] + ["missing"] * 3
    assert sweeps.error.splitlines()[-1].startswith("stixel sweep --resume")
    bad_mesh.write_text(TETRAHEDRON.format(1.5), encoding="utf-8")
    assert sweeps.run("--resume", sweeps.results / "mine", "--fail-fast")["complete"]


REQUEST = SweepRequest("", False, (), (("seed",),), (), {"command": ""})


def sweep_of(seeds):
    plan = plan_runs(sweep_runs(["measurement=fabricated", f"seed={seeds}"]))
    return Sweep(plan, None, REQUEST)


def test_runs_and_nodes_are_counted(capsys, monkeypatch):
    monkeypatch.setattr(Sweep, "take", lambda self, run: self.runs.update({run.index: run}))
    sweep = sweep_of("1,2,3,4,5")
    before, waiting = sweep.plan.runs[:2], sweep.plan.runs[2:]
    sweep.runs.update({run.index: run for run in before})
    sweep.wait_for(waiting)
    sweep.known, sweep.workers = {"track": 4.0}, 2
    tracks = [one.graph.of_stage("track")[0] for one in waiting]
    scores = [one.graph.nodes[one.targets[0]] for one in waiting]
    sweep.begin([*tracks, *scores[:2]], cached=7)
    # The scores of the last one are there: it waits for nothing.
    assert [*sweep.runs.values()] == [*before, waiting[2]]
    assert sweep.text == "0/5 nodes; 3/5 runs; 7 nodes cached"
    sweep.started(tracks[0])
    sweep.finished(tracks[0], 2.0)
    sweep.started(scores[0])
    sweep.finished(scores[0], 1.0)
    assert [*sweep.runs.values()] == [*before, waiting[2], waiting[0]]
    sweep.failed(tracks[1], StageFailure("track", "track", ValueError("a\nb"), ""), [scores[1]])
    assert sweep.text == "about 2 s left; 2/3 nodes, 1 failed; 4/5 runs, 1 failed; 7 nodes cached"
    assert capsys.readouterr().err == "stixel: failed: run 3 (seed=4): track: ValueError: a b\n"
    sweep.close()


def test_the_end_of_a_sweep_is_prepared_once_after_its_first_nodes_started(monkeypatch):
    calls = []
    monkeypatch.setattr("stixel_cli.sweeps.run.import_module", calls.append)
    sweep = sweep_of("1,2")
    scores = [one.graph.nodes[one.targets[0]] for one in sweep.plan.runs]
    sweep.wait_for(sweep.plan.runs)
    sweep.begin(scores, cached=0)
    sweep.started(scores[0])
    assert calls == []
    sweep.tick()
    sweep.tick()
    assert calls == ["stixel_cli.answers.runs"]


def test_times_in_words():
    assert [duration(s) for s in (0.2, 80, 600, 12_000)] == ["1 s", "80 s", "10 min", "3 h 20 min"]
    assert [duration(86_400 * days) for days in (1, 7)] == ["24 h 0 min", "7 d"]
