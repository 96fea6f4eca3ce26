"""The picture of a rig's disparity error, as its own motion shows it."""

import numpy as np

from stixel_cli.geometry.rig_calibration import RigCalibration
from stixel_cli.pictures import style
from stixel_cli.results.pictures import Pictures

DEPTHS = (10.0, 20.0, 40.0)
"""m, at which the error of a depth is drawn."""


def rig_pictures(calibration: RigCalibration) -> Pictures:
    """`rig_error` as `.png` and `.svg`: the error over the columns, and the depth errors it causes.

    Without points there is no picture.
    """
    if not len(calibration.columns):
        return Pictures({})
    rig = calibration.rig
    columns = np.linspace(0, rig.width - 1, 200)
    basis = rig.disparity_error_basis(columns)
    error = basis @ rig.disparity_error
    band = np.linalg.norm(basis @ rig.disparity_error_factor, axis=1)
    with style.drawing():
        figure = style.new_figure(10.4, 3.6, layout="constrained")
        left, right = figure.subplots(1, 2)
        left.plot(calibration.columns, calibration.errors, ",", color=style.UNUSED)
        left.fill_between(columns, error - 2 * band, error + 2 * band, color=style.CONSISTENT)
        left.plot(columns, error, color=style.ESTIMATE)
        left.set_ylim(min(error.min(), 0.0) - 1.5, max(error.max(), 0.0) + 1.5)
        left.set_title("Disparity error, ± 2 standard deviations; points: static points")
        left.set_ylabel("px")
        for depth, colour in zip(DEPTHS, style.RUNS, strict=False):
            per_pixel = depth / rig.disparity_from_depth(depth)
            right.plot(columns, -per_pixel * error, color=colour, label=f"{depth:g} m")
            right.fill_between(
                columns, -2 * per_pixel * band, 2 * per_pixel * band, color=colour, alpha=0.2
            )
        right.set_title("Error of a depth: lines before, bands (± 2 std) after")
        right.set_ylabel("m")
        right.legend(loc="upper center", ncols=3)
        for axes in (left, right):
            axes.set_xlabel("column (px)")
            axes.grid(True)
        return Pictures({"rig_error.png": style.png(figure), "rig_error.svg": style.svg(figure)})
