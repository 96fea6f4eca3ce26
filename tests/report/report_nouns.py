"""Plausible nouns of a small run, made without any other stage."""

import numpy as np
from made_stixels import made_stixels

from stixel_cli.evaluation.scores import Scores
from stixel_cli.geometry.pose import world_from_target, wrap_angle
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.scans import Scans
from stixel_cli.rendering.frames import RenderedFrames, StereoPairs
from stixel_cli.scene.scenario import EgoMotion, Scenario
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.types import FreeSpace
from stixel_cli.tracking.track import Track


def make_rig(width=160, height=120):
    return Rig(width, height, 60.0, None, None, None, 0.3, 1.3, 0.0, None)


def make_ego_motion(scans=12, sample_time=0.1):
    times = sample_time * np.arange(scans)
    poses = np.stack([0.0 * times, 1.5 * times, np.full(scans, 0.5 * np.pi)], axis=1)
    return EgoMotion(times, poses)


def make_scenario(scans=12):
    ego = make_ego_motion(scans)
    t = ego.times
    turn = 0.35 * t
    poses = np.stack([-4 + 6 * np.sin(turn) / 0.35, 20 - 6 * (np.cos(turn) - 1) / 0.35, turn], 1)
    rates = np.stack([6 * np.cos(turn), 6 * np.sin(turn), np.full(scans, 0.35)], axis=1)
    quarter = np.array([[2.25, 0.7], [2.0, 0.9]])
    half = np.concatenate([quarter, quarter[::-1] * [-1, 1]])
    contour = np.concatenate([half, -half])
    return Scenario(t, ego.poses_world, poses, rates, contour[None])


def make_scans(scenario, rng):
    offsets, points, covariances = [0], [], []
    for k, pose in enumerate(scenario.target_poses_world):
        count = 0 if k == 5 else 40
        side = np.stack([rng.uniform(-2.2, 2.2, count), np.full(count, -0.9)], axis=1)
        seen = world_from_target(side, pose) - scenario.ego_poses_world[k, :2]
        ray = seen / np.linalg.norm(seen, axis=1)[:, None]
        along = 0.15**2 * ray[:, :, None] * ray[:, None, :]
        covariance = along + 0.02**2 * np.eye(2)
        seen = seen + rng.normal(0, 0.15, count)[:, None] * ray
        clutter = np.array([[6.0, 14.0], [-7.0, 25.0]])[: 2 if count else 0]
        points += [seen + scenario.ego_poses_world[k, :2], clutter]
        covariances += [covariance, np.tile(0.04 * np.eye(2), (len(clutter), 1, 1))]
        offsets.append(offsets[-1] + count + len(clutter))
    return Scans(
        scenario.times,
        scenario.ego_poses_world,
        np.array(offsets),
        np.concatenate(points),
        np.concatenate(covariances),
    )


def make_track(scenario, scans, rng, corners=60):
    count = len(scenario.times)
    drift = np.cumsum(rng.normal(0, [0.05, 0.05, 0.01], (count, 3)), axis=0)
    means = np.concatenate([scenario.target_poses_world + drift, scenario.target_rates_world], 1)
    angles = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    radius = 1 / np.maximum(np.abs(np.cos(angles)) / 2.1, np.abs(np.sin(angles)) / 0.85)
    directions = np.stack([np.cos(angles + h) for h in means[:, 2]])
    directions = np.stack([directions, [np.sin(angles + h) for h in means[:, 2]]], axis=2)
    used = [np.arange(*scans.rows(k).indices(10**6)) for k in range(count)]
    used = [rows[:-2] for rows in used]
    nis = rng.chisquare(80, count)
    nis[[len(rows) == 0 for rows in used]] = np.nan
    return Track(
        times=scenario.times,
        means=means,
        covariances=np.tile(np.diag([0.04, 0.09, 0.01, 0.1, 0.1, 0.01]), (count, 1, 1)),
        contours_world=means[:, None, :2] + radius[:, None] * directions,
        contour_std=np.tile(0.05 + 0.15 * (np.sin(angles) > 0), (count, 1)),
        used_offsets=np.concatenate([[0], np.cumsum([len(rows) for rows in used])]),
        used_points=np.concatenate(used),
        nis=nis,
        nis_degrees_of_freedom=np.array([2 * len(rows) for rows in used]),
    )


