"""A sweep from a file: YAML with `fixed`, `axes`, `zipped`, `seeds` and `leave_out`."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import field, fields, replace
from pathlib import Path
from typing import Annotated, Any

from annotated_types import MinLen

from stixel_cli.border import Origin
from stixel_cli.config import messages
from stixel_cli.config.folders import shipped_folder
from stixel_cli.config.override_checks import check_overrides
from stixel_cli.config.overrides import MOST_VALUES, Override, parse
from stixel_cli.config.texts import override_text
from stixel_cli.errors import ConfigurationError
from stixel_cli.files import check_plain, read_text, read_yaml_text
from stixel_cli.parameters import parameters
from stixel_cli.sweeps.design import SEED, Axis, Design, has, refuse_equal

_MOST_ENTRIES = 50_000
"""Values of a file, aliases expanded: OmegaConf takes 5 s for these."""


@parameters
class _Content:
    """The entries of a sweep's file; the values of a key are a list, or a sweep as typed."""

    fixed: dict[str, Any] = field(default_factory=dict)
    axes: dict[str, Any] = field(default_factory=dict)
    zipped: list[Annotated[dict[str, Any], MinLen(2)]] = field(default_factory=list)
    seeds: Any = None
    leave_out: list[Annotated[dict[str, Any], MinLen(1)]] = field(default_factory=list)


ENTRIES = tuple(one.name for one in fields(_Content))


def find_file(name: str) -> Path:
    """The file of a path, or of a name in `pipelines/studies`; ConfigurationError without one."""
    path = Path(name)
    if path.is_file() or (path.suffix == ".yaml" and path.exists()):
        return path
    shipped = shipped_folder("pipelines") / "studies"
    inside = shipped / f"{name.removesuffix('.yaml')}.yaml"
    if path.name == name and inside.is_file():
        return inside
    known = [file.stem for file in sorted(shipped.glob("*.yaml")) if not is_study(file)]
    hint = messages.suggestion(name, known) or (f" (shipped: {', '.join(known)})" if known else "")
    raise ConfigurationError(f"--from: {messages.printable(name)}: no such file{hint}")


def is_study(path: Path) -> bool:
    """Whether a file describes a study of several sweeps; `pipelines/studies` has both kinds."""
    return re.search("^sweeps:", read_text(path), re.M) is not None


def read_design(path: Path, trusted: bool) -> Design:
    """The design in a file, whose names of code count as `trusted`; UserError if it is wrong."""
    content = read_mapping(path, ENTRIES)
    if "sweeps" in content:
        where = messages.printable(str(path), 200)
        raise ConfigurationError(f"{where}: is a study, not a sweep: stixel study {path.stem}")
    return replace(design_of(content, str(path), Origin(str(path), trusted)), file=str(path))


def design_of(content: Mapping[Any, Any], where: str, origin: Origin) -> Design:
    """The design of entries that `origin` has; ConfigurationError in one line after `where`."""
    where = messages.printable(where, 200)
    given = {key: value for key, value in content.items() if value is not None}
    entries = messages.validated(_Content, given, where, ENTRIES)
    try:
        return _design(entries, origin)
    except ConfigurationError as fault:
        raise ConfigurationError(f"{where}: {fault}") from None


def _design(content: _Content, origin: Origin) -> Design:
    fixed = tuple(parse(override_text(key, value), origin) for key, value in content.fixed.items())
    for override in fixed:
        if override.sweep is not None:
            raise ConfigurationError(f"fixed: {override.text}: one value is needed")
    axes = [_axis("axes", {key: values}, origin) for key, values in content.axes.items()]
    for number, keys in enumerate(content.zipped, start=1):
        axes.append(_axis(f"zipped: entry {number}", keys, origin))
    seeds = content.seeds
    if isinstance(seeds, int) and not isinstance(seeds, bool):
        if not 1 <= seeds <= MOST_VALUES:
            most = f"must be a number from 1 to {MOST_VALUES} or a list"
            raise ConfigurationError(f"seeds: {most}, got {seeds}")
        seeds = list(range(seeds))
    if seeds is not None:
        axes.append(_axis("seeds", {SEED: seeds}, origin))
    swept = [key for axis in axes for key in axis.keys]
    for key, count in Counter([*(one.key for one in fixed), *swept]).items():
        if count > 1:
            raise ConfigurationError(f"{key}: is given twice: give it once")
    design = Design(fixed, tuple(axes), tuple(content.leave_out))
    for key, value in (pair for entry in content.leave_out for pair in entry.items()):
        if key not in swept:
            shown, hint = messages.printable(key), messages.suggestion(key, swept)
            raise ConfigurationError(f"leave_out: {shown} is not on any axis{hint}")
        if not has(design.swept, key, value):
            raise ConfigurationError(f"leave_out: no run has {key}={messages.show(value)}")
    check_overrides(design.overrides)
    return design


def read_mapping(path: Path, entries: Sequence[str]) -> dict[str, Any]:
    """The content of a YAML file with some of `entries`; UserError, which names it, for faults."""
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    text = read_yaml_text(path, _MOST_ENTRIES)
    where = messages.printable(str(path), 200)
    try:
        # OmegaConf reads 1e-6 as a number and refuses a repeated key.
        content = OmegaConf.to_container(OmegaConf.create(text), resolve=False)
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f"line {mark.line + 1}: " if mark is not None else ""
        reason = str(getattr(error, "problem", None) or "not valid YAML")
        raise ConfigurationError(f"{where}: {line}{messages.printable(reason, 200)}") from None
    except (OmegaConfBaseException, AssertionError, ValueError, TypeError, RecursionError) as error:
        # AssertionError: the whole file is one number.
        reason = str(error).partition("\n")[0] or "not valid YAML"
        raise ConfigurationError(f"{where}: {messages.printable(reason, 200)}") from None
    check_plain(content, path)
    if not isinstance(content, dict):
        raise ConfigurationError(
            f"{where}: must have the entries {', '.join(entries)}, as KEY: VALUE"
        )
    return content


def _axis(where: str, keys: Mapping[str, Any], origin: Origin) -> Axis:
    columns = {key: _values(where, key, values, origin) for key, values in keys.items()}
    if len(columns) == 1:
        refuse_equal(*columns.values())
    if len(set(map(len, columns.values()))) > 1:
        counts = ", ".join(f"{key} {len(column)}" for key, column in columns.items())
        raise ConfigurationError(f"{where}: zipped keys need the same number of values: {counts}")
    steps = tuple(zip(*columns.values(), strict=True))
    for step, count in Counter(steps).items():
        if count > 1:
            shown = " ".join(one.text for one in step)
            raise ConfigurationError(f"{where}: {shown} is given twice: two runs would be equal")
    return Axis(tuple(keys), steps)


def _values(where: str, key: str, values: Any, origin: Origin) -> list[Override]:
    if isinstance(values, list):
        if not values:
            raise ConfigurationError(f"{where}: {key} has no values")
        return [parse(override_text(key, value), origin) for value in values]
    if isinstance(values, str):
        # As on the command line: a,b or choice(…), range(…), glob(…).
        parsed = parse(f"{key}={values}", origin)
        if parsed.sweep is not None:
            return parsed.singles()
    raise ConfigurationError(
        f"{where}: {key}: {messages.show(values)} is one value: write a list [a, b], or a sweep "
        "such as range(0,1,0.1)"
    )
