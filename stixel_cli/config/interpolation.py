"""Values and interpolations of a configuration in plain dicts, for sweeps of many runs.

Only what `conf/` uses is handled here: keys that exist, and values that are one interpolation
`${a.b}`. The rest raises `NotPlain`, and OmegaConf does it, which takes thirty times as long.
"""

import re
from collections.abc import Collection, Mapping
from typing import Any

_INTERPOLATION = re.compile(r"\$\{([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)\}")


class NotPlain(Exception):
    """The configuration needs OmegaConf."""


def with_values(
    plain: Mapping[str, Any], values: Mapping[str, Any], interpolated: Collection[str]
) -> dict[str, Any]:
    """`plain` with the values of some keys replaced and all interpolations resolved.

    Sections that need no change are those of `plain`, not copies.

    Args:
        plain: a configuration in plain types with interpolations as text; not changed.
        values: the new values; keys have dots.
        interpolated: the sections of `plain` that have interpolations, see `interpolated`.

    Raises:
        NotPlain: if the keys, values or interpolations need OmegaConf.
    """
    tree = dict(plain)
    for name, value in values.items():
        _put(tree, name.split("."), value)
    changed = {*interpolated, *(name.partition(".")[0] for name in values)}
    resolver = _Resolver(tree)
    return {
        name: resolver.resolve(section) if name in changed else section
        for name, section in tree.items()
    }


def interpolated(plain: Mapping[str, Any]) -> frozenset[str]:
    """The sections that have an interpolation or a missing value `???`."""
    texts = {name: repr(section) for name, section in plain.items()}
    return frozenset(name for name, text in texts.items() if "${" in text or "???" in text)


def _put(tree: dict[str, Any], parts: list[str], value: Any) -> None:
    """Replace a value. The dicts that contain it are copied, because they are shared."""
    section = tree
    for part in parts[:-1]:
        inner = section.get(part)
        if not isinstance(inner, dict):
            raise NotPlain
        section[part] = section = dict(inner)
    if parts[-1] not in section or isinstance(section[parts[-1]], dict) or isinstance(value, dict):
        raise NotPlain
    section[parts[-1]] = value


class _Resolver:
    """Resolves the interpolations of a tree."""

    def __init__(self, tree: dict[str, Any]):
        self._tree = tree
        self._pending: list[str] = []

    def resolve(self, value: Any) -> Any:
        if isinstance(value, dict):
            return {name: self.resolve(item) for name, item in value.items()}
        if isinstance(value, list):
            return [self.resolve(item) for item in value]
        if isinstance(value, str) and ("${" in value or value == "???"):
            return self._look_up(value)
        return value

    def _look_up(self, text: str) -> Any:
        match = _INTERPOLATION.fullmatch(text)
        if match is None or text in self._pending:
            raise NotPlain
        value: Any = self._tree
        for part in match[1].split("."):
            if not isinstance(value, dict) or part not in value:
                raise NotPlain
            value = value[part]
        self._pending.append(text)
        value = self.resolve(value)
        self._pending.pop()
        return value
