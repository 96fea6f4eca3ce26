"""`stixel ls --code`: the modules whose code differs between two runs."""

import json

from result_folders import make_folder

from stixel_cli.cli.app import main
from stixel_cli.results.differences import code_differences

OLD, NEW = "a" * 32, "b" * 32


def made(folder, code, **manifest):
    make_folder(folder)
    if code is not None:
        (folder / "lineage.json").write_text(json.dumps({"stages": {}, "code": code}))
    file = folder / "manifest.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | manifest))
    return folder


def test_modules_that_differ_are_named_and_how_to_see_it(tmp_path, capsys):
    clean = [{"git": {"revision": digit * 40, "dirty": False}} for digit in "12"]
    one = made(tmp_path / "one", {"pkg.filter": OLD, "pkg.same": NEW}, **clean[0])
    other = made(tmp_path / "other", {"pkg.filter": NEW, "pkg.same": NEW, "new": OLD}, **clean[1])
    expected = [
        "new: only in other",
        "pkg.filter: differs",
        "to see the difference: git diff 111111111111 222222222222",
    ]
    assert code_differences(one, other, ("one", "other")) == expected
    assert main(["ls", str(one), str(other), "--code"]) == 0
    assert capsys.readouterr().out.endswith("\n".join(expected) + "\n")
    assert main(["ls", str(one), str(other), "--code", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["code"] == expected
    assert main(["ls", str(one), str(other), str(one), "--code"]) == 2


def test_a_folder_without_its_code(tmp_path):
    one, plain = made(tmp_path / "one", {"pkg.filter": OLD}), made(tmp_path / "plain", None)
    found = code_differences(one, plain, ("one", "plain"))
    assert found == ["plain: the folder does not record its code"]


def test_equal_code_is_stated(tmp_path, capsys):
    folders = [made(tmp_path / name, {"pkg.filter": OLD}) for name in ("one", "other")]
    assert main(["ls", *map(str, folders), "--code"]) == 0
    assert capsys.readouterr().out.endswith("the code is the same\n")
