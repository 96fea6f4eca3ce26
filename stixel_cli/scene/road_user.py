"""The target's meshes, one for each pose of its limbs: made in code, or the user's own.

The module of a class has `STANDARD`, the shape without a seed; `drawn`, which draws a shape; `mesh`
of a contrast and a shape, limbs in their first pose; and `limbs`, the parts that move, by name, of
a shape and an angle from 0 to 2 pi, or None.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from stixel_cli.randomness import generator
from stixel_cli.scene import car, cyclist, pedestrian
from stixel_cli.scene.mesh import Mesh, fitted, grounded
from stixel_cli.scene.parameters import RoadUser
from stixel_cli.scene.shapes import Surface, joined

LIMB_POSES = 32
"""Poses of the limbs in one cycle: one turn of the cranks, or two steps."""

FORWARD = {"x": 0.0, "y": 0.5 * np.pi, "-x": np.pi, "-y": -0.5 * np.pi}
FORWARD |= {"z": FORWARD["-y"], "-z": FORWARD["y"]}
"""Direction of each axis of a mesh's file, rad: where y is up, z points to the right."""

_CLASSES = {"car": car, "cyclist": cyclist, "pedestrian": pedestrian}


def road_user_meshes(road_user: RoadUser) -> tuple[Mesh, ...]:
    """The target's meshes in its own frame: x along the heading, y left, z up, m.

    One for each of the `LIMB_POSES` poses of the limbs in order, or a single one if nothing moves.
    All have the same parts and triangles; only vertices move. The origin is the centre of the
    footprint of the box around all of them, on the ground. That box is exactly `length` × `width` ×
    `height`, except for a drawn shape and for a mesh of the user's own, which keep their size.
    ValueError if the user's file cannot be read, see `load_mesh`.
    """
    if road_user.mesh is not None:
        # trimesh takes a second to import; a built-in road user never needs it.
        from stixel_cli.scene.mesh_file import load_mesh

        turn = -FORWARD[road_user.mesh_forward]
        scale, up = road_user.mesh_scale, road_user.mesh_up
        return (load_mesh(road_user.mesh, road_user.contrast, scale, turn, up),)
    return _built_in(road_user)


# Every chunk of frames asks for them.
@lru_cache(maxsize=2)
def _built_in(road_user: RoadUser) -> tuple[Mesh, ...]:
    of_class, shape = _CLASSES[road_user.kind], _shape(road_user)
    first = of_class.mesh(road_user.contrast, shape)
    meshes = [first]
    if of_class.limbs is not None:
        turns = 2.0 * np.pi * np.arange(LIMB_POSES) / LIMB_POSES
        meshes = [_posed(first, of_class.limbs(shape, turn)) for turn in turns]
    if road_user.shape_seed is not None:
        return grounded(meshes)
    return fitted(meshes, road_user.length, road_user.width, road_user.height)


def limb_poses(road_user: RoadUser, travelled: np.ndarray) -> np.ndarray:
    """Index (K,) int64 in `road_user_meshes` where the target has `travelled` (K,) m."""
    if road_user.mesh is not None or _CLASSES[road_user.kind].limbs is None:
        return np.zeros(len(travelled), dtype=np.int64)
    turns = np.asarray(travelled) / _shape(road_user).cycle_length
    return np.rint(LIMB_POSES * turns).astype(np.int64) % LIMB_POSES


def moving_parts(road_user: RoadUser) -> frozenset[str]:
    """Names of the parts of `road_user_meshes`, if these are many, that differ between poses."""
    return frozenset(_CLASSES[road_user.kind].limbs(_shape(road_user), 0.0))


def _shape(road_user: RoadUser):
    of_class = _CLASSES[road_user.kind]
    if road_user.shape_seed is None:
        return of_class.STANDARD
    return of_class.drawn(generator(road_user.shape_seed, f"shape of a {road_user.kind}"))


def _posed(mesh: Mesh, moving: dict[str, list[Surface]]) -> Mesh:
    """`mesh` with other vertices of its `moving` parts; the texture stays on its triangles."""
    return tuple(
        replace(part, vertices=joined(moving[part.name])[0]) if part.name in moving else part
        for part in mesh
    )
