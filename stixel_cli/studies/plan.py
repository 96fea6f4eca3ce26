"""What a study would run: the design of every sweep, checked before anything is computed."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

from stixel_cli.config import messages
from stixel_cli.config.overrides import parse_overrides, single_overrides
from stixel_cli.errors import ConfigurationError
from stixel_cli.experiment.run import OF_THE_MACHINE
from stixel_cli.studies.file import StudyFile, SweepEntry
from stixel_cli.studies.overrides import key_of, overridden
from stixel_cli.sweeps.design import Design, check_size
from stixel_cli.sweeps.graphs import SweepPlan
from stixel_cli.sweeps.runs import design_runs
from stixel_cli.sweeps.whole import planned_sweep

_NOT_PLAIN = re.compile(r"[^A-Za-z0-9_.+=,-]+")
_LONGEST_NAME = 100


@dataclass(frozen=True)
class PlannedSweep:
    """A sweep with its design, and its plan; that is None where axes are derived later."""

    sweep: SweepEntry
    design: Design
    plan: SweepPlan | None
    notes: tuple[str, ...]


@dataclass(frozen=True)
class StudyPlan:
    """A study with its overrides; `notes` say which of them are left out of which sweeps."""

    study: StudyFile
    overrides: tuple[str, ...]
    sweeps: tuple[PlannedSweep, ...]
    notes: tuple[str, ...]

    @property
    def folder_name(self) -> str:
        """Of its folder, unless one is given: the study's name, then its overrides.

        So a command finds its own folder again, and no two commands of different results share one.
        """
        texts = sorted(_values_text(text) for text in self.overrides if not of_the_machine(text))
        name = "-".join((self.study.name, *texts))
        plain = _NOT_PLAIN.sub("-", name)[:_LONGEST_NAME]
        # A name that lost characters could be that of other overrides too.
        return name if plain == name else f"{plain}-{sha256(name.encode()).hexdigest()[:8]}"

    def request(self) -> dict[str, Any]:
        """What is asked for, in plain types: equal for two commands that mean the same results."""
        return {
            "study": self.study.name,
            "template": self.study.template_name,
            "module": self.study.module_name,
            "sweeps": {
                one.sweep.name: {
                    "fixed": [t for t in one.design.fixed if not of_the_machine(t)],
                    "axes": [
                        {"keys": list(axis.keys), "steps": [list(step) for step in axis.steps]}
                        for axis in one.design.axes
                    ],
                    "leave_out": [dict(entry) for entry in one.design.left_out],
                    "results": list(one.sweep.steps),
                    "derive": one.sweep.derive,
                }
                for one in self.sweeps
            },
        }


def _values_text(text: str) -> str:
    """An override with its values written out: `seed=range(0,2)` means what `seed=0,1` means."""
    (parsed,) = parse_overrides([text])
    values = [one.partition("=")[2] for one in single_overrides(parsed, shuffled=False)]
    return f"{parsed.key_or_group}={','.join(values)}"


def of_the_machine(text: str) -> bool:
    """Whether an override says where to compute, on which no result depends."""
    return key_of(text).partition(".")[0] in OF_THE_MACHINE


def plan_study(study: StudyFile, overrides: Sequence[str]) -> StudyPlan:
    """The plan of a study.

    Raises:
        ConfigurationError: in one line, for whatever is wrong with any of its runs.
    """
    designs, notes = overridden(
        [sweep.design() for sweep in study.sweeps],
        # So that their order makes no other request.
        sorted(overrides),
        [sweep.name for sweep in study.sweeps],
        [sweep.name for sweep in study.sweeps if sweep.derive is not None],
    )
    sweeps = []
    for sweep, design in zip(study.sweeps, designs, strict=True):
        if sweep.derive is None:
            sweeps.append(PlannedSweep(sweep, design, *_plan(sweep, design)))
        else:
            sweeps.append(PlannedSweep(sweep, design, None, ()))
    return StudyPlan(study, tuple(overrides), tuple(sweeps), tuple(notes))


def derived_design(plan: StudyPlan, one: PlannedSweep, axes: list[dict[str, list]]) -> Design:
    """The design of a sweep with the axes that were derived for it."""
    with_axes = one.sweep.design(axes)
    known = {key for axis in one.sweep.design().axes for key in axis.keys}
    new = [axis for axis in with_axes.axes if known.isdisjoint(axis.keys)]
    derived = {key for axis in new for key in axis.keys}
    fixed = tuple(text for text in one.design.fixed if key_of(text) not in derived)
    # An override of what is derived has been heard by the sweeps that it is derived from.
    own = [axis for axis in one.design.axes if derived.isdisjoint(axis.keys)]
    # Before the sweep's own, of which the last is that of the seeds.
    design = Design(fixed, (*new, *own), one.design.left_out)
    _plan(one.sweep, design)
    return design


def _plan(sweep: SweepEntry, design: Design) -> tuple[SweepPlan, tuple[str, ...]]:
    try:
        check_size(design, one_is_enough=True)
        plan, notes = planned_sweep(design_runs(design), None, False, sweep.steps)
    except ConfigurationError as fault:
        raise ConfigurationError(f"sweep {sweep.name}: {fault}") from None
    for step in sweep.steps:
        if not any(step in point.graph.stages for point in plan.runs):
            known = sorted({name for point in plan.runs for name in point.graph.stages})
            hint = messages.suggestion(step, known) or f" (steps: {', '.join(known)})"
            raise ConfigurationError(
                f"sweep {sweep.name}: results: no pipeline of its runs has a step "
                f"{messages.printable(step)}{hint}"
            )
    return plan, tuple(notes)
