"""A walking person: legs in stride, torso, swinging arms, head.

Modelled at about 0.6 × 0.36 × 1.75 m, x forward, y left, z up.
"""

from dataclasses import dataclass

import numpy as np

from stixel_cli.scene.mesh import Mesh, Part
from stixel_cli.scene.shapes import Surface, ellipsoid, knee, loft, part, tube, turned
from stixel_cli.scene.textures import Colour, cloth, mottled

ANKLE_HEIGHT = 0.09
HIP_HEIGHT = 0.90
SKIN = (205, 158, 132)
TORSO = (
    (0.00, 0.80, 0.120, 0.142), (0.00, 0.90, 0.125, 0.150), (0.00, 1.05, 0.105, 0.132),
    (0.01, 1.20, 0.112, 0.142), (0.015, 1.34, 0.118, 0.155), (0.01, 1.42, 0.098, 0.150),
    (0.005, 1.465, 0.070, 0.105), (0.005, 1.49, 0.055, 0.062),
)  # fmt: skip
"""Its sections, as those of `_body`."""


@dataclass(frozen=True)
class PedestrianShape:
    """One person; the default is today's model."""

    size: float = 1.0
    """Factor on all of it."""
    breadth: float = 1.0
    depth: float = 1.0
    """`breadth`, `depth`: factors on the body across and along the heading."""
    step: float = 0.40
    """Distance between the ankles at its longest, m on the model's scale."""
    swing: float = 0.32
    """Angle of the arms at its largest, rad."""
    coat: bool = False
    """Whether a coat reaches to the knees."""
    bag: str = ""
    """Either "back", "side" (hanging from the left shoulder) or "" for no bag."""
    top: Colour = (164, 62, 48)
    trousers: Colour = (72, 92, 136)
    hair: Colour = (62, 42, 30)
    """`top`, `trousers`, `hair`: colours."""

    @property
    def cycle_length(self) -> float:
        """Distance walked in two steps, m."""
        return 1.4 * self.size


def drawn(random: np.random.Generator) -> PedestrianShape:
    """A person: height 1.5 … 1.95 m, 0.3 … 0.7 m wide with arms and bag."""
    top, trousers = (tuple(float(c) for c in random.uniform(30.0, 210.0, 3)) for _ in range(2))
    grey = float(random.uniform(25.0, 170.0))
    breadth = float(random.uniform(0.90, 1.25))
    return PedestrianShape(
        size=float(random.uniform(0.865, 1.105)),
        breadth=breadth,
        depth=breadth * float(random.uniform(0.90, 1.20)),
        step=float(random.uniform(0.34, 0.56)),
        swing=float(random.uniform(0.10, 0.45)),
        coat=bool(random.random() < 0.3),
        bag=("", "", "back", "side")[random.integers(4)],
        top=top,
        trousers=trousers,
        hair=(grey, 0.75 * grey, 0.55 * grey),
    )


STANDARD = PedestrianShape()


def mesh(contrast: float, shape: PedestrianShape = STANDARD) -> Mesh:
    """The person, the cloth's texture of `contrast` 0 … 1."""
    moving = limbs(shape, 0.0)
    skin = mottled("skin", SKIN, 0.10)
    head = ellipsoid((0.02, 0.0, 1.625), (0.098, 0.075, 0.122), 12, 18)
    neck = tube([(0.0, 0.0, 1.44), (0.015, 0.0, 1.56)], 0.052, 12)
    hair = [
        ellipsoid((-0.005, 0.0, 1.665), (0.100, 0.081, 0.092), 10, 18),
        ellipsoid((-0.04, 0.0, 1.60), (0.065, 0.074, 0.075), 8, 14),
    ]
    return (
        part("torso", _body(TORSO, shape), cloth(shape.top, contrast, 5), 0.9),
        part("sleeves", moving["sleeves"], cloth(shape.top, contrast, 5), 0.9),
        part("trousers", moving["trousers"], cloth(shape.trousers, contrast), 0.5),
        part("shoes", moving["shoes"], mottled("leather", (58, 44, 36), 0.25), 0.3),
        part("hands", moving["hands"], skin, 0.5),
        part("head", _grown([head, neck], shape), skin, 0.5),
        part("hair", _grown(hair, shape), mottled("hair", shape.hair, 0.35, 4.0), 0.3),
        *_clothes(shape, contrast),
    )


