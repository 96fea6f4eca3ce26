import io
import json
import os
import re
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import yaml

from stixel_cli.border import files
from stixel_cli.border.files import read_arrays, read_json, read_text, read_yaml
from stixel_cli.border.origins import write_whole, written
from stixel_cli.errors import UserError
from stixel_cli.rendering.images import ImageStack, decode_image, encode_png, encode_pnm


def test_texts_and_bytes_in_a_folder_that_is_not_there_yet(tmp_path):
    write_whole(tmp_path / "a/b/text", "10° ± 1\n")
    write_whole(tmp_path / "a/bytes", b"\x00\r\n")
    assert (tmp_path / "a/b/text").read_bytes() == "10° ± 1\n".encode()
    assert (tmp_path / "a/bytes").read_bytes() == b"\x00\r\n"


def test_threads_write_one_file_at_once(tmp_path, monkeypatch):
    """The other thread replaces the file between this one's two steps."""
    replace = Path.replace

    def slowly(partial, target):
        monkeypatch.setattr(Path, "replace", replace)
        with ThreadPoolExecutor(1) as pool:
            pool.submit(write_whole, target, "other").result()
        return replace(partial, target)

    monkeypatch.setattr(Path, "replace", slowly)
    write_whole(tmp_path / "text", "this")
    assert (tmp_path / "text").read_text() == "this"
    assert len(list(tmp_path.iterdir())) == 1


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
    with pytest.raises(OSError, match="No space left"):
        write_whole(tmp_path / "new/er/report.html", "new")
    assert os.listdir(tmp_path) == ["report.html"]


def refused(read, file):
    """The one line of a file that is refused; it names the file, or its folder and its name."""
    with pytest.raises(UserError) as caught:
        read(file)
    said = str(caught.value)
    assert "\n" not in said
    assert len(said) < 400
    assert said.startswith((f"{file}: ", f"{file.parent}: {file.name} "))
    return said


def links(folder):
    """Names of what is no regular file -> what is said of it."""
    os.mkfifo(folder / "fifo")
    (folder / "zero").symlink_to("/dev/zero")
    (folder / "null").symlink_to("/dev/null")
    (folder / "circle").symlink_to("circle")
    (folder / "lost").symlink_to("nowhere")
    (folder / "folder").mkdir()
    (folder / "file").write_text("")
    said = dict.fromkeys(("fifo", "zero", "null"), "not a regular file")
    said |= {"circle": "Too many levels of symbolic links", "lost": "lost is missing"}
    said |= {"folder": "cannot be read: Is a directory"}
    return said | {"file/below": "cannot be read: Not a directory"}


@pytest.mark.parametrize("read", [read_text, read_json, read_yaml, read_arrays])
def test_only_regular_files_are_read(tmp_path, read):
    for name, said in links(tmp_path).items():
        assert said in refused(read, tmp_path / name)
    large = tmp_path / "large"
    with large.open("wb") as file:
        file.truncate(files.GREATEST_ARRAYS + 1)  # A sparse file takes no space.
    assert "too large: 1073741825 bytes, at most" in refused(read, large)


def test_too_many_values_and_a_file_that_is_larger_than_it_says_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "MOST_VALUES", 10)
    file = tmp_path / "file"
    file.write_text(json.dumps({"a": [0] * 10}))
    assert "a: more than 10 values" in refused(read_json, file)
    assert "more than 10 values, aliases expanded" in refused(read_yaml, file)
    # Files of /proc say that they have no bytes.
    file = Path("/proc/self/status")
    if not file.exists():
        pytest.skip("there is no /proc here")
    assert "Name:" in read_text(file)
    monkeypatch.setattr(files.read_bytes, "__defaults__", (100,))
    assert "too large: more than 100 bytes" in refused(read_text, file)


