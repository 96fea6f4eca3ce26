"""The schema: JSON Schemas of all files of `conf/` and `pipelines/`, and faults made key by key."""

import copy
import json
import re
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args

import pytest
from annotated_types import Ge, Gt, Le, Lt
from jsonschema import Draft202012Validator
from referencing import Registry
from referencing.jsonschema import DRAFT202012
from typer.testing import CliRunner

from stixel_cli.border.files import read_yaml
from stixel_cli.cli.app import application
from stixel_cli.config.annotations import describe
from stixel_cli.config.compose import compose, from_resolved
from stixel_cli.config.folders import group_options, options_of_kind, outermost_group
from stixel_cli.config.keys import known_keys, locate
from stixel_cli.config.messages import show
from stixel_cli.config.texts import suggestion
from stixel_cli.errors import ConfigurationError
from stixel_cli.export.json_schemas import WRITTEN, schema_files
from stixel_cli.studies import file as study_file
from stixel_cli.sweeps.design import SWEEP_ENTRIES

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "conf" / "schema"
SCHEMAS = {name: json.loads(text) for name, text in schema_files().items()}
REGISTRY = Registry().with_resources(
    (name, DRAFT202012.create_resource(content)) for name, content in SCHEMAS.items()
)
FILES = [path for name in ("conf", "pipelines") for path in sorted((ROOT / name).rglob("*.yaml"))]


def faults(name, content):
    validator = Draft202012Validator({"$ref": name}, registry=REGISTRY)
    return [f"{one.json_path}: {one.message}" for one in validator.iter_errors(content)]


def named_schema(path):
    """The file that the first line names for editors; Hydra wants `# @package` before it."""
    text = path.read_text(encoding="utf-8")
    found = re.match(r"(?:# @package.*\n)?# yaml-language-server: \$schema=(\S+)\n", text)
    return (path.parent / found[1]).resolve() if found else None


def test_the_schemas_are_valid_written_and_have_the_entries_of_their_readers(tmp_path):
    assert {f"{name}.json" for name in WRITTEN} < SCHEMAS.keys()
    for content in SCHEMAS.values():
        Draft202012Validator.check_schema(content)
    assert tuple(SCHEMAS["sweep.json"]["properties"]) == SWEEP_ENTRIES
    study = SCHEMAS["study.json"]["properties"]
    assert {*study} == {field.name for field in fields(study_file.StudyEntries)}
    entries = study["questions"]["additionalProperties"]["properties"]
    assert {"name", *entries} == {field.name for field in fields(study_file.StudyQuestion)}
    assert entries["better"]["enum"] == ["more", "less", "one"]
    result = CliRunner().invoke(application(""), ["describe", "--schema", str(tmp_path / "new")])
    assert result.exit_code == 0
    written = {file.name: json.loads(file.read_text()) for file in (tmp_path / "new").iterdir()}
    assert written == SCHEMAS


def test_every_file_names_its_schema_and_follows_it():
    for path in FILES:
        schema = named_schema(path)
        assert schema.parent == FOLDER and schema.name in SCHEMAS, path
        if path.parent.parent.name == "conf":
            assert schema.stem == path.parent.name
        assert faults(schema.name, read_yaml(path) or {}) == [], path


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("tracker.json", {"kind": "gp_ekf", "basis_point": 50}),
        ("tracker.json", {"kind": "gp_ekf", "basis_points": "fifty"}),
        ("tracker.json", {"kind": "point", "basis_points": 50}),
        ("rig.json", {"width": -1}),
        ("experiment.json", {"path": {"duration": "long"}}),
        ("sweep.json", {"axes": {"tracker.sigma_f": [0.1, "wide"]}}),
        ("sweep.json", {"axis": {}}),
        ("study.json", {"title": "t", "question": "q", "text": "t", "module": "m"}),
    ],
)
def test_a_fault_is_found(name, content):
    assert faults(name, content)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("tracker.json", {"defaults": ["gp_ekf", "_self_"], "basis_points": "${my.points}"}),
        ("rig.json", {"width": "${oc.env:WIDTH}"}),
        ("path.json", {"kind": "turn", "start": ["${pace.x}", 1.0]}),
        ("sweep.json", {"axes": {"tracker": ["contour", "mine:track"], "seed": "range(0,3)"}}),
    ],
)
def test_interpolations_and_options_of_ones_own_are_accepted(name, content):
    assert faults(name, content) == []


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
def test_wrong_types_and_ranges_are_named_with_the_key(group, plain_of):
    for key in keys_of(group):
        text = fault(with_value(plain_of(key), key.name, {"a": 1}))
        assert text.startswith(f"{key.name}: ")
        assert describe(key.annotation) in text
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
