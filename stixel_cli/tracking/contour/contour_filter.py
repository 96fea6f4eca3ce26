"""An extended Kalman filter on pose and size that casts the scan's rays on the class's shape.

State: x, y, heading psi, speed v along the heading, turn rate omega, and the logarithms of the
factors on the class's length and width; world frame, m, rad, s. The residual of the outline
follows (`residual.py`). The heading is tied to the velocity, as a road user does not slide
sideways: x' = v cos psi, y' = v sin psi, psi' = omega (Bar-Shalom, Li & Kirubarajan 2001, 11.7).

A point is the range r along its ray, whose direction is known well. The measurement is

    r = h(state, ray) + error

where h casts the ray on the shape that the sensor sees (`ray_table.py`). Its Jacobian is a central
difference over about a standard deviation of the state, as the shape has edges. The error has the
sensor's variance and that of the shape, as no road user has quite the class's shape.

The first and the last ray that meet the target give two more measurements, the silhouette: how far
inside the limits of the visible shape they pass. Ranges hardly measure the place across the rays.
A silhouette at the border of the field of view, or beside a nearer object, is not used. Every ray
with a point of the target should meet it: how far it passes by the visible shape is measured as 0.

Neighbours and successive scans share the shape's error, so n points are not n independent ones.
Large factors on the variances account for that in the gain. How certain the estimate is with this
gain follows from the errors themselves: the sensor's own, and what a target's faces are off at the
heights of its points, which is considered, not estimated, see `consider.py`. What scans share of
the shape's error is the residual; of the sensor's, see `with_sensor_errors`.

Errors have heavy tails, so their variances are divided by the weights (nu + 1) / (nu + e²) ≤ 1 of a
Student distribution, e the normalised error at the current iterate (Lange, Little, Taylor 1989,
*Robust statistical modeling using the t distribution*). The update is iterated (Bell, Cathey 1993,
*The iterated Kalman filter update as a Gauss-Newton method*).
"""

from dataclasses import replace

import numpy as np

from stixel_cli.scene.parameters import CLASS_ROWS, ClassRow
from stixel_cli.tracking.association import GATE_STDS
from stixel_cli.tracking.consider import JointCovariance
from stixel_cli.tracking.contour.class_shape import ClassShape
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.contour.contour_rays import Rays, Sight, associate, at_heights
from stixel_cli.tracking.contour.contour_recovery import (
    RECENT,
    clusters_of,
    detect_again,
    is_inconsistent,
    rivals,
    turned,
)
from stixel_cli.tracking.contour.contour_report import SIDEWAYS, box_size, contour_of, reported
from stixel_cli.tracking.contour.contour_update import SEEN, Hypothesis, Measurement
from stixel_cli.tracking.contour.residual import NODES, RESIDUAL_STD
from stixel_cli.tracking.motion import tied_to_velocity
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import OTHER, InitialState, Track

SIZE_TIME = 10.0
"""s in which the size goes back to the prior's by 63 %."""


