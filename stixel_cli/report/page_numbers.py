"""Numbers of the playback page: whole millimetres and the like, None for what is not finite."""

import numpy as np

FARTHEST = 1e7  # m; the page omits farther points


def ellipses(covariances: np.ndarray) -> list[int | None]:
    """Semi-axes (mm) and angle (1e-3 rad) of each 1σ ellipse, in one list."""
    a, b, c = covariances[:, 0, 0], covariances[:, 0, 1], covariances[:, 1, 1]
    # The eigenvalues of a symmetric 2 × 2 matrix in closed form.
    mean, spread = 0.5 * (a + c), np.hypot(0.5 * (a - c), b)
    with np.errstate(invalid="ignore"):
        axes = np.sqrt(np.maximum(np.stack([mean + spread, mean - spread]), 0.0))
    angle = 0.5 * np.arctan2(2.0 * b, a - c)
    values = 1000.0 * np.stack([*axes, angle], axis=1).ravel()
    known = np.abs(values) < 1e3 * FARTHEST
    whole = np.rint(np.where(known, values, 0.0)).astype(np.int64).tolist()
    return whole if known.all() else [w if k else None for w, k in zip(whole, known, strict=True)]


def rounded_poses(poses: np.ndarray) -> list[list[int] | None]:
    """x, y (mm) and heading (1e-4 rad) of poses (K, 3 or more)."""
    return [_integers(pose[:3] * (1e3, 1e3, 1e4)) for pose in poses]


def millimetres(values: np.ndarray) -> list[int] | None:
    """Lengths in m as whole millimetres; None if one is not finite or too large."""
    return _integers(1000.0 * values)


def _integers(values: np.ndarray) -> list[int] | None:
    """The values rounded to integers; None if one is not finite or too large."""
    if not (np.abs(values) < 1e3 * FARTHEST).all():
        return None
    return np.rint(values).astype(np.int64).tolist()


def numbers(values: np.ndarray, digits: int) -> list[float | None]:
    """The values, rounded to `digits`; None for one that is not finite."""
    return [round(v, digits) if np.isfinite(v) else None for v in np.asarray(values).tolist()]
