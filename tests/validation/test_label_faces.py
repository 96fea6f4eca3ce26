"""Faces of labelled boxes, seen by the columns of an image."""

import numpy as np
import pytest

from stixel_cli.geometry.pose import rectangle
from stixel_cli.geometry.rig import Rig
from stixel_cli.validation.pair_errors import face_depths

RIG = Rig(160, 120, 60.0, None, None, None, 0.3, 1.2, 0.0, None)


def test_the_face_of_a_car_ahead_is_its_rear():
    # Frame of the rays: x ahead, y to the left; the rear is 10 m ahead, the column of u0 sees it.
    contour = rectangle(4.0, 1.8) + np.array([12.0, 0.0])
    depths = face_depths(contour, RIG)
    seen = np.flatnonzero(np.isfinite(depths))
    assert depths[seen] == pytest.approx(10.0)
    half = 0.9 * RIG.focal / 10.0
    assert seen[0] == np.ceil(RIG.u0 - half) and seen[-1] == np.floor(RIG.u0 + half)


def test_the_face_of_a_car_at_the_left_is_its_rear_and_its_side():
    contour = rectangle(4.0, 1.8) + np.array([12.0, 4.0])
    depths = face_depths(contour, RIG)
    seen = np.flatnonzero(np.isfinite(depths))
    assert seen[-1] < RIG.u0
    # From left to right: the rear, then the right side up to the front.
    assert depths[seen[0]] == pytest.approx(10.0) and depths[seen[-1]] > 13.0
    assert (np.diff(depths[seen]) >= -1e-9).all()
