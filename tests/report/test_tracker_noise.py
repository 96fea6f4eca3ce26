"""The R that the playback page shows for each tracker."""

from dataclasses import replace

import numpy as np
import pytest
from playback_runs import make_run

from stixel_cli.config.compose import compose
from stixel_cli.report import playback
from stixel_cli.report.playback import noise_of


@pytest.fixture
def noise():
    def of(*overrides):
        return noise_of(replace(make_run(), composition=compose(overrides)))

    return of


def test_an_isotropic_noise_is_one_number(noise):
    assert noise("tracker.measurement_std=0.4")["std"] == 400
    for kind in ("point", "box"):
        assert noise(f"tracker={kind}", "tracker.measurement_std=0.25")["std"] == 250


def test_the_scan_s_own_noise_is_not_stored_again(noise):
    found = noise("tracker.measurement_covariance=points")
    assert found["std"] is found["ellipses"] is None


def test_added_and_stretched_noise_have_own_ellipses(noise, monkeypatch):
    run = make_run()
    used = run.track.used_points[slice(*run.track.used_offsets[2:4])]
    covariances = run.scans.covariances_world[used]
    of_each = [
        noise(f"tracker={kind}", "tracker.measurement_std=0.3")["ellipses"][2]
        for kind in ("pyrecest", "rectangle")
    ]
    assert of_each[0] == of_each[1]
    added = np.reshape(of_each[0], (-1, 3))
    with monkeypatch.context() as patch:
        patch.setattr(playback, "MOST_OF_NOISE", 10)
        many = noise("tracker=pyrecest")
    assert many["ellipses"] is None and many["text"].endswith("too many points to show it")
    traces = (added[:, :2] ** 2).sum(axis=1) / 1e6
    assert traces == pytest.approx(np.trace(covariances, axis1=1, axis2=2) + 0.18, rel=0.01)
    stretched = noise("tracker=contour", "tracker.noise_factor=3.0")
    major = np.reshape(stretched["ellipses"][2], (-1, 3))[:, 0] / 1e3
    # The made scans have their noise along the ray.
    assert major == pytest.approx(3.0 * np.sqrt(np.linalg.eigvalsh(covariances)[:, 1]), rel=0.05)
