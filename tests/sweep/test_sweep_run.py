"""Sweeps of real stages by the real command line: sharing, tables; `stixel explain` of sweeps."""

import csv
import json
import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import yaml

from stixel_cli.cli.app import main
from stixel_cli.config.compose import compose, from_resolved
from stixel_cli.evaluation.intervals import between_bounds
from stixel_cli.evaluation.metric_table import metric
from stixel_cli.results.result import read_scored_run

FEW = ("measurement=fabricated", "path.duration=0.3")
STATISTICS = ("summary.csv", "summary.md", "index.html")


def test_runs_share_what_they_have_in_common(sweeps, told):
    line = [*FEW, "seed=0,1", "tracker.sigma_q=0.5,0.6,0.7"]
    planned = json.loads(told("sweep", "--dry-run", "--json", *line))
    shared = {"ego_motion": 1, "scenario": 1, "scans": 2, "start": 2}
    nodes = {stage["name"]: stage["nodes"] for stage in planned["stages"]}
    assert nodes == shared | {"track": 6, "scores": 6}
    assert planned["runs"] == 6
    assert planned["nodes"] == {"all": 18, "cached": 0, "to_run": 18}
    swept = sweeps.run(*line, "--name", "a")
    assert swept["nodes"] == {"computed": 18, "cached": 0}
    assert swept["complete"]
    # One more value computes only its own nodes; the same values again compute nothing.
    more = sweeps.run(*FEW, "seed=0,1", "tracker.sigma_q=0.5,0.6,0.7,0.8")
    assert more["nodes"]["computed"] == 2 * 2
    assert sweeps.run(*line)["nodes"]["computed"] == 0
    planned = json.loads(told("sweep", "--dry-run", "--json", *line))
    assert planned["nodes"] == {"all": 18, "cached": 18, "to_run": 0}
    assert planned["runs_cached"] == 6


@pytest.mark.sketched
def test_the_folder(sweeps):
    swept = sweeps.run(*FEW, "tracker.sigma_f=0.1,0.3", "seed=0,1,2", "--name", "mine")
    folder = sweeps.results / "mine"
    assert swept["folder"] == str(folder)
    assert "6 of 6 runs done" in (sweeps.results / "index.html").read_text(encoding="utf-8")
    names = {"sweep.yaml", "runs.csv", *STATISTICS, "runs", "code"}
    assert {path.name for path in folder.iterdir()} == names
    rows = sweeps.rows("mine")
    assert len(rows) == 6
    for index, row in enumerate(rows):
        assert row["status"] == "done"
        assert row["folder"] == f"runs/{index:04d}"
        run = folder / row["folder"]
        metrics = json.loads((run / "metrics.json").read_text())
        known = {name: value for name, value in metrics.items() if value is not None}
        assert {name: float(row[name]) for name in metrics if row[name]} == known
        configuration = from_resolved(yaml.safe_load((run / "config.yaml").read_text()))
        assert configuration == compose(row["overrides"].split()).configuration
        assert configuration.seed == int(row["seed"]) == index % 3
        assert configuration.tracker.sigma_f == float(row["tracker.sigma_f"])
        # A run's folder is read as any run's is, and small.
        read = read_scored_run(run)
        assert read.metrics == metrics
        keys = {stage["name"]: stage["key"] for stage in read.manifest["stages"]}
        assert {"scans", "track", "scores"} <= keys.keys()
        assert sum(file.stat().st_size for file in run.iterdir()) < 30_000
    request = yaml.safe_load((folder / "sweep.yaml").read_text())
    assert request["command"].startswith("stixel sweep measurement=fabricated")
    assert len(request["runs"]) == 6


@pytest.mark.sketched
@pytest.mark.summed
def test_the_summaries_are_those_of_the_seeds(sweeps):
    swept = sweeps.run(*FEW, "tracker.sigma_f=0.1,0.3", "seed=range(0,4)", "--name", "mine")
    folder = sweeps.results / "mine"
    with (folder / "summary.csv").open() as file:
        rows = list(csv.DictReader(file))
    metrics = json.loads((folder / "runs/0000/metrics.json").read_text())
    known = [name for name, value in metrics.items() if value is not None]
    assert {row["metric"] for row in rows} == set(known)
    assert len(rows) == len(swept["summary"]) == 2 * len(known)
    for row in rows:
        sigma = row["tracker.sigma_f"]
        runs = [run for run in sweeps.rows("mine") if run["tracker.sigma_f"] == sigma]
        values = [float(run[row["metric"]]) for run in runs]
        assert int(row["units"]) == len(values) == 4
        mean, std = np.mean(values), np.std(values, ddof=1)
        assert float(row["mean"]) == pytest.approx(mean)
        if row["metric"] != "track_lost":  # A rate has Wilson's interval.
            half = 3.182446305284263 * std / math.sqrt(4)  # t of 3 degrees of freedom
            low, high = between_bounds(mean, half, metric(row["metric"]).bounds)
            assert float(row["low"]) == pytest.approx(low)
            assert float(row["high"]) == pytest.approx(high)
    head = "| tracker.sigma_f | runs | mean IoU, box [95 %] |"
    assert head in (folder / "summary.md").read_text()
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert "<h1>Sweep mine</h1>" in page and "Runs: <code>stixel sweep " in page
    # The worst run of each option, and all runs, are one click away.
    assert page.count('<a href="runs/000') == 2
    assert all(f'"runs/000{index}' in page for index in range(8))


