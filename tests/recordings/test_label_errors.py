"""Disparity errors of labelled cars, and the rig's error in them."""

import json
from dataclasses import replace

import numpy as np
import pytest
from made_clip import make_clip, small_rig, small_scenario

from stixel_cli.calibration.label_errors import (
    LabelErrors,
    column_rays,
    face_depths,
    fit_label_errors,
)
from stixel_cli.cli.app import main
from stixel_cli.geometry.pose import rectangle

RIG = small_rig()


def errors_at(columns, errors, tracks):
    n = len(columns)
    return LabelErrors(
        frames=np.arange(n),
        tracks=np.array(tracks),
        columns=np.array(columns, dtype=float),
        depths=np.full(n, 20.0),
        errors=np.array(errors, dtype=float),
        stds=np.full(n, 0.1),
    )


def test_the_face_of_a_car_ahead_is_its_rear():
    # Frame of the rays: x ahead, y to the left; the rear is 10 m ahead, the column of u0 sees it.
    contour = rectangle(4.0, 1.8) + np.array([12.0, 0.0])
    depths = face_depths(contour, column_rays(RIG), RIG)
    seen = np.flatnonzero(np.isfinite(depths))
    assert depths[seen] == pytest.approx(10.0)
    half = 0.9 * RIG.focal / 10.0
    assert seen[0] == np.ceil(RIG.u0 - half) and seen[-1] == np.floor(RIG.u0 + half)


def test_the_face_of_a_car_at_the_left_is_its_rear_and_its_side():
    contour = rectangle(4.0, 1.8) + np.array([12.0, 4.0])
    depths = face_depths(contour, column_rays(RIG), RIG)
    seen = np.flatnonzero(np.isfinite(depths))
    assert seen[-1] < RIG.u0
    # From left to right: the rear, then the right side up to the front.
    assert depths[seen[0]] == pytest.approx(10.0) and depths[seen[-1]] > 13.0
    assert (np.diff(depths[seen]) >= -1e-9).all()


def test_offset_and_slope_are_found_and_an_outlier_is_not():
    columns = np.linspace(10, 150, 15)
    errors = -0.4 + 0.002 * (columns - RIG.u0)
    errors[4] += 2.5
    found = fit_label_errors(errors_at(columns, errors, np.arange(15) % 3), RIG)
    assert found.offset == pytest.approx(-0.4, abs=0.03)
    assert found.slope == pytest.approx(0.002, abs=4e-4)
    assert (found.count, found.unit) == (15, "labels of 3 cars")
    assert found.median_after < 0.05 < found.median_before


def test_the_fit_includes_what_the_rig_has_already():
    columns = np.array([20.0, 80.0, 140.0])
    corrected = replace(RIG, disparity_offset=-0.3, disparity_slope=0.001)
    found = fit_label_errors(errors_at(columns, [-0.1] * 3, [0, 1, 2]), corrected)
    assert (found.offset, found.slope) == (pytest.approx(-0.4), pytest.approx(0.001))


def test_one_car_shows_no_slope():
    found = fit_label_errors(errors_at([20, 80, 140], [0.1, 0.2, 0.3], [5, 5, 5]), RIG)
    assert found.slope == 0.0 and found.offset == pytest.approx(0.2)


def test_without_labels_there_is_no_fit():
    with pytest.raises(ValueError, match="no car"):
        fit_label_errors(errors_at([], [], []), RIG)


def test_the_command_finds_the_offset_of_a_clip(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    make_clip(tmp_path / "clip", small_scenario(3))
    given = ["source=kitti_tracking", f"source.folder={tmp_path / 'clip'}", "source.sequence=0003"]
    given += ["source.target=0", "stereo.disparities=48", "stereo.nearest=6", "executor=threads"]

    def offset(*more):
        capsys.readouterr()
        assert main(["calibrate", "--json", *given, *more]) == 0
        return json.loads(capsys.readouterr().out)

    exact = offset()
    assert abs(exact["offset"]) < 0.15 and exact["slope"] == 0.0
    assert (exact["count"], exact["unit"], exact["frames"]) == (3, "labels of 1 car", "0:3")
    # A correction that is already set is included: the sum is the same.
    assert offset("rig.disparity_offset=0.25")["offset"] == pytest.approx(exact["offset"], abs=0.05)


def test_rendered_images_need_no_calibration(capsys):
    assert main(["calibrate", "seed=0"]) == 2
    assert "source: rendered is exact" in capsys.readouterr().err
