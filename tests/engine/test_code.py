"""What is part of a stage's code: every module that its module reaches through imports."""

import sys

import pytest

from stixel_cli.engine import versions
from stixel_cli.engine.code import CodeIndex


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
    assert found.modules == code("first", first=f"import {project.name} as p").modules | {
        f"{project.name}.first": found.modules[f"{project.name}.first"]
    }


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
ALIASES = {
    "another name of a library": ("from math import sin as f", "from math import cos as f"),
    "two aliases swapped": (
        "from .helpers import scale as f, unused as g",
        "from .helpers import unused as f, scale as g",
    ),
    "a flag": (
        "FLAG = True\nif FLAG:\n    from .helpers import scale as f\n"
        "else:\n    from .helpers import unused as f",
        "FLAG = False\nif FLAG:\n    from .helpers import scale as f\n"
        "else:\n    from .helpers import unused as f",
    ),
    "the order of two bindings": (
        "from .helpers import scale as f\nfrom .helpers import unused as f",
        "from .helpers import unused as f\nfrom .helpers import scale as f",
    ),
    "an import within a function": (
        "def f(x):\n    from .helpers import scale as g\n    return g(x)",
        "def f(x):\n    from .helpers import unused as g\n    return g(x)",
    ),
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
    with pytest.raises(LookupError) as error:
        code("first", first=text)
    assert fault in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("editable", [True, False])
def test_an_editable_install_counts_by_its_code(editable, project, code, tmp_path, monkeypatch):
    name = f"helper_{project.name}"
    notes = tmp_path / f"{name}-1.0.dist-info"
    notes.mkdir()
    (notes / "METADATA").write_text(f"Name: {name}\nVersion: 1.0\n")
    (notes / "top_level.txt").write_text(name)
    (notes / "direct_url.json").write_text(
        f'{{"dir_info": {{"editable": {str(editable).lower()}}}}}'
    )
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