def limbs(shape: PedestrianShape, turn: float) -> dict[str, list[Surface]]:
    """Surfaces of the parts that move, by name; `turn` goes from 0 to 2 pi in two steps.

    At 0 the right foot is farthest ahead and on the ground; it goes back until pi, and is lifted
    and brought forward after that. The left leg is half a round later, arms go with the other leg.
    """
    sleeves, hands, trousers, shoes = [], [], [], []
    for side in (-1.0, 1.0):
        phase = (turn + (np.pi if side > 0.0 else 0.0)) % (2.0 * np.pi)
        planted = phase <= np.pi
        forward = 1.0 - 2.0 * phase / np.pi if planted else -np.cos(phase - np.pi)
        lift = 0.0 if planted else np.sin(phase - np.pi)
        hip = np.array([0.0, 0.072 * side * shape.breadth, HIP_HEIGHT])
        ankle = np.array(
            [0.5 * shape.step * forward, 0.075 * side * shape.breadth, ANKLE_HEIGHT + 0.11 * lift]
        )
        # Toes down behind, and up in front.
        pitch = 0.22 * forward - 0.35 * lift
        ankle[2] += max(0.0, -0.12 * pitch)
        bend = knee(hip, ankle, 0.43, 0.41)
        trousers.append(tube([hip, bend, ankle], np.array([0.085, 0.058, 0.046]) * shape.depth, 12))
        foot = np.array([(-0.03, 0.0, -0.045), (0.03, 0.0, -0.045), (0.13, 0.005 * side, -0.06)])
        shoes.append(tube(turned(ankle + foot, ankle, pitch), [0.043, 0.046, 0.033], 10))

        angle = -shape.swing * np.cos(phase)
        shoulder = np.array([0.0, 0.148 * side * shape.breadth, 1.36])
        elbow = shoulder + 0.24 * np.array([np.sin(angle), 0.03 * side, -np.cos(angle)])
        low = angle + 0.15 + 0.5 * max(angle, 0.0)
        down = np.array([np.sin(low), 0.0, -np.cos(low)])
        wrist, palm = elbow + 0.22 * down, elbow + 0.27 * down
        sleeves.append(
            tube([shoulder - (0.0, 0.006 * side, -0.04), shoulder, elbow, wrist],
                 np.array([0.042, 0.048, 0.037, 0.030]) * shape.depth, 12)
        )  # fmt: skip
        hands.append(ellipsoid(palm, (0.033, 0.020, 0.055), 6, 10))
    moving = {"sleeves": sleeves, "hands": hands, "trousers": trousers, "shoes": shoes}
    return {name: _grown(surfaces, shape) for name, surfaces in moving.items()}


def _grown(surfaces: list[Surface], shape: PedestrianShape) -> list[Surface]:
    return [(shape.size * vertices, triangles) for vertices, triangles in surfaces]


def _body(sections, shape):
    """The skin over closed rings: rows (x, z, half depth, half breadth), m, of `sections`."""
    angles = 2.0 * np.pi * np.arange(20) / 20
    # A superellipse: flatter in front and behind than an ellipse.
    cosine, sine = np.cos(angles), np.sin(angles)
    unit_x = np.sign(cosine) * np.abs(cosine) ** 0.8
    unit_y = np.sign(sine) * np.abs(sine) ** 0.8
    build = np.array([1.0, 1.0, shape.depth, shape.breadth])
    x, z, depth, breadth = (np.array(sections) * build).T[:, :, None]
    rings = np.broadcast_arrays(x + depth * unit_x, breadth * unit_y, z)
    return _grown([loft(np.stack(rings, axis=-1))], shape)


def _clothes(shape: PedestrianShape, contrast: float) -> list[Part]:
    """The person's coat and luggage."""
    parts = []
    if shape.coat:
        sections = [(0.0, 0.52, 0.20, 0.19), (0.0, 0.80, 0.155, 0.17), (0.0, 1.05, 0.125, 0.15),
                    (0.01, 1.30, 0.130, 0.165)]  # fmt: skip
        parts.append(part("coat", _body(sections, shape), cloth(shape.top, contrast), 0.9))
    if shape.bag == "back":
        centre = (-0.10 * shape.depth - 0.10, 0.0, 1.20)
        bag = ellipsoid(centre, (0.12, 0.15, 0.23), 10, 16)
        parts.append(part("bag", _grown([bag], shape), cloth((58, 66, 60), contrast, 3), 0.6))
    if shape.bag == "side":
        away = 0.16 * shape.breadth + 0.07
        bag = ellipsoid((-0.02, away, 0.86), (0.17, 0.06, 0.14), 10, 16)
        strap = tube([(0.0, 0.6 * away, 1.43), (-0.02, away, 0.98)], 0.012, 6)
        parts.append(part("bag", _grown([bag, strap], shape), cloth((96, 70, 48), contrast), 0.6))
    return parts
