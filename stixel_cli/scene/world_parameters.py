"""Parameters of road and background (the group `world`), and of the light of both renderers."""

from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le

from stixel_cli.parameters import parameters


@parameters
class World:
    """Road and background.

    Attributes:
        kind: `street` leads off a town square, with houses, trees, poles and parked cars;
            `roadside` has such objects along the ego car's way, and leaves the way and the view of
            the target free.
        seed: of the layout and its textures (not the run's seed).
        contrast: how strong the textures of road and background are, 0 (plain) … 1.
    """

    kind: Literal["street", "roadside"]
    seed: Annotated[int, Ge(0), Le(1_000_000)]
    contrast: Annotated[float, Ge(0), Le(1)]


@parameters
class Light:
    """The light of the scene, in linear units: a white surface in full light shines with about 1.

    Attributes:
        sun_azimuth: direction of the sun, degrees counter-clockwise from the world's +x axis
            (the ego car looks along +90 at k = 0).
        sun_elevation: height of the sun above the horizon, degrees.
        sun: irradiance of a surface that faces the sun, over pi.
        ambient: irradiance from the sky of a surface that faces up, over pi.
    """

    sun_azimuth: Annotated[float, Ge(-180), Le(360)]
    sun_elevation: Annotated[float, Ge(5), Le(90)]
    sun: Annotated[float, Ge(0), Le(10)]
    ambient: Annotated[float, Ge(0), Le(10)]

    exposure: ClassVar[float] = 0.85
    """Factor from light to the image's linear grey, with full scale 1: white stays below it."""
