"""Parameters of road and background: the group `world`."""

from typing import Annotated, Literal

from annotated_types import Ge, Le

from stixel_cli.parameters import parameters


@parameters
class World:
    """Road and background.

    Attributes:
        kind: a street that leads off a town square, with houses, trees, poles and parked cars.
        seed: of the layout and its textures (not the run's seed).
        contrast: how strong the textures of road and background are, 0 (plain) … 1.
    """

    kind: Literal["street"]
    seed: Annotated[int, Ge(0), Le(1_000_000)]
    contrast: Annotated[float, Ge(0), Le(1)]
