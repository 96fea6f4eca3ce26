"""The thesis's study: the figures. Their captions are in the template."""

import numpy as np
import pandas as pd

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.rays import first_crossings, spread_rays
from stixel_cli.pictures import ground, style
from stixel_cli.report.blocks import Figure
from stixel_cli.report.charts import WIDTH, Panel, chart, line
from stixel_cli.report.tables import chosen, groups, mean_over, names, with_unit
from stixel_cli.results.result import RunResult
from stixel_cli.tracking.prior import prior_radii

MEASURES = ("centre_rmse_m", "orientation_rmse_deg", "iou_mean")
"""The three measures of the thesis (3.1.2)."""
DRAWN_RAYS = 40
"""At most this many rays to the contour are drawn."""
CONTOURS = 6


def paths(name: str, runs: pd.DataFrame) -> Figure:
    """Path of the target, of the ego car, and the field of view; a panel for each ego motion."""

    def panel(ego: str, run: RunResult) -> Panel:
        def draw(axes) -> None:
            scenario, rig = run.load("scenario"), run.configuration.rig
            poses, cars = scenario.target_poses_world, scenario.ego_poses_world
            axes.grid(False)
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

        return Panel(draw, title=ego, x="x (m)", y="y (m)")

    panels = [panel(ego, own["run"].iloc[0]) for (ego,), own in groups(runs, ["ego"])]
    return chart(name, panels, len(panels), 2.55)


def rays(name: str, run: RunResult) -> Figure:
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

    def draw(axes) -> None:
        axes.grid(False)
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

    return chart(name, [Panel(draw, x="x (m)", y="y (m)")], row=2.75, width=0.75 * WIDTH)


def radial_functions(name: str, runs: pd.DataFrame) -> Figure:
    """Radius over the angle to the heading at the last scan: estimate with band, truth, prior."""

    def panel(kernel: str, run: RunResult) -> Panel:
        track, contour = run.load("track"), run.load("scenario").contour_target(-1)
        radii = np.linalg.norm(track.contours_world[-1] - track.means[-1, :2], axis=1)
        angles = np.linspace(0.0, 360.0, len(radii), endpoint=False)
        ends = radii + 2.0 * np.array([[-1.0], [1.0]]) * track.contour_std[-1]
        closed = np.concatenate([contour, contour[:1]])
        fine = np.linspace(closed[:-1], closed[1:], 20, endpoint=False).reshape(-1, 2)
        bearing, distance = (
            np.degrees(np.arctan2(fine[:, 1], fine[:, 0])) % 360.0,
            np.hypot(*fine.T),
        )

        def draw(axes) -> None:
            shade = {"color": style.ESTIMATE, "alpha": 0.2, "linewidth": 0.0}
            axes.fill_between(angles, *np.maximum(ends, 0.0), **shade)
            axes.plot(angles, radii, color=style.ESTIMATE, label="estimate ± 2 std")
            prior = prior_radii(run.configuration.prior, np.radians(angles))
            axes.plot(angles, prior, "--", color=style.UNUSED, linewidth=1.0, label="prior")
            axes.plot(bearing, distance, ".", color=style.TRUTH, markersize=1.5, label="truth")
            axes.set_xticks(range(0, 361, 90))

        limits = (0.0, 1.6 * float(distance.max()))
        return Panel(draw, title=kernel, x="θ (°)", y="r (m)", limits=limits)

    panels = [
        panel(kernel, own.sort_values("seed")["run"].iloc[0])
        for (kernel,), own in groups(runs, ["tracker"])
    ]
    return chart(name, panels, len(panels), 2.15, sharey=True)


def levels(name: str, runs: pd.DataFrame, key: str, label: str) -> Figure:
    """The measures over a noise level, means with intervals: a column for each road user."""
    users = names(runs, "road_user")
    level = runs[key].astype(float)
    places = sorted(level.unique())

    def panel(i: int, metric: str, user: str) -> Panel:
        def draw(axes) -> None:
            own = chosen(runs, road_user=user)
            for shade, kernel in zip(style.RUNS, names(runs, "tracker"), strict=False):
                same = chosen(own, tracker=kernel)
                found = [mean_over(same[level[same.index] == at], metric) for at in places]
                line(axes, places, found, shade, kernel, bars=True, linewidth=1.0)

        first, last = i == 0, i == len(MEASURES) - 1
        return Panel(
            draw,
            title=user if first else "",
            x=label if last else "",
            y=with_unit(METRICS[metric]) if user == users[0] else "",
            limits=(0.0, 1.0 if metric == "iou_mean" else None),
        )

    panels = [panel(i, metric, user) for i, metric in enumerate(MEASURES) for user in users]
    return chart(name, panels, len(users), 1.5, sharex=True)
