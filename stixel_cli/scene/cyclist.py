"""A cyclist: bicycle (frame of tubes, two wheels, handlebar) and rider, who pedals.

Modelled at about 1.8 × 0.6 × 1.75 m, x forward, y left, z up.
"""

from dataclasses import dataclass

import numpy as np

from stixel_cli.scene.mesh import Mesh, Part
from stixel_cli.scene.shapes import (
    Surface,
    box,
    ellipsoid,
    knee,
    lathe,
    loft,
    part,
    torus,
    tube,
    turned,
)
from stixel_cli.scene.textures import Colour, cloth, mottled, paint

AXLE = np.array([0.0, 0.06, 0.0])
CRANK_LENGTH = 0.17
HIP_HEIGHT = 0.95
SKIN = (205, 158, 132)


@dataclass(frozen=True)
class CyclistShape:
    """One bicycle with its rider; the default is today's model."""

    wheelbase: float = 1.0
    """Factor on the bicycle's length; its wheels keep their size."""
    handlebar: float = 1.0
    """Factor on the handlebar's width."""
    size: float = 1.0
    breadth: float = 1.0
    """`size`, `breadth`: factors on the rider's bones and on the breadth."""
    upright: float = 0.0
    """Angle by which the back is more upright, rad."""
    coat: bool = False
    backpack: bool = False
    panniers: bool = False
    """`coat`, `backpack`, `panniers`: what the rider wears and carries."""
    jacket: Colour = (222, 158, 36)
    trousers: Colour = (84, 90, 112)
    bicycle: Colour = (40, 92, 84)
    """`jacket`, `trousers`, `bicycle`: colours."""

    cycle_length = 5.0
    """Distance that one turn of the cranks drives, m."""

    @property
    def hip(self) -> np.ndarray:
        """Middle between the hip joints, (3,) m: a tall rider raises the saddle."""
        return np.array([-0.25, 0.0, HIP_HEIGHT + self.raised])

    @property
    def raised(self) -> float:
        """How much higher the saddle is than the model's, m."""
        return 0.6 * (self.size - 1.0)

    def on_bicycle(self, points) -> np.ndarray:
        """Points (…, 3) m of the model's bicycle on this one."""
        return np.asarray(points, dtype=np.float64) * [self.wheelbase, 1.0, 1.0]

    def on_body(self, points) -> np.ndarray:
        """Points (…, 3) m of the model's upper body on this rider's."""
        offsets = np.asarray(points, dtype=np.float64) - (-0.25, 0.0, HIP_HEIGHT)
        grown = self.hip + offsets * [self.size, self.size * self.breadth, self.size]
        return turned(grown, self.hip, self.upright)

    def on_bar(self, points) -> np.ndarray:
        """Points (…, 3) m of the model's handlebar on this one."""
        return self.on_bicycle(points) * [1.0, self.handlebar, 1.0]


def drawn(random: np.random.Generator) -> CyclistShape:
    """A bicycle with its rider: length 1.65 … 1.95 m, width 0.45 … 0.75 m, height 1.55 … 2.0 m."""
    jacket, trousers, bicycle = (
        tuple(float(c) for c in random.uniform(30.0, 210.0, 3)) for _ in range(3)
    )
    return CyclistShape(
        wheelbase=float(random.uniform(0.93, 1.07)),
        handlebar=float(random.uniform(0.80, 1.25)),
        size=float(random.uniform(0.88, 1.08)),
        breadth=float(random.uniform(0.88, 1.15)),
        upright=float(random.uniform(-0.15, 0.35)),
        coat=bool(random.random() < 0.25),
        backpack=bool(random.random() < 0.35),
        panniers=bool(random.random() < 0.3),
        jacket=jacket,
        trousers=trousers,
        bicycle=bicycle,
    )


STANDARD = CyclistShape()


