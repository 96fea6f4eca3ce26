"""A stage runs the source that its key was made of, whatever bytecode there is."""

import importlib
import importlib.util
import os
import py_compile
import sys
from pathlib import Path

import pytest

from stixel_cli.engine import loaded_code
from stixel_cli.engine.errors import CodeChanged


@pytest.fixture
def edited(project, monkeypatch):
    """A module that was edited in its size and its time: the new text, the old bytecode."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    monkeypatch.delenv("PYTHONDONTWRITEBYTECODE")
    source = project.package / "helpers.py"
    py_compile.compile(str(source), doraise=True, invalidation_mode=TIME)
    before = source.stat()
    project.edit("helpers", "FACTOR = 3.0", "FACTOR = 5.0")
    os.utime(source, ns=(before.st_atime_ns, before.st_mtime_ns))
    loaded_code._checked.clear()
    return source


TIME = py_compile.PycInvalidationMode.TIMESTAMP


def first_double(project):
    graph = project.graph()
    project.run(graph, ["double"], executor="serial")
    return project.store.load(graph.of_stage("double")[0].key).values.tolist()


def test_stale_bytecode_is_replaced(project, edited):
    assert first_double(project) == [0.0, 10.0, 20.0, 30.0]
    # From now on Python sees such an edit for itself.
    before = edited.stat()
    project.edit("helpers", "FACTOR = 5.0", "FACTOR = 7.0")
    os.utime(edited, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert first_double(project) == [0.0, 14.0, 28.0, 42.0]


def test_workers_replace_stale_bytecode(project, edited):
    graph = project.graph()
    project.run(graph, ["double"], executor="local")
    values = project.store.load(graph.of_stage("double")[0].key).values
    assert values.tolist() == [0.0, 10.0, 20.0, 30.0]


def test_stale_bytecode_that_was_imported_ends_the_run(project, edited):
    assert importlib.import_module(f"{project.name}.helpers").FACTOR == 3.0
    with pytest.raises(CodeChanged, match=r"helpers.*\.pyc: .*run the command again"):
        loaded_code.check_bytecode({f"{project.name}.helpers": edited})
    assert first_double(project) == [0.0, 10.0, 20.0, 30.0]


def test_stale_bytecode_that_cannot_be_replaced_ends_the_run(project, edited, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError

    monkeypatch.setattr(loaded_code.py_compile, "compile", refuse)
    with pytest.raises(CodeChanged, match=r"helpers.*\.pyc: .*delete it"):
        first_double(project)


def test_right_bytecode_is_compared_with_the_source_once(project, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    source = project.package / "helpers.py"
    file = Path(py_compile.compile(str(source), doraise=True, invalidation_mode=TIME))
    loaded_code._checked.clear()
    loaded_code.check_bytecode({f"{project.name}.helpers": source})
    assert file.read_bytes()[4:8] == loaded_code._BY_HASH
    monkeypatch.setattr(loaded_code, "_code", None)
    loaded_code._checked.clear()
    loaded_code.check_bytecode({f"{project.name}.helpers": source})
