"""Words of the verdict for runs that were disturbed by a known amount.

    python docs/verdicts.py

It prints a table: 200 runs on fabricated scans, without images. Offset and
outline disturb a perfect track; start disturbs the exact initial position of `tracker=contour`.
"""

import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from stixel_cli.config.compose import compose
from stixel_cli.evaluation.evaluate import evaluate
from stixel_cli.evaluation.verdict import WORDS, word
from stixel_cli.geometry.pose import world_from_target
from stixel_cli.measurements.fabricated import fabricate_scans
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.path import build_scenario
from stixel_cli.tracking.contour import contour
from stixel_cli.tracking.start import noisy_start
from stixel_cli.tracking.track import Track

ROAD_USERS = ("car", "cyclist", "pedestrian")
PATHS = ("turn", "crossing", "approach")

ROWS = (
    ("offset", 0.0, 0.08, ("good",)),
    ("offset", 0.1, 0.2, ("fair",)),
    ("offset", 0.3, 0.55, ("poor",)),
    ("offset", 1.0, 1.5, ("lost",)),
    ("outline", 0.0, 0.1, ("good",)),
    ("outline", 0.15, 0.25, ("fair",)),
    ("outline", 0.4, 0.6, ("poor",)),
    ("start", 0.0, 0.1, ("fair", "good")),
    ("start", 1.5, 3.0, ("lost", "poor")),
)
"""What is disturbed, its least and greatest amount as a share of the target's length and width, and
the words that are expected."""

RUNS = (24, 24, 24, 24, 24, 24, 24, 16, 16)
"""Runs of each row."""


@cache
def scene(user: str, path: str, seed: int) -> tuple[Any, ...]:
    """Configuration, scenario and fabricated scans of two seconds."""
    overrides = [f"road_user={user}", f"path={path}", "path.duration=2", "measurement=fabricated"]
    overrides += ["tracker=contour", f"seed={seed}", f"road_user.shape_seed={seed}"]
    p = compose(overrides).configuration
    ego = ego_motion(p.ego, p.path.duration, p.path.sample_time)
    scenario = build_scenario(ego, p.road_user, p.path)
    scans = fabricate_scans(scenario, p.rig, p.measurement, seed)
    return p, scenario, scans


def perfect_track(scenario: Any, scans: Any, offset: np.ndarray, scale: np.ndarray) -> Track:
    """The truth, its centre moved by `offset` (2,) m and its outline scaled by `scale` (2,)."""
    poses = scenario.target_poses_world
    moved = scenario.contours_target[scenario.limb_poses] * scale + offset
    centres = np.broadcast_to(offset, (len(poses), 1, 2))
    contours, places = (
        np.stack([world_from_target(one, pose) for one, pose in zip(points, poses, strict=True)])
        for points in (moved, centres)
    )
    count = len(poses)
    means = np.concatenate([places[:, 0], poses[:, 2:], scenario.target_rates_world], axis=1)
    return Track(
        times=scenario.times,
        means=means,
        covariances=np.tile(0.01 * np.eye(6), (count, 1, 1)),
        contours_world=contours,
        contour_std=np.full(contours.shape[:2], 0.1),
        used_offsets=scans.offsets,
        used_points=np.arange(scans.offsets[-1]),
        nis=np.full(count, 2.0),
        nis_degrees_of_freedom=np.full(count, 2),
    )


def disturbed(what: str, amount: float, draw: np.random.Generator, at: tuple) -> dict[str, Any]:
    """The metrics of one run, disturbed by `amount` of the target's length and width."""
    p, scenario, scans = scene(*at)
    low, high = scenario.box_target
    angle = draw.uniform(0.0, 2.0 * np.pi)
    offset = amount * (high - low) * [np.cos(angle), np.sin(angle)]
    scale = 1.0 + amount * draw.choice([-1.0, 1.0], 2)
    if what == "start":
        start = noisy_start(scenario, p.start, at[2])
        pose = scenario.target_poses_world[0]
        step = world_from_target(offset[None], pose)[0] - pose[:2]
        moved = pose + np.array([*step, 0.0])
        mean = np.concatenate([moved, scenario.target_rates_world[0]])
        start = replace(start, mean=mean)
        track = contour.track(scans, start, p.prior, p.tracker)
    else:
        offset, scale = (offset, np.ones(2)) if what == "offset" else (np.zeros(2), scale)
        track = perfect_track(scenario, scans, offset, scale)
    return evaluate(track, scenario, scans).metrics


def rows(seed: int = 0, part: int = 1) -> Iterator[tuple[tuple, Counter]]:
    """Each of `ROWS` with the counts of the words of its runs; every `part`-th run is made."""
    for number, ((what, least, greatest, _), runs) in enumerate(zip(ROWS, RUNS, strict=True)):
        found: Counter = Counter()
        for i in range(0, runs, part):
            draw = np.random.default_rng([seed, number, i])
            at = ROAD_USERS[i % 3], PATHS[i // 3 % 3], seed + i // 9
            metrics = disturbed(what, draw.uniform(least, greatest), draw, at)
            found[word(metrics)] += 1
        yield ROWS[number], found


def table() -> str:
    """The table of confusions, in Markdown."""
    lines = [
        f"| disturbed | amount | expected | {' | '.join(WORDS)} |",
        f"|---|---|---|{'---:|' * len(WORDS)}",
    ]
    for (what, least, greatest, expected), found in rows():
        counts = " | ".join(str(found[one]) for one in WORDS)
        amount = f"{100 * least:.0f} to {100 * greatest:.0f} %"
        lines.append(f"| {what} | {amount} | {' or '.join(expected)} | {counts} |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(f"{table()}\n")
