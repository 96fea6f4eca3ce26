"""`stixel study`: answer a research question by its sweeps and its report."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stixel_cli.cli.completion import complete_study
from stixel_cli.cli.errors import tell
from stixel_cli.cli.options import (
    ConfigDir,
    DryRun,
    Json,
    Results,
    TrustCode,
    Workers,
    argument,
)
from stixel_cli.cli.plan import plan_content, print_plan
from stixel_cli.cli.terminal import console, print_json, print_table, say
from stixel_cli.errors import ConfigurationError, MissingData, UserError

if TYPE_CHECKING:
    from stixel_cli.studies.plan import StudyPlan
    from stixel_cli.studies.run import StudyResult

INCOMPLETE = 1


def study(
    words: Annotated[
        list[str] | None,
        argument(
            "A study of pipelines/studies, or all; then overrides as in `stixel sweep`.",
            "STUDY [OVERRIDES]",
            complete_study,
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(
            help="Name of the result folder (default: the study's name, then the overrides).",
            metavar="<str>",
        ),
    ] = None,
    results: Results = Path("results"),
    workers: Workers = None,
    fresh: Annotated[
        bool,
        typer.Option("--fresh", help="Start over: delete the content of the study's folder."),
    ] = False,
    dry_run: DryRun = False,
    trust_code: TrustCode = False,
    json: Json = False,
    config_dir: ConfigDir = None,
) -> int:
    """Run a study and write its report, tables and figures.

    \b
      accuracy  How accurate are the trackers, for each road user, measurement and path?
      motions   Do the answers of RQ2 and RQ3 hold for real motion?
      robustness       How do the trackers do on other shapes, after gaps, from a wrong start?
      robustness_real  The same on recordings of real sensors.
      rq1       Are these stixels like those of The Stixel World?
      rq2       How well does the tracker work on stixels, compared with lidar?
      rq3       What do fabricated measurements miss?
      thesis    The experiment of the thesis, plain and improved.
      all       All studies, one after the other.

    A study takes minutes to hours. Run the same command again to resume it. Statistics appear once
    all runs are complete; until then the exit code is 1.

    \b
    Examples:
      stixel study rq2
      stixel study rq2 road_user=car 'seed=range(0,3)' --name rq2-car
      stixel study all
    """
    from stixel_cli.studies.file import ALL, shipped_studies

    chosen, *overrides = _checked(words or [], name)
    overrides += [] if workers is None else [f"executor.workers={workers}"]
    options = [] if name is None else ["--name", name]
    options += [] if results == Path("results") else ["--results", str(results)]
    options += ["--trust-code"] if trust_code else []
    wanted = (overrides, options, results, name, dry_run, fresh, trust_code, json)
    if chosen == ALL:
        return _run_all([_Command(each, *wanted) for each in shipped_studies()], json)
    command = _Command(chosen, *wanted)
    answer, code = command.run(command.plan())
    if json:
        print_json(answer)
    return code


def _checked(words: Sequence[str], name: str | None) -> Sequence[str]:
    """The words of the command line: a study, or all, then overrides."""
    from stixel_cli.studies.file import ALL, shipped_studies

    shipped = shipped_studies()
    if not words or "=" in words[0]:
        raise ConfigurationError(f"name a study first: {', '.join(shipped)}, or {ALL}")
    second = next((word for word in words[1:] if word in (*shipped, ALL)), None)
    if second is not None:
        raise ConfigurationError(f"{second}: one command runs one study, or {ALL}")
    if words[0] == ALL and name is not None:
        raise UserError(f"--name names the folder of one study: leave it out with {ALL}")
    return words


def _run_all(commands: "list[_Command]", json: bool) -> int:
    """Run one study after the other; one that fails stops no other."""
    from stixel_cli.sweeps.run import SweepInterrupted

    answers, codes, plans = {}, [0], {}

    def failed(study: str, error: UserError) -> None:
        tell(f"{study}: {error}")
        answers[study] = {"study": study, "complete": False, "error": str(error)}

    # Report studies that cannot run before the first one runs for minutes.
    for command in commands:
        try:
            plans[command] = command.plan()
        except UserError as error:
            failed(command.study, error)
            codes += [] if isinstance(error, MissingData) else [error.exit_code]
    for command, plan in plans.items():
        try:
            answers[command.study], code = command.run(plan)
        except SweepInterrupted:
            raise
        except UserError as error:
            failed(command.study, error)
            code = error.exit_code
        codes.append(code)
    if json:
        print_json({"studies": [answers[command.study] for command in commands]})
    return max(codes)


@dataclass(eq=False)
class _Command:
    """One study as it was requested."""

    study: str
    overrides: Sequence[str]
    options: Sequence[str]
    results: Path
    name: str | None
    dry_run: bool
    fresh: bool
    trust_code: bool
    json: bool

    @property
    def text(self) -> str:
        """The command line."""
        return shlex.join(["stixel", "study", self.study, *self.overrides, *self.options])

    def plan(self) -> "StudyPlan":
        """The study with its overrides.

        Raises:
            UserError: if the study cannot be run with them.
        """
        from stixel_cli.studies.file import find_study, read_study
        from stixel_cli.studies.plan import plan_study

        return plan_study(read_study(find_study(self.study), self.trust_code), self.overrides)

    def run(self, plan: "StudyPlan") -> tuple[dict[str, Any], int]:
        """Run the study, and print the result unless it is to be JSON.

        Returns:
            The result in plain types, and the exit code.
        """
        from stixel_cli.studies.folder import StudyFolder, study_folder
        from stixel_cli.studies.run import run_study

        folder = study_folder(self.results, plan.folder_name if self.name is None else self.name)
        if self.dry_run:
            StudyFolder(folder).check(plan, self.fresh)
            return _planned(plan, self.json), 0
        result = run_study(plan, folder, self.text, self.fresh, tell)
        if not self.json:
            _print(plan, result)
        missing = [state for state in result.sweeps if not state.complete]
        for state in missing:
            for fault in state.faults:
                tell(f"sweep {state.name}: {fault}")
        if missing:
            counts = (f"{state.name} {state.done} of {state.runs or '?'}" for state in missing)
            tell(f"no statistics yet: runs are missing: {', '.join(counts)}; see {result.page}")
            print(self.text, file=sys.stderr)  # noqa: T201
        return _answer(plan, result), INCOMPLETE if missing else 0


def _planned(plan: "StudyPlan", json: bool) -> dict[str, Any]:
    """The plan in plain types; printed unless `json`."""
    sweeps = {
        part.sweep.name: part.plan and plan_content(part.plan, part.design.axes)
        for part in plan.sweeps
    }
    if not json:
        say(*(f"note: {note}" for note in plan.notes))
        for part in plan.sweeps:
            say(f"sweep {part.sweep.name}")
            if part.plan is None:
                say("its axes depend on the results of the sweeps before")
            else:
                print_plan(part.plan, part.design.axes)
            say("")
    return {"study": plan.study.name, "notes": list(plan.notes), "sweeps": sweeps}


def _answer(plan: "StudyPlan", result: "StudyResult") -> dict[str, Any]:
    return {
        "study": plan.study.name,
        "folder": str(result.folder),
        "report": str(result.page),
        "complete": result.findings is not None,
        "answer": None if result.findings is None else list(result.findings.answer),
        "notes": list(plan.notes),
        "nodes": {"computed": result.computed, "cached": result.cached},
        "sweeps": {
            state.name: {
                "runs": state.runs,
                "done": state.done,
                "folder": str(state.folder),
                "faults": list(state.faults),
            }
            for state in result.sweeps
        },
    }


def _print(plan: "StudyPlan", result: "StudyResult") -> None:
    from stixel_cli.report.blocks import Table
    from stixel_cli.report.tables import shown_table

    if result.findings is not None:
        console().print(plan.study.title, markup=False, style="bold")
        for text in result.findings.answer:
            say(text)
        for table in (block for block in result.findings.opening if isinstance(block, Table)):
            header, rows, numeric = shown_table(table)
            say("")
            print_table(header, rows, [i for i, right in enumerate(numeric) if right])
            say(table.caption)
    done = sum(state.done for state in result.sweeps)
    say(
        f"{done} runs done; nodes: {result.computed} computed, {result.cached} cached; "
        f"{result.seconds:.1f} s"
    )
    say(result.page)
    sys.stdout.flush()
