"""Read files of any origin with limits.

All files of unknown origin are read here. A file must be a regular file (a FIFO or a device would
block, or never end) of limited size; its content must have limited depth, finite numbers and valid
text. Nothing is unpickled. Each fault is reported in one line.
"""

import os
import re
import stat
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, lru_cache, wraps
from hashlib import file_digest
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, ParamSpec, TypeVar

from stixel_cli.errors import UserError, printable_path

if TYPE_CHECKING:
    import zipfile
    from xml.etree.ElementTree import Element

    import numpy as np

P, T = ParamSpec("P"), TypeVar("T")

GREATEST_TEXT = 64 * 2**20
"""Bytes of a text, a JSON or a YAML file: the `sweep.yaml` of 100,000 runs has 10 MB."""

GREATEST_ARRAYS = 2**30
"""Bytes of all arrays of an `.npz` file: the points of 10,000 scans take 200 MB."""

GREATEST_RECORDING = 2**35
"""Bytes of a file that is read in pieces, such as a recording in one file."""

DEEPEST = 50
"""Levels of lists and mappings in JSON and YAML; libyaml overflows the stack at some 10,000."""

MOST_VALUES = 4_000_000
"""Values of a JSON or YAML file, aliases expanded."""

_LONG_NUMBER = re.compile(r"[-+0-9_:.]{1000,}")
"""YAML has numbers to base 60, which take quadratic time to read."""


