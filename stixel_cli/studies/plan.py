"""The plan of a study: the design of every sweep, checked before any computation."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

from stixel_cli.config import messages
from stixel_cli.config.folders import of_the_machine
from stixel_cli.config.overrides import Override, parse
from stixel_cli.errors import ConfigurationError
from stixel_cli.studies.file import StudyFile, SweepEntry
from stixel_cli.studies.overrides import overridden
from stixel_cli.sweeps.design import Design, check_size
from stixel_cli.sweeps.graphs import SweepPlan
from stixel_cli.sweeps.runs import design_runs
from stixel_cli.sweeps.whole import planned_sweep

_NOT_PLAIN = re.compile(r"[^A-Za-z0-9_.+=,-]+")
_LONGEST_NAME = 100


@dataclass(frozen=True)
class PlannedSweep:
    """A sweep with its design and plan; the plan is None if its axes are derived later."""

    sweep: SweepEntry
    design: Design
    plan: SweepPlan | None
    notes: tuple[str, ...]


@dataclass(frozen=True)
class StudyPlan:
    """A study with its overrides; `notes` list those that are left out of some sweeps."""

    study: StudyFile
    overrides: tuple[str, ...]
    sweeps: tuple[PlannedSweep, ...]
    notes: tuple[str, ...]

    @property
    def folder_name(self) -> str:
        """Default name of the folder: the study's name and its overrides.

        A command finds its folder again, and commands with different results have different ones.
        """
        texts = sorted(_values_text(parse(t)) for t in self.overrides if not of_the_machine(t))
        name = "-".join((self.study.name, *texts))
        plain = _NOT_PLAIN.sub("-", name)[:_LONGEST_NAME]
        # Other overrides could give the same shortened name.
        return name if plain == name else f"{plain}-{sha256(name.encode()).hexdigest()[:8]}"

    def request(self) -> dict[str, Any]:
        """The request in plain types; it is equal for commands with the same results."""
        return {
            "study": self.study.name,
            "template": self.study.template_name,
            "module": self.study.module_name,
            "sweeps": {
                one.sweep.name: {
                    "fixed": [o.text for o in one.design.fixed if not of_the_machine(o.key)],
                    "axes": [
                        {
                            "keys": list(axis.keys),
                            "steps": [[value.text for value in step] for step in axis.steps],
                        }
                        for axis in one.design.axes
                    ],
                    "leave_out": [dict(entry) for entry in one.design.left_out],
                    "results": list(one.sweep.steps),
                    "derive": one.sweep.derive,
                }
                for one in self.sweeps
            },
        }


def _values_text(override: Override) -> str:
    """An override with its values written out: `seed=range(0,2)` becomes `seed=0,1`."""
    return f"{override.key}={','.join(one.value_text for one in override.singles())}"


def plan_study(study: StudyFile, overrides: Sequence[str]) -> StudyPlan:
    """The plan of a study.

    Raises:
        ConfigurationError: in one line, if a run is not valid.
    """
    designs, notes = overridden(
        [study.design(sweep) for sweep in study.sweeps],
        # The request does not depend on their order.
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
    """The design of a sweep with its derived axes."""
    with_axes = one.sweep.design(axes)
    known = {key for axis in one.sweep.design().axes for key in axis.keys}
    new = [axis for axis in with_axes.axes if known.isdisjoint(axis.keys)]
    derived = {key for axis in new for key in axis.keys}
    fixed = tuple(override for override in one.design.fixed if override.key not in derived)
    # An override of a derived key already applies to the earlier sweeps.
    own = [axis for axis in one.design.axes if derived.isdisjoint(axis.keys)]
    # Before the sweep's own axes, the last of which is the seeds'.
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
        if not any(step in run.graph.stages for run in plan.runs):
            known = sorted({name for run in plan.runs for name in run.graph.stages})
            hint = messages.suggestion(step, known) or f" (steps: {', '.join(known)})"
            raise ConfigurationError(
                f"sweep {sweep.name}: results: no pipeline of its runs has a step "
                f"{messages.printable(step)}{hint}"
            )
    return plan, tuple(notes)
