import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from stixel_cli.scene.shapes import monotone

POINTS = {
    "rising": ([0.0, 1.0, 1.5, 4.0], [0.0, 0.1, 2.0, 2.1]),
    "with extremes": ([-2.0, -1.0, 0.0, 0.5, 3.0, 3.1], [1.0, 3.0, 3.0, -1.0, 0.0, 0.0]),
    "ends that are bent back": ([0.0, 1.0, 1.1, 5.0, 5.1, 9.0], [0.0, 1.0, 9.0, 8.0, 1.0, 0.9]),
    "three": ([0.0, 1.0, 3.0], [2.0, 1.0, 1.0]),
}


@pytest.mark.parametrize("name", POINTS)
def test_values_are_those_of_scipy_to_the_bit(name):
    x, y = POINTS[name]
    at = np.concatenate([np.linspace(x[0] - 0.3, x[-1] + 0.3, 997), x]).reshape(-1, 1)
    assert np.array_equal(monotone((x, y), at), PchipInterpolator(x, y)(at))
