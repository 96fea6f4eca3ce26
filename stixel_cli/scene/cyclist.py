"""A cyclist: bicycle (frame of tubes, two wheels, handlebar) and rider (pedalling, with helmet).

Modelled at about 1.8 × 0.6 × 1.75 m, x forward, y left, z up; the caller fits it to its size.
"""

import numpy as np

from stixel_cli.scene.mesh import Mesh
from stixel_cli.scene.shapes import ellipsoid, lathe, loft, part, torus, tube
from stixel_cli.scene.textures import cloth, mottled, paint

REAR, FRONT = np.array([-0.54, 0.0, 0.35]), np.array([0.54, 0.0, 0.35])
AXLE = np.array([0.0, 0.06, 0.0])
CRANK = np.array([-0.09, 0.0, 0.30])
SEAT, HEAD_LOW, HEAD_TOP = (-0.25, 0.0, 0.84), (0.41, 0.0, 0.66), (0.36, 0.0, 0.84)


def cyclist(contrast: float) -> Mesh:
    """Rider and bicycle, the texture of cloth and paint of `contrast` 0 … 1."""
    return Mesh(
        (
            part("frame", _frame(), paint((40, 92, 84), contrast), 0.6),
            part("tyres", [torus(hub, 0.325, 0.025) for hub in (REAR, FRONT)],
                 mottled("rubber", (40, 40, 42), 0.25), 0.3),
            part("spokes", _spokes(), mottled("steel", (168, 170, 174), 0.15), 0.3),
            part("saddle and grips", _black(), mottled("saddle", (36, 34, 33), 0.25), 0.3),
            part("jacket", [_torso(), *_sleeves()], cloth((222, 158, 36), contrast, 4), 0.8),
            part("trousers", _legs(), cloth((84, 90, 112), contrast), 0.5),
            part("shoes", _shoes(), mottled("sneakers", (196, 194, 190), 0.2), 0.3),
            part("skin", [_head(), _neck(), *_hands()],
                 mottled("skin", (205, 158, 132), 0.10), 0.5),
            part("helmet", [_helmet()], paint((206, 210, 214), 0.4 * contrast), 0.4),
        )
    )  # fmt: skip


def _frame():
    surfaces = [
        tube([CRANK, SEAT], 0.018),
        tube([HEAD_LOW, HEAD_TOP, (0.345, 0.0, 0.93)], 0.021),
        tube([(-0.22, 0.0, 0.76), (0.37, 0.0, 0.80)], 0.018),
        tube([CRANK, HEAD_LOW], 0.021),
        # The stem, and a handlebar that sweeps back.
        tube([(0.345, 0.0, 0.92), (0.41, 0.0, 0.97)], 0.018),
        tube([(0.30, 0.27, 0.99), (0.38, 0.18, 0.99), (0.415, 0.05, 0.97), (0.415, -0.05, 0.97),
              (0.38, -0.18, 0.99), (0.30, -0.27, 0.99)], 0.014),
    ]  # fmt: skip
    for side in (1, -1):
        apart = np.array([0.0, 0.055 * side, 0.0])
        surfaces += [
            tube([CRANK + 0.5 * apart, REAR + apart], 0.011, 8),
            tube([np.array([-0.22, 0.0, 0.77]) + 0.3 * apart, REAR + apart], 0.010, 8),
            tube([np.array(HEAD_LOW) + 0.3 * apart, np.array([0.43, 0, 0.60]) + apart,
                  FRONT + apart], 0.014, 8),
        ]  # fmt: skip
    surfaces.append(tube([(-0.09, 0.10, 0.30), (-0.09, -0.10, 0.30)], 0.022, 10))
    surfaces.append(lathe([(-0.074, 0.10), (-0.07, 0.10)], CRANK, 20))
    return surfaces


