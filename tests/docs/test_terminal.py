"""The pictures of the terminal: small, of valid commands, and they load nothing."""

import re
import shlex
from xml.etree import ElementTree

import pytest
from test_settings_page import DOCS, load_script

from stixel_cli.border import TYPED
from stixel_cli.config.overrides import check_overrides, read_overrides

terminal = load_script("terminal")
MOST_BYTES = 60_000


@pytest.mark.parametrize("name", terminal.PICTURES)
def test_picture(name):
    file = DOCS / "figures" / f"{name}.svg"
    text = file.read_text(encoding="utf-8")
    assert len(text) < MOST_BYTES
    words = "".join(ElementTree.fromstring(text).itertext()).replace("\xa0", " ")
    for command in terminal.PICTURES[name]:
        assert f"$ {command}" in words, f"run python docs/terminal.py {name}"
    assert set(re.findall(r"https?://[^\s\"]+", text)) == {"http://www.w3.org/2000/svg"}


def test_overrides_of_the_first_picture_are_valid():
    for command in terminal.PICTURES["terminal_run"]:
        check_overrides(read_overrides([w for w in shlex.split(command)[2:] if "=" in w], TYPED))


def test_output_has_its_colours_and_errors(tmp_path):
    command = "python -c 'import sys; print(sys.stdout.isatty()); sys.exit(\"wrong\")'"
    assert terminal.output_on_a_terminal(command, tmp_path) == "True\nwrong\n"
    svg = terminal.picture(["printf '\\033[31mred'"])
    assert ">red<" in svg and "fonts" not in svg
