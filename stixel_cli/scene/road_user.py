"""The target's mesh: made in code, or the user's own."""

from functools import partial

from stixel_cli.scene.car import car
from stixel_cli.scene.cyclist import cyclist
from stixel_cli.scene.mesh import Mesh, fitted
from stixel_cli.scene.pedestrian import pedestrian
from stixel_cli.scene.road_user_parameters import RoadUser

CAR_COLOUR = (66, 108, 160)

_MESHES = {"car": partial(car, CAR_COLOUR), "cyclist": cyclist, "pedestrian": pedestrian}
"""Class of road user to the function that makes its mesh with a contrast."""


def road_user_mesh(road_user: RoadUser) -> Mesh:
    """The target's mesh in its own frame: x along the heading, y left, z up, m.

    The origin is the centre of the footprint's bounding box, on the ground. The bounding box is
    exactly `length` × `width` × `height`, but for a mesh of the user's own, which keeps its size.

    Raises:
        ValueError: if the user's file cannot be read, see `load_mesh`.
    """
    if road_user.mesh is not None:
        # Open3D takes seconds to import; a built-in road user never needs it.
        from stixel_cli.scene.mesh_file import load_mesh

        return load_mesh(road_user.mesh, road_user.contrast)
    mesh = _MESHES[road_user.kind](road_user.contrast)
    return fitted(mesh, road_user.length, road_user.width, road_user.height)
