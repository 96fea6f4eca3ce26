"""Print the packages that only Open3D needs, their size, and those that a rendered run imports.

python bench/open3d_packages.py
"""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, distribution, packages_distributions
from pathlib import Path

from packaging.requirements import Requirement

OPEN3D = {"open3d", "open3d-cpu"}
HOOK = """
import os, sys
def note(event, arguments):
    if event == "import":
        with open(os.environ["IMPORTED"], "a") as file:
            file.write(arguments[0].partition(".")[0] + "\\n")
sys.addaudithook(note)
"""
RUN = ("-m", "stixel_cli", "run", "path.duration=0.3", "rig.width=160", "rig.height=120")


def plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def needed(name: str, without: Iterable[str] = ()) -> set[str]:
    """Installed distributions that `name` requires, itself included, directly or not."""
    found, ahead = set(), [name]
    while ahead:
        name = plain(ahead.pop())
        try:
            requirements = map(Requirement, distribution(name).requires or ())
        except PackageNotFoundError:
            continue
        if name not in found and name not in without:
            found.add(name)
            ahead += [
                one.name
                for one in requirements
                if one.marker is None or one.marker.evaluate({"extra": ""})
            ]
    return found


def megabytes(names: Iterable[str]) -> float:
    files = [file.locate() for name in names for file in distribution(name).files or ()]
    return sum(os.path.getsize(file) for file in files if os.path.isfile(file)) / 1e6


def imported() -> set[str]:
    """Distributions that the processes of one rendered run import, with an empty cache."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "sitecustomize.py").write_text(HOOK)
        log = Path(folder, "imported")
        paths = {"PYTHONPATH": folder, "IMPORTED": str(log), "STIXEL_CACHE": f"{folder}/cache"}
        subprocess.run([sys.executable, *RUN], cwd=folder, env=os.environ | paths, check=True)
        tops = set(log.read_text().split())
    providers = packages_distributions()
    return {plain(name) for top in tops for name in providers.get(top, ())}


def main() -> None:
    everything = needed("stixel")
    others = everything - needed("stixel", without=OPEN3D) - OPEN3D
    own = everything & OPEN3D
    print(f"all: {len(everything)} packages, {megabytes(everything):.0f} MB")
    print(f"Open3D: {megabytes(own):.0f} MB")
    print(f"only for Open3D: {len(others)} packages, {megabytes(others):.0f} MB")
    print("imported of these:", *(sorted(others & imported()) or ["none"]))


if __name__ == "__main__":
    main()
