"""Things drawn on the ground plane."""

import numpy as np
import shapely

from stixel_cli.pictures import ground, style


def band_of(contour, directions, std):
    """The area that is drawn round a contour about the origin."""
    with style.drawing():
        axes = style.new_figure(3.0, 3.0).add_axes((0.0, 0.0, 1.0, 1.0))
        ground.draw_band(axes, np.zeros(2), contour, directions, std)
        (patch,) = axes.artists or axes.patches
        parts = patch.get_path().vertices.reshape(-1, 5, 2)
    return shapely.union_all(shapely.make_valid(shapely.polygons(parts)))


def test_the_band_is_across_the_contour_and_no_mirror_spreads_it():
    angles = 2.0 * np.pi * np.arange(180) / 180
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    # A box of 4 m × 2 m; the radius has a jump of 0.2 m over three points, a mirror.
    radii = 1.0 / np.maximum(np.abs(directions[:, 0]) / 2.0, np.abs(directions[:, 1]))
    radii[60:63] += 0.2
    contour = radii[:, None] * directions
    # 0.1 m across a side, as a standard deviation along the rays.
    edges = np.roll(contour, -1, axis=0) - np.roll(contour, 1, axis=0)
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    facing = np.sum(normals * directions, axis=1) / np.linalg.norm(edges, axis=1)
    std = 0.1 / np.maximum(facing, 0.2)
    band = band_of(contour, directions, std)
    outline = shapely.Polygon(contour).exterior
    assert shapely.hausdorff_distance(band, outline) < 0.3
    assert band.covers(shapely.Point(1.0, 1.15)) and not band.covers(shapely.Point(1.0, 1.25))
    assert band.covers(shapely.Point(2.15, 0.3)) and not band.covers(shapely.Point(2.25, 0.3))


def test_a_contour_of_four_points_has_a_band():
    """Four points on to either side of one is itself: the band had no width."""
    square = np.array([[2.0, 1.0], [-2.0, 1.0], [-2.0, -1.0], [2.0, -1.0]])
    directions = square / np.hypot(*square.T)[:, None]
    band = band_of(square, directions, np.full(4, 0.3))
    assert band.covers(shapely.Point(2.1, 0.0)) and not band.covers(shapely.Point(0.0, 0.0))
