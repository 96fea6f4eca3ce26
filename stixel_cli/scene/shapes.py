"""Closed surfaces, the parts of road users and of the background; curves and joints to shape them.

A surface is (vertices (V, 3) m, triangles (T, 3) int32, counter-clockwise seen from outside).
"""

import numpy as np
from numpy.typing import ArrayLike

from stixel_cli.scene.mesh import Part

Surface = tuple[np.ndarray, np.ndarray]


def part(name: str, surfaces: list[Surface], texture: np.ndarray, tile: float) -> Part:
    """Surfaces of one texture (h, w, 3) uint8 RGB, laid on from the six sides of a cube.

    One repetition of the texture covers `tile` m.
    """
    vertices, triangles = joined(surfaces)
    return Part(vertices, triangles, cube_uvs(vertices, triangles, tile), texture, name)


def joined(surfaces: list[Surface]) -> Surface:
    """Several surfaces as one."""
    offsets = np.cumsum([0] + [len(vertices) for vertices, _ in surfaces])
    counted = zip(surfaces, offsets, strict=False)
    triangles = np.concatenate([triangles + offset for (_, triangles), offset in counted])
    return np.concatenate([vertices for vertices, _ in surfaces]), triangles.astype(np.int32)


def cube_uvs(vertices: np.ndarray, triangles: np.ndarray, tile: float) -> np.ndarray:
    """Texture coordinates (T, 3, 2): each triangle seen along the axis that its normal is nearest.

    `vertices` (V, 3) m and `triangles` (T, 3); one repetition covers `tile` m. The texture's rows
    point down (−z) on upright faces.
    """
    points = vertices[triangles]
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    axis = np.argmax(np.abs(normals), axis=1)
    across = np.where((axis == 0)[:, None], points[:, :, 1], points[:, :, 0])
    down = np.where((axis == 2)[:, None], points[:, :, 1], -points[:, :, 2])
    return np.stack([across, down], axis=2) / tile


def outward(vertices: np.ndarray, triangles: np.ndarray) -> Surface:
    """A closed surface of `vertices` (V, 3) m, its `triangles` (T, 3) turned to face outwards."""
    points = vertices[triangles]
    volume = np.einsum("ti,ti->", points[:, 0], np.cross(points[:, 1], points[:, 2]))
    if volume < 0.0:
        triangles = triangles[:, ::-1]
    return vertices, np.ascontiguousarray(triangles, dtype=np.int32)


def box(low: ArrayLike, high: ArrayLike) -> Surface:
    """The box between the corners `low` and `high`, (3,) m."""
    low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    ring = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    rings = [np.column_stack([ring, np.full(4, z)]) for z in (0, 1)]
    vertices, triangles = loft(np.array(rings, dtype=np.float64))
    return low + vertices * (high - low), triangles


def ring_quads(stations: int, points: int) -> np.ndarray:
    """Quads (stations − 1, points, 4) between neighbouring closed rings of a loft's vertices."""
    first = points * np.arange(stations - 1)[:, None] + np.arange(points)
    following = points * np.arange(stations - 1)[:, None] + (np.arange(points) + 1) % points
    return np.stack([first, following, following + points, first + points], axis=-1)


def quads_to_triangles(quads: np.ndarray) -> np.ndarray:
    """The n quads (…, 4) of vertices as triangles (2 n, 3) int32."""
    quads = quads.reshape(-1, 4)
    return np.stack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]], 1).reshape(-1, 3).astype(np.int32)


def loft(rings: np.ndarray) -> Surface:
    """The skin over closed rings (S, N, 3) m, closed by a fan at both ends."""
    stations, points, _ = rings.shape
    vertices = np.concatenate([rings.reshape(-1, 3), rings[[0, -1]].mean(axis=1)])
    ahead = np.arange(points)
    after = (ahead + 1) % points
    last = points * (stations - 1)
    start = np.column_stack([np.full(points, last + points), after, ahead])
    end = np.column_stack([np.full(points, last + points + 1), last + ahead, last + after])
    body = quads_to_triangles(ring_quads(stations, points))
    return outward(vertices, np.concatenate([body, start, end]))


