"""The box of a label, seen from above."""

import numpy as np


def rectangle(length: float, width: float) -> np.ndarray:
    """Corners (4, 2) m of a rectangle about the origin, counter-clockwise, x along its length."""
    return 0.5 * np.array([[length, width], [-length, width], [-length, -width], [length, -width]])
