"""Write the moving picture of the README: the default experiment, by its camera and from above.

    python docs/moving_picture.py

The images take minutes, or seconds if they are in the cache.
"""

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from PIL import Image

from stixel_cli import run
from stixel_cli.pictures import ground, style
from stixel_cli.results.result import RunResult

FILE = Path(__file__).parent / "figures" / "moving_picture.gif"
WIDTH, HEIGHT = 384, 288
"""Size of the camera's image in the picture, px."""
LAST = 1500
"""Time for which the last frame is shown, ms; the others have their own."""
GREY, LEAST_CHANGE = 8, 16
"""Step of the grey values, of 256, and the least change of one that is shown: smaller ones are
noise of the sensor, which would take most of the file."""


def camera_images(result: RunResult) -> Iterator[np.ndarray]:
    """The left images (HEIGHT, WIDTH, 3) uint8 with their stixels, coloured by depth."""
    before = np.full((HEIGHT, WIDTH), -256.0)
    for chunk in result.camera:
        colours = 255.0 * style.depth_colours(chunk.depth)
        bounds = np.stack([chunk.left, chunk.right, chunk.top, chunk.base + 1], axis=1)
        bounds = np.round(bounds * (WIDTH / chunk.width)).astype(int)
        for i, file in enumerate(chunk.images["grey"]):
            image = Image.open(io.BytesIO(file)).convert("L").resize((WIDTH, HEIGHT))
            grey = np.asarray(image, dtype=np.float64)
            before = np.where(np.abs(grey - before) < LEAST_CHANGE, before, grey)
            shown = np.repeat(before[..., None] // GREY * GREY, 3, axis=2)
            for row in range(chunk.offsets[i], chunk.offsets[i + 1]):
                left, right, top, base = bounds[row]
                shown[top:base, left:right] *= 0.55
                shown[top:base, left:right] += 0.45 * colours[row]
            yield shown.astype(np.uint8)


def from_above(result: RunResult, k: int) -> np.ndarray:
    """Scan k with both contours, the whole path and the target enlarged: (HEIGHT, n, 3) uint8."""
    scans, scenario, track = result.scans, result.scenario, result.track
    contour, mean = track.contours_world[k], track.means[k, :2]
    points = scans.points_world[scans.rows(k)]
    used = scans.points_world[track.used_points[slice(*track.used_offsets[k : k + 2])]]
    with style.drawing():
        figure = style.new_figure(2.0 * HEIGHT / style.DPI, HEIGHT / style.DPI)
        wide, near = figure.add_axes((0.045, 0.09, 0.45, 0.89)), figure.add_axes((0.51, 0, 0.49, 1))
        wide.tick_params(labelsize=7)
        wide.set(xlim=(-13, 13), ylim=(-0.5, 25.2))
        near.set(xlim=mean[0] + [-3.2, 3.2], ylim=mean[1] + [-3.2, 3.2], xticks=[], yticks=[])
        near.spines[:].set_visible(False)
        ground.draw_sensor(wide, scenario.ego_poses_world[k], None)
        wide.plot(*track.means[: k + 1, :2].T, color=style.ESTIMATE, linewidth=0.8)
        for axes, size in ((wide, 2), (near, 5)):
            axes.plot(*points.T, ".", color=style.UNUSED, markersize=size)
            axes.plot(*used.T, ".", color=style.USED, markersize=size, zorder=5)
            ground.draw_contour(axes, scenario.contour_world(k), style.TRUTH)
            ground.draw_band(axes, mean, contour, track.contour_directions[k], track.contour_std[k])
            ground.draw_contour(axes, contour, style.ESTIMATE, linewidth=1.2)
        handles = [
            Line2D([], [], color=style.USED, linestyle="none", marker=".", label="points"),
            Line2D([], [], color=style.TRUTH, label="true contour"),
            Line2D([], [], color=style.ESTIMATE, label="estimate"),
            Patch(color=style.ESTIMATE, alpha=0.3, linewidth=0, label="± 2σ"),
        ]
        wide.legend(handles=handles, loc="lower left", fontsize=7)
        text = f"{track.times[k]:.1f} s, IoU {result.scores.iou[k]:.2f}"
        near.text(0.97, 0.97, text, size=9, ha="right", va="top", transform=near.transAxes)
        return np.asarray(Image.open(io.BytesIO(style.png(figure))))


def main(overrides: list[str], file: Path) -> None:
    """Run an experiment with images of 4:3 and write its picture to `file`."""
    result = run(overrides)
    images = [
        Image.fromarray(np.hstack([image, from_above(result, k)]))
        for k, image in enumerate(camera_images(result))
    ]
    # The colours that differ most: the most frequent ones are all grey.
    palette = images[len(images) // 2].quantize(128, Image.Quantize.MAXCOVERAGE)
    first, *others = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    pauses = np.round(1000.0 * np.diff(result.track.times)).astype(int).tolist()
    first.save(file, save_all=True, append_images=others, duration=[*pauses, LAST], loop=0)


if __name__ == "__main__":
    main(["pictures.frames=[]"], FILE)
