"""`stixel rerun`: a result folder's configuration once more."""

from pathlib import Path

from stixel_cli.cli.run import print_run, with_workers
from stixel_cli.engine.progress import make_progress
from stixel_cli.experiment.run import record_run
from stixel_cli.experiment.stored_run import read_stored_run


def rerun_command(
    folder: Path, name: str | None, results: Path, workers: int | None, json: bool
) -> int:
    """Run the configuration of a result folder into a new one; the exit code.

    Raises:
        UserError: if it is no result folder, or for whatever `stixel run` would refuse.
    """
    stored = read_stored_run(folder, tuple(with_workers((), workers)))
    made = record_run(
        stored.composition,
        ["stixel", "rerun", str(folder)],
        results=results,
        name=name,
        stem=f"{folder.resolve().name.lstrip('.')[:100]}-rerun",
        progress=make_progress(),
        notes={"rerun_of": str(folder)},
    )
    print_run(made, json)
    return 0
