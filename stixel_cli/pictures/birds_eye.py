"""Scans from above: with the track of one target, and with those of all moving objects."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.pictures import ground, style
from stixel_cli.pictures.uncertainty import target_radius, tracker_noise
from stixel_cli.recordings.types import LabelTruth
from stixel_cli.results.pictures import Pictures
from stixel_cli.scene.scenario import Scenario
from stixel_cli.stixels.types import Objects
from stixel_cli.tracking.track import ObjectTrack, Track


def track_pictures(
    scans: Scans,
    track: Track,
    scenario: Scenario,
    field_of_view: tuple[float, float] | None,
    tracker: Any,
    frame: int,
    objects: Objects | None = None,
) -> Pictures:
    """The bird's eye view of scan `frame`: all that is seen, and the target enlarged.

    Gives `k0033/birds_eye.png`: the ego car and its field of view, the scan with ellipses of one
    standard deviation (of the noise R that the `tracker`, its parameters, uses at the points which
    it used; of that which the scan states at the others), the true contour, the
    estimated one with its band of ± 2 standard deviations of the radius, both headings. Where the
    truth is unknown, only the estimate is drawn. `field_of_view` is in rad, None if unknown. With
    `objects`, the rectangles round their points are drawn.
    """
    _, noise, _ = tracker_noise(tracker, scans)
    with style.drawing({"axes.grid": True}):
        figure = style.new_figure(10.4, 5.7)
        wide = figure.add_axes((0.055, 0.17, 0.4, 0.76))
        near = figure.add_axes((0.54, 0.17, 0.44, 0.76))
        for axes, linewidth in ((wide, 1.1), (near, 1.6)):
            axes.set(xlabel="x in the world (m)", ylabel="y in the world (m)")
            _draw_target(axes, track, scenario, frame, linewidth)
            _draw_scan(axes, scans, noise, track, frame)
            if objects is not None:
                ground.draw_objects(axes, objects, scenario.ego_poses_world[frame], frame)
        # The ellipse of two standard deviations of the estimated centre.
        centre, covariance = track.means[frame, :2], track.covariances[frame, :2, :2]
        if np.isfinite(centre).all():
            look = {"linewidth": 1.0, "linestyle": "--", "zorder": 4.0}
            ground.draw_ellipses(near, centre[None], covariance[None], 2.0, style.ESTIMATE, **look)
        _draw_surroundings(wide, scans, track, scenario, field_of_view, frame)
        # Near are the two contours and the points that were used.
        used = track.used_points[track.used_offsets[frame] : track.used_offsets[frame + 1]]
        contour = _outline(track, scenario, frame)
        also = np.concatenate([track.contours_world[frame], scans.points_world[used]])
        seen = np.concatenate([contour, ground.near(also, contour)])
        ground.fit(near, seen, 0.3 * target_radius(track, scenario))
        # Marked in the wide view.
        (left, right), (bottom, top) = near.get_xlim(), near.get_ylim()
        look = {"edgecolor": "#555555", "linewidth": 0.7, "linestyle": ":", "zorder": 6}
        wide.add_patch(Rectangle((left, bottom), right - left, top - bottom, fill=False, **look))
        wide.set_title(style.title("Bird's eye view", frame, track.times[frame]))
        near.set_title(_std(track, scenario, frame))
        _legend(figure, bool(scenario.known.any()), field_of_view is not None, objects is not None)
        return Pictures({f"k{frame:04d}/birds_eye.png": style.png(figure)})


def _outline(track: Track, scenario: Scenario, k: int) -> np.ndarray:
    """The true contour (M, 2) m; the estimated one where the truth is unknown."""
    if scenario.known[k]:
        return scenario.contour_world(k)
    contour = track.contours_world[k]
    finite = np.isfinite(contour).all()
    return contour if finite else np.zeros((1, 2)) + scenario.ego_poses_world[k, :2]


def _draw_target(axes: Axes, track: Track, scenario: Scenario, k: int, linewidth: float) -> None:
    contour = track.contours_world[k]
    mean = track.means[k]
    if scenario.known[k]:
        ground.draw_contour(axes, scenario.contour_world(k), style.TRUTH, linewidth=linewidth)
    ground.draw_band(axes, mean[:2], contour, track.contour_directions[k], track.contour_std[k])
    ground.draw_contour(axes, contour, style.ESTIMATE, linewidth=linewidth)
    reach = 0.75 * target_radius(track, scenario)
    ground.draw_heading(axes, scenario.target_poses_world[k], reach, style.TRUTH)
    ground.draw_heading(axes, mean[:3], reach, style.ESTIMATE)


def _draw_scan(axes: Axes, scans: Scans, noise: np.ndarray, track: Track, k: int) -> None:
    rows = scans.rows(k)
    used = np.zeros(len(scans.points_world), dtype=bool)
    used[track.used_points[track.used_offsets[k] : track.used_offsets[k + 1]]] = True
    looks = (~used, scans.covariances_world, style.UNUSED), (used, noise, style.USED)
    for chosen, covariances, colour in looks:
        of_scan = chosen[rows]
        points = scans.points_world[rows][of_scan]
        ground.draw_points(axes, points, covariances[rows][of_scan], colour)


def _draw_surroundings(
    axes: Axes, scans: Scans, track: Track, scenario: Scenario, field_of_view, k: int
) -> None:
    """Ego car, field of view, and the paths up to now; the limits include all visible things."""
    ego = scenario.ego_poses_world[k]
    contour = _outline(track, scenario, k)
    points = scans.points_world[scans.rows(k)]
    far = 5.0 + 1.6 * np.linalg.norm(contour - ego[:2], axis=1).max()
    shown = np.linalg.norm(points - ego[:2], axis=1) <= far
    seen = np.concatenate([ego[None, :2], contour, points[shown]])
    seen = np.concatenate([seen, ground.near(track.contours_world[k], seen)])
    ground.fit(axes, seen, 1.5)
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    x, y = points.T
    hidden = np.sum((x < left) | (x > right) | (y < bottom) | (y > top))
    if hidden:
        text = f"{hidden} point{'s' if hidden > 1 else ''} outside"
        place = {"ha": "right", "va": "bottom", "transform": axes.transAxes}
        axes.text(1.0, 1.015, text, size=7.5, color="#444444", **place)
    ground.draw_sensor(axes, ego, field_of_view)
    axes.plot(*scenario.target_poses_world[: k + 1, :2].T, color=style.TRUTH, linewidth=0.9)
    axes.plot(*track.means[: k + 1, :2].T, color=style.ESTIMATE, linewidth=0.9)


def _std(track: Track, scenario: Scenario, k: int) -> str:
    if not scenario.known[k]:
        return "Target, enlarged"
    offset = track.means[k, :3] - scenario.target_poses_world[k]
    if not np.isfinite(offset).all():
        return "Target, enlarged;  no valid estimate"
    centre = float(np.hypot(*offset[:2]))
    turn = np.degrees(float(wrap_angle(offset[2])))
    return f"Target, enlarged;  centre error {centre:.2f} m, heading error {abs(turn):.1f}°"


def _legend(figure: Figure, with_truth: bool, with_view: bool, with_objects: bool) -> None:
    dot = {"linestyle": "none", "marker": "o"}
    handles = [
        Line2D([], [], color=style.TRUTH, label="truth: contour, heading, path"),
        Line2D([], [], color=style.ESTIMATE, label="estimate: contour, heading, path"),
        Patch(color=style.ESTIMATE, alpha=0.2, linewidth=0, label="± 2σ of the contour"),
        Line2D([], [], color=style.ESTIMATE, lw=1.0, ls="--", label="2σ of the centre"),
        Line2D([], [], color=style.USED, **dot, markersize=4, label="point used, tracker's R (1σ)"),
        Line2D([], [], color=style.UNUSED, **dot, markersize=4, label="point not used, scan's 1σ"),
        Line2D([], [], color=style.EGO, linestyle="none", marker="^", label="ego car's sensor"),
        Patch(color=style.FIELD_OF_VIEW, alpha=0.25, linewidth=0, label="field of view"),
    ]
    handles = handles if with_view else handles[:-1]
    handles = handles if with_truth else handles[1:]
    if with_objects:
        handles.append(Line2D([], [], color=style.OBJECT, lw=1.0, label="objects"))
    figure.legend(handles=handles, loc="lower center", ncols=4, columnspacing=2.2)


def moving_pictures(
    scans: Scans,
    tracks: tuple[ObjectTrack, ...],
    truths: tuple[LabelTruth, ...],
    objects: Objects,
    field_of_view: tuple[float, float] | None,
    frame: int,
) -> Pictures:
    """The bird's eye view of scan `frame` of a recording with the tracks of all moving objects.

    Gives `k0033/birds_eye.png`: the ego car, its field of view (rad; None if unknown), the points,
    the rectangles of all objects, the contour, path and number of each track, and all labels.
    """
    rows, pose = scans.rows(frame), scans.sensor_poses_world[frame]
    points = scans.points_world[rows]
    with style.drawing({"axes.grid": True}):
        figure = style.new_figure(10.4, 7.4)
        axes = figure.add_axes((0.06, 0.08, 0.92, 0.87))
        axes.set(xlabel="x in the world (m)", ylabel="y in the world (m)")
        ground.fit(axes, np.concatenate([pose[None, :2], points]), 1.5)
        ground.draw_sensor(axes, pose, field_of_view)
        ground.draw_points(axes, points, scans.covariances_world[rows], style.UNUSED)
        ground.draw_objects(axes, objects, pose, frame)
        for one in truths:
            box = one.scenario.boxes_world[frame]
            if np.isfinite(box).all():
                ground.draw_contour(axes, box, style.TRUTH, linewidth=0.9)
                axes.text(*box[0], f"label {one.name}", color=style.TRUTH, size=7, clip_on=True)
        _draw_tracks(axes, tracks, frame)
        axes.set_title(style.title("Tracks, labels and objects", frame, scans.times[frame]))
        return Pictures({f"k{frame:04d}/birds_eye.png": style.png(figure)})


def _draw_tracks(axes: Axes, tracks: tuple[ObjectTrack, ...], k: int) -> None:
    """Contour, path and number of each track that has scan k."""
    for number, one in enumerate(tracks):
        i = k - one.first
        if 0 <= i < len(one.track.times) and np.isfinite(one.track.means[i]).all():
            colour = style.RUNS[number % len(style.RUNS)]
            ground.draw_contour(axes, one.track.contours_world[i], colour, linewidth=0.9)
            axes.plot(*one.track.means[: i + 1, :2].T, color=colour, linewidth=0.9)
            place = one.track.means[i, :2]
            axes.text(*place, f"   track {number}", color=colour, size=7, clip_on=True)
