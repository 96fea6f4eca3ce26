"""The settings in which pictures are drawn."""

from threading import Event, Thread

import matplotlib

from stixel_cli.report import style


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
