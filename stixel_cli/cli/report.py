"""`stixel report` and `stixel ls`: pages, tables and figures of results, and lists of them."""

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.cli import options
from stixel_cli.cli.run import stored_run
from stixel_cli.cli.terminal import print_json, print_table, say, say_wrapped, tell
from stixel_cli.errors import UserError

if TYPE_CHECKING:
    from stixel_cli.results.result import RunResult


Compare = options.option(str | None, "Swept keys whose values are compared, in a sweep.", "KEYS")
Metrics = options.option(str | None, "Metrics by commas, the main one first.", "NAMES")
Reference = options.option(str | None, "Option to compare with, instead of the best.")


def report(
    folders: options.Folders,
    output: options.Output = None,
    form: options.choice(
        "html|md|tex|csv|svg|pdf|png",
        "html, the page; md, tex or csv, one table; svg, pdf or png, one figure.",
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
    from stixel_cli.answers.figures import FORMATS, differences
    from stixel_cli.answers.render import TABLES
    from stixel_cli.border.origins import write_new
    from stixel_cli.results.folder import PAGE, default_page
    from stixel_cli.sweeps.folder import asked_folders, sweep_page
    from stixel_cli.sweeps.index import update_index

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
    file = output or default_page(folders, *(("figure", form) if form in FORMATS else ()))
    answers = asked.answers
    if form in FORMATS:
        answers = answers[:1]
        write_new(file, differences(answers[0], FORMATS[form]))
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
    from stixel_cli.border.origins import write_new
    from stixel_cli.engine.progress import Progress
    from stixel_cli.experiment.stored import folders_page
    from stixel_cli.results.folder import PAGE, default_page, run_labels
    from stixel_cli.results.result import SWEEP_FILE
    from stixel_cli.sweeps.folder import PLAYER, SweepFolder, asked_folders, sweep_page

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


OF_IMAGES = ("correction", "row_difference_px")
COLUMNS = {"iou_box_mean": "box IoU", "centre_rmse_m": "centre (m)"}
COLUMNS |= {"orientation_rmse_deg": "heading (°)"}
"""Metric to its column in a list; the verdict tells whether the track was lost."""


def ls(
    folders: options.argument(
        list[Path] | None,
        "Folder to search (default: results), runs or a sweep.",
        "DIR",
        options.complete_folder,
    ) = None,
    json: options.Json = False,
) -> int:
    """List runs and sweeps, show one, or compare several.

    A folder of runs: one line each, oldest first, with the settings that differ from the default. A
    run: its origin, scores and stages. A sweep: its answer and its runs. Several runs: the settings
    and metrics that differ.

    \b
    Examples:
      stixel ls
      stixel ls results/contour
      stixel ls results/simulated results/fabricated
    """
    from stixel_cli.results.result import MANIFEST, SWEEP_FILE

    folders = folders or [Path("results")]
    if len(folders) > 1:
        _compare(folders, json)
    elif (folders[0] / SWEEP_FILE).exists():
        _show_sweep(folders[0], json)
    elif (folders[0] / MANIFEST).exists():
        _show_run(folders[0], json)
    else:
        _list(folders[0], json)
    return 0


def _list(folder: Path, json: bool) -> None:
    from stixel_cli.results.result import list_runs
    from stixel_cli.sweeps.index import Line, line_of

    entries, runs = [], list_runs(folder)
    for run in runs:
        try:
            entries.append((run, line_of(run)))
        except UserError as fault:
            tell(str(fault))
            entries.append((run, Line("sweep" if run.is_sweep else "run", "", "", str(fault), {})))
    if json:
        print_json([_as_json(*entry) for entry in entries])
    elif not runs:
        tell(f"{folder}: no result folders")
    else:
        columns = ("folder", "settings", "verdict", *COLUMNS.values(), "created", "seed")
        rows = [[str(one.folder.relative_to(folder)), *_row(one, line)] for one, line in entries]
        print_table(columns, rows, right=(3, 4, 5, 7), leave_out=(6, 7, 5, 4))


def _as_json(run: "RunResult", line: Any) -> dict[str, Any]:
    from stixel_cli.evaluation.verdict import word

    return {
        "path": str(run.folder),
        "kind": line.kind,
        "created": str(run.manifest.get("created", "")),
        "choices": line.settings,
        "overrides": run.overrides,
        "swept": run.setting,
        "seed": run.seed,
        "verdict": word(run.metrics),
        "text": line.text,
        "metrics": run.metrics,
        "fault": None if run.failure is None else str(run.failure),
    }


def _row(run: "RunResult", line: Any) -> list[str]:
    from stixel_cli.report.metrics import shown_value

    metrics = line.metrics
    shown = [shown_value(n, metrics[n]) if metrics.get(n) is not None else "" for n in COLUMNS]
    created = str(run.manifest.get("created", ""))[:16].replace("T", " ")
    # A line of the table may break at the spaces.
    settings = re.sub(r",(?=\S)", ", ", line.settings)
    seed = "" if run.seed is None else str(run.seed)
    return [settings, line.word, *shown, created, seed]


def _show_run(folder: Path, json: bool) -> None:
    from stixel_cli.evaluation.verdict import verdict
    from stixel_cli.report.metrics import in_order, score_table
    from stixel_cli.results.result import flat_settings, read_run

    run = read_run(folder)
    manifest, metrics = run.manifest, run.metrics
    if json:
        answer = {"folder": str(folder), "settings": flat_settings(run.settings)}
        answer |= {"metrics": metrics, "verdict": verdict(metrics), "manifest": manifest}
        print_json(answer)
        return
    for sentence in verdict(metrics):
        say_wrapped(sentence)
    say("")
    print_table(*score_table(in_order(metrics)))
    say("")
    print_table(("run", str(folder)), _provenance(run))
    say("")
    stages, cut = manifest.get("stages"), {"key": 12}
    missing = {"stage": "?", "status": "?", "nodes": "", "seconds": "", "key": ""}
    known = [s for s in stages if isinstance(s, dict)] if isinstance(stages, list) else []
    rows = [missing | s | {"stage": s.get("name", "?")} for s in known]
    cells = [[str(row[name])[: cut.get(name)] for name in missing] for row in rows]
    print_table((*missing,), cells, right=(2, 3))


def _show_sweep(folder: Path, json: bool) -> None:
    """Print the request of a sweep, the status of its runs, its answer, and its runs."""
    from stixel_cli.sweeps.folder import SweepFolder

    result = SweepFolder(folder).result()
    if json:
        print_json({"folder": str(folder), "notes": result.request.notes, "runs": result.rows})
        return
    statuses = Counter(run.status for run in result.runs)
    about = [("runs", ", ".join(f"{count} {status}" for status, count in statuses.items()))]
    about += [(n, str(v)) for n, v in result.request.notes.items() if n in ("command", "created")]
    print_table(("sweep", str(folder)), about)
    say("")
    if result.count("done"):
        from stixel_cli.cli.sweep import print_answers

        print_answers(result)
        say("")
        _list(folder / "runs", json)


def _compare(folders: Sequence[Path], json: bool) -> None:
    """Print the settings and metrics in which runs differ."""
    from stixel_cli.evaluation.metric_table import main_first, metric
    from stixel_cli.report.metrics import shown_value
    from stixel_cli.results.folder import run_labels
    from stixel_cli.results.lineage import differing_settings
    from stixel_cli.results.result import read_run

    labels = run_labels(folders)
    from_third = range(len(labels), 2, -1)
    runs = [read_run(folder) for folder in folders]
    settings = differing_settings(runs)
    names = main_first(dict.fromkeys(name for run in runs for name in run.metrics))
    metrics = {name: [run.metrics.get(name) for run in runs] for name in names}
    differing = {name: values for name, values in metrics.items() if len(set(values)) > 1}
    if json:
        tables = {"settings": settings, "metrics": differing}
        for name, table in tables.items():
            tables[name] = {k: dict(zip(labels, v, strict=True)) for k, v in table.items()}
        print_json({"folders": [*map(str, folders)], **tables})
        return
    if differing:
        rows = []
        for name, values in differing.items():
            title = ", ".join(filter(None, (metric(name).label, metric(name).shown_unit)))
            rows.append((title, *(shown_value(name, value) for value in values)))
        right = range(1, 1 + len(labels))
        print_table(("metric", *labels), rows, right, leave_out=from_third)
        say("One run per column: a difference may be due to chance.")
    else:
        say("the metrics are the same")
    say("")
    if settings:
        rows = [(key, *values) for key, values in settings.items()]
        print_table(("setting", *labels), rows, leave_out=from_third)
    else:
        say("the settings are the same")


def _provenance(run: "RunResult") -> list[tuple[str, str]]:
    from stixel_cli.results.lineage import shown_revision

    manifest = run.manifest
    names = ("command", "rerun_of", "created", "seconds", "seed", "workers", *OF_IMAGES)
    rows = [(name, str(manifest[name])) for name in names if name in manifest]
    choices = " ".join(f"{group}={option}" for group, option in run.choices.items())
    rows.append(("choices", choices))
    revision = shown_revision(run.entry("git"))
    rows += [] if revision is None else [("git", revision)]
    for name in ("versions", "machine"):
        rows.append((name, ", ".join(f"{k} {v}" for k, v in run.entry(name).items())))
    return rows
