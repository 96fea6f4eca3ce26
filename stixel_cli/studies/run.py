"""Run a study: the sweeps one after the other, then the report."""

import os
import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from stixel_cli.border import TYPED, Origin, write_below, write_whole, written
from stixel_cli.config import messages
from stixel_cli.config.folders import of_the_machine
from stixel_cli.engine.cache_folder import Lease
from stixel_cli.errors import UserError
from stixel_cli.files import read_yaml
from stixel_cli.results.differences import first_difference
from stixel_cli.results.folder import check_plain_name
from stixel_cli.results.lineage import provenance
from stixel_cli.results.result import SKIPPED, SWEEP_FILE, yaml_text
from stixel_cli.studies.plan import PlannedSweep, StudyPlan, derived_sweep
from stixel_cli.studies.report import (
    Report,
    StudyData,
    SweepState,
    files_of,
    study_page,
    study_report,
    with_stages,
)
from stixel_cli.sweeps.folder import SweepFolder, SweepResult
from stixel_cli.sweeps.graphs import plan_sweep
from stixel_cli.sweeps.run import SweepInterrupted, new_sweep, resumed_sweep

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


_RESUME = "; resume with: "
_MOST_FAILURES = 5


@dataclass(frozen=True)
class StudyResult:
    """Result of a study; `report` is None unless every sweep is complete."""

    folder: Path
    page: Path
    sweeps: tuple[SweepState, ...]
    report: Report | None
    computed: int
    cached: int
    seconds: float


def run_study(
    plan: StudyPlan, folder: Path, command: str, fresh: bool, tell: Callable[[str], Any]
) -> StudyResult:
    """Run the missing runs of a study, and write its report; progress is on stderr.

    Args:
        folder: of the study; resumed if it exists and has the same plan.
        command: the command line that does this.
        fresh: start over and remove the folder's content.
        tell: called with notes before the first run, and with the runs that are out of date before
            their sweep.

    Raises:
        UserError: before notes and files if the cache, the scheduler or the folder is unusable.
            Computed results stay.
        SweepInterrupted: by Ctrl-C, after the report is written.
    """
    run = _Study(plan, StudyFolder(folder), command, tell)
    for one in plan.sweeps:
        if one.plan is not None:
            one.plan.probe()
    run.folder.begin(plan, command, fresh)
    of_sweeps = (f"{p.sweep.name}: {note}" for p in plan.sweeps if p.plan for note in p.plan.notes)
    for note in (*plan.notes, *of_sweeps):
        tell(note)
    try:
        for one in plan.sweeps:
            run.compute(one)
    except SweepInterrupted:
        run.report()
        raise SweepInterrupted(
            f"interrupted in sweep {one.sweep.name}; what was computed is kept{_RESUME}{command}"
        ) from None
    except UserError as error:
        with suppress(UserError):
            run.report()
        reason = str(error).partition(_RESUME)[0]
        raise type(error)(f"sweep {one.sweep.name}: {reason}{_RESUME}{command}") from error
    return run.report()


class _Study:
    """The state of one study."""

    def __init__(
        self, plan: StudyPlan, folder: StudyFolder, command: str, tell: Callable[[str], Any]
    ):
        self.plan, self.folder, self.command, self.tell = plan, folder, command, tell
        self.results: dict[str, SweepResult] = {}
        self.started = time.perf_counter()
        self.store = next(one.plan.store for one in plan.sweeps if one.plan)

    def compute(self, one: PlannedSweep) -> None:
        """Compute a sweep's missing runs, unless its axes depend on an incomplete sweep."""
        if one.sweep.derive is not None:
            before = self.plan.sweeps[: self.plan.sweeps.index(one)]
            if any(other.sweep.name not in self._data().sweeps for other in before):
                return
            with self._leased():
                axes = self.plan.study.further_axes(one.sweep.derive, self._data())
            one = derived_sweep(one, axes)
        # A sweep keeps the cache's limit at its end: the results of the sweeps before must stay.
        with self._leased():
            result = self._sweep(one)
        if result.complete:
            result = with_stages(result, one.sweep, self.store)
        self.results[one.sweep.name] = result

    def report(self) -> StudyResult:
        """Write the report; it has statistics only if all sweeps are complete."""
        states = tuple(map(self._state, self.plan.sweeps))
        report = None
        if all(state.complete for state in states):
            with self._leased():
                report = study_report(self.plan.study, self._data())
        origin = {
            "command": self.command,
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "seeds": {
                name: sorted({run.seed for run in result.runs})
                for name, result in self.results.items()
            },
        }
        html = study_page(self.plan, states, report, origin, self.folder.path / PAGE)
        return StudyResult(
            folder=self.folder.path,
            page=self.folder.write(html, report),
            sweeps=states,
            report=report,
            computed=sum(result.computed for result in self.results.values()),
            cached=sum(result.cached for result in self.results.values()),
            seconds=time.perf_counter() - self.started,
        )

    def _data(self) -> StudyData:
        return StudyData({name: own for name, own in self.results.items() if own.complete})

    def _leased(self):
        """A lease on all results that the report can read."""
        keys = {
            target
            for result in self.results.values()
            for run in result.runs
            for target in run.targets
        }
        return Lease(self.store.folder, sorted(keys))

    def _sweep(self, one: PlannedSweep) -> SweepResult:
        name = one.sweep.name
        path, label = self.folder.sweep(name), f"{self.plan.study.name} {name}"
        if (path / SWEEP_FILE).exists():
            request = SweepFolder(path).request()
            texts = [run.overrides for run in one.plan.runs]
            # Equal but for overrides of the machine.
            there, wanted = (
                [[text for text in overrides if not of_the_machine(text)] for overrides in runs]
                for runs in (request.runs, texts)
            )
            if there == wanted and request.nodes == one.sweep.steps:
                return resumed_sweep(
                    path,
                    visible=True,
                    label=label,
                    overrides=[text for text in texts[0] if of_the_machine(text)],
                    note=lambda text: self.tell(f"{name}: {text}"),
                    # They are those of the study; the folder says where the modules are.
                    names=TYPED if request.working_directory == os.getcwd() else Origin(str(path)),
                )
        # The folder is unfinished, or its axes were derived from other results.
        if path.exists():
            shutil.rmtree(path)
        design = replace(one.design, words=("--resume", str(path)))
        plan = plan_sweep(design, nodes=one.sweep.steps)
        return new_sweep(plan, path.parent, path.name, True, advice=False, label=label)

    def _state(self, one: PlannedSweep) -> SweepState:
        name, folder = one.sweep.name, self.folder.sweep(one.sweep.name)
        result = self.results.get(name)
        if result is None:
            count = None if one.plan is None else len(one.plan.runs)
            done = len(list(folder.glob("runs/[0-9]*")))
            why = "not started" if count is not None else "its axes depend on the sweeps before"
            return SweepState(name, count, done, ("interrupted" if done else why,), folder)
        failed = [run for run in result.runs if run.failure is not None]
        faults = [
            f"{run.label}: {messages.printable(' '.join(str(run.failure).split()), 300)}"
            + (" (as another)" if run.status == SKIPPED else "")
            for run in failed[:_MOST_FAILURES]
        ]
        if len(failed) > _MOST_FAILURES:
            faults.append(f"and {len(failed) - _MOST_FAILURES} more, see runs.csv")
        return SweepState(name, len(result.runs), result.count("done"), tuple(faults), folder)
