"""What is shown of a sweep on its way."""

from runs_of import sweep_runs

from stixel_cli.engine.errors import StageFailure
from stixel_cli.engine.parameters import duration
from stixel_cli.sweeps.folder import SweepRequest
from stixel_cli.sweeps.graphs import plan_runs
from stixel_cli.sweeps.run import Sweep

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
    sweep.expect({"track": 4.0}, workers=2)
    tracks = [one.graph.of_stage("track")[0] for one in waiting]
    scores = [one.graph.nodes[one.targets[0]] for one in waiting]
    sweep.begin([*tracks, *scores[:2]], cached=7)
    # The scores of the last one are there: it waits for nothing.
    assert [*sweep.runs.values()] == [*before, waiting[2]]
    assert sweep.text == "about 10 s left; 0/5 nodes; 3/5 runs; 7 nodes cached"
    sweep.started(tracks[0])
    sweep.finished(tracks[0], 2.0)
    sweep.started(scores[0])
    sweep.finished(scores[0], 1.0)
    assert [*sweep.runs.values()] == [*before, waiting[2], waiting[0]]
    sweep.failed(tracks[1], StageFailure("track", "track", ValueError("a\nb"), ""), [scores[1]])
    assert sweep.text == "about 1 s left; 2/3 nodes, 1 failed; 4/5 runs, 1 failed; 7 nodes cached"
    assert capsys.readouterr().err == "stixel: failed: track: ValueError: a b\n"
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
