"""In what settings two canonical trees differ, and how a tree is written for people."""

from collections.abc import Iterator, Mapping
from typing import Any

Difference = tuple[str, str, str]
"""Dotted path of a setting, what it was, what it is; "" for what is not there."""


def differences(before: Any, after: Mapping[str, Any]) -> list[Difference]:
    """The settings in which two canonical trees differ."""
    before = before if isinstance(before, Mapping) else {}
    return list(_of_fields(before, after, ""))


def _of_fields(before: Mapping, after: Mapping, prefix: str) -> Iterator[Difference]:
    for name in sorted({*before, *after}):
        path = prefix + name
        if name not in before:
            yield path, "", plain(after[name])
        elif name not in after:
            yield path, plain(before[name]), ""
        elif before[name] != after[name]:
            (kind, old), (new_kind, new) = _content(before[name]), _content(after[name])
            if kind and kind == new_kind:
                yield from _of_fields(old, new, f"{path}.")
            else:
                yield path, plain(before[name]), plain(after[name])


def _content(tree: Any) -> tuple[str, Mapping[str, Any]]:
    """Type and fields of a dataclass, or of a mapping, in the canonical spelling; else "", {}."""
    if isinstance(tree, dict) and len(tree) == 1:
        ((kind, fields),) = tree.items()
        if isinstance(fields, dict):
            return kind, fields
    return "", {}


def plain(tree: Any) -> str:
    """A canonical tree as people write it."""
    if tree is None:
        return "null"
    if isinstance(tree, bool):
        return str(tree).lower()
    if isinstance(tree, list):
        return f"[{', '.join(map(plain, tree))}]"
    if isinstance(tree, dict):
        if set(tree) == {"float"}:
            return str(tree["float"])
        ((name, content),) = tree.items()
        if isinstance(content, list):
            return plain(content)
        # A variant of a group by its kind, anything else by its class.
        return str(content.get("kind", name.rpartition(".")[2]))
    return str(tree) or "''"
