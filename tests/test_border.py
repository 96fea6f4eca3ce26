"""One module lets names out of the process; the page on security has its table."""

import ast
import re
from dataclasses import replace
from pathlib import Path

import pytest

import stixel_cli
from stixel_cli.border import RULES, TYPED, Origin, admit, forget_told, imported, write_below
from stixel_cli.errors import ConfigurationError, UserError

PACKAGE = Path(stixel_cli.__file__).parent
SECURITY = PACKAGE.parent / "docs" / "security.md"

IMPORTS = {"import_module", "__import__", "spec_from_file_location", "exec", "eval", "run_path"}
IMPORTS |= {"exec_module", "run_module", "resolve_name", "SourceFileLoader", "get_method"}
UNPICKLES = {"loads", "Unpickler", "read_pickle", "unsafe_load", "full_load", "UnsafeLoader"}
CONNECTS = {"Client", "urlopen", "urlretrieve", "create_connection", "socket", "connect"}
WRITES = {"write_text", "write_bytes", "copyfile", "copy", "copytree", "move", "savez", "savetxt"}
WRITES |= {"savez_compressed", "savefig", "imwrite", "tofile", "to_csv", "to_pickle", "touch"}
WRITES |= {"symlink_to", "hardlink_to", "symlink", "link", "dump", "save"}

ALLOWED = {
    ("__init__.py", "import_module"): "names of its own table",
    ("engine/limits.py", "open"): "a mark in the cache",
    ("engine/cache_folder.py", "write_text"): "a lease in the cache",
    ("engine/store.py", "dump"): "an entry of the cache",
    ("engine/store.py", "write_bytes"): "an entry of the cache",
    ("engine/store.py", "touch"): "a probe of the cache",
    ("engine/task.py", "save"): "of the store",
    ("cli/errors.py", "write_text"): "the log of a crash, named by time",
    ("cli/errors.py", "open"): "the null device",
    ("experiment/class_shapes.py", "write_text"): "a script of developers",
    ("export/mlflow_folder.py", "copyfile"): "names of mlflow, in the partial folder",
    ("export/rerun_log.py", "save"): "rerun writes, in the partial folder",
    ("rendering/filament.py", "open"): "a temporary folder",
    ("rendering/filament.py", "savez"): "a temporary folder",
    ("rendering/filament.py", "write_bytes"): "a temporary folder",
    ("rendering/filament_process.py", "savez"): "a temporary folder",
    ("rendering/filament_process.py", "touch"): "a temporary folder",
    ("tracking/several/track_each.py", "resolve_name"): "the tracker of a planned stage",
    ("scene/open3d_import.py", "spec_from_file_location"): "a part of Open3D, by its place",
    ("scene/open3d_import.py", "exec_module"): "a part of Open3D, by its place",
}


@pytest.fixture(autouse=True)
def nothing_told():
    forget_told()


def called(node):
    """The name of a call; "" for one that does nothing of these."""
    name = getattr(node.func, "attr", getattr(node.func, "id", ""))
    owner = getattr(getattr(node.func, "value", None), "id", "")
    first = node.args[0] if node.args else None
    if name in {"import_module", "__import__"} and isinstance(first, ast.Constant):
        return ""
    if name == "open":
        values = [*node.args, *(word.value for word in node.keywords)]
        modes = [str(one.value) for one in values if isinstance(one, ast.Constant)]
        return name if any(re.fullmatch(r"[rbt]*[wax+][bt+]*", mode) for mode in modes) else ""
    in_memory = isinstance(first, ast.NamedExpr) or getattr(first, "id", "") in {"buffer", "stream"}
    plain = owner in {"json", "ast", "marshal", "yaml"} or (name == "copy" and len(node.args) < 2)
    return "" if in_memory or plain else name


def test_only_the_border_imports_by_name_unpickles_connects_and_writes():
    found = set()
    for path in sorted(PACKAGE.rglob("*.py")):
        file = path.relative_to(PACKAGE).as_posix()
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and file != "border.py":
                name = called(node)
                if name in IMPORTS | UNPICKLES | CONNECTS | WRITES | {"open"}:
                    found.add((file, name))
    # An entry that nothing needs any more is an error, too.
    assert found == {*ALLOWED}


def test_the_page_on_security_has_the_table():
    lines = ["| what a name can do | where files have one | from a file |", "|---|---|---|"]
    table = "\n".join([*lines, *(f"| {' | '.join(rule)} |" for rule in RULES)])
    assert f"\n{table}\n" in SECURITY.read_text("utf-8"), table


def test_a_name_from_a_file_needs_trust_and_is_told_once(capsys):
    file = Origin("a/file.yaml")
    with pytest.raises(ConfigurationError, match=r"a/file.yaml: .*\(colorsys\).*--trust-code"):
        imported("colorsys", file)
    for origin in (TYPED, replace(file, trusted=True)) * 2:
        admit([("colorsys", origin)])
        imported("colorsys", origin)
    assert capsys.readouterr().err == "stixel: a/file.yaml: may run colorsys (--trust-code)\n"
    with pytest.raises(ConfigurationError):
        admit([("b", file), ("c", replace(file, trusted=True))])
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("name", ["../x", "/tmp/x", "a/../../x", "", ".", "out/x", "a/.."])
def test_a_path_of_output_stays_below_its_folder(name, tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "out").symlink_to(tmp_path)
    with pytest.raises(UserError, match="not a path below the folder"):
        write_below(folder, {"fine": "1", name: "2"})
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == []


def test_a_link_at_the_place_of_a_file_is_replaced_not_followed(tmp_path):
    (tmp_path / "theirs").write_text("kept")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "page").symlink_to(tmp_path / "theirs")
    write_below(tmp_path / "folder", {"page": "new", "a/b": b"1"})
    assert (tmp_path / "theirs").read_text() == "kept"
    assert (tmp_path / "folder" / "page").read_text() == "new"
