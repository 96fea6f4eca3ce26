"""Loops of `one_side.py`, over points and over the corners of a contour: Numba kernels."""

from math import cos, hypot, inf, sin, sqrt

import numpy as np
from numba import njit

from stixel_cli.geometry.kernel import returning

REACH, REACH_BESIDE = 0.5, 0.3
"""A point this near the contour, m, is the target's: of the segment of neighbouring rays on which
the contour was placed, and of other segments. Inside the contour it may be twice as far."""

PLACING_STD, TAIL = 0.1, 0.3
"""Of a point, m, to place the contour on a segment: standard deviation, scale of its heavy tail."""


@returning(
    lambda labels, *_: (
        np.zeros(len(labels), bool),
        np.zeros(labels.max(initial=0) + 1),
        np.zeros((6, 3)),
    )
)
@njit(cache=True, error_model="numpy")
def fitting(fits, weights, work, labels, slopes, residuals, covariance):
    """Which points (n,) fit a contour that is placed on the segment with most points near it.

    `labels` (n,) are those of the segments, `residuals` (n,) m are outside of the contour, `slopes`
    (n, 3) minus their derivatives by its pose, of which the `covariance` (3 or more, …) is that
    before. The fit is robust: twice, with the noise of a Cauchy distribution at the last residuals.
    """
    step, found, spread, posterior = work[0], work[1], work[2], work[3:]
    main = 0
    for i in range(len(labels)):
        weights[labels[i]] += 1.0 / (1.0 + (residuals[i] / TAIL) ** 2)
        if weights[labels[i]] > weights[main]:
            main = labels[i]
    for _ in range(2):
        posterior[:], found[:] = covariance[:3, :3], 0.0
        for i in range(len(labels)):
            if labels[i] == main:
                left, innovation = residuals[i], residuals[i]
                for j in range(3):
                    left -= slopes[i, j] * step[j]
                    innovation -= slopes[i, j] * found[j]
                variance = PLACING_STD**2 * (1.0 + (left / TAIL) ** 2)
                variance += _variance(posterior, slopes[i], spread)
                for j in range(3):
                    pull = spread[j] / variance
                    found[j] += pull * innovation
                    for k in range(3):
                        posterior[j, k] -= pull * spread[k]
        step[:] = found
    for i in range(len(labels)):
        left, reach = residuals[i], REACH_BESIDE
        for j in range(3):
            left -= slopes[i, j] * step[j]
        if labels[i] == main:
            reach = REACH + sqrt(_variance(posterior, slopes[i], spread))
        fits[i] = -2.0 * reach < left < reach


@njit(cache=True)
def _variance(covariance, slope, spread):
    """Of a scalar with this `slope` (3,); its covariance with the pose goes to `spread` (3,)."""
    variance = 0.0
    for j in range(3):
        spread[j] = 0.0
        for k in range(3):
            spread[j] += covariance[j, k] * slope[k]
        variance += slope[j] * spread[j]
    return variance


@njit(cache=True, error_model="numpy")
def apart(row, mean, basis_directions, sensor, directions, ends, seen):
    """How far the contour's ends are right of the `ends` (2,) of the rays `directions` (n, 2), m.

    Mean of those that are `seen` (2,), across the rays' mean direction. Adds its derivative by the
    state `mean` (6 + N,) to the `row` (6 + N,).
    """
    x, y, far = 0.0, 0.0, 0.0
    for i in range(len(directions)):
        x, y = x + directions[i, 0], y + directions[i, 1]
    x, y = x / hypot(x, y), y / hypot(x, y)
    cosine, sine, share = cos(mean[2]), sin(mean[2]), 1.0 / (seen[0] + seen[1])
    for e in range(2):
        if not seen[e]:
            continue
        farthest, corner, depth = -inf, 0, 0.0
        for c in range(len(basis_directions)):
            u, v = basis_directions[c]
            radius = max(mean[6 + c], 0.0)
            dx = mean[0] - sensor[0] + radius * (cosine * u - sine * v)
            dy = mean[1] - sensor[1] + radius * (sine * u + cosine * v)
            place = (x * dy - y * dx) / (x * dx + y * dy) * (2 * e - 1)
            if place > farthest:
                farthest, corner, depth = place, c, x * dx + y * dy
        place, u, v = farthest * (2 * e - 1), directions[ends[e], 0], directions[ends[e], 1]
        far += share * ((x * v - y * u) / (x * u + y * v) - place) * depth
        # What moves an end by 1 m: across its ray, which is not quite across the others.
        across_x, across_y = share * (-y - place * x), share * (x - place * y)
        u, v = basis_directions[corner]
        u, v = cosine * u - sine * v, sine * u + cosine * v
        row[0] += across_x
        row[1] += across_y
        row[2] += max(mean[6 + corner], 0.0) * (u * across_y - v * across_x)
        row[6 + corner] += u * across_x + v * across_y
    return far
