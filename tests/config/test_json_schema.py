"""The JSON Schemas of `conf/` and `pipelines/`, and all files of these folders against them."""

import json
import re
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator
from referencing import Registry
from referencing.jsonschema import DRAFT202012
from typer.testing import CliRunner

from stixel_cli.cli.app import app
from stixel_cli.config.keys import WRITTEN, schema_files
from stixel_cli.files import read_yaml
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


def test_the_schemas_are_valid():
    assert {f"{name}.json" for name in WRITTEN} < SCHEMAS.keys()
    for content in SCHEMAS.values():
        Draft202012Validator.check_schema(content)


def test_every_file_names_its_schema_and_follows_it():
    for path in FILES:
        schema = named_schema(path)
        assert schema.parent == FOLDER and schema.name in SCHEMAS, path
        if path.parent.parent.name == "conf":
            assert schema.stem == path.parent.name
        assert faults(schema.name, read_yaml(path) or {}) == [], path


def test_entries_of_sweeps_and_studies_are_those_of_their_readers():
    assert tuple(SCHEMAS["sweep.json"]["properties"]) == SWEEP_ENTRIES
    study = SCHEMAS["study.json"]["properties"]
    assert {*study} == {*study_file.ENTRIES}
    entries = study["questions"]["additionalProperties"]["properties"]
    assert {*entries} == {*study_file.QUESTION_ENTRIES}
    assert entries["better"]["enum"] == ["more", "less", "one"]


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


def test_the_command_writes_them(tmp_path):
    result = CliRunner().invoke(app, ["describe", "--schema", str(tmp_path / "new")])
    assert result.exit_code == 0
    written = {file.name: json.loads(file.read_text()) for file in (tmp_path / "new").iterdir()}
    assert written == SCHEMAS
