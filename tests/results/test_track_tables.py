"""The track of a run as the columns of its CSV file and the arrays of its NPZ file."""

from dataclasses import replace

import numpy as np
import pytest

from stixel_cli.results.tables import track_arrays, track_columns, tracks_columns
from stixel_cli.tracking.track import ObjectTrack, Track

COUNT = 3


@pytest.fixture
def track():
    return Track(
        times=np.arange(COUNT) * 0.1,
        means=np.zeros((COUNT, 6)),
        covariances=np.tile(np.eye(6), (COUNT, 1, 1)),
        contours_world=np.zeros((COUNT, 4, 2)),
        contour_std=np.zeros((COUNT, 4)),
        contour_directions=np.zeros((COUNT, 4)),
        used_points=np.zeros(0, np.int64),
        used_offsets=np.zeros(COUNT + 1, np.int64),
        nis=np.zeros(COUNT),
        nis_degrees_of_freedom=np.zeros(COUNT, np.int64),
    )


@pytest.mark.parametrize("table", [track_columns, track_arrays])
def test_both_files_have_the_probability_of_each_class(track, table):
    assert not any("probability" in name for name in table(track))
    car = np.array([0.5, 0.7, 0.9])
    found = table(replace(track, class_probabilities={"car": car, "cyclist": 1.0 - car}))
    np.testing.assert_array_equal(found["car_probability"], car)
    np.testing.assert_array_equal(found["cyclist_probability"], 1.0 - car)


@pytest.mark.parametrize("replaced", [0, 1])
def test_a_track_without_probabilities_has_none_in_the_table_of_all(track, replaced):
    car = np.array([0.5, 0.7, 0.9])
    both = [track, track]
    both[replaced] = replace(track, class_probabilities={"car": car})
    found = tracks_columns([ObjectTrack(0, 1, both[0]), ObjectTrack(5, 9, both[1])])
    np.testing.assert_array_equal(found["k"], [0, 1, 2, 5, 6, 7])
    np.testing.assert_array_equal(found["car_probability"][found["track"] == replaced], car)
    assert np.isnan(found["car_probability"][found["track"] != replaced]).all()
    np.testing.assert_array_equal(found["confirmed"], [0, 1, 1, 0, 0, 0])
