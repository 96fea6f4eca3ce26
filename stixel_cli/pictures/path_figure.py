"""The whole run from above: the path, and contours at several times."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import withStroke

from stixel_cli.geometry.pose import target_from_world
from stixel_cli.pictures import ground, style
from stixel_cli.pictures.uncertainty import target_radius
from stixel_cli.results.pictures import Pictures
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track

CONTOURS = 8
"""At most this many contours are drawn along the path, besides the last one."""

LEGEND, LEFT, BOTTOM, TOP, STRIP_TITLE = 1.95, 0.65, 0.6, 0.4, 0.35  # margins, in
CELL = (2.2, 2.4)
"""Room for one contour in its own frame, in multiples of the target's greatest radius."""
HALO = withStroke(linewidth=2.5, foreground="white")
"""Keeps a label readable where it meets a line."""

SCALE = 0.5
"""Width for the scale next to the contours, in cells."""


def path_pictures(
    track: Track, scenario: Scenario, field_of_view: tuple[float, float] | None
) -> Pictures:
    """`path`, contours along the path, as `.png` and `.svg`; arguments as of `path_figure`."""
    with style.drawing():
        figure = path_figure(track, scenario, field_of_view)
        return Pictures({"path.png": style.png(figure), "path.svg": style.svg(figure)})


def path_figure(
    track: Track,
    scenario: Scenario,
    field_of_view: tuple[float, float] | None,
    axes: Axes | None = None,
) -> Figure:
    """Paths with contours at several times in the world, and the same contours enlarged below.

    Below, contours are in the frame of the true target: heading to the right, next to each other.
    Where the truth is unknown, the estimate takes its place. `field_of_view` is in rad, None if
    unknown. With `axes`, only the paths are drawn, there.
    """
    known, ego = scenario.known, scenario.ego_poses_world
    # The estimate where the truth is unknown, and the ego's pose where both are.
    poses = np.where(known[:, None], scenario.target_poses_world, track.means[:, :3])
    poses = np.where(np.isfinite(poses).all(axis=1)[:, None], poses, ego)
    size = target_radius(track, scenario)
    chosen = spaced_frames(poses[:, :2], size)
    contours = {k: scenario.contour_world(k) for k in chosen if known[k]}
    certain = np.concatenate([ego[:, :2], poses[:, :2], *contours.values()])
    estimated = ground.near(track.contours_world[list(chosen)].reshape(-1, 2), certain)
    points, strip = np.concatenate([certain, estimated]), None
    if axes is None:
        axes, strip = _axes_for(points, 0.8 * size + 1.0, len(chosen) + SCALE)
    ground.fit(axes, points, 0.8 * size + 1.0)
    for k in sorted({0, len(ego) - 1}) if np.ptp(ego, axis=0).any() else (0,):
        ground.draw_sensor(axes, ego[k], field_of_view)
    axes.plot(*ego[:, :2].T, color=style.EGO, linewidth=1.2)
    axes.plot(*scenario.target_poses_world[:, :2].T, color=style.TRUTH, linewidth=0.9, zorder=3)
    axes.plot(*track.means[:, :2].T, color=style.ESTIMATE, linewidth=0.9, zorder=3)
    for k in chosen:
        if k in contours:
            ground.draw_contour(axes, contours[k], style.TRUTH, linewidth=1.2)
        contour = track.contours_world[k]
        ground.draw_contour(axes, contour, style.ESTIMATE, linewidth=1.2)
        band = (track.means[k, :2], contour, track.contour_directions[k], track.contour_std[k])
        ground.draw_band(axes, *band)
    shown = [contours.get(k, track.contours_world[k]) for k in chosen]
    _label_times(axes, track.times, poses, chosen, shown)
    axes.set(xlabel="x in the world (m)", ylabel="y in the world (m)")
    axes.set_title(f"Path of the target, {track.times[-1] - track.times[0]:.1f} s")
    handles = [Line2D([], [], color=style.TRUTH, label="truth")] if known.any() else []
    handles += [
        Line2D([], [], color=style.ESTIMATE, label="estimate"),
        Patch(color=style.ESTIMATE, alpha=0.2, linewidth=0, label="± 2σ of the contour"),
        Line2D([], [], color=style.EGO, marker="^", markersize=7, label="ego car's sensor"),
    ]
    if field_of_view is not None:
        handles += [Patch(color=style.FIELD_OF_VIEW, alpha=0.25, lw=0, label="field of view")]
    if strip is None:
        axes.legend(handles=handles)
    else:
        box = axes.get_position()
        beside = (box.x1 + 0.01, box.y1)
        axes.figure.legend(handles=handles, loc="upper left", bbox_to_anchor=beside)
        _draw_strip(strip, track, scenario, poses, chosen, size)
    return axes.figure


