"""`stixel export --format mlflow`: what mlflow's own client reads again."""

import json
import shutil
from unittest.mock import MagicMock

import pytest

from stixel_cli.cli.app import main

# mlflow's models use a strategy of SQLAlchemy that is deprecated.
pytestmark = pytest.mark.filterwarnings("ignore:The ``noload`` loader strategy")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    command = ["sweep", "measurement=fabricated", "path.duration=0.5", "tracker=point,gp_ekf"]
    command += ["seed=range(0,4)", "executor=threads", "--name", "sweep", "--results", str(folder)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(tmp_path_factory.mktemp("cache")))
        assert main(command) == 0
    return folder


def logged(folder):
    from mlflow.tracking import MlflowClient  # it takes seconds: not at collection

    client = MlflowClient(tracking_uri=f"sqlite:///{folder / 'mlflow.db'}")
    (experiment,) = client.search_experiments(filter_string="name = 'stixel'")
    runs = client.search_runs([experiment.experiment_id])
    return {run.info.run_id: run for run in runs}


def test_sweep(results, tmp_path, capsys):
    out = tmp_path / "logs"
    # A link to the folder itself is no way out of it.
    sweep = tmp_path / "sweep"
    sweep.symlink_to(results / "sweep")
    assert main(["export", str(sweep), "--format", "mlflow", "--output", str(out)]) == 0
    runs = logged(out)
    assert len(runs) == 1 + 2 + 8
    parents = {name: run.data.tags.get("mlflow.parentRunId") for name, run in runs.items()}
    (top,) = [name for name, parent in parents.items() if parent is None]
    copied = out / "artifacts" / top / "artifacts/summary.csv"
    assert copied.read_bytes() == (sweep / "summary.csv").read_bytes()
    settings = {runs[n].info.run_name: runs[n] for n, parent in parents.items() if parent == top}
    assert set(settings) == {"point", "gp_ekf"}
    point = settings["point"]
    metrics = point.data.metrics
    assert metrics["iou_mean/low"] < metrics["iou_mean"] < metrics["iou_mean/high"]
    below = [runs[n] for n, parent in parents.items() if parent == point.info.run_id]
    assert {run.data.params["seed"] for run in below} == {"0", "1", "2", "3"}
    of_runs = sorted(run.data.metrics["iou_mean"] for run in below)
    assert metrics["n"] == 4
    assert sum(of_runs) / 4 == pytest.approx(metrics["iou_mean"])


@pytest.mark.parametrize("linked", ["summary.md", "runs/0003"])
def test_nothing_is_copied_through_a_link_out_of_the_folder(
    linked, results, tmp_path, told, monkeypatch
):
    # A database of mlflow takes seconds to make.
    client = MagicMock()
    client.create_run.return_value.info.run_id = "one"
    monkeypatch.setattr("mlflow.tracking.MlflowClient", lambda **_: client)
    sweep, out = tmp_path / "theirs", tmp_path / "logs"
    shutil.copytree(results / "sweep", sweep)
    secret = tmp_path / "secret"
    if (sweep / linked).is_dir():
        (sweep / linked).rename(secret)
    else:
        secret.write_text("secret")
        (sweep / linked).unlink()
    (sweep / linked).symlink_to(secret)
    line = told("export", sweep, "--format", "mlflow", "--output", out, code=2).splitlines()[-1]
    assert linked in line and "link out of" in line
    assert [path.name for path in tmp_path.iterdir() if path not in (sweep, secret)] == []


def test_run_and_an_output_that_exists(results, tmp_path, told):
    out, run = tmp_path / "logs", results / "sweep/runs/0000"
    command = ["export", str(run), "--format", "mlflow", "--output", str(out)]
    assert main(command) == 0
    (one,) = logged(out).values()
    stored = json.loads((run / "metrics.json").read_text())
    assert one.data.metrics == {name: v for name, v in stored.items() if v is not None}
    assert one.info.artifact_uri == (out / f"artifacts/{one.info.run_id}/artifacts").as_uri()
    assert "exists and is not overwritten" in told(*command, code=2)
