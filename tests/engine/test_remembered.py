"""Results that are no nodes: computed once for the same code and content, and never stale."""

import importlib
import sys

import pytest

from stixel_cli.engine import loaded_code, source_files
from stixel_cli.engine.code import CodeIndex
from stixel_cli.engine.store import Store
from stixel_cli.engine.task import remembered


@pytest.fixture
def draw(tmp_path, monkeypatch):
    """Returns what is remembered of a content, and whether it was computed now."""
    file = tmp_path / "drawn_module.py"
    file.write_text("SIZE = 1\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    store = Store(tmp_path / "cache")

    def run(content):
        calls = []
        module = sys.modules["drawn_module"]
        compute = lambda: calls.append(1) or (module.SIZE, content)  # noqa: E731
        value = remembered(store, "drawing", ["drawn_module"], content, compute)
        return value, bool(calls)

    importlib.import_module("drawn_module")
    # As if the module had been imported after its last edit.
    monkeypatch.setattr(loaded_code, "_started", file.stat().st_mtime + 1.0)
    yield run, file, store
    sys.modules.pop("drawn_module", None)


def test_the_same_content_is_computed_once(draw):
    run, _, store = draw
    assert run({"a": [1, 2]}) == ((1, {"a": [1, 2]}), True)
    assert run({"a": [1, 2]}) == ((1, {"a": [1, 2]}), False)
    assert run({"a": [2, 1]})[1]
    for value in store.folder.glob("??/*/value.joblib"):
        value.write_bytes(b"damaged")
    assert run({"a": [1, 2]}) == ((1, {"a": [1, 2]}), True)


def test_the_next_process_parses_no_module_again(draw, monkeypatch):
    run, _, store = draw
    run("x")
    monkeypatch.setattr(source_files, "_digests", {})
    monkeypatch.setattr(source_files.ast, "parse", lambda *_, **__: pytest.fail("parsed"))
    assert CodeIndex(store.folder).code(["drawn_module"]).modules.keys() == {"drawn_module"}


def test_edited_code_is_computed_again_and_not_stored_by_a_process_that_has_the_old(
    draw, monkeypatch
):
    run, file, _ = draw
    run("x")
    file.write_text("SIZE = 22\n")
    # This process still has the module as it was.
    monkeypatch.setattr(loaded_code, "_started", 0.0)
    assert run("x") == ((1, "x"), True)
    assert run("x") == ((1, "x"), True)
    sys.modules.pop("drawn_module")
    importlib.invalidate_caches()
    importlib.import_module("drawn_module")
    monkeypatch.setattr(loaded_code, "_started", file.stat().st_mtime + 1.0)
    assert run("x") == ((22, "x"), True)
    assert run("x") == ((22, "x"), False)


def test_a_store_that_cannot_be_written_is_no_fault(draw, tmp_path):
    run, _, store = draw
    store.folder.write_text("a file in the place of the folder")
    assert run("x") == ((1, "x"), True)
