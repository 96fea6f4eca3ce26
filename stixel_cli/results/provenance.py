"""Provenance of a result: code, also the user's, packages, machine."""

import os
import platform
import re
import subprocess
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from stixel_cli.engine.versions import installed_version

PACKAGES = (
    "stixel",
    "numpy",
    "scipy",
    "numba",
    "opencv-python-headless",
    "open3d-cpu",
    "open3d",
    "shapely",
    "matplotlib",
    "joblib",
    "hydra-core",
)

LARGEST_DIFFERENCE = 1_000_000
"""A larger difference of a repository of the user, in characters, is left out."""


def provenance() -> dict[str, Any]:
    """Entries of a manifest: revision, package versions and machine of this process."""
    return {"git": git_state(), "versions": package_versions(), "machine": machine()}


def package_versions() -> dict[str, str]:
    """Versions of Python and of the installed packages that results depend on."""
    versions = {"python": platform.python_version()}
    installed = {package: installed_version(package) for package in PACKAGES}
    return versions | {name: version for name, version in installed.items() if version is not None}


def git_state() -> dict[str, Any]:
    """Revision of this package's checkout, and whether it has uncommitted changes.

    Both are None if the package is not in a checkout or git is not installed.
    """
    folder = Path(__file__).resolve().parents[2]
    if not (folder / ".git").exists():
        return {"revision": None, "dirty": None}
    state = git(folder, "status", "--porcelain=v2", "--branch", "--untracked-files=no")
    if state is None:
        return {"revision": None, "dirty": None}
    found = re.search(r"^# branch\.oid ([0-9a-f]+)$", state, re.MULTILINE)
    changes = any(not line.startswith("#") for line in state.splitlines())
    return {"revision": found[1] if found else None, "dirty": changes}


def machine() -> dict[str, Any]:
    """System, release, architecture and number of processors of this machine."""
    return {
        "system": platform.system(),
        "release": platform.release(),
        "architecture": platform.machine(),
        "processors": os.cpu_count(),
    }


def git(folder: Path, *arguments: str) -> str | None:
    """What git prints about a folder; None if it fails or is not installed."""
    try:
        answer = subprocess.run(
            ["git", "-C", str(folder), *arguments],
            capture_output=True,
            encoding="utf-8",
            errors="surrogateescape",
            timeout=5,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.rstrip("\n")


def stored_sources(sources: Mapping[str, tuple[Path, str]]) -> dict[str, bytes]:
    """Contents to store in a result folder, by path below its folder of code.

    Args:
        sources: module -> its file, and the SHA-256 of its bytes when it was planned.
    """
    found = {}
    for module, (path, digest) in sources.items():
        content = path.read_bytes() if path.is_file() else b""
        if sha256(content).hexdigest() == digest:
            name = module.replace(".", "/") + ("/__init__" if path.stem == "__init__" else "")
            found[f"{name}.py"] = content
    folders = {path.parent for path, _ in sources.values()}
    tops = sorted({git(one, "rev-parse", "--show-toplevel") for one in folders} - {None})
    return found | {f"{Path(top).name}.diff": _difference(Path(top)) for top in tops}


def _difference(repository: Path) -> bytes:
    """The revision of a repository, and the changes of tracked files, as `git apply` reads them."""
    revision = git(repository, "rev-parse", "HEAD")
    options = ("--no-ext-diff", "--no-textconv", "--no-color", "--binary")
    changes = git(repository, "diff", *options, "HEAD") or ""
    if len(changes) > LARGEST_DIFFERENCE:
        changes = f"the changes have {len(changes)} characters and are left out"
    return f"revision {revision}\n\n{changes}\n".encode(errors="surrogateescape")
