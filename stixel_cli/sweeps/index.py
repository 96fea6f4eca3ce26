"""One page of all runs and sweeps below a folder, `results/index.html`; their lines in lists."""

import json
import os
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from stixel_cli.border.files import read_text
from stixel_cli.border.origins import write_whole
from stixel_cli.config.texts import split_override
from stixel_cli.engine.cache_folder import file_lock
from stixel_cli.errors import UserError, counted
from stixel_cli.evaluation.metric_table import MAIN, metric
from stixel_cli.evaluation.verdict import verdict, word
from stixel_cli.experiment.run_names import differences, short_setting, swept_setting
from stixel_cli.report.metrics import filled_page
from stixel_cli.results.folder import PAGE
from stixel_cli.results.result import (
    DONE,
    GROUPS,
    MANIFEST,
    SWEEP_FILE,
    RunResult,
    find_folders,
    listed_run,
)
from stixel_cli.sweeps.design import NOT_GIVEN
from stixel_cli.sweeps.folder import TABLE, SweepFolder
from stixel_cli.version import __version__

REPORT = "report.html"
"""The page of a study."""

MOST_AXES = 5
"""Axes of a sweep in its line."""

PATIENCE = 10.0
"""Seconds to wait for another command that updates the page."""

_DATA = re.compile('<script type="application/json" id="(?:index|runs)">(.*?)</script>', re.S)
"""Of this page; `runs` in older versions."""
_TEXTS = ("result", "settings", *MAIN, "verdict", "created", "seed", "kind", "folder", *GROUPS)
_LISTS = ("names", "links", "stamps", "rows")


@dataclass(frozen=True)
class Line:
    """A run or sweep in a list."""

    kind: str
    """Run, sweep or study."""
    settings: str
    """That differ from the default, or between the runs of a sweep."""
    word: str
    """Of a run's verdict; the option of a sweep that is shown to be the best."""
    text: str
    """The verdict, or the answer of a sweep."""
    metrics: dict[str, Any]
    """Of a run. A sweep has no mean over its options."""


def line_of(run: RunResult) -> Line:
    """The line of an entry of `list_runs`; UserError if it cannot be read."""
    if run.failure is not None:
        raise run.failure
    if run.is_sweep:
        return Line("sweep", _swept(run.folder), *_answer(run.folder), {})
    text = verdict(run.metrics)[0]
    return Line("run", _differing(run), word(run.metrics) or "", text, dict(run.metrics))


def update_index(root: Path | None) -> None:
    """Write the page of all runs and sweeps below `root`, if that is possible; None: no page.

    Only new and changed folders are read: the old page has the rows of the others. A foreign
    `index.html` is kept. A folder that cannot be read becomes a row that says so.
    """
    if root is None:
        return
    page = root / PAGE
    # A page that cannot be written must not fail the run that is on the disk by now.
    with suppress(OSError, UserError), file_lock(root / ".index.lock").acquire(timeout=PATIENCE):
        known = _known_rows(page) if page.exists() else {}
        rows = [_row(root, folder, known) for folder in find_folders(root)]
        tops = dict.fromkeys(name.partition("/")[0] for name, *_ in rows)
        studies = [name for name in tops if (root / name / REPORT).is_file()]
        rows += [_study(root, name) for name in studies]
        data = {
            "version": __version__,
            "columns": [_column(name) for name in _TEXTS],
            "first": "run or sweep",
            "sorted": _TEXTS.index("created"),
            **dict.fromkeys(("axes", "errors", "options"), ()),
            **{name: [row[i] for row in rows] for i, name in enumerate(_LISTS)},
        }
        title = f"Runs in {root.resolve().name}"
        files = {"css": ["page.css"], "table": ["runs.html"], "script": ["runs.js"]}
        text = filled_page("stixel_cli.report", PAGE, title, data, **files)
        write_whole(page, text)


def _column(name: str) -> dict[str, Any]:
    is_metric, row = name in MAIN, metric(name)
    about = {"title": row.heading, "about": row.label, "bounds": row.bounds} if is_metric else {}
    shown = name not in ("seed", "kind", "folder", *GROUPS)
    wide = name in ("settings", "verdict")
    look = {"shown": shown, "number": is_metric, "wide": wide}
    return {"title": name.replace("_", " ")} | about | look


