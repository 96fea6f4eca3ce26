import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stixel_cli.geometry.angles import wrap_angle


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(0.0, 0.0), (np.pi, np.pi), (-np.pi, np.pi), (3 * np.pi, np.pi), (1.5 * np.pi, -0.5 * np.pi)],
)
def test_known_angles(angle, wrapped):
    assert wrap_angle(angle) == pytest.approx(wrapped)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.floats(-1e3, 1e3))
def test_wrapped_angles_point_the_same_way(angle):
    wrapped = float(wrap_angle(angle))
    assert -np.pi < wrapped <= np.pi
    assert np.cos(wrapped) == pytest.approx(np.cos(angle), abs=1e-9)
    assert np.sin(wrapped) == pytest.approx(np.sin(angle), abs=1e-9)


def test_any_shape():
    assert wrap_angle(np.zeros((2, 3))).shape == (2, 3)
