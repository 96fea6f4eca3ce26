"""Rows of the frames of RQ2, made by hand."""

import numpy as np
import pandas as pd


def run(seed=0, measurement="stixels", tracker="gp_ekf", centre=1.0, **changes):
    """A row of a frame of runs."""
    kind = measurement.partition("_")[0]
    return {
        "road_user": "car",
        "path": "turn",
        "measurement": measurement,
        "tracker": tracker,
        "measurement_kind": kind,
        "tracker_kind": tracker,
        "seed": seed,
        "centre_rmse_m": centre,
        "orientation_rmse_deg": 2.0 * centre,
        "iou_mean": 0.9 - 0.1 * centre,
        "iou_hull_mean": 0.9 - 0.1 * centre,
        "iou_box_mean": 0.9 - 0.1 * centre,
        "low_overlap_share": 0.0,
        "track_lost": 0.0,
        "nees_position_mean": 1.0,
        "nis_mean": 1.0,
    } | changes


def scans_of(seed=0, count=4, **changes):
    """The frame of the scans of one run."""
    return pd.DataFrame(
        {
            "road_user": "car",
            "path": "turn",
            "measurement": "stixels",
            "tracker": "gp_ekf",
            "seed": seed,
            "k": np.arange(count),
            "t": np.arange(count) * 0.1,
            "centre": 1.0,
            "orientation": 2.0,
            "iou": 0.5,
            "nees": 1.0,
            "nis": 1.0,
            "nis_degrees": 10,
        }
        | ({} if count != 4 else FOUR_SCANS)
        | changes
    )


FOUR_SCANS = {
    "range": [5.0, 9.0, 9.5, 50.0],
    "aspect": [0.0, 50.0, 90.0, 180.0],
    "used": [0, 1, 2, 50],
    "points": [0, 2, 2, 60],
}