class ClassFilter:
    """The filter of a target of one class: predict, associate, update at each scan.

    The state starts as `initial`, with the size of the class's `prior`. So many `face_errors` of
    the target at its points' heights are considered, see `at_heights`. Reads no truth. It keeps its
    state between scans, as the filters of all classes take the same scan before the next.

    Attributes:
        log_weight: of the class after the last scan, see `contour.py`; None before the first.
        size_deviation: of the size from the class's then, in its standard deviations.
    """

    def __init__(
        self,
        initial: InitialState,
        prior: PriorShape,
        shape: ClassShape,
        sight: Sight,
        tracker: ContourParameters,
        face_errors: int,
    ):
        self._tracker, self._road_user = tracker, prior.road_user
        self._shape, self.sight = shape, sight
        of_class = np.log(np.array([prior.length, prior.width]) / self._shape.size)
        self._size = of_class, np.array([prior.length_std, prior.width_std])
        mean, covariance = start(initial, *self._size)
        joint = JointCovariance(covariance, face_errors)
        self._hypotheses = [Hypothesis((mean, covariance, joint))]
        self._start = np.zeros_like(covariance)
        self._start[:5, :5] = covariance[:5, :5]
        self._ratios: list[float] = []
        self._without_points = RECENT
        self.log_weight: float | None = None
        self.size_deviation = 0.0

    @property
    def best(self) -> Hypothesis:
        """The likeliest after the last scan."""
        return self._hypotheses[0]

    @property
    def unseen(self) -> bool:
        """Whether none of the last scans, or no scan yet, had points of the target."""
        return self._without_points >= RECENT

    def expected(self, interval: float) -> tuple[np.ndarray, float]:
        """Place (2,) m an `interval` in s later, and how far from there the target may reach, m."""
        mean, covariance, _ = self.best.state
        later, matrix, noise = predict(mean, interval, self._tracker, *self._size)
        variances = np.diag(matrix @ covariance @ matrix.T + noise)[:2]
        half = 0.5 * float(np.hypot(*(self.sight.table.extents * np.exp(mean[5:7]))))
        return later[:2], half + GATE_STDS * np.sqrt(max(variances.sum(), 0.0))

    def step(self, interval: float, rays: Rays) -> np.ndarray:
        """The next scan, an `interval` in s after the one before, with the `rays` of its points.

        The result (n,) are indices of the points that were used.
        """
        first = self.unseen
        steps = rivals([self._advanced(one, interval, rays) for one in self._hypotheses])
        best = steps[0]
        if best.degrees:
            contradicted = is_inconsistent([*self._ratios, best.nis / best.degrees])
            if first or (len(steps) == 1 and contradicted):
                # A turned or shifted target may be an error that only later scans contradict.
                steps = rivals([*self._detected(best, rays, first), *([] if first else steps)])
                best = steps[0]
        mean, covariance, _ = best.state
        fastest = mean[3] + 2.0 * np.sqrt(covariance[3, 3])
        if fastest < -class_row(self._road_user).reverse_speed:
            best = replace(best, state=turned(*best.state), transition=None)
            steps, mean = [best], best.state[0]
        self._hypotheses = steps
        if best.degrees:
            self._ratios.append(best.nis / best.degrees)
        self._without_points = 0 if best.degrees else self._without_points + 1
        self.size_deviation = float(np.abs((mean[5:7] - self._size[0]) / self._size[1]).max())
        self.log_weight = log_weight(
            best.log_likelihood, self.size_deviation, mean[3], best.stated[3, 3], self._road_user
        )
        return best.indices

    def _advanced(self, one: Hypothesis, interval: float, rays: Rays) -> Hypothesis:
        """The hypothesis an `interval` in s later, updated with the points that it associates."""
        mean, covariance, joint = one.state
        mean, matrix, noise = predict(mean, interval, self._tracker, *self._size)
        covariance, joint = matrix @ covariance @ matrix.T + noise, joint.copy()
        joint.predict(matrix, noise)
        prediction = mean, covariance, joint
        rays = self._at_heights(rays, mean)
        indices = associate(rays, mean[SEEN], covariance[np.ix_(SEEN, SEEN)], self.sight)
        # Only smoothing looks back; a filter without it keeps no chain of all its scans.
        before = None if self._tracker.lag == 0 else one
        prior = Hypothesis(
            prediction, one.log_likelihood, sums=one.sums, before=before, transition=matrix
        )
        if not len(indices):
            return prior
        return Measurement(rays, indices, self.sight, self._tracker).update(prior)

    def _at_heights(self, rays: Rays, mean: np.ndarray) -> Rays:
        sight, of_class = self.sight, self._road_user != OTHER
        return at_heights(rays, mean[SEEN], sight.table, sight.height_insets, of_class)

    def _detected(self, one: Hypothesis, rays: Rays, first: bool) -> list[Hypothesis]:
        """Hypotheses with the likely places of the target, see `detect_again`.

        `first`: at the first scan with points, or the first after a gap.
        """
        after_gap = first and self.log_weight is not None
        prior, sight = replace(one.prior, transition=None), self.sight
        mean, covariance, joint = prior.state
        if not first:
            # A state that the scans contradict may be as wrong as the start, too.
            covariance, joint = covariance + self._start, joint.copy()
            joint.matrix[: len(mean), : len(mean)] += self._start
            prior = replace(prior, state=(mean, covariance, joint))
        rays = self._at_heights(rays, mean)
        clusters = clusters_of(rays, one.indices, sight, after_gap)
        return detect_again(prior, rays, clusters, sight, self._tracker)

    @property
    def reported(self) -> np.ndarray:
        """State (8,) after the last scan, as a track has it."""
        mean, covariance, _ = self.best.state
        return reported(mean, covariance, self.sight.residual)[0]

    def report(self) -> Track:
        """The track of the last scan alone, at time 0.

        The states are x, y, heading, their rates, and the two logarithms of size; the velocity is
        along the heading. A scan with n points has n degrees of freedom, and one for each
        silhouette that is used. `contour_std` is that of the reported contour along the ray from
        the estimated centre: pose, size and shape together.
        """
        best = self.best
        return Track(
            np.zeros(1),
            **self.described(best.state[0], best.stated),
            used_offsets=np.array([0, len(best.indices)]),
            used_points=best.indices,
            nis=np.array([best.nis]),
            nis_degrees_of_freedom=np.array([best.degrees]),
            size_deviations=np.array([self.size_deviation]),
        )

    def described(self, mean: np.ndarray, covariance: np.ndarray) -> dict[str, np.ndarray]:
        """What a track of one scan has of a state with `mean` (d,) and `covariance` (d, d)."""
        shape, residual = self._shape, self.sight.residual
        state, spread = reported(mean, covariance, residual)
        contour, stds = contour_of(mean, covariance, shape, self._tracker.contour_points, residual)
        return {
            "means": state[None],
            "covariances": spread[None],
            "contours_world": contour[None],
            "contour_std": stds[None],
            "box_sizes": box_size(mean, shape, residual)[None],
        }


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
    """Log weight of a class, see `contour.py`: d, v in m/s and V; -1e9 if it is not finite."""
    variance = class_row(road_user).speed ** 2 + speed_variance
    weight = sum_of_log_likelihoods - 0.5 * (
        size_deviation**2 + speed**2 / variance + np.log(variance)
    )
    return weight if np.isfinite(weight) else -1e9


