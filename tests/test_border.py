"""One module lets names out of the process; the page on security has its table."""

import ast
import re
from dataclasses import replace

import pytest
from package_trees import trees

from stixel_cli.border.origins import TYPED, Origin, admit, forget_told, imported, write_below
from stixel_cli.config.overrides import Override
from stixel_cli.errors import ConfigurationError, UserError

IMPORTS = {"import_module", "__import__", "spec_from_file_location", "exec", "eval", "run_path"}
IMPORTS |= {"exec_module", "run_module", "resolve_name", "SourceFileLoader", "get_method"}
UNPICKLES = {"loads", "Unpickler", "read_pickle", "unsafe_load", "full_load", "UnsafeLoader"}
CONNECTS = {"Client", "urlopen", "urlretrieve", "create_connection", "socket", "connect"}
WRITES = {"write_text", "write_bytes", "copyfile", "copy", "copytree", "move", "savez", "savetxt"}
WRITES |= {"savez_compressed", "savefig", "imwrite", "tofile", "to_csv", "to_pickle", "touch"}
WRITES |= {"symlink_to", "hardlink_to", "symlink", "link", "dump", "save"}

TYPES = {
    "benchmark/run.py": "words of its command line",
    "benchmark/sequences.py": "the tracker and the workers of the command line",
    "cli/sweep.py": "words of its command line; a stored sweep that is compared, not imported",
    "studies/plan.py": "words of its command line",
    "sweeps/design.py": "words of its command line",
    "sweeps/run.py": "words of its command line",
    "sweeps/tuning.py": "seeds that it counts itself",
    "config/compose.py": "the function `compose`, whose callers are below",
    "studies/file.py": "functions that shipped studies name",
    "studies/run.py": "a sweep equal to that of the study, which was admitted",
    "border/own_code.py": "the function of a planned node, which was admitted when composed",
    "engine/loaded_code.py": "the function of a planned node, as above",
    "results/folder.py": "a folder that this user's command made, by a note in the cache",
}
"""Modules that call a name typed, as nothing is by default, and what it is."""

COMPOSES = {
    "api.py": "arguments of the user's program",
    "cli/images.py": "words of its command line",
    "cli/run.py": "words of its command line",
    "cli/machine.py": "the default configuration",
    "machine/kernels.py": "constants",
    "benchmark/run.py": "constants",
    "experiment/class_shapes.py": "constants, and words of a command line",
    "experiment/stored.py": "executor and cache as typed",
    "studies/wrong_poses.py": "constants",
}
"""Modules that compose texts as if they were typed, and what the texts are."""

ALLOWED = {
    ("__init__.py", "import_module"): "names of its own table",
    ("engine/limits.py", "open"): "a mark in the cache",
    ("engine/cache_folder.py", "write_text"): "a lease in the cache",
    ("engine/store.py", "dump"): "an entry of the cache",
    ("engine/store.py", "write_bytes"): "an entry of the cache",
    ("engine/store.py", "touch"): "a probe of the cache",
    ("engine/scheduler.py", "save"): "of the store",
    ("cli/terminal.py", "write_text"): "the log of a crash, named by time",
    ("cli/terminal.py", "open"): "the null device",
    ("export/mlflow_folder.py", "copyfile"): "names of mlflow, in the partial folder",
    ("export/export.py", "save"): "rerun writes, in the partial folder",
    ("rendering/filament.py", "open"): "a temporary folder",
    ("rendering/filament.py", "savez"): "a temporary folder",
    ("rendering/filament_process.py", "savez"): "a temporary folder",
    ("rendering/filament_process.py", "touch"): "a temporary folder",
    ("tracking/several.py", "resolve_name"): "the tracker of a planned stage",
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
    if name == "to_csv" and first is None:
        return ""  # It returns the text.
    in_memory = isinstance(first, ast.NamedExpr) or getattr(first, "id", "") in {"buffer", "stream"}
    plain = owner in {"json", "ast", "marshal", "yaml"} or (name == "copy" and len(node.args) < 2)
    return "" if in_memory or plain else name


@pytest.fixture(scope="module")
def nodes():
    """The nodes of the syntax trees of all modules but the border, each with its file."""
    others = [(file, tree) for file, tree in trees().items() if file != "border/origins.py"]
    return [(file, node) for file, tree in others for node in ast.walk(tree)]


def test_only_the_border_imports_by_name_unpickles_connects_and_writes(nodes):
    names = IMPORTS | UNPICKLES | CONNECTS | WRITES | {"open"}
    calls = {(file, called(node)) for file, node in nodes if isinstance(node, ast.Call)}
    # An entry that nothing needs any more is an error, too.
    assert {(file, name) for file, name in calls if name in names} == {*ALLOWED}
    callers = {file for file, name in calls if name in {"unpickled", "cached", "connected"}}
    engine = {"engine/store.py", "engine/dask_pool.py", "engine/scheduler.py"}
    assert callers == engine, "admitted with a graph's plan"


def test_no_reader_of_files_calls_a_name_typed(nodes):
    used = {(file, node.id) for file, node in nodes if isinstance(node, ast.Name)}
    used |= {(file, node.attr) for file, node in nodes if isinstance(node, ast.Attribute)}
    assert {file for file, name in used if name == "TYPED"} == {*TYPES}
    # Methods of a `Composer` take overrides that have their origin.
    imports = [(file, node) for file, node in nodes if isinstance(node, ast.ImportFrom)]
    imports = [(f, node.names) for f, node in imports if node.module == "stixel_cli.config.compose"]
    composing = {file for file, names in imports if "compose" in [one.name for one in names]}
    assert composing == {*COMPOSES}
    with pytest.raises(TypeError):
        Override("tracker=evil:track", "tracker")


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
