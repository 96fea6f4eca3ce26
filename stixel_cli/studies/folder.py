"""The folder of a study: what was asked for, the sweeps' folders, and the report with its files.

study.yaml         what was asked for
sweeps/NAME/        the sweep of each sweep
report.html        the report
tables/ figures/   its tables as CSV, Markdown and LaTeX and its figures as SVG, once all is there
"""

import shutil
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath

import yaml

from stixel_cli.errors import UserError
from stixel_cli.files import read_yaml, write_whole, written
from stixel_cli.results.folder import check_plain_name
from stixel_cli.results.provenance import provenance
from stixel_cli.studies.differences import differences
from stixel_cli.studies.plan import StudyPlan
from stixel_cli.studies.tables import figures_of, table_csv, table_latex, table_markdown, tables_of
from stixel_cli.studies.types import Findings
from stixel_cli.sweeps.folder import yaml_text

FILE, PAGE = "study.yaml", "report.html"


def study_folder(results: Path, name: str) -> Path:
    """The folder `name` in `results`; UserError if that is no plain name."""
    check_plain_name(name)
    return results / name


class StudyFolder:
    """Reads and writes the folder at `path`; every failure of the disk is a UserError."""

    def __init__(self, path: Path):
        self.path = path

    def sweep(self, name: str) -> Path:
        """The folder of one of its sweeps."""
        return self.path / "sweeps" / name

    def check(self, plan: StudyPlan, fresh: bool) -> bool:
        """Whether there is a folder of this plan to go on with; nothing is written.

        Raises:
            UserError: if the folder is of something else, unless it is a study's and `fresh`.
        """
        if not self.path.exists():
            return False
        if not (self.path / FILE).exists():
            if self.path.is_dir() and not any(self.path.iterdir()):
                return False
            raise UserError(f"{self.path}: exists and is not a study folder; choose another --name")
        if fresh:
            return False
        # As it would be read back.
        wanted = yaml.safe_load(yaml_text(plan.request()))
        try:
            found = differences(read_yaml(self.path / FILE), wanted, str(self.path))
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

    def write(self, html: str, findings: Findings | None) -> Path:
        """Write the report, and its tables and figures if there are any; the page's path."""
        with written(self.path):
            for name in ("tables", "figures"):
                shutil.rmtree(self.path / name, ignore_errors=True)
            for name, content in files_of(findings).items() if findings is not None else ():
                write_whole(self.path / name, content)
            write_whole(self.path / PAGE, html)
        return self.path / PAGE


def files_of(findings: Findings) -> dict[str, str | bytes]:
    """The files next to the page, by their path in the folder.

    Raises:
        UserError: if two files have one name, or a name is not a path inside the folder.
    """
    named: list[tuple[str, str | bytes]] = []
    for table in tables_of(findings):
        named.append((f"tables/{table.name}.csv", table_csv(table)))
        named.append((f"tables/{table.name}.md", table_markdown(table)))
        named.append((f"tables/{table.name}.tex", table_latex(table)))
    named += [(f"figures/{figure.name}.svg", figure.svg) for figure in figures_of(findings)]
    named += findings.files.items()
    files = dict(named)
    if len(files) < len(named):
        names = [name for name, _ in named]
        raise UserError(f"report: two files have the name {next(n for n in names if names.count(n) > 1)}")
    for name in files:
        path = PurePosixPath(name)
        if path.is_absolute() or ".." in path.parts or name in (FILE, PAGE):
            raise UserError(f"report: {name!r} is not a valid file name in a study's folder")
    return files