def tube(points: ArrayLike, radii: ArrayLike, sides: int = 10) -> Surface:
    """A round tube along the polyline `points` (n, 3) m, with radii (n,) or one, m.

    Its ends are rounded off, so that limbs join.
    """
    points = np.asarray(points, dtype=np.float64)
    radii = np.broadcast_to(np.asarray(radii, dtype=np.float64), (len(points),))
    segments = np.diff(points, axis=0)
    segments /= np.linalg.norm(segments, axis=1, keepdims=True)
    tangents = np.concatenate([segments[:1], segments[1:] + segments[:-1], segments[-1:]])
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    lean = np.cos(np.radians(50.0))
    before, after = 0.7 * radii[0] * tangents[:1], 0.7 * radii[-1] * tangents[-1:]
    centres = np.concatenate([points[:1] - before, points, points[-1:] + after])
    tangents = np.concatenate([tangents[:1], tangents, tangents[-1:]])
    radii = np.concatenate([lean * radii[:1], radii, lean * radii[-1:]])
    # One reference direction for all rings, so that the tube does not twist.
    least = np.argmin(np.abs(tangents).max(axis=0))
    first = np.cross(tangents, np.eye(3)[least])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(tangents, first)
    angles = 2.0 * np.pi * np.arange(sides) / sides
    rings = centres[:, None] + radii[:, None, None] * (
        np.cos(angles)[:, None] * first[:, None] + np.sin(angles)[:, None] * second[:, None]
    )
    return loft(rings)


def ellipsoid(centre: ArrayLike, radii: ArrayLike, rings: int = 8, sides: int = 14) -> Surface:
    """The ellipsoid about `centre` (3,) m with half axes `radii` (3,) m."""
    polar = np.pi * (np.arange(rings) + 0.5) / rings
    # The first and the last ring are drawn together, so that the fans close nearly flat poles.
    polar[0], polar[-1] = 0.08, np.pi - 0.08
    azimuth = 2.0 * np.pi * np.arange(sides) / sides
    across, up = np.sin(polar)[:, None], np.cos(polar)[:, None] * np.ones(sides)
    unit = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), up], axis=-1)
    return loft(np.asarray(centre) + unit * np.asarray(radii))


def lathe(profile: ArrayLike, centre: ArrayLike, sides: int = 28) -> Surface:
    """A body turned about the y axis through `centre` (3,) m.

    `profile` (n, 2) m is (y, radius), from one side to the other.
    """
    return loft(np.asarray(centre) + _turned_profile(profile, sides))


def hoop(profile: ArrayLike, centre: ArrayLike, sides: int) -> Surface:
    """A ring about the y axis through `centre` (3,) m: a lathe whose `profile` is closed."""
    rings = _turned_profile(profile, sides).swapaxes(0, 1)
    points = rings.shape[1]
    quads = ring_quads(sides + 1, points) % (sides * points)
    return outward(np.asarray(centre) + rings.reshape(-1, 3), quads_to_triangles(quads))


def _turned_profile(profile: ArrayLike, sides: int) -> np.ndarray:
    """Points (n, sides, 3) m: a circle about the y axis for each (y, radius) of `profile`."""
    y, radius = np.asarray(profile, dtype=np.float64).T[:, :, None]
    angles = 2.0 * np.pi * np.arange(sides) / sides
    across = np.broadcast_to(y, (len(y), sides))
    return np.stack([radius * np.cos(angles), across, radius * np.sin(angles)], axis=-1)


def torus(
    centre: ArrayLike, radius: float, thickness: float, sides: int = 36, around: int = 8
) -> Surface:
    """A ring in the x-z plane about `centre` (3,) m: a bicycle's tyre.

    `radius` goes to the middle of the tube, whose own radius is `thickness`, m.
    """
    turns = 2.0 * np.pi * np.arange(around) / around
    profile = np.column_stack([thickness * np.sin(turns), radius + thickness * np.cos(turns)])
    return hoop(profile, centre, sides)


