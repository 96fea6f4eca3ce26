"""How a study's folder differs from what a command asks for: the keys, with both values."""

from collections.abc import Mapping
from typing import Any

UNSET = "not set"
_LONGEST = 60
"""Characters shown of a value."""


def differences(there: Mapping[str, Any], wanted: Mapping[str, Any], folder: str) -> list[str]:
    """What differs between two requests of a study, as `KEY: VALUE in FOLDER, VALUE here`.

    Args:
        there: request that `folder` was made with, see `StudyPlan.request`.
        wanted: request of the command.

    Raises:
        ValueError: if `there` is not a request.
    """
    try:
        before, after = _settings(there), _settings(wanted)
    except (AttributeError, KeyError, TypeError, ValueError):
        raise ValueError("not the request of a study") from None
    sweeps = wanted["sweeps"]
    found = []
    for key in dict.fromkeys((*after, *before)):
        if before.get(key) == after.get(key):
            continue
        (sweep, name), old, new = key, before.get(key, UNSET), after.get(key, UNSET)
        where = f" of sweep {sweep}" if sweep and (len(sweeps) > 1 or sweep not in sweeps) else ""
        old, new = _shown(old, new), _shown(new, old)
        found.append(f"{name}{where}: {old} in {folder}, {new} here")
    return found


def _settings(request: Mapping[str, Any]) -> dict[tuple[str, str], str]:
    """StudySweep ("" for the study's own) and key to the values as they are typed."""
    found = {("", key): str(request[key]) for key in ("study", "template", "module")}
    for name, sweep in request["sweeps"].items():
        for text in sweep["fixed"]:
            key, _, value = text.partition("=")
            found[name, key] = value
        for axis in sweep["axes"]:
            steps = [_step(step) for step in axis["steps"]]
            found[name, "+".join(axis["keys"])] = ",".join(steps)
        for key in ("leave_out", "results", "derive"):
            found[name, key] = str(sweep[key])
    return found


def _step(texts: list[str]) -> str:
    values = [text.partition("=")[2] for text in texts]
    return values[0] if len(values) == 1 else f"({' '.join(values)})"


def _shown(value: str, other: str) -> str:
    """The value, of a long one where it begins to differ from the other."""
    if len(value) <= _LONGEST:
        return value
    pairs = enumerate(zip(value, other, strict=False))
    alike = next((i for i, (one, two) in pairs if one != two), len(other))
    start = max(0, alike - _LONGEST // 2)
    text = value[start : start + _LONGEST]
    return f"{'…' * (start > 0)}{text}{'…' * (start + _LONGEST < len(value))}"
