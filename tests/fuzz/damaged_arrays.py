"""Damage to a file of arrays: types, shapes and values, and what no writer of NumPy writes."""

import io
import os
import pickle
import random
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


class _Payload:
    """What makes a folder when it is unpickled."""

    def __reduce__(self):
        return os.mkdir, ("unpickled",)


def damage_arrays(file: Path, rng: random.Random) -> None:
    """An array of another type, shape or value, or a member that no writer of NumPy writes."""
    with np.load(file) as stored:
        arrays = dict(stored)
    name = rng.choice(list(arrays))
    if rng.random() < 0.5:
        arrays[name] = rng.choice(ARRAYS)(arrays[name])
        if rng.random() < 0.1:
            del arrays[name]
        np.savez_compressed(file, **arrays)
        return
    members = {f"{one}.npy": npy(array) for one, array in arrays.items()}
    rng.choice(_MEMBERS)(members, f"{name}.npy")
    with zipfile.ZipFile(file, "w", rng.choice((0, 8, 12, 14))) as archive:
        for one, data in members.items():
            archive.writestr(one, data)
    how = rng.random()
    if how < 0.3:
        # Encrypted; a method that no one knows; a length that is none.
        place, value = rng.choice(((6, 1), (8, 99), (8, 6), (8, 97), (18, 0xFFFF), (22, 0xFFFF)))
        _patch(file, place, value)


def _patch(file: Path, place: int, value: int) -> None:
    """A field of the first member's header, in the file and in the directory at its end."""
    data = bytearray(file.read_bytes())
    for start in (data.find(b"PK\3\4") + place, data.find(b"PK\1\2") + place + 2):
        data[start : start + 2] = value.to_bytes(2, "little")
    file.write_bytes(data)


def npy(array: np.ndarray) -> bytes:
    """An array as NumPy writes it."""
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def _header(members: dict[str, bytes], name: str, text: str) -> None:
    head = text.encode("latin-1") + b"\n"
    members[name] = b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head + b"\0" * 64


def _shape(text: str, kind: str = "'<f8'") -> Callable[[dict[str, bytes], str], None]:
    def replace(members: dict[str, bytes], name: str) -> None:
        _header(members, name, f"{{'descr': {kind}, 'fortran_order': False, 'shape': {text}, }}")

    return replace


def _pickled(members: dict[str, bytes], name: str) -> None:
    _shape("(1,)", "'|O'")(members, name)
    members[name] = members[name][:-64] + pickle.dumps(_Payload())


def _bare_pickle(members: dict[str, bytes], name: str) -> None:
    members[name] = pickle.dumps(_Payload())


def _other_name(members: dict[str, bytes], name: str) -> None:
    members["../../x.npy"] = members.pop(name)


def _no_npy(members: dict[str, bytes], name: str) -> None:
    members[name.removesuffix(".npy")] = members.pop(name)


def _half(members: dict[str, bytes], name: str) -> None:
    members[name] = members[name][: len(members[name]) // 2]


_SHAPES = (
    *("(3,)", "(10**12,)", "(-1,)", "(2**62, 2**62)", "(1,)*100", "()", "3", "(0, 99)", "(1e3,)"),
    *("(99999999999,)", "(True,)", "(None,)", "('a',)", "(" * 500, "[3]", "(3,),'x':1"),
)
_KINDS = ("'<f99'", "[('a','<f8')]", "'O'", "'<M8[s]'", "None", "'<U0'", "('<f8',(99,))")
_MEMBERS = (*map(_shape, _SHAPES), *(_shape("(3,)", kind) for kind in _KINDS))
_MEMBERS += (_pickled, _bare_pickle, _other_name, _no_npy, _half)


def _with(value: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(array: np.ndarray) -> np.ndarray:
        array = np.array(array, float)
        array.reshape(-1)[-1:] = value
        return array

    return change


_TYPES = ("c16", "U3", "S3", "?", "O", "M8[s]", "m8[s]", "u1", "f2")
ARRAYS: tuple[Callable[[np.ndarray], Any], ...] = (
    *map(_with, (np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324, -1.0, 2.0**63)),
    *(lambda a, t=t: np.zeros(np.shape(a), t) for t in _TYPES),
    *(lambda a, s=s: np.zeros(s) for s in ((), (0,), (1,), (2, 2), (1000,), (3, 0), (1, 1, 1))),
    lambda a: np.full(np.shape(a), np.nan),
    lambda a: np.concatenate([np.ravel(a), np.ravel(a)]),
    lambda a: np.ravel(a)[::-1],
    lambda a: np.full(np.shape(a), np.iinfo(np.int64).min),
    lambda a: np.array([(1, 2.0)], [("a", "i4"), ("b", "f8")]),
    lambda a: np.array([10**400], object),
)
