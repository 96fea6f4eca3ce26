"""Digests of source files are kept, no edit makes them wrong, and stages run that very source."""

import importlib
import importlib.util
import json
import os
import py_compile
import sys
from hashlib import sha256
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from stixel_cli.engine import cache_folder, loaded_code, source_files
from stixel_cli.engine.code import CodeIndex
from stixel_cli.engine.errors import CodeChanged
from stixel_cli.engine.versions import providers


@pytest.fixture
def new_process(monkeypatch):
    """Forget all digests, as a new process does; return the set of the contents parsed since."""

    def new_process():
        parsed = set()
        monkeypatch.setattr(source_files, "_digests", {})
        monkeypatch.setattr(source_files, "_unsaved", parsed)
        return parsed

    return new_process


def digest(project):
    source_files.load_digests(project.store.folder)
    return CodeIndex().code([f"{project.name}.double"]).digest


def digests_file(project):
    (file,) = (project.store.folder / "sources").glob("digests-*.json")
    return file


@pytest.fixture
def stored(project, new_process):
    """The digest of the stage `double`, which the store knows now."""
    new_process()
    project.run(targets=["double"])
    return digest(project)


def test_an_edit_that_keeps_size_and_time_is_seen(project, new_process, stored):
    parsed = new_process()
    edit_unseen(project, 3, 4)
    assert digest(project) != stored
    assert len(parsed) == 1


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: content[:-20],
        lambda content: content.replace(b"false", b"true", 1),
        lambda content: b"[" * 100_000,
        lambda content: b"\xff" * 100,
    ],
)
def test_a_damaged_file_of_digests_is_replaced(project, new_process, stored, damage):
    file = digests_file(project)
    content = file.read_bytes()
    file.write_bytes(damage(content))
    parsed = new_process()
    assert digest(project) == stored
    assert parsed
    project.run(targets=["double"])
    parsed = new_process()
    assert digest(project) == stored
    assert not parsed


def test_a_large_file_of_digests_is_not_read(project, new_process, stored, monkeypatch):
    monkeypatch.setattr(cache_folder, "LARGEST", 10)
    parsed = new_process()
    assert digest(project) == stored
    assert parsed


def test_two_processes_keep_the_digests_of_both(project, new_process, stored):
    new_process()
    project.write("first", "value = 1")
    CodeIndex().code([f"{project.name}.first"])
    source_files.save_digests(project.store.folder)
    parsed = new_process()
    assert digest(project) == stored
    CodeIndex().code([f"{project.name}.first"])
    assert not parsed


def test_the_newest_digests_are_kept(project, new_process, stored, monkeypatch):
    monkeypatch.setattr(source_files, "MOST_DIGESTS", 2)
    new_process()
    project.write("first", "value = 1")
    CodeIndex().code([f"{project.name}.first"])
    source_files.save_digests(project.store.folder)
    content = digests_file(project).read_bytes().partition(b"\n")[2]
    # Also that of the package's empty `__init__`.
    assert set(json.loads(content)) == {sha256(b"value = 1").hexdigest(), sha256(b"").hexdigest()}


def test_digests_do_not_fail_on_a_store_that_cannot_be_written(project, new_process):
    new_process()
    project.store.folder.write_text("a file, not a folder")
    digest(project)
    source_files.save_digests(project.store.folder)


def test_providers_are_those_of_the_library():
    for top, names in packages_distributions().items():
        assert set(names) <= set(providers()[top]), top


@pytest.fixture
def edited(project, monkeypatch):
    """A module that was edited in its size and its time: the new text, the old bytecode."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    monkeypatch.delenv("PYTHONDONTWRITEBYTECODE")
    source = project.package / "helpers.py"
    py_compile.compile(str(source), doraise=True, invalidation_mode=TIME)
    edit_unseen(project, 3, 5)
    loaded_code._checked.clear()
    return source


def edit_unseen(project, old, new):
    """Another factor, in a file of the same size and time."""
    source = project.package / "helpers.py"
    before = source.stat()
    project.edit("helpers", f"FACTOR = {old}.0", f"FACTOR = {new}.0")
    os.utime(source, ns=(before.st_atime_ns, before.st_mtime_ns))


TIME = py_compile.PycInvalidationMode.TIMESTAMP


def first_double(project, executor="serial"):
    graph = project.graph()
    project.run(graph, ["double"], executor)
    return project.store.load(graph.of_stage("double")[0].key).values.tolist()


def test_stale_bytecode_is_replaced(project, edited):
    assert first_double(project) == [0.0, 10.0, 20.0, 30.0]
    # From now on Python sees such an edit for itself.
    edit_unseen(project, 5, 7)
    assert first_double(project) == [0.0, 14.0, 28.0, 42.0]


def test_workers_replace_stale_bytecode(project, edited):
    assert first_double(project, "local") == [0.0, 10.0, 20.0, 30.0]


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
