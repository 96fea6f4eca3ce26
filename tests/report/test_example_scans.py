"""Scans of a study's runs, with what the cache still has."""

from types import SimpleNamespace

import numpy as np

from stixel_cli.engine.errors import MissingEntry
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.report import example_scans


def run(**results):
    def load(stage):
        if results[stage] is None:
            raise MissingEntry(stage, "gone")
        return results[stage]

    graph = SimpleNamespace(stages=results)
    return SimpleNamespace(load=load, planned=SimpleNamespace(graph=graph))


def test_a_run_is_drawn_with_its_image_unless_the_cache_lost_them(monkeypatch):
    drawn = []
    monkeypatch.setattr(example_scans, "_scan", lambda axes, scenario, scans: drawn.append(scans))
    monkeypatch.setattr(example_scans, "_image", lambda axes, image: drawn.append(image[0, 0]))
    pairs = [StereoPairs(first, *[np.full((2, 4, 6), first, np.uint8)] * 2) for first in (0, 2, 4)]
    runs = {
        "stixels": run(scans="abcde", scenario="there", add_sensor_noise=pairs),
        "lidar": run(scans="fghij", scenario="there", add_sensor_noise=None),
        "recording": run(scans="klmno", scenario="there", pairs=pairs),
        "lost": run(scans=None, scenario="there"),
    }
    assert example_scans.scenes(runs).name == "scenes"
    # The middle scan of five has k = 2, in the second chunk.
    assert drawn == ["abcde", 2, "fghij", "klmno", 2]
    assert example_scans.scenes({"lost": runs["lost"]}) is None
