"""Random command lines by the real command, in this process; what no answer may be is a complaint.

Case `i` of a kind is drawn from (kind, i) alone, so each can be run again by itself.
"""

import contextlib
import faulthandler
import io
import json
import os
import random
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from stixel_cli.cli.app import main
from stixel_cli.engine.execute import execute
from stixel_cli.engine.plan import plan
from stixel_cli.errors import UserError

LONGEST_CASE = 120
"""Seconds after which a case of a long run hangs, and the run ends with its frames."""

LONGEST_LINE = 1000
"""Characters of a line on stderr, over those that were typed."""

DEFECTS = ("Traceback", "internal error", "Warning: ")

Make = Callable[[random.Random, Path], list[str]]
"""Draws a case: the words after `stixel`; it may write what they name into the folder."""


class _Computes(UserError):
    """In place of computing: so far the command line was right."""


_computes: list[str] = []


@dataclass(frozen=True)
class Answer:
    """How a command ended."""

    code: int
    out: str
    err: str


def number_of_cases(small: int) -> int:
    """How many cases of a kind: `small` in the suite, what STIXEL_FUZZ says in a long run."""
    return int(os.environ.get("STIXEL_FUZZ", small))


def no_computing(monkeypatch) -> None:
    """Let no command of this test compute; what is all in the cache is the real thing."""

    def only_cached(graph, targets, store, *others, **options):
        if plan(graph, targets, store).missing:
            _computes.append("reached")
            raise _Computes("would compute")
        return execute(graph, targets, store, *others, **options)

    for module in ("experiment.stages", "sweeps.run", "benchmark.sequences"):
        monkeypatch.setattr(f"stixel_cli.{module}.execute", only_cached)


def settle(monkeypatch, folder: Path) -> Path:
    """An empty working folder below `folder`, and no way to the user's own files."""
    for name in ("HOME", "XDG_CACHE_HOME", "XDG_STATE_HOME", "XDG_DATA_HOME"):
        monkeypatch.setenv(name, str(folder / name))
    place = folder / "place"
    place.mkdir()
    monkeypatch.chdir(place)
    no_computing(monkeypatch)
    return place


def answer(words: list[str]) -> Answer:
    """What the console script would answer."""
    how = {"encoding": "utf-8", "errors": "backslashreplace", "newline": "\n"}
    out, err = (io.TextIOWrapper(io.BytesIO(), **how) for _ in range(2))
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(words)
    out.flush()
    err.flush()
    return Answer(code, *(s.buffer.getvalue().decode("utf-8") for s in (out, err)))


def complaint(kind: "Kind", words: list[str]) -> str:
    """What is wrong with the answer to `words`, "" if nothing.

    What the command left in the working folder is removed.
    """
    _computes.clear()
    before = _content(kind.place)
    try:
        got = kind.answer(words)
    except BaseException as error:
        return "".join(traceback.format_exception(error))
    after = _content(kind.place)
    changed = sorted(name for name in after | before if after.get(name) != before.get(name))
    _remove([name for name in changed if name not in before])
    # It says what a study lacks, so it is written where a part fails too.
    changed = [name for name in changed if not name.endswith("/report.html")]
    if _computes:
        return ""
    wrong = _fault(words, got) or kind.also(words, got)
    if not wrong and changed and not (kind.may_write and got.code == 0):
        wrong = f"changed: {changed}; exit code {got.code}: {got.err}"
    return wrong


def _fault(words: list[str], got: Answer) -> str:
    # 1 from `verify` says that something differs.
    if got.code not in (0, 2) and not (got.code == 1 and words[0] == "verify" and got.out):
        return f"exit code {got.code}: {got.err}"
    if any(word in got.err or word in got.out for word in DEFECTS):
        return got.err
    if got.code == 2:
        if not got.err.startswith("stixel: ") or got.err.count("\n") != 1:
            return f"not one line: {got.err!r}"
        if not got.err[:-1].isprintable():
            return f"not printable: {got.err!r}"
        if len(got.err) > LONGEST_LINE + sum(map(len, words)):
            return f"{len(got.err)} characters: {got.err[:200]}"
    elif not got.out and not got.err:
        return "no answer"
    elif words[1:2] == ["--json"] and not got.out.startswith("Usage:"):
        try:
            json.loads(got.out, parse_constant=_refuse_constant)
        except ValueError as error:
            return f"no JSON: {error}: {got.out[:200]!r}"
    return ""


def _refuse_constant(text: str) -> None:
    raise ValueError(text)


def _content(place: Path) -> dict[str, tuple[int, int]]:
    found = {}
    for folder, folders, files in os.walk(place):
        for name in (*folders, *files):
            path = os.path.join(folder, name)
            state = os.lstat(path)
            # A folder's time changes with what is in it, which is named itself.
            is_folder = name in folders
            found[path] = (0, 0) if is_folder else (state.st_size, state.st_mtime_ns)
    return found


def _remove(names: list[str]) -> None:
    # A folder comes before what is in it.
    for name in sorted(names, reverse=True):
        path = Path(name)
        if path.is_dir() and not path.is_symlink():
            with contextlib.suppress(OSError):
                path.rmdir()
        else:
            path.unlink(missing_ok=True)


@dataclass(frozen=True)
class Kind:
    """Cases of one kind.

    Attributes:
        name: from which the cases are drawn, with their number.
        make: draws one.
        place: the working folder, left as it was.
        also: a further check of the words and their answer, "" if nothing is wrong.
        may_write: whether a command that succeeds may write into `place`.
        answer: runs the words; the command line's own answer, or that of a reader.
    """

    name: str
    make: Make
    place: Path
    also: Callable[[list[str], Answer], str] = lambda words, got: ""
    may_write: bool = False
    answer: Callable[[list[str]], Answer] = answer


def run_cases(kind: Kind, small: int) -> None:
    """Fail if there are complaints about `small` cases, or in a long run, which tells them on
    stderr, about any of its own.

    A case of a long run that hangs or dies is the last one that it told.
    """
    found, long_run = [], "STIXEL_FUZZ" in os.environ
    for i in range(number_of_cases(small)):
        words = kind.make(random.Random(f"{kind.name} {i}"), kind.place)
        shown = f"{kind.name} {i}: stixel {' '.join(ascii(word)[:300] for word in words)}"
        if long_run:
            sys.__stderr__.write(f"{shown}\n")
            faulthandler.dump_traceback_later(LONGEST_CASE, exit=True, file=sys.__stderr__)
        wrong = complaint(kind, words)
        if wrong:
            found.append(f"{shown}: {wrong}")
            sys.__stderr__.write(f"{found[-1]}\n" if long_run else "")
    faulthandler.cancel_dump_traceback_later()
    assert not found, "\n".join(found)
