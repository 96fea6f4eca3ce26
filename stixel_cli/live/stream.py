"""Stixels, objects and moving objects of image pairs that come one after the other."""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import chain, count
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.config.folders import option_values, real_image_parameters
from stixel_cli.errors import ArgumentError
from stixel_cli.geometry.pose import STRAIGHT_AHEAD, planar_poses
from stixel_cli.geometry.rig import Rig
from stixel_cli.live.pairs import (
    FrameStixels,
    RigLike,
    check_rows,
    grey_pair,
    matched,
    rig_of,
    stixels_of,
)

if TYPE_CHECKING:
    from stixel_cli.calibration.tracks import Pair
    from stixel_cli.geometry.rig_calibration import RigCalibration
    from stixel_cli.measurements.scans import Scans
    from stixel_cli.rendering.frames import StereoPairs
    from stixel_cli.stixels.types import Objects
    from stixel_cli.trackers import Contour, Estimate
    from stixel_cli.tracking.followed import ClusterTrack

CALIBRATED = (100, 200, 400)
"""Numbers of pairs after which the rig's error is estimated, from all pairs of images by then."""

MOST_THREADS, FARTHEST = 64, 1e6
"""Of `StixelStream.steps`; m, of a pose's numbers."""


@dataclass(frozen=True)
class MovingObject:
    """An object that moves like a road user."""

    number: int
    """The same in all frames."""
    mean: np.ndarray
    """(4,) place and velocity in the world, m and m/s; and covariance: its, (4, 4)."""
    covariance: np.ndarray
    points: np.ndarray
    """(n, 2) m, its points in the world; none where it is not seen."""
    estimate: "Estimate"
    """Pose, size and contour, of the tracker `contour` on these points."""


@dataclass(frozen=True)
class StreamFrame:
    """What `StixelStream` knows after one pair; the world is the ground plane of the first one."""

    k: int
    """Number of the pair, from 0."""
    stixels: FrameStixels
    """Of the pair."""
    objects: "Objects"
    """Clusters of the stixels."""
    scan: "Scans"
    """One scan, the points of the stixels in the world."""
    tracks: tuple[MovingObject, ...]
    """The objects that move."""
    calibration: "RigCalibration | None" = None
    """What is known by now of the rig's disparity error; None for nothing."""


