"""Overrides of a whole study: they replace the values of its sweeps."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from stixel_cli.config import messages
from stixel_cli.config.compose import Composer
from stixel_cli.config.folders import group_options
from stixel_cli.config.overrides import check_overrides, parse_overrides, single_overrides
from stixel_cli.config.own_options import own_groups
from stixel_cli.errors import BelongsElsewhere, ConfigurationError
from stixel_cli.results.text import listed
from stixel_cli.sweeps.design import SEED, Axis, Design, check_each, same


def overridden(
    designs: Sequence[Design],
    overrides: Sequence[str],
    names: Sequence[str],
    derived: Collection[str] = (),
) -> tuple[list[Design], list[str]]:
    """The designs of a study's sweeps with overrides, each in every sweep that accepts it.

    A key that a sweep fixes or sweeps takes the given values and stays on its axis. Of zipped keys
    only the steps with these values remain. A key that a sweep lacks is fixed in it, or swept, if
    it fits the sweep's runs. One value that fits only some steps of an axis (a noise fits only
    fabricated measurements) is applied to these steps. Sweeps whose names are in `derived` keep
    the options that they fix: their further axes depend on them. A key whose fixed values
    distinguish the sweeps is refused.

    Returns:
        the designs, and a line for each override that is left out of some sweeps or runs, with
        the sweeps' `names` and the first reason.

    Raises:
        ConfigurationError: for an override that is not valid, or that fits no sweep.
    """
    parsed = parse_overrides(overrides)
    check_overrides(parsed)
    # Groups first, then nested groups: the meaning of a key depends on the options.
    parsed = sorted(
        parsed,
        key=lambda one: (one.key_or_group not in group_options(), one.key_or_group.count("/")),
    )
    composer = Composer()
    designs, notes = list(designs), []
    for override in parsed:
        texts = single_overrides(override, shuffled=False)
        check_each(texts, own_groups(parsed))
        _refuse_distinguishing(
            override.key_or_group,
            {n: design for n, design in zip(names, designs, strict=True) if n not in derived},
        )
        given = messages.printable(override.input_line, 100)
        faults: dict[str, ConfigurationError] = {}
        for i, design in enumerate(designs):
            try:
                if names[i] in derived:
                    _refuse_option(design, override.key_or_group)
                changed = _changed(
                    design, override.key_or_group, texts, override.is_sweep_override()
                )
                without = ""
                if texts[0] in changed.fixed:
                    changed, without = _where_it_fits(changed, texts[0], composer)
                _first_run(changed, composer)
                designs[i] = changed
                if without:
                    notes.append(f"{given}: left out of sweep {names[i]} with {without}")
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


def _changed(design: Design, key: str, texts: Sequence[str], several: bool) -> Design:
    rest = tuple(text for text in design.fixed if key_of(text) != key)
    axes = design.axes
    if any(key in axis.keys for axis in axes):
        axes = tuple(_axis(axis, key, texts) if key in axis.keys else axis for axis in axes)
    elif several:
        new = Axis((key,), tuple((text,) for text in texts))
        # The axis of the seeds stays last.
        last = tuple(axis for axis in axes if axis.keys == (SEED,))
        axes = (*(axis for axis in axes if axis not in last), new, *last)
    else:
        rest = (*rest, *texts)
    return Design(rest, axes, tuple(_left_out(design.left_out, axes)))


def _axis(axis: Axis, key: str, texts: Sequence[str]) -> Axis:
    if axis.keys == (key,):
        return Axis(axis.keys, tuple((text,) for text in texts))
    wanted = [_value(text) for text in texts]
    place = axis.keys.index(key)
    steps = [s for s in axis.steps if any(same(_value(s[place]), value) for value in wanted)]
    if not steps:
        there = ", ".join(dict.fromkeys(step[place].partition("=")[2] for step in axis.steps))
        raise ConfigurationError(
            f"{key}: goes together with {', '.join(k for k in axis.keys if k != key)} here: "
            f"give one of {messages.printable(there, 200)}"
        )
    return Axis(axis.keys, tuple(steps))


def _left_out(entries: Sequence[Any], axes: Sequence[Axis]) -> Iterator[Any]:
    """The entries that still match a run."""
    swept = [(key_of(t), _value(t)) for axis in axes for step in axis.steps for t in step]
    for entry in entries:
        if all(any(k == key and same(v, value) for k, v in swept) for key, value in entry.items()):
            yield entry


def _refuse_distinguishing(key: str, sweeps: Mapping[str, Design]) -> None:
    """Refuse a key that distinguishes the sweeps: their names would then be wrong."""
    fixed = {
        name: text
        for name, design in sweeps.items()
        for text in design.fixed
        if key_of(text) == key
    }
    if len(set(fixed.values())) > 1:
        values = ", ".join(f"{text} in {name}" for name, text in fixed.items())
        raise ConfigurationError(
            f"{key}: its values distinguish the study's sweeps ({values}): leave it out"
        )


def _refuse_option(design: Design, key: str) -> None:
    """Refuse an override of a group that a design fixes and its derived axes depend on."""
    own = next((text for text in design.fixed if key_of(text) == key), None)
    if own is not None and key in group_options():
        raise ConfigurationError(f"{key}: its axes are made for {own}")


def _first_run(design: Design, composer: Composer) -> None:
    first = next(iter(design.combinations(composer)), None)
    if first is not None:
        composer.compose((*design.fixed, *first))


def _where_it_fits(design: Design, text: str, composer: Composer) -> tuple[Design, str]:
    """The design, with a fixed override moved to the steps of an axis that accept it.

    Returns:
        the design, and the steps that are left out with the reason; "" without any.

    Raises:
        ConfigurationError: if the step's first run is not valid for another reason.
    """
    group = re.split("[./]", key_of(text))[0]
    every = list(design.combinations(composer))
    for i, axis in enumerate(design.axes):
        # The option of a key's group, or of a nested group, determines its meaning.
        if not any(key in group_options() and key.split("/")[0] == group for key in axis.keys):
            continue
        faults: dict[tuple[str, ...], BelongsElsewhere] = {}
        for step in axis.steps:
            run = next((texts for texts in every if set(step) <= set(texts)), None)
            try:
                composer.compose((*design.fixed, *(run or step)))
            except BelongsElsewhere as fault:
                faults[step] = fault
        if 0 < len(faults) < len(axis.steps):
            fixed = tuple(one for one in design.fixed if one != text)
            steps = tuple(step if step in faults else (*step, text) for step in axis.steps)
            axes = (*design.axes[:i], Axis(axis.keys, steps), *design.axes[i + 1 :])
            without = listed([" ".join(step) for step in faults])
            reason = next(iter(faults.values()))
            return replace(design, fixed=fixed, axes=axes), f"{without}: {reason}"
    return design, ""


def key_of(text: str) -> str:
    """The key of an override."""
    return text.partition("=")[0].strip().lstrip("+")


def _value(text: str) -> Any:
    return parse_overrides([text])[0].value()
