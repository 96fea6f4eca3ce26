"""The folder of a study.

study.yaml         the request: sweeps, overrides, provenance
sweeps/NAME/       a sweep
report.html        the report
report.json        its answer and its tables as data, once all runs are complete
tables/ figures/   tables as CSV, Markdown and LaTeX, figures as SVG, once all runs are complete
"""

import shutil
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from stixel_cli.border import write_below, write_whole, written
from stixel_cli.errors import UserError
from stixel_cli.files import read_yaml
from stixel_cli.results.folder import check_plain_name
from stixel_cli.results.lineage import provenance
from stixel_cli.results.reader import flat_settings, yaml_text
from stixel_cli.studies.plan import StudyPlan
from stixel_cli.studies.report import Report, files_of

FILE, PAGE = "study.yaml", "report.html"
UNSET = "not set"
_LONGEST = 60
"""Characters of a value that are shown."""


def study_folder(results: Path, name: str) -> Path:
    """The folder `name` in `results`; UserError unless `name` is a plain name."""
    check_plain_name(name)
    return results / name


class StudyFolder:
    """Reads and writes the folder at `path`; a failing disk raises UserError."""

    def __init__(self, path: Path):
        self.path = path

    def sweep(self, name: str) -> Path:
        """The folder of a sweep."""
        return self.path / "sweeps" / name

    def check(self, plan: StudyPlan, fresh: bool) -> bool:
        """Whether the folder exists and can be resumed by this plan; writes nothing.

        Raises:
            UserError: if the folder has another request, unless `fresh`, or is not a study's.
        """
        if not self.path.exists():
            return False
        if not (self.path / FILE).exists():
            if self.path.is_dir() and not any(self.path.iterdir()):
                return False
            raise UserError(f"{self.path}: exists and is not a study folder; choose another --name")
        if fresh:
            return False
        try:
            found = differences(read_yaml(self.path / FILE), plan.request(), str(self.path))
        except (UserError, ValueError):
            raise UserError(
                f"{self.path / FILE}: not a valid study file; start over with --fresh"
            ) from None
        if found:
            more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
            raise UserError(f"{found[0]}{more}; choose another --name, or start over with --fresh")
        return True

    def begin(self, plan: StudyPlan, command: str, fresh: bool) -> None:
        """Make the folder, or check that the existing one can be resumed."""
        if self.check(plan, fresh):
            return
        content = {
            "title": plan.study.title,
            "question": plan.study.question,
            "command": command,
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            **provenance(),
            "overrides": list(plan.overrides),
            **plan.request(),
        }
        with written(self.path):
            if fresh and self.path.exists():
                shutil.rmtree(self.path)
            write_whole(self.path / FILE, yaml_text(content))

    def write(self, html: str, report: Report | None) -> Path:
        """Write the report with its tables and figures; return the page's path.

        With a `report` the study is complete, and runs that were out of date were computed again:
        it then has the present provenance.
        """
        with written(self.path):
            if report is not None:
                content = read_yaml(self.path / FILE) | provenance()
                write_whole(self.path / FILE, yaml_text(content))
            for name in ("tables", "figures"):
                shutil.rmtree(self.path / name, ignore_errors=True)
            files = {} if report is None else files_of(report)
            write_below(self.path, files | {PAGE: html})
        return self.path / PAGE


def differences(there: Mapping[str, Any], wanted: Mapping[str, Any], folder: str) -> list[str]:
    """Differences of two `StudyPlan.request`, as `KEY: VALUE in FOLDER, VALUE here`.

    Raises:
        ValueError: if `there` is not a request.
    """
    if not isinstance(there, dict) or not isinstance(there.get("sweeps"), dict):
        raise ValueError("not the request of a study")
    before, after = flat_settings({key: there.get(key) for key in wanted}), flat_settings(wanted)
    pairs = {key: (before.get(key, UNSET), after.get(key, UNSET)) for key in {**after, **before}}
    return [
        f"{key}: {_shown(old, new)} in {folder}, {_shown(new, old)} here"
        for key, (old, new) in pairs.items()
        if old != new
    ]


def _shown(value: str, other: str) -> str:
    """The value; of a long one, the part where it begins to differ from the other."""
    if len(value) <= _LONGEST:
        return value
    pairs = enumerate(zip(value, other, strict=False))
    alike = next((i for i, (one, two) in pairs if one != two), len(other))
    start = max(0, alike - _LONGEST // 2)
    text = value[start : start + _LONGEST]
    return f"{'…' * (start > 0)}{text}{'…' * (start + _LONGEST < len(value))}"
