"""What is asked of a stored sweep, or of several runs: pages, tables and figures to take."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from stixel_cli.answers import figures, render
from stixel_cli.answers.page import Asked, asked_runs
from stixel_cli.answers.runs import Answer
from stixel_cli.errors import UserError
from stixel_cli.pictures import style
from stixel_cli.results.folder import PAGE
from stixel_cli.results.lineage import shown_revision
from stixel_cli.results.result import DONE, SWEEP_FILE
from stixel_cli.sweeps.design import over_keys
from stixel_cli.sweeps.folder import PLAYER, SUMMARIES, SweepFolder, SweepResult

FIGURES = {"svg": style.svg, "pdf": figures.pdf, "png": style.png}
"""Format of a figure to what writes it."""


def summary_files(result: SweepResult, notes: Mapping[str, Any]) -> dict[str, str]:
    """The summaries and the page by file name; `notes` are those of the sweep's request."""
    every, shown = result.table.answers(result.table.metrics), result.table.answers()
    page = result.folder / PAGE
    texts = (
        render.csv(every),
        f"# {notes['command']}\n\n{render.markdown(shown)}",
        sweep_page(of_sweep(result, notes, shown), page, ["stixel", "report", str(result.folder)]),
    )
    return dict(zip(SUMMARIES, texts, strict=True))


def read_sweep(folder: Path) -> tuple[SweepResult, dict[str, Any]]:
    """The sweep in a folder and its notes; UserError if it is no sweep, or no run is done."""
    request = SweepFolder(folder).request()
    runs = tuple(SweepFolder(folder).runs(request))
    result = SweepResult(folder, runs, axes=request.axes, over=request.over)
    if not result.count(DONE):
        raise UserError(f"{folder}: no run is done; resume with: stixel sweep --resume {folder}")
    return result, request.notes


def of_sweep(result: SweepResult, notes: Mapping[str, Any], answers: Sequence[Answer]) -> Asked:
    """What is asked of a sweep; `notes` are those of its request."""
    git, player = notes.get("git"), result.folder / PLAYER
    origin = {
        "command": notes.get("command", ""),
        "created": notes.get("created", "–"),
        "revision": (shown_revision(git) if isinstance(git, dict) else None) or "–",
    }
    title = f"Sweep {result.folder.resolve().name}"
    is_played = player if player.exists() else None
    return Asked(title, result.table, answers, (), origin, is_played)


def asked_folders(
    folders: Sequence[Path],
    metrics: str | None = None,
    reference: str | None = None,
    over: str | None = None,
    compare: str | None = None,
) -> Asked:
    """What is asked of one sweep's folder, or of the folders of several runs.

    Args:
        metrics, over, compare: names by commas; see `answers.runs.Runs.question`. The last two
            are of a sweep only.
        reference: the option to compare with.

    Raises:
        UserError: for a folder that is neither, and as of `Runs.ask`.
    """
    names = metrics.split(",") if metrics else ()
    if len(folders) > 1 or not (folders[0] / SWEEP_FILE).exists():
        for option, value in (("--over", over), ("--compare", compare)):
            if value is not None:
                raise UserError(f"{option}: is for one sweep; these are runs")
        return asked_runs(folders, names, reference)
    result, notes = read_sweep(folders[0])
    if over is not None:
        result = replace(result, over=over_keys(over, result.axes))
    compared = None if compare is None else compare.split(",")
    answers = result.table.answers(names, compare=compared, reference=reference)
    return of_sweep(result, notes, answers)


def sweep_page(asked: Asked, page: Path, command: Sequence[str]) -> str:
    """The page; `page` is its file, `command` the one that writes it."""
    from stixel_cli.answers.page import answers_page, page_links

    frame = asked.runs.frame
    folders = [Path(one) for one in frame["folder"].dropna()] if "folder" in frame else []
    links = page_links([*folders, *filter(None, [asked.player])], page, PAGE)
    return answers_page(asked, links, command)
