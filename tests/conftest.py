"""What every test may use: a cache of its own, away from the user's, and short runs."""

import copy
import gc
import os
from functools import cache, lru_cache

# Before NumPy is imported: with two threads for each of two test processes, BLAS mostly waits.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Else every process of a test would compile all modules anew, which takes longer than its work.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

import hypothesis
import pytest
import typer.main
from browser import browser as browser
from browser import open_page as open_page
from rendered_clip import clip as clip
from short_runs import marks_of, runs_with
from tables_of_arrays import remembered

from stixel_cli.rendering import placement, raycast
from stixel_cli.scene import contours, road_user
from stixel_cli.tracking.contour import ray_table

# What is imported and collected lives to the end: without this a tenth of the time goes to
# looking through it for garbage.
gc.set_threshold(50_000, 20, 10)

# The same examples in every run, and no fault because the machine is busy.
hypothesis.settings.register_profile("same", derandomize=True, deadline=None, max_examples=20)
hypothesis.settings.load_profile("same")

# The tests have more shapes than a run: meshes and outlines of more of them are remembered.
contours._united = cache(contours._united.__wrapped__)
road_user._built_in = lru_cache(maxsize=16)(road_user._built_in.__wrapped__)

# One world is seen by rigs of many sizes, and to build it takes as long as to render it.
_surroundings = lru_cache(maxsize=2)(
    lambda world, motion: raycast.StaticScene(
        placement.numbered_objects(world, motion), rig=None, renderer=None
    )
)


@lru_cache(maxsize=1)
def _static_scene(world, motion, rig, renderer):
    scene = copy.copy(_surroundings(world, motion))
    scene.rig, scene.renderer = rig, renderer
    return scene


raycast._static_scene = _static_scene

# So are the tables of what a sensor sees of them, which each track of `contour` makes anew.
ray_table.first_depths = remembered(ray_table.first_depths)

# Typer makes all commands anew for each command line of a process, of which the tests have many.
typer.main.get_command = cache(typer.main.get_command)


@pytest.fixture(scope="session")
def shared_cache(tmp_path_factory):
    """A cache folder for the whole session, all workers of xdist included.

    Tests of runs share what they have in common, such as a rendered scene.
    """
    session = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        session = session.parent
    return session / "cache"


@pytest.fixture(scope="session", autouse=True)
def _nothing_of_the_user(shared_cache, tmp_path_factory):
    """Neither the user's cache nor `results` of this clone, for fixtures of any scope, too."""
    with pytest.MonkeyPatch.context() as patch, runs_with():
        patch.chdir(tmp_path_factory.mktemp("work"))
        patch.setenv("STIXEL_CACHE", str(shared_cache))
        yield


@pytest.fixture(scope="module", autouse=True)
def _runs_of_module(request):
    """For the module's fixtures, too."""
    with runs_with(*marks_of(request.node)):
        yield


@pytest.fixture(autouse=True)
def _runs_of_test(request, _runs_of_module):
    with runs_with(*marks_of(request.node)):
        yield


def pytest_collection_modifyitems(items):
    """The longest tests first: at the end, the other worker would wait for them."""
    long = ("bench", "filament", "tutorials", "tune", "reruns", "result_folder", "sweep_failures")
    long += ("pyrecest", "verdict", "mlflow_folder")
    items.sort(key=lambda item: item.path.stem.removeprefix("test_") not in long)
    items.sort(key=lambda item: item.path.name != "test_bench.py")
    gc.freeze()
