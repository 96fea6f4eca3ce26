"""`stixel report`: compare runs, or show a sweep, on one page."""

from stixel_cli.cli.options import Folders, Output
from stixel_cli.cli.terminal import say
from stixel_cli.errors import UserError


def report(folders: Folders, output: Output = None) -> int:
    """Compare two or more runs, or show one sweep by its own folder, on one page.

    A comparison shows verdicts, metrics, errors over time and the settings that differ. A sweep's
    page has a sortable table of its settings, a figure for each axis, and errors over time.

    Example: stixel report results/simulated results/fabricated
    """
    from stixel_cli.results.folder import PAGE
    from stixel_cli.results.reader import SWEEP_FILE, check_folder

    is_sweep = len(folders) == 1 and (folders[0] / SWEEP_FILE).exists()
    if len(folders) < 2 and not is_sweep:
        check_folder(folders[0])
        raise UserError(
            f"report compares two or more runs, or shows one sweep; the page of one run is "
            f"{folders[0] / PAGE}"
        )
    from stixel_cli.report.compare import default_page, page_html, write_page

    page = default_page(folders) if output is None else output
    command = ["stixel", "report", *map(str, folders)]
    if output is not None:
        command += ["--output", str(output)]
    if is_sweep:
        from stixel_cli.sweeps.page import sweep_page

        text = sweep_page(folders[0], page, command)
    else:
        from stixel_cli.results.result import read_scored_run

        text = page_html([read_scored_run(folder) for folder in folders], command, page)
    write_page(page, text)
    say(page)
    return 0
