"""`stixel tune`: search for the best values of settings with Optuna."""

import shlex
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from stixel_cli.cli import options
from stixel_cli.cli.completion import complete_folder
from stixel_cli.cli.terminal import print_json, print_table, say
from stixel_cli.config.folders import PRESETS
from stixel_cli.errors import UserError

_REQUEST = "tune.yaml"
_Resume = typer.Option(metavar="FOLDER", help="Continue.", autocompletion=complete_folder)


def tune(
    overrides: options.SweepOverrides = None,
    objective: Annotated[
        str, typer.Option(metavar="METRICS", help="One metric, or two for a Pareto front: A,B.")
    ] = "iou_mean",
    trials: Annotated[int, typer.Option(min=1, max=10_000, help="Number of trials.")] = 40,
    seeds: Annotated[
        int, typer.Option(min=1, max=1000, help="Seeds from 1000 to tune on, and from 0 to report.")
    ] = 10,
    over: options.Over = None,
    name: options.Name = None,
    results: options.Results = Path("results"),
    workers: options.Workers = None,
    resume: Annotated[Path | None, _Resume] = None,
    json: options.Json = False,
    config_dir: options.ConfigDir = None,
) -> int:
    """Search for the best values of settings with Optuna.

    Parameters have several values, KEY='interval(A,B)', or KEY='tag(log,interval(A,B))'. A trial
    is averaged over seeds from 1000, and stops if it is clearly worse after the first four. The
    gain over the default is that on seeds from 0, in pairs. An objective that should be 1, such as
    nees_position_mean, counts by its |log|. The folder has a page, a table of the trials, and a
    preset: stixel run --config-dir FOLDER/preset experiment=tuned.

    Example: stixel tune measurement=fabricated tracker.sigma_q='tag(log,interval(0.1,10))'
    """
    from stixel_cli.files import read_yaml
    from stixel_cli.report.tables import shown_table
    from stixel_cli.results.folder import check_results, new_folder, write_whole_folder
    from stixel_cli.results.reader import yaml_text
    from stixel_cli.sweeps.run import SweepInterrupted
    from stixel_cli.sweeps.tune_folder import write_outcome
    from stixel_cli.sweeps.tuning import Tuning

    request = {"overrides": overrides or [], "objectives": objective.split(",")}
    request |= {"over": (over or "seed").split(","), "seeds": seeds, "trials": trials}
    if resume is not None:
        if overrides or over or name:
            raise UserError("--resume continues the tuning of that folder: leave out the rest")
        stored = read_yaml(resume / _REQUEST) if (resume / _REQUEST).is_file() else None
        kinds = {key: type(value) for key, value in request.items()}
        if not isinstance(stored, dict) or {k: type(v) for k, v in stored.items()} != kinds:
            raise UserError(f"{resume}: not the folder of a tuning (no valid {_REQUEST})")
        request = stored
    else:
        check_results(results, name)
    trials = request.pop("trials")
    tuning = Tuning(**request | {"overrides": options.with_workers(request["overrides"], workers)})
    folder = resume or new_folder(
        results,
        name,
        "tune",
        datetime.now(UTC),
        lambda path: write_whole_folder(path, {_REQUEST: yaml_text(request | {"trials": trials})}),
    )
    command = shlex.join(["stixel", "tune", "--resume", str(folder), *PRESETS.option])
    try:
        tuning.search(trials)
        best, gain = write_outcome(folder, tuning, command)
    except SweepInterrupted:
        raise SweepInterrupted(f"interrupted; resume with: {command}") from None
    if json:
        rows = [dict(zip(gain.columns, row, strict=True)) for row in gain.rows]
        answer = {"trial": best.name, "settings": best.settings, "gain": rows}
        print_json({"folder": str(folder.absolute()), **answer})
    else:
        header, cells, numeric = shown_table(gain)
        print_table(header, cells, right=[i for i, one in enumerate(numeric) if one])
        chosen = " ".join(f"{key}={value}" for key, value in best.settings.items())
        say(f"trial {best.name}: {chosen}", folder)
    return 0
