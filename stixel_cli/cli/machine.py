"""`stixel doctor` and `stixel cache`: check this machine, inspect and clean its cache."""

import sys
import time
from typing import TYPE_CHECKING, Any

import typer

from stixel_cli.cli import options
from stixel_cli.cli.terminal import print_json, print_table, say, tell
from stixel_cli.errors import UserError, counted, located

if TYPE_CHECKING:
    from stixel_cli.engine.entries import Collection, Entry
    from stixel_cli.engine.errors import MissingEntry
    from stixel_cli.engine.store import Store

app = typer.Typer(name="cache", rich_markup_mode=None, no_args_is_help=False)


@app.callback()
def cache() -> None:
    """Inspect and clean the cache.

    The cache is the folder `cache.folder` of the configuration, else the one that the environment
    variable STIXEL_CACHE names, else the user's cache folder.
    """


def local_store() -> "Store":
    """The cache of this machine."""
    from stixel_cli.config.compose import compose
    from stixel_cli.engine.store import open_store

    return open_store(compose().configuration.cache)


def doctor(json: options.Json = False) -> int:
    """Check whether this machine can run experiments.

    It checks versions, cores, threads, renderers, cache and disk. The exit code is 0 if the default
    experiment can run here, otherwise 1.
    """
    from stixel_cli.engine.progress import Display
    from stixel_cli.machine.health import examine

    bar = Display()
    show = bar.show if sys.stderr.isatty() else lambda _, text: tell(f"{text} …")
    checks = examine(local_store(), begins=(lambda *_: None) if json else show)
    bar.close()
    failing = [check for check in checks if check.status == "fails"]
    if json:
        print_json({"ok": not failing, "checks": [vars(check) for check in checks]})
    else:
        rows = [(check.name, check.status, check.text) for check in checks]
        print_table(("check", "", "found"), rows)
        faults = [f"{check.name} fails: {check.text}" for check in failing]
        say(*(faults or ["the default experiment can run here"]))
    return 1 if failing else 0


@app.command()
def ls(json: options.Json = False) -> int:
    """List cached results by stage: number, size, last use."""
    from rich.filesize import decimal

    from stixel_cli.engine.entries import entries
    from stixel_cli.engine.parameters import duration

    store, now = local_store(), time.time()
    damaged: list[tuple[Entry, MissingEntry]] = []
    listed = entries(store, damaged)
    if damaged:
        are = "1 entry is" if len(damaged) == 1 else f"{len(damaged)} entries are"
        removed = ", removed" if all(fault.removed for _, fault in damaged) else ""
        tell(f"{are} damaged or of an older version{removed}; recomputed when needed")
    stages: dict[str, dict[str, Any]] = {}
    for entry in listed:
        row = stages.setdefault(entry.stage, {"entries": 0, "size": 0, "last_use": 0.0})
        row["entries"] += 1
        row["size"] += entry.size
        row["last_use"] = max(row["last_use"], entry.last_use)
    stages = dict(sorted(stages.items(), key=lambda item: -item[1]["size"]))
    total = sum(entry.size for entry in listed)
    if json:
        answer = {"folder": str(store.folder), "max_size": store.max_size, "size": total}
        counts = {"entries": len(listed), "damaged": len(damaged)}
        print_json({**answer, **counts, "stages": stages})
        return 0
    rows = []
    for name, row in stages.items():
        age = f"{duration(now - row['last_use'])} ago"
        rows.append((name, str(row["entries"]), decimal(row["size"]), age))
    if rows:
        print_table(("stage", "entries", "size", "last use"), rows, right=(1, 2))
    limit = "no limit" if store.max_size is None else f"limit {decimal(store.max_size)}"
    say(f"{store.folder}: {len(listed)} results, {decimal(total)}, {limit}")
    return 0


@app.command()
def gc(
    max_size: options.option(
        str | None,
        "Keep at most this size, for example 10GB (default: the configured limit).",
        "SIZE",
    ) = None,
    older_than: options.option(
        str | None, "Also remove results not used for this time, for example 30d.", "AGE"
    ) = None,
    dry_run: options.flag("--dry-run", "Print what would be removed; remove nothing.") = False,
    json: options.Json = False,
) -> int:
    """Remove least recently used results.

    It also removes what killed processes left over an hour ago. Results that a running process
    uses are kept.

    Example: stixel cache gc --max-size 10GB --older-than 30d
    """
    from stixel_cli.engine.entries import collect
    from stixel_cli.engine.parameters import parse_age, parse_size

    store = local_store()
    with located("--max-size"):
        size = store.max_size if max_size is None else parse_size(max_size)
    with located("--older-than"):
        age = None if older_than is None else parse_age(older_than)
    done = collect(store, size, age, dry_run)
    _print_collection(store, done, "would be removed" if dry_run else "removed", json)
    return 0


@app.command()
def clear(
    yes: options.flag("--yes", "Do not ask for confirmation.") = False, json: options.Json = False
) -> int:
    """Remove all results that no running process uses.

    It asks for confirmation. Without a terminal, --yes is required.
    """
    from rich.filesize import decimal

    from stixel_cli.engine.entries import collect, entry_folders

    store = local_store()
    if not yes:
        if not (sys.stdin.isatty() and sys.stderr.isatty()):
            raise UserError("this removes all results: add --yes, there is no terminal to ask at")
        listed = entry_folders(store)
        size = decimal(sum(entry.size for entry in listed))
        question = f"remove {len(listed)} results, {size}, from {store.folder}?"
        if not typer.confirm(question, err=True):
            tell("nothing was removed")
            return 1
    _print_collection(store, collect(store, max_size=0), "removed", json)
    return 0


@app.command()
def verify(json: options.Json = False) -> int:
    """Check the digest of every result; remove damaged ones.

    Damaged results are listed and recomputed when needed. The exit code is then 1.
    """
    from stixel_cli.engine.entries import entries

    store = local_store()
    bad: list[tuple[Entry, MissingEntry]] = []
    count = len(entries(store, bad, values=True)) + len(bad)
    if json:
        answer = [vars(entry) | {"reason": fault.reason} for entry, fault in bad]
        print_json({"folder": str(store.folder), "read": count, "bad": answer})
    else:
        for entry, fault in bad:
            how = "removed" if fault.removed else "cannot be removed"
            say(f"bad: {entry.label} {entry.key[:12]}: {fault.reason}; {how}")
        are = "is" if len(bad) == 1 else "are"
        verdict = f"{len(bad)} {are} bad and recomputed when needed" if bad else "all are good"
        say(f"{store.folder}: {count} results read, {verdict}")
    return 1 if bad else 0


def _print_collection(store: "Store", done: "Collection", verb: str, json: bool) -> None:
    from rich.filesize import decimal

    if json:
        print_json({"folder": str(store.folder), **vars(done)})
        return
    used = f", {done.in_use} of them in use" if done.in_use else ""
    say(
        f"{store.folder}: {done.removed} results, {decimal(done.removed_size)}, {verb}; "
        f"{done.kept} results, {decimal(done.kept_size)}, kept{used}"
    )
    if done.left:
        left, size = counted(done.left, "item"), decimal(done.left_size)
        say(f"no results, such as files of killed processes: {left}, {size}, {verb}")
