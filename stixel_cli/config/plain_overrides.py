"""Overrides that need no parser: `KEY=NUMBER`, `KEY=WORD`, `GROUP=OPTION`."""

import re
from dataclasses import dataclass

_ID = "[a-z_][a-z_0-9]*"
_PLAIN = re.compile(
    rf"(?P<key>{_ID}([.]{_ID})*|{_ID}(/{_ID})*)="
    rf"((?P<word>{_ID})|(?P<number>-?(0|[1-9][0-9]{{0,15}})([.][0-9]{{1,15}})?))"
)
_NOT_WORDS = ("true", "false", "null", "inf", "nan")


@dataclass(frozen=True)
class PlainOverride:
    """One key with one value, with the part of the interface of Hydra's `Override` that is used.

    Hydra takes 0.2 s to import, and most overrides are plain.
    """

    input_line: str
    key_or_group: str
    plain_value: str | int | float
    package: None = None

    def value(self) -> str | int | float:
        """The value in its own type."""
        return self.plain_value

    def is_delete(self) -> bool:
        """Return False: it has no `~`."""
        return False

    def is_add(self) -> bool:
        """Return False: it has no `+`."""
        return False

    def is_force_add(self) -> bool:
        """Return False: it has no `++`."""
        return False

    def is_sweep_override(self) -> bool:
        """Return False: it has one value."""
        return False

    def is_hydra_override(self) -> bool:
        """Return False: Hydra's own keys are left to Hydra's parser."""
        return False


def plain_override(text: str) -> PlainOverride | None:
    """The override as Hydra's parser reads it; None if it needs that parser."""
    found = _PLAIN.fullmatch(text)
    if found is None or found["word"] in _NOT_WORDS or found["key"].startswith("hydra"):
        return None
    if found["word"] is not None:
        return PlainOverride(text, found["key"], found["word"])
    number = found["number"]
    return PlainOverride(text, found["key"], float(number) if "." in number else int(number))