def rounded_rectangle(
    low: ArrayLike, high: ArrayLike, radius: float, per_side: int, per_corner: int
) -> np.ndarray:
    """A closed ring (4 (per_side + per_corner), 2), counter-clockwise from the corner of `high`.

    `low` and `high` (2,) are opposite corners; they and `radius` have one unit. In turn: corner,
    then side; sides go −x, −y, +x, +y. Rings of equal counts match point by point at any
    size, so a loft's columns keep their meaning.
    """
    low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    x0, y0, x1, y1 = low[0] + radius, low[1] + radius, high[0] - radius, high[1] - radius
    centres = [(x1, y1), (x0, y1), (x0, y0), (x1, y0)]
    points = []
    for corner, centre in enumerate(centres):
        angles = 0.5 * np.pi * (corner + np.arange(per_corner + 1) / per_corner)
        arc = np.array(centre) + radius * np.column_stack([np.cos(angles), np.sin(angles)])
        following = 0.5 * np.pi * (corner + 1)
        out = radius * np.array([np.cos(following), np.sin(following)])
        goal = np.array(centres[(corner + 1) % 4]) + out
        steps = (np.arange(1, per_side) / per_side)[:, None]
        points += [arc, arc[-1] + steps * (goal - arc[-1])]
    return np.concatenate(points)


def knee(hip: np.ndarray, ankle: np.ndarray, thigh: float, shin: float) -> np.ndarray:
    """Where the knee is, (3,) m: in front of the line from `hip` to `ankle`, (3,) m.

    The leg bends in the upright plane through both, x forward. A leg that is too short to reach is
    straight.
    """
    line = ankle - hip
    distance = np.linalg.norm(line)
    along = 0.5 * (distance + (thigh**2 - shin**2) / distance)
    out = np.sqrt(max(thigh**2 - along**2, 0.0))
    ahead = np.array([-line[2], 0.0, line[0]]) / np.hypot(line[0], line[2])
    return hip + along / distance * line + out * ahead


def turned(points: np.ndarray, about: np.ndarray, angle: float) -> np.ndarray:
    """`points` (…, 3) turned about the y axis through `about` (3,) by `angle` rad, x towards z."""
    cosine, sine = np.cos(angle), np.sin(angle)
    matrix = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
    return about + (np.asarray(points) - about) @ matrix.T


def monotone(points: ArrayLike, at: ArrayLike) -> np.ndarray:
    """The cubics through `points` (2, n), x and y with n ≥ 3, monotone where these are, `at` any x.

    Fritsch, Butland 1984, *A method for constructing local monotone piecewise cubic interpolants*,
    with the ends of Moler 2004, *Numerical computing with MATLAB*: to the bit SciPy's
    `PchipInterpolator`, which takes 0.4 s to import in every process that makes a car.
    """
    x, y = np.array(points, dtype=np.float64)
    step = np.diff(x)
    slope = np.diff(y) / step
    # At an extreme the tangent is level, elsewhere the weighted harmonic mean.
    first, second = 2.0 * step[1:] + step[:-1], step[1:] + 2.0 * step[:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        harmonic = (first / slope[:-1] + second / slope[1:]) / (first + second)
        inner = np.where(slope[:-1] * slope[1:] > 0.0, 1.0 / harmonic, 0.0)
    ends = _end_tangent(*step[:2], *slope[:2]), _end_tangent(*step[:-3:-1], *slope[:-3:-1])
    tangent = np.concatenate([ends[:1], inner, ends[1:]])
    bend = (tangent[:-1] + tangent[1:] - 2.0 * slope) / step
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(step) - 1)
    s = at - x[i]
    low = y[i] + tangent[i] * s + ((slope[i] - tangent[i]) / step[i] - bend[i]) * (s * s)
    return low + bend[i] / step[i] * (s * s * s)


def _end_tangent(step: float, next_step: float, slope: float, next_slope: float) -> float:
    """The tangent at an end, from the two intervals nearest to it."""
    tangent = ((2.0 * step + next_step) * slope - step * next_slope) / (step + next_step)
    if np.sign(tangent) != np.sign(slope):
        return 0.0
    turns = np.sign(slope) != np.sign(next_slope) and abs(tangent) > 3.0 * abs(slope)
    return 3.0 * slope if turns else tangent
