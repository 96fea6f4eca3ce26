"""A sweep of a study's file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Annotated, Any

from pydantic import StringConstraints

from stixel_cli.border import Origin
from stixel_cli.config import messages
from stixel_cli.config.texts import value_text
from stixel_cli.errors import ConfigurationError
from stixel_cli.parameters import parameters
from stixel_cli.sweeps.design import Design
from stixel_cli.sweeps.file import ENTRIES as SWEEP_ENTRIES
from stixel_cli.sweeps.file import design_of

NAME = "^[A-Za-z][A-Za-z0-9_]{0,59}$"
"""Of a sweep or a question: it is in names of folders and files, and in messages."""

Axes = Sequence[Mapping[str, list]]
"""Further axes of a sweep: each maps one key, or several zipped ones, to values."""


@parameters
class _Entries:
    """The entries of a sweep that a sweep's own file does not have."""

    name: Annotated[str, StringConstraints(pattern=NAME)]
    results: tuple[str, ...] = ()
    derive: str | None = None
    axes_of: str | None = None
    variants: dict[str, dict[str, Any]] = field(default_factory=dict)

    def check(self) -> None:
        """Raise ValueError for a variant with a key that the first one lacks."""
        first = next(iter(self.variants.values()), {})
        for name, own in self.variants.items():
            unknown = next((key for key in own if key not in first), None)
            if unknown is not None or not first:
                raise ValueError(
                    f"variants: {name}: {unknown} must have a value in the first variant too"
                )


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
        content = {**self.content, "axes": axes, "zipped": zipped}
        return design_of(content, f"sweeps: {self.name}", self.origin)


def sweep_entry(name: Any, entries: Any, origin: Origin) -> SweepEntry:
    """A sweep of the file; ConfigurationError in one line that names it and the entry."""
    where = f"sweeps: {messages.printable(str(name))}"
    if not isinstance(entries, dict):
        raise ConfigurationError(f"{where}: must have a sweep's entries, as KEY: VALUE")
    content = {key: value for key, value in entries.items() if key in SWEEP_ENTRIES}
    given = {k: v for k, v in entries.items() if k not in SWEEP_ENTRIES and v is not None}
    known = [*SWEEP_ENTRIES, *(one.name for one in fields(_Entries))]
    own = messages.validated(_Entries, {**given, "name": name}, where, known)
    first = next(iter(own.variants.values()), {})
    # The first variant gives all keys, the others those that differ.
    variants = {variant: {**first, **values} for variant, values in own.variants.items()}
    return SweepEntry(name, content, own.results, own.derive, own.axes_of, variants, origin)
