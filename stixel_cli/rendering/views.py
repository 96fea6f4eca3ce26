"""One camera's view of the scene: the static scene, and over it the target and its shadow.

A pixel that neither the target nor its shadow touches has the colour of the static view, to the
bit. So the static view is kept while the camera does not move, and only a rectangle is rendered
for each frame.
"""

from dataclasses import dataclass

import numpy as np

from stixel_cli.rendering import tracing
from stixel_cli.rendering.camera_rays import Camera
from stixel_cli.rendering.edges import edge_pixels, unclear_pixels
from stixel_cli.rendering.frames import SKY_ID
from stixel_cli.rendering.raycast_parameters import RaycastParameters
from stixel_cli.rendering.supersampling import (
    Centres,
    rasterised,
    sample_offsets,
    supersampled,
)
from stixel_cli.rendering.surfaces import srgb_from_linear
from stixel_cli.rendering.tracing import Body, Hits
from stixel_cli.scene.world_parameters import Light

THIN_SAMPLES = 2
"""Samples along each axis that look for thin parts of the target between pixel centres."""

CENTRE = np.zeros(1), np.zeros(1)
"""The one sample in the middle of a pixel."""

MARGIN = 3
"""Pixels round the target's and its shadow's rectangle: samples and neighbours reach one or two."""


@dataclass(frozen=True)
class StaticView:
    """The road, the background and the sky from one camera.

    Attributes:
        hits: the surface that each pixel's centre ray hits, in row-major order.
        lit: (n,) bool, whether it sees the sun.
        plain: (n, 3) float32, linear light by one ray a pixel.
        light: (n, 3) float32, linear light with more rays where `plain` has edges.
        picture: (n, 3) uint8, sRGB of `light`.
        ids: (n,) uint8, as in `RenderedFrames.ids`.
    """

    hits: Hits
    lit: np.ndarray
    plain: np.ndarray
    light: np.ndarray
    picture: np.ndarray
    ids: np.ndarray


def static_view(
    static: Body, camera: Camera, sun: np.ndarray, renderer: RaycastParameters
) -> StaticView:
    """The view of the static scene; `sun` (3,) points to the sun in the world."""
    rows, columns = np.divmod(np.arange(camera.height * camera.width), camera.width)
    u, v = columns.astype(np.float64), rows.astype(np.float64)
    hits = tracing.nearest([static], camera, rows, columns, *CENTRE)
    lit = _sunlit_static(static, camera, u, v, hits, sun)
    plain = tracing.light_of(
        [static], camera, u, v, hits, lit, sun, renderer.light, np.ones(len(u))
    )
    centres, light = Centres(rows, columns, hits, lit, plain), plain.copy()
    if renderer.samples > 1:
        edge, at_shadow = edge_pixels([static], hits, lit, plain, camera.height)
        again = np.flatnonzero(edge)
        light[again] = supersampled(
            [static],
            camera,
            centres.at(again),
            at_shadow[again],
            sun,
            renderer.light,
            renderer.samples,
        )
    ids = np.full(len(u), SKY_ID, dtype=np.uint8)
    ids[hits.body == 0] = static.surfaces.object_ids[hits.triangle[hits.body == 0]]
    return StaticView(hits, lit, plain, light, srgb_from_linear(light), ids)


def _sunlit_static(static: Body, camera: Camera, u, v, hits: Hits, sun) -> np.ndarray:
    """(n,) bool, whether each pixel's hit sees the sun.

    Asked on every second field of a chequer-board, and between them where the neighbours disagree.
    """
    lit = np.zeros(len(u), dtype=bool)
    even = np.flatnonzero((u + v) % 2 == 0)
    lit[even] = tracing.sunlit([static], camera, u[even], v[even], hits.at(even), sun, (0,))
    odd = unclear_pixels([static], hits, lit, camera.height)
    lit[odd] = tracing.sunlit([static], camera, u[odd], v[odd], hits.at(odd), sun, (0,))
    return lit


