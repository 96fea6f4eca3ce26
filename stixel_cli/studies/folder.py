"""The folder of a study.

study.yaml         the request: sweeps, overrides, provenance
sweeps/NAME/       a sweep
report.html        the report
report.json        its answer and its tables as data, once all runs are complete
tables/ figures/   tables as CSV, Markdown and LaTeX, figures as SVG, once all runs are complete
"""

import shutil
from datetime import UTC, datetime
from pathlib import Path

from stixel_cli.border import write_below, write_whole, written
from stixel_cli.errors import UserError
from stixel_cli.files import read_yaml
from stixel_cli.results.differences import first_difference
from stixel_cli.results.folder import check_plain_name
from stixel_cli.results.lineage import provenance
from stixel_cli.results.reader import yaml_text
from stixel_cli.studies.plan import StudyPlan
from stixel_cli.studies.report import Report, files_of

FILE, PAGE = "study.yaml", "report.html"


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
        there, wanted = read_yaml(self.path / FILE), plan.request()
        if isinstance(there, dict):
            there = {name: there.get(name) for name in wanted}
        difference = first_difference(there, wanted)
        if difference is not None:
            raise UserError(
                f"{self.path}: has another request: {difference}; choose another --name, or start "
                "over with --fresh"
            )
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
