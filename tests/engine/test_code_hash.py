"""The hash of the code that a stage reaches: what changes it, and what does not."""

import sys

import pytest

from stixel_cli.engine.code_hash import CodeIndex


@pytest.fixture
def code(project):
    """Hash of a function as the files are now; given modules are written first."""

    def hash_of(function, module="steps", types=(), **modules):
        for name, text in modules.items():
            project.write(name, text)
        return CodeIndex().hash(f"{project.name}.{module}:{function}", types)

    return hash_of


def names(project, code_hash):
    return {part.removeprefix(f"{project.name}.") for part in code_hash.parts}


def test_follows_names_through_modules(project, code):
    assert names(project, code("double")) == {
        "steps:double",
        "log:called",
        "helpers:scale",
        "helpers:FACTOR",
        "nouns:Chunk",
        "nouns:Chunk.total",
        "nouns:Gain",
    }


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("helpers", "FACTOR * values", "FACTOR + values"),
        ("helpers", "FACTOR = 3.0", "FACTOR = 4.0"),
        ("nouns", "self.values.sum()", "self.values.max()"),
        ("nouns", "factor: float", "factor: int"),
        ("nouns", "frozen=True", "frozen=False"),
        ("steps", "gain.factor *", "gain.offset *"),
    ],
)
def test_changes_with_what_is_reached(project, code, module, old, new):
    before = code("double").digest
    project.edit(module, old, new)
    assert code("double").digest != before


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("helpers", "# a comment", "# another comment\n"),
        ("helpers", "FACTOR = 3.0", 'FACTOR = (  3.0 )\n"""What it is."""'),
        ("helpers", "UNUSED = 1.0", "UNUSED = 2.0"),
        ("helpers", "UNUSED * values", "UNUSED + values"),
        ("steps", "A docstring.", "Another docstring."),
        ("steps", 'called("numbers")', 'called("other")'),
    ],
)
def test_does_not_change_with_the_rest(project, code, module, old, new):
    before = code("double").digest
    project.edit(module, old, new)
    assert code("double").digest == before


@pytest.mark.parametrize(
    "text",
    [
        "from .helpers import scale as f\ndef g(x): return f(x)",
        "from . import helpers\ndef g(x): return helpers.scale(x)",
        "from . import helpers as h\ndef g(x): return [h.scale(y) for y in x]",
        "def g(x):\n    from .helpers import scale\n    return scale(x)",
        "def g(x):\n    from . import helpers\n    def inner(): return helpers.scale(x)\n"
        "    return inner",
        "from .helpers import *\ndef g(x): return scale(x)",
        "from .middle import again as f\ndef g(x): return f(x)",
        "from .helpers import scale\ndef g(x, f=scale): return f(x)",
        "from .helpers import scale\n@scale\ndef g(x): return x",
        "from .helpers import scale\ng = scale",
        "from .helpers import scale\nTABLE = {'a': scale}\ndef g(x): return TABLE[x]",
        "from .helpers import scale\nclass A:\n    y = scale(1)\nclass B(A): pass\n"
        "def g(x): return B.y",
        "try:\n    from .helpers import scale\nexcept ImportError:\n    scale = None\n"
        "def g(x): return scale(x)",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from .helpers import scale\n"
        "def g(x: 'scale | None'): return x",
        "from .helpers import scale\ndef g(x: scale | None): return x",
        "from .helpers import scale\nF = None\nF = scale\ndef g(x): return F(x)",
        "from .helpers import scale\nT = {}\nT['a'] = scale\ndef g(x): return T",
        "from .helpers import scale\nscale(1)\ndef g(x): return x",
        "from functools import singledispatch\nfrom .helpers import scale\n@singledispatch\n"
        "def g(x): return x\n@g.register\ndef _(x: int): return scale(x)",
        "from .helpers import scale\nT = {}\ndef kept(f): return T.setdefault('a', f)\n@kept\n"
        "def a(x): return scale(x)\ndef g(x): return T[x]",
        "from . import registered\nfrom .registry import T\ndef g(x): return T['a'](x)",
        "import importlib\ndef g(x): return importlib.import_module('.helpers', __package__)",
        "import importlib\ndef g(x): return importlib.import_module(x)",
        "from . import helpers\ndef g(x): return getattr(helpers, x)(x)",
        "from .helpers import scale\ndef g(x): return globals()[x]",
        "from .helpers import scale\ndef g(x): return [(scale := y) for y in x], (lambda: scale)\n",
        "from .helpers import scale\ndef g(x):\n    class Local:\n        scale = scale\n"
        "    return Local",
        "from .helpers import scale\ndef g(x): return [scale for scale in scale(x)]",
        "from .helpers import scale\ndef g(x):\n    match x:\n        case scale(): return 1",
    ],
)
def test_reaches_the_helper_however_it_is_named(project, code, text):
    project.write("middle", "from .helpers import scale as again")
    project.write("registry", "T = {}\ndef kept(name): return lambda f: T.setdefault(name, f)")
    project.write(
        "registered",
        "from .helpers import scale\nfrom .registry import kept\n@kept('a')\n"
        "def a(x): return scale(x)",
    )
    before = code("g", "other", other=text)
    # Where a local name hides the import there is nothing to reach.
    hidden = "(scale := y)" in text
    project.edit("helpers", "FACTOR * values", "FACTOR - values")
    assert (code("g", "other").digest == before.digest) == hidden


