"""Parameters of the target: the group `road_user`."""

import os.path
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from stixel_cli.parameters import parameters
from stixel_cli.scene.classes import RoadUserClass


@parameters
class RoadUser:
    """The target.

    Attributes:
        kind: the class of road user.
        length: of the mesh's bounding box along the heading, m; a pedestrian's is the stride. Not
            read for a mesh of your own or a drawn shape: they keep their size.
        width: of the mesh's bounding box across the heading, m; a pedestrian's goes over shoulders
            and arms. Not read for a mesh of your own or a drawn shape.
        height: of the mesh's bounding box, m. Not read for a mesh of your own or a drawn shape.
        contrast: how strong the texture of paint and cloth is, 0 (plain) … 1; stereo fails on 0.
        shape_seed: seed that draws a body and its size within the class, or null for the standard
            shape.
        mesh: file with a mesh of your own (any format of Open3D; m, x forward, z up) or null.
        mesh_scale: factor on the mesh's coordinates: 0.001 for a file in millimetres.
        mesh_forward: axis of the mesh's file that points forward; z points up.
    """

    kind: RoadUserClass
    length: Annotated[float, Ge(0.1), Le(30)]
    width: Annotated[float, Ge(0.1), Le(10)]
    height: Annotated[float, Ge(0.1), Le(10)]
    contrast: Annotated[float, Ge(0), Le(1)]
    shape_seed: Annotated[int, Ge(0), Le(2**63 - 1)] | None
    mesh: str | None
    mesh_scale: Annotated[float, Gt(0), Le(1000)]
    mesh_forward: Literal["x", "-x", "y", "-y"]

    def check(self) -> None:
        """Raise ValueError if the shape has two sources, or a mesh is not a file or not given.

        The content of the file is checked on reading.
        """
        if self.mesh is not None and self.shape_seed is not None:
            raise ValueError(
                f"road_user.shape_seed: must be null with road_user.mesh, got {self.shape_seed}"
            )
        if self.mesh is not None and not os.path.isfile(self.mesh):
            raise ValueError(f"road_user.mesh: file not found: {self.mesh!r}")
        if self.mesh is None and (self.mesh_scale, self.mesh_forward) != (1.0, "x"):
            raise ValueError(
                "road_user.mesh_scale, road_user.mesh_forward: only for a mesh of your own; "
                "give road_user.mesh=FILE, too"
            )
