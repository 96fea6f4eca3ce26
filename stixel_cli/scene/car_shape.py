"""Bodies of cars, as differences from the hatchback that `car` models, and how they are drawn."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class CarShape:
    """One car's body.

    Attributes:
        length, width: outer size with mirrors, m.
        roof: how much higher the roof is than the hatchback's, m.
        lift: how much higher the flanks are, as a share of their height.
        windscreen_foot, windscreen_top: how much farther in front the windscreen's lower and upper
            edges are, m on the hatchback's scale.
        roof_end, tail: the same for the roof's rear edge and the rear window's lower edge.
        fullness: 1 for the hatchback's corners seen from above, more for rounder ones.
    """

    length: float
    width: float
    roof: float = 0.0
    lift: float = 0.0
    windscreen_foot: float = 0.0
    windscreen_top: float = 0.0
    roof_end: float = 0.0
    tail: float = 0.0
    fullness: float = 1.0

    @property
    def stretch(self) -> float:
        """Length over that of the hatchback."""
        return self.length / HATCHBACK.length


HATCHBACK = CarShape(length=4.5, width=1.8)

_BODIES = {
    # length, height, lift, windscreen's foot and top, roof's end, tail: from … to
    "small": ((3.6, 4.1), (1.42, 1.56), (0.0, 0.08), (0.0, 0.2), (0.0, 0.2), (-0.4, 0.0),
              (0.0, 0.0)),
    "hatchback": ((4.0, 4.5), (1.42, 1.52), (0.0, 0.06), (-0.1, 0.1), (-0.1, 0.1), (-0.1, 0.2),
                  (0.0, 0.0)),
    "saloon": ((4.4, 5.05), (1.38, 1.50), (0.0, 0.05), (-0.1, 0.1), (-0.1, 0.1), (0.4, 0.7),
               (0.3, 0.5)),
    "estate": ((4.3, 5.0), (1.42, 1.54), (0.0, 0.06), (-0.1, 0.1), (-0.1, 0.1), (-0.55, -0.35),
               (0.0, 0.0)),
    "off-road": ((4.1, 4.9), (1.60, 1.80), (0.12, 0.24), (-0.1, 0.1), (-0.1, 0.2), (-0.5, -0.2),
                 (0.0, 0.0)),
    "van": ((4.2, 5.05), (1.75, 1.98), (0.10, 0.20), (0.3, 0.5), (0.5, 0.9), (-0.65, -0.45),
            (0.0, 0.0)),
}  # fmt: skip


def drawn_car(random: np.random.Generator) -> CarShape:
    """A car's body: one of six kinds, then its measures; longer cars are wider.

    Length 3.6 … 5.1 m, width 1.6 … 2.0 m, height 1.38 … 1.98 m.
    """
    kind = list(_BODIES)[random.integers(len(_BODIES))]
    length, height, lift, foot, top, roof_end, tail = (
        float(random.uniform(*limits)) for limits in _BODIES[kind]
    )
    width = 1.64 + 0.28 * (length - 3.6) / 1.5 + 0.06 * float(random.uniform(-0.6, 1.3))
    fullness = float(random.uniform(0.7, 1.4))
    return CarShape(length, width, height - 1.5, lift, foot, top, roof_end, tail, fullness)
