"""Parameters of target, road and background: the groups `road_user` and `world`."""

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
        mesh: file with a mesh of your own (.glb, .gltf, .obj, .off, .ply or .stl; m) or null.
        mesh_scale: factor on the mesh's coordinates: 0.001 for a file in millimetres.
        mesh_forward: axis of the mesh's file that points forward.
        mesh_up: axis of the mesh's file that points up: y in all .glb and .gltf, and many .obj.
    """

    kind: RoadUserClass
    length: Annotated[float, Ge(0.1), Le(30)]
    width: Annotated[float, Ge(0.1), Le(10)]
    height: Annotated[float, Ge(0.1), Le(10)]
    contrast: Annotated[float, Ge(0), Le(1)]
    shape_seed: Annotated[int, Ge(0), Le(2**63 - 1)] | None
    mesh: str | None
    mesh_scale: Annotated[float, Gt(0), Le(1000)]
    mesh_forward: Literal["x", "-x", "y", "-y", "z", "-z"]
    mesh_up: Literal["z", "y"] = "z"

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
        if self.mesh_forward.endswith(self.mesh_up):
            raise ValueError(
                f"road_user.mesh_forward: must be another axis than road_user.mesh_up, "
                f"{self.mesh_up}"
            )
        given = (self.mesh_scale, self.mesh_forward, self.mesh_up)
        if self.mesh is None and given != (1.0, "x", "z"):
            raise ValueError(
                "road_user.mesh_scale, road_user.mesh_forward, road_user.mesh_up: only for a mesh "
                "of your own; give road_user.mesh=FILE, too"
            )


@parameters
class World:
    """Road and background.

    Attributes:
        kind: `street` leads off a town square, with houses, trees, poles and parked cars;
            `roadside` has such objects along the ego car's way, and leaves the way and the view of
            the target free; `fenced` is the same with fences and hedges along the way, whose ends
            and gaps a stereo camera may take for moving objects.
        seed: of the layout and its textures (not the run's seed).
        contrast: how strong the textures of road and background are, 0 (plain) … 1.
        occluder: what stands between the camera and the target and hides it for a part of the way;
            `seed` draws its place and its size.
    """

    kind: Literal["street", "roadside", "fenced"]
    seed: Annotated[int, Ge(0), Le(1_000_000)]
    contrast: Annotated[float, Ge(0), Le(1)]
    occluder: Literal["none", "parked_car", "post", "hedge"] = "none"
