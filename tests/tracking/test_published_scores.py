"""Trackers beside their published scores, PyRecEst and reference cases."""

import dataclasses
import json
import runpy
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from real_data import real_data
from tracking_cases import CAR, GOLDEN, TRACKER, scans_of

from stixel_cli.config.compose import compose
from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import world_from_target
from stixel_cli.tracking.baselines import pyrecest as adapter
from stixel_cli.tracking.baselines.pyrecest import Name
from stixel_cli.tracking.gp_ekf import track
from stixel_cli.tracking.own import check_track
from stixel_cli.tracking.track import InitialState

ROOT = Path(__file__).parents[2]
EXAMPLE = runpy.run_path(str(ROOT / "examples" / "lidarrm_scores.py"))


def test_orders_of_points_and_later_scans(tmp_path):
    rows = "0,0,5,9\n0,0,6,9\n0,0,7,9\n1,1,5,9\n1,1,6,9\n"
    (tmp_path / "scans.csv").write_text("k,t,x,y\n" + rows)
    scans = EXAMPLE["read_scans"](str(tmp_path / "scans.csv"), None, 0.1)
    assert EXAMPLE["shuffled"](scans, 0) is scans
    other = [EXAMPLE["shuffled"](scans, order).points_world[:, 0] for order in range(1, 6)]
    assert all(sorted(x[:3]) == [5, 6, 7] and sorted(x[3:]) == [5, 6] for x in other)
    assert any(list(x[:3]) != [5, 6, 7] for x in other)
    later = EXAMPLE["without_first"](scans)
    assert len(later) == 1 and later.offsets.tolist() == [0, 2]
    np.testing.assert_array_equal(later.points_world, [[5, 9], [6, 9]])


def test_a_run_without_a_start_scores_zero(tmp_path):
    """Two points that are far apart, at every scan: no cluster of the class's size moves."""
    rows = [f"{k},{k},{x},60\n" for k in range(6) for x in (-30, 30)]
    (tmp_path / "scans.csv").write_text("k,t,x,y\n" + "".join(rows))
    poses = [f"{k},0,60,0,8,3\n" for k in range(6)]
    (tmp_path / "truth.csv").write_text("k,x,y,heading,length,width\n" + "".join(poses))
    settings = EXAMPLE["settings_of"]("lidar_random_matrix")
    values, started = EXAMPLE["ious"](tmp_path, settings, False, 0)
    assert values.tolist() == [0.0] * 6 and not started


@pytest.mark.parametrize(
    ("tracker", "tolerance"),
    # The order of the points alone changes the last one's score by .04.
    [("lidar_random_matrix", 0.01), ("li_random_matrix", 0.01), ("gm_mem_ekf", 0.05)],
)
@pytest.mark.parametrize("scans", ["default", "sparse"])
def test_a_peer_has_its_published_score(tracker, tolerance, scans):
    folder = real_data("lidarrm")
    runs = sorted(one.parent for one in folder.glob(f"{scans}-*/scans.csv"))
    runs = runs[::2]  # all take twice as long
    rows = json.loads((folder / "rows.json").read_text(encoding="utf-8"))
    name = EXAMPLE["TRACKERS"][tracker]
    published = np.concatenate([rows[run.name][name] for run in runs]).mean()
    found, _ = EXAMPLE["score"](runs, EXAMPLE["settings_of"](tracker), True, 0)
    assert found == pytest.approx(published, abs=tolerance)


CONFIGURATION = compose(["tracker=pyrecest"]).configuration
PRIOR, PARAMETERS = CONFIGURATION.prior, CONFIGURATION.tracker
RATES = np.array([1.0, 4.0, 0.0])


def few_scans_of(count=14):
    """A car that drives ahead, seen all round with little noise; scans 5 to 7 have few points."""
    random = np.random.default_rng(0)
    heading = np.arctan2(RATES[1], RATES[0])
    points = []
    for k in range(count):
        pose = np.array([2.0, 10.0, heading]) + 0.1 * k * RATES
        angles = random.uniform(0.0, 2.0 * np.pi, {5: 2, 6: 1, 7: 0}.get(k, 30))
        outline = np.stack([2.1 * np.cos(angles), 0.85 * np.sin(angles)], axis=1)
        noise = 0.05 * random.standard_normal((len(angles), 2))
        points.append(world_from_target(outline, pose) + noise)
    covariances = [np.tile(0.0025 * np.eye(2), (len(one), 1, 1)) for one in points]
    return scans_of(points, covariances), heading


