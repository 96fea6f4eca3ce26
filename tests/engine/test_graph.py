"""From stages to nodes, their keys, and the code that is part of them."""

import json
import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused

from stixel_cli.engine import versions
from stixel_cli.engine.code import CodeIndex
from stixel_cli.engine.graph import GraphBuilder
from stixel_cli.engine.keys import canonical, digest
from stixel_cli.errors import UserError


def test_targets_are_stages_or_nodes(project):
    graph = project.graph()
    node = graph.of_stage("double")[1].key
    assert graph.expand(["gather", node]) == [graph.of_stage("gather")[0].key, node]
    assert graph.ancestors([node]) == {node, graph.of_stage("numbers")[0].key}
    with pytest.raises(KeyError, match="nothing"):
        graph.expand(["nothing"])


@pytest.mark.parametrize(
    ("index", "changes", "message"),
    [
        (0, {"name": "double"}, "name double"),
        (1, {"inputs": {"numbers": "none"}}, "unknown input none"),
        (1, {"inputs": {"gain": "numbers"}}, "'gain' is given twice"),
        (1, {"settings": {"frames": 1}}, "'frames' is given twice"),
        (3, {"settings": {"seed": 1}}, "'seed' is given twice"),
        (1, {"pattern": "each"}, "'each' is not a pattern"),
        (1, {"frames": (1,)}, "frames are for the pattern pick"),
        (4, {"frames": (10,)}, "frame 10 is not in 0 … 9"),
        (4, {"frames": (2,)}, "show needs frame 9 of grid"),
        (0, {"inputs": {"count": "gather"}, "settings": {}}, "depend on each other"),
        (0, {"function": "steps"}, "is not package.module:function"),
    ],
)
def test_refuses_stages_that_contradict(project, index, changes, message):
    stages = project.stages()
    stages[index] = replace(stages[index], **changes)
    with pytest.raises(ValueError, match=message):
        GraphBuilder().build(stages, 10, 4)


@pytest.mark.parametrize(("frames", "chunk"), [(0, 4), (10, 0)])
def test_refuses_nothing_to_run_over(project, frames, chunk):
    with pytest.raises(ValueError, match="no frames"):
        GraphBuilder().build(project.stages(), frames, chunk)


CHUNK, FRAMES = 4, 10


@dataclass(frozen=True)
class One:
    a: float


@dataclass(frozen=True)
class Other:
    a: float


SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text()


def lists_and_dictionaries(inner):
    lists = st.lists(inner, max_size=3)
    return lists | lists.map(tuple) | st.dictionaries(st.text(), inner, max_size=3)


plain = st.recursive(SCALARS, lists_and_dictionaries, max_leaves=6)


def spelled(value):
    """A text that tells values apart as keys should."""
    if isinstance(value, dict):
        return ("dict", sorted((key, repr(spelled(value[key]))) for key in value))
    if isinstance(value, list | tuple):
        return (type(value).__name__, [spelled(item) for item in value])
    return (type(value).__name__, repr(value))


@settings(max_examples=30)
@given(plain, plain)
def test_digests_agree_exactly_when_values_do(one, other):
    same = digest(canonical(one)) == digest(canonical(other))
    assert same == (spelled(one) == spelled(other))


def test_values_differ_by_type_and_container_but_for_numpys_floats():
    values = [0.0, -0.0, 0, False, None, "0", (), [], {}, (0.0,), [0.0], One(0.0), Other(0.0)]
    values += [0.1 + 0.2, 0.3, {"a": 0.0}, {"b": 0.0}, "0.0", float("inf")]
    assert len({digest(canonical(value)) for value in values}) == len(values)
    assert canonical(np.float64(0.25)) == canonical(0.25)


@pytest.mark.parametrize("value", [{1, 2}, np.zeros(2), object(), {1: 2}, One, (np.int64(1),)])
def test_a_value_without_canonical_form_is_an_error(value):
    with pytest.raises(TypeError, match="cannot be part of a key"):
        canonical(value)


