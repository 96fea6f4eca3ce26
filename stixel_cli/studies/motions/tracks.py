"""The real tracks of the study: those of KITTI tracking in the folder that STIXEL_DATA names."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stixel_cli.errors import MissingData
from stixel_cli.recordings.kitti_tables import read_labels, read_poses
from stixel_cli.recordings.replay import LABELS, label_root, sequences
from stixel_cli.scene.classes import CLASS_OF_KITTI_TYPE
from stixel_cli.studies.data import DATA, data_folder

CLIPS = "kitti_tracking"
NEEDED = f"{CLIPS}/training with label_02, ego_poses and calib of KITTI's tracking benchmark"
"""What the data folder of the study has."""

LEAST_FRAMES = 30
"""Labelled frames of a track that count, at least."""

FARTHEST = 40.0
"""A frame counts if the label is within this distance of the camera on the ground, m, …"""

MOST_OCCLUDED = 2
"""… is not truncated, and has at most this state of occlusion (2: largely occluded)."""

MOST_SIMULATED = 10
"""Tracks of each class with simulated measurements, at most."""


@dataclass(frozen=True)
class RealTrack:
    """One labelled track: clip, track id, type of its label, first to last frame that counts."""

    sequence: str
    target: int
    kind: str
    frames: range


def real_tracks(folder: Path) -> list[RealTrack]:
    """The tracks of all clips with ego poses that have enough frames, by clip and track id.

    Raises:
        UserError: if a file is not valid.
    """
    root = label_root(folder)
    found = []
    for sequence in sequences(root):
        poses = root / "ego_poses" / f"{sequence}.txt"
        if not poses.is_file():
            continue
        count = len(read_poses(poses))
        for target, labels in read_labels(root / LABELS / f"{sequence}.txt").items():
            away = np.hypot(labels.places[:, 0], labels.places[:, 2])
            clear = (labels.truncated == 0) & (labels.occluded <= MOST_OCCLUDED)
            frames = labels.frames[clear & (away <= FARTHEST) & (labels.frames < count)]
            if labels.kind in CLASS_OF_KITTI_TYPE and len(frames) >= LEAST_FRAMES:
                span = range(int(frames[0]), int(frames[-1]) + 1)
                found.append(RealTrack(sequence, target, labels.kind, span))
    return found


def simulated_subset(tracks: list[RealTrack]) -> list[RealTrack]:
    """At most `MOST_SIMULATED` tracks of each class, evenly spread in the order of `tracks`."""
    chosen = []
    for road_user in dict.fromkeys(CLASS_OF_KITTI_TYPE.values()):
        own = [track for track in tracks if CLASS_OF_KITTI_TYPE[track.kind] == road_user]
        count = min(len(own), MOST_SIMULATED)
        chosen += [own[i * len(own) // count] for i in range(count)]
    return [track for track in tracks if track in chosen]


def every_track() -> list[dict[str, list]]:
    """Axes: all tracks, each with a seed of its own."""
    return _axes(lambda tracks: tracks)


def some_tracks() -> list[dict[str, list]]:
    """Axes: the tracks with simulated measurements, with the same seeds as in `every_track`."""
    return _axes(simulated_subset)


def _axes(subset: Callable[[list[RealTrack]], list[RealTrack]]) -> list[dict[str, list]]:
    folder = data_folder(NEEDED, CLIPS)
    tracks = real_tracks(folder)
    chosen = subset(tracks)
    if not chosen:
        raise MissingData(
            f"{DATA}: {folder} has no track with {LEAST_FRAMES} frames within {FARTHEST:g} m"
        )
    return [
        {
            "path.folder": [str(folder)] * len(chosen),
            "path.sequence": [track.sequence for track in chosen],
            "path.target": [track.target for track in chosen],
            "path.frames": [f"{track.frames.start}:{track.frames.stop}" for track in chosen],
            "seed": [tracks.index(track) for track in chosen],
        }
    ]
