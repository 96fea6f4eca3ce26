"""`stixel report`: compare runs on one page."""

import sys

from stixel_cli.cli.options import Folders, Output, check_output
from stixel_cli.errors import UserError


def report(folders: Folders, output: Output = None) -> int:
    """Compare two or more runs side by side on one page.

    The page shows the settings that differ, the metrics, and the errors over time.

    Example: stixel report results/simulated results/fabricated
    """
    if len(folders) < 2:
        raise UserError("stixel report compares runs: name two or more result folders")
    check_output(output)
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
