"""A folder of a run, a sweep or an export appears complete, under its name, or not at all."""

import pytest

from stixel_cli.errors import FolderTaken, UserError
from stixel_cli.results.folder import whole_folder, write_whole_folder


def test_it_has_texts_bytes_and_written_files_at_any_depth(tmp_path):
    files = {"a.txt": "ä", "b/c.bin": b"\x00", "b/d.txt": "d"}
    write_whole_folder(tmp_path / "new", files)
    assert (tmp_path / "new" / "a.txt").read_bytes() == "ä".encode()
    assert (tmp_path / "new" / "b/c.bin").read_bytes() == b"\x00"
    assert (tmp_path / "new" / "b/d.txt").read_text() == "d"
    assert [path.name for path in tmp_path.iterdir()] == ["new"]


def test_a_failure_leaves_nothing_and_keeps_an_older_folder(tmp_path):
    write_whole_folder(tmp_path / "old", {"a": "1"})
    for name in ("new", "old"):
        with (
            pytest.raises(UserError, match="written: full"),
            whole_folder(tmp_path / name, True) as partial,
        ):
            (partial / "a").write_text("2")
            raise OSError("full")
    assert [path.name for path in tmp_path.iterdir()] == ["old"]
    assert (tmp_path / "old" / "a").read_text() == "1"


def test_a_folder_is_replaced_only_on_request(tmp_path):
    write_whole_folder(tmp_path / "run", {"a": "1"})
    with pytest.raises(FolderTaken):
        write_whole_folder(tmp_path / "run", {"a": "2"})
    assert (tmp_path / "run" / "a").read_text() == "1"
    write_whole_folder(tmp_path / "run", {"b": "2"}, replace=True)
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["b"]
