"""Messages about a configuration, in one line each: the key, the fault, and the valid values."""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from stixel_cli.config import keys
from stixel_cli.config.annotations import choices, describe, first_fault, plain_fault, read_as
from stixel_cli.config.folders import group_options, innermost_group, options_of_kind
from stixel_cli.config.texts import suggestion
from stixel_cli.errors import ConfigurationError, counted, printable

LONGEST_REASON = 200

_REPLACED = {("measurement", "simulated"): "measurement=stixels"}
_REPLACED |= {("tracker", "random_matrix"): "tracker=pyrecest tracker.name=ggiw"}
_OTHER_KEYS = {"tracker.class": "tracker.road_user"}
_OTHER_KEYS |= {"measurement.file": "measurement.path", "stereo.disparities": "stereo.nearest, m"}
_OTHER_KEYS |= dict.fromkeys(
    ("rig.disparity_offset", "rig.disparity_slope"), "rig.disparity_error, px of (1, x, x²)"
)
"""Names that a user may type to those of today."""
_OWN = {
    "road_user": "a mesh: road_user.mesh=FILE",
    "tracker": "a function: tracker=MODULE:FUNCTION",
    "measurement": "a function: measurement=MODULE:FUNCTION",
}
"""Groups with options of the user's own, and how these are given."""


def unknown_key(
    name: str, kinds: Mapping[str, str] | None = None, others: Iterable[str] = ()
) -> str:
    """Message: the key `name` is unknown, with the nearest ones; `others` are further valid names.

    `kinds` has the chosen variant of each group, if known.
    """
    if name in _OTHER_KEYS:
        return f"{name}: unknown key; it is called {_OTHER_KEYS[name]}"
    kinds = kinds or {}
    variants = keys.known_keys().get(name)
    name, options = printable(name), group_options()
    if variants:
        # A preset of the user's own may lack a key of its kind.
        owners = dict(variants[0].owners)
        group = next((g for g, kind in owners.items() if kinds.get(g) != kind), next(iter(owners)))
        chosen = f" with {group}={kinds[group]}" if group in kinds else " in the chosen option"
        return f"{name}: unknown key{chosen}; it belongs to {_owners(variants, kinds)}"
    dotted, meant = name.replace("/", "."), name.removesuffix(".kind").replace(".", "/")
    if dotted in keys.known_keys() or meant in options:
        right = dotted if dotted in keys.known_keys() else f"{meant}={'|'.join(options[meant])}"
        return f"{name}: unknown key; did you mean {right}?"
    group = innermost_group(name) or name.partition(".")[0]
    within = group.replace("/", ".") + "."
    inner = [key for key in keys.known_keys() if key.startswith(name + ".")]
    if inner:
        return f"{name}: is a group of keys: give one of them, such as {inner[0]}=VALUE"
    candidates = [
        key
        for key, variants in keys.known_keys().items()
        if not key.startswith(within) or any(v.fits(dict(v.owners) | dict(kinds)) for v in variants)
    ]
    groups = [] if "." in name else options
    hint = suggestion(name, [*groups, *candidates, *others])
    if not hint and group in options:
        its = [key.removeprefix(within) for key in candidates if key.startswith(within)]
        hint = f"; {group} has {', '.join(its) or 'no keys'}"
        hint = hint if len(its) < 20 else f"; `stixel describe {group}` lists its keys"
    elif not hint:
        hint = "; `stixel describe` lists the groups, `stixel run --dry-run` every key"
    return f"{name}: unknown key{hint}"


def _owners(variants: Sequence[keys.Key], kinds: Mapping[str, str]) -> str:
    """The options that each variant of a key belongs to, without the chosen ones."""
    owners = ([(g, kind) for g, kind in v.owners if kinds.get(g) != kind] for v in variants)
    texts = ([f"{g}={'|'.join(options_of_kind(g, kind))}" for g, kind in own] for own in owners)
    return ", ".join(map(" ".join, texts))


def unknown_option(group: str, option: str) -> str:
    """Message: the group has no such option, with the nearest one and all options."""
    if (group, option) in _REPLACED:
        return f"{group}: {option} is gone: use {_REPLACED[group, option]}"
    options = group_options()[group]
    hint = suggestion(option, options, f"{group}={{}}".format)
    if group == "tracker" and option.isidentifier() and Path(f"{option}.py").is_file():
        hint = f"; did you mean tracker={option}:track?"
    text = f"{group}: unknown option {show(option)}{hint} (options: {', '.join(options)})"
    return text + (f"; for your own, give {_OWN[group]}" if group in _OWN else "")


def show(value: Any) -> str:
    """A value as one would type it, on one line, shortened if necessary."""
    if isinstance(value, str):
        return f"'{printable(value)}'"
    return printable(json.dumps(value, ensure_ascii=False, default=str))


_GONE = "is no key of this version: make the run anew without it, or use the version of the folder"
"""Of a key in a stored configuration, which nobody has typed."""

