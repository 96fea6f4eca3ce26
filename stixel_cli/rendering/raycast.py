"""The default renderer: rays against the meshes on Embree, exact and repeatable to the bit.

A pixel that neither the target nor its shadow touches has the colour of the static view, to the
bit. So the static view is kept while the camera does not move, and only a rectangle is rendered
for each frame.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import cv2
import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering import placement, supersampling, tracing
from stixel_cli.rendering.frames import SKY_ID, TARGET_ID, RenderedFrames
from stixel_cli.rendering.parameters import RaycastParameters
from stixel_cli.rendering.supersampling import Centres, supersampled
from stixel_cli.rendering.surfaces import Surfaces, build_surfaces, of_vertices, srgb_from_linear
from stixel_cli.rendering.tracing import Body, Shot
from stixel_cli.scene.mesh import Mesh, bounding_box
from stixel_cli.scene.open3d_import import import_open3d_bindings
from stixel_cli.scene.parameters import RoadUser, World
from stixel_cli.scene.road_user import road_user_meshes
from stixel_cli.scene.scenario import Scenario

# Half a second, here and not with the first picture: a worker that waits for the scenario imports
# this module.
import_open3d_bindings()

THIN_SAMPLES = 2
"""Samples along each axis that look for thin parts of the target between pixel centres."""

MARGIN = 3
"""Pixels round the target's and its shadow's rectangle: samples and neighbours reach one or two."""


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


@dataclass(frozen=True)
class StaticView:
    """The road, the background and the sky from one camera."""

    shot: Shot
    """Without the target."""
    samples: int
    """Along each axis of a pixel that shows an edge."""
    centres: Centres
    """All pixels, in row-major order, by one ray each."""
    light: np.ndarray
    """(n, 3) float32, linear light with more rays where that of `centres` has edges."""
    picture: np.ndarray
    """(n, 3) uint8, sRGB of `light`."""
    ids: np.ndarray
    """(n,) uint8, as in `RenderedFrames.ids`."""


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
            # The meshes differ in nothing but vertices.
            changed = of_vertices(self._meshes[limb_pose])
            self._surfaces[limb_pose] = replace(self._surfaces[0], **changed)
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


def static_view(shot: Shot, samples: int) -> StaticView:
    """The view of a static scene, with `samples`² in a pixel that shows an edge."""
    camera, surfaces = shot.camera, shot.bodies[0].surfaces
    rows, columns = np.divmod(np.arange(camera.height * camera.width), camera.width)
    hits = tracing.nearest(shot, columns.astype(np.float64), rows.astype(np.float64))
    # The sun is asked for on every second field of a chequer-board, and between them where the
    # neighbours disagree.
    lit = np.zeros(len(hits.u), dtype=bool)
    even = np.flatnonzero((hits.u + hits.v) % 2 == 0)
    lit[even] = tracing.sunlit(shot, hits.at(even), (0,))
    odd = np.flatnonzero(supersampling.unclear_pixels(hits, shot.tables, lit, camera.width))
    lit[odd] = tracing.sunlit(shot, hits.at(odd), (0,))
    plain = tracing.light_of(shot, hits, lit, 1.0)
    centres, light = Centres(rows, columns, hits, lit, plain), plain.copy()
    if samples > 1:
        colours = srgb_from_linear(plain)
        edge, at_shadow = supersampling.edge_pixels(hits, shot.tables, lit, colours, camera.width)
        again = np.flatnonzero(edge)
        light[again] = supersampled(shot, centres.at(again), at_shadow[again], samples)
    ids = np.full(len(lit), SKY_ID, dtype=np.uint8)
    ids[hits.body == 0] = surfaces.object_ids[hits.triangle[hits.body == 0]]
    return StaticView(shot, samples, centres, light, srgb_from_linear(light), ids)


def view_with_target(
    view: StaticView, target: Body, corners_target: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`view` with the target and its shadow in it.

    Picture (H, W, 3) uint8 sRGB, depth (H, W) float64 m with inf for the sky, ids (H, W) uint8.
    `corners_target` (8, 3) m are those of the target's box in its own frame.
    """
    shot = replace(view.shot, bodies=(*view.shot.bodies, target))
    height, width = shot.camera.height, shot.camera.width
    static_depth = view.centres.hits.depth
    picture, depth, ids = view.picture.copy(), static_depth.copy(), view.ids.copy()
    body_box, box = _touched_rectangles(shot, corners_target)
    top, bottom, left, right = box
    if top < bottom:
        pixels = (np.arange(top, bottom)[:, None] * width + np.arange(left, right)).ravel()
        inside = np.zeros((height, width), dtype=bool)
        inside[slice(*body_box[:2]), slice(*body_box[2:])] = True
        near = np.flatnonzero(inside[top:bottom, left:right])
        centres, over, changed = _centres_with_target(view, shot, pixels, near)
        light, fresh = view.light[pixels], changed
        light[changed] = centres.light[changed]
        if view.samples > 1:
            seen = centres.hits, shot.tables, centres.lit, srgb_from_linear(centres.light)
            edge, at_shadow = supersampling.edge_pixels(*seen, right - left)
            # Those that changed and their neighbours (of four).
            mask = changed.reshape(bottom - top, right - left).view(np.uint8)
            edge &= cv2.dilate(mask, cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))).ravel() > 0
            edge[near] |= _thin(shot, centres.at(near), static_depth[pixels[near]])
            again = np.flatnonzero(edge)
            fresh = changed | edge
            light[again] = supersampled(shot, centres.at(again), at_shadow[again], view.samples)
        picture[pixels[fresh]] = srgb_from_linear(light[fresh])
        depth[pixels[over]] = centres.hits.depth[over]
        ids[pixels[over]] = target.surfaces.object_ids[centres.hits.triangle[over]]
    size = height, width
    return picture.reshape(*size, 3), depth.reshape(size), ids.reshape(size)


