"""Damage to the files of a result folder, drawn at random."""

import json
import os
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml
from damaged_arrays import damage_arrays
from odd_values import words

_MARK = "@here@"

PLAIN = (
    *words(r"""
    null true false 0 -1 3.5 1e308 -0.0 5e-324 "" "x" "\u0000" [] {} [[]] [1,null] {"":1}
    {"a":{"b":[1,{}]}} "../../x" "/tmp/evil" "/dev/zero" "\ud800" "\u202e\u2028" "\u001b[31m" "\n\n"
    "[red]x[/red]" "nan" "1" 2026 1e400 -1e400 "<script>alert(1)</script>"
    """),
    *("9" * 25, "9" * 400, "9" * 5000, '"' + "x" * 100_000 + '"', "[" * 300 + "]" * 300),
    *('"' + "é" * 3000 + '"', "[" + "0," * 5000 + "0]"),
)
"""Values as JSON, and YAML, has them."""

IN_JSON = ("NaN", "-Infinity", "[" * 100_000, '{"a":' * 100_000, "[" * 900 + "]" * 900, "01", "")
IN_YAML = (
    *words(".nan -.inf 2026-01-01 2026-01-01T00:00:00Z 0o17 1:30:00 0x10 ~ = << ${seed} *b"),
    *("!!set {a, b}", "!!binary aGFsbG8=", "!!python/object/apply:os.mkdir [unpickled]"),
    *("!nothing x", "&a [*a]", "{1: 2}", "{null: 1}", "{[a]: 1}", "{2026-01-01: 1}", "{true: 1}"),
    *("? x", "- - -", "[" * 100_000, "{a: " * 100_000, "[" * 900 + "]" * 900, "{<<: {a: 1}}"),
    "!!omap [a: 1]",
    "{a: &a [x,x,x,x,x,x,x,x], b: &b [*a,*a,*a,*a,*a,*a,*a,*a], c: &c [*b,*b,*b,*b,*b,*b,*b,*b], "
    "d: &d [*c,*c,*c,*c,*c,*c,*c,*c], e: &e [*d,*d,*d,*d,*d,*d,*d,*d], f: [*e,*e,*e,*e,*e,*e,*e]}",
)


def damage(file: Path, rng: random.Random) -> None:
    """Damage one file: what it is, its bytes, or its content."""
    how = rng.random()
    if how < 0.15:
        rng.choice(_REPLACED)(file)
    elif how < 0.35:
        rng.choice(_BYTES if file.stat().st_size else (_random,))(file, rng)
    else:
        of_kind = {".json": damage_tree, ".yaml": damage_tree, ".npz": damage_arrays}
        of_kind.get(file.suffix, _text)(file, rng)


def _link(target: str) -> Callable[[Path], None]:
    def replace(file: Path) -> None:
        file.unlink()
        file.symlink_to(target.format(file=file.name, parent=file.parent))

    return replace


def _folder(file: Path) -> None:
    file.unlink()
    file.mkdir()
    (file / "x").touch()


def _fifo(file: Path) -> None:
    file.unlink()
    os.mkfifo(file)


def _huge(file: Path) -> None:
    os.truncate(file, 2**36)


LINKS = ("/dev/zero", "/dev/null", "nowhere", "{file}", "{parent}", "/dev/tty", "/proc/self/mem")
_REPLACED = (Path.unlink, _folder, _fifo, _huge, *map(_link, LINKS))


def _cut(file: Path, rng: random.Random) -> None:
    os.truncate(file, rng.randrange(file.stat().st_size + 1))


def _flip(file: Path, rng: random.Random) -> None:
    data = bytearray(file.read_bytes())
    for _ in range(rng.choice((1, 1, 2, 5, 50))):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    file.write_bytes(data)


def _insert(file: Path, rng: random.Random) -> None:
    data = file.read_bytes()
    at = rng.choice((0, len(data), rng.randrange(len(data))))
    odd = (b"\0", b"\xff", b"\xef\xbb\xbf", b"\r\n", b"\t", b"---\n", b"{", b"#", b"\xed\xa0\x80")
    what = rng.choice(odd)
    file.write_bytes(data[:at] + what * rng.choice((1, 1, 3, 1000)) + data[at:])


def _repeat(file: Path, rng: random.Random) -> None:
    data = file.read_bytes()
    start, stop = sorted(rng.randrange(len(data)) for _ in range(2))
    file.write_bytes(data[:stop] + data[start:])


def _encode(file: Path, rng: random.Random) -> None:
    text = file.read_bytes().decode("latin-1")
    file.write_bytes(text.encode(rng.choice(("utf-16", "utf-32", "utf-8-sig", "cp037"))))


def _random(file: Path, rng: random.Random) -> None:
    file.write_bytes(rng.randbytes(rng.choice((0, 1, 10, 1000))))


_BYTES = (_cut, _cut, _flip, _flip, _insert, _repeat, _encode, _random)


def _text(file: Path, rng: random.Random) -> None:
    """A cell of a table, or a line of a text, is another."""
    lines = file.read_bytes().decode("latin-1").split("\n")
    at = rng.randrange(len(lines))
    words = lines[at].split(",")
    words[rng.randrange(len(words))] = rng.choice((*PLAIN, "=1+1", '"', "a,b,c", "\r", "nan", "\0"))
    lines[at] = ",".join(words)
    file.write_text("\n".join(lines), encoding="utf-8")


def damage_tree(file: Path, rng: random.Random) -> None:
    """One or two places of the tree are of another type, away, or more."""
    is_json = file.suffix == ".json"
    text = file.read_text(encoding="utf-8")
    tree = {"": json.loads(text) if is_json else yaml.safe_load(text)}
    new = []
    for _ in range(rng.choice((1, 1, 2))):
        parent, key = rng.choice(list(_places(tree)))
        how = rng.random()
        if how < 0.15 and parent is not tree:
            del parent[key]
        elif how < 0.25 and isinstance(parent, dict) and parent is not tree:
            value = parent.pop(key)
            parent[rng.choice(("", "x", "\u2028", "a.b", "kind", "__class__", "x" * 5000))] = value
        elif how < 0.35:
            parent[key] = rng.choice(([parent[key]], {"x": parent[key]}, str(parent[key])))
        else:
            parent[key] = f"{_MARK}{len(new)}"
            new.append(rng.choice((*PLAIN, *PLAIN, *(IN_JSON if is_json else IN_YAML))))
    plain = tree[""]
    text = json.dumps(plain) if is_json else yaml.safe_dump(plain, sort_keys=False)
    for number, one in enumerate(new):
        mark = f"{_MARK}{number}"
        for written in (f'"{mark}"', f"'{mark}'"):
            text = text.replace(written, one)
    file.write_text(text, encoding="utf-8")


def _places(tree: Any):
    items = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in list(items):
        yield tree, key
        if isinstance(value, dict | list):
            yield from _places(value)


def restore(place: Path, original: Path) -> None:
    """Make `place` hold what `original` does, whatever became of it."""
    for path in place.iterdir():
        shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
    shutil.copytree(original, place, dirs_exist_ok=True)