def _spokes():
    surfaces = []
    for hub in (REAR, FRONT):
        surfaces.append(tube([hub - AXLE, hub + AXLE], 0.022, 8))
        surfaces.append(torus(hub, 0.303, 0.010, 36, 6))
        for spoke in range(14):
            angle = 2.0 * np.pi * spoke / 14 + 0.1
            reach = np.array([np.cos(angle), 0.0, np.sin(angle)])
            foot = hub + np.array([0.0, 0.02 * (-1) ** spoke, 0.0])
            surfaces.append(tube([foot, hub + 0.30 * reach], 0.003, 4))
    return surfaces


def _black():
    return [
        tube([(-0.36, 0.0, 0.875), (-0.25, 0.0, 0.875), (-0.10, 0.0, 0.87)],
             [0.050, 0.058, 0.025], 10),
        tube([(0.31, 0.262, 0.99), (0.27, 0.282, 0.99)], 0.019, 8),
        tube([(0.31, -0.262, 0.99), (0.27, -0.282, 0.99)], 0.019, 8),
        # Pedals: the left one below, the right one above.
        tube([(-0.05, 0.07, 0.135), (-0.05, 0.17, 0.135)], 0.020, 6),
        tube([(-0.13, -0.07, 0.465), (-0.13, -0.17, 0.465)], 0.020, 6),
        tube([(-0.09, 0.08, 0.30), (-0.05, 0.08, 0.135)], 0.012, 6),
        tube([(-0.09, -0.08, 0.30), (-0.13, -0.08, 0.465)], 0.012, 6),
    ]  # fmt: skip


def _torso():
    """Rings across a spine that leans forward."""
    spine = np.array([(-0.27, 0.90), (-0.23, 0.98), (-0.14, 1.10), (-0.03, 1.24), (0.06, 1.36),
                      (0.10, 1.43), (0.13, 1.49)])  # fmt: skip
    depth = [0.10, 0.125, 0.115, 0.12, 0.12, 0.09, 0.055]
    breadth = [0.13, 0.165, 0.150, 0.170, 0.190, 0.155, 0.060]
    angles = 2.0 * np.pi * np.arange(20) / 20
    lean = np.array([0.80, 0.0, -0.60])
    rings = [
        np.array([x, 0.0, z])
        + d * np.cos(angles)[:, None] * lean
        + b * np.sin(angles)[:, None] * np.array([0.0, 1.0, 0.0])
        for (x, z), d, b in zip(spine, depth, breadth, strict=True)
    ]
    return loft(np.array(rings))


def _sleeves():
    return [
        tube([(0.06, side * 0.155, 1.39), (0.08, side * 0.185, 1.35), (0.13, side * 0.245, 1.14),
              (0.27, side * 0.262, 1.03)], [0.055, 0.058, 0.044, 0.034], 12)
        for side in (1, -1)
    ]  # fmt: skip


def _hands():
    return [ellipsoid((0.305, side * 0.262, 1.01), (0.05, 0.032, 0.035), 6, 10) for side in (1, -1)]


def _legs():
    return [
        tube([(-0.23, 0.085, 0.95), (0.13, 0.12, 0.64), (-0.06, 0.12, 0.235)],
             [0.092, 0.064, 0.044], 12),
        tube([(-0.23, -0.085, 0.95), (0.20, -0.12, 0.84), (-0.13, -0.12, 0.565)],
             [0.092, 0.066, 0.044], 12),
    ]  # fmt: skip


def _shoes():
    return [
        tube([(-0.11, 0.12, 0.20), (-0.05, 0.12, 0.185), (0.06, 0.125, 0.165)],
             [0.040, 0.042, 0.032], 10),
        tube([(-0.19, -0.12, 0.53), (-0.13, -0.12, 0.515), (-0.02, -0.125, 0.495)],
             [0.040, 0.042, 0.032], 10),
    ]  # fmt: skip


def _head():
    return ellipsoid((0.185, 0.0, 1.60), (0.100, 0.076, 0.122), 12, 18)


def _neck():
    return tube([(0.10, 0.0, 1.43), (0.165, 0.0, 1.55)], 0.05, 12)


def _helmet():
    return ellipsoid((0.165, 0.0, 1.655), (0.135, 0.095, 0.095), 10, 18)
