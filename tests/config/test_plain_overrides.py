"""Plain overrides: the same as Hydra's parser reads, or left to it."""

import subprocess
import sys

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from stixel_cli.config.plain_overrides import plain_override

PLAIN = ["seed=3", "path.speed=-0.25", "a.b_c.d2=12.50", "x=-0", "x=0.0", "path=turn"]
PLAIN += ["measurement/noise=fitted_2", "road.kind=_x9", "x=1234567890123456"]
OTHERS = ["x=true", "x=null", "x=nan", "x=1e3", "x=01", "x=1_0", "x=.5", "x=1.", "x=1,2", "x=[1]"]
OTHERS += ["x=range(1)", "x=${y}", "x='a'", "x=a-b", "x= 1", "x=", "x", "~x=1", "+x=1", "x@y=1"]
OTHERS += ["hydra.job.name=x", "hydra=x", "x=1\n", "X=1", "a/b.c=1", "x=a.yaml"]


@pytest.mark.parametrize("text", PLAIN)
def test_plain_overrides_are_as_hydra_reads_them(text):
    hydra, own = OverridesParser.create().parse_override(text), plain_override(text)
    assert own is not None
    names = ("key_or_group", "input_line", "package")
    assert [getattr(own, name) for name in names] == [getattr(hydra, name) for name in names]
    assert repr(own.value()) == repr(hydra.value())
    for name in ("is_delete", "is_add", "is_force_add", "is_sweep_override", "is_hydra_override"):
        assert getattr(own, name)() == getattr(hydra, name)() is False


@pytest.mark.parametrize("text", OTHERS)
def test_other_overrides_are_left_to_hydra(text):
    assert plain_override(text) is None


def test_a_plain_override_imports_no_hydra():
    code = (
        "import sys; from stixel_cli.config.overrides import *; "
        "parsed = parse_overrides(['seed=3', 'path=turn']); check_overrides(parsed); "
        "assert 'hydra' not in sys.modules and 'antlr4' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