def mesh(contrast: float, shape: CyclistShape = STANDARD) -> Mesh:
    """Rider and bicycle, the texture of cloth and paint of `contrast` 0 … 1."""
    hubs = [shape.on_bicycle((x, 0.0, 0.35)) for x in (-0.54, 0.54)]
    moving = limbs(shape, 0.0)
    head = ellipsoid(shape.on_body((0.185, 0.0, 1.60)), (0.100, 0.076, 0.122), 12, 18)
    neck = tube(shape.on_body([(0.10, 0.0, 1.43), (0.165, 0.0, 1.55)]), 0.05, 12)
    helmet = ellipsoid(shape.on_body((0.165, 0.0, 1.655)), (0.135, 0.095, 0.095), 10, 18)
    jacket = cloth(shape.jacket, contrast, 4)
    rubber = mottled("rubber", (40, 40, 42), 0.25)
    places = (shape.on_bar((0.305, side * 0.262, 1.01)) for side in (1, -1))
    hands = [ellipsoid(place, (0.05, 0.032, 0.035), 6, 10) for place in places]
    return (
        part("frame", _frame(shape), paint(shape.bicycle, contrast), 0.6),
        part("tyres", [torus(hub, 0.325, 0.025) for hub in hubs], rubber, 0.3),
        part("spokes", _spokes(hubs), mottled("steel", (168, 170, 174), 0.15), 0.3),
        part("saddle and grips", _black(shape), mottled("saddle", (36, 34, 33), 0.25), 0.3),
        part("cranks", moving["cranks"], mottled("saddle", (36, 34, 33), 0.25), 0.3),
        part("jacket", [_torso(shape), *_sleeves(shape)], jacket, 0.8),
        part("trousers", moving["trousers"], cloth(shape.trousers, contrast), 0.5),
        part("shoes", moving["shoes"], mottled("sneakers", (196, 194, 190), 0.2), 0.3),
        part("skin", [head, neck, *hands], mottled("skin", SKIN, 0.10), 0.5),
        part("helmet", [helmet], paint((206, 210, 214), 0.4 * contrast), 0.4),
        *_luggage(shape, contrast),
    )  # fmt: skip


def limbs(shape: CyclistShape, turn: float) -> dict[str, list[Surface]]:
    """Surfaces of the parts that move, by name, when the cranks have turned by `turn` rad.

    At 0 the left pedal is below. The cranks turn forwards: a pedal on top moves ahead.
    """
    cranks, trousers, shoes = [], [], []
    for side in (1.0, -1.0):
        angle = np.radians(-76.5) - turn + (np.pi if side < 0.0 else 0.0)
        axle = shape.on_bicycle((-0.09, 0.0, 0.30))
        pedal = axle + CRANK_LENGTH * np.array([np.cos(angle), 0.0, np.sin(angle)])
        apart = np.array([0.0, side, 0.0])
        cranks.append(tube([pedal + 0.07 * apart, pedal + 0.17 * apart], 0.020, 6))
        cranks.append(tube([axle + 0.08 * apart, pedal + 0.08 * apart], 0.012, 6))
        # The heel sinks a little in front and rises behind.
        ankle = np.add(pedal, (-0.01, 0.12 * side, 0.10))
        hip = np.add(shape.hip, (0.02, 0.085 * side * shape.breadth, 0.0))
        bend = knee(hip, ankle, 0.46 * shape.size, 0.445 * shape.size)
        bend[1] = 0.12 * side
        radii = np.array([0.092, 0.065, 0.044]) * shape.breadth
        trousers.append(tube([hip, bend, ankle], radii, 12))
        foot = pedal + np.array([(-0.06, 0.12 * side, 0.065), (0.0, 0.12 * side, 0.05),
                                 (0.11, 0.125 * side, 0.03)])  # fmt: skip
        shoes.append(tube(foot, [0.040, 0.042, 0.032], 10))
    return {"cranks": cranks, "trousers": trousers, "shoes": shoes}


