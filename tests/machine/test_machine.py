"""Compiled kernels and the probe of a renderer."""

import shutil
import subprocess
import sys

from stixel_cli.config import folders
from stixel_cli.machine import kernels

SCRIPT = """
import importlib
from pathlib import Path
import stixel_cli
from stixel_cli import compose
from stixel_cli.machine.kernels import TINY, call_kernels
from stixel_cli.method import follow_road_user

folder = Path(stixel_cli.__file__).parent
kernels = {}
for path in sorted(folder.rglob("*.py")):
    if "import njit" in path.read_text("utf-8"):
        name = ".".join(path.relative_to(folder.parent).with_suffix("").parts)
        named = vars(importlib.import_module(name)).items()
        found = [(key, getattr(one, "kernel", one)) for key, one in named]
        kernels |= {f"{name}.{key}": k for key, k in found if hasattr(k, "signatures")}
assert len(kernels) > 25
call_kernels()
# A kernel that another one calls is kept inside that.
inner = {used for kernel in kernels.values() for used in kernel.py_func.__code__.co_names}
outer = {name for name in kernels if name.rpartition(".")[2] not in inner}
assert len(outer) > 15
never = [name for name in outer if not kernels[name].signatures]
assert not never, never

before = {name: list(kernel.signatures) for name, kernel in kernels.items()}
for options in ((), ("road=estimated", "occupancy=column_disparity", "ego=straight")):
    follow_road_user(compose([*TINY, *options]).configuration, seed=1)
other = [name for name, kernel in kernels.items() if kernel.signatures != before[name]]
assert not other, other
"""


def test_setup_compiles_every_kernel_for_the_types_that_a_run_calls_it_with():
    result = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


def test_the_probe_casts_rays_even_if_another_renderer_is_the_default(tmp_path, monkeypatch):
    conf = shutil.copytree(folders.shipped_folder("conf"), tmp_path / "conf")
    chosen = (conf / "config.yaml").read_text(encoding="utf-8")
    assert "renderer: raycast" in chosen
    (conf / "config.yaml").write_text(chosen.replace("renderer: raycast", "renderer: filament"))
    monkeypatch.setattr(folders, "shipped_folder", tmp_path.joinpath)
    kernels.render_tiny_picture()
