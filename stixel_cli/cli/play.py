"""`stixel play`: a page that plays runs back."""

import sys
from pathlib import Path

from stixel_cli.errors import UserError


def play_command(folders: list[Path], output: Path | None, workers: int | None) -> int:
    """Write the page of one run, or of several of one scene, and print where it is; the exit code.

    Raises:
        UserError: if a folder is not to be read, the runs are not of one scene, or the page is not
            to be written.
    """
    if output is not None and output.exists():
        raise UserError(f"--output: {output} exists, and is not written over; name another file")
    if output is not None and not output.parent.is_dir():
        raise UserError(f"--output: there is no folder {output.parent}")
    from stixel_cli.cli.run import with_workers
    from stixel_cli.engine.progress import make_progress
    from stixel_cli.experiment.playback import folders_page
    from stixel_cli.experiment.stored_run import read_stored_run
    from stixel_cli.report.compare import default_page, run_labels, write_page

    labels = run_labels(folders)
    stored = [read_stored_run(folder, tuple(with_workers((), workers))) for folder in folders]
    page, notes = folders_page(stored, labels, make_progress())
    for note in notes:
        sys.stderr.write(f"stixel: {note}\n")
    file = default_page(folders, "play") if output is None else output
    write_page(file, page)
    sys.stdout.write(f"{file}\n")
    return 0
