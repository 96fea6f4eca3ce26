"""Two cases of the [GP] model that an independent program ran: agreement to 1e-5."""

import numpy as np
import pytest
from tracking_cases import GOLDEN, scans_of

from stixel_cli.tracking.gp_ekf import GpEkfParameters, track
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState


@pytest.fixture(params=["car_turn_full", "metu_demo_square"])
def case(request):
    with np.load(GOLDEN / f"{request.param}.npz", allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def points_of(case):
    return np.split(case["meas"], np.cumsum(case["meas_count"])[:-1])


def test_whole_track_matches_the_reference(case):
    """Through `track` itself: the reference starts from radii of zero, so from a point."""
    tracker = GpEkfParameters(
        kind="gp_ekf",
        basis_points=len(case["uf"]),
        length_scale=float(case["length_scale"]),
        sigma_f=float(case["sigma_f"]),
        sigma_r=float(case["sigma_r"]),
        mean_function="zero",
        forgetting_rate=float(case["alpha"]),
        jitter=float(case["jitter"]),
        sigma_q=float(case["sigma_q"]),
        sigma_q_psi=float(case["sigma_q_psi"]),
        slip=None,
        seen_by=None,
        measurement_covariance="isotropic",
        measurement_std=float(case["sigma_meas"]),
        gate_probability=None,
        lag=0,
    )
    point = PriorShape(
        length=1e-12,
        width=1e-12,
        shape="ellipse",
        corner_radius=0.0,
        sigma_f=1.0,
        sigma_r=1.0,
        measurement_std=0.1,
        start_position=0.3,
        road_user="car",
        length_std=0.06,
        width_std=0.06,
        outline=None,
    )
    points = points_of(case)
    scans = scans_of(points, times=float(case["T"]) * np.arange(len(points)))
    initial = InitialState(mean=case["x0"][:6], covariance=case["P0"][:6, :6])
    result = track(scans, initial, point, tracker)
    np.testing.assert_allclose(result.means, case["expected_x"], rtol=0, atol=1e-5)
    np.testing.assert_allclose(
        np.einsum("kii->ki", result.covariances), case["expected_P_diag"], rtol=0, atol=1e-5
    )
    for k, expected in ((1, "expected_scan1_P"), (-1, "expected_P_final")):
        np.testing.assert_allclose(result.covariances[k], case[expected], rtol=0, atol=1e-5)
    np.testing.assert_array_equal(np.diff(result.used_offsets), case["meas_count"])
    np.testing.assert_array_equal(result.used_points, np.arange(len(case["meas"])))
