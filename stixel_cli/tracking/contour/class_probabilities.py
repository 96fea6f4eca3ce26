"""Which class the points are of: one filter for each class, weighted by likelihood.

The classes are equally probable at first. After the scans up to k, the log weight of a class is

    sum of log likelihoods  -  d²/2  -  v²/2(s² + V)  -  log(s² + V)/2

The likelihood is that of the measurements that the class's filter used, points and silhouettes, in
1/m each. The classes gate different points, so each measurement is compared with clutter that is
even over the gate of the point (`gate_widths`), and has a density of 1/m at an end: a class that
leaves out a point pays for it as if it were clutter, and points that no class uses cancel. At one
density for all, the far points of a car, uncertain by 1 m, are less likely than clutter, and its
front becomes a pedestrian. Size and speed are facts of the state, not of a scan, so they count
once: d is how far the estimated length or width is from the mean of the class, in its standard
deviations; v is the speed, V its variance, and s how fast the class moves. Seen from the front,
little but the speed separates cyclists from pedestrians. A start with the sensor's motion has a
speed that says nothing yet: V is large.
"""

from collections.abc import Mapping

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.scene.parameters import CLASS_ROWS, ClassRow
from stixel_cli.tracking.contour.class_size import ClassSize
from stixel_cli.tracking.track import REPORTED, InitialState

CONTRADICTED = 50.0
"""The scans contradict the prior's class once the log odds of another are above this. Any other
class is dropped at twice as much: in 108 runs with a wrong one, the right one was never below -68.

The errors of successive scans are alike, so a wrong class may be more likely for some scans: at the
odds of 100 : 1 that was so in one of 45 runs of tuning seeds, a cyclist seen from its front.
"""


def class_row(road_user: str) -> ClassRow:
    """The row of a class; that of a car for one that the user's file gives, and for no class."""
    return CLASS_ROWS.get(road_user, CLASS_ROWS["car"])


def log_weight(
    sum_of_log_likelihoods: float,
    size_deviation: float,
    speed: float,
    speed_variance: float,
    road_user: str,
) -> float:
    """Log weight of a class, see above; -1e9 if it is not finite.

    Args:
        sum_of_log_likelihoods: over the scans.
        size_deviation: d.
        speed, speed_variance: v in m/s and V.
        road_user: the class.
    """
    variance = class_row(road_user).speed ** 2 + speed_variance
    weight = sum_of_log_likelihoods - 0.5 * (
        size_deviation**2 + speed**2 / variance + np.log(variance)
    )
    return weight if np.isfinite(weight) else -1e9


def probabilities_of(log_weights: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What is reported to probability (K,), given the scans up to k; 0 without a weight."""
    weights = np.stack(list(log_weights.values()))
    odds = np.exp(weights - weights.max(axis=0))
    excluded = dict.fromkeys(REPORTED, np.zeros(weights.shape[1]))
    return excluded | dict(zip(log_weights, odds / odds.sum(axis=0), strict=True))


def reported_class(log_weights: Mapping[str, float], assumed: str | None) -> str:
    """The most probable class; but that which is `assumed`, until the scans contradict it."""
    best = max(log_weights, key=log_weights.__getitem__)
    if assumed is None or log_weights[best] - log_weights[assumed] > CONTRADICTED:
        return best
    return assumed


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
