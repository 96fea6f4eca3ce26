"""The method in plain calls gives what the graph of cached stages gives."""

import inspect
from dataclasses import fields

import numpy as np

from stixel_cli import compose, method, run

SMALL = ("path.duration=1.2", "rig.width=320", "rig.height=240", "seed=5", "executor=threads")


def test_the_method_gives_the_bytes_of_the_cached_run(tmp_path, monkeypatch):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path))
    found = method.follow_road_user(compose(SMALL).configuration, seed=5)
    cached = run(SMALL)
    for ours, theirs in zip(found, (cached.scans, cached.track, cached.scores), strict=True):
        for field in fields(ours):
            a, b = getattr(ours, field.name), getattr(theirs, field.name)
            if isinstance(a, np.ndarray):
                assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes()), (
                    field.name
                )
            else:
                assert a == b, field.name


def test_the_method_fits_on_one_screen():
    lines, _ = inspect.getsourcelines(method.follow_road_user)
    assert len(lines) <= 40
