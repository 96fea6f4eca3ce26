"""Feather files of any origin: what pyarrow refuses is one line, and so are too many rows."""

import random
import struct

import pytest

from stixel_cli.errors import UserError
from stixel_cli.recordings import argoverse

pyarrow = pytest.importorskip("pyarrow")


def write(file, columns, compression):
    from pyarrow.feather import write_feather

    write_feather(pyarrow.table(columns), str(file), compression=compression)
    return file


@pytest.mark.parametrize("compression", ["zstd", "lz4", "uncompressed"])
def test_columns_by_name(tmp_path, compression):
    words = pyarrow.array(["car", "van"] * 50).dictionary_encode()
    columns = {"t": list(range(100)), "kind": words, "name": ["a"] * 100, "x": [0.5] * 100}
    file = write(tmp_path / "t.feather", columns, compression)
    found = argoverse.read_columns(file, ("t", "x"), ("kind", "name"))
    assert found["t"].tolist() == list(range(100)) and found["x"].sum() == 50.0
    assert found["kind"].tolist() == ["car", "van"] * 50 and set(found["name"]) == {"a"}


def test_too_many_rows_are_refused_before_they_are_unpacked(tmp_path, monkeypatch):
    file = write(tmp_path / "t.feather", {"t": pyarrow.nulls(9, "int64").fill_null(0)}, "zstd")
    monkeypatch.setattr(argoverse, "MOST_ROWS", 9)
    assert len(argoverse.read_columns(file, ("t",))["t"]) == 9
    monkeypatch.setattr(argoverse, "MOST_ROWS", 8)
    # If these rows were unpacked, the file would be called damaged.
    data = file.read_bytes()
    file.write_bytes(data.replace(b"\x28\xb5\x2f\xfd", b"\0\0\0\0"))
    with pytest.raises(UserError, match=r"t\.feather: more than 8 rows$"):
        argoverse.read_columns(file, ("t",))


@pytest.mark.parametrize("size", [2**62, 2**33, -5])
def test_another_size_than_the_stated_one_is_refused(tmp_path, size):
    """The size of a packed column stands before it."""
    file = write(tmp_path / "t.feather", {"t": list(range(1000))}, "zstd")
    data = bytearray(file.read_bytes())
    start = data.find(b"\x28\xb5\x2f\xfd")
    data[start - 8 : start] = struct.pack("<q", size)
    file.write_bytes(data)
    with pytest.raises(UserError, match=r"t\.feather: not a valid Feather file: "):
        argoverse.read_columns(file, ("t",))


def test_a_damaged_file_is_read_or_refused_in_one_line(tmp_path):
    columns = {"t": list(range(50)), "kind": pyarrow.array(["car", "van"] * 25)}
    whole = write(tmp_path / "t.feather", columns, "zstd").read_bytes()
    draw, refused = random.Random(0), 0
    for _ in range(400):
        data = bytearray(whole[: draw.choice((len(whole), draw.randrange(len(whole))))])
        for _ in range(min(len(data), draw.choice((1, 2, 8)))):
            data[draw.randrange(len(data))] = draw.randrange(256)
        file = tmp_path / "damaged.feather"
        file.write_bytes(data)
        try:
            found = argoverse.read_columns(file, ("t",), ("kind",))
            assert len(found["t"]) == len(found["kind"])
        except UserError as fault:
            refused += 1
            assert "\n" not in str(fault) and str(file) in str(fault)
    assert 200 < refused < 400
