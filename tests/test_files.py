import os
import re
from pathlib import Path

import pytest

from stixel_cli.errors import UserError
from stixel_cli.files import write_whole, written


def test_texts_and_bytes_in_a_folder_that_is_not_there_yet(tmp_path):
    write_whole(tmp_path / "a/b/text", "10° ± 1\n")
    write_whole(tmp_path / "a/bytes", b"\x00\r\n")
    assert (tmp_path / "a/b/text").read_bytes() == "10° ± 1\n".encode()
    assert (tmp_path / "a/bytes").read_bytes() == b"\x00\r\n"


def test_a_write_that_fails_leaves_what_was_there_and_nothing_else(tmp_path, monkeypatch):
    file = tmp_path / "report.html"
    write_whole(file, "old")
    to_bytes = Path.write_bytes

    def full(path, content):
        to_bytes(path, content[:1])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    said = rf"^{re.escape(str(tmp_path))}: cannot be written: No space left"
    with pytest.raises(UserError, match=said), written(tmp_path):
        write_whole(file, "new")
    assert os.listdir(tmp_path) == ["report.html"]
    assert file.read_text() == "old"
