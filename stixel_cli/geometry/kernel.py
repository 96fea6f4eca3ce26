"""Numba kernels that return what they write, and the one of rays that meet a polygon."""

from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np
from numba import njit


def returning(make: Callable[..., np.ndarray | tuple[np.ndarray, ...]]) -> Callable[..., Any]:
    """Decorate a kernel that writes its first arguments: callers give the others, get the first.

    `make` gets the others too, and makes the first ones: the result, and perhaps working memory. It
    is not compiled: Numba would compile allocations for seconds.
    """

    def decorated(kernel: Any) -> Callable[..., np.ndarray]:
        @wraps(kernel.py_func)
        def call(*given: Any) -> np.ndarray:
            made = make(*given)
            arrays = made if isinstance(made, tuple) else (made,)
            kernel(*arrays, *given)
            return arrays[0]

        call.kernel = kernel
        return call

    return decorated


@returning(lambda polygon, origins, directions: np.full(len(directions), np.inf))
@njit(cache=True, error_model="numpy")
def first_hits(ranges, polygon, origins, directions):
    """Ranges (n,) m at which rays first enter a polygon (M, 2) m, counter-clockwise; inf if never.

    `origins` (n, 2) m; `directions` (n, 2) unit vectors. A ray along an edge meets it at its nearer
    end.
    """
    corners = len(polygon)
    for i in range(len(ranges)):
        dx, dy, ox, oy = directions[i, 0], directions[i, 1], origins[i, 0], origins[i, 1]
        x, y = polygon[corners - 1, 0] - ox, polygon[corners - 1, 1] - oy
        before, along = dx * y - dy * x, dx * x + dy * y
        for c in range(corners):
            x, y = polygon[c, 0] - ox, polygon[c, 1] - oy
            here, ahead = dx * y - dy * x, dx * x + dy * y
            # An edge that faces the ray's origin runs from its left to its right.
            if before >= 0.0 >= here and before > here:
                met = along + before / (before - here) * (ahead - along)
                if 0.0 < met < ranges[i]:
                    ranges[i] = met
            before, along = here, ahead
