"""`stixel report`: a page, a table, a figure or a player of a sweep, or of several runs."""

from pathlib import Path

from stixel_cli.cli import options
from stixel_cli.cli.stored import stored_run
from stixel_cli.cli.terminal import say, say_wrapped, tell
from stixel_cli.errors import UserError

Compare = options.option(str | None, "Swept keys whose values are compared, in a sweep.", "KEYS")
Metrics = options.option(str | None, "Metrics by commas, the main one first.", "NAMES")
Reference = options.option(str | None, "Option to compare with, instead of the best.")


def report(
    folders: options.Folders,
    output: options.Output = None,
    form: options.option(
        str,
        "html, the page; md, tex or csv, one table; svg, pdf or png, one figure.",
        None,
        "--format",
    ) = "html",
    over: options.Over = None,
    compare: Compare = None,
    metrics: Metrics = None,
    reference: Reference = None,
    player: options.flag("--play", "Write the page that plays the runs of one scene back.") = False,
    workers: options.Workers = None,
    trust_code: options.TrustCode = False,
) -> int:
    """Write a page, a table or a figure of a sweep or of several runs.

    The page compares the options of the sweep, by its own folder, or the runs: answers with paired
    intervals, errors over time, settings that differ. With --play, it plays back runs of one scene;
    missing results are computed. The page of one run is already in its folder, as index.html.

    The table has a row for each option and a column for each metric. It is printed without
    --output. The best is in bold only where the intervals of all differences from it exclude 0. The
    figure has the values of each option for the first metric, and the paired differences from the
    best or the reference.

    \b
    Examples:
      stixel report results/simulated results/fabricated
      stixel report results/my_sweep --compare tracker --metrics iou_mean,centre_rmse_m
      stixel report results/my_sweep --metrics iou_mean,centre_rmse_m --format tex
      stixel report results/my_sweep --metrics centre_rmse_m --format pdf
      stixel report --play results/gp results/point
    """
    from stixel_cli.answers.figures import differences
    from stixel_cli.answers.render import TABLES
    from stixel_cli.border import write_new
    from stixel_cli.report.compare import default_page
    from stixel_cli.results.folder import PAGE
    from stixel_cli.sweeps.index import update_index
    from stixel_cli.sweeps.page import FIGURES, asked_folders, sweep_page

    forms = ("html", *TABLES, *FIGURES)
    if form not in forms:
        raise UserError(f"--format: {form}: must be one of {', '.join(forms)}")
    if player:
        if form != "html":
            raise UserError("--play writes a page: leave out --format")
        return _play(folders, output, workers, trust_code)
    asked = asked_folders(folders, metrics, reference, over, compare)
    if form in TABLES:
        text = TABLES[form](asked.answers)
        if output is not None:
            write_new(output, text)
        say(text.rstrip("\n") if output is None else output)
        return 0
    file = output or default_page(folders, *(("figure", form) if form in FIGURES else ()))
    answers = asked.answers
    if form in FIGURES:
        answers = answers[:1]
        write_new(file, differences(answers[0], FIGURES[form]))
    else:
        given = {"--over": over, "--compare": compare, "--metrics": metrics}
        given |= {"--reference": reference, "--output": output and str(output)}
        command = ["stixel", "report", *map(str, folders)]
        command += [word for option, value in given.items() if value for word in (option, value)]
        write_new(file, sweep_page(asked, file, command))
        if (file.parent / PAGE).exists():
            update_index(file.parent)  # It links to the page of a sweep.
    for answer in answers:
        say_wrapped(answer.sentence)
    say(file)
    return 0


def _play(folders: list[Path], output: Path | None, workers: int | None, trust_code: bool) -> int:
    """Write the page that plays runs of one scene, or a sweep, whose page then links to it."""
    if output is not None and not output.parent.is_dir():
        raise UserError(f"--output: the folder {output.parent} does not exist")
    from stixel_cli.border import write_new
    from stixel_cli.engine.progress import Progress
    from stixel_cli.experiment.playback import folders_page
    from stixel_cli.report.compare import default_page, run_labels
    from stixel_cli.results.folder import PAGE
    from stixel_cli.results.reader import SWEEP_FILE
    from stixel_cli.sweeps.folder import PLAYER, SweepFolder
    from stixel_cli.sweeps.page import asked_folders, sweep_page

    is_sweep, runs = len(folders) == 1 and (folders[0] / SWEEP_FILE).exists(), folders
    if is_sweep:
        asked_folders(folders)  # It refuses a sweep that has no page.
        runs = sorted((folders[0] / "runs").glob("[0-9]*"))
    stored = [stored_run(folder, workers, trust_code) for folder in runs]
    page, notes = folders_page(stored, run_labels(runs), Progress(visible=True))
    for note in notes:
        tell(note)
    if is_sweep and output is None:
        folder, file = SweepFolder(folders[0]), folders[0] / PAGE
        folder.write({PLAYER: page})
        command = ["stixel", "report", str(folders[0])]
        folder.write({PAGE: sweep_page(asked_folders(folders), file, command)})
    else:
        file = output or default_page(folders, "play")
        write_new(file, page)
    say(file)
    return 0
