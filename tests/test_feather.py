"""Feather files of any origin: what they unpack to is limited before it is unpacked."""

import pytest

from stixel_cli import feather
from stixel_cli.errors import UserError

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
    found = feather.read_columns(file, ("t", "x"), ("kind", "name"))
    assert found["t"].tolist() == list(range(100)) and found["x"].sum() == 50.0
    assert found["kind"].tolist() == ["car", "van"] * 50 and set(found["name"]) == {"a"}


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
@pytest.mark.parametrize("packed", ["numbers", "dictionary"])
def test_a_file_that_unpacks_to_too_much_is_refused(tmp_path, monkeypatch, compression, packed):
    columns = {"t": [0] * 1000 if packed == "numbers" else [0, 0]}
    if packed == "dictionary":
        columns["kind"] = pyarrow.array(["a" * 4000, "b" * 4000]).dictionary_encode()
    file = write(tmp_path / "t.feather", columns, compression)
    assert file.stat().st_size < 2000
    monkeypatch.setattr(feather, "GREATEST_UNPACKED", 7000)
    with pytest.raises(UserError, match=r"t\.feather: too large: \d+ bytes when unpacked, at most"):
        feather.read_columns(file, ("t",))


@pytest.mark.parametrize("encoded", [False, True])
def test_a_long_text_is_refused(tmp_path, encoded):
    """NumPy would give each row the size of the longest text."""
    texts = pyarrow.array(["car", "x" * 65])
    columns = {"kind": texts.dictionary_encode() if encoded else texts}
    file = write(tmp_path / "t.feather", columns, "zstd")
    with pytest.raises(UserError, match=r"the column kind: a text of 65 bytes, at most 64$"):
        feather.read_columns(file, (), ("kind",))