class StixelStream:
    """Takes image pairs in order, and keeps the free space and the tracks from pair to pair.

    The stixels are those of `stixel run` on the same clip with the same disparity error of the rig;
    the tracks are the clusters that `source.target=auto` follows, as far as they are known at each
    pair, each with its contour. `rig` is as in `stixels_from_pair`; a height that it does not state
    is that of the road in the first pair. A disparity error that it does not state is estimated by
    the motion of the camera, after each of the `CALIBRATED` numbers of pairs, and corrected from
    then on.
    `sample_time` is from pair to pair, s; `check_rectification` as in `stixels_from_pair`, of the
    first pair that has corners enough.
    """

    def __init__(self, rig: RigLike, sample_time: float = 0.1, check_rectification: bool = True):
        if not 0.001 <= sample_time <= 10.0:
            raise ArgumentError(f"sample_time: must be from 0.001 to 10 s, got {sample_time!r}")
        self._check_rectification, self._checked = check_rectification, False
        self._rig, self._sample_time = rig, sample_time
        self._stixels: FrameStixels | None = None
        self._camera: np.ndarray | None = None
        self._poses = np.zeros((0, 3))
        self._scans: deque[Scans] = deque()
        self._tracks: list[ClusterTrack] = []
        self._calibration: RigCalibration | None = None
        self._lefts: list[np.ndarray] = []
        self._motions: list[Pair] = []
        self._contours: dict[int, Contour] = {}
        self._numbers = count()

    def step(
        self, left: np.ndarray, right: np.ndarray, pose: np.ndarray | None = None
    ) -> StreamFrame:
        """The stixels, objects and tracks after one more pair.

        Args:
            left, right: as in `stixels_from_pair`.
            pose: of the car: (3,) x m, y m, heading rad on the ground, or (3, 4), the left camera's
                pose as in KITTI's `poses.txt`. Without poses the car counts as parked.

        ArgumentError as `stixels_from_pair`, and for a pose that is none.
        """
        return self._advance(*self._matched(left, right), pose)

    def steps(
        self, pairs: Iterable[Sequence[np.ndarray]], threads: int = 2
    ) -> Iterator[StreamFrame]:
        """`step` for each of `pairs`, (left, right) or (left, right, pose).

        Each of the `threads` matches a pair ahead, so `pairs` may also be read from a camera.
        """
        from stixel_cli.stereo.matching import one_thread

        if not 1 <= threads <= MOST_THREADS:
            raise ArgumentError(f"threads: must be from 1 to {MOST_THREADS}, got {threads!r}")
        waiting: deque = deque()
        with one_thread(), ThreadPoolExecutor(threads) as pool:
            for left, right, *pose in pairs:
                waiting.append((pool.submit(self._matched, left, right), pose))
                if len(waiting) > threads:
                    ahead, pose = waiting.popleft()
                    yield self._advance(*ahead.result(), *(pose or [None]))
            for ahead, pose in waiting:
                yield self._advance(*ahead.result(), *(pose or [None]))

    def _matched(self, left: np.ndarray, right: np.ndarray) -> tuple:
        """The grey pair, its disparities, and the rig whose error is corrected in them."""
        pair = grey_pair(left, right)
        rig = rig_of(self._rig, pair.left[0].shape)
        return pair, matched(pair, rig), rig

    def _advance(
        self, pair: "StereoPairs", disparities, matched_by: Rig, pose: np.ndarray | None
    ) -> StreamFrame:
        from stixel_cli.measurements.objects import find_objects

        k = len(self._poses)
        self._checked = self._checked or check_rows(pair, matched_by, self._check_rectification)
        if k == 0:
            self._rig = rig_of(self._rig, pair.left[0].shape, disparities)
        self._poses = np.vstack([self._poses, self._planar(pose)])
        last_two = self._poses[[max(k - 1, 0), k]]
        rig = replace(self._rig, disparity_error=matched_by.disparity_error)
        self._stixels = stixels_of(disparities, pair, rig, self._stixels, last_two)
        if self._calibration or not rig.states_error:
            self._calibrate(pair.left[0], disparities, rig, k)
        scan = self._stixels.to_scan(self._poses[k], k * self._sample_time)
        moving = self._followed(scan, k)
        gates = real_image_parameters().measurement.gates
        objects = find_objects(self._stixels.stixels, gates, range(1))
        return StreamFrame(k, self._stixels, objects, scan, moving, self._calibration)

    def _calibrate(self, left: np.ndarray, disparities, rig: Rig, k: int) -> None:
        """Follow the points of every tenth pair `k`, and estimate the rig's error at times."""
        from stixel_cli.calibration.motion_fit import calibrate_rig
        from stixel_cli.calibration.tracks import MOST_STEPS, followed, gathered
        from stixel_cli.recordings.types import Tables

        if k > CALIBRATED[-1]:
            return
        self._lefts.append(left)
        if k % MOST_STEPS == 0:
            if k > 0:
                rows = followed(self._lefts, self._first_disparity, rig)
                self._motions += [(k - MOST_STEPS, *row) for row in rows]
            self._lefts = [left]
            self._first_disparity = disparities.pixels(0) + (
                rig.disparity_errors() - rig.far_disparity
            )
        if k in CALIBRATED:
            nothing = (0.0, 0.0, 0.0)
            exact = replace(rig, disparity_error=nothing, disparity_error_std=nothing)
            tracks = gathered(self._motions)
            self._calibration = calibrate_rig(tracks, (), exact, Tables(), by_motion=True)
            self._rig = self._calibration.rig

    def _followed(self, scan: "Scans", k: int) -> tuple[MovingObject, ...]:
        """The objects that move, after scan `k`."""
        from stixel_cli.measurements.scans import Scans
        from stixel_cli.tracking.contour.class_size import SIZES
        from stixel_cli.tracking.followed import follow_scan
        from stixel_cli.tracking.several import RECENT, are_one, confirmed

        if len(self._scans) == RECENT:
            dropped = len(self._scans.popleft().points_world)
            for one in self._tracks:
                late = (its for its in one.rows.items() if its[0] > k - RECENT)
                one.rows = {its_k: rows - dropped for its_k, rows in late}
        self._scans.append(scan)
        # Scans of the whole way; those before the last ones are empty.
        points = [(np.zeros((0, 2)), np.zeros((0, 2, 2)))] * (k + 1 - len(self._scans))
        points += [(one.points_world, one.covariances_world) for one in self._scans]
        times = self._sample_time * np.arange(k + 1)
        scans = Scans.of_each(times, self._poses, points, scan.field_of_view, scan.shared_errors)
        follow_scan(self._tracks, scans, k, SIZES)
        self._tracks = [one for one in self._tracks if one.is_alive(k + 1)]
        numbered = [one for one in self._tracks if one.number is not None]
        for one in self._tracks:
            if one.number is None and confirmed(scans, one) is not None:
                same = (other.number for other in numbered if are_one(scans, other, one, SIZES))
                one.number = next(chain(same, self._numbers))
                numbered.append(one)
        own = {one.number: one for one in reversed(numbered)}
        self._contours = {number: one for number, one in self._contours.items() if number in own}
        moving = []
        for number, one in sorted(own.items()):
            points, estimate = scans.points_world[one.rows.get(k, [])], self._estimate(scans, one)
            moving.append(MovingObject(number, one.mean, one.covariance, points, estimate))
        return tuple(moving)

    def _estimate(self, scans: "Scans", one: "ClusterTrack") -> "Estimate":
        """Pose, size and contour of a track after the last of the `scans`."""
        from stixel_cli.trackers import Contour
        from stixel_cli.tracking.contour.class_size import SIZES
        from stixel_cli.tracking.followed import ScansStart, state_of

        first = len(scans) - 1
        if one.number not in self._contours:
            # Its scans so far are used now, as it was not clear before that it moves.
            start = ScansStart(**option_values("start", "scans"))
            first = min(one.rows)
            initial = state_of(scans, one, SIZES, start, first)
            self._contours[one.number] = Contour(
                "unknown",
                start=initial,
                start_time=(first - 1) * self._sample_time,
                sensor="stixels",
                field_of_view=scans.field_of_view,
                shared_errors=scans.shared_errors,
            )
        for k in range(first, len(scans)):
            own, tracker = one.rows.get(k, np.zeros(0, np.int64)), self._contours[one.number]
            points, covariances = scans.points_world[own], scans.covariances_world[own]
            estimate = tracker.step(
                points, covariances, scans.sensor_poses_world[k], scans.times[k]
            )
        return estimate

    def _planar(self, pose: np.ndarray | None) -> np.ndarray:
        """The pose (3,) in the world: that of the pair before where none is given."""
        before = self._poses[-1] if len(self._poses) else np.array([0.0, 0.0, STRAIGHT_AHEAD])
        if pose is None:
            return before
        pose = np.asarray(pose, dtype=np.float64)
        if pose.shape not in ((3,), (3, 4)) or not (np.abs(pose) <= FARTHEST).all():
            got = f"got {pose.shape}"
            raise ArgumentError(f"pose: must be (3,) or (3, 4), at most {FARTHEST:g}, {got}")
        if pose.ndim == 1:
            return pose
        turn = pose[:, :3]
        if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-3) or np.linalg.det(turn) < 0.0:
            raise ArgumentError("pose: must have a rotation in its first three columns")
        self._camera = pose if self._camera is None else self._camera
        way = np.stack([self._camera, pose])
        planar = planar_poses(way, self._rig.level_from_camera)[1]
        planar[2] = np.unwrap([before[2], planar[2]])[1]
        return planar
