"""The thesis's study: the figures. Their captions are in the template."""

from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.rays import first_crossings, spread_rays
from stixel_cli.report import ground, style
from stixel_cli.studies.data import StudyRun, chosen, names
from stixel_cli.studies.runs import metric_over_seeds
from stixel_cli.studies.tables import with_unit
from stixel_cli.studies.thesis.runs import MEASURES
from stixel_cli.studies.types import Figure
from stixel_cli.tracking.prior import prior_radii

if TYPE_CHECKING:
    import pandas as pd

WIDTH = 5.4
"""in."""
DRAWN_RAYS = 40
"""At most this many rays to the contour are drawn."""
CONTOURS = 6


def paths(name: str, runs: "pd.DataFrame") -> Figure:
    """Path of the target, of the ego car, and the field of view; a panel for each ego motion."""
    egos = names(runs, "ego")
    with style.drawing():
        figure = style.new_figure(WIDTH, 3.0, layout="constrained")
        for i, ego in enumerate(egos):
            run = chosen(runs, ego=ego)["run"].iloc[0]
            scenario, rig = run.load("scenario"), run.configuration.rig
            poses, cars = scenario.target_poses_world, scenario.ego_poses_world
            axes = figure.add_subplot(1, len(egos), i + 1)
            axes.set_title(ego)
            axes.set_aspect("equal")
            points = np.concatenate([poses[:, :2], cars[:, :2]])
            axes.set_xlim(points[:, 0].min() - 4.0, points[:, 0].max() + 4.0)
            axes.set_ylim(points[:, 1].min() - 1.0, points[:, 1].max() + 4.0)
            for k in sorted({0, len(cars) - 1}) if np.ptp(cars, axis=0).any() else (0,):
                ground.draw_field_of_view(axes, cars[k], rig.field_of_view)
                ground.draw_ego(axes, cars[k], 6.0)
            axes.plot(*cars[:, :2].T, color=style.EGO, linewidth=1.2)
            axes.plot(*poses[:, :2].T, color=style.TRUTH, linewidth=0.9)
            for k in np.linspace(0, len(poses) - 1, CONTOURS).round().astype(int):
                outline = scenario.contour_world(k)
                ground.draw_contour(axes, outline, style.TRUTH, linewidth=0.9)
            axes.set_xlabel("x (m)")
            axes.tick_params(labelsize=8.0)
        figure.axes[0].set_ylabel("y (m)")
        return _finished(figure, name)


