"""Overrides are parsed in one place: plain ones without Hydra, the rest by its parser."""

import subprocess
import sys
from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

import stixel_cli
from stixel_cli.border import TYPED
from stixel_cli.config import overrides
from stixel_cli.config.folders import outermost_group
from stixel_cli.config.overrides import parse

PLAIN = ["seed=3", "path.speed=-0.25", "a.b_c.d2=12.50", "x=-0", "x=0.0", "path=turn"]
PLAIN += ["measurement/noise=fitted_2", "road.kind=_x9", "x=1234567890123456", "x=nan_", "x=true_1"]
OTHERS = ["x=true", "x=null", "x=1e3", "x=01", "x=1_0", "x=.5", "x=1.", "x=[1]", "x='a'", "x=a-b"]
OTHERS += ["x=${y}", "x= 1", "x=", "~x=1", "+x=1", "++x=[1]", "X=1", "x=a.yaml"]
SEVERAL = {"x=1,2": [1, 2], "x=range(0,1,0.5)": [0.0, 0.5], "x='a b',c": ["a b", "c"]}


@pytest.mark.parametrize("text", [*PLAIN, *OTHERS])
def test_they_are_what_hydra_reads(text):
    theirs, ours = OverridesParser.create().parse_override(text), parse(text, TYPED)
    assert (ours.text, ours.key, ours.sweep) == (text, theirs.key_or_group, None)
    assert repr(ours.value) == repr(theirs.value())
    assert ours.singles() == [ours]
    assert (overrides._PLAIN.fullmatch(text) is not None) == (text in PLAIN)


def test_several_values_are_overrides_of_one_value_each():
    for text, expected in SEVERAL.items():
        assert parse(text, TYPED).value is None
        assert [one.value for one in parse(text, TYPED).singles()] == expected
    assert [one.text for one in parse("+x=1,2", TYPED).singles()] == ["+x=1", "+x=2"]


def test_key_group_and_value_of_the_text():
    inner, key = (
        parse(text, TYPED) for text in ("++measurement/noise=constant", "measurement.rays= [1,2]")
    )
    assert (inner.sign, inner.key) == ("++", "measurement/noise")
    assert (key.sign, key.value_text) == ("", "[1,2]")
    assert {outermost_group(one.key) for one in (inner, key)} == {"measurement"}


def test_a_plain_override_imports_no_hydra():
    code = (
        "import sys; from stixel_cli.border import TYPED; "
        "from stixel_cli.config.overrides import *; "
        "check_overrides(read_overrides(['seed=3', 'path=turn'], TYPED)); "
        "assert 'hydra' not in sys.modules and 'antlr4' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_one_file_takes_an_override_apart():
    package = Path(stixel_cli.__file__).parent
    found = [
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        if 'partition("=")' in path.read_text(encoding="utf-8")
    ]
    assert found == ["config/texts.py"]
