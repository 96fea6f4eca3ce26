"""A sweep from a file: YAML with `fixed`, `axes`, `zipped`, `seeds`, `leave_out` and `grids`."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from stixel_cli.border import Origin
from stixel_cli.config import messages
from stixel_cli.config.folders import shipped_folder
from stixel_cli.config.override_checks import check_overrides
from stixel_cli.config.overrides import MOST_VALUES, Override, parse
from stixel_cli.config.texts import override_text
from stixel_cli.errors import ConfigurationError
from stixel_cli.files import check_plain, read_text, read_yaml_text
from stixel_cli.sweeps.design import SEED, Axis, Design, refuse_equal

_MOST_ENTRIES = 50_000
"""Values of a file, aliases expanded: OmegaConf takes 5 s for these."""

GRID = ("fixed", "axes", "zipped", "leave_out")
ENTRIES = ("fixed", "axes", "zipped", "seeds", "leave_out", "grids")


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
    try:
        if "sweeps" in content:
            raise ConfigurationError(f"is a study, not a sweep: stixel study {path.stem}")
        design = design_of(content, Origin(str(path), trusted))
        return replace(design, file=str(path))
    except ConfigurationError as fault:
        where = messages.printable(str(path), 200)
        text = str(fault)
        raise ConfigurationError(text if where in text else f"{where}: {text}") from None


def design_of(content: Mapping[Any, Any], origin: Origin) -> Design:
    """The design of entries that `origin` has; ConfigurationError in one line names the entry."""
    refuse_unknown(content, ENTRIES)
    given = _entry(content, "fixed", {}).items()
    fixed = tuple(parse(override_text(key, value), origin) for key, value in given)
    for override in fixed:
        if override.sweep is not None:
            raise ConfigurationError(f"fixed: {override.text}: one value is needed")
    given = _entry(content, "axes", {}).items()
    axes = [_axis("axes", {key: values}, origin) for key, values in given]
    for number, keys in enumerate(_entry(content, "zipped", []), start=1):
        where = f"zipped: entry {number}"
        if not isinstance(keys, dict) or len(keys) < 2:
            raise ConfigurationError(f"{where}: must map two keys or more to values")
        axes.append(_axis(where, keys, origin))
    if content.get("grids") is not None:
        axes.append(_union(_entry(content, "grids", []), origin))
    seeds = content.get("seeds")
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
    design = Design(fixed, tuple(axes), tuple(_left_out(content, swept)))
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


def refuse_unknown(content: Mapping[Any, Any], entries: Sequence[str]) -> None:
    """Raise ConfigurationError for a name that is not in `entries`; it suggests the nearest."""
    for name in content:
        if name not in entries:
            hint = messages.suggestion(str(name), entries) or f" (entries: {', '.join(entries)})"
            raise ConfigurationError(f"{messages.printable(str(name))}: no such entry{hint}")


def _entry(content: Mapping[str, Any], name: str, default: Any) -> Any:
    """An entry of the type of its default, a mapping or a list."""
    value = default if content.get(name) is None else content[name]
    if isinstance(default, list) and not isinstance(value, list):
        raise ConfigurationError(f"{name}: must be a list of mappings from keys to values")
    if isinstance(default, dict) and not (
        isinstance(value, dict) and all(isinstance(key, str) for key in value)
    ):
        raise ConfigurationError(f"{name}: must map keys of the configuration to values")
    return value


def _axis(where: str, keys: Mapping[str, Any], origin: Origin) -> Axis:
    columns = {k: _values(where, k, values, origin) for k, values in keys.items()}
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


def _union(grids: Sequence[Any], origin: Origin) -> Axis:
    """The points of several grids as one axis: in order, those of two grids once."""
    designs = []
    for number, grid in enumerate(grids, start=1):
        where = f"grids: entry {number}"
        if not isinstance(grid, dict) or not grid:
            raise ConfigurationError(f"{where}: must have some of {', '.join(GRID)}")
        try:
            refuse_unknown(grid, GRID)
            designs.append(design_of(grid, origin))
        except ConfigurationError as fault:
            raise ConfigurationError(f"{where}: {fault}") from None
        if SEED in (one.key for one in designs[-1].overrides):
            raise ConfigurationError(f"{where}: write {SEED}s once, next to grids")
    keys = list(dict.fromkeys(one.key for design in designs for one in design.overrides))
    if not keys:
        raise ConfigurationError("grids: must be a list of one grid or more")
    points = (
        tuple(sorted((*design.fixed, *changes), key=lambda one: keys.index(one.key)))
        for design in designs
        for changes in design.combinations()
    )
    return Axis(tuple(keys), tuple(dict.fromkeys(points)))


def _values(where: str, key: Any, values: Any, origin: Origin) -> list[Override]:
    if not isinstance(key, str):
        raise ConfigurationError(f"{where}: {messages.show(key)} is not a key")
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


def _left_out(content: Mapping[str, Any], swept: Sequence[str]) -> list[dict[str, Any]]:
    entries = _entry(content, "leave_out", [])
    for number, entry in enumerate(entries, start=1):
        where = f"leave_out: entry {number}"
        if not isinstance(entry, dict) or not entry:
            raise ConfigurationError(f"{where}: must map keys to the values to leave out")
        for key in (key for key in entry if key not in swept):
            shown, hint = messages.printable(str(key)), messages.suggestion(str(key), swept)
            raise ConfigurationError(f"{where}: {shown} is not on any axis{hint}")
    return entries
