"""The settings in which pictures are drawn."""

from dataclasses import replace
from threading import Event, Thread

import matplotlib
import pytest
from matplotlib import font_manager

from stixel_cli.pictures import style


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
