"""The extension of a random matrix: its update by the points of one scan.

M. Feldmann, D. Fränken, W. Koch 2011, *Tracking of extended objects and group targets using random
matrices*, IEEE Transactions on Signal Processing 59(4), with symmetric roots.
"""

import numpy as np


def update_extension(
    extension: np.ndarray,
    weight: float,
    innovation: tuple[np.ndarray, np.ndarray],
    offsets: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """X⁺ (2, 2) m² from n points; it counts as alpha + n of them.

    `extension` X and its `weight` alpha are the predicted ones. `innovation` is the measured centre
    minus the predicted one (2,) m, and its covariance S (2, 2) m². `offsets` are the points minus
    the measured centre (n, 2) m, and the expected covariance Y (2, 2) m² of each.
    """
    moved = _whitening(extension, innovation[1]) @ innovation[0]
    spread = offsets[0] @ _whitening(extension, offsets[1]).T
    total = weight + len(spread)
    return (weight * extension + np.outer(moved, moved) + spread.T @ spread) / total


def _whitening(extension: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """X^½ C^-½ (2, 2) with symmetric roots of the `extension` X and the `covariance` C."""
    roots, axes = np.linalg.eigh(np.stack([extension, covariance]))
    powers = np.sqrt(roots) ** np.array([[1.0], [-1.0]])
    first, second = (axes * powers[:, None, :]) @ np.swapaxes(axes, 1, 2)
    return first @ second