def make_scores(scenario, track):
    offset = track.means[:, :3] - scenario.target_poses_world
    error = np.hypot(offset[:, 0], offset[:, 1])
    iou = np.clip(0.9 - error, 0, 1)
    nees = 0.5 * (offset[:, 0] ** 2 / 0.04 + offset[:, 1] ** 2 / 0.09)
    with np.errstate(invalid="ignore", divide="ignore"):
        nis = track.nis / track.nis_degrees_of_freedom
    metrics = {"centre_rmse_m": float(np.sqrt(np.mean(error**2))), "low_overlap_share": 0.0}
    metrics |= {"iou_mean": float(iou.mean()), "nis_mean": None, "scans": len(error)}
    box = np.clip(iou + 0.1, 0, 1)
    return Scores(track.times, error, wrap_angle(offset[:, 2]), iou, box, nees, nis, metrics)


def make_camera_nouns(rig, rng, first=4, count=2):
    """(rendered, pairs, disparities, free space, stixels) of `count` frames from `first` on."""
    height, width = rig.height, rig.width
    rows = np.arange(height)[:, None] - rig.v0
    road = rig.baseline * np.maximum(rows, 0) / rig.camera_height
    disparity = np.maximum(np.broadcast_to(road, (height, width)).copy(), rig.focal * 0.3 / 60)
    base, top = int(height * 0.68), int(height * 0.42)
    target = float(road[base, 0])
    disparity[top : base + 1, width // 3 : width // 2] = target
    raw = np.rint(16 * disparity).astype(np.int16)
    raw[: height // 3] = -1
    raw[rng.random(raw.shape) < 0.03] = -1
    colour = np.full((height, width, 3), (150, 150, 145), np.uint8)
    colour[: int(rig.v0)] = (170, 200, 230)
    colour[top : base + 1, width // 3 : width // 2] = (140, 40, 40)
    grey = np.clip(colour.mean(axis=2) + rng.normal(0, 3, raw.shape), 0, 255).astype(np.uint8)
    depth = rig.depth_from_disparity(disparity)
    ids = np.ones((height, width), np.uint8)
    many = range(count)
    rendered = RenderedFrames.from_frames(first, [(colour, colour, depth, ids)] * count)
    pairs = StereoPairs(first, rendered.left.from_images([grey for _ in many]), rendered.right)
    disparities = Disparities.from_raw(first, 128, [raw] * count)
    nearest = np.full((count, width), np.nan, np.float32)
    base_row = np.full((count, width), -1, np.int32)
    nearest[:, width // 3 : width // 2] = target
    base_row[:, width // 3 : width // 2] = base
    slope = rig.baseline / rig.camera_height
    lines = np.tile([slope, -slope * rig.v0], (count, 1))
    left = np.tile(np.arange(width // 3, width // 2 - 4, 5), count)
    n = len(left)
    stixels = made_stixels(
        first,
        np.arange(count + 1) * (n // count),
        left=left.astype(np.int32),
        right=(left + 5).astype(np.int32),
        top=np.full(n, top, np.int32),
        base=np.full(n, base, np.int32),
        disparity=np.full(n, target),
        disparity_variance=np.full(n, 0.01),
        depth=np.full(n, rig.depth_from_disparity(target)),
        height=np.full(n, 1.5),
        covariances_ego=np.tile(np.eye(2), (n, 1, 1)),
    )
    known = np.full_like(base_row, -1)
    return rendered, pairs, disparities, FreeSpace(first, nearest, base_row, lines, known), stixels
