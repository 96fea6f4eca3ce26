"""`stixel report` and `stixel play`: write a page that compares runs, or plays them back."""

from typing import Annotated

import typer

from stixel_cli.cli.errors import tell
from stixel_cli.cli.options import Folders, Output, Over, TrustCode, Workers
from stixel_cli.cli.run import stored_run
from stixel_cli.cli.terminal import say, say_wrapped
from stixel_cli.errors import UserError


def report(
    folders: Folders,
    output: Output = None,
    over: Over = None,
    compare: Annotated[
        str | None,
        typer.Option(metavar="KEYS", help="Swept keys whose values are compared, in a sweep."),
    ] = None,
    metrics: Annotated[
        str | None, typer.Option(metavar="NAMES", help="Metrics of a sweep, the main one first.")
    ] = None,
    reference: Annotated[
        str | None, typer.Option(help="Option of a sweep to compare with, instead of the best.")
    ] = None,
    form: Annotated[
        str | None,
        typer.Option(
            "--format",
            help="Of a sweep: html, a table (md, tex, csv) or a figure (svg, pdf, png); default: "
            "that of --output, or html.",
        ),
    ] = None,
) -> int:
    """Compare two or more runs, or show one sweep by its own folder, on one page.

    A comparison shows verdicts, metrics, errors over time and the settings that differ. A sweep's
    page compares its options, with paired intervals. A sweep also gives one table or one figure
    for a paper.

    \b
    Examples:
      stixel report results/simulated results/fabricated
      stixel report results/my_sweep --metrics iou_mean,centre_rmse_m --format tex
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
    own = {"--over": over, "--compare": compare, "--metrics": metrics}
    own |= {"--reference": reference, "--format": form}
    if not is_sweep:
        for option in (option for option, value in own.items() if value is not None):
            raise UserError(f"{option}: is for one sweep; these are runs")
    from stixel_cli.border import write_new
    from stixel_cli.report.compare import default_page, page_html

    command = ["stixel", "report", *map(str, folders)]
    given = {**own, "--output": None if output is None else str(output)}
    command += [word for option, value in given.items() if value for word in (option, value)]
    if is_sweep:
        from stixel_cli.sweeps.page import FORMATS, asked_sweep, sweep_page, written_format

        form = form or (output.suffix[1:] if output is not None else "") or "html"
        if form not in FORMATS:
            raise UserError(f"--format: {form}: must be one of {', '.join(FORMATS)}")
        result, notes, answers = asked_sweep(folders[0], over, compare, metrics, reference)
        page = output or default_page(folders).with_suffix(f".{form}")
        if form == "html":
            content = sweep_page(result, page, command, notes, answers)
        else:
            content = written_format(answers, form)
        for answer in answers:
            say_wrapped(answer.sentence)
    else:
        from stixel_cli.results.result import read_scored_run

        page = output or default_page(folders)
        content = page_html([read_scored_run(folder) for folder in folders], command, page)
    write_new(page, content)
    if (page.parent / PAGE).exists() and page.suffix == ".html":
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