def test_a_dry_run_writes_nothing_and_a_taken_name_is_refused_before_anything_is_planned(
    sweeps, told, monkeypatch
):
    line = [*FEW, "seed=0,1", "--dry-run", "--results", str(sweeps.results)]
    said = told("sweep", *line)
    assert "2 runs, 0 complete" in said
    assert "seed: 2 values: seed=0, seed=1" in said
    assert not sweeps.results.exists()
    (sweeps.results / "mine").mkdir(parents=True)
    monkeypatch.setattr("stixel_cli.sweeps.graphs.design_runs", None)
    assert "choose another --name" in sweeps.refused(*FEW, "seed=0,1", "--name", "mine")


@pytest.mark.sketched
def test_pictures_only_on_request(sweeps):
    plain = sweeps.run(*FEW, "seed=0,1", "--name", "plain")
    assert not (sweeps.results / "plain" / "runs" / "0000" / "figures").exists()
    asked = sweeps.run(*FEW, "pictures.frames=[1]", "seed=0,1", "--name", "asked", "--pictures")
    drawn = sweeps.results / "asked" / "runs" / "0001" / "figures"
    assert (drawn / "path.png").is_file()
    assert (drawn / "k0001" / "birds_eye.png").is_file()
    assert asked["summary"] == plain["summary"]


@pytest.mark.parametrize("columns", ["80", "200"])
def test_the_table_of_the_options_fits_the_screen(sweeps, told, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", columns)
    line = [*FEW, "tracker=gp_ekf,point", "seed=range(0,4)"]
    said = told("sweep", *line, "--results", sweeps.results)
    assert "8 of 8 runs done" in said and said.rstrip().endswith("/index.html")
    assert "…" not in said and max(map(len, said.splitlines()[:-1])) <= int(columns)
    header = " ".join(said[: said.index("──")].split())
    for name in ("IoU", "centre", "orientation", "loss"):
        assert name in header


def test_json_has_the_full_folder_and_show_fits_the_terminal(sweeps, tmp_path, told, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sweeps.results = Path("here")
    swept = sweeps.run(*FEW, "seed=0,1", "--name", "mine")
    assert swept["folder"] == str(tmp_path / "here" / "mine")
    said = told("ls", "here/mine/runs/0000")
    assert max(map(len, said.splitlines())) <= 100
    assert "hydra-core" in said
    assert "world=street" in said


@pytest.fixture
def explained(sweeps, told):
    """What `stixel explain --json` says."""

    def explain(*words):
        return json.loads(told("explain", "--json", *words))

    return explain


def test_each_node_once(sweeps, explained, told):
    sweeps.run(*FEW, "tracker.sigma_f=0.1", "seed=0,1")
    line = [*FEW, "tracker.sigma_f=0.1,0.2", "seed=0,1,2"]
    found = explained(*line)
    keys = [one["key"] for one in found]
    assert len(keys) == len(set(keys))
    # Seed 2 is new, and so is sigma_f=0.2; what the scores of runs 0 and 1 took is not asked for.
    stages = Counter(one["stage"] for one in found)
    assert stages == {"scans": 1, "start": 1, "track": 4, "scores": 4}
    said = told("explain", *line)
    assert "\nstart: seed changed from " in said
    assert "\nscores, 2 nodes: input changed: track\n" in said
    sweeps.run(*line)
    assert explained(*line) == []


TUNED = ("tracker.sigma_f=0.5",)
OF_RUN = [pytest.param("run", words, marks=pytest.mark.sketched) for words in ((), TUNED)]
OF_SWEEP = [("sweep", ("seed=0,1",)), ("sweep", ("path=choice(turn)",))]


@pytest.mark.parametrize(("command", "words"), [*OF_RUN, *OF_SWEEP])
def test_explain_dry_run_and_the_command_itself_agree(command, words, sweeps, explained, told):
    if words == ("tracker.sigma_f=0.5",):
        assert main(["run", *FEW, "--results", str(sweeps.results)]) == 0

    def answer(*line):
        return json.loads(told(*line, *FEW, *words, "--json"))

    planned = answer(command, "--dry-run")
    counts = {stage["name"]: (stage["nodes"], stage["to_run"]) for stage in planned["stages"]}
    why = explained(*FEW, *words)
    done = answer(command, "--results", str(sweeps.results))
    if command == "run":
        computed = sum(stage["nodes_computed"] for stage in done["stages"])
        assert counts["track_pictures"][1] > 0
    else:
        computed = done["nodes"]["computed"]
        assert "track_pictures" not in counts
    assert computed == planned["nodes"]["to_run"] == len(why) > 0


def test_a_file_and_the_folder_of_a_sweep(sweeps, explained, tmp_path, told):
    file = tmp_path / "mine.yaml"
    file.write_text("fixed: {measurement: fabricated, path.duration: 0.3}\nseeds: 2\n")
    found = explained("--from", file, "road_user=car")
    assert [one["stage"] for one in found].count("scans") == 2
    sweeps.run("--from", file, "--name", "mine")
    folder = sweeps.results / "mine"
    assert explained(folder) == []
    # Runs of a sweep draw no pictures by default, so explain requires none.
    assert explained(folder / "runs" / "0001") == []
    stages = {one["stage"] for one in explained(*FEW, "seed=1")}
    assert stages == {"track_pictures", "path_pictures", "error_pictures"}
    said = told("explain", folder, "--from", file, code=2)
    assert "either a result folder or --from FILE" in said
    assert "no stage reads it" in told("explain", *FEW, "sensor.read_noise=0,1", code=2)
