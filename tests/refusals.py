"""How the program refuses what a user gave it: in one line."""

import re
from contextlib import contextmanager

import pytest

from stixel_cli.errors import UserError


@contextmanager
def refused(*said, match="", error=UserError):
    """The block must end in an `error` of one line with the words `said`, or that fits `match`."""
    with pytest.raises(error) as caught:
        yield
    line = str(caught.value)
    assert all(words in line for words in said) and re.search(match, line), line
    assert "\n" not in line
