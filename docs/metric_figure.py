"""Write `docs/figures/metrics.svg`: what the metrics measure, on one scan of a fabricated run.

python docs/metric_figure.py
"""

from pathlib import Path

import numpy as np

from stixel_cli import run
from stixel_cli.evaluation.contour_errors import even_points, in_frames, seen_points
from stixel_cli.geometry.pose import world_from_target
from stixel_cli.pictures import style

FILE = Path(__file__).parent / "figures" / "metrics.svg"
SCAN = 12
CENTRE_SCALE = 5.0
"""The ellipse of the centre is drawn so many times as large, to be seen."""


def main() -> None:
    """Draw truth, estimate with its band, ellipse of the centre, and the baseline."""
    result = run(["measurement=fabricated", "path.duration=2", "tracker=gp_ekf", "seed=3"])
    scenario, scans, track = result.scenario, result.scans, result.track
    pose, limbs = scenario.target_poses_world[SCAN], scenario.limb_poses[SCAN]
    outline = even_points(scenario.contours_target, 400)
    sensors = in_frames(scenario.ego_poses_world[:, None, :2], scenario.target_poses_world)[:, 0]
    seen = seen_points(outline, scenario.contours_target, scenario.limb_poses, sensors)[SCAN]
    truth = world_from_target(outline[limbs], pose)
    points = scans.points_world[scans.rows(SCAN)]
    estimate, centre = track.contours_world[SCAN], track.means[SCAN, :2]
    arms = estimate - centre
    outwards = arms / np.linalg.norm(arms, axis=1, keepdims=True)
    band = 1.96 * track.contour_std[SCAN][:, None] * outwards
    values, vectors = np.linalg.eigh(track.covariances[SCAN, :2, :2])
    around = np.linspace(0.0, 2.0 * np.pi, 100)
    # 5.99: 95 % of the chi-square distribution of two dimensions.
    circle = np.stack([np.cos(around), np.sin(around)]) * np.sqrt(5.99 * values)[:, None]
    ellipse = centre + CENTRE_SCALE * (vectors @ circle).T
    baseline = truth - pose[:2] + points.mean(axis=0)
    with style.drawing(style.LEGIBLE):
        figure = style.new_figure(style.NARROW, 6.4, layout="constrained")
        axes = figure.subplots()
        ring = [*range(len(estimate)), 0]
        axes.fill(
            *np.vstack([(estimate + band)[ring], (estimate - band)[ring][::-1]]).T,
            color=style.CONSISTENT,
            label="95 % band of the estimate",
        )
        for part, look, label in (
            (seen, "-", "near side"),
            (~seen, ":", "far side"),
        ):
            shown = np.where(part[:, None], truth, np.nan)
            axes.plot(*shown.T, look, color=style.TRUTH, label=f"true outline, {label}")
        axes.plot(*estimate[ring].T, color=style.ESTIMATE, label="estimate")
        axes.plot(
            *baseline[[*range(len(baseline)), 0]].T,
            "--",
            color=style.UNUSED,
            linewidth=1.0,
            label="baseline: true outline at the mean of the points",
        )
        axes.plot(*points.T, ".", color=style.USED, markersize=3.0, label="points of the scan")
        axes.plot(
            *ellipse.T,
            color=style.ESTIMATE,
            linewidth=1.0,
            linestyle="-.",
            label=f"95 % ellipse of the centre, × {CENTRE_SCALE:g}: NEES",
        )
        axes.plot(
            *np.stack([centre, pose[:2]]).T,
            "o-",
            color=style.OBSTACLE,
            markersize=3.0,
            label="error of the centre",
        )
        axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
        figure.legend(loc="outside lower left")
        FILE.write_bytes(style.svg(figure))


if __name__ == "__main__":
    main()
