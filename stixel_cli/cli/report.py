"""`stixel report`, `table` and `figure`: what is said of a sweep, or of several runs."""

from typing import Annotated

import typer

from stixel_cli.cli.errors import tell
from stixel_cli.cli.options import Folders, Output, Over, TrustCode, Workers
from stixel_cli.cli.run import stored_run
from stixel_cli.cli.terminal import say, say_wrapped
from stixel_cli.errors import UserError

Compare = Annotated[
    str | None,
    typer.Option(metavar="KEYS", help="Swept keys whose values are compared, in a sweep."),
]
Metrics = Annotated[
    str | None, typer.Option(metavar="NAMES", help="Metrics by commas, the main one first.")
]
Reference = Annotated[str | None, typer.Option(help="Option to compare with, instead of the best.")]


def report(
    folders: Folders,
    output: Output = None,
    over: Over = None,
    compare: Compare = None,
    metrics: Metrics = None,
    reference: Reference = None,
    player: Annotated[
        bool, typer.Option("--play", help="Write the page that plays the runs of one scene back.")
    ] = False,
    workers: Workers = None,
    trust_code: TrustCode = False,
) -> int:
    """Write one page of a sweep or of several runs.

    It compares the options of the sweep, by its own folder, or the runs: answers with paired
    intervals, errors over time, settings that differ. With --play, it plays back runs of one scene;
    missing results are computed. The page of one run is already in its folder, as index.html.

    \b
    Examples:
      stixel report results/simulated results/fabricated
      stixel report results/my_sweep --compare tracker --metrics iou_mean,centre_rmse_m
      stixel report --play results/gp results/point
    """
    from stixel_cli.border import write_new
    from stixel_cli.report.compare import default_page
    from stixel_cli.results.folder import PAGE
    from stixel_cli.sweeps.page import asked_folders, sweep_page

    if player:
        return play(folders, output, workers, trust_code)
    asked = asked_folders(folders, metrics, reference, over, compare)
    page = output or default_page(folders)
    given = {"--over": over, "--compare": compare, "--metrics": metrics, "--reference": reference}
    given["--output"] = None if output is None else str(output)
    command = ["stixel", "report", *map(str, folders)]
    command += [word for option, value in given.items() if value for word in (option, value)]
    write_new(page, sweep_page(asked, page, command))
    if (page.parent / PAGE).exists():
        from stixel_cli.sweeps.index import update_index

        update_index(page.parent)  # It links to the page of a sweep.
    for answer in asked.answers:
        say_wrapped(answer.sentence)
    say(page)
    return 0


def table(
    folders: Folders,
    form: Annotated[str, typer.Option("--format", help="md, tex or csv.")] = "md",
    output: Output = None,
    over: Over = None,
    compare: Compare = None,
    metrics: Metrics = None,
    reference: Reference = None,
) -> int:
    """Print one table of a sweep or of several runs.

    Each option is a row, each metric a column. The best is in bold only where the intervals of all
    differences from it exclude 0.

    Example: stixel table results/my_sweep --metrics iou_mean,centre_rmse_m --format tex
    """
    from stixel_cli.border import write_new
    from stixel_cli.sweeps.page import TABLES, asked_folders

    if form not in TABLES:
        raise UserError(f"--format: {form}: must be one of {', '.join(TABLES)}")
    text = TABLES[form](asked_folders(folders, metrics, reference, over, compare).answers)
    if output is None:
        say(text.rstrip("\n"))
    else:
        write_new(output, text)
        say(output)
    return 0


def figure(
    folders: Folders,
    form: Annotated[str, typer.Option("--format", help="svg, pdf or png.")] = "pdf",
    output: Output = None,
    over: Over = None,
    compare: Compare = None,
    metrics: Annotated[str | None, typer.Option("--metric", help="Metric of the figure.")] = None,
    reference: Reference = None,
) -> int:
    """Write one figure of a sweep or of several runs.

    It has the values of each option, and the paired differences from the best or the reference.

    Example: stixel figure results/my_sweep --metric centre_rmse_m --format pdf
    """
    from stixel_cli.answers.figures import differences
    from stixel_cli.border import write_new
    from stixel_cli.report.compare import default_page
    from stixel_cli.sweeps.page import FIGURES, asked_folders

    if form not in FIGURES:
        raise UserError(f"--format: {form}: must be one of {', '.join(FIGURES)}")
    answer = asked_folders(folders, metrics, reference, over, compare).answers[0]
    file = output or default_page(folders, "figure", form)
    write_new(file, differences(answer, FIGURES[form]))
    say_wrapped(answer.sentence)
    say(file)
    return 0


def play(
    folders: Folders, output: Output = None, workers: Workers = None, trust_code: TrustCode = False
) -> int:
    """Play back runs of one scene: short for report --play.

    Of a sweep, all runs are played, and its page links to the player.

    Example: stixel play results/gp results/point
    """
    if output is not None and not output.parent.is_dir():
        raise UserError(f"--output: the folder {output.parent} does not exist")
    from stixel_cli.border import write_new
    from stixel_cli.engine.progress import make_progress
    from stixel_cli.experiment.playback import folders_page
    from stixel_cli.report.compare import default_page, run_labels
    from stixel_cli.results.folder import PAGE
    from stixel_cli.results.reader import SWEEP_FILE
    from stixel_cli.sweeps.folder import PLAYER, SweepFolder
    from stixel_cli.sweeps.page import asked_folders, sweep_page

    is_sweep = len(folders) == 1 and (folders[0] / SWEEP_FILE).exists()
    if is_sweep:
        asked_folders(folders)  # It refuses a sweep that has no page.
    runs = sorted((folders[0] / "runs").glob("[0-9]*")) if is_sweep else folders
    labels = run_labels(runs)
    stored = [stored_run(folder, workers, trust_code) for folder in runs]
    page, notes = folders_page(stored, labels, make_progress())
    for note in notes:
        tell(note)
    file = output or (folders[0] / PAGE if is_sweep else default_page(folders, "play"))
    if is_sweep and output is None:
        folder, command = SweepFolder(folders[0]), ["stixel", "report", str(folders[0])]
        folder.write({PLAYER: page})
        folder.write({PAGE: sweep_page(asked_folders(folders), file, command)})
    else:
        write_new(file, page)
    say(file)
    return 0