DEEP = 100_000
NO_JSON = ["[" * DEEP, '{"a":' * DEEP, '{"a": 1' + "0" * 5000 + "}", '{"a": 1, "a": 2}', ""]
NOT_FINITE = ['{"a": 1e400}', '{"a": -Infinity}', '{"a": NaN}', f'{{"a": {10**400}}}']
JSON = {
    "not valid JSON": NO_JSON,
    "nested more than 50 levels deep": ['{"a": ' + "[" * 60 + "]" * 60 + "}"],
    "a: not a finite number": NOT_FINITE,
    "a: not valid text": ['{"a": ["\\ud800"]}'],
    "a name: not valid text": ['{"\\ud800": 1}'],
    "must map names to values, not be a list": ["[1]"],
    "must map names to values, not be a int": ["3"],
}
CIRCLES = ["a: &a [*a]", "a: &a [1]\nb: &a [*a]", "a: &a {<<: *a}"]
NO_YAML = ["!!python/object/apply:os.getcwd []", "{[1]: 2}", "a: \x07", "a: 1\n---\nb: 2"]
YAML = {
    "nested more than 50 levels deep": [text * DEEP for text in ("[", "{a: ", "- ", "? ")],
    "*a: an alias of itself, or of nothing": CIRCLES,
    "*b: an alias of itself, or of nothing": ["a: *b"],
    "a: not a finite number": ["a: .inf", "a: .nan", f"a: {10**400}"],
    "a number of 2000001 characters": ["a: 1" + ":0" * 10**6],
    "line 1: found invalid Unicode character escape code": ['a: "\\ud800"'],
    "line 2: a: is given twice": ["a: 1\n'a': 2"],
    "line 1: b: is given twice": ["a: {b: {c: 1}, d: [b], b: 2}"],
    "a: a set: must be": ["a: !!set {b}"],
    "a: a bytes: must be": ["a: !!binary AAAA"],
    "line 2: did not find expected node content: not valid YAML": ["a: ["],
    "not valid YAML": NO_YAML,
}


def bomb(entry):
    """YAML of 10 lines, each of which has the one before ten times."""
    lines = ["a0: &a0 {k: v}"]
    lines += [f"a{i}: &a{i} " + entry(", ".join([f"*a{i - 1}"] * 10)) for i in range(1, 10)]
    return "\n".join(lines)


BOMBS = [bomb(entry.format) for entry in ("[{}]", "{{<<: [{}]}}")]
YAML["more than 4000000 values, aliases expanded"] = BOMBS
TEXTS = [(read_json, said, text) for said, texts in JSON.items() for text in texts]
TEXTS += [(read_yaml, said, text) for said, texts in YAML.items() for text in texts]


@pytest.mark.parametrize(
    ("read", "said", "text"), TEXTS, ids=lambda one: ascii(getattr(one, "__name__", one))[:30]
)
def test_texts_that_would_break_a_parser(tmp_path, read, said, text):
    file = tmp_path / "file"
    file.write_text(text)
    assert said in refused(read, file)


def test_plain_files_are_read(tmp_path):
    file = tmp_path / "file"
    file.write_text('{"a": [1, 2.5, null, true, "°"], "b": {}}')
    assert read_json(file) == read_yaml(file) == {"a": [1, 2.5, None, True, "°"], "b": {}}
    file.write_text("a: &a [1]\nb: [*a, *a]\n")
    assert read_yaml(file) == {"a": [1], "b": [[1], [1]]}
    file.write_text("a: 1e-6\nb: 2026-01-01\nc: 2026-99-99\nd: 1e6\ne: e6\n")
    assert read_yaml(file) == {"a": 1e-6, "b": "2026-01-01", "c": "2026-99-99", "d": 1e6, "e": "e6"}
    points = [["measurement=fabricated", f"seed={i}"] for i in range(10_000)]
    file.write_text(yaml.dump({"points": points}, Dumper=yaml.CSafeDumper))
    assert read_yaml(file) == {"points": points}


ARRAYS = {"t": np.arange(3.0), "used": np.array([True]), "k": np.zeros((2, 0, 3), np.int32)}


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_arrays_are_read(tmp_path, save):
    save(tmp_path / "a.npz", **ARRAYS, f=np.asfortranarray(np.eye(3)), scalar=np.float32(2))
    found = read_arrays(tmp_path / "a.npz")
    assert list(found) == [*ARRAYS, "f", "scalar"]
    for name, value in ARRAYS.items():
        assert found[name].dtype == value.dtype
        np.testing.assert_array_equal(found[name], value)


def npz(content, method=zipfile.ZIP_DEFLATED, name="t.npy"):
    """The bytes of an archive with one member."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        archive.writestr(name, content)
    return buffer.getvalue()


def npy(header, data=bytes(24)):
    """The bytes of an array with a header of its own."""
    text = header.encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data


def patched(content, *patches):
    """An archive's bytes with bytes replaced; `patches` are (signature, offset, bytes)."""
    data = bytearray(content)
    for signature, offset, new in patches:
        at = data.index(signature) + offset
        data[at : at + len(new)] = new
    return bytes(data)


