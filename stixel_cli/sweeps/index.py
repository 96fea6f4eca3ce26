"""One page of all runs and sweeps below a folder, `results/index.html`; their lines in lists."""

import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

from stixel_cli.border import write_whole
from stixel_cli.config.texts import split_override
from stixel_cli.engine.cache_folder import file_lock
from stixel_cli.errors import UserError, counted
from stixel_cli.evaluation.metric_table import metric
from stixel_cli.evaluation.verdict import verdict
from stixel_cli.experiment.run_names import differences, short_setting, swept_setting
from stixel_cli.files import read_text
from stixel_cli.report.metrics import shown_value
from stixel_cli.report.static_page import filled_page
from stixel_cli.results.folder import PAGE
from stixel_cli.results.reader import SWEEP_FILE, find_folders
from stixel_cli.results.result import DONE, RunResult, listed_run
from stixel_cli.sweeps.folder import TABLE, SweepFolder
from stixel_cli.version import __version__

SHOWN = ("centre_rmse_m", "iou_mean", "iou_box_mean")
"""The metrics of a line."""

GROUPS = ("road_user", "path", "measurement", "tracker")
"""The groups by whose options the page groups its rows."""

REPORT = "report.html"
"""The page of a study."""

MOST_AXES = 5
"""Axes of a sweep in its line."""

PATIENCE = 10.0
"""Seconds to wait for another command that updates the page."""

_DATA = '<script type="application/json" id="runs">'


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
        columns = [(name, metric(name).short_label, metric(name).shown_unit) for name in SHOWN]
        tops = {row["path"].partition("/")[0] for row in rows}
        data = {
            "version": __version__,
            "groups": GROUPS,
            "columns": columns,
            # The folders of studies.
            "reports": {t: _link(f"{t}/{REPORT}") for t in tops if (root / t / REPORT).is_file()},
            "rows": rows,
        }
        title = f"Runs in {root.resolve().name}"
        write_whole(page, filled_page(__package__, PAGE, title, data))


def _known_rows(page: Path) -> dict[str, dict[str, Any]]:
    """The rows of an older page by path; UserError if it is another page."""
    _, found, rest = read_text(page).partition(_DATA)
    if not found:
        raise UserError(f"{page}: not a page of runs")
    with suppress(ValueError, KeyError, TypeError):
        data = json.loads(rest.partition("</script>")[0])
        # Another version has other verdicts.
        if data["version"] == __version__:
            return {row["path"]: row for row in data["rows"]}
    return {}


def _row(root: Path, folder: Path, known: dict[str, dict[str, Any]]) -> dict[str, Any]:
    path = folder.relative_to(root).as_posix()
    pages = (folder / PAGE, folder.with_name(f"report-{folder.name}.html"), folder)
    found = next(page for page in pages if page.exists())
    link = _link(found.relative_to(root).as_posix() + "/" * (found == folder))
    files = (folder / name for name in ("manifest.json", "metrics.json", SWEEP_FILE, TABLE))
    stamp = [file.stat().st_mtime_ns if file.is_file() else 0 for file in files]
    if known.get(path, {}).get("stamp") == stamp:
        return known[path] | {"page": link}
    row = {"path": path, "page": link, "stamp": stamp}
    try:
        return row | _content(listed_run(folder))
    except UserError as fault:
        return row | {"fault": str(fault)}
    except Exception as fault:
        # A foreign or damaged folder may have any content.
        return row | {"fault": f"not a valid result: {type(fault).__name__}: {fault}"}


def _link(path: str) -> str:
    return quote(os.fsencode(f"./{path}"))


def _content(run: RunResult) -> dict[str, Any]:
    """What the page shows of a run or sweep; raises any error for a folder of foreign content."""
    if run.failure is not None:
        raise run.failure
    if run.is_sweep:
        metrics, text = _sweep_content(SweepFolder(run.folder))
    else:
        metrics, text = run.metrics, verdict(run.metrics)[0]
    return {
        "kind": "sweep" if run.is_sweep else "run",
        "created": str(run.manifest.get("created", "")),
        "settings": differing(run),
        "seed": run.seed,
        "options": [run.choices.get(group, "") for group in GROUPS],
        "metrics": [[metrics.get(n), shown_value(n, metrics.get(n))] for n in SHOWN],
        "verdict": text,
    }


def _sweep_content(folder: SweepFolder) -> tuple[dict[str, float], str]:
    """Means over the runs of a sweep that are done, and their number, IoU and losses in words."""
    rows = folder.rows()
    done = [row for row in rows if row.get("status") == DONE]
    names = (*SHOWN, "track_lost")
    values = {name: [float(row[name]) for row in done if row.get(name)] for name in names}
    text = f"{len(done)} of {counted(len(rows), 'run')} done"
    iou, lost = values["iou_mean"], values["track_lost"]
    text += f", IoU {min(iou):.2f} to {max(iou):.2f}" if iou else ""
    text += f", {sum(lost):.0f} lost" if lost else ""
    return {name: sum(v) / len(v) for name, v in values.items() if v}, f"{text}."


def differing(run: RunResult) -> str:
    """What differs from the default in a run of `list_runs`, or between the runs of a sweep.

    UserError if the sweep cannot be read.
    """
    if run.is_sweep:
        return _swept(run.folder)
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
        swept_setting(keys, list(dict.fromkeys(run[keys[0]] for run in given)))
        for keys in request.axes
        if keys
    ]
    if len(axes) > MOST_AXES:
        axes = [*axes[:MOST_AXES], f"and {len(axes) - MOST_AXES} more"]
    runs = counted(len(request.runs), "run")
    return ", ".join([" ".join(axes), runs] if axes else [runs])
