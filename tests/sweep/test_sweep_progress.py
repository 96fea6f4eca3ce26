"""What is shown of a sweep on its way."""

from runs_of import sweep_runs

from stixel_cli.engine.errors import StageFailure
from stixel_cli.engine.parameters import duration
from stixel_cli.sweeps.graphs import plan_runs
from stixel_cli.sweeps.run import SweepProgress


def test_runs_and_nodes_are_counted(capsys):
    line = ["measurement=fabricated", "seed=1,2,3"]
    waiting = plan_runs(sweep_runs(line)).runs
    complete = []
    progress = SweepProgress(waiting, lambda run, seconds: complete.append(run), 2)
    progress.expect({"track": 4.0}, workers=2)
    tracks = [one.graph.of_stage("track")[0] for one in waiting]
    scores = [one.graph.nodes[one.targets[0]] for one in waiting]
    progress.begin([*tracks, *scores[:2]], cached=7)
    # The scores of the third are there: it waits for nothing.
    assert complete == [waiting[2]]
    assert progress.text == "about 10 s left; 0/5 nodes; 3/5 runs; 7 nodes cached"
    progress.started(tracks[0])
    progress.finished(tracks[0], 2.0)
    progress.started(scores[0])
    progress.finished(scores[0], 1.0)
    assert complete == [waiting[2], waiting[0]]
    progress.failed(tracks[1], StageFailure("track", "track", ValueError("a\nb"), ""), [scores[1]])
    assert progress.runs_failed == 1
    assert progress.text == (
        "about 1 s left; 2/3 nodes, 1 failed; 4/5 runs, 1 failed; 7 nodes cached"
    )
    assert capsys.readouterr().err == "stixel: failed: track: ValueError: a b\n"
    progress.close()


def test_the_end_of_a_sweep_is_prepared_once_after_its_first_nodes_started():
    waiting = plan_runs(sweep_runs(["measurement=fabricated", "seed=1,2"])).runs
    calls = []
    progress = SweepProgress(waiting, lambda *_: None, prepare=lambda: calls.append("now"))
    progress.begin([one.graph.nodes[one.targets[0]] for one in waiting], cached=0)
    progress.started(waiting[0].graph.nodes[waiting[0].targets[0]])
    assert calls == []
    progress.tick()
    progress.tick()
    assert calls == ["now"]


def test_times_in_words():
    assert [duration(s) for s in (0.2, 80, 600, 12_000)] == ["1 s", "80 s", "10 min", "3 h 20 min"]
