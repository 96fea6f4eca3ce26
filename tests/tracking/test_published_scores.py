"""The peers' scores on the scans of their publication, where these are at hand."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest
from real_data import real_data

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
    values, elapsed = EXAMPLE["ious"](tmp_path, settings, False, 0)
    assert values.tolist() == [0.0] * 6 and np.isnan(elapsed)


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
    found, _, _ = EXAMPLE["score"](runs, EXAMPLE["settings_of"](tracker), True, 0)
    assert found == pytest.approx(published, abs=tolerance)