def _known_rows(page: Path) -> dict[str, tuple]:
    """The rows of an older page by name; UserError if it is another page."""
    found = _DATA.search(read_text(page))
    if found is None:
        raise UserError(f"{page}: not a page of runs")
    with suppress(ValueError, KeyError, TypeError):
        data = json.loads(found[1])
        # Another version has other verdicts.
        titles = [column["title"] for column in data["columns"]]
        if data["version"] == __version__ and titles == [_column(name)["title"] for name in _TEXTS]:
            return {row[0]: row for row in zip(*(data[name] for name in _LISTS), strict=True)}
    return {}


def _row(root: Path, folder: Path, known: dict[str, tuple]) -> tuple[str, str, list, list]:
    """Name, link, stamp and values of a folder."""
    name = folder.relative_to(root).as_posix()
    found = folder / PAGE if (folder / PAGE).exists() else folder
    link = _link(found.relative_to(root).as_posix() + "/" * (found == folder))
    files = (folder / file for file in (MANIFEST, "metrics.json", SWEEP_FILE, TABLE))
    stamp = [file.stat().st_mtime_ns if file.is_file() else 0 for file in files]
    if name in known and known[name][2] == stamp:
        return name, link, stamp, known[name][3]
    run = RunResult(folder=folder)
    try:
        run = listed_run(folder)
        line = line_of(run)
    except Exception as fault:
        # A foreign or damaged folder may have any content.
        is_ours = isinstance(fault, UserError)
        text = str(fault) if is_ours else f"not a valid result: {type(fault).__name__}: {fault}"
        line = Line("not readable", "", "", text, {})
    created = str(run.manifest.get("created", ""))[:16].replace("T", " ")
    top = name.partition("/")[0] if "/" in name else ""
    options = [run.choices.get(group, "") for group in GROUPS]
    metrics = [line.metrics.get(metric) for metric in MAIN]
    texts = line.word, line.settings, *metrics, line.text
    values = [*texts, created, run.seed, line.kind, top, *options]
    return name, link, stamp, values


def _study(root: Path, name: str) -> tuple[str, str, list, list]:
    values = dict.fromkeys(_TEXTS) | {"settings": "report of the study", "kind": "study"}
    values |= dict.fromkeys(("result", "verdict", "created", *GROUPS), "") | {"folder": name}
    return name, _link(f"{name}/{REPORT}"), [], list(values.values())


def _link(path: str) -> str:
    return quote(os.fsencode(f"./{path}"))


def _answer(folder: Path) -> tuple[str, str]:
    """The best option of a sweep, if one is shown to be, and its answer in words."""
    from stixel_cli.sweeps.folder import read_sweep

    try:
        result = read_sweep(folder)
    except UserError:
        return "", "No run is done."
    answer = result.ask()
    done = f"{result.count(DONE)} of {counted(len(result.runs), 'run')} done."
    best = str(answer.best) if answer.shown else ""
    return best, " ".join([done, answer.sentence, *answer.notes])


def _differing(run: RunResult) -> str:
    if run.setting:
        return " ".join(short_setting(key, value) for key, value in run.setting.items())
    # The seed has a column of its own.
    others = [text for text in run.overrides if not text.startswith("seed=")]
    return " ".join(differences(run.choices, others))


def _swept(folder: Path) -> str:
    """`tracker=gp_ekf,contour seed=0..9, 20 runs`."""
    request = SweepFolder(folder).request()
    given = [dict(map(split_override, overrides)) for overrides in request.runs]
    axes = [
        swept_setting(keys, list(dict.fromkeys(run.get(keys[0], NOT_GIVEN) for run in given)))
        for keys in request.axes
        if keys
    ]
    if len(axes) > MOST_AXES:
        axes = [*axes[:MOST_AXES], f"and {len(axes) - MOST_AXES} more"]
    runs = counted(len(request.runs), "run")
    return ", ".join([" ".join(axes), runs] if axes else [runs])