def rays(name: str, run: StudyRun) -> Figure:
    """Rays of one scan to the true contour, their crossings, and the fabricated points."""
    scenario, scans = run.load("scenario"), run.load("scans")
    rig, measurement = run.configuration.rig, run.configuration.measurement
    k = len(scans) // 2
    pose, car = scenario.target_poses_world[k], scenario.ego_poses_world[k]
    outline = scenario.contour_world(k)
    spread = spread_rays(
        measurement.rays or rig.width, rig.field_of_view, measurement.spacing == "tangent"
    )
    hit, ranges = first_crossings((outline - car[:2]) @ rotation(car[2]), spread)
    bearings = car[2] + spread.angles[hit]
    crossings = car[:2] + ranges[:, None] * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    with style.drawing():
        figure = style.new_figure(0.75 * WIDTH, 3.2, layout="constrained")
        axes = figure.add_subplot()
        for crossing in crossings[:: max(1, len(crossings) // DRAWN_RAYS)]:
            axes.plot(*np.stack([car[:2], crossing]).T, color=style.FIELD_OF_VIEW, linewidth=0.4)
        ground.draw_contour(axes, outline, style.TRUTH, linewidth=1.2)
        axes.plot(*crossings.T, ".", color=style.FREE, markersize=2.5, label="nearest crossings")
        points = scans.points_world[scans.rows(k)]
        axes.plot(*points.T, ".", color=style.USED, markersize=3.0, label="with noise")
        reach = 0.7 * np.ptp(outline, axis=0).max() + 0.5
        axes.set_xlim(pose[0] - reach, pose[0] + reach)
        axes.set_ylim(pose[1] - reach, pose[1] + reach)
        axes.set_aspect("equal")
        axes.set_xlabel("x (m)")
        axes.set_ylabel("y (m)")
        figure.legend(loc="outside lower center", ncols=2)
        return _finished(figure, name)


def radial_functions(name: str, runs: "pd.DataFrame") -> Figure:
    """Radius over the angle to the heading at the last scan: estimate with band, truth, prior."""
    kernels = names(runs, "tracker")
    with style.drawing():
        figure = style.new_figure(WIDTH, 2.6, layout="constrained")
        grid = figure.subplots(1, len(kernels), sharey=True, squeeze=False)
        for axes, kernel in zip(grid[0], kernels, strict=True):
            run = chosen(runs, tracker=kernel).sort_values("seed")["run"].iloc[0]
            track, contour = run.load("track"), run.load("scenario").contour_target(-1)
            radii = np.linalg.norm(track.contours_world[-1] - track.means[-1, :2], axis=1)
            angles = np.linspace(0.0, 360.0, len(radii), endpoint=False)
            std = track.contour_std[-1]
            axes.fill_between(
                angles,
                np.maximum(radii - 2.0 * std, 0.0),
                radii + 2.0 * std,
                color=style.ESTIMATE,
                alpha=0.2,
                linewidth=0.0,
            )
            axes.plot(angles, radii, color=style.ESTIMATE, label="estimate ± 2 std")
            prior = prior_radii(run.configuration.prior, np.radians(angles))
            axes.plot(angles, prior, "--", color=style.UNUSED, linewidth=1.0, label="prior")
            closed = np.concatenate([contour, contour[:1]])
            fine = np.linspace(closed[:-1], closed[1:], 20, endpoint=False).reshape(-1, 2)
            bearing = np.degrees(np.arctan2(fine[:, 1], fine[:, 0])) % 360.0
            distance = np.hypot(*fine.T)
            axes.plot(bearing, distance, ".", color=style.TRUTH, markersize=1.5, label="truth")
            axes.set_title(kernel)
            axes.set_xlabel("θ (°)")
            axes.set_xticks(range(0, 361, 90))
            axes.set_ylim(0.0, 1.6 * distance.max())
        grid[0, 0].set_ylabel("r (m)")
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
        return _finished(figure, name)


def levels(name: str, runs: "pd.DataFrame", key: str, label: str) -> Figure:
    """The measures over a noise level, means with intervals: a column for each road user."""
    users, kernels = names(runs, "road_user"), names(runs, "tracker")
    with style.drawing():
        figure = style.new_figure(WIDTH, 0.6 + 1.5 * len(MEASURES), layout="constrained")
        grid = figure.subplots(len(MEASURES), len(users), sharex=True, squeeze=False)
        for j, user in enumerate(users):
            for i, metric in enumerate(MEASURES):
                for shade, kernel in zip(style.RUNS, kernels, strict=False):
                    own = chosen(runs, road_user=user, tracker=kernel)
                    _level(grid[i, j], own, key, metric.name, shade, kernel)
                grid[i, 0].set_ylabel(with_unit(metric), fontsize=8.0)
                grid[i, j].grid(True)
                grid[i, j].set_ylim(bottom=0.0, top=1.0 if metric.name == "iou_mean" else None)
            grid[0, j].set_title(user)
            grid[-1, j].set_xlabel(label)
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
        return _finished(figure, name)


def _level(axes, runs: "pd.DataFrame", key: str, metric: str, shade: str, label: str) -> None:
    """Means over the seeds at each level, with their intervals."""
    places = sorted(set(map(float, runs[key])))
    found = [metric_over_seeds(runs[runs[key].astype(float) == at], metric) for at in places]
    known = [(at, one) for at, one in zip(places, found, strict=True) if one.mean is not None]
    half = [0.0 if one.low is None else one.mean - one.low for _, one in known]
    axes.errorbar(
        [at for at, _ in known],
        [one.mean for _, one in known],
        yerr=half,
        color=shade,
        marker="o",
        markersize=2.5,
        linewidth=1.0,
        elinewidth=0.9,
        label=label,
    )


def _finished(figure, name: str) -> Figure:
    figure.patch.set_visible(False)
    for axes in figure.axes:
        axes.patch.set_visible(False)
    return Figure(name, "", style.svg(figure))
