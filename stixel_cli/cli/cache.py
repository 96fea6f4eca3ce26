"""`stixel cache`: what is in the cache, what may go, what is damaged."""

import sys
import time
from collections.abc import Sequence
from typing import Any

from stixel_cli.cli.errors import tell
from stixel_cli.cli.terminal import print_table
from stixel_cli.config.compose import compose
from stixel_cli.engine.cleanup import Collection, clear, collect
from stixel_cli.engine.entries import entries, entry_folders, verify_all
from stixel_cli.engine.errors import MissingEntry
from stixel_cli.engine.parameters import parse_age, parse_size, show_size
from stixel_cli.engine.store import Store, open_store
from stixel_cli.errors import UserError
from stixel_cli.experiment.run import one_line_errors
from stixel_cli.results.text import json_text


def _store() -> Store:
    return open_store(compose().configuration.cache)


def list_command(json: bool) -> int:
    """Print, by stage, how many results there are, their size and last use; the exit code."""
    store = _store()
    damaged: list[MissingEntry] = []
    with one_line_errors():
        found = entries(store, damaged.append)
    if damaged:
        tell(_damage(damaged))
    stages: dict[str, dict[str, Any]] = {}
    for entry in found:
        row = stages.setdefault(entry.stage, {"entries": 0, "size": 0, "last_use": 0.0})
        row["entries"] += 1
        row["size"] += entry.size
        row["last_use"] = max(row["last_use"], entry.last_use)
    stages = dict(sorted(stages.items(), key=lambda item: -item[1]["size"]))
    total = sum(entry.size for entry in found)
    if json:
        answer = {"folder": str(store.folder), "max_size": store.max_size, "size": total}
        counts = {"entries": len(found), "damaged": len(damaged)}
        sys.stdout.write(json_text({**answer, **counts, "stages": stages}))
        return 0
    rows = [
        (name, str(row["entries"]), show_size(row["size"]), _ago(row["last_use"]))
        for name, row in stages.items()
    ]
    if rows:
        print_table(("stage", "entries", "size", "last use"), rows, right=(1, 2))
    limit = "no limit" if store.max_size is None else f"limit {show_size(store.max_size)}"
    sys.stdout.write(f"{store.folder}: {len(found)} results, {show_size(total)}, {limit}\n")
    return 0


def collect_command(max_size: str | None, older_than: str | None, dry_run: bool, json: bool) -> int:
    """Remove what was not used for long, and what is too much; the exit code.

    Without `max_size` the limit of the configuration is kept.

    Raises:
        UserError: for a size or an age that is none, or a cache that cannot be read or written.
    """
    store = _store()
    try:
        size = store.max_size if max_size is None else parse_size(max_size)
    except ValueError as fault:
        raise UserError(f"--max-size: {fault}") from None
    try:
        age = None if older_than is None else parse_age(older_than)
    except ValueError as fault:
        raise UserError(f"--older-than: {fault}") from None
    with one_line_errors():
        done = collect(store, size, age, dry_run)
    _print_collection(store, done, "would be removed" if dry_run else "removed", json)
    return 0


def _damage(damaged: Sequence[MissingEntry]) -> str:
    count = "1 entry is" if len(damaged) == 1 else f"{len(damaged)} entries are"
    aside = " and set aside" if all(one.set_aside for one in damaged) else ""
    return f"{count} damaged or of an older version{aside}; made again when needed"


def clear_command(yes: bool, json: bool) -> int:
    """Remove all but what a running process uses; the exit code.

    On a terminal it asks before, unless `yes`.

    Raises:
        UserError: where there is neither a terminal nor `yes`, or the cache cannot be written.
    """
    store = _store()
    if not yes and not _confirmed(store):
        tell("nothing was removed")
        return 1
    with one_line_errors():
        done = clear(store)
    _print_collection(store, done, "removed", json)
    return 0


def check_command(json: bool) -> int:
    """Read every result: 0 if all are what was stored, 1 if not; bad ones are named, set aside."""
    store = _store()
    with one_line_errors():
        # `entries` would set aside, unnamed, what `verify_all` is to name.
        count = len(entry_folders(store))
        bad = verify_all(store)
    if json:
        answer = [vars(entry) | {"reason": reason} for entry, reason in bad]
        sys.stdout.write(json_text({"folder": str(store.folder), "read": count, "bad": answer}))
    else:
        for entry, reason in bad:
            sys.stdout.write(f"bad: {entry.label} {entry.key[:12]}: {reason}; set aside\n")
        are = "is" if len(bad) == 1 else "are"
        told = f"{len(bad)} {are} bad, and made again when needed" if bad else "all are good"
        sys.stdout.write(f"{store.folder}: {count} results read, {told}\n")
    return 1 if bad else 0


def _confirmed(store: Store) -> bool:
    """The answer of who sits at the terminal."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UserError("this removes all results of the cache: add --yes, there is no one to ask")
    with one_line_errors():
        found = entry_folders(store)
    size = show_size(sum(one.size for one in found))
    sys.stderr.write(f"remove {len(found)} results, {size}, from {store.folder}? [y/N] ")
    sys.stderr.flush()
    return sys.stdin.readline().strip().lower() in ("y", "yes")


def _print_collection(store: Store, done: Collection, verb: str, json: bool) -> None:
    if json:
        answer = {
            "folder": str(store.folder),
            "removed": [vars(one) for one in done.removed],
            "removed_size": done.removed_size,
            "kept": done.kept,
            "kept_size": done.kept_size,
            "in_use": done.in_use,
        }
        sys.stdout.write(json_text(answer))
        return
    by_reason: dict[str, list[int]] = {}
    for one in done.removed:
        by_reason.setdefault(one.reason, []).append(one.size)
    for reason, sizes in by_reason.items():
        sys.stdout.write(f"{reason}: {len(sizes)} {verb}, {show_size(sum(sizes))}\n")
    used = f", {done.in_use} of them in use" if done.in_use else ""
    sys.stdout.write(
        f"{store.folder}: {show_size(done.removed_size)} {verb}; "
        f"{done.kept} results, {show_size(done.kept_size)}, kept{used}\n"
    )


def _ago(moment: float) -> str:
    seconds = max(0.0, time.time() - moment)
    for unit, name in ((86400.0, "d"), (3600.0, "h"), (60.0, "min")):
        if seconds >= unit:
            return f"{seconds / unit:.0f} {name} ago"
    return "just now"
