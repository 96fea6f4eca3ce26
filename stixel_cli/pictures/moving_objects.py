"""A scan from above, with the tracks of all moving objects."""

import numpy as np
from matplotlib.axes import Axes

from stixel_cli.measurements.scans import Scans
from stixel_cli.pictures import ground, style
from stixel_cli.recordings.types import LabelTruth
from stixel_cli.results.pictures import Pictures
from stixel_cli.stixels.types import Objects
from stixel_cli.tracking.track import ObjectTrack


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
        if field_of_view is not None:
            ground.draw_field_of_view(axes, pose, field_of_view)
        ground.draw_ego(axes, pose)
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
