"""`stixel compare --code`: the source that differs between two runs."""

import json

import pytest
from result_folders import make_folder

from stixel_cli.cli.app import main
from stixel_cli.results.differences import code_differences

OLD, NEW, LOST = "a" * 32, "b" * 32, "c" * 32


@pytest.fixture
def store(tmp_path, monkeypatch):
    """A cache that keeps two sources of a module."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("STIXEL_CACHE", str(folder))
    (folder / "sources").mkdir(parents=True)
    (folder / f"sources/{OLD}.py").write_text("gain = 1.0\nbias = 0.0\n")
    (folder / f"sources/{NEW}.py").write_text("gain = 2.0\nbias = 0.0\n")
    return folder


def made(folder, code, **manifest):
    make_folder(folder)
    if code is not None:
        (folder / "lineage.json").write_text(json.dumps({"stages": {}, "code": code}))
    file = folder / "manifest.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | manifest))
    return folder


def test_kept_sources_are_compared(tmp_path, store, capsys):
    one = made(tmp_path / "one", {"pkg.filter": OLD, "pkg.same": NEW})
    other = made(tmp_path / "other", {"pkg.filter": NEW, "pkg.same": NEW})
    (found,) = code_differences(one, other, ("one", "other"), store)
    assert found.module == "pkg.filter" and found.reason == ""
    assert found.lines[:2] == ("--- one: pkg.filter", "+++ other: pkg.filter")
    assert {"-gain = 1.0", "+gain = 2.0", " bias = 0.0"} <= set(found.lines)
    assert main(["compare", str(one), str(other), "--code"]) == 0
    assert "+gain = 2.0\n" in capsys.readouterr().out
    assert main(["compare", str(one), str(other), "--code", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["code"][0]["module"] == "pkg.filter"
    assert main(["compare", str(one), str(one.parent / "other"), str(one), "--code"]) == 2


def test_an_unknown_source_has_its_reason(tmp_path, store):
    clean = [{"git": {"revision": digit * 40, "dirty": False}} for digit in "12"]
    one = made(tmp_path / "one", {"pkg.filter": OLD}, **clean[0])
    other = made(tmp_path / "other", {"pkg.filter": LOST, "pkg.new": NEW}, **clean[1])
    lost, new = code_differences(one, other, ("one", "other"), store)
    assert lost.lines == ()
    assert lost.reason == (
        "the cache has no copy of the source of other; try: git diff 111111111111 222222222222"
    )
    # A module that only one run has is shown whole.
    assert "+gain = 2.0" in new.lines
    plain = made(tmp_path / "plain", None)
    (found,) = code_differences(one, plain, ("one", "plain"), store)
    assert found.reason == "plain: the folder does not record its code"


def test_a_digest_is_no_path(tmp_path, store):
    (tmp_path / "secret.py").write_text("secret")
    one = made(tmp_path / "one", {"pkg.filter": OLD})
    other = made(tmp_path / "other", {"pkg.filter": "../../secret"})
    (found,) = code_differences(one, other, ("one", "other"), store)
    assert found.lines == () and "no copy of the source of other" in found.reason


def test_equal_code_is_stated(tmp_path, store, capsys):
    folders = [made(tmp_path / name, {"pkg.filter": OLD}) for name in ("one", "other")]
    assert main(["compare", *map(str, folders), "--code"]) == 0
    assert capsys.readouterr().out.endswith("the code is the same\n")
