"""`stixel report` and `stixel play`: write a page that compares runs, or plays them back."""

from stixel_cli.cli.errors import tell
from stixel_cli.cli.options import Folders, Output, Over, TrustCode, Workers
from stixel_cli.cli.run import stored_run
from stixel_cli.cli.terminal import say
from stixel_cli.errors import UserError


def report(folders: Folders, output: Output = None, over: Over = None) -> int:
    """Compare two or more runs, or show one sweep by its own folder, on one page.

    A comparison shows verdicts, metrics, errors over time and the settings that differ. A sweep's
    page ranks its settings, and has a figure for each axis, and errors over time.

    \b
    Examples:
      stixel report results/simulated results/fabricated
      stixel report results/my_sweep --over seed,path
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
    if over is not None and not is_sweep:
        raise UserError("--over: is for one sweep; these are runs")
    from stixel_cli.border import write_new
    from stixel_cli.report.compare import default_page, page_html

    page = default_page(folders) if output is None else output
    command = ["stixel", "report", *map(str, folders)]
    if output is not None:
        command += ["--output", str(output)]
    if over is not None:
        command += ["--over", over]
    if is_sweep:
        from stixel_cli.sweeps.page import sweep_page

        text = sweep_page(folders[0], page, command, over or "")
    else:
        from stixel_cli.results.result import read_scored_run

        text = page_html([read_scored_run(folder) for folder in folders], command, page)
    write_new(page, text)
    if (page.parent / PAGE).exists():
        from stixel_cli.sweeps.index import update_index

        update_index(page.parent)  # It links to the page of a sweep.
    say(page)
    return 0


def play(
    folders: Folders, output: Output = None, workers: Workers = None, trust_code: TrustCode = False
) -> int:
    """Write a page that plays back one or more runs of one scene.

    Missing results are computed. The page of one run is already in its folder, as index.html.

    \b
    Examples:
      stixel play results/gp results/point
      stixel play results/sweep/runs/0003
    """
    if output is not None and not output.parent.is_dir():
        raise UserError(f"--output: the folder {output.parent} does not exist")
    from stixel_cli.border import write_new
    from stixel_cli.engine.progress import make_progress
    from stixel_cli.experiment.playback import folders_page
    from stixel_cli.report.compare import default_page, run_labels

    labels = run_labels(folders)
    stored = [stored_run(folder, workers, trust_code) for folder in folders]
    page, notes = folders_page(stored, labels, make_progress())
    for note in notes:
        tell(note)
    file = default_page(folders, "play") if output is None else output
    write_new(file, page)
    say(file)
    return 0
