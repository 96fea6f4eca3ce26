"""The settings in which pictures are drawn, and things on the ground plane."""

from dataclasses import replace
from threading import Event, Thread

import matplotlib
import numpy as np
import pytest
import shapely
from matplotlib import font_manager

from stixel_cli.pictures import ground, style


def test_threads_draw_one_at_a_time_and_keep_the_user_settings():
    """As the stages of pictures do with `executor=threads`."""
    drawn, inside, waiting = [], Event(), Event()

    def draw_first():
        with style.drawing({"font.size": 5.0}):
            inside.set()
            waiting.wait(timeout=600)
            drawn.append(("first", matplotlib.rcParams["font.size"]))

    def draw_second():
        inside.wait(timeout=600)
        waiting.set()
        with style.drawing({"font.size": 6.0}):
            drawn.append(("second", matplotlib.rcParams["font.size"]))

    with matplotlib.rc_context({"font.size": 20.0}):
        threads = [Thread(target=draw) for draw in (draw_first, draw_second)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert matplotlib.rcParams["font.size"] == 20.0
    assert drawn == [("first", 5.0), ("second", 6.0)]


@pytest.mark.parametrize("text", ["10 %", "$10^{0}$"])
def test_pictures_do_not_depend_on_the_fonts_of_the_system(monkeypatch, text):
    """A system may have another version of the font. Here: another font by its name."""

    def draw():
        with style.drawing():
            figure = style.new_figure(1.0, 1.0)
            figure.text(0.5, 0.5, text)
            return style.svg(figure), style.png(figure)

    before = draw()
    manager = font_manager.fontManager
    serif = next(font for font in manager.ttflist if font.name == "DejaVu Serif")
    others = [font for font in manager.ttflist if font.name != "DejaVu Sans"]
    monkeypatch.setattr(manager, "ttflist", [replace(serif, name="DejaVu Sans"), *others])
    manager._findfont_cached.cache_clear()
    try:
        assert draw() == before
    finally:
        manager._findfont_cached.cache_clear()


@pytest.mark.parametrize("values", [[0.8, 2.9], [0.04, 0.2], [0.02, 30.0], [1.2, 1.9]])
def test_a_logarithmic_axis_has_several_labels(values):
    with style.drawing():
        figure = style.new_figure(3.0, 2.0)
        axes = figure.add_subplot()
        axes.plot(values)
        axes.axhline(1.0)
        style.log_axis(axes)
        low, high = axes.get_ylim()
        shown = [place for place in axes.get_yticks() if low <= place <= high]
    assert 2 <= len(shown) <= 8


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