def _frame(shape):
    at, bar, raised = shape.on_bicycle, shape.on_bar, np.array([0.0, 0.0, shape.raised])
    crank, head_low, head_top = at((-0.09, 0, 0.30)), at((0.41, 0.0, 0.66)), at((0.36, 0.0, 0.84))
    rear, front = at((-0.54, 0.0, 0.35)), at((0.54, 0.0, 0.35))
    surfaces = [
        tube([crank, at((-0.25, 0.0, 0.84)) + raised], 0.018),
        tube([head_low, head_top, at((0.345, 0.0, 0.93))], 0.021),
        tube(at([(-0.22, 0.0, 0.76), (0.37, 0.0, 0.80)]), 0.018),
        tube([crank, head_low], 0.021),
        # The stem, and a handlebar that sweeps back.
        tube(at([(0.345, 0.0, 0.92), (0.41, 0.0, 0.97)]), 0.018),
        tube(bar([(0.30, 0.27, 0.99), (0.38, 0.18, 0.99), (0.415, 0.05, 0.97), (0.415, -0.05, 0.97),
                  (0.38, -0.18, 0.99), (0.30, -0.27, 0.99)]), 0.014),
    ]  # fmt: skip
    for side in (1, -1):
        apart = np.array([0.0, 0.055 * side, 0.0])
        surfaces += [
            tube([crank + 0.5 * apart, rear + apart], 0.011, 8),
            tube([at((-0.22, 0.0, 0.77)) + 0.3 * apart, rear + apart], 0.010, 8),
            tube([head_low + 0.3 * apart, at((0.43, 0, 0.60)) + apart, front + apart], 0.014, 8),
        ]
    surfaces.append(tube(np.add(crank, [(0.0, 0.10, 0.0), (0.0, -0.10, 0.0)]), 0.022, 10))
    surfaces.append(lathe([(-0.074, 0.10), (-0.07, 0.10)], crank, 20))
    return surfaces


def _spokes(hubs):
    surfaces = []
    for hub in hubs:
        surfaces.append(tube([hub - AXLE, hub + AXLE], 0.022, 8))
        surfaces.append(torus(hub, 0.303, 0.010, 36, 6))
        for spoke in range(14):
            angle = 2.0 * np.pi * spoke / 14 + 0.1
            reach = np.array([np.cos(angle), 0.0, np.sin(angle)])
            foot = hub + np.array([0.0, 0.02 * (-1) ** spoke, 0.0])
            surfaces.append(tube([foot, hub + 0.30 * reach], 0.003, 4))
    return surfaces


def _black(shape):
    saddle = [(-0.36, 0.0, 0.875), (-0.25, 0.0, 0.875), (-0.10, 0.0, 0.87)]
    saddle = np.add(shape.on_bicycle(saddle), (0.0, 0.0, shape.raised))
    grips = ([(0.31, side * 0.262, 0.99), (0.27, side * 0.282, 0.99)] for side in (1, -1))
    tubes = [tube(shape.on_bar(grip), 0.019, 8) for grip in grips]
    return [tube(saddle, [0.050, 0.058, 0.025], 10), *tubes]


def _torso(shape):
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
    return loft(shape.on_body(rings))


def _sleeves(shape):
    surfaces = []
    for side in (1, -1):
        first, shoulder = shape.on_body([(0.06, side * 0.155, 1.39), (0.08, side * 0.185, 1.35)])
        wrist = shape.on_bar((0.27, side * 0.262, 1.03))
        elbow = 0.45 * shoulder + 0.55 * wrist + np.array([-0.055, 0.017 * side, -0.034])
        surfaces.append(tube([first, shoulder, elbow, wrist], [0.055, 0.058, 0.044, 0.034], 12))
    return surfaces


def _luggage(shape: CyclistShape, contrast: float) -> list[Part]:
    """The rider's coat and luggage."""
    parts = []
    if shape.coat:
        # Its tails hang over the saddle.
        tails = [(-0.20, 0.0, 1.02), (-0.30, 0.0, 0.92), (-0.40, 0.0, 0.74)]
        coat = tube(np.add(tails, (0.0, 0.0, shape.raised)), [0.15, 0.17, 0.13])
        parts.append(part("coat", [coat], cloth(shape.jacket, contrast), 0.8))
    if shape.backpack:
        bag = ellipsoid(shape.on_body((-0.19, 0.0, 1.27)), (0.13, 0.15, 0.20), 10, 16)
        parts.append(part("backpack", [bag], cloth(shape.trousers, contrast, 3), 0.6))
    if shape.panniers:
        sides = (0.07, 0.21), (-0.21, -0.07)
        ends = ([(-0.72, low, 0.36), (-0.40, high, 0.68)] for low, high in sides)
        bags = [box(*shape.on_bicycle(corners)) for corners in ends]
        parts.append(part("panniers", bags, cloth((60, 60, 64), contrast), 0.6))
    return parts
