"""What is computed once for all tests of a process, because they have more shapes than a run."""

import copy
from collections.abc import Callable
from functools import cache, lru_cache, wraps

import numpy as np
import pandas
import typer.main

from stixel_cli.cli import app
from stixel_cli.config import folders
from stixel_cli.engine import code
from stixel_cli.rendering import placement, raycast
from stixel_cli.scene import contours, road_user
from stixel_cli.tracking.contour import ray_table


def remember() -> None:
    """Called before any other module takes these functions by name."""
    contours._united = cache(contours._united.__wrapped__)
    road_user._built_in = lru_cache(maxsize=16)(road_user._built_in.__wrapped__)
    raycast._static_scene = lru_cache(maxsize=1)(_static_scene)
    # The tables of what a sensor sees of a shape, which each track of `contour` makes anew.
    ray_table.first_depths = remembered(ray_table.first_depths)
    # The files of the package, of which each graph reads and hashes a hundred.
    code._Walk._code = _of_own_package(code._Walk._code)
    folders.conf_state = _of_shipped_presets(folders.conf_state)
    # As where pyarrow, which few need, is not installed: texts of small tables take half as long.
    pandas.set_option("mode.string_storage", "python")
    # Typer makes all commands anew for each command line of a process, of which tests have many.
    app.application = cache(app.application)
    typer.main.get_command = cache(typer.main.get_command)


def _of_own_package(find: Callable[[code._Walk, tuple[str, ...]], code.Code]) -> Callable:
    """`find`, which finds the code of the package's own modules once: no test edits these files."""
    known = cache(lambda roots: find(code._Walk(()), roots))

    def found(walk: code._Walk, roots: tuple[str, ...]) -> code.Code:
        own = all(root.startswith(f"{code.OWN_PACKAGE}.") for root in roots)
        return known(roots) if own and not walk._own else find(walk, roots)

    return found


def _of_shipped_presets(state: Callable[[], str]) -> Callable[[], str]:
    """`state` of the presets, found once while there are no others than the shipped ones."""
    known, package = cache(state), folders._PACKAGE

    def found() -> str:
        shipped = package == folders._PACKAGE and folders.PRESETS.folder is None
        return known() if shipped else state()

    return found


def _static_scene(world, motion, rig, renderer) -> raycast.StaticScene:
    """One world is seen by rigs of many sizes, and to build it takes as long as to render it."""
    scene = copy.copy(_surroundings(world, motion))
    scene.rig, scene.renderer = rig, renderer
    return scene


@lru_cache(maxsize=2)
def _surroundings(world, motion) -> raycast.StaticScene:
    return raycast.StaticScene(placement.numbered_objects(world, motion), rig=None, renderer=None)


def remembered(function: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    """The function, which computes each result once; a caller may write to what it gets."""

    @cache
    def result(*arrays: tuple[bytes, tuple[int, ...], str]) -> np.ndarray:
        copies = [np.frombuffer(data, form).reshape(shape).copy() for data, shape, form in arrays]
        return function(*copies)

    @wraps(function)
    def of_arrays(*arrays: np.ndarray) -> np.ndarray:
        return result(*((one.tobytes(), one.shape, one.dtype.str) for one in arrays)).copy()

    return of_arrays