def initial_of(heading):
    mean = np.array([2.2, 9.7, heading + 0.05, *RATES]) - 0.1 * np.array([*RATES, 0, 0, 0])
    return InitialState(mean, np.diag([0.3, 0.3, 0.1, 0.5, 0.5, 0.1]) ** 2)


@pytest.mark.parametrize("name", get_args(Name))
def test_each_follows_a_car_through_scans_of_few_points(name):
    pytest.importorskip("pyrecest")
    scans, heading = few_scans_of()
    parameters = dataclasses.replace(PARAMETERS, name=name, measurement_std=0.1)
    track = adapter.track(scans, initial_of(heading), PRIOR, parameters)
    check_track(track, scans, name)
    true = np.array([2.0, 10.0]) + scans.times[:, None] * RATES[:2]
    assert np.hypot(*(track.means[-5:, :2] - true[-5:]).T).max() < 0.5
    assert np.abs(np.angle(np.exp(1j * (track.means[-1, 2] - heading)))) < 0.3
    x, y = track.contours_world[-1].T
    area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    # Points of an outline are twice as far apart as those of a filled ellipse, which some assume.
    assert 0.4 < area / (np.pi * 2.1 * 0.85) < 2.2, "counter-clockwise and of the car's size"
    assert np.isfinite(track.covariances).all()
    again = adapter.track(few_scans_of(8)[0], initial_of(heading), PRIOR, parameters)
    assert again.means.tobytes() == track.means[:8].tobytes(), "and later scans change nothing"


def test_without_pyrecest_the_message_names_the_extra(monkeypatch):

    monkeypatch.setitem(sys.modules, "pyrecest", None)
    monkeypatch.setitem(sys.modules, "pyrecest.distributions", None)
    scans, heading = few_scans_of(2)
    with pytest.raises(UserError, match=r"pip install 'stixel\[peers\]'"):
        adapter.track(scans, initial_of(heading), PRIOR, PARAMETERS)


@pytest.mark.parametrize("name", ["car_turn_full", "metu_demo_square"])
def test_whole_track_matches_the_reference(name):
    """Through `track` itself: the reference starts from radii of zero, so from a point."""
    with np.load(GOLDEN / f"{name}.npz", allow_pickle=False) as arrays:
        case = {name: arrays[name] for name in arrays.files}
    alike = ("length_scale", "sigma_f", "sigma_r", "sigma_q", "sigma_q_psi")
    names = dict(zip(alike, alike, strict=True))
    names |= {"forgetting_rate": "alpha", "measurement_std": "sigma_meas"}
    values = {name: float(case[theirs]) for name, theirs in names.items()}
    values |= {"basis_points": len(case["uf"]), "gate_probability": None}
    tracker = dataclasses.replace(TRACKER, **values)
    size = {"length": 1e-12, "width": 1e-12, "corner_radius": 0.0}
    point = dataclasses.replace(CAR, shape="ellipse", sigma_r=1.0, **size)
    points = np.split(case["meas"], np.cumsum(case["meas_count"])[:-1])
    scans = scans_of(points, times=float(case["T"]) * np.arange(len(points)))
    initial = InitialState(mean=case["x0"][:6], covariance=case["P0"][:6, :6])
    result = track(scans, initial, point, tracker)
    np.testing.assert_allclose(result.means, case["expected_x"], rtol=0, atol=1e-5)
    variances = np.einsum("kii->ki", result.covariances)
    np.testing.assert_allclose(variances, case["expected_P_diag"], rtol=0, atol=1e-5)
    for k, expected in ((1, "expected_scan1_P"), (-1, "expected_P_final")):
        np.testing.assert_allclose(result.covariances[k], case[expected], rtol=0, atol=1e-5)
    np.testing.assert_array_equal(np.diff(result.used_offsets), case["meas_count"])
    np.testing.assert_array_equal(result.used_points, np.arange(len(case["meas"])))
