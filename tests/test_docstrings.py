"""The examples in the docstrings of what a script imports give what they show."""

import doctest
from importlib import import_module

import pytest

MODULES = ("stixel_cli.api", "stixel_cli.live.pairs", "stixel_cli.measurements.scans")


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_give_what_they_show(name):
    result = doctest.testmod(import_module(name))
    assert result.attempted > 0 and result.failed == 0