def keys(graph, *stages):
    return [node.key for name in stages for node in graph.of_stage(name)]


ALL = ("numbers", "double", "running", "gather", "grid", "show")


def test_other_pictures_leave_the_rest_alone(project):
    before, after = project.graph(), project.graph(frames=(2, 5))
    others = [name for name in ALL if name not in ("grid", "show")]
    assert keys(before, *others) == keys(after, *others)
    assert keys(before, "show")[0] == keys(after, "show")[0]
    assert keys(before, "show")[1] != keys(after, "show")[1]


def test_every_part_of_a_stage_counts(project, tmp_path):
    file = tmp_path / "mesh"
    file.write_text("a")
    stage = replace(project.stages()[0], files=(file,))

    def key(stage):
        return GraphBuilder().build([stage], FRAMES, CHUNK).of_stage(stage.name)[0].key

    changes = [{}, {"name": "counts"}, {"function": project.function("gather")}, {"seed": 1}]
    changes += [{"settings": {"count": 11}}, {"settings": {"size": 10}}, {"files": ()}]
    changes += [{"modules": (f"{project.name}.helpers",)}]
    found = [key(replace(stage, **change)) for change in changes]
    file.write_text("b")
    found.append(key(stage))
    assert len(set(found)) == len(found)
    numbers, double, *_ = project.stages()
    sources = [numbers, replace(numbers, name="others")]
    doubles = [replace(double, inputs={"numbers": one.name}) for one in sources]
    wired = [GraphBuilder().build([*sources, one], 10, 4) for one in doubles]
    assert {*keys(wired[0], "double")}.isdisjoint(keys(wired[1], "double"))


def test_a_file_without_an_end_is_refused(project, tmp_path):
    os.mkfifo(tmp_path / "fifo")
    for file in (tmp_path / "fifo", Path("/dev/zero")):
        stage = replace(project.stages()[0], files=(file,))
        with pytest.raises(UserError, match=f"{file}: not a regular file"):
            GraphBuilder().build([stage], FRAMES, CHUNK)


@pytest.fixture
def code(project):
    """The code of modules of the project, after writing modules given by name."""

    def code(*roots, **modules):
        for name, text in modules.items():
            project.write(name, text)
        return CodeIndex().code(f"{project.name}.{root}" for root in roots)

    return code


def names(project, code):
    return {name.removeprefix(f"{project.name}.") for name in code.modules}


def test_reaches_modules_through_imports_and_all_of_a_package_that_is_an_object(project, code):
    found = code("double")
    assert names(project, found) == {"double", "log", "helpers", "nouns"}
    assert set(found.versions) == {"numpy"}
    assert found.versions["numpy"]
    found = code("first", first=f"import {project.name}.helpers")
    assert names(project, found) >= {"first", "helpers", "nouns", "log", "double", project.name}
    own = {f"{project.name}.first": found.modules[f"{project.name}.first"]}
    assert found.modules == code("first", first=f"import {project.name} as p").modules | own


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("helpers", "FACTOR * values", "FACTOR + values"),
        ("helpers", "FACTOR = 3.0", "FACTOR = 4.0"),
        ("helpers", "UNUSED = 1.0", "UNUSED = 2.0"),
        ("nouns", "self.values.sum()", "self.values.max()"),
        ("nouns", "factor: float", "factor: int"),
        ("nouns", "frozen=True", "frozen=False"),
        ("double", "gain.factor *", "gain.offset *"),
        ("nouns", "import numpy as np", "import numpy.ma as np"),
        ("double", "from .helpers import scale", "from .helpers import unused as scale"),
        ("double", "from .nouns import Chunk, Gain", "from .nouns import Chunk as Gain, Chunk"),
    ],
)
def test_an_edit_of_any_statement_changes_the_digest(project, code, module, old, new):
    before = code("double").digest
    project.edit(module, old, new)
    assert code("double").digest != before


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("# a comment", "# another comment\n"),
        ("FACTOR = 3.0", 'FACTOR = (  3.0 )\n"""The meaning of FACTOR."""'),
        ("def scale(values):", 'def scale(values):\n    """A docstring."""'),
    ],
)
def test_comments_layout_and_docstrings_do_not_count(project, code, old, new):
    before = code("double").digest
    project.edit("helpers", old, new)
    assert code("double").digest == before


