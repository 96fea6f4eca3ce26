"""Numba kernels that return what they write."""

from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np


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
