"""Find the first difference of two results: arrays, dataclasses, containers, plain values."""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def first_difference(old: Any, new: Any, name: str = "") -> str | None:
    """The first difference of two values in one line, with its size; None if they are equal.

    Floats are equal if their bits are; NaN equals NaN. `name` is the name of the value.
    """
    if type(old) is not type(new):
        return _named(name, f"a {type(old).__name__} became a {type(new).__name__}")
    if isinstance(old, np.ndarray):
        return _array_difference(old, new, name)
    if is_dataclass(old):
        return _of_parts(_parts(old), _parts(new), name)
    if isinstance(old, Mapping):
        return _of_parts(old, new, name)
    if isinstance(old, list | tuple):
        return _of_parts(dict(enumerate(old)), dict(enumerate(new)), name)
    if isinstance(old, bytes):
        return None if old == new else _named(name, "other bytes")
    if isinstance(old, float) and math.isnan(old) and math.isnan(new):
        return None
    return None if old == new else _named(name, f"{_short(old)} became {_short(new)}")


def _parts(value: Any) -> dict[str, Any]:
    return {field.name: getattr(value, field.name) for field in fields(value)}


def _of_parts(old: Mapping, new: Mapping, name: str) -> str | None:
    if old.keys() != new.keys():
        odd = [str(key) for key in (*old, *new) if (key in old) != (key in new)]
        return _named(name, f"{odd[0]} is in only one of the two")
    for key in old:
        inner = f"{name}.{key}" if name else str(key)
        difference = first_difference(old[key], new[key], inner)
        if difference is not None:
            return difference
    return None


def _array_difference(old: np.ndarray, new: np.ndarray, name: str) -> str | None:
    if old.shape != new.shape:
        return _named(name, f"its shape {old.shape} became {new.shape}")
    if old.dtype != new.dtype:
        return _named(name, f"its type {old.dtype} became {new.dtype}")
    if old.tobytes() == new.tobytes():
        return None
    if old.dtype.kind not in "biufc":
        return _named(name, "other values")
    same = (old == new) | ((old != old) & (new != new))
    if same.all():
        return _named(name, "zeros of other signs or other NaNs")
    share = f"{np.count_nonzero(~same)} of {same.size} values differ"
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(new[~same].astype(np.complex128) - old[~same].astype(np.complex128))
    finite = apart[np.isfinite(apart)]
    most = f", by up to {finite.max():.3g}" if finite.size else ", not finite"
    return _named(name, share + most)


def _named(name: str, text: str) -> str:
    return f"{name}: {text}" if name else text


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:59] + "…"
