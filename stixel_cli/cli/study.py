"""`stixel study`: answer a research question by its sweeps and its report."""

import shlex
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.cli import options
from stixel_cli.cli.sweep import INCOMPLETE, estimate_text, plan_content, print_plan
from stixel_cli.cli.terminal import print_json, say, say_wrapped, tell
from stixel_cli.config.folders import STUDIES
from stixel_cli.errors import ConfigurationError, Interrupted, MissingData, UserError, counted

if TYPE_CHECKING:
    from stixel_cli.studies.plan import StudyPlan
    from stixel_cli.studies.run import Study


def study(
    words: options.argument(
        list[str] | None,
        "A study of pipelines/studies, or all; then overrides as in `stixel sweep`.",
        "STUDY [OVERRIDES]",
        options.complete_study,
    ) = None,
    name: options.option(
        str | None,
        "Name of the result folder (default: the study's name, then the overrides).",
        "<str>",
    ) = None,
    results: options.Results = Path("results"),
    workers: options.Workers = None,
    fresh: options.flag("--fresh", "Start over: delete the content of the study's folder.") = False,
    dry_run: options.DryRun = False,
    trust_code: options.TrustCode = False,
    json: options.Json = False,
    config_dir: options.ConfigDir = None,
) -> int:
    """Run a study and write its report, tables and figures.

    \b
      accuracy  How accurate are the trackers, for each road user, measurement and path?
      consistency  Is the stated uncertainty that of the errors?
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
    from stixel_cli.results.folder import check_plain_name
    from stixel_cli.studies.file import ALL, read_study
    from stixel_cli.studies.plan import plan_study
    from stixel_cli.studies.run import Study
    from stixel_cli.sweeps.design import find_file
    from stixel_cli.sweeps.index import update_index

    chosen, *overrides = _checked(words or [], name)
    studies = STUDIES if chosen == ALL else (chosen,)
    overrides = options.with_workers(overrides, workers)
    repeated = [] if name is None else ["--name", name]
    repeated += [] if results == Path("results") else ["--results", str(results)]
    repeated += ["--trust-code"] if trust_code else []
    answers, codes, plans = {}, [0], {}

    @contextmanager
    def reported(study: str) -> Iterator[None]:
        """Report a study that fails: of all studies, it stops no other."""
        try:
            yield
        except UserError as error:
            if chosen != ALL or isinstance(error, Interrupted):
                raise
            tell(f"{study}: {error}")
            answers[study] = {"study": study, "complete": False, "error": str(error)}
            codes.append(0 if isinstance(error, MissingData) else error.exit_code)

    # Report studies that cannot run before the first one runs for minutes.
    for study in studies:
        with reported(study):
            file = read_study(find_file(study, study=True), trust_code)
            plans[study] = plan_study(file, overrides)
    for study, plan in plans.items():
        with reported(study):
            own_name = plan.folder_name if name is None else name
            check_plain_name(own_name)
            command = shlex.join(["stixel", "study", study, *overrides, *repeated])
            asked = Study(plan, results / own_name, command, tell)
            if dry_run:
                asked.check(fresh)
                answers[study] = _planned(plan, json)
                continue
            asked.run(fresh)
            if not json:
                _print(asked)
            update_index(results)
            answers[study] = _answer(asked)
            codes.append(_tell_what_is_missing(asked))
    if json:
        print_json({"studies": [*map(answers.get, studies)]} if chosen == ALL else answers[chosen])
    elif dry_run and plans and chosen == ALL:
        say(f"all studies{_total(plans.values())}")
    return max(codes)


def _checked(words: Sequence[str], name: str | None) -> Sequence[str]:
    """The words of the command line: a study, or all, then overrides."""
    from stixel_cli.studies.file import ALL

    if not words or "=" in words[0]:
        raise ConfigurationError(f"name a study first: {', '.join(STUDIES)}, or {ALL}")
    second = next((word for word in words[1:] if word in (*STUDIES, ALL)), None)
    if second is not None:
        raise ConfigurationError(f"{second}: one command runs one study, or {ALL}")
    if words[0] == ALL and name is not None:
        raise UserError(f"--name names the folder of one study: leave it out with {ALL}")
    return words


def _tell_what_is_missing(asked: "Study") -> int:
    """Name the runs that are missing on stderr; returns the exit code."""
    missing = [state for state in asked.states if not state.complete]
    for state in missing:
        for fault in state.faults:
            tell(f"sweep {state.name}: {fault}")
    if not missing:
        return 0
    counts = (f"{state.name} {state.done} of {state.runs or '?'}" for state in missing)
    tell(f"no statistics yet: runs are missing: {', '.join(counts)}; see {asked.page}")
    print(asked.command, file=sys.stderr)  # noqa: T201
    return INCOMPLETE


def _planned(plan: "StudyPlan", json: bool) -> dict[str, Any]:
    """The plan in plain types; printed unless `json`."""
    sweeps = {part.sweep.name: part.plan and plan_content(part.plan) for part in plan.sweeps}
    if not json:
        say(*(f"note: {note}" for note in plan.notes))
        for part in plan.sweeps:
            say(f"sweep {part.sweep.name}")
            if part.plan is None:
                say("its axes depend on the results of the sweeps before")
            else:
                print_plan(part.plan)
            say("")
        if len(plan.sweeps) > 1:
            say(f"all sweeps{_total([plan])}")
    return {"study": plan.study.name, "notes": list(plan.notes), "sweeps": sweeps}


def _total(plans: "Iterable[StudyPlan]") -> str:
    """The estimated time of studies, in which they compute each shared result once."""
    from stixel_cli.sweeps.graphs import estimated

    parts = [part for plan in plans for part in plan.sweeps]
    known = [part.plan for part in parts if part.plan is not None]
    seconds, unmeasured = estimated(known)
    derived = len(parts) - len(known)
    text = estimate_text(seconds, known[0].executor.workers, unmeasured)
    return text + (f", and without {counted(derived, 'derived sweep')}" if derived else "")


def _answer(asked: "Study") -> dict[str, Any]:
    return {
        "study": asked.plan.study.name,
        "folder": str(asked.path),
        "report": str(asked.page),
        "complete": asked.report is not None,
        "answer": None if asked.report is None else list(asked.report.answer),
        "notes": list(asked.plan.notes),
        "nodes": {name: asked.count(name) for name in ("computed", "cached")},
        "sweeps": {one.name: vars(one) | {"folder": str(one.folder)} for one in asked.states},
    }


def _print(asked: "Study") -> None:
    if asked.report is not None:
        say_wrapped(asked.plan.study.title, "bold")
        say_wrapped(asked.report.answer[0])
    done = sum(state.done for state in asked.states)
    nodes = f"{asked.count('computed')} computed, {asked.count('cached')} cached"
    say(f"{done} runs done; nodes: {nodes}; {asked.seconds:.1f} s", asked.page)
    sys.stdout.flush()
