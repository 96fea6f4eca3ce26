"""Share of a target's columns that have a point of it, behind occluders.

    python bench/occluded_columns.py [--from 1000] [--seeds 3] [--tracks] [OVERRIDE …]

Crossings of a car, a cyclist and a pedestrian behind each occluder; seed, shape and layout have the
same number. Columns in which the target has 8 visible pixels or more count. A column has a point if
a stixel that covers it, inside the gates of the measurement, has a disparity within 1 px of those
of the target's pixels there. "Behind" are the columns that show the occluder, too. With --tracks,
two trackers run in place of that: mean IoU, and the runs that lost the target.
"""

import argparse

import numpy as np
from small import IMAGES, sized

from stixel_cli.config.compose import compose
from stixel_cli.experiment.stages import computed_stages
from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import RenderedFrames
from stixel_cli.stixels.types import Stixels
from stixel_cli.validation.stage_errors import GROSS, FrameTruth, frame_truth

OCCLUDERS = ("parked_car", "post", "hedge")
ROAD_USERS = ("car", "cyclist", "pedestrian")
TRACKERS = ("contour", "gp_ekf")
LEAST = 8
"""Visible pixels of the target in a column that counts."""


def points_of_target(
    stixels: Stixels, chosen: np.ndarray, truth: FrameTruth, rig: Rig
) -> np.ndarray:
    """Whether one of the stixels `chosen` is on the target, in each column (W,)."""
    near = np.where(truth.on_target, truth.depth, np.inf).min(axis=0)
    far = np.where(truth.on_target, truth.depth, 0.0).max(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        most, least = rig.disparity_from_depth(near) + GROSS, rig.disparity_from_depth(far) - GROSS
    found = np.zeros(rig.width, dtype=bool)
    for s in chosen:
        u = slice(stixels.left[s], stixels.right[s])
        found[u] |= (stixels.disparity[s] >= least[u]) & (stixels.disparity[s] <= most[u])
    return found


def counts(words: list[str]) -> np.ndarray:
    """Columns, and those with a point; the same of the columns behind the occluder, (4,)."""
    composition = compose([*words, "executor=threads"])
    values = composition.configuration
    with computed_stages(composition, ["render", "stixels"]) as (_, load):
        chunks: list[tuple[RenderedFrames, Stixels]] = list(
            zip(load("render"), load("stixels"), strict=True)
        )
    last = max(int(images.ids[i].max()) for images, _ in chunks for i in range(len(images.left)))
    total = np.zeros(4, dtype=np.int64)
    for images, stixels in chunks:
        inside = stixels.inside(values.measurement.gates)
        for i in range(len(images.left)):
            ids = images.ids[i]
            truth = frame_truth(
                images.depth(i), ids, values.rig, values.road, values.occupancy, values.free_space
            )
            rows = stixels.rows(i)
            chosen = rows.start + np.flatnonzero(inside[rows])
            found = points_of_target(stixels, chosen, truth, values.rig)
            counted = truth.on_target.sum(axis=0) >= LEAST
            behind = counted & (ids == last).any(axis=0)
            total += [counted.sum(), (counted & found).sum(), behind.sum(), (behind & found).sum()]
    return total


def tracks(words: list[str]) -> np.ndarray:
    """Mean IoU, and whether the track is lost, of each of `TRACKERS`."""
    row = []
    for tracker in TRACKERS:
        composition = compose([*words, f"tracker={tracker}", "executor=threads"])
        with computed_stages(composition, ["scores"]) as (_, load):
            metrics = load("scores")[0].metrics
        row += [metrics["iou_mean"], metrics["track_lost"]]
    return np.array(row)


def main() -> None:
    """Print a row for each occluder and road user, and one for all."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--from", dest="first", type=int, default=0, help="first seed")
    parser.add_argument("--seeds", type=int, default=sized(3, 1))
    parser.add_argument("--tracks", action="store_true")
    options, overrides = parser.parse_known_args()
    small = sized([], ["path.duration=2.0", "path.sample_time=1.0", *IMAGES])
    of_scene, cells = (tracks, track_cells) if options.tracks else (counts, share_cells)
    heads = ("columns", "with a point", "behind", "with a point")
    if options.tracks:
        heads = [f"{tracker}: {name}" for tracker in TRACKERS for name in ("IoU", "lost")]
    show("occluder", "road user", *heads)
    show(*["---"] * (2 + len(heads)))
    rows = []
    for occluder in OCCLUDERS[: sized(None, 1)]:
        for road_user in ROAD_USERS[: sized(None, 1)]:
            scenes = []
            for seed in range(options.first, options.first + options.seeds):
                scene = [f"road_user={road_user}", "path=crossing", f"world.occluder={occluder}"]
                numbers = [f"seed={seed}", f"world.seed={seed}", f"road_user.shape_seed={seed}"]
                scenes.append(of_scene([*scene, *numbers, *small, *overrides]))
            rows += scenes
            show(occluder, road_user, *cells(scenes))
    show("all", "all", *cells(rows))


def share_cells(rows: list[np.ndarray]) -> list[str]:
    count, found, behind, found_behind = np.sum(rows, axis=0)
    shares = [
        f"{part / max(whole, 1):.3f}" for part, whole in ((found, count), (found_behind, behind))
    ]
    return [str(count), shares[0], str(behind), shares[1]]


def track_cells(rows: list[np.ndarray]) -> list[str]:
    mean, lost = np.mean(rows, axis=0), np.sum(rows, axis=0)
    return [
        f"{mean[i]:.3f}" if i % 2 == 0 else f"{lost[i]:.0f} of {len(rows)}"
        for i in range(len(mean))
    ]


def show(*cells: str) -> None:
    print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
