"""Run a study: the sweeps one after the other, then the report. Its folder:

study.yaml         the request: sweeps, overrides, provenance
sweeps/NAME/       a sweep
report.html        the report
report.json        its answer and its tables as data, once all runs are complete
tables/ figures/   tables as CSV, Markdown and LaTeX, figures as SVG, once all runs are complete
"""

import os
import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from stixel_cli.border.files import read_yaml
from stixel_cli.border.origins import TYPED, Origin, write_below, write_whole, written
from stixel_cli.config.folders import of_the_machine
from stixel_cli.engine.cache_folder import Lease
from stixel_cli.engine.plan import probe
from stixel_cli.errors import Interrupted, UserError
from stixel_cli.results.lineage import first_difference, origin, provenance
from stixel_cli.results.result import SWEEP_FILE, yaml_text
from stixel_cli.studies import report
from stixel_cli.studies.plan import PlannedSweep, StudyPlan, derived_sweep
from stixel_cli.sweeps.folder import SweepFolder, SweepResult
from stixel_cli.sweeps.run import new_sweep, resumed_sweep

FILE, PAGE = "study.yaml", "report.html"
_RESUME = "; resume with: "
_MOST_FAILURES = 5


class Study:
    """A study in its folder, at `path`; a failing disk raises UserError.

    Attributes:
        results: of the sweeps so far, by name.
        states: of all sweeps, as in the report.
        report: None unless every sweep is complete.
        seconds: time until the report was written.
    """

    def __init__(
        self,
        plan: StudyPlan,
        path: Path,
        command: str = "",
        tell: Callable[[str], Any] = lambda text: None,
    ):
        """With the `command` line that runs it.

        `tell` is called with notes before the first run, and with the runs that are out of date
        before their sweep.
        """
        self.plan, self.path, self.command, self.tell = plan, path, command, tell
        self.page, self.report = path / PAGE, None
        self.results: dict[str, SweepResult] = {}
        self.states: tuple[report.SweepState, ...] = ()
        self.started, self.seconds = time.perf_counter(), 0.0

    def check(self, fresh: bool) -> bool:
        """Whether the folder exists and can be resumed by this plan; writes nothing.

        UserError if the folder has another request, unless `fresh`, or is not a study's.
        """
        if not self.path.exists():
            return False
        if not (self.path / FILE).exists():
            if self.path.is_dir() and not any(self.path.iterdir()):
                return False
            raise UserError(f"{self.path}: exists and is not a study folder; choose another --name")
        if fresh:
            return False
        there, wanted = read_yaml(self.path / FILE), self.plan.request()
        difference = first_difference({name: there.get(name) for name in wanted}, wanted)
        if difference is not None:
            raise UserError(
                f"{self.path}: has another request: {difference}; choose another --name, or start "
                "over with --fresh"
            )
        return True

    def begin(self, fresh: bool) -> None:
        """Make the folder, or check that the existing one can be resumed."""
        if self.check(fresh):
            return
        study, overrides = self.plan.study, list(self.plan.overrides)
        content = {"title": study.title, "question": study.question, **origin(self.command)}
        content |= {"overrides": overrides, **self.plan.request()}
        with written(self.path):
            if fresh and self.path.exists():
                shutil.rmtree(self.path)
            write_whole(self.path / FILE, yaml_text(content))

    def run(self, fresh: bool) -> None:
        """Run the missing runs, and write the report; progress is on stderr.

        With `fresh` start over and remove the folder's content; else a folder is resumed.

        Raises:
            UserError: before notes and files if the cache, the scheduler or the folder is unusable.
                Computed results stay.
            Interrupted: by Ctrl-C, after the report is written.
        """
        plans = {one.sweep.name: one.plan for one in self.plan.sweeps if one.plan is not None}
        for plan in plans.values():
            probe(len(plan.missing), plan.store, plan.executor)
        self.begin(fresh)
        of_sweeps = (f"{name}: {note}" for name, plan in plans.items() for note in plan.notes)
        for note in (*self.plan.notes, *of_sweeps):
            self.tell(note)
        try:
            for one in self.plan.sweeps:
                self.compute(one)
        except Interrupted:
            self.write_report()
            raise Interrupted(
                f"interrupted in sweep {one.sweep.name}; what was computed is kept"
                f"{_RESUME}{self.command}"
            ) from None
        except UserError as error:
            with suppress(UserError):
                self.write_report()
            reason = str(error).partition(_RESUME)[0]
            raise type(error)(f"sweep {one.sweep.name}: {reason}{_RESUME}{self.command}") from error
        self.write_report()

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
            result = report.with_stages(result, one.sweep, one.plan.store)
        self.results[one.sweep.name] = result

    def write_report(self) -> None:
        """Write the page; and tables and figures, if all sweeps are complete.

        Then runs that were out of date were computed again: it has the present provenance.
        """
        self.states = tuple(map(self._state, self.plan.sweeps))
        if all(state.complete for state in self.states):
            with self._leased():
                self.report = report.study_report(self.plan.study, self._data())
        seeds = {n: sorted({run.seed for run in own.runs}) for n, own in self.results.items()}
        made = origin(self.command) | {"seeds": seeds}
        files = {} if self.report is None else report.files_of(self.report)
        files[PAGE] = report.study_page(self.plan, self.states, self.report, made, self.page)
        with written(self.path):
            if self.report is not None:
                content = read_yaml(self.path / FILE) | provenance()
                write_whole(self.path / FILE, yaml_text(content))
            for name in ("tables", "figures"):
                shutil.rmtree(self.path / name, ignore_errors=True)
            write_below(self.path, files)
        self.seconds = time.perf_counter() - self.started

    def count(self, nodes: str) -> int:
        """The number of `computed` or `cached` nodes of all sweeps."""
        return sum(getattr(result, nodes) for result in self.results.values())

    def _data(self) -> report.StudyData:
        return report.StudyData({name: own for name, own in self.results.items() if own.complete})

    def _leased(self):
        """A lease on all results that the report can read."""
        runs = [run for result in self.results.values() for run in result.runs]
        keys = {target for run in runs for target in run.targets}
        store = next(one.plan.store for one in self.plan.sweeps if one.plan)
        return Lease(store.folder, sorted(keys))

    def _sweep(self, one: PlannedSweep) -> SweepResult:
        name = one.sweep.name
        path, label = self.path / "sweeps" / name, f"{self.plan.study.name} {name}"
        if (path / SWEEP_FILE).exists():
            request = SweepFolder(path).request()
            texts = [run.overrides for run in one.plan.runs]
            # Equal but for overrides of the machine.
            there, wanted = (
                [[text for text in overrides if not of_the_machine(text)] for overrides in runs]
                for runs in (request.runs, texts)
            )
            if there == wanted and request.nodes == one.sweep.results:
                return resumed_sweep(
                    path,
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
        plan = replace(one.plan, design=design)
        return new_sweep(plan, path.parent, path.name, True, label=label)

    def _state(self, one: PlannedSweep) -> report.SweepState:
        name, folder = one.sweep.name, self.path / "sweeps" / one.sweep.name
        result = self.results.get(name)
        if result is None:
            count = None if one.plan is None else len(one.plan.runs)
            done = len(list(folder.glob("runs/[0-9]*")))
            why = "not started" if count is not None else "its axes depend on the sweeps before"
            return report.SweepState(name, count, done, ("interrupted" if done else why,), folder)
        faults = tuple(result.faults(_MOST_FAILURES))
        return report.SweepState(name, len(result.runs), result.count("done"), faults, folder)