@contextmanager
def opened(file: Path, greatest: int = GREATEST_ARRAYS) -> Iterator[BinaryIO]:
    """Open a regular file of at most `greatest` bytes for reading.

    UserError if it is missing, not a regular file, too large, or cannot be read.
    """
    try:
        with open(file, "rb", opener=without_waiting) as stream:
            status = os.fstat(stream.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise UserError(f"{file}: not a regular file")
            if status.st_size > greatest:
                raise UserError(f"{file}: too large: {status.st_size} bytes, at most {greatest}")
            yield stream
    except FileNotFoundError:
        raise UserError(f"{printable_path(file.parent)}: {file.name} is missing") from None
    except OSError as error:
        raise UserError(f"{file}: cannot be read: {error.strerror or error}") from error


def without_waiting(path: str, flags: int) -> int:
    """Open a file; without O_NONBLOCK a FIFO would wait for its other end."""
    return os.open(path, flags | os.O_NONBLOCK | os.O_NOCTTY, 0o666)


def read_bytes(file: Path, greatest: int = GREATEST_TEXT) -> bytes:
    """The content of a regular file of at most `greatest` bytes; UserError for any other."""
    with opened(file, greatest) as stream:
        # Files of /proc have size 0. None: nothing to read at the moment.
        content = stream.read(greatest + 1) or b""
    if len(content) > greatest:
        raise UserError(f"{file}: too large: more than {greatest} bytes")
    return content


def content_digest(file: Path, greatest: int = GREATEST_ARRAYS) -> str:
    """SHA-256, in hex, of a regular file's content; UserError for any other: it may not end."""
    with opened(file, greatest) as stream:
        return file_digest(stream, "sha256").hexdigest()


def read_text(file: Path) -> str:
    """The text of a file, without a BOM; UserError if it is missing, too large, or not in UTF-8."""
    try:
        return read_bytes(file).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise UserError(f"{file}: not a text in UTF-8") from None


def read_json(file: Path) -> dict[str, Any]:
    """The names and values of a JSON file.

    UserError if it is missing, not JSON, or has what `check_plain` refuses.
    """
    return parse_json(read_text(file), file)


def parse_json(text: str, file: Path) -> dict[str, Any]:
    """The names and values of a JSON text in `file`; UserError as of `read_json`."""
    import json

    # Before a value is made: a packed text of 64 kB can have 30 million, which took 2.7 GiB.
    if text.count(",") > MOST_VALUES:
        raise UserError(f"{file}: more than {MOST_VALUES} values")
    try:
        content = json.loads(text, object_pairs_hook=_unique)
    except (ValueError, RecursionError):
        raise UserError(f"{file}: not valid JSON") from None
    check_plain(content, file)
    return content


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        raise ValueError("a name is given twice")
    return content


def read_xml(file: Path) -> "Element":
    """The root of an XML file without entities of its own.

    UserError if it is missing, is not XML, declares entities, or has too many elements.
    """
    from xml.etree import ElementTree

    text = read_text(file)
    if "<!ENTITY" in text or text.count("<") > MOST_VALUES:
        raise UserError(f"{file}: must declare no entities, and have at most {MOST_VALUES} tags")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise UserError(f"{file}: not valid XML: {error}") from None


def read_yaml(file: Path, most: int | None = None) -> dict[str, Any]:
    """The names and values of a YAML file, {} of an empty one; 1e-6 is a number, a date is text.

    It has at most `most` values (default `MOST_VALUES`), aliases expanded. UserError if it is
    missing, is not YAML, has a key twice in a mapping, is nested too deep or has too many values,
    or has what `check_plain` refuses.
    """
    import yaml

    # OpenCV's files have a directive and a tag that are not valid YAML; a message that ROS prints
    # ends with the start of a next document.
    text = re.sub(r"\A%YAML:1\.0\s*\n|!!opencv-matrix|\n---\s*\Z", "", read_text(file))
    try:
        _check_nodes(text, file, most or MOST_VALUES)
        content = yaml.load(text, _loader())
        content = {} if content is None else content
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = "" if mark is None else f"line {mark.line + 1}: {error.problem}: "
        raise UserError(f"{file}: {line}not valid YAML") from None
    except (ValueError, TypeError, RecursionError):
        raise UserError(f"{file}: not valid YAML") from None
    check_plain(content, file)
    return content


@cache
def _loader() -> Any:
    """PyYAML's loader of plain types, but 1e-6 is a number, as in YAML 1.2, and a date a text."""
    import yaml

    class Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
        pass

    number = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+$")
    Loader.add_implicit_resolver("tag:yaml.org,2002:float", number, list("-+0123456789"))
    Loader.add_constructor("tag:yaml.org,2002:timestamp", Loader.construct_yaml_str)
    return Loader


def _check_nodes(text: str, file: Path, most: int) -> None:
    """Raise UserError for a YAML text that is nested too deep, too long, or has a key twice."""
    import yaml

    total = 0
    sizes: dict[str | None, int] = {}  # Number of values of each anchor.
    # Of each open collection: anchor, total before, keys of a mapping, and number of its nodes.
    started: list[list[Any]] = []
    # Events come one at a time: the parser does not recurse here, the loader does.
    for event in yaml.parse(text, _loader()):
        if isinstance(event, yaml.CollectionEndEvent):
            anchor, before, *_ = started.pop()
            sizes[anchor] = total - before
        elif isinstance(event, yaml.NodeEvent):
            anchor, value = event.anchor, getattr(event, "value", None)
            if started and started[-1][2] is not None:
                # A mapping has a key, its value, the next key, …
                if started[-1][3] % 2 == 0 and value is not None:
                    if value in started[-1][2]:
                        line = event.start_mark.line + 1
                        raise UserError(f"{file}: line {line}: {value[:40]}: is given twice")
                    started[-1][2].add(value)
                started[-1][3] += 1
            if isinstance(event, yaml.AliasEvent) and anchor not in sizes:
                raise UserError(f"{file}: *{anchor[:40]}: an alias of itself, or of nothing")
            if value is not None and _LONG_NUMBER.fullmatch(value):
                raise UserError(f"{file}: a number of {len(value)} characters")
            total += sizes[anchor] if isinstance(event, yaml.AliasEvent) else 1
            if isinstance(event, yaml.CollectionStartEvent):
                keys = set() if isinstance(event, yaml.MappingStartEvent) else None
                started.append([anchor, total - 1, keys, 0])
                sizes.pop(anchor, None)
            elif value is not None:
                sizes[anchor] = 1
        if len(started) > DEEPEST:
            raise UserError(f"{file}: nested more than {DEEPEST} levels deep")
        if total > most:
            raise UserError(f"{file}: more than {most} values, aliases expanded")


def check_plain(content: Any, file: Path) -> None:
    """Check the content of `file`.

    UserError if it is no mapping, has anything except lists, mappings, valid text, finite numbers,
    booleans and null, or is nested deeper than `DEEPEST`.
    """
    pending: list[tuple[Any, Any, int]] = [("content", content, 0)]
    total = 0
    while pending:
        name, value, depth = pending.pop()
        total += 1
        fault = None
        if depth > DEEPEST:
            fault = f"nested more than {DEEPEST} levels deep"
        elif total > MOST_VALUES:
            fault = f"more than {MOST_VALUES} values"
        elif isinstance(value, str):
            if not value.isascii() and any("\ud800" <= c <= "\udfff" for c in value):
                fault = "not valid text (half of a surrogate pair)"
        elif isinstance(value, int | float):
            # No integer beyond the range of a float.
            if not abs(value) <= sys.float_info.max:
                fault = "not a finite number below 1.8e308"
        elif isinstance(value, dict):
            pending += [(key, item, depth + 1) for key, item in value.items()]
            pending += [("a name", key, depth + 1) for key in value]
        elif isinstance(value, list):
            pending += [(name, item, depth + 1) for item in value]
        elif value is not None:
            fault = f"a {type(value).__name__}: must be text, a number, true, false or null"
        if fault is not None:
            raise UserError(f"{file}: {str(name)[:60]}: {fault}")
    if not isinstance(content, dict):
        raise UserError(f"{file}: must map names to values, not be a {type(content).__name__}")


def read_arrays(file: Path, texts: dict[str, str] | None = None) -> "dict[str, np.ndarray]":
    """The numeric arrays of an `.npz` file, by name; members named in `texts` become its values.

    UserError if it is missing, damaged or encrypted, if an array has anything except booleans and
    numbers, or if the arrays together are larger than `GREATEST_ARRAYS`.
    """
    import zipfile

    methods = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
    with opened(file) as stream:
        try:
            # A damaged header may warn as well; that would be a second line.
            with zipfile.ZipFile(stream) as archive, warnings.catch_warnings(action="error"):
                members = archive.infolist()
                if sum(member.file_size for member in members) > GREATEST_ARRAYS:
                    most = f"its arrays have more than {GREATEST_ARRAYS} bytes"
                    raise UserError(f"{file}: too large: {most}")
                if len({member.filename for member in members}) < len(members):
                    raise UserError(f"{file}: two of its arrays have one name")
                for member in members:
                    if member.flag_bits & 1 or member.compress_type not in methods:
                        fault = "is encrypted, or compressed by a method other than deflate"
                        raise UserError(f"{file}: {member.filename!a} {fault}")
                for member in [one for one in members if one.filename in (texts or {})]:
                    if member.file_size > GREATEST_TEXT:
                        fault = f"has more than {GREATEST_TEXT} bytes"
                        raise UserError(f"{file}: {member.filename!a} {fault}")
                    texts[member.filename] = archive.read(member).decode()
                    members.remove(member)
                return {m.filename.removesuffix(".npy"): _read_array(archive, m) for m in members}
        except UserError:
            raise
        except Exception:
            # NumPy, zipfile and zlib have no common class of errors.
            raise UserError(f"{file}: not a file of numeric arrays") from None


def _read_array(archive: "zipfile.ZipFile", member: "zipfile.ZipInfo") -> "np.ndarray":
    """The numbers of a member; NumPy fills what it allocates only as far as there are bytes."""
    from numpy.lib.format import read_array

    with archive.open(member) as stream:
        array = read_array(stream, allow_pickle=False)
        if array.dtype.kind not in "biuf" or stream.read(1):
            raise ValueError("not an array of numbers alone")
    return array


def remembered(read: Callable[P, T]) -> Callable[P, T]:
    """`read`, which reads files again only after their time, size or inode has changed.

    Its paths are arguments of their own. Every call returns the same object: do not change it.
    """

    @lru_cache(maxsize=1024)
    def read_once(arguments: tuple[Any, ...], states: tuple[Any, ...]) -> T:
        return read(*arguments)

    @wraps(read)
    def read_if_changed(*arguments: Any) -> T:
        files = [argument for argument in arguments if isinstance(argument, Path)]
        return read_once(arguments, tuple(map(file_state, files)))

    return read_if_changed


known_digest = remembered(content_digest)


def file_state(file: Path) -> tuple[int, int, int] | None:
    """What changes when a file changes; None if it cannot be read, which its reader reports."""
    try:
        stat = os.stat(file)
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_size, stat.st_ino
