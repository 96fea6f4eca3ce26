"""A sweep of a study's file."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from stixel_cli.border import Origin
from stixel_cli.config import messages
from stixel_cli.config.texts import value_text
from stixel_cli.errors import ConfigurationError
from stixel_cli.sweeps.design import Design
from stixel_cli.sweeps.file import ENTRIES as SWEEP_ENTRIES
from stixel_cli.sweeps.file import design_of, refuse_unknown

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{,59}")
"""Of a sweep or a question: it is in names of folders and files, and in messages."""

Axes = Sequence[Mapping[str, list]]
"""Further axes of a sweep: each maps one key, or several zipped ones, to values."""


@dataclass(frozen=True)
class SweepEntry:
    """A sweep of the file.

    Attributes:
        content: entries as in a sweep's file.
        steps: stages whose results the report reads in addition to the scores.
        derive: name of the module's function that returns further axes, from the data of the
            earlier sweeps; or None.
        axes_of: name of the module's function that returns further axes when the study is
            planned, such as those of the user's data; or None.
        variants: name to key to value, the same keys in all.
        origin: of all that the file names.
    """

    name: str
    content: Mapping[str, Any]
    steps: tuple[str, ...]
    derive: str | None
    axes_of: str | None
    variants: Mapping[str, Mapping[str, Any]]
    origin: Origin

    def variant_of(self, setting: Mapping[str, str]) -> str:
        """Name of the variant that a run has; "" without any."""
        for name, values in self.variants.items():
            if all(setting.get(key) == value_text(value) for key, value in values.items()):
                return name
        return ""

    def design(self, further: Axes = ()) -> Design:
        """The design of the runs, with further axes.

        Raises:
            ConfigurationError: in one line that names the sweep and the entry.
        """
        axes, zipped = self.content.get("axes"), self.content.get("zipped")
        variants = list(self.variants.values())
        own = {key: [values[key] for values in variants] for key in (variants or [{}])[0]}
        for keys in (*([own] if own else []), *further):
            if len(keys) == 1:
                axes = {**(axes or {}), **keys}
            else:
                zipped = [*(zipped or []), keys]
        try:
            content = {**self.content, "axes": axes, "zipped": zipped}
            return design_of(content, False, self.origin)
        except ConfigurationError as fault:
            raise ConfigurationError(f"sweeps: {self.name}: {fault}") from None


def sweep_entry(name: Any, entries: Any, origin: Origin) -> SweepEntry:
    """A sweep of the file; ConfigurationError in one line that names it and the entry."""
    where = f"sweeps: {messages.printable(str(name))}"
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise ConfigurationError(f"{where}: a name of 1 to 60 letters, digits and _ is needed")
    if not isinstance(entries, dict):
        raise ConfigurationError(f"{where}: must have a sweep's entries, as KEY: VALUE")
    try:
        refuse_unknown(entries, (*SWEEP_ENTRIES, "results", "derive", "axes_of", "variants"))
        steps = entries.get("results") or []
        if not isinstance(steps, list) or not all(isinstance(step, str) for step in steps):
            raise ConfigurationError("results: must be a list of steps")
        functions = {entry: entries.get(entry) for entry in ("derive", "axes_of")}
        for entry, function in functions.items():
            if not isinstance(function, str | None):
                raise ConfigurationError(f"{entry}: must be the name of a function")
        variants = _variants(entries.get("variants"))
    except ConfigurationError as fault:
        raise ConfigurationError(f"{where}: {fault}") from None
    content = {key: value for key, value in entries.items() if key in SWEEP_ENTRIES}
    return SweepEntry(name, content, tuple(steps), **functions, variants=variants, origin=origin)


def _variants(content: Any) -> dict[str, dict[str, Any]]:
    """Variant to key to value; the first gives all keys, the others those that differ."""
    if content is None:
        return {}
    if not isinstance(content, dict) or not all(isinstance(v, dict) for v in content.values()):
        raise ConfigurationError("variants: must map names to keys with their values")
    first = next(iter(content.values()), {})
    for name, own in content.items():
        unknown = next((key for key in own if key not in first), None)
        if unknown is not None or (not own and not first):
            raise ConfigurationError(
                f"variants: {messages.printable(str(name))}: {unknown} must have a value "
                "in the first variant too"
            )
    return {str(name): {**first, **own} for name, own in content.items()}