# Each text reaches `helpers` through `first`; the second text differs in what an import binds.
SCALE, UNUSED = (f"from .helpers import {name} as f" for name in ("scale", "unused"))
BRANCHES = f"if FLAG:\n    {SCALE}\nelse:\n    {UNUSED}"
WITHIN = "def f(x):\n    from .helpers import {} as g\n    return g(x)"
ALIASES = {
    "another name of a library": ("from math import sin as f", "from math import cos as f"),
    "two aliases swapped": (f"{SCALE}, unused as g", f"{UNUSED}, scale as g"),
    "a flag": (f"FLAG = True\n{BRANCHES}", f"FLAG = False\n{BRANCHES}"),
    "the order of two bindings": (f"{SCALE}\n{UNUSED}", f"{UNUSED}\n{SCALE}"),
    "an import within a function": (WITHIN.format("scale"), WITHIN.format("unused")),
}


@pytest.mark.parametrize("case", ALIASES)
@pytest.mark.parametrize("module", ["first", "middle"])
def test_the_bindings_of_an_import_count(project, code, module, case):
    """Those of the module itself, and those of a helper that it imports from."""
    before, after = ALIASES[case]
    text = "from .middle import f\ndef first(x): return f(x)"
    first = code("first", **{"first": text} | {module: before}).digest
    assert code("first", **{module: after}).digest != first


def test_a_registry_of_subclasses_counts(project, code):
    code(
        base="class Base:\n    known = []\n    def __init_subclass__(cls): Base.known.append(cls)",
        plugin="from .base import Base\nclass One(Base):\n    gain = 1",
        first="from . import plugin\nfrom .base import Base\ndef f(x): return Base.known[0].gain",
    )
    before = code("first").digest
    project.edit("plugin", "gain = 1", "gain = 2")
    assert code("first").digest != before


@pytest.mark.parametrize(
    "text",
    [
        "from .helpers import scale",
        "from . import helpers",
        "from . import helpers as h",
        "from PACKAGE.helpers import scale",
        "import PACKAGE.helpers as h",
        "from .helpers import *",
        "from .middle import again",
        "def g(x):\n    from .helpers import scale\n    return scale(x)",
        "try:\n    from .helpers import scale\nexcept ImportError:\n    scale = None",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from .helpers import scale",
        "class A:\n    from .helpers import scale",
        "from .inner import deep",
        "from .inner.deep import value",
        "from . import inner",
        "from .inner import *",
    ],
)
def test_reaches_the_helper_from_wherever_it_is_imported(project, code, text):
    (project.package / "inner").mkdir()
    project.write("inner/__init__", "")
    project.write("inner/deep", "from ..helpers import scale\nvalue = 1")
    project.write("middle", "from .helpers import scale as again")
    text = text.replace("PACKAGE", project.name)
    assert "helpers" in names(project, code("first", first=text))


def test_the_init_of_a_users_package_counts_always_if_it_has_statements(project, code):
    project.write("__init__", "from .log import called\nanswer = 1")
    reached = {"first", "helpers", "log", project.name}
    before = code("first", first="from .helpers import scale")
    assert names(project, before) == reached
    project.write("__init__", "from .log import called\nanswer = 2")
    assert code("first").digest != before.digest
    assert names(project, code("first", first="from . import answer")) == reached - {"helpers"}


