"""The default renderer: rays against the meshes on Embree, exact and repeatable to the bit."""

from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import product

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering import placement
from stixel_cli.rendering.frames import TARGET_ID, RenderedFrames
from stixel_cli.rendering.parameters import RaycastParameters
from stixel_cli.rendering.surfaces import Surfaces, build_surfaces, with_other_vertices
from stixel_cli.rendering.tracing import Body, Shot
from stixel_cli.rendering.views import StaticView, static_view, view_with_target
from stixel_cli.scene.mesh import Mesh, bounding_box
from stixel_cli.scene.open3d_import import import_open3d_bindings
from stixel_cli.scene.parameters import RoadUser, World
from stixel_cli.scene.road_user import road_user_meshes
from stixel_cli.scene.scenario import Scenario

# Half a second, here and not with the first picture: a worker that waits for the scenario imports
# this module.
import_open3d_bindings()


def render(
    scenario: Scenario,
    road_user: RoadUser,
    world: World,
    rig: Rig,
    renderer: RaycastParameters,
    frames: range,
) -> RenderedFrames:
    """Render `frames` of the scenario without noise.

    One ray goes through each pixel's centre and gives depth and identity; a rasteriser finds what
    `renderer.samples`² samples show for the colour of a pixel at an edge. While the ego car does
    not move, the static scene is rendered once; the bytes are those of a frame rendered alone.
    """
    target = Target(road_user_meshes(road_user))
    static = _static_scene(world, placement.motion_of(world, scenario), rig, renderer)
    images = (render_frame(static, target, scenario, k) for k in frames)
    return RenderedFrames.from_frames(frames.start, images)


class StaticScene:
    """The road and the background, ready for rays; keeps the views from the last ego pose.

    `objects` are (object id, Mesh in the world).
    """

    def __init__(self, objects: Iterable[tuple[int, Mesh]], rig: Rig, renderer: RaycastParameters):
        self.rig, self.renderer = rig, renderer
        self.body = Body(build_surfaces(objects), np.eye(4))
        self._pose: bytes | None = None
        self._views: list[StaticView] = []

    def views(self, ego_pose_world: np.ndarray) -> list[StaticView]:
        """Views of the left and the right camera, on the ego car at the pose (3,)."""
        if self._pose != ego_pose_world.tobytes():
            # Let go of the old views first: two pairs need not be in memory.
            self._pose, self._views = None, []
            self._views = [
                static_view(Shot((self.body,), camera), self.renderer.samples)
                for camera in placement.rig_cameras(self.rig, ego_pose_world)
            ]
            self._pose = ego_pose_world.tobytes()
        return self._views


class Target:
    """The target, ready for rays, in its own frame.

    `meshes` are those of `road_user_meshes`. `corners` (8, 3) m are those of the box around all.
    """

    def __init__(self, meshes: Sequence[Mesh]):
        self.corners = np.array(list(product(*bounding_box(*meshes).T)))
        self._meshes = meshes
        self._surfaces = {0: build_surfaces([(TARGET_ID, meshes[0])])}

    def surfaces(self, limb_pose: int) -> Surfaces:
        """The surfaces of the mesh with the index `limb_pose`, built at the first call."""
        if limb_pose not in self._surfaces:
            mesh = self._meshes[limb_pose]
            self._surfaces[limb_pose] = with_other_vertices(self._surfaces[0], mesh)
        return self._surfaces[limb_pose]


# One worker renders many chunks of one scene, and to build it takes as long as ten frames.
@lru_cache(maxsize=1)
def _static_scene(
    world: World, motion: placement.Motion, rig: Rig, renderer: RaycastParameters
) -> StaticScene:
    return StaticScene(placement.numbered_objects(world, motion), rig, renderer)


def render_frame(
    static: StaticScene, target: Target, scenario: Scenario, k: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Left and right RGB (H, W, 3) uint8, depth (H, W) m and ids (H, W) uint8 of frame `k`."""
    pose = placement.world_from_target_3d(scenario.target_poses_world[k])
    body = Body(target.surfaces(int(scenario.limb_poses[k])), pose)
    views = static.views(scenario.ego_poses_world[k])
    seen = (view_with_target(view, body, target.corners) for view in views)
    (left, depth, ids), (right, _, _) = seen
    return left, right, depth, ids