PLAIN = "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }"
GOOD = npz(npy(PLAIN))
LOCAL, CENTRAL = b"PK\x03\x04", b"PK\x01\x02"
NPZ = {
    "no archive": (b"nothing", "not a file of numeric arrays"),
    "empty": (b"", "not a file of numeric arrays"),
    "cut": (GOOD[:-30], "not a file of numeric arrays"),
    "encrypted": (patched(GOOD, (LOCAL, 6, b"\1"), (CENTRAL, 8, b"\1")), "'t.npy' is encrypted"),
    "unknown method": (patched(GOOD, (LOCAL, 8, b"\x63"), (CENTRAL, 10, b"\x63")), "other than"),
    "lzma": (npz(npy(PLAIN), zipfile.ZIP_LZMA), "compressed by a method other than deflate"),
    "flipped": (patched(GOOD, (LOCAL, 40, b"\xff\xff\xff")), "not a file of numeric arrays"),
    "no array": (npz(b"text"), "not a file of numeric arrays"),
    "version": (npz(b"\x93NUMPY\x09\x00" + bytes(100)), "not a file of numeric arrays"),
    "huge shape": (npz(npy(PLAIN.replace("3,", "10**15,"))), "not a file of numeric arrays"),
    "large shape": (npz(npy(PLAIN.replace("3,", "2000000000,"))), "not a file of numeric arrays"),
    "negative": (npz(npy(PLAIN.replace("3,", "-1,-3"))), "not a file of numeric arrays"),
    "objects": (npz(npy(PLAIN.replace("<f8", "|O"))), "not a file of numeric arrays"),
    "records": (npz(npy(PLAIN.replace("'<f8'", "[('a', '<f8')]"))), "not a file of numeric"),
    "texts": (npz(npy(PLAIN.replace("<f8", "<U2"))), "not a file of numeric arrays"),
    "brackets": (npz(npy("(" * 110)), "not a file of numeric arrays"),
    "python 2": (npz(npy(PLAIN.replace("3,", "3L,"))), "not a file of numeric arrays"),
    "syntax": (npz(npy(PLAIN.replace("False", "0in ()"))), "not a file of numeric arrays"),
    "too long": (npz(npy(PLAIN, bytes(25))), "not a file of numeric arrays"),
    "declared": (patched(GOOD, (CENTRAL, 24, b"\0\0\0\x7f")), "too large: its arrays have"),
    "zeros": (npz(npy(PLAIN.replace("3,", f"{2**28},"), bytes(2**20))), "not a file of numeric"),
}


@pytest.mark.parametrize("case", NPZ)
def test_arrays_that_are_damaged(tmp_path, case):
    content, said = NPZ[case]
    file = tmp_path / "scores.npz"
    file.write_bytes(content)
    assert said in refused(read_arrays, file)


def test_two_arrays_of_one_name(tmp_path):
    file = tmp_path / "scores.npz"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("t.npy", npy(PLAIN))
        archive.writestr("u.npy", npy(PLAIN))
    file.write_bytes(file.read_bytes().replace(b"u.npy", b"t.npy"))
    assert "two of its arrays have one name" in refused(read_arrays, file)


SHAPE = 60, 80
RANDOM = np.random.default_rng(0)
IMAGES = {
    "picture": (np.indices(SHAPE).sum(axis=0)[:, :, None] + [0, 50, 100]).astype(np.uint8),
    "noise": RANDOM.normal(120.0, 3.0, SHAPE).astype(np.uint8),
    "any colours": RANDOM.integers(0, 256, (*SHAPE, 3), dtype=np.uint8),
    "upper 16 bits": np.full(SHAPE, 3, dtype=np.uint16),
    "lower 16 bits": RANDOM.integers(0, 65536, SHAPE, dtype=np.uint16),
    "ids": (np.indices(SHAPE)[1] // 20).astype(np.uint8),
}


@pytest.mark.parametrize("encode", [encode_png, encode_pnm])
@pytest.mark.parametrize("kind", IMAGES)
def test_an_image_survives_compression_and_its_bytes_repeat(kind, encode):
    image = IMAGES[kind]
    data = encode(image)
    assert data == encode(np.asfortranarray(image))
    again = decode_image(data)
    assert again.dtype == image.dtype and np.array_equal(again, image)
    stack = ImageStack.from_images([image, image[::-1]])
    assert len(stack) == 2 and np.array_equal(stack[1], image[::-1])


@pytest.mark.parametrize("kind", ["picture", "noise", "upper 16 bits", "ids"])
def test_what_can_be_compressed_is(kind):
    assert len(encode_png(IMAGES[kind])) < 0.75 * IMAGES[kind].nbytes


def test_what_is_no_image_is_refused():
    with pytest.raises(ValueError, match="not an image"):
        decode_image(b"no image")
    for image in (np.zeros((2, 3, 5), dtype=np.uint8), np.zeros((2, 3)), np.zeros((2, 3, 3))):
        with pytest.raises(ValueError, match=r"cannot encode an image of shape \(2, 3"):
            encode_png(image)
