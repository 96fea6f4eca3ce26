"""Things drawn on the ground plane: contours and their band, points, headings, field of view.

All coordinates are metres in the world frame; a pose is (x, y, heading). Patches are added as
artists, which do not affect the limits: to find their extents takes longer than to draw them.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.markers import MarkerStyle
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path
from matplotlib.typing import ColorType

from stixel_cli.geometry.pose import world_from_ego
from stixel_cli.pictures import style
from stixel_cli.pictures.uncertainty import ellipse_axes
from stixel_cli.stixels.types import Objects

BAND_REACH = 4
"""Points of a contour to both sides, at most, that give the direction of its band."""


def draw_contour(axes: Axes, contour_world: np.ndarray, colour: str, **options) -> None:
    """The outline of a polygon (M, 2) m; nothing if it is not finite."""
    if np.isfinite(contour_world).all():
        options = {"linewidth": 1.6, "zorder": 4.0, "joinstyle": "round"} | options
        look = {"fill": False, "edgecolor": colour, **options}
        axes.add_artist(Polygon(contour_world, closed=True, **look))


def draw_band(
    axes: Axes,
    centre_world: np.ndarray,
    contour_world: np.ndarray,
    directions: np.ndarray,
    std: np.ndarray,
) -> None:
    """The ring of ± 2 standard deviations across a contour (M, 2).

    `std` (M,) is along `directions` (M, 2) from the centre (2,): a normal that is askew to them has
    the smaller share of it. The ring's width and direction are those of a longer piece of the
    contour, so that a mirror does not spread it. The inner edge is not beyond the centre.
    """
    if not (np.isfinite(contour_world).all() and np.isfinite(std).all()):
        return
    radii = np.linalg.norm(contour_world - centre_world, axis=1)
    reach = 2.0 * std * np.maximum(np.sum(_normals(contour_world, 1) * directions, axis=1), 0.2)
    beside = min(BAND_REACH, (len(contour_world) - 1) // 2)
    reach = np.median([np.roll(reach, shift) for shift in range(-beside, beside + 1)], axis=0)
    across = _normals(contour_world, beside)
    inner = contour_world - np.minimum(reach, radii)[:, None] * across
    outer = contour_world + reach[:, None] * across
    # One area per edge, all of one orientation: where they overlap, nothing is left out.
    parts = [outer, np.roll(outer, -1, axis=0), np.roll(inner, -1, axis=0), inner, outer]
    quads = np.stack(parts, axis=1)
    x, y = quads[..., 0], quads[..., 1]
    turned = np.sum(x[:, :-1] * y[:, 1:] - x[:, 1:] * y[:, :-1], axis=1) < 0.0
    quads[turned] = quads[turned, ::-1]
    codes = [Path.MOVETO, *[Path.LINETO] * 3, Path.CLOSEPOLY] * len(outer)
    ring = Path(quads.reshape(-1, 2), codes)
    look = {"facecolor": style.ESTIMATE, "alpha": 0.2, "linewidth": 0, "zorder": 2.0}
    axes.add_artist(PathPatch(ring, **look))


def _normals(contour: np.ndarray, reach: int) -> np.ndarray:
    """Outward unit normals (M, 2) of a contour, over `reach` points to both sides."""
    pieces = np.roll(contour, -reach, axis=0) - np.roll(contour, reach, axis=0)
    lengths = np.maximum(np.linalg.norm(pieces, axis=1), 1e-9)
    return np.stack([pieces[:, 1], -pieces[:, 0]], axis=1) / lengths[:, None]


def draw_points(
    axes: Axes, points_world: np.ndarray, covariances_world: np.ndarray, colour: str
) -> None:
    """Points (n, 2) and their ellipses of one standard deviation, covariances (n, 2, 2) in m²."""
    if len(points_world) == 0:
        return
    # Few points are visible, many do not smear.
    alpha = min(max(20.0 / len(points_world), 0.3), 0.8)
    draw_ellipses(axes, points_world, covariances_world, 1.0, colour, alpha=alpha, linewidth=0.6)
    axes.plot(*points_world.T, ".", color=colour, markersize=3.0, zorder=3.5)


def draw_ellipses(
    axes: Axes,
    centres: np.ndarray,
    covariances: np.ndarray,
    std: float,
    colour: ColorType,
    **options,
) -> None:
    """Ellipses of `std` standard deviations round centres (n, 2), as one artist."""
    semi_axes, angles = ellipse_axes(covariances)
    ellipses = EllipseCollection(
        *(2.0 * std * semi_axes),
        np.degrees(angles),
        units="xy",
        offsets=centres,
        offset_transform=axes.transData,
        facecolors="none",
        edgecolors=colour,
        **({"zorder": 3.0} | options),
    )
    axes.add_collection(ellipses, autolim=False)


def draw_heading(axes: Axes, pose_world: np.ndarray, length: float, colour: str) -> None:
    """An arrow of `length` m from a target at `pose_world` (3,) along its heading."""
    if not np.isfinite(pose_world).all():
        return
    x, y, heading = pose_world
    tip = (x + length * np.cos(heading), y + length * np.sin(heading))
    head = "-|>,head_width=0.22,head_length=0.45"
    look = {"arrowstyle": head, "color": colour, "linewidth": 1.3, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", tip, (x, y), arrowprops=look, zorder=4.5, annotation_clip=False)
    axes.plot(x, y, "o", color=colour, markersize=3.5, zorder=4.5)


def draw_objects(axes: Axes, objects: Objects, ego_pose_world: np.ndarray, k: int) -> None:
    """The rectangles of the objects and their numbers, as in `objects.csv`."""
    for number, corners in enumerate(objects.corners_ego[objects.rows(k - objects.first)]):
        corners_world = world_from_ego(corners, ego_pose_world)
        draw_contour(axes, corners_world, style.OBJECT, linewidth=1.0)
        place = corners_world[corners_world[:, 1].argmax()]
        axes.text(*place, str(number), color=style.OBJECT, size=7, clip_on=True)


def draw_sensor(
    axes: Axes, pose_world: np.ndarray, field_of_view: tuple[float, float] | None
) -> None:
    """The ego car at `pose_world` (3,), a triangle along its heading, and what its sensor sees.

    That is a wedge between the bearings of the `field_of_view`, rad from the heading, if these are
    known. It reaches past the limits of the axes, which must be set before.
    """
    if field_of_view is not None:
        corners = np.array([(x, y) for x in axes.get_xlim() for y in axes.get_ylim()])
        reach = 1.2 * np.linalg.norm(corners - pose_world[:2], axis=1).max()
        angles = pose_world[2] + np.linspace(*field_of_view, 25)
        arc = pose_world[:2] + reach * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        wedge = np.concatenate([[pose_world[:2]], arc])
        look = {"facecolor": style.FIELD_OF_VIEW, "alpha": 0.09, "linewidth": 0, "zorder": 0}
        axes.add_artist(Polygon(wedge, **look))
        edges = np.stack([arc[0], pose_world[:2], arc[-1]])
        axes.plot(*edges.T, color=style.FIELD_OF_VIEW, linewidth=0.9, zorder=1.0)
    shape = MarkerStyle([(-0.7, -1.0), (0.7, -1.0), (0.0, 1.0)])
    turned = shape.rotated(rad=float(pose_world[2]) - 0.5 * np.pi)
    look = {"linestyle": "none", "marker": turned, "color": style.EGO, "zorder": 5}
    axes.plot(*pose_world[:2], markersize=9.0, **look)


def near(points_world: np.ndarray, reference_world: np.ndarray) -> np.ndarray:
    """The points (n, 2) m, finite and no further from the reference's box than it is large.

    Thus an estimate that has gone astray does not shrink all the rest of a picture.
    """
    low, high = reference_world.min(axis=0), reference_world.max(axis=0)
    reach = np.max(high - low)
    with np.errstate(invalid="ignore"):
        inside = (points_world >= low - reach) & (points_world <= high + reach)
    return points_world[inside.all(axis=1)]


def fit(axes: Axes, points_world: np.ndarray, margin: float) -> None:
    """Show all points (n, 2) and `margin` m round them, at one scale for both axes.

    The limits grow until they fill the box of the axes, which stays as it is.
    """
    low, high = points_world.min(axis=0) - margin, points_world.max(axis=0) + margin
    figure_width, figure_height = axes.figure.get_size_inches()
    box = axes.get_position()
    size = np.array([box.width * figure_width, box.height * figure_height])
    half = 0.5 * size * np.max((high - low) / size)
    centre = 0.5 * (low + high)
    limits = np.stack([centre - half, centre + half], axis=1)
    axes.set(xlim=limits[0], ylim=limits[1], aspect="equal")
