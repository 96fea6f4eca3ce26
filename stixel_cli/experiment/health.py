"""What this machine has of what experiments need."""

import os
import platform
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from stixel_cli.engine.entries import entries, set_aside
from stixel_cli.engine.errors import CacheError, MissingEntry
from stixel_cli.engine.parameters import show_size
from stixel_cli.engine.store import Store
from stixel_cli.results.provenance import git_state, package_versions

RENDERER_TIMEOUT = 60.0
"""Seconds that a renderer is given; the first start on a machine compiles kernels."""

LEAST_FREE = 10**9
"""Bytes that must be free for the cache: some experiments of a hundred frames."""

RAYCAST_PROBE = (sys.executable, "-m", "stixel_cli.experiment.raycast_probe")


@dataclass(frozen=True)
class Check:
    """One thing that was looked at.

    Attributes:
        name: what.
        status: `fails` is what keeps the default experiment from running; `absent` is what only
            some experiments need; `limited` is there, and not all that it should be.
        text: what was found, or what is wrong, in one line.
    """

    name: str
    status: Literal["ok", "absent", "limited", "fails"]
    text: str


def examine(
    store: Store,
    raycast: Callable[[], str | None] | None = None,
    filament: Callable[[], str | None] | None = None,
) -> list[Check]:
    """Look at everything; what hangs or dies is in a child process, and timed out.

    `raycast` and `filament` tell why the renderer does not work, None if it does.
    """
    return [
        *_software(),
        *_processors(),
        _renderer("raycast", raycast or probe_raycast, "fails"),
        _renderer("filament", filament or _probe_filament, "absent"),
        *_cache(store),
    ]


def probe_raycast(
    timeout: float = RENDERER_TIMEOUT, command: tuple[str, ...] = RAYCAST_PROBE
) -> str | None:
    """Why rays cannot be cast here, in one line; None if one picture is rendered in time."""
    child = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,
    )
    try:
        _, said = child.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        return f"no picture within {timeout:g} s"
    finally:
        if child.poll() is None:
            os.killpg(child.pid, signal.SIGKILL)
            child.communicate()
    if child.returncode == 0:
        return None
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    return lines[-1] if lines else f"its process died with {child.returncode}"


def _probe_filament() -> str | None:
    from stixel_cli.rendering.filament import probe_filament

    return probe_filament(timeout=RENDERER_TIMEOUT)


def _renderer(
    name: str, probe: Callable[[], str | None], otherwise: Literal["absent", "fails"]
) -> Check:
    reason = probe()
    return Check(f"renderer {name}", "ok" if reason is None else otherwise, reason or "works")


def _software() -> list[Check]:
    versions = package_versions()
    git = git_state()
    revision = "no checkout" if git["revision"] is None else git["revision"][:12]
    changed = " with uncommitted changes" if git["dirty"] else ""
    supported = (3, 11) <= sys.version_info[:2] <= (3, 12)
    return [
        Check("stixel", "ok", f"{versions.get('stixel', 'not installed')} ({revision}{changed})"),
        Check(
            "Python",
            "ok" if supported else "fails",
            versions["python"] + ("" if supported else ": 3.11 or 3.12 is needed"),
        ),
        Check("system", "ok", f"{platform.system()} {platform.release()} {platform.machine()}"),
        *(
            Check(name, "ok", version)
            for name, version in versions.items()
            if name not in ("stixel", "python")
        ),
        _dask(),
    ]


def _dask() -> Check:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return Check("distributed", "ok", version("distributed"))
    except PackageNotFoundError:
        return Check("distributed", "absent", "executor=dask needs pip install 'stixel[dask]'")


def _processors() -> list[Check]:
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return [
        Check("cores", "ok", f"{usable} usable of {os.cpu_count()}"),
        Check("threads", "ok", "one thread per stage; the libraries' own settings are ignored"),
    ]


def _cache(store: Store) -> list[Check]:
    limit = "no limit" if store.max_size is None else f"limit {show_size(store.max_size)}"
    damaged: list[MissingEntry] = []
    try:
        found = entries(store, damaged.append)
    except CacheError as error:
        checks = [_cache_folder(store, 0), Check("cache size", "fails", str(error))]
    else:
        size = show_size(sum(entry.size for entry in found))
        checks = [
            _cache_folder(store, len(found)),
            Check("cache size", "ok", f"{size} in {len(found)} results, {limit}"),
            _cache_entries(store, len(damaged)),
        ]
    beside = next(p for p in (store.folder, *store.folder.parents) if p.exists())
    free = shutil.disk_usage(beside).free
    return [*checks, Check("disk free", "ok" if free >= LEAST_FREE else "fails", show_size(free))]


def _cache_entries(store: Store, damaged: int) -> Check:
    """How many results are known to be damaged; their values are not read, which may take long."""
    aside = set_aside(store)
    # Those that were found just now are among them, where they could be set aside.
    if not (damaged or aside):
        return Check("cache entries", "ok", "none known to be damaged")
    if not aside:
        text = f"{damaged} damaged, which cannot be set aside"
    else:
        text = f"{aside} damaged and set aside, computed again when needed"
    return Check("cache entries", "limited", f"{text}; stixel cache verify reads all")


def _cache_folder(store: Store, held: int) -> Check:
    """Whether results could be stored, beside the `held` there are; nothing is left behind."""
    beside: Path = next(p for p in (store.folder, *store.folder.parents) if p.exists())
    if beside != store.folder:
        able = beside.is_dir() and os.access(beside, os.W_OK | os.X_OK)
        text = "not there yet" if able else f"cannot be made in {beside}"
        return Check("cache folder", "ok" if able else "fails", f"{store.folder}, {text}")
    try:
        store.check_writable()
    except CacheError as error:
        if held:
            text = f"{error}; experiments that it holds can run, others cannot"
            return Check("cache folder", "limited", text)
        return Check("cache folder", "fails", str(error))
    return Check("cache folder", "ok", str(store.folder))
