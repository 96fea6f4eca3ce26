"""Scores of this project's stixels on pairs with true disparities: python bench/pair_scores.py.

STIXEL_DATA names the folder with kitti2012, kitti2015 and kitti2012_more. Further arguments are
overrides, as `stereo.subpixel=parabola`.
"""

import os
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from stixel_cli import compose
from stixel_cli.engine.progress import Progress
from stixel_cli.evaluation.intervals import mean_interval
from stixel_cli.experiment.assess import assess

DATA = Path(os.environ.get("STIXEL_DATA", "../shared/data")).absolute()
RIGS = {
    "kitti2012": (707.0912, 601.8873, 183.1104, 0.5379),
    "kitti2015": (721.5377, 609.5593, 172.854, 0.5327254),
}
"""Focal length and principal point, px, baseline, m: these pairs come without calibration."""

COLUMNS = {
    "stixels": ("stixels", 1, "{:.0f}"),
    "all: median, px": ("median_px", 1, "{:.2f}"),
    "beyond 1 px, %": ("beyond_1px_share", 100, "{:.1f}"),
    "square: n": ("square_compared", 1, "{:.0f}"),
    "median, px": ("square_median_px", 1, "{:.2f}"),
    "square beyond 1 px, %": ("square_beyond_1px_share", 100, "{:.1f}"),
    "outliers, %": ("outlier_share", 100, "{:.1f}"),
    "found, %": ("found_share", 100, "{:.1f}"),
    "phantoms": ("phantoms", 1, "{:.0f}"),
    "near called free": ("near_called_free", 1, "{:.0f}"),
    "of columns": ("near_columns", 1, "{:.0f}"),
}
WEIGHTS = {
    "beyond_1px_share": "stixels_compared",
    "outlier_share": "stixels_compared",
    "square_beyond_1px_share": "square_compared",
    "found_share": "obstacle_columns",
}
"""Shares and what they are of."""


def pairs(folder: Path) -> dict[str, tuple[Path, Path, Path, Path]]:
    """Left and right image, calibration and true disparities, by name; writes rigs to `folder`."""
    found = {}
    for name, (focal_length, u, v, baseline) in RIGS.items():
        rig = folder / f"{name}.yaml"
        rig.write_text(
            f"focal_length: {focal_length}\nprincipal_u: {u}\nprincipal_v: {v}\n"
            f"baseline: {baseline}\ncamera_height: 1.65\n"
        )
        files = (DATA / name / f"000000_10_{part}.png" for part in ("left", "right", "disp_occ"))
        left, right, truth = files
        found[f"{name} 000000"] = left, right, rig, truth
    more = DATA / "kitti2012_more"
    for number in ("000074", "000174"):
        left, right, truth = (
            more / part / f"{number}_10.png" for part in ("image_0", "image_1", "disp_occ")
        )
        found[f"kitti2012 {number}"] = left, right, more / "calib" / f"{number}.txt", truth
    return found


def main() -> None:
    """Print a Markdown table: a row per pair, the shares of all, and means with 95 % intervals."""
    scores = {}
    needed = ["source=pair", "road_user=car", "start.range=[1,80]", "pictures.frames=[0]"]
    with tempfile.TemporaryDirectory() as folder:
        for name, files in pairs(Path(folder)).items():
            keys = ("left", "right", "calibration", "disparity")
            named = [f"source.{key}={file}" for key, file in zip(keys, files, strict=True)]
            composition = compose([*needed, *named, *sys.argv[1:]])
            scores[name] = assess(composition, Progress()).values
    print("| pair |", " | ".join(COLUMNS), "|")
    print("|---|" + "---|" * len(COLUMNS))
    for name, values in scores.items():
        cells = [form.format(scale * values[key]) for key, scale, form in COLUMNS.values()]
        print("|", " | ".join([name, *cells]), "|")
    for key, of in WEIGHTS.items():
        counts = [values[of] for values in scores.values()]
        shares = [values[key] for values in scores.values()]
        pooled = sum(n * share for n, share in zip(counts, shares, strict=True)) / sum(counts)
        (ends,) = mean_interval(pd.DataFrame({key: shares}), (0.0, 1.0)).itertuples(index=False)
        mean, low, high = (f"{100 * one:.1f}" for one in (np.mean(shares), ends.low, ends.high))
        (name,) = (name for name, (column, _, _) in COLUMNS.items() if column == key)
        print(
            f"{name}: {100 * pooled:.1f} of {sum(counts)} in all; mean of {len(shares)} pairs "
            f"{mean}, 95 % interval {low} to {high}"
        )


if __name__ == "__main__":
    main()
