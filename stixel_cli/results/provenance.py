"""Provenance of a result: code, packages, machine."""

import os
import platform
import re
import subprocess
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
    state = _git(folder, "status", "--porcelain=v2", "--branch", "--untracked-files=no")
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


def _git(folder: Path, *arguments: str) -> str | None:
    try:
        answer = subprocess.run(
            ["git", "-C", str(folder), *arguments],
            capture_output=True,
            text=True,
            timeout=5,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.strip()