def start(
    initial: InitialState, size: np.ndarray, size_stds: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (d,) and covariance (d, d) from an initial state and the class's `size` (2,).

    Its logarithms, with their standard deviations (2,). The residual is zero. The velocity is tied
    to the heading.
    """
    mean, covariance, *_ = tied_to_velocity(initial.mean, initial.covariance, SIDEWAYS)
    matrix = np.eye(6)[[0, 1, 2, 3, 5]]
    matrix[3, 3:5] = np.cos(mean[2]), np.sin(mean[2])
    whole, spread = np.zeros(7 + NODES), np.diag([0.0] * 7 + [RESIDUAL_STD**2] * NODES)
    whole[:5], whole[5:7] = matrix @ mean, size
    spread[:5, :5] = matrix @ covariance @ matrix.T
    spread[5, 5], spread[6, 6] = size_stds**2
    return whole, spread


def predict(
    mean: np.ndarray,
    interval: float,
    tracker: ContourParameters,
    size: np.ndarray,
    size_stds: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean (d,) one `interval` in s later, its Jacobian (d, d) and the process noise (d, d).

    A turn: the displacement has the heading of the middle of the interval. The logarithms of size
    go back to the class's `size` (2,) with its standard deviations (2,), as an AR(1) process: the
    errors of a shape have the same sign in all scans, and without this the size follows them. Of a
    car that is followed, only the rear is seen; its roundness then counted as its length.
    """
    middle = mean[2] + 0.5 * mean[4] * interval
    forward = interval * np.array([np.cos(middle), np.sin(middle)])
    left = mean[3] * np.array([-forward[1], forward[0]])
    matrix, keep = np.eye(len(mean)), np.exp(-interval / SIZE_TIME)
    matrix[:2, 2], matrix[:2, 3], matrix[:2, 4] = left, forward, 0.5 * interval * left
    matrix[2, 4], matrix[5, 5], matrix[6, 6] = interval, keep, keep
    later = mean.copy()
    later[:2] += mean[3] * forward
    later[2] += mean[4] * interval
    later[5:7] = size + keep * (mean[5:7] - size)
    noise = np.zeros((len(mean), len(mean)))
    noise[0, 0] = noise[1, 1] = tracker.slip**2 * interval
    noise[2, 2] = tracker.turn_acceleration**2 * interval**3 / 3.0
    noise[2, 4] = noise[4, 2] = tracker.turn_acceleration**2 * interval**2 / 2.0
    noise[4, 4] = tracker.turn_acceleration**2 * interval
    noise[3, 3] = tracker.acceleration**2 * interval
    noise[5, 5], noise[6, 6] = (1.0 - keep**2) * size_stds**2
    return later, matrix, noise
