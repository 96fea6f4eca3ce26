"""Faults made from the schema, key by key, and what is said of each."""

import copy
import re
from typing import Any, get_args

import pytest
from annotated_types import Ge, Gt, Le, Lt

from stixel_cli.config.annotations import describe
from stixel_cli.config.compose import compose, from_resolved
from stixel_cli.config.folders import group_options, options_of_kind, outermost_group
from stixel_cli.config.keys import known_keys, locate
from stixel_cli.config.messages import show
from stixel_cli.config.texts import suggestion
from stixel_cli.errors import ConfigurationError


@pytest.fixture(scope="module")
def plain_of():
    """The resolved configuration in which a group's variant is chosen."""
    composed: dict[tuple[tuple[str, str], ...], dict[str, Any]] = {}

    def resolved(key):
        if key.owners not in composed:
            chosen = [f"{group}={options_of_kind(group, kind)[0]}" for group, kind in key.owners]
            composed[key.owners] = compose(chosen).resolved
        return copy.deepcopy(composed[key.owners])

    return resolved


def limits(annotation):
    for member in (annotation, *get_args(annotation)):
        for limit in getattr(member, "__metadata__", ()):
            match limit:
                case Gt(gt=value):
                    yield value
                case Ge(ge=value):
                    yield value - 1
                case Lt(lt=value):
                    yield value
                case Le(le=value):
                    yield value + 1


def of_numbers(key):
    return describe(key.annotation).startswith(("a number", "a whole number"))


OF_A_RECORDING = {("path", "source"), ("path", "recorded"), ("tracker", "file")}
OF_A_RECORDING |= {("source", kind) for kind in group_options()["source"] if kind != "rendered"}
"""Variants that need a folder: see tests/recordings."""

KEYS = [
    key
    for variants in known_keys().values()
    for key in variants
    if OF_A_RECORDING.isdisjoint(key.owners)
]
GROUPS = sorted({outermost_group(key.name) for key in KEYS})


def keys_of(group):
    return [key for key in KEYS if outermost_group(key.name) == group]


def with_value(plain, name, value):
    *groups, last = name.split(".")
    section = plain
    for group in groups:
        section = section[group]
    assert last in section, f"{name} is in the schema and not in conf/"
    section[last] = value
    return plain


def fault(plain):
    with pytest.raises(ConfigurationError) as error:
        from_resolved(plain)
    text = str(error.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize("group", GROUPS)
def test_wrong_type_names_key_and_type(group, plain_of):
    for key in keys_of(group):
        text = fault(with_value(plain_of(key), key.name, {"a": 1}))
        assert text.startswith(f"{key.name}: ")
        assert describe(key.annotation) in text


@pytest.mark.parametrize("group", GROUPS)
def test_out_of_range_says_the_range(group, plain_of):
    for key in filter(of_numbers, keys_of(group)):
        for value in limits(key.annotation):
            text = fault(with_value(plain_of(key), key.name, value))
            assert re.match(rf"{key.name}: {value} (is out of range|does not fit): must be ", text)
            assert any(sign in text for sign in "<>≤≥")


SLIPS = (
    lambda word: word[:-1],
    lambda word: word + "x",
    lambda word: word[:1] + word[2:],
    lambda word: word[0] + word[2:3] + word[1:2] + word[3:],
)


@pytest.mark.parametrize("start", range(8))
def test_a_slip_finds_the_key(start):
    """Every eighth key, with one slip each: a search over all keys takes a while."""
    for number, name in [*enumerate(known_keys())][start::8]:
        group, dot, last = name.rpartition(".")
        slip = SLIPS[(number // 8 + start) % len(SLIPS)](last)
        typed = f"{group}{dot}{slip}"
        if slip != last and typed not in known_keys() and len(last) > 2:
            assert f" {name}" in suggestion(typed, known_keys()).replace("?", ""), typed


@pytest.mark.parametrize("group", group_options())
def test_a_slip_finds_the_group(group):
    assert f"mean {group}" in suggestion(group[:-1] + "x", [*group_options(), *known_keys()])


def test_every_key_is_found_again():
    for key in KEYS:
        kinds = dict(key.owners)
        path: list[str] = []
        *groups, last = key.name.split(".")
        for i, part in enumerate(groups):
            group = "/".join(groups[: i + 1])
            path += [part, kinds[group]] if group in kinds else [part]
        assert locate((*path, last)) == (key.name, key.annotation)


def test_unknown_place():
    assert locate(("rig", "nope")) == ("rig.nope", None)
    assert locate(("path", "waypoints", "points", 2, 1))[0] == "path.points[2][1]"


def test_words_for_types():
    def words(name, kind=None):
        return next(
            describe(key.annotation)
            for key in known_keys()[name]
            if kind is None or kind in dict(key.owners).values()
        )

    assert words("rig.baseline") == "a number ≥ 0.001 and ≤ 5"
    assert words("rig.width") == "a whole number ≥ 64 and ≤ 4096"
    assert words("rig.horizontal_fov") == "a number ≥ 5 and < 170, or null"
    assert words("road_user.mesh") == "text, or null"
    assert words("path.side", "turn") == "one of left, right"


@pytest.mark.parametrize("text", ["a\nb", "a\tb", "\x1b[31m", "a\u2028b", "x" * 5000])
def test_values_are_shown_on_one_short_line(text):
    shown = show(text)
    assert len(shown) < 80
    assert shown.isprintable()
