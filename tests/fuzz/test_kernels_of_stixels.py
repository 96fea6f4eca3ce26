"""The kernels of stixels on any rig that is valid and any disparities.

NUMBA_BOUNDSCHECK=1 makes each index out of its array an error: see CONTRIBUTING.
"""

import random

import numpy as np
from harness_of_fuzz import number_of_cases

from stixel_cli import stixels_from_disparity
from stixel_cli.errors import ArgumentError

SMALL = 5

ENDS = {
    "focal_length": (10.0, 12.5, 300.0, 1e5),
    "baseline": (0.001, 0.54, 5.0),
    "camera_height": (0.1, 0.11, 1.65, 20.0),
    "pitch": (-30.0, 0.0, 4.0, 30.0),
    "disparity_error": ((-16.0,) * 3, (0.0, 0.0, 2.0), (16.0,) * 3),
}
USUAL = {"focal_length": 300.0, "baseline": 0.54, "camera_height": 1.65}
USUAL |= {"pitch": 0.0, "disparity_error": (0.0, 0.0, 0.0)}


def draw(rng):
    """A rig of the ends of its ranges, and an image of noise, a road, or one disparity."""
    rig = {name: rng.choice((USUAL[name], *values)) for name, values in ENDS.items()}
    rig |= {name: USUAL[name] for name in rng.sample(list(USUAL), rng.randrange(6))}
    height, width = rng.choice(((64, 64), (64, 97), (120, 160)))
    generator = np.random.default_rng(rng.randrange(2**32))
    rows = np.arange(height)[:, None] * np.ones(width)
    kind = rng.randrange(8)
    if kind >= 4:
        # The road of that rig, with upright faces.
        disparity = np.maximum(rows - height / 2.0, 0.0) * rig["baseline"] / rig["camera_height"]
        for _ in range(rng.choice((1, 3))):
            u, v = rng.randrange(width), rng.randrange(height)
            face = disparity[v : v + 60, u : u + 40]
            face[:] = disparity[min(v + 60, height - 1), u]
    elif kind == 0:
        disparity = generator.uniform(0.0, 40.0, (height, width))
    elif kind == 1:
        disparity = np.maximum(rng.uniform(-0.5, 1.5) * (rows - rng.uniform(0, height)), 0.0)
    elif kind == 2:
        disparity = np.full((height, width), rng.choice((0.0, 1.0 / 16.0, 20.0, 1e6)))
    else:
        disparity = np.where(generator.random((height, width)) < 0.5, np.nan, rows / 4.0)
    disparity[generator.random((height, width)) < rng.choice((0.0, 0.3))] = np.nan
    images = tuple(generator.integers(0, 256, (2, height, width), dtype=np.uint8))
    return disparity, rig, rng.choice((None, images))


def test_no_rig_leads_out_of_an_array():
    for case in range(number_of_cases(SMALL)):
        disparity, rig, images = draw(random.Random(f"kernels {case}"))
        try:
            found = stixels_from_disparity(disparity, rig, images=images).stixels
        except ArgumentError:
            continue
        assert ((found.top >= 0) & (found.top <= found.base)).all(), (case, rig)
        assert (found.base < disparity.shape[0]).all() and (found.right <= disparity.shape[1]).all()