_TYPES = {bool: "a boolean", int: "a whole number", float: "a float", str: "text", list: "a list"}
_UNSUITABLE = {"finite_number": "is not finite", "multiple_of": "does not fit"}
_UNSUITABLE |= dict.fromkeys(
    ("greater_than", "greater_than_equal", "less_than", "less_than_equal", "too_short", "too_long"),
    "is out of range",
)


def describe_fault(fault: Mapping[str, Any], name: str, annotation: Any) -> str:
    """One line for one of pydantic's errors about the key `name`; None for no `annotation`."""
    kind, value = fault["type"], fault["input"]
    if kind == "missing":
        return f"{name}: is missing" + (f": must be {describe(annotation)}" if annotation else "")
    if kind.startswith("union_tag"):
        options = ", ".join(group_options()[innermost_group(name)])
        return f"{name}: its kind is unknown (options: {options})"
    if kind == "json_invalid":
        return "the configuration has text that is not UTF-8"
    if annotation is None:
        return f"{name}: {show(value)}: {plain_fault(fault)}"
    if value is None:
        return f"{name}: has no value: must be {describe(annotation)}"
    # Of a range both bounds, so that the user need not find the other one.
    right, words, hint = describe(annotation), choices(annotation), ""
    what = "is empty" if value == "" else f"is {_TYPES.get(type(value), 'a group of keys')}"
    if kind in _UNSUITABLE:
        what, right = _UNSUITABLE[kind], re.sub("^a (whole )?number (?=[<>≥≤])", "", right)
    elif words and isinstance(value, str):
        what, hint = "is not known", suggestion(value, words)
    elif ends := re.fullmatch(r"(-?\d+)(\.\.|:)(-?\d+)", str(value)):
        # As lists of runs write several seeds, 0..3, or as Python does, 0:4.
        hint = f"; several values: '{name}=range({ends[1]},{int(ends[3]) + (ends[2] != ':')})'"
    return f"{name}: {show(value)} {what}: must be {right}{hint}"


def named_fault(fault: BaseException, file: str = "") -> str:
    """Type and text of an exception of the user's code, and the line, of a `file`, that led to it.

    Without a file it is the innermost line outside of libraries.
    """
    import traceback

    from stixel_cli.engine.errors import StageFailure

    trace = "".join(traceback.format_exception(fault))
    place = StageFailure("", "", fault, trace, frozenset([file])).place
    text = printable(" ".join(f"{type(fault).__name__}: {fault}".split()), LONGEST_REASON)
    # A SyntaxError names its line itself.
    place = printable(place, LONGEST_REASON)
    return f"{text} ({place})" if place and not isinstance(fault, SyntaxError) else text


def validated(kind: type, content: Any, where: Path | str, known: Iterable[str] = ()) -> Any:
    """The content of a file, or of an entry of it, as the dataclass `kind`.

    ConfigurationError in one line that begins with `where` and names the entry; for an unknown one
    it suggests one of those `known`, by default the fields of `kind`.
    """
    from pydantic import ValidationError

    try:
        return read_as(kind, content)
    except ValidationError as error:
        name, text, unknown = first_fault(error)
        names = known or [field.name for field in fields(kind)]
        hint = suggestion(name.rpartition(".")[2], names) if unknown else ""
        text = f"{where}: {printable(name or 'content')}: {printable(text, LONGEST_REASON)}{hint}"
        raise ConfigurationError(text) from None
    except ValueError as fault:
        raise ConfigurationError(f"{where}: {printable(str(fault), 200)}") from None


def read_settings(kind: Any, plain: Any, typed: Iterable[str], group: str = "") -> Any:
    """A configuration in plain types, or its section `group`, as the class `kind`.

    ConfigurationError in one line for the fault to correct first, of the keys `typed` if one of
    them has any, with the number of the others.
    """
    from pydantic import ValidationError

    try:
        return read_as(kind, plain)
    except ValidationError as error:
        within = (group,) if group else ()
        faults = [one | {"loc": (*within, *one["loc"])} for one in error.errors(include_url=False)]
        given, places = tuple(typed), [keys.locate(fault["loc"]) for fault in faults]
        first = next((i for i, (name, _) in enumerate(places) if name.startswith(given)), 0)
        name = places[first][0]
        if faults[first]["type"] == "unexpected_keyword_argument":
            is_gone = not given and name not in keys.known_keys()
            kinds = keys.chosen_kinds({group: plain} if group else plain)
            text = f"{printable(name)}: {_GONE}" if is_gone else unknown_key(name, kinds)
        else:
            text = describe_fault(faults[first], *places[first])
        others = len({name for name, _ in places}) - 1
        more = f" (and {counted(others, 'more fault')})" if others > 0 else ""
        raise ConfigurationError(text + more) from None
    except (TypeError, ValueError) as fault:
        raise ConfigurationError(" ".join(str(fault).split())) from None
