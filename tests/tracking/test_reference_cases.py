"""Two cases of the [GP] model that an independent program ran: agreement to 1e-5."""

import numpy as np
import pytest
from tracking_cases import GOLDEN, scans_of

from stixel_cli.tracking.gp_ekf import GpEkfParameters, track
from stixel_cli.tracking.gp_ekf_update import linearise, update
from stixel_cli.tracking.kernel import ContourProcess
from stixel_cli.tracking.motion import predict, process_noise, transition
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState


@pytest.fixture(params=["car_turn_full", "metu_demo_square"])
def case(request):
    with np.load(GOLDEN / f"{request.param}.npz", allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def process_of(case):
    return ContourProcess(
        len(case["uf"]),
        float(case["length_scale"]),
        float(case["sigma_f"]),
        float(case["sigma_r"]),
        float(case["jitter"]),
    )


def points_of(case):
    return np.split(case["meas"], np.cumsum(case["meas_count"])[:-1])


def test_basis_and_motion_match_the_reference(case):
    process = process_of(case)
    interval, alpha = float(case["T"]), float(case["alpha"])
    np.testing.assert_allclose(process.basis_angles, case["uf"], atol=1e-12)
    np.testing.assert_allclose(process.covariance, case["P0"][6:, 6:], atol=1e-12)
    np.testing.assert_allclose(transition(interval), case["F"][:6, :6])
    noise = process_noise(interval, float(case["sigma_q"]), float(case["sigma_q_psi"]))
    np.testing.assert_allclose(noise, case["Q"][:6, :6], atol=1e-15)
    _, predicted = predict(case["x0"], case["P0"], interval, noise, alpha, process)
    expected = case["F"] @ case["P0"] @ case["F"].T + case["Q"]
    np.testing.assert_allclose(predicted, expected, atol=1e-12)


def test_every_posterior_matches_the_reference(case):
    process = process_of(case)
    noise = process_noise(float(case["T"]), float(case["sigma_q"]), float(case["sigma_q_psi"]))
    measurement = float(case["sigma_meas"]) ** 2 * np.eye(2)
    mean, covariance = case["x0"], case["P0"]
    for k, points in enumerate(points_of(case)):
        mean, covariance = predict(
            mean, covariance, float(case["T"]), noise, float(case["alpha"]), process
        )
        np.testing.assert_allclose(mean, case["expected_x_predicted"][k], rtol=0, atol=1e-5)
        model = linearise(points, mean, process)
        mean, covariance, _, _ = update(mean, covariance, model, measurement, True)
        np.testing.assert_allclose(mean, case["expected_x"][k], rtol=0, atol=1e-5)
        np.testing.assert_allclose(
            np.diag(covariance), case["expected_P_diag"][k], rtol=0, atol=1e-5
        )
        if k == 1:
            np.testing.assert_allclose(covariance, case["expected_scan1_P"], rtol=0, atol=1e-5)
    np.testing.assert_allclose(covariance, case["expected_P_final"], rtol=0, atol=1e-5)


def test_measurement_model_of_the_second_scan_matches_the_reference(case):
    process, points = process_of(case), points_of(case)[1]
    mean = case["expected_x_predicted"][1]
    model = linearise(points, mean, process)
    p = model.directions
    t = np.stack([-p[:, 1], p[:, 0]], axis=-1)

    predicted = points - model.residuals[:, None] * p
    np.testing.assert_allclose(predicted.ravel(), case["expected_scan1_z_hat"], rtol=0, atol=1e-5)

    matrix = np.zeros((len(points), 2, 6 + len(case["uf"])))
    seen = np.r_[0:3, 6 : matrix.shape[-1]]
    matrix[:, :, seen] = p[:, :, None] * model.radial_matrix[:, None, :]
    matrix[:, :, :2] += (model.tangential_slopes[:, None] * t)[:, :, None] * t[:, None, :]
    np.testing.assert_allclose(
        matrix.reshape(-1, matrix.shape[-1]), case["expected_scan1_H"], rtol=0, atol=1e-5
    )

    blocks = model.radius_variances[:, None, None] * p[:, :, None] * p[:, None, :]
    blocks += float(case["sigma_meas"]) ** 2 * np.eye(2)
    expected = case["expected_scan1_R"].reshape(len(points), 2, len(points), 2)
    np.testing.assert_allclose(blocks, np.einsum("iaib->iab", expected), rtol=0, atol=1e-5)


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
    np.testing.assert_array_equal(np.diff(result.used_offsets), case["meas_count"])
    np.testing.assert_array_equal(result.used_points, np.arange(len(case["meas"])))
