"""Which class the points are of: one tracker for each class, weighed by likelihood.

The classes are equally probable at first. After the scans up to k, the log weight of a class is

    1/T sum of log likelihoods  -  d²/2  -  v²/2s² - log s

The likelihood is that of the measurements that the class's tracker used, points and silhouettes, in
1/m each. The classes gate different points, so each measurement is compared with clutter, whose
density is 1/m: a class that leaves out a point pays for it as if it were clutter, and points that
no class uses cancel. With clutter that is rarer, points of other objects next to a pedestrian make
a car of it on lidar (tuning seeds; on stixels the density changes nothing from 0.1 to 1/m). The
errors of successive scans are correlated, so T scans count as one. Size and speed are facts of the
state, not of a scan, so they count once: d is how far the estimated length or width is from the
mean of the class, in its standard deviations; v is the speed and s how fast the class moves. Seen
from the front, little but the speed separates cyclists from pedestrians.
"""

from collections.abc import Mapping
from dataclasses import fields, replace

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.class_size import ClassSize
from stixel_cli.tracking.track import InitialState, Track, used_rows

CORRELATED_SCANS = 10.0
"""T: so many scans count as one, a second of them at most of our sample times."""

SPEEDS = {"car": 12.0, "cyclist": 5.0, "pedestrian": 1.2}
"""s: a class's root mean square speed, m/s."""

CONTRADICTED = 3.3
"""The scans contradict a class once the size or speed is so many standard deviations off.

Right classes stay below, on stixels and lidar. Other classes' likelihoods do not count: a larger
gate takes points of other objects, which a lidar sees next to a pedestrian.
"""

GREATEST_NIS = {3: 1.0, 10: 0.6}
"""Number of successive scans with points: greatest ratio of their NIS to its degrees of freedom.

Above one of them the scans contradict the class, too. The shape's noise is large: right classes
have at most 0.5 over ten scans, but one run of 72 of cyclists, with 0.62: its class stays the most
probable. Others have up to 1.5 (tuning seeds, stixels and lidar). NIS and degrees
of freedom are summed before the division: scans with few points, as after a start that is far off,
then count less.
"""


def log_weights(track: Track, road_user: str) -> np.ndarray:
    """Log weight (K,) of a class whose tracker reports `track`; one that is not finite is -1e9.

    Raises:
        ValueError: if the track has no likelihoods or sizes.
    """
    if track.log_likelihoods is None or track.size_deviations is None:
        raise ValueError("a bank of classes needs a tracker of log likelihoods and sizes")
    of_state = track.size_deviations**2 + speed_deviations(track, road_user) ** 2
    weights = (
        np.cumsum(track.log_likelihoods) / CORRELATED_SCANS
        - 0.5 * of_state
        - np.log(SPEEDS[road_user])
    )
    return np.where(np.isfinite(weights), weights, -1e9)


def speed_deviations(track: Track, road_user: str) -> np.ndarray:
    """The speeds (K,) of a track in those of the class."""
    return np.hypot(track.means[:, 3], track.means[:, 4]) / SPEEDS[road_user]


def probabilities_of(tracks: Mapping[str, Track], scans: int) -> dict[str, np.ndarray]:
    """Class to probability (K,), given the scans up to k, of the first K = `scans` scans."""
    weights = np.stack([log_weights(track, name)[:scans] for name, track in tracks.items()])
    odds = np.exp(weights - weights.max(axis=0))
    return dict(zip(tracks, odds / odds.sum(axis=0), strict=True))


def contradicted(own: Track, road_user: str) -> np.ndarray:
    """Whether the scans up to k contradict the class that the tracker had, (K,)."""
    # Until the speed is measured it is that of the start, which may be the sensor's.
    stds = np.sqrt(np.linalg.eigvalsh(own.covariances[:, 3:5, 3:5])[:, -1])
    speeds = np.where(stds < SPEEDS[road_user], speed_deviations(own, road_user), 0.0)
    beyond = np.maximum(own.size_deviations, speeds) > CONTRADICTED
    known = np.flatnonzero(np.isfinite(own.nis))
    for count, greatest in GREATEST_NIS.items():
        if len(known) >= count:
            nis, degrees = (
                np.convolve(values[known], np.ones(count), mode="valid")
                for values in (own.nis, own.nis_degrees_of_freedom)
            )
            beyond[known[count - 1 :]] |= nis > greatest * degrees
    return np.logical_or.accumulate(beyond)


def most_probable(tracks: Mapping[str, Track], class_of_prior: str | None) -> Track:
    """The track that is, at each scan, that of the most probable class given the scans up to it.

    Args:
        tracks: of the same scans, by class.
        class_of_prior: reported until the scans contradict it; None: unknown. The sizes' deviations
            are then from this class.
    """
    names = list(tracks)
    count = len(tracks[names[0]].times)
    probabilities = probabilities_of(tracks, count)
    best = np.argmax(list(probabilities.values()), axis=0)
    if class_of_prior is not None:
        own = tracks[class_of_prior]
        best[~contradicted(own, class_of_prior)] = names.index(class_of_prior)
        if (best == names.index(class_of_prior)).all():
            return own
    every = [tracks[name] for name in names]
    scans = np.arange(count)
    values = {
        field.name: np.stack([getattr(track, field.name) for track in every])[best, scans]
        for field in fields(Track)
        if field.name not in SHARED
    }
    if class_of_prior is not None:
        values["size_deviations"] = own.size_deviations
    offsets, rows = used_rows(
        [every[i].used_points[slice(*every[i].used_offsets[k : k + 2])] for k, i in enumerate(best)]
    )
    return replace(
        every[0],
        **values,
        used_offsets=offsets,
        used_points=rows,
        class_probabilities=probabilities,
        class_replaced=None if class_of_prior is None else best != names.index(class_of_prior),
    )


SHARED = (
    "used_offsets",
    "used_points",
    "class_probabilities",
    "class_replaced",
    "uses_scans",
)
"""Fields of a track without one row for each scan."""


def start_of_other(initial: InitialState, size: np.ndarray, other: ClassSize) -> InitialState:
    """A start that was made with the `size` (2,) m of one class, for another class.

    The sides that were seen may be those of either class, so the place is uncertain by half of the
    differences in length and width.
    """
    heading = initial.mean[2]
    turn = rotation(heading)
    covariance = initial.covariance.copy()
    covariance[:2, :2] += turn @ np.diag((0.5 * (size - other.mean)) ** 2) @ turn.T
    return InitialState(initial.mean, covariance)
