"""The plan of a study: the design of every sweep with overrides, checked before any computation."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from hashlib import sha256
from typing import Any

from stixel_cli.border.origins import TYPED
from stixel_cli.config import messages
from stixel_cli.config.compose import Composer
from stixel_cli.config.folders import group_options, of_the_machine
from stixel_cli.config.overrides import Override, parse, read_overrides
from stixel_cli.engine.graph import GraphBuilder
from stixel_cli.errors import BelongsElsewhere, ConfigurationError, located
from stixel_cli.results.result import listed
from stixel_cli.studies.file import Axes, StudyFile, SweepEntry
from stixel_cli.sweeps.design import Axis, Design, check_size, has
from stixel_cli.sweeps.graphs import SweepPlan, plan_sweep

_NOT_PLAIN = re.compile(r"[^A-Za-z0-9_.+=,-]+")
_LONGEST_NAME = 100


@dataclass(frozen=True)
class PlannedSweep:
    """A sweep with its design and plan; the plan is None if its axes are derived later."""

    sweep: SweepEntry
    design: Design
    plan: SweepPlan | None

    @property
    def settings(self) -> dict[str, str]:
        """Each key, or axis, to its values as typed; and the entries that decide what is read."""
        found = {o.key: o.value_text for o in self.design.fixed if not of_the_machine(o.key)}
        for axis in self.design.axes:
            single = len(axis.keys) == 1
            steps = (
                step[0].value_text if single else f"({' '.join(one.text for one in step)})"
                for step in axis.steps
            )
            found[axis.name] = ",".join(steps)
        left_out, results = map(dict, self.design.left_out), self.sweep.results
        further = {"leave_out": [*left_out], "results": [*results], "derive": self.sweep.derive}
        return found | {name: str(value) for name, value in further.items() if value}


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
        overrides = [parse(text, TYPED) for text in self.overrides if not of_the_machine(text)]
        # `seed=range(0,2)` is named like `seed=0,1`.
        texts = sorted(f"{o.key}={','.join(v.value_text for v in o.singles())}" for o in overrides)
        name = "-".join((self.study.name, *texts))
        plain = _NOT_PLAIN.sub("-", name)[:_LONGEST_NAME]
        # Other overrides could give the same shortened name.
        return name if plain == name else f"{plain}-{sha256(name.encode()).hexdigest()[:8]}"

    def request(self) -> dict[str, Any]:
        """The request in plain types; it is equal for commands with the same results."""
        sweeps = {one.sweep.name: one.settings for one in self.sweeps}
        return {"study": self.study.name, "module": self.study.module_name, "sweeps": sweeps}


def plan_study(study: StudyFile, overrides: Sequence[str]) -> StudyPlan:
    """The plan of a study; ConfigurationError in one line, if a run is not valid."""
    designs, notes = overridden(
        [sweep.design(study.further_axes(sweep.axes_of)) for sweep in study.sweeps],
        # The request does not depend on their order.
        sorted(overrides),
        [sweep.name for sweep in study.sweeps],
        [sweep.name for sweep in study.sweeps if sweep.derive is not None],
    )
    shared = Composer(), cache(GraphBuilder)
    sweeps = tuple(
        PlannedSweep(sweep, design, None if sweep.derive else _plan(sweep, design, *shared))
        for sweep, design in zip(study.sweeps, designs, strict=True)
    )
    return StudyPlan(study, tuple(overrides), sweeps, tuple(notes))


def derived_sweep(one: PlannedSweep, axes: Axes) -> PlannedSweep:
    """The sweep with its derived axes."""
    with_axes = one.sweep.design(axes)
    known = {key for axis in one.sweep.design().axes for key in axis.keys}
    new = [axis for axis in with_axes.axes if known.isdisjoint(axis.keys)]
    derived = {key for axis in new for key in axis.keys}
    fixed = tuple(override for override in one.design.fixed if override.key not in derived)
    # An override of a derived key already applies to the earlier sweeps.
    own = [axis for axis in one.design.axes if derived.isdisjoint(axis.keys)]
    # Before the sweep's own axes, the last of which is the seeds'.
    design = Design(fixed, (*new, *own), one.design.left_out)
    return replace(one, design=design, plan=_plan(one.sweep, design))


def _plan(sweep: SweepEntry, design: Design, *shared: Any) -> SweepPlan:
    """The plan of a sweep; `shared` are the composer and the builders of graphs."""
    with located(f"sweep {sweep.name}", ConfigurationError, ConfigurationError):
        check_size(design, one_is_enough=True)
        plan = plan_sweep(design, False, sweep.results, *shared)
    for step in sweep.results:
        if not any(step in run.graph.stages for run in plan.runs):
            known = sorted({name for run in plan.runs for name in run.graph.stages})
            hint = messages.suggestion(step, known) or f" (steps: {', '.join(known)})"
            raise ConfigurationError(
                f"sweep {sweep.name}: results: no pipeline of its runs has a step "
                f"{messages.printable(step)}{hint}"
            )
    return plan


def overridden(
    designs: Sequence[Design],
    overrides: Sequence[str],
    names: Sequence[str],
    derived: Collection[str] = (),
) -> tuple[list[Design], list[str]]:
    """The designs of a study's sweeps with overrides, each in every sweep that accepts it.

    A key that a sweep sweeps takes the given values and stays on its axis; of zipped keys only the
    steps with these values remain. A key that a sweep lacks, or fixes, is fixed to one value.
    Sweeps whose names are in `derived` keep the options that they fix: their further axes depend on
    them. A key whose fixed values distinguish the sweeps is refused.

    Also returns a line for each override that is left out of some sweeps, with their `names` and
    the first reason. ConfigurationError for an override that is not valid, or that fits no sweep.
    """
    # Groups first, then nested groups: the meaning of a key depends on the options.
    parsed = sorted(
        read_overrides(overrides, TYPED),
        key=lambda o: (o.key not in group_options(), o.key.count("/")),
    )
    composer = Composer()
    designs, notes = list(designs), []
    for override in parsed:
        values = override.singles()
        underived = {n: own for n, own in zip(names, designs, strict=True) if n not in derived}
        _refuse_distinguishing(override.key, underived)
        given = messages.printable(override.text, 100)
        faults: dict[str, ConfigurationError] = {}
        for i, design in enumerate(designs):
            try:
                own = next((one for one in design.fixed if one.key == override.key), None)
                if own and names[i] in derived and own.key in group_options():
                    raise ConfigurationError(f"{own.key}: its axes are made for {own.text}")
                changed = _changed(design, override.key, values)
                for run in _first_runs(changed):
                    composer.compose((*changed.fixed, *run))
                designs[i] = changed
            except ConfigurationError as fault:
                faults[names[i]] = fault
        if len(faults) == len(designs):
            # The fault of a sweep with the key helps more than that of a sweep without it.
            raise min(faults.values(), key=lambda fault: isinstance(fault, BelongsElsewhere))
        if faults:
            sweeps = "sweeps" if len(faults) > 1 else "sweep"
            first = next(iter(faults.values()))
            notes.append(f"{given}: left out of {sweeps} {listed(list(faults))}: {first}")
    return designs, notes


def _first_runs(design: Design) -> Iterator[tuple[Override, ...]]:
    """The first run of each step of each axis: a key may fit some steps only."""
    seen: set[tuple[Override, ...]] = set()
    for run in design.combinations():
        steps = {step for axis in design.axes for step in axis.steps if set(step) <= set(run)}
        if not steps <= seen or not design.axes:
            seen |= steps
            yield run


def _changed(design: Design, key: str, values: Sequence[Override]) -> Design:
    rest = tuple(one for one in design.fixed if one.key != key)
    axes = design.axes
    if any(key in axis.keys for axis in axes):
        axes = tuple(_axis(axis, key, values) if key in axis.keys else axis for axis in axes)
    elif len(values) > 1:
        raise BelongsElsewhere(f"{key}: is on no axis here: give one value", key)
    else:
        rest = (*rest, *values)
    changed = Design(rest, axes)
    # The entries that still match a run.
    left_out = (
        entry
        for entry in design.left_out
        if all(has(changed.swept, name, value) for name, value in entry.items())
    )
    return replace(changed, left_out=tuple(left_out))


def _axis(axis: Axis, key: str, values: Sequence[Override]) -> Axis:
    if axis.keys == (key,):
        return Axis(axis.keys, tuple((one,) for one in values))
    place = axis.keys.index(key)
    steps = [step for step in axis.steps if has(values, key, step[place].value)]
    if not steps:
        there = ", ".join(dict.fromkeys(step[place].value_text for step in axis.steps))
        raise ConfigurationError(
            f"{key}: goes together with {', '.join(k for k in axis.keys if k != key)} here: "
            f"give one of {messages.printable(there, 200)}"
        )
    return Axis(axis.keys, tuple(steps))


def _refuse_distinguishing(key: str, sweeps: Mapping[str, Design]) -> None:
    """Refuse a key that distinguishes the sweeps: their names would then be wrong."""
    fixed = {
        name: one.text for name, design in sweeps.items() for one in design.fixed if one.key == key
    }
    if len(set(fixed.values())) > 1:
        values = ", ".join(f"{text} in {name}" for name, text in fixed.items())
        raise ConfigurationError(
            f"{key}: its values distinguish the study's sweeps ({values}): leave it out"
        )
