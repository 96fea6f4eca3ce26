"""Functions of arrays whose results are remembered."""

from collections.abc import Callable
from functools import cache, wraps

import numpy as np


def remembered(function: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    """The function, which computes each result once; a caller may write to what it gets."""

    @cache
    def result(*arrays: tuple[bytes, tuple[int, ...], str]) -> np.ndarray:
        return function(
            *(np.frombuffer(data, form).reshape(shape).copy() for data, shape, form in arrays)
        )

    @wraps(function)
    def of_arrays(*arrays: np.ndarray) -> np.ndarray:
        return result(*((one.tobytes(), one.shape, one.dtype.str) for one in arrays)).copy()

    return of_arrays
