"""`stixel report`: result folders side by side on one page."""

import sys
from pathlib import Path

from stixel_cli.errors import UserError


def report_command(folders: list[Path], output: Path | None) -> int:
    """Write the page of two or more result folders and print where it is; the exit code.

    Raises:
        UserError: if there are fewer than two, one of them is not to be read, or the page is not
            to be written.
    """
    if len(folders) < 2:
        raise UserError("stixel report puts runs side by side: name two result folders or more")
    if output is not None and output.exists():
        raise UserError(f"--output: {output} exists, and is not written over; name another file")
    from stixel_cli.report.compare import default_page, page_html, write_page
    from stixel_cli.results.result import read_scored_run

    runs = [read_scored_run(folder) for folder in folders]
    page = default_page(folders) if output is None else output
    command = ["stixel", "report", *map(str, folders)]
    if output is not None:
        command += ["--output", str(output)]
    write_page(page, page_html(runs, command))
    sys.stdout.write(f"{page}\n")
    return 0