def view_with_target(
    view: StaticView,
    static: Body,
    target: Body,
    corners_target: np.ndarray,
    camera: Camera,
    sun: np.ndarray,
    renderer: RaycastParameters,
    whole: bool = False,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`view` with the target and its shadow in it.

    Args:
        view: the static scene, from the same camera.
        static, target: the bodies.
        corners_target: (8, 3) m, corners of the target's box in its own frame.
        camera: the camera in the world.
        sun: (3,) in the world, towards the sun.
        renderer: samples and light.
        whole: render the whole image and not just the rectangle that can change (same bytes).

    Returns:
        Picture (H, W, 3) uint8 sRGB, depth (H, W) float64 m with inf for the sky, ids (H, W) uint8.
    """
    height, width = camera.height, camera.width
    bodies = [static, target]
    picture, depth, ids = view.picture.copy(), view.hits.depth.copy(), view.ids.copy()
    body_box, box = (0, height, 0, width), (0, height, 0, width)
    if not whole:
        body_box, box = _touched_rectangles(static, target, corners_target, camera, sun)
    top, bottom, left, right = box
    if top < bottom:
        pixels = (np.arange(top, bottom)[:, None] * width + np.arange(left, right)).ravel()
        rows, columns = np.divmod(pixels, width)
        near = np.flatnonzero(_inside(rows, columns, body_box))
        centres, over, changed = _centres_with_target(
            view, bodies, camera, sun, renderer.light, pixels, near
        )
        light, fresh = view.light[pixels], changed
        light[changed] = centres.light[changed]
        if renderer.samples > 1:
            shape = bottom - top, right - left
            edge, at_shadow = edge_pixels(
                bodies, centres.hits, centres.lit, centres.light, shape[0]
            )
            edge &= _grown(changed.reshape(shape)).ravel()
            edge[near] |= _thin(
                target, camera, rows[near], columns[near], view.hits.depth[pixels[near]], over[near]
            )
            again = np.flatnonzero(edge)
            fresh = changed | edge
            light[again] = supersampled(
                bodies,
                camera,
                centres.at(again),
                at_shadow[again],
                sun,
                renderer.light,
                renderer.samples,
            )
        picture[pixels[fresh]] = srgb_from_linear(light[fresh])
        depth[pixels[over]] = centres.hits.depth[over]
        ids[pixels[over]] = target.surfaces.object_ids[centres.hits.triangle[over]]
    return (
        picture.reshape(height, width, 3),
        depth.reshape(height, width),
        ids.reshape(height, width),
    )


def _centres_with_target(
    view: StaticView,
    bodies: list[Body],
    camera: Camera,
    sun: np.ndarray,
    light: Light,
    pixels: np.ndarray,
    near: np.ndarray,
) -> tuple[Centres, np.ndarray, np.ndarray]:
    """The rays through the centres of `pixels` (n,) of `view`, with the target in it.

    Args:
        view: the static scene.
        bodies: the static scene, and the target.
        camera, sun, light: as for `view_with_target`.
        pixels: (n,) indices in row-major order.
        near: (m,) indices of those `pixels` that the target itself can touch.

    Returns:
        Their values; (n,) bool, whether the target is met; (n,) bool, whether that or its
        shadow changes the static view's colour.
    """
    rows, columns = np.divmod(pixels, camera.width)
    u, v = columns.astype(np.float64), rows.astype(np.float64)
    hits, lit, plain = view.hits.at(pixels), view.lit[pixels], view.plain[pixels]
    # The target, where it is nearer than the static scene.
    found, triangle = tracing.intersect(bodies[1], camera, rows[near], columns[near], *CENTRE)
    nearer = found < hits.depth[near]
    over = np.zeros(len(pixels), dtype=bool)
    over[near] = nearer
    hits.depth[over], hits.body[over] = found[nearer], 1
    hits.triangle[over] = triangle[nearer]
    # Its shadow on sunlit pixels.
    asked = np.flatnonzero(lit & ~over)
    shadowed = asked[~tracing.sunlit(bodies, camera, u[asked], v[asked], hits.at(asked), sun, (1,))]
    lit[shadowed] = False
    covered = np.flatnonzero(over)
    lit[covered] = tracing.sunlit(
        bodies, camera, u[covered], v[covered], hits.at(covered), sun, (1, 0)
    )
    changed = over.copy()
    changed[shadowed] = True
    fresh = np.flatnonzero(changed)
    plain[fresh] = tracing.light_of(
        bodies, camera, u[fresh], v[fresh], hits.at(fresh), lit[fresh], sun, light, 1.0
    )
    return Centres(rows, columns, hits, lit, plain), over, changed


def _touched_rectangles(static: Body, target: Body, corners_target, camera: Camera, sun):
    """Rectangles of the image that the target can touch, and that it or its shadow can."""
    corners = corners_target @ target.world_from_body[:3, :3].T + target.world_from_body[:3, 3]
    floor = min(static.surfaces.corners[:, :, 2].min(), corners[:, 2].min())
    fall = (corners[:, 2] - floor) / sun[2]
    swept = np.concatenate([corners, corners - fall[:, None] * sun])
    return camera.rectangle_of(corners, MARGIN), camera.rectangle_of(swept, MARGIN)


def _grown(mask: np.ndarray) -> np.ndarray:
    """`mask` (h, w) bool and its neighbours (of four)."""
    grown = mask.copy()
    grown[1:] |= mask[:-1]
    grown[:-1] |= mask[1:]
    grown[:, 1:] |= mask[:, :-1]
    grown[:, :-1] |= mask[:, 1:]
    return grown


def _thin(target: Body, camera: Camera, rows, columns, depth, over) -> np.ndarray:
    """(n,) bool: pixels where only a part of some samples meets the target, as at a thin tube."""
    inverse, _ = rasterised([target], camera, rows, columns, *sample_offsets(THIN_SAMPLES))
    met = inverse > 1.0 / depth[:, None]
    return (met != over[:, None]).any(axis=1)


def _inside(rows: np.ndarray, columns: np.ndarray, box: tuple[int, int, int, int]) -> np.ndarray:
    """(n,) bool: whether pixels are in the rectangle `box`."""
    top, bottom, left, right = box
    return (rows >= top) & (rows < bottom) & (columns >= left) & (columns < right)
