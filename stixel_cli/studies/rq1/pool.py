"""The stage errors of a sweep's runs, pooled by what differs between them."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.studies.prose import counted, percent, quantity
from stixel_cli.studies.types import StudyRun, StudySweep
from stixel_cli.validation.stage_errors import StageErrors
from stixel_cli.validation.stage_summary import phase_bias, pooled, stixel_summary

EDGES = tuple(float(edge) for edge in range(5, 51, 5))
"""Ends of the ranges in the figures, m: true depth of the target's nearest surface."""

COARSE = ((5.0, 10.0), (10.0, 20.0), (20.0, 30.0), (30.0, 40.0), (40.0, 50.0))
"""The ranges of the tables, m."""

SW_DEPTH, SW_STD = 28.0, 0.1
"""Badino, Franke, Pfeiffer 2009 state an uncertainty below 0.1 m at 28 m."""

ROUND = (25.0, 31.0)
"""The range that is looked at for it, m."""

LEAST = 5
"""A mean of fewer values is not shown."""


@dataclass(frozen=True)
class Group:
    """The runs of one setting, pooled.

    Attributes:
        label: what the setting is called.
        rig: of all its runs.
        runs: in their order.
        errors: of all their frames.
        poses: (n,) of each frame, the number of its pose: a road user at a place, of any seed.
        pose_strata, pose_frames: road user and index of the frame, of each pose.
    """

    label: str
    rig: Rig
    runs: tuple[StudyRun, ...]
    errors: StageErrors
    poses: np.ndarray
    pose_strata: tuple[str, ...]
    pose_frames: tuple[int, ...]

    def frames(self, low: float, high: float) -> np.ndarray:
        """Which frames (n,) bool see the target in [low, high) m."""
        depth = self.errors.target_depth
        return (depth >= low) & (depth < high)

    @property
    def seen(self) -> np.ndarray:
        """Which frames (n,) bool see the target at any of the ranges."""
        return self.frames(EDGES[0], EDGES[-1])


def groups(sweep: StudySweep, name: Callable[[StudyRun], str]) -> list[Group]:
    """Groups of the runs that `name` calls the same, in the order in which they come."""
    return [pool(label, points) for label, points in by_label(sweep.runs, name).items()]


def by_label(
    points: Iterable[StudyRun], name: Callable[[StudyRun], str]
) -> dict[str, list[StudyRun]]:
    """The runs by what `name` calls them."""
    found: dict[str, list[StudyRun]] = {}
    for point in points:
        found.setdefault(name(point), []).append(point)
    return found


def pool(label: str, points: Iterable[StudyRun]) -> Group:
    """One group of all the runs, at least one."""
    points = tuple(points)
    records, poses = [], []
    numbers: dict[tuple[str, int], int] = {}
    for point in points:
        for record in point.load("stage_errors"):
            records.append(record)
            for k in range(record.first, record.first + len(record.target_depth)):
                poses.append(numbers.setdefault((road_user(point), k), len(numbers)))
    return Group(
        label,
        points[0].configuration.rig,
        points,
        pooled(records),
        np.array(poses, dtype=np.int64),
        tuple(user for user, _ in numbers),
        tuple(k for _, k in numbers),
    )


def road_user(point: StudyRun) -> str:
    """The class of the run's road user."""
    return point.configuration.road_user.kind


def matcher(point: StudyRun) -> str:
    """Name of the run's stereo matcher."""
    stereo = point.configuration.stereo
    name = stereo.kind.upper()
    if stereo.error_cancellation:
        return name
    return f"{name} (one match)" if stereo.kind == "sgm" else name


def grid(point: StudyRun) -> str:
    """Name of the run's occupancy grid."""
    return point.configuration.occupancy.kind.replace("_", "-")


def rig(point: StudyRun) -> str:
    """Name of the run's rig: the option's, or its size where the study has one rig alone."""
    of = point.configuration.rig
    name = point.setting.get("rig", f"{of.width} × {of.height}")
    return {"kitti": "KITTI"}.get(name, name.replace("_", "-"))


def contrast(point: StudyRun) -> float:
    """Contrast of the road user's paint, 0 … 1."""
    return float(point.configuration.road_user.contrast)


def needed_disparity(rig: Rig, std: float, depth: float) -> float:
    """Disparity's standard deviation px that means `std` m at `depth` m: f B σ_z / z²."""
    return rig.focal * rig.baseline * std / depth**2


def achieved(group: Group) -> dict[str, float]:
    """The stixels of a group round the depth that *The Stixel World* names."""
    return stixel_summary(group.errors.stixels, *ROUND)


def counts(lines: Iterable[Group]) -> str:
    """What a line of a figure or table counts: poses and seeds, as a caption has it."""
    lines = list(lines)
    poses = {len(set(group.poses[group.seen].tolist())) for group in lines}
    return f"{_told(poses, 'pose')} a line, {seeds(lines)}"


def seeds(lines: Iterable[Group]) -> str:
    """How many seeds each pose of a table has, whose rows say how many poses they have."""
    return f"{_told({len({p.seed for p in group.runs}) for group in lines}, 'seed')} a pose"


def _told(numbers: set[int], what: str) -> str:
    least, most = min(numbers), max(numbers)
    return counted(most, what) if least == most else f"{least} to {most} {what}s"


def locking_swing(group: Group, zone: int) -> float:
    """Greatest less least mean error over the fractional part of the true disparity, px."""
    mean = phase_bias(group.errors.disparity, zone)[1]
    return float(np.nanmax(mean) - np.nanmin(mean)) if np.isfinite(mean).any() else math.nan


def text(value: float | None, digits: int = 2, unit: str = "") -> str:
    """A number as prose has it; a dash where there is none."""
    return quantity(value, unit, digits)


def share(value: float | None, digits: int = 1) -> str:
    """A share as per cent."""
    return percent(value, digits)


def cell(value: float, factor: float = 1.0) -> float | None:
    """A number for a table; None where there is none."""
    return float(value) * factor if math.isfinite(value) else None
