"""`stixel rerun`: repeat a run."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from stixel_cli.cli.options import Folder, Json, Results, TrustCode, Verbose, Workers
from stixel_cli.cli.run import print_run, print_scores, stored_run, tell_changed_code


def rerun(
    folder: Folder,
    name: Annotated[
        str | None,
        typer.Option(help="Name of the result folder (default: FOLDER-rerun, and the time)."),
    ] = None,
    results: Results = Path("results"),
    workers: Workers = None,
    trust_code: TrustCode = False,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Repeat a run with the configuration of its folder.

    The results go into a new folder. Executor and cache are those of this machine, all other
    settings are those of the folder.

    Example: stixel rerun results/contour
    """
    from stixel_cli.engine.progress import make_progress
    from stixel_cli.experiment.run import record_run
    from stixel_cli.machine.kernels import uncompiled

    stored = stored_run(folder, workers, trust_code)
    tell_changed_code(stored)
    made = record_run(
        stored.composition,
        results,
        name,
        progress=make_progress(uncompiled(), advice=not json),
        on_scores=None if json else partial(print_scores, verbose),
        rerun_of=folder,
    )
    print_run(made, json)
    return 0
