"""`stixel study motions`: tracks of KITTI tracking and Argoverse 2 in the folder of STIXEL_DATA."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from stixel_cli.answers.runs import Runs
from stixel_cli.errors import MissingData
from stixel_cli.recordings.argoverse import ANNOTATIONS
from stixel_cli.recordings.replay import find_motion, label_root, sequences
from stixel_cli.recordings.tables import read_labels, read_poses
from stixel_cli.results.result import RunResult
from stixel_cli.scene.parameters import CLASS_OF_KITTI_TYPE
from stixel_cli.studies.report import DATA, data_folder, with_columns

CLIPS = "kitti_tracking"
NEEDED = (
    f"{CLIPS}/training with label_02, oxts (or ego_poses) and calib of KITTI's tracking benchmark"
)
"""What the data folder of the study has."""

LOGS = "argoverse2"
"""Beside it, if the user has it: a folder of logs."""

LEAST_FRAMES = 30
"""Labelled frames of a track that count, at least."""

FARTHEST = 40.0
"""A frame counts if the label is within this distance of the camera on the ground, m, …"""

WIDEST = 0.86
"""… and in the image of `rig=kitti` (at most this far aside over ahead), …"""

MOST_OCCLUDED = 2
"""… is not truncated, and has at most this state of occlusion (2: largely occluded)."""

MOST_SIMULATED = 10
"""Tracks of each class with simulated measurements, at most."""


@dataclass(frozen=True)
class RealTrack:
    """One labelled track: folder of the log or of all clips, clip (None: a log), track id, type of
    its label, first to last frame that counts."""

    folder: Path
    sequence: str | None
    target: int | str
    kind: str
    frames: range


def real_tracks(folder: Path) -> list[RealTrack]:
    """The tracks that have enough frames, of all clips with ego poses, and of the logs beside them.

    UserError if a file is not valid.
    """
    clips = [(folder, sequence) for sequence in sequences(label_root(folder))]
    logs = sorted(file.parent for file in (folder.parent / LOGS).glob(f"*/{ANNOTATIONS}"))
    found = []
    for place, sequence in [*clips, *((log, None) for log in logs)]:
        motion = find_motion(place, sequence)
        count = len(read_poses(motion.pose_files, motion.tables))
        for target, labels in read_labels(motion.label_files, motion.tables).items():
            aside, _, ahead = labels.places.T
            clear = (labels.truncated == 0) & (labels.occluded <= MOST_OCCLUDED)
            clear &= (np.hypot(aside, ahead) <= FARTHEST) & (np.abs(aside) <= WIDEST * ahead)
            frames = labels.frames[clear & (labels.frames < count)]
            if labels.kind in CLASS_OF_KITTI_TYPE and len(frames) >= LEAST_FRAMES:
                span = range(int(frames[0]), int(frames[-1]) + 1)
                found.append(RealTrack(place, sequence, target, labels.kind, span))
    return found


def simulated_subset(tracks: list[RealTrack]) -> list[RealTrack]:
    """At most `MOST_SIMULATED` tracks of each class, evenly spread in the order of `tracks`."""
    chosen = []
    for road_user in dict.fromkeys(CLASS_OF_KITTI_TYPE.values()):
        own = [track for track in tracks if CLASS_OF_KITTI_TYPE[track.kind] == road_user]
        count = min(len(own), MOST_SIMULATED)
        chosen += [own[i * len(own) // count] for i in range(count)]
    return [track for track in tracks if track in chosen]


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
            "path.folder": [str(track.folder) for track in chosen],
            "path.sequence": [track.sequence for track in chosen],
            "path.target": [track.target for track in chosen],
            "path.frames": [f"{track.frames.start}:{track.frames.stop}" for track in chosen],
            "seed": [tracks.index(track) for track in chosen],
        }
    ]


every_track, some_tracks = (partial(_axes, subset) for subset in (list, simulated_subset))
"""Axes: all tracks, each with a seed of its own; those of them with simulated measurements."""


def columns(name: str, runs: Runs, results: Sequence[RunResult]) -> Runs:
    """The runs with their motion: a hand-made path, or a track of a clip or log. It is the unit."""
    motions = []
    for run, option in zip(results, runs.frame["path"], strict=True):
        path = run.configuration.path
        clip = getattr(path, "sequence", None) or Path(getattr(path, "folder", "")).name[:8]
        motions.append(f"{clip}/{str(path.target)[:8]}" if hasattr(path, "target") else option)
    # The settings of a track go together with its motion.
    axes = tuple(a for a in runs.axes if not a.startswith("path") and a != "seed")
    own = Runs(runs.frame, axes if name != "hand_made" else (*axes, "seed"))
    return with_columns(own, motion=motions)
