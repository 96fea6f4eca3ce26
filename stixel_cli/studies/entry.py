"""The sweeps of a study's file."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from stixel_cli.config import messages
from stixel_cli.config.texts import override_text
from stixel_cli.errors import ConfigurationError
from stixel_cli.sweeps.design import Design
from stixel_cli.sweeps.file import ENTRIES as SWEEP_ENTRIES
from stixel_cli.sweeps.file import design_of, refuse_unknown

_SWEEP_ENTRIES = (*SWEEP_ENTRIES, "results", "derive", "axes_of", "variants")
_SWEEP_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


@dataclass(frozen=True)
class SweepEntry:
    """A sweep of the file.

    Attributes:
        name: of the sweep.
        content: entries as in a sweep's file.
        steps: stages whose results the report reads in addition to the scores.
        derive: name of the module's function that returns further axes, from the data of the
            earlier sweeps; or None.
        axes_of: name of the module's function that returns further axes when the study is
            planned, such as those of the user's data; or None.
        variants: name to override texts, one for each key that the first variant sets.
    """

    name: str
    content: Mapping[str, Any]
    steps: tuple[str, ...]
    derive: str | None
    axes_of: str | None
    variants: Mapping[str, tuple[str, ...]]

    def variant_of(self, setting: Mapping[str, str]) -> str:
        """Name of the variant that a run has; "" without any."""
        own = {f"{key}={value}" for key, value in setting.items()}
        return next((name for name, texts in self.variants.items() if own.issuperset(texts)), "")

    def design(self, derived: list[dict[str, list]] | None = None) -> Design:
        """The design of the runs, with further axes.

        Raises:
            ConfigurationError: in one line that names the sweep and the entry.
        """
        content = dict(self.content)
        for keys in derived or []:
            if len(keys) == 1:
                content["axes"] = {**(content.get("axes") or {}), **keys}
            else:
                content["zipped"] = [*(content.get("zipped") or []), keys]
        try:
            return design_of(content, shuffled=False)
        except ConfigurationError as fault:
            raise ConfigurationError(f"sweeps: {self.name}: {fault}") from None


def sweep_entries(content: Mapping[str, Any]) -> list[SweepEntry]:
    """The sweeps of a study's file.

    Raises:
        ConfigurationError: in one line that names the sweep.
    """
    sweeps = content.get("sweeps")
    if not isinstance(sweeps, dict) or not sweeps:
        raise ConfigurationError("sweeps: must be names, each with a sweep's entries")
    found = []
    for name, entries in sweeps.items():
        where = f"sweeps: {messages.printable(str(name))}"
        if not isinstance(name, str) or not _SWEEP_NAME.fullmatch(name):
            raise ConfigurationError(f"{where}: a name of letters, digits and _ is needed")
        if not isinstance(entries, dict):
            raise ConfigurationError(f"{where}: must have a sweep's entries, as KEY: VALUE")
        try:
            refuse_unknown(entries, _SWEEP_ENTRIES)
        except ConfigurationError as fault:
            raise ConfigurationError(f"{where}: {fault}") from None
        steps = entries.get("results") or []
        if not isinstance(steps, list) or not all(isinstance(step, str) for step in steps):
            raise ConfigurationError(f"{where}: results: must be a list of steps")
        functions = {entry: entries.get(entry) for entry in ("derive", "axes_of")}
        for entry, function in functions.items():
            if not isinstance(function, str | None):
                raise ConfigurationError(f"{where}: {entry}: must be the name of a function")
        sweep = {key: value for key, value in entries.items() if key in SWEEP_ENTRIES}
        variants = _variants(entries.get("variants"), where)
        if variants:
            keys = next(iter(variants.values()))
            axis = {key: [own[key] for own in variants.values()] for key in keys}
            if len(axis) == 1:
                sweep["axes"] = {**(sweep.get("axes") or {}), **axis}
            else:
                sweep["zipped"] = [*(sweep.get("zipped") or []), axis]
        texts = {
            name: tuple(override_text(key, value) for key, value in own.items())
            for name, own in variants.items()
        }
        found.append(SweepEntry(name, sweep, tuple(steps), **functions, variants=texts))
    return found


def _variants(content: Any, where: str) -> dict[str, dict[str, Any]]:
    """Variant to key to value; the first gives all keys, the others those that differ."""
    if content is None:
        return {}
    if not isinstance(content, dict) or not all(isinstance(v, dict) for v in content.values()):
        raise ConfigurationError(f"{where}: variants: must map names to keys with their values")
    first = next(iter(content.values()), {})
    for name, own in content.items():
        unknown = next((key for key in own if key not in first), None)
        if unknown is not None or (not own and not first):
            raise ConfigurationError(
                f"{where}: variants: {messages.printable(str(name))}: {unknown} must have a value "
                "in the first variant too"
            )
    return {str(name): {**first, **own} for name, own in content.items()}
