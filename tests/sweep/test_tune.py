"""`stixel tune`, by the real command."""

import json
from pathlib import Path

import pytest
import yaml

from stixel_cli.cli.app import main
from stixel_cli.errors import Interrupted
from stixel_cli.sweeps import tuning

FEW = ["measurement=fabricated", "path.duration=0.3", "executor=threads"]
TUNED = [*FEW, "tracker.sigma_q=tag(log,interval(0.1,10))", "tracker.basis_points=interval(10,50)"]
TUNED += ["prior.length=4.52,1.0", "path=turn,s_curve", "road_user.shape_seed=1000"]
OPTIONS = ["--over", "path", "--objective", "iou_mean,nees_position_mean"]
OPTIONS += ["--seeds", "5", "--trials", "3"]


@pytest.fixture
def tune(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)

    def run(*words, code=0):
        capsys.readouterr()
        found = main(["tune", "--json", *words])
        said = capsys.readouterr()
        assert found == code, said.err
        return json.loads(said.out) if code == 0 else said.err

    return run


@pytest.mark.sketched
def test_trials_depend_on_no_worker_and_an_interrupted_tuning_continues(
    tune, tmp_path, monkeypatch, capsys
):
    one = tune(*TUNED, *OPTIONS, "--workers", "1", "--name", "one")
    table = Path("results/one/trials.csv").read_text()
    assert len(table.splitlines()) == 1 + 1 + 3
    # A car of 1 m is clearly worse after four seeds.
    assert ",stopped," in table and ",on the front," in table
    gains = [row for row in one["gain"] if row["trial"] == one["trial"]]
    assert [row["metric"] for row in gains] == ["iou_mean", "nees_position_mean"]
    assert [row["units"] for row in gains] == [5, 5] and len(one["gain"]) == 4
    assert all(row["minus_low"] is not None for row in gains)
    page = Path("results/one/index.html").read_text()
    assert "importance for mean NEES" in page and page.count("</svg>") == 2

    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "other"))
    run, calls = tuning.Sweep.run, []

    def interrupted(sweep):
        calls.append(sweep)
        if len(calls) == 3:
            raise Interrupted("interrupted")
        return run(sweep)

    with monkeypatch.context() as patch:
        patch.setattr(tuning.Sweep, "run", interrupted)
        said = tune(*TUNED, *OPTIONS, "--workers", "2", "--name", "two", code=130)
    machine = ["executor=threads", "executor.workers=2"]
    assert said.splitlines()[-1].endswith(f"stixel tune --resume results/two {' '.join(machine)}")
    two = tune("--resume", "results/two", *machine)
    assert (two["trial"], two["gain"]) == (one["trial"], one["gain"])
    assert Path("results/two/trials.csv").read_text() == table

    assert main(["run", "--json", "--config-dir", "results/two/preset", "experiment=tuned"]) == 0
    run = json.loads(capsys.readouterr().out)
    config = yaml.safe_load((Path(run["folder"]) / "config.yaml").read_text())
    assert str(config["tracker"]["basis_points"]) == one["settings"]["tracker.basis_points"]
    assert (config["path"]["duration"], config["seed"]) == (0.3, 0)
    assert config["road_user"]["shape_seed"] is None


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([TUNED[3], "--objective", "iou"], "--objective: iou: no such metric"),
        ([TUNED[3], "--objective", "iou_mean,iou_mean"], "two different ones"),
        ([TUNED[3], "--over", "path"], "--over: path is not swept"),
        ([TUNED[3], "seed=999,1000"], "seed=999: seeds to tune on are 1000 and more"),
        ([TUNED[3], "road_user.shape_seed=1,2"], "road_user.shape_seed=1: seeds"),
        (["start.rates=interval(0,1)"], "not a number: write start.rates=A,B"),
        (["tracker=interval(0,1)"], "tracker=interval(0,1): not a number: write tracker=A,B"),
        (["tracker.sigma_q=tag(log,interval(0,1))"], "for log with A > 0"),
        (["tracker.sigma_q=interval(-1,1)"], "tracker.sigma_q"),
        (["tracker.sigmaq=interval(0,1)"], "tracker.sigmaq"),
        (["sensor.read_noise=interval(0,1)"], "sensor.read_noise: no stage reads it"),
        (["executor.workers=1,2"], "executor.workers: it does not affect results"),
        (["experiment=thesis", TUNED[3]], "experiment: the preset is one"),
        (["--resume", "results"], "results: tune.yaml is missing"),
        ([], "nothing to tune"),
    ],
)
def test_wrong_input_is_one_line(tune, words, said):
    error = tune(*words, *(FEW if "--resume" not in words else ()), code=2)
    assert said in error and error.count("\n") == 1
    assert not Path("results").exists()
