"""Result folders as `stixel run` writes them, small and made by hand."""

import json

import numpy as np
import yaml

from stixel_cli.rendering.images import encode_png

CONFIG = {"seed": 0, "road_user": {"kind": "car", "length": 4.5, "mesh": None}}
CONFIG |= {"path": {"kind": "turn", "speed": 6.0}}
CONFIG |= {"measurement": {"kind": "stixels", "least_height": 0.3}}
CONFIG |= {"tracker": {"kind": "gp_ekf", "basis_points": 50}}

TETRAHEDRON = "v -2 -1 0\nv 2 -1 0\nv 2 1 0\nv -2 1 0\nv 0 0 {}\nf 1 3 2\nf 1 4 3\n"
TETRAHEDRON += "f 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n"
"""A mesh whose height, m, is to be filled in."""


def make_folder(folder, seed=0, config=None, metrics=None, series=None, manifest=None):
    """Write the result folder `folder`; the other arguments replace what is plain."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    scans = 40
    centre = 0.1 + np.abs(np.cumsum(rng.normal(0, 0.03, scans)))
    arrays = {
        "k": np.arange(scans),
        "t": 0.1 * np.arange(scans),
        "centre_error": centre,
        "orientation_error": np.cumsum(rng.normal(0, 0.01, scans)),
        "iou": np.clip(0.9 - centre, 0, 1),
        "iou_box": np.clip(1.0 - centre, 0, 1),
        "nees_position": rng.chisquare(2, scans) / 2,
        "nis": np.where(np.arange(scans) == 5, np.nan, rng.chisquare(80, scans) / 80),
    } | (series or {})
    known = {name: values for name, values in arrays.items() if values is not None}
    np.savez_compressed(folder / "scores.npz", **known)
    (folder / "config.yaml").write_text(yaml.safe_dump(config or CONFIG, sort_keys=False))
    iou = None if np.isnan(arrays["iou"]).any() else float(arrays["iou"].mean())
    summary = {"centre_rmse_m": float(np.sqrt(np.mean(centre**2))), "iou_mean": iou}
    summary |= {"nees_position_mean": 1.07, "nis_mean": None, "scans": scans} | (metrics or {})
    (folder / "metrics.json").write_text(json.dumps(summary))
    content = {"command": "stixel run seed=0", "seed": seed, "seconds": 12.3, "stages": []}
    content |= {"created": "2026-01-01T00:00:00+00:00"}
    content |= {"git": {"revision": "0123456789abcdef0123", "dirty": True}}
    content |= {"versions": {"python": "3.11.7", "numpy": "2.0.0"}}
    content |= {"machine": {"system": "Linux", "processors": 2}} | (manifest or {})
    (folder / "manifest.json").write_text(json.dumps(content))
    (folder / "figures").mkdir()
    picture = encode_png(np.full((60, 80, 3), 200, np.uint8))
    (folder / "figures" / "path.png").write_bytes(picture)
    return folder