def test_declared_files_and_loose_modules_count_by_their_content(project, code, tmp_path):
    (project.package / "weights.npz").write_bytes(b"1")
    before = code("first", first='FILES = ["weights.npz"]')
    assert f"{project.name}.first/weights.npz" in before.modules
    (project.package / "weights.npz").write_bytes(b"2")
    assert code("first").digest != before.digest
    (tmp_path / f"loose_{project.name}.py").write_text("gain = 1\n")
    text = f"import loose_{project.name}"
    before = code("first", first=text)
    assert f"loose_{project.name}" in before.modules
    (tmp_path / f"loose_{project.name}.py").write_text("gain = 2\n")
    assert code("first").digest != before.digest


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ('FILES = ["nothing.npz"]', ": nothing.npz is missing"),
        ('FILES = ["."]', "cannot be read: Is a directory"),
        ('FILES = ["/dev/zero"]', "FILES: /dev/zero: must be relative"),
        ('FILES = ["large.npz"]', "large.npz: too large"),
        ('FILES = "weights.npz"', "line 1: FILES must be a list"),
        ("FILES: list = [str(n) for n in range(3)]", "line 1: FILES must be a list"),
    ],
)
def test_files_that_cannot_be_declared_are_refused_in_one_line(text, fault, project, code):
    with (project.package / "large.npz").open("wb") as file:
        file.truncate(2**31)  # a sparse file
    with refused(fault, error=LookupError):
        code("first", first=text)


@pytest.mark.parametrize("editable", [True, False])
def test_an_editable_install_counts_by_its_code(editable, project, code, tmp_path, monkeypatch):
    name = f"helper_{project.name}"
    notes = tmp_path / f"{name}-1.0.dist-info"
    notes.mkdir()
    (notes / "METADATA").write_text(f"Name: {name}\nVersion: 1.0\n")
    (notes / "top_level.txt").write_text(name)
    (notes / "direct_url.json").write_text(json.dumps({"dir_info": {"editable": editable}}))
    (tmp_path / f"{name}.py").write_text("gain = 1\n")
    versions.providers.cache_clear()
    try:
        found = code("first", first=f"from {name} import gain")
    finally:
        versions.providers.cache_clear()
        versions.is_editable.cache_clear()
    assert (name in found.modules) == editable
    assert (name in found.versions) == (not editable)


def test_declarations_count_and_circular_imports_end(project, code):
    project.write("first", "")
    assert names(project, code("first", "log")) == {"first", "log"}
    code(a="from . import b\nfrom .b import g", b="from .a import *\nfrom . import a")
    assert names(project, code("a")) == {"a", "b"}


def test_distributions_may_be_missing_the_engines_package_is_first_party_and_no_module_is_said(
    project, code
):
    text = "import cv2\nimport os.path\ntry:\n    import no_such_module\nexcept ImportError: pass"
    assert code("first", first=text).versions.keys() == {"opencv-python-headless", "no_such_module"}
    assert code("first").versions["no_such_module"] is None
    found = code("first", first="from stixel_cli.geometry.pose import wrap_angle")
    assert names(project, found) == {"first", "stixel_cli.geometry.pose"}
    with pytest.raises(LookupError, match=r"no module .*nothing found"):
        code("nothing")
    with pytest.raises(LookupError, match=r"first\.py, line 1: not valid Python"):
        code("first", first="def (")


@pytest.mark.skipif(sys.version_info < (3, 12), reason="the syntax is of Python 3.12")
def test_new_syntax(project, code):
    text = "type Pair[T] = tuple[T, T]\ndef g[T](x: T) -> Pair[T]: return x, x"
    before = code("first", first=text).digest
    assert code("first", first=text.replace("x, x", "x, 0")).digest != before


def test_an_index_sees_files_as_they_were(project):
    index = CodeIndex()
    root = f"{project.name}.double"
    before = index.code([root])
    project.edit("helpers", "FACTOR = 3.0", "FACTOR = 4.0")
    assert index.code([root]) == before != CodeIndex().code([root])