def test_absolute_imports_and_the_package_itself(project, code):
    text = f"import {project.name}.helpers\ndef g(x): return {project.name}.helpers.scale(x)"
    assert "helpers:scale" in names(project, code("g", "other", other=text))
    project.write("__init__", "from .helpers import scale as public")
    text = f"import {project.name} as p\ndef g(x): return p.public(x)"
    assert names(project, code("g", "other", other=text)) == {
        "other:g",
        "helpers:scale",
        "helpers:FACTOR",
    }


def test_one_name_of_a_module_is_not_all_of_it(project, code):
    text = "from . import helpers\ndef g(x): return helpers.UNUSED"
    assert names(project, code("g", "other", other=text)) == {"other:g", "helpers:UNUSED"}


def test_parameters_and_locals_hide_the_names_of_the_module(project, code):
    text = """
        from .helpers import scale, unused
        def g(scale, x):
            unused = scale
            return [unused for unused in x], unused
        """
    assert names(project, code("g", "other", other=text)) == {"other:g"}


def test_effects_of_imported_modules_count(project, code):
    project.write("effects", "import os\nos.environ.setdefault('A', '1')")
    text = "from . import effects\ndef g(x): return x"
    before = code("g", "other", other=text).digest
    project.edit("effects", "'1'", "'2'")
    assert code("g", "other").digest != before


def test_the_main_block_does_not_count(project, code):
    text = "def g(x): return x\nif __name__ == '__main__':\n    g(1)\n"
    assert names(project, code("g", "other", other=text)) == {"other:g"}


def test_types_of_settings_are_roots(project, code):
    gain = [(f"{project.name}.nouns", "Gain")]
    assert names(project, code("running", types=gain)) - names(project, code("running")) == {
        "nouns:Gain"
    }


def test_circular_imports_end(project, code):
    project.write("a", "from .b import *\nfrom . import b\ndef f(x): return b.g(x), missing")
    project.write("b", "from .a import *\nfrom . import a\ndef g(x): return a.f(x), absent")
    assert {"a:f", "b:g"} <= names(project, code("f", "a"))


def test_literals_in_annotations_are_no_names(project, code):
    text = """
        from typing import Annotated, Literal
        from . import helpers as rig
        def g(x: Literal["rig", "else"], y: "Annotated[int, 3]"): return x
        """
    assert names(project, code("g", "other", other=text)) == {"other:g"}


def test_parts_name_the_method(project, code):
    before = code("double").parts
    project.edit("nouns", "self.values.sum()", "self.values.max()")
    after = code("double").parts
    changed = {name for name in before if before[name] != after[name]}
    assert changed == {f"{project.name}.nouns:Chunk.total"}


def test_no_such_function(project):
    for function in (f"{project.name}.steps:none", f"{project.name}.none:f", "no_package.a:f"):
        with pytest.raises(LookupError, match=r"none|no_package"):
            CodeIndex().hash(function)


@pytest.mark.skipif(sys.version_info < (3, 12), reason="the syntax is of Python 3.12")
def test_type_parameters_are_no_global_names(project, code):
    text = """
        from .helpers import scale
        type Pair[T] = tuple[T, T]
        class Box[T]:
            def get[U](self, x: T, y: U) -> Pair[T]: return x
        def g[T](x: T) -> Box[T]: return x
        """
    assert names(project, code("g", "other", other=text)) == {
        "other:g",
        "other:Box",
        "other:Box.get",
        "other:Pair",
    }
