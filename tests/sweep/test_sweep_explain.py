"""`stixel explain` of sweeps: each node once."""

import json
from collections import Counter

import pytest

from stixel_cli.cli.app import main

FEW = ("measurement=fabricated", "path.duration=0.3")


@pytest.fixture
def explained(sweeps, capsys):
    """What `stixel explain --json` says."""

    def explain(*words):
        capsys.readouterr()
        assert main(["explain", "--json", *map(str, words)]) == 0
        return json.loads(capsys.readouterr().out)

    return explain


def test_each_node_once(sweeps, explained, capsys):
    sweeps.run(*FEW, "tracker.sigma_f=0.1", "seed=0,1")
    line = [*FEW, "tracker.sigma_f=0.1,0.2", "seed=0,1,2"]
    found = explained(*line)
    keys = [one["key"] for one in found]
    assert len(keys) == len(set(keys))
    # Seed 2 is new, and so is sigma_f=0.2; what the scores of runs 0 and 1 took is not asked for.
    stages = Counter(one["stage"] for one in found)
    assert stages == {"scans": 1, "start": 1, "track": 4, "scores": 4}
    assert main(["explain", *line]) == 0
    said = capsys.readouterr().out
    assert "\nstart: seed changed from " in said
    assert "\nscores, 2 nodes: input changed: track\n" in said
    sweeps.run(*line)
    assert explained(*line) == []


@pytest.mark.parametrize(
    ("command", "words"),
    [
        pytest.param("run", (), marks=pytest.mark.sketched),
        pytest.param("run", ("tracker.sigma_f=0.5",), marks=pytest.mark.sketched),
        ("sweep", ("seed=0,1",)),
        ("sweep", ("path=choice(turn)",)),
    ],
)
def test_explain_dry_run_and_the_command_itself_agree(command, words, sweeps, explained, capsys):
    if words == ("tracker.sigma_f=0.5",):
        assert main(["run", *FEW, "--results", str(sweeps.results)]) == 0

    def answer(*line):
        capsys.readouterr()
        assert main([*line, *FEW, *words, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

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


def test_a_file_and_the_folder_of_a_sweep(sweeps, explained, tmp_path, capsys):
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
    assert stages == {"track_pictures", "run_pictures"}
    capsys.readouterr()
    assert main(["explain", str(folder), "--from", str(file)]) == 2
    assert main(["explain", *FEW, "sensor.read_noise=0,1"]) == 2
    errors = capsys.readouterr().err.splitlines()
    assert "either a result folder or --from FILE" in errors[0]
    assert "no stage reads it" in errors[1]