def _centres_with_target(
    view: StaticView, shot: Shot, pixels: np.ndarray, near: np.ndarray
) -> tuple[Centres, np.ndarray, np.ndarray]:
    """The rays through the centres of `pixels` (n,) of `view`, with the target in it.

    Their values; (n,) bool, whether the target is met; (n,) bool, whether that or its shadow
    changes the static view's colour. The `shot` has the target; `pixels` (n,) are in row-major
    order, `near` (m,) the indices of those that the target itself can touch.
    """
    centres = view.centres.at(pixels)
    _, _, hits, lit, light = centres
    # The target, where it is nearer than the static scene.
    samples = hits.u[near], hits.v[near]
    target_depth, triangle = tracing.intersect(shot.bodies[1], shot.camera, *samples)
    nearer = target_depth < hits.depth[near]
    over = np.zeros(len(pixels), dtype=bool)
    over[near] = nearer
    hits.depth[over], hits.body[over] = target_depth[nearer], 1
    hits.triangle[over] = triangle[nearer]
    # Its shadow on sunlit pixels.
    asked = np.flatnonzero(lit & ~over)
    shadowed = asked[~tracing.sunlit(shot, hits.at(asked), (1,))]
    lit[shadowed] = False
    covered = np.flatnonzero(over)
    lit[covered] = tracing.sunlit(shot, hits.at(covered), (1, 0))
    changed = over.copy()
    changed[shadowed] = True
    fresh = np.flatnonzero(changed)
    light[fresh] = tracing.light_of(shot, hits.at(fresh), lit[fresh], 1.0)
    return centres, over, changed


def _touched_rectangles(shot: Shot, corners_target: np.ndarray):
    """Rectangles of the image that the target can touch, and that it or its shadow can."""
    static, target = shot.bodies
    corners = corners_target @ target.world_from_body[:3, :3].T + target.world_from_body[:3, 3]
    floor = min(static.surfaces.corners[:, :, 2].min(), corners[:, 2].min())
    fall = (corners[:, 2] - floor) / placement.SUN[2]
    swept = np.concatenate([corners, corners - fall[:, None] * placement.SUN])
    return shot.camera.rectangle_of(corners, MARGIN), shot.camera.rectangle_of(swept, MARGIN)


def _thin(shot: Shot, centres: Centres, static_depth: np.ndarray) -> np.ndarray:
    """(n,) bool: pixels where only a part of some samples meets the target, as at a thin tube."""
    alone = replace(shot, bodies=shot.bodies[1:])
    offsets = supersampling.sample_offsets(THIN_SAMPLES)
    inverse, _ = supersampling.rasterised(alone, centres.rows, centres.columns, offsets)
    met = inverse > 1.0 / static_depth[:, None]
    return (met != (centres.hits.body == 1)[:, None]).any(axis=1)