def spaced_frames(positions_world: np.ndarray, size: float) -> tuple[int, ...]:
    """Frames whose places (K, 2) along the path are far enough apart to be drawn, and the last.

    They are an eighth of the path apart, and at least 2.4 `size` (m), the target's greatest radius.
    """
    steps = np.linalg.norm(np.diff(positions_world, axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    spacing = max(travelled[-1] / CONTOURS, 2.4 * size)
    chosen = [0]
    for k in range(len(travelled)):
        if travelled[k] - travelled[chosen[-1]] >= spacing:
            chosen.append(k)
    last = len(travelled) - 1
    # The last one is always shown; those that would overlap it are dropped.
    kept = [k for k in chosen if travelled[last] - travelled[k] >= 0.8 * spacing]
    return (*kept, last) if last > 0 else (0,)


def _axes_for(points: np.ndarray, margin: float, cells: float) -> tuple[Axes, Axes]:
    """Axes of a new figure whose shape suits the points, space at their right, a strip below."""
    extent = np.ptp(points, axis=0) + 2.0 * margin
    width, height = np.maximum(extent * 5.2 / max(extent), [3.6, 3.4])
    total_width = width + LEFT + LEGEND
    strip_width = total_width - 0.4
    strip_height = min(strip_width / cells * CELL[1] / CELL[0], 1.7)
    below = strip_height + STRIP_TITLE + BOTTOM + 0.1
    size = np.array([total_width, below + height + TOP])
    figure = style.new_figure(*size)
    axes = figure.add_axes((*([LEFT, below] / size), *([width, height] / size)))
    strip = figure.add_axes((*([0.2, 0.1] / size), *([strip_width, strip_height] / size)))
    return axes, strip


def _label_times(axes: Axes, times, poses, chosen, contours: Sequence[np.ndarray]) -> None:
    """Times next to the contours, inside the axes: on the path's outer side if it is free."""
    middle = poses[:, :2].mean(axis=0)
    height = np.diff(axes.get_ylim()).item()
    room = np.array([0.08, 0.035]) * height  # of a label
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    low, high = low + 0.5 * room, high - 0.5 * room
    places: list[np.ndarray] = []
    for k, contour in zip(chosen, contours, strict=True):
        heading = poses[k, 2]
        side = np.array([-np.sin(heading), np.cos(heading)])
        half_width = np.nan_to_num(np.abs((contour - poses[k, :2]) @ side)).max()
        # Half of the label is on the way, across it or along it.
        distance = half_width + 0.015 * height + 0.5 * np.abs(side) @ room
        outwards = side @ (poses[k, :2] - middle)
        # On a straight path both sides are alike: the right one, or the upper one.
        toward = np.sign(outwards) if abs(outwards) > 0.05 * distance else np.sign(side.sum())
        away = distance * (toward or 1.0) * side
        place = np.clip(poses[k, :2] + away, low, high)
        if any((np.abs(place - other) < room).all() for other in places):
            place = np.clip(poses[k, :2] - away, low, high)
        places.append(place)
        text = f"{times[k]:.1f} s"
        label = {"ha": "center", "va": "center", "size": 7.5, "color": "#444444", "zorder": 6}
        axes.text(*place, text, path_effects=[HALO], **label)


def _draw_strip(
    axes: Axes, track: Track, scenario: Scenario, poses: np.ndarray, chosen, size: float
) -> None:
    """The contours at `chosen` in the frame of the target at `poses` (K, 3), next to each other."""
    # For the greatest radius with its band; a lost estimate would make the others too small to see.
    frames = list(chosen)
    away = np.linalg.norm(track.contours_world[frames] - poses[frames, None, :2], axis=2)
    reach = away + 2.0 * track.contour_std[frames]
    size = float(np.clip(np.nanmax(reach, initial=size), size, 2.5 * size))
    width, height = CELL[0] * size, CELL[1] * size
    for i, k in enumerate(chosen):
        pose, centre = poses[k], np.array([(i + 0.5) * width, 0.0])
        if scenario.known[k]:
            true = scenario.contour_target(k) + centre
            ground.draw_contour(axes, true, style.TRUTH, linewidth=1.2)
        drawn = len(axes.patches)
        contour = target_from_world(track.contours_world[k], pose) + centre
        ground.draw_contour(axes, contour, style.ESTIMATE, linewidth=1.2)
        middle = target_from_world(track.means[k, None, :2], pose)[0] + centre
        turned = np.array([0.0, 0.0, pose[2]])
        directions = target_from_world(track.contour_directions[k], turned)
        ground.draw_band(axes, middle, contour, directions, track.contour_std[k])
        cell = Rectangle((i * width, -0.42 * height), 0.97 * width, 0.92 * height, lw=0, fill=False)
        axes.add_patch(cell)
        for patch in axes.patches[drawn:-1]:
            patch.set_clip_path(cell)
        text = f"{track.times[k]:.1f} s"
        axes.text(centre[0], -0.5 * height, text, ha="center", va="bottom", size=7.5)
    metres = next(m for m in (5.0, 2.0, 1.0, 0.5, 0.2, 0.1) if m <= SCALE * width or m == 0.1)
    right = (len(chosen) + SCALE) * width
    axes.plot([right - metres, right], [-0.27 * height] * 2, color="#444444", linewidth=1.5)
    below = {"xytext": (0, -3), "textcoords": "offset points", "ha": "right", "va": "top"}
    axes.annotate(f"{metres:g} m", (right, -0.27 * height), size=7.5, **below)
    axes.set(xlim=(0.0, right), ylim=(-0.5 * height, 0.5 * height))
    axes.set_aspect("equal", anchor="W")
    axes.set_axis_off()
    whose = "true" if scenario.known.any() else "estimated"
    axes.set_title(f"In the {whose} target's frame, heading to the right")
