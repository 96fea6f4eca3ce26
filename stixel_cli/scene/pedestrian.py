"""A walking person: legs in stride, torso, swinging arms, head.

Modelled at about 0.6 × 0.36 × 1.75 m, x forward, y left, z up; the caller fits it to its size.
"""

import numpy as np
from numpy.typing import ArrayLike

from stixel_cli.scene.mesh import Mesh
from stixel_cli.scene.shapes import ellipsoid, loft, part, tube
from stixel_cli.scene.textures import cloth, mottled


def pedestrian(contrast: float) -> Mesh:
    """The person, the cloth's texture of `contrast` 0 … 1."""
    skin = mottled("skin", (205, 158, 132), 0.10)
    return Mesh(
        (
            part("coat", [_torso(), *_sleeves()], cloth((164, 62, 48), contrast, 5), 0.9),
            part("trousers", _legs(), cloth((72, 92, 136), contrast), 0.5),
            part("shoes", _shoes(), mottled("leather", (58, 44, 36), 0.25), 0.3),
            part("skin", [*_hands(), _head(), _neck()], skin, 0.5),
            part("hair", _hair(), mottled("hair", (62, 42, 30), 0.35, coarsest=4.0), 0.3),
        )
    )


def torso_rings(sections: ArrayLike) -> np.ndarray:
    """Closed rings (S, N, 3) of `sections`: rows (x, z, half depth, half breadth), m."""
    angles = 2.0 * np.pi * np.arange(20) / 20
    # A superellipse: flatter in front and behind than an ellipse.
    cosine, sine = np.cos(angles), np.sin(angles)
    unit_x = np.sign(cosine) * np.abs(cosine) ** 0.8
    unit_y = np.sign(sine) * np.abs(sine) ** 0.8
    return np.array(
        [
            np.column_stack([x + depth * unit_x, breadth * unit_y, np.full(20, z)])
            for x, z, depth, breadth in sections
        ]
    )


def _torso():
    return loft(
        torso_rings(
            [
                (0.00, 0.80, 0.120, 0.142),
                (0.00, 0.90, 0.125, 0.150),
                (0.00, 1.05, 0.105, 0.132),
                (0.01, 1.20, 0.112, 0.142),
                (0.015, 1.34, 0.118, 0.155),
                (0.01, 1.42, 0.098, 0.150),
                (0.005, 1.465, 0.070, 0.105),
                (0.005, 1.49, 0.055, 0.062),
            ]
        )
    )


def _sleeves():
    return [
        tube([(0.0, 0.142, 1.40), (0.01, 0.148, 1.36), (0.02, 0.155, 1.13), (0.14, 0.152, 0.95)],
             [0.042, 0.048, 0.037, 0.030], 12),
        tube([(0.0, -0.142, 1.40), (-0.01, -0.148, 1.36), (-0.10, -0.155, 1.14),
              (-0.16, -0.152, 0.92)],
             [0.042, 0.048, 0.037, 0.030], 12),
    ]  # fmt: skip


def _hands():
    return [
        ellipsoid((0.185, 0.150, 0.90), (0.035, 0.020, 0.055), 6, 10),
        ellipsoid((-0.180, -0.152, 0.855), (0.030, 0.020, 0.055), 6, 10),
    ]


def _legs():
    return [
        tube([(0.0, -0.07, 0.90), (0.10, -0.075, 0.50), (0.185, -0.075, 0.11)],
             [0.085, 0.058, 0.046], 12),
        tube([(0.0, 0.07, 0.90), (0.0, 0.075, 0.49), (-0.215, 0.075, 0.15)],
             [0.085, 0.058, 0.046], 12),
    ]  # fmt: skip


def _shoes():
    return [
        tube([(0.165, -0.075, 0.05), (0.22, -0.075, 0.05), (0.32, -0.08, 0.032)],
             [0.044, 0.046, 0.034], 10),
        tube([(-0.25, 0.075, 0.12), (-0.20, 0.075, 0.07), (-0.14, 0.08, 0.032)],
             [0.040, 0.045, 0.034], 10),
    ]  # fmt: skip


def _neck():
    return tube([(0.0, 0.0, 1.44), (0.015, 0.0, 1.56)], 0.052, 12)


def _head():
    return ellipsoid((0.02, 0.0, 1.625), (0.098, 0.075, 0.122), 12, 18)


def _hair():
    return [
        ellipsoid((-0.005, 0.0, 1.665), (0.100, 0.081, 0.092), 10, 18),
        ellipsoid((-0.04, 0.0, 1.60), (0.065, 0.074, 0.075), 8, 14),
    ]
