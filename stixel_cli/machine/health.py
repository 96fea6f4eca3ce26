"""Check whether this machine can run experiments."""

import os
import platform
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rich.filesize import decimal

from stixel_cli.engine.entries import entries
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.store import Store
from stixel_cli.results.lineage import git_state, package_versions, shown_revision

RENDERER_TIMEOUT = 60.0
"""Time limit of a renderer, s; the first start on a machine compiles kernels."""

LEAST_FREE = 10**9
"""Free bytes that the cache needs: a few experiments of a hundred frames."""

_RENDER = "from stixel_cli.machine import kernels; kernels.render_tiny_picture()"
PROBES = {
    "raycast": (sys.executable, "-c", _RENDER),
    "filament": (sys.executable, "-m", "stixel_cli.rendering.filament_process", "--probe"),
}
"""The command of a child process that draws a picture, by renderer."""


@dataclass(frozen=True)
class Check:
    """The result of one check."""

    name: str
    """What was checked."""
    status: Literal["ok", "absent", "limited", "fails"]
    """`fails` keeps the default experiment from running; `absent` is needed by some experiments
    only; `limited` works in part."""
    text: str
    """The finding or the fault, in one line."""


def examine(
    store: Store, begins: Callable[[float, str], object] = lambda share, text: None
) -> list[Check]:
    """Run all checks; the renderers run in child processes with a time limit.

    Before each slow part `begins` is called with the share that is done and what begins.
    """
    begins(0.0, "raycast draws a picture; the first time it compiles")
    of_raycast = _renderer("raycast", "fails")
    begins(0.4, "filament draws a picture")
    of_filament = _renderer("filament", "absent")
    begins(0.8, "the cache is listed")
    return [*_software(), of_raycast, of_filament, *_cache(store)]


def _renderer(name: str, otherwise: Literal["absent", "fails"]) -> Check:
    """The check of a renderer, which draws a picture; its status is `otherwise` without one."""
    from stixel_cli.rendering import filament

    reason = filament.probe(name, RENDERER_TIMEOUT, PROBES[name])
    return Check(f"renderer {name}", "ok" if reason is None else otherwise, reason or "works")


def _software() -> list[Check]:
    from importlib.metadata import PackageNotFoundError, version

    versions = dict(package_versions())
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    found = {
        "stixel": f"{versions.pop('stixel')} ({shown_revision(git_state()) or 'no checkout'})",
        "Python": versions.pop("python"),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        **versions,
        "cores": f"{usable} usable of {os.cpu_count()}",
    }
    checks = [Check(name, "ok", text) for name, text in found.items()]
    try:
        return [*checks, Check("distributed", "ok", version("distributed"))]
    except PackageNotFoundError:
        hint = "for executor=dask: pip install 'stixel[dask]'"
        return [*checks, Check("distributed", "absent", hint)]


def _cache(store: Store) -> list[Check]:
    limit = "no limit" if store.max_size is None else f"limit {decimal(store.max_size)}"
    found = []
    try:
        found = entries(store)
        size = decimal(sum(entry.size for entry in found))
        sizes = Check("cache size", "ok", f"{size} in {len(found)} results, {limit}")
    except CacheError as error:
        sizes = Check("cache size", "fails", str(error))
    existing = next(p for p in (store.folder, *store.folder.parents) if p.exists())
    free = shutil.disk_usage(existing).free
    disk = Check("disk free", "ok" if free >= LEAST_FREE else "fails", decimal(free))
    return [_cache_folder(store, existing, bool(found)), sizes, disk]


def _cache_folder(store: Store, existing: Path, stored: bool) -> Check:
    """Whether results can be stored, beside the `stored` ones; leaves nothing behind.

    The nearest folder that is there is the `existing` one.
    """
    if existing != store.folder:
        able = existing.is_dir() and os.access(existing, os.W_OK | os.X_OK)
        text = "not created yet" if able else f"cannot be created in {existing}"
        return Check("cache folder", "ok" if able else "fails", f"{store.folder}, {text}")
    try:
        store.check_writable()
    except CacheError as error:
        if not stored:
            return Check("cache folder", "fails", str(error))
        return Check("cache folder", "limited", f"{error}; only cached experiments can run")
    return Check("cache folder", "ok", str(store.folder))
