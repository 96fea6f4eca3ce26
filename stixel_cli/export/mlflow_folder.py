"""Export a run or a sweep, as stored, for mlflow: an offline folder, by mlflow's own client."""

import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stixel_cli.answers.runs import known
from stixel_cli.errors import UserError, located, printable_path
from stixel_cli.results import result
from stixel_cli.results.folder import PAGE, whole_folder
from stixel_cli.sweeps.folder import SweepResult, read_sweep

DATABASE = "mlflow.db"


def export_mlflow(folder: Path, target: Path) -> None:
    """Write `target` with mlflow's database and the artifacts; nothing is computed.

    A run is a run of mlflow: its settings are the parameters, its scores the metrics, its page and
    manifest the artifacts. A sweep is one, too, with its page and tables; below it are its complete
    settings, whose metrics are the means, with `NAME/low` and `NAME/high`, the ends of the 95 %
    interval, and `NAME/n`; below these, their runs.

    UserError if `folder` is neither, `target` exists or cannot be written, or mlflow is missing.
    """
    # Before the import, which reads them: an offline export calls nobody, and says no more than us.
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    os.environ.setdefault("MLFLOW_LOGGING_LEVEL", "WARNING")
    with located("--format: mlflow needs mlflow: pip install 'stixel[mlflow]'", caught=ImportError):
        from mlflow.tracking import MlflowClient
    is_sweep = (folder / result.SWEEP_FILE).exists()
    stored = read_sweep(folder) if is_sweep else result.read_run(folder)
    with whole_folder(target) as partial:
        client = MlflowClient(tracking_uri=f"sqlite:///{partial / DATABASE}")
        try:
            artifacts = (target / "artifacts").as_uri()
            experiment = client.create_experiment("stixel", artifact_location=artifacts)
            log = _Log(client, experiment, partial / "artifacts", folder.resolve())
            if is_sweep:
                _log_sweep(log, stored)
            else:
                log.run(stored, folder.name)
        finally:
            # SQLite's file is closed before it moves, or goes.
            client._tracking_client.store._dispose_engine()


class _Log:
    """Runs of one experiment of mlflow; files below `folder` are copied, since it moves."""

    def __init__(self, client: Any, experiment: str, artifacts: Path, folder: Path):
        self.client, self.experiment, self.artifacts = client, experiment, artifacts
        self.folder = folder

    def one(
        self,
        name: str,
        parameters: Mapping[str, str],
        metrics: Mapping[str, float | int | None],
        files: Mapping[str, Path],
        parent: str | None = None,
    ) -> str:
        """Log a run of mlflow below that with the id `parent`; returns its id."""
        from mlflow.entities import Metric, Param

        tags = {"mlflow.parentRunId": parent} if parent else {}
        made = self.client.create_run(self.experiment, run_name=name, tags=tags).info.run_id
        known = [Metric(n, float(v), 0, 0) for n, v in metrics.items() if v is not None]
        rows = [Param(key, value) for key, value in parameters.items()]
        # As many as mlflow takes at once.
        for first in range(0, max(len(rows), len(known)), 100):
            part = slice(first, first + 100)
            self.client.log_batch(made, metrics=known[part], params=rows[part])
        for file, source in files.items():
            if not source.resolve().is_relative_to(self.folder):
                raise UserError(f"{printable_path(source)}: is a link out of {self.folder}")
            if source.is_file():
                copy = self.artifacts / made / "artifacts" / file
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source, copy)
        self.client.set_terminated(made)
        return made

    def run(self, run: result.RunResult, name: str, parent: str | None = None) -> None:
        """Log a run of this program."""
        files = {file: run.folder / file for file in (PAGE, "manifest.json", "config.yaml")}
        self.one(
            name, result.flat_settings(result.read_config(run.folder)), run.metrics, files, parent
        )


def _log_sweep(log: _Log, sweep: SweepResult) -> None:
    files = {path.name: path for path in sorted(sweep.folder.iterdir()) if path.is_file()}
    top = log.one(sweep.folder.name, {}, {}, files)
    answers = sweep.table.answers(sweep.table.metrics)
    by_option = answers[0].runs.groupby("option", sort=False).groups
    for option, indices in by_option.items():
        bounds = {"n": answers[0].units}
        for one in answers:
            values = known(one.table.loc[option, ["mean", "low", "high"]])
            names = (one.question.metric + end for end in ("", "/low", "/high"))
            bounds |= dict(zip(names, values, strict=True))
        keys = answers[0].question.compare
        values = answers[0].runs.loc[indices[0], [*keys]]
        parent = log.one(str(option), {key: str(values[key]) for key in keys}, bounds, {}, top)
        for run in (sweep.runs[i] for i in indices):
            if run.status == result.DONE:
                log.run(run, f"run {run.index}", parent)
