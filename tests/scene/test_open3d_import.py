"""In processes of their own: what is imported, and in which order, is the subject."""

import os
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES

import pytest

CAST = """
import numpy as np
def cast(library):
    scene = library.t.geometry.RaycastingScene(nthreads=1)
    points = np.random.default_rng(0).normal(size=(300, 3)).astype(np.float32)
    triangles = np.arange(300, dtype=np.uint32).reshape(-1, 3)
    scene.add_triangles(library.core.Tensor(points), library.core.Tensor(triangles))
    rays = np.random.default_rng(1).normal(size=(500, 6)).astype(np.float32)
    hits = scene.cast_rays(library.core.Tensor(rays), nthreads=1)
    return hits["t_hit"].numpy().tobytes() + hits["primitive_ids"].numpy().tobytes()
import sys
from stixel_cli.scene import open3d_import
from stixel_cli.scene.open3d_import import import_open3d, import_open3d_bindings
"""

LIGHT = "assert not {'open3d', 'sklearn', 'pandas', 'dash'} & sys.modules.keys()"
WHOLE = """
from open3d.t.geometry import RaycastingScene
assert RaycastingScene is bindings.t.geometry.RaycastingScene
assert open3d.visualization.rendering.OffscreenRenderer
import open3d.core
from open3d.ml import contrib
assert cast(open3d) == before
"""


def run(script: str, folder: str = "") -> None:
    """Run a script; modules in `folder` come before the installed ones."""
    words = [sys.executable, "-W", "ignore", "-c", CAST + script]
    environment = os.environ | {"PYTHONPATH": folder}
    result = subprocess.run(words, env=environment, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


def test_all_of_open3d_can_be_imported_after_its_bindings():
    whole = "open3d = import_open3d()\nassert open3d is sys.modules['open3d']"
    run(f"bindings = import_open3d_bindings()\nbefore = cast(bindings)\n{whole}\n{WHOLE}")


def test_where_open3d_is_imported_already_that_is_used():
    """As if it were: to execute the module takes seconds."""
    run(
        "from importlib.util import find_spec, module_from_spec\n"
        "open3d = sys.modules['open3d'] = module_from_spec(find_spec('open3d'))\n"
        "assert import_open3d_bindings() is open3d"
    )


@pytest.mark.parametrize("layout", ["no bindings", "an unknown suffix", "CUDA", "damaged bindings"])
def test_another_layout_of_the_package_gives_the_plain_import(layout, tmp_path):
    """With a small package of that name: the installed one takes seconds to import."""
    package = tmp_path / "open3d"
    suffix = EXTENSION_SUFFIXES[0]
    if layout != "no bindings":
        (package / "cpu").mkdir(parents=True)
        name = f"pybind{'.other' if layout == 'an unknown suffix' else suffix}"
        (package / "cpu" / name).write_bytes(b"no library")
    if layout == "CUDA":
        (package / "cuda").mkdir()
    package.mkdir(exist_ok=True)
    (package / "__init__.py").touch()
    same = "bindings = import_open3d_bindings()\nimport open3d\nassert bindings is open3d\n"
    run(f"{same}assert open3d.__file__.startswith({str(tmp_path)!r})", str(tmp_path))


def test_threads_that_ask_together_get_one_module_without_the_viewers_of_open3d():
    run(
        "from concurrent.futures import ThreadPoolExecutor\n"
        "with ThreadPoolExecutor(4) as pool:\n"
        "    found = list(pool.map(lambda _: import_open3d_bindings(), range(8)))\n"
        f"assert {{*map(id, found)}} == {{id(import_open3d_bindings())}}\n{LIGHT}"
    )
