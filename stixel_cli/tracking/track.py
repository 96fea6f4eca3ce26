"""The initial state and the result of a tracker."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.geometry.pose import STATE, rotations
from stixel_cli.scene.parameters import ROAD_USER_CLASSES

if TYPE_CHECKING:
    import pandas

    from stixel_cli.measurements.scans import Scans

OTHER = "other"
"""The class of a target that is no road user of a known class."""

REPORTED = (*ROAD_USER_CLASSES, OTHER)
"""The classes that a track may have."""


@dataclass(frozen=True)
class InitialState:
    """Initialisation of a tracker: the true pose and rates with noise.

    Attributes:
        mean: (6,) x m, y m, heading rad, and their rates (m/s, m/s, rad/s).
        covariance: (6, 6) of that noise.
    """

    mean: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True)
class Track:
    """Posterior of every scan k (prediction, then update; at an empty scan only a prediction).

    Attributes:
        times: (K,) s.
        means: (K, D) state means; the first six are x m, y m, heading rad and their rates.
        covariances: (K, D, D).
        contours_world: (K, M, 2) m, the estimated contour as a polygon, counter-clockwise.
        contour_std: (K, M) m, standard deviation of the distance from the estimated centre to the
            true contour along the `contour_directions`: of pose and shape together.
        used_offsets: (K + 1,) int64, and
        used_points: (U,) int64: scan k was updated with the rows
            used_points[used_offsets[k]:used_offsets[k + 1]] of the scans' arrays.
        nis: (K,) normalised innovation squared; NaN where no point was used.
        nis_degrees_of_freedom: (K,) int64.
        box_sizes: (K, 2) m, length and width of the target's box, which is centred at x, y and has
            room for its limbs in all poses; None: the box of the contour.
        size_deviations: (K,) how far length or width, the farther one, is from the mean of the
            reported class, in its standard deviations; None if the tracker does not estimate them.
        class_probabilities: class to (K,), its probability given the scans up to k. None if the
            prior's class is reported at all scans, or the tracker does not compare classes.
        class_replaced: (K,) bool, whether another class than the prior's is reported; None if the
            prior's is unknown, or reported at all scans.
        uses_scans: whether the tracker is one that uses points at all.
        lag: number of later scans that the estimates use, 0 for a filter, None for all of the run.
        smoothed: the track whose estimates also use later scans, see `kalman.py`, beside that of
            a filter, whose points, NIS and classes it has; None without.
    """

    times: np.ndarray
    means: np.ndarray
    covariances: np.ndarray
    contours_world: np.ndarray
    contour_std: np.ndarray
    used_offsets: np.ndarray
    used_points: np.ndarray
    nis: np.ndarray
    nis_degrees_of_freedom: np.ndarray
    box_sizes: np.ndarray | None = None
    size_deviations: np.ndarray | None = None
    class_probabilities: dict[str, np.ndarray] | None = None
    class_replaced: np.ndarray | None = None
    uses_scans: bool = True
    lag: int | None = 0
    smoothed: "Track | None" = None

    @property
    def poses(self) -> np.ndarray:
        """(K, 3) x m, y m, heading rad."""
        return self.means[:, :3]

    @property
    def contour_directions(self) -> np.ndarray:
        """(K, M, 2) unit vectors from the centre through the contour's points.

        Where a point is at the centre, its place among even directions over a turn.
        """
        arms = self.contours_world - self.means[:, None, :2]
        lengths = np.linalg.norm(arms, axis=2, keepdims=True)
        _, even = contour_directions(self.means[:, 2], arms.shape[1])
        return np.divide(arms, lengths, out=even, where=lengths > 0.0)

    @property
    def boxes(self) -> np.ndarray:
        """(K, 2) m, length and width: `box_sizes`, or those of the contour along the heading."""
        if self.box_sizes is not None:
            return self.box_sizes
        return np.ptp(self.contours_world @ rotations(self.means[:, 2]), axis=1)

    def to_frame(self) -> "pandas.DataFrame":
        """A table with one row per scan.

        Columns as in a run's `track.csv`, which `tracker=file` reads: `k`, `t` s, pose and rates
        (m, rad, s) with their standard deviations, `length` and `width` m, `points_used`. And
        `normalised_nis`, NaN without a point.
        """
        import pandas

        columns = {"k": np.arange(len(self.times)), "t": self.times}
        table = pandas.DataFrame(columns | state_columns(self.means, self.covariances))
        table[["length", "width"]] = self.boxes
        table["points_used"] = np.diff(self.used_offsets)
        table["normalised_nis"] = self.normalised_nis
        return table

    @property
    def normalised_nis(self) -> np.ndarray:
        """NIS divided by its degrees of freedom (K,): 1 is consistent; NaN without a point."""
        degrees = self.nis_degrees_of_freedom
        return np.divide(self.nis, degrees, out=np.full(len(degrees), np.nan), where=degrees > 0)

    @classmethod
    def of_scans(
        cls,
        times: np.ndarray,
        states: tuple[np.ndarray, np.ndarray],
        contours: tuple[np.ndarray, np.ndarray],
        used: Sequence[np.ndarray],
        nis: np.ndarray,
        nis_degrees_of_freedom: np.ndarray | None = None,
    ) -> "Track":
        """From what a tracker has after its last scan.

        `states` are means and covariances, `contours` the contours and their standard deviations;
        both and `times`, `nis` are as the attributes. `used` has, for each scan, the
        rows (n_k,) that updated it. Without `nis_degrees_of_freedom`, each such row has one.
        """
        offsets, rows = used_rows(used)
        degrees = nis_degrees_of_freedom
        degrees = np.diff(offsets) if degrees is None else degrees
        return cls(np.array(times, float), *states, *contours, offsets, rows, nis, degrees)

    def of_points(self, rows: np.ndarray) -> "Track":
        """The track as one of scans whose points at `rows` (P,) were given to the tracker."""
        smoothed = self.smoothed and self.smoothed.of_points(rows)
        return replace(self, used_points=rows[self.used_points], smoothed=smoothed)


@dataclass(frozen=True)
class ObjectTrack:
    """The track of one road user.

    Attributes:
        first: the first of its scans.
        confirmed: the scan up to which its cluster was followed until it was clear that it moves.
        track: from the first scan to its last. `used_points` are rows of all scans' arrays.
    """

    first: int
    confirmed: int
    track: Track


def state_columns(means: np.ndarray, covariances: np.ndarray) -> dict[str, np.ndarray]:
    """The `STATE` and its std_… as columns, from means (K, 6 or more) and their covariances."""
    std = np.sqrt(np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 0.0))
    columns = {name: means[:, i] for i, name in enumerate(STATE)}
    return columns | {f"std_{name}": std[:, i] for i, name in enumerate(STATE)}


def used_rows(used: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """`used_offsets` (K + 1,) and `used_points` (U,) of a `Track`.

    `used` has, for each of K scans, the rows (n_k,) of the scans' arrays that updated it.
    """
    offsets = np.cumsum([0, *(len(rows) for rows in used)], dtype=np.int64)
    return offsets, np.concatenate([np.zeros(0, np.int64), *used]).astype(np.int64)


def contour_directions(headings: np.ndarray, points: int = 120) -> tuple[np.ndarray, np.ndarray]:
    """Where a reported contour has its points, seen from the centre.

    Angles (M,) rad from the heading on, even over a full turn, M = `points`, of which no estimate
    depends; and unit vectors (K, M, 2) in the world that lead there at the `headings` (K,) rad.
    """
    angles = 2.0 * np.pi * np.arange(points) / points
    bearings = headings[:, None] + angles
    return angles, np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)


def shift_variances(directions: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """Variances (K, M) m² of how far a contour is in `directions` (K, M, 2), by its centre's error.

    One that is shifted by d is farther away by pᵀ d in the direction p. `covariances` are
    (K, D, D), of the centre first.
    """
    return np.einsum("kmi,kij,kmj->km", directions, covariances[:, :2, :2], directions)


def with_sensor_errors(track: Track, scans: "Scans") -> Track:
    """The `track` of where the sensor shows the target, as uncertain as what all scans share.

    No scan shows an error of the sensor that stays: it moves the target as it moves its points.
    """
    if not scans.shared_errors.count:
        return track
    moved = np.zeros((*track.means.shape, scans.shared_errors.count))
    for k, mean in enumerate(track.means):
        moved[k, :3] = scans.pose_shifts(k, mean[:3])
    steps = np.diff(track.times)[:, None, None]
    np.divide(np.diff(moved[:, :3], axis=0), steps, out=moved[1:, 3:6], where=steps > 0.0)
    smoothed = track.smoothed and with_sensor_errors(track.smoothed, scans)
    return replace(widened(track, moved @ moved.transpose(0, 2, 1)), smoothed=smoothed)


def widened(track: Track, added: np.ndarray) -> Track:
    """The `track` with `added` (K, D, D) covariances, of the centre for the contour."""
    variances = track.contour_std**2 + shift_variances(track.contour_directions, added)
    covariances = track.covariances + added
    return replace(track, covariances=covariances, contour_std=np.sqrt(variances))


def check_finite(track: Track, name: str = "the tracker") -> None:
    """Raise ValueError, which names the first scan, if an estimate of `name` is not finite."""
    for field in ("times", "means", "covariances", "contours_world"):
        values = np.asarray(getattr(track, field))
        wrong = np.flatnonzero(~np.isfinite(values).reshape(len(values), -1).all(axis=1))
        if len(wrong):
            raise ValueError(f"{name}: {field} of its track are not finite at scan {wrong[0]}")
