"""The stage errors of a sweep's runs, pooled by what differs between them."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.studies.data import StudyRun, StudySweep
from stixel_cli.studies.tables import counted
from stixel_cli.validation.stage_errors import StageErrors
from stixel_cli.validation.stage_summary import phase_bias, pooled

EDGES = tuple(float(edge) for edge in range(5, 51, 5))
"""Ends of the ranges in the figures, m: true depth of the target's nearest surface."""

COARSE = ((5.0, 10.0), (10.0, 20.0), (20.0, 30.0), (30.0, 40.0), (40.0, 50.0))
"""The ranges of the tables, m."""

INSIDE, AT_BORDER, OTHERS = 0, 1, 2
"""Zones of the pixels, see `stage_errors.ZONES`."""

SW_DEPTH, SW_STD = 28.0, 0.1
"""Badino, Franke, Pfeiffer 2009 state an uncertainty below 0.1 m at 28 m."""

ROUND = (25.0, 31.0)
"""Range in which their value is compared, m."""

DEPTHS = {8.0: (6.0, 10.0), 15.0: (12.0, 18.0), 28.0: ROUND, 40.0: (36.0, 44.0)}
"""Depths at which rigs are compared, m, each with the ends of its range."""

LEAST = 5
"""A mean of fewer values is not shown."""


@dataclass(frozen=True)
class Group:
    """The runs of one setting, pooled.

    Attributes:
        label: name of the setting.
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
    """Groups of the runs with the same `name`, in order of appearance."""
    return [pool(label, runs) for label, runs in by_label(sweep.runs, name).items()]


def by_label(
    runs: Iterable[StudyRun], name: Callable[[StudyRun], str]
) -> dict[str, list[StudyRun]]:
    """The runs by `name`, in order of appearance."""
    found: dict[str, list[StudyRun]] = {}
    for run in runs:
        found.setdefault(name(run), []).append(run)
    return found


def pool(label: str, runs: Iterable[StudyRun]) -> Group:
    """One group of all the runs, at least one."""
    runs = tuple(runs)
    records, poses = [], []
    numbers: dict[tuple[str, int], int] = {}
    for run in runs:
        for record in run.load("stage_errors"):
            records.append(record)
            for k in range(record.first, record.first + len(record.target_depth)):
                poses.append(numbers.setdefault((road_user(run), k), len(numbers)))
    return Group(
        label,
        runs[0].configuration.rig,
        runs,
        pooled(records),
        np.array(poses, dtype=np.int64),
        tuple(user for user, _ in numbers),
        tuple(k for _, k in numbers),
    )


def road_user(run: StudyRun) -> str:
    """The class of the run's road user."""
    return run.configuration.road_user.kind


def matcher(run: StudyRun) -> str:
    """Name of the run's stereo matcher."""
    stereo = run.configuration.stereo
    kinds = {"phase_table": " (phase table)", "parabola": " (one match)"}
    return "SGM" + kinds.get(stereo.subpixel, "") if stereo.kind == "sgm" else "BM"


def grid(run: StudyRun) -> str:
    """Name of the run's occupancy grid."""
    return run.configuration.occupancy.kind.replace("_", "-")


def rig(run: StudyRun) -> str:
    """Name of the run's rig: the option's, or its size if the study has only one rig."""
    of = run.configuration.rig
    name = run.setting.get("rig", f"{of.width} × {of.height}")
    return {"kitti": "KITTI"}.get(name, name.replace("_", "-"))


def contrast(run: StudyRun) -> float:
    """Contrast of the road user's paint, 0 … 1."""
    return float(run.configuration.road_user.contrast)


def needed_disparity(rig: Rig, std: float, depth: float) -> float:
    """Disparity's standard deviation, px, that gives `std` m at `depth` m: f B σ_z / z²."""
    return rig.focal * rig.baseline * std / depth**2


def counts(lines: Iterable[Group]) -> str:
    """Numbers of poses and seeds behind a line of a figure or table, for its caption."""
    lines = list(lines)
    poses = {len(set(group.poses[group.seen].tolist())) for group in lines}
    return f"{_numbers(poses, 'pose')} per line, {seeds(lines)}"


def seeds(lines: Iterable[Group]) -> str:
    """Number of seeds per pose."""
    return (
        f"{_numbers({len({run.seed for run in group.runs}) for group in lines}, 'seed')} per pose"
    )


def _numbers(numbers: set[int], what: str) -> str:
    least, most = min(numbers), max(numbers)
    return counted(most, what) if least == most else f"{least} to {most} {what}s"


def locking_swing(group: Group, zone: int) -> float:
    """Greatest less least mean error over the fractional part of the true disparity, px."""
    mean = phase_bias(group.errors.disparity, zone)[1]
    return float(np.nanmax(mean) - np.nanmin(mean)) if np.isfinite(mean).any() else math.nan


def cell(value: float, factor: float = 1.0) -> float | None:
    """A number for a table; None if it is not finite."""
    return float(value) * factor if math.isfinite(value) else None
