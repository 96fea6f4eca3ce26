"""Parameters of the renderers and of the cameras' sensors."""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from stixel_cli.geometry.rig import STRICT


@dataclass(frozen=True)
class Light:
    """The light of the scene, in linear units: a white surface in full light shines with about 1.

    Attributes:
        sun_azimuth: where the sun stands, degrees counter-clockwise from the world's +x axis
            (the ego car looks along +90 at k = 0).
        sun_elevation: height of the sun above the horizon, degrees.
        sun: irradiance of a surface that faces the sun, over pi.
        ambient: irradiance from the sky of a surface that faces up, over pi.
        exposure: factor from light to the image's linear grey, of which 1 is full scale.
    """

    __pydantic_config__ = STRICT

    sun_azimuth: Annotated[float, Ge(-180), Le(360)]
    sun_elevation: Annotated[float, Ge(5), Le(90)]
    sun: Annotated[float, Ge(0), Le(10)]
    ambient: Annotated[float, Ge(0), Le(10)]
    exposure: Annotated[float, Gt(0), Le(10)]


@dataclass(frozen=True)
class RaycastParameters:
    """Rays against the meshes (Open3D's RaycastingScene): exact, repeats to the bit, no driver.

    Attributes:
        kind: `raycast`.
        samples: its square is the number of rays through a pixel that shows an edge; 1 is one ray
            everywhere.
        light: the sun, the sky and the exposure.
    """

    __pydantic_config__ = STRICT

    kind: Literal["raycast"]
    samples: Annotated[int, Ge(1), Le(8)]
    light: Light


@dataclass(frozen=True)
class FilamentParameters:
    """Open3D's rasteriser (OffscreenRenderer on Filament and EGL), in a child process.

    Attributes:
        kind: `filament`.
        light: the sun, the sky and the exposure.
        start_timeout: time that the child may take until it is ready to render, s.
        frame_timeout: time that the child may take to render one stereo pair, s.
        attempts: how often a child that hangs or dies is started anew.
    """

    __pydantic_config__ = STRICT

    kind: Literal["filament"]
    light: Light
    start_timeout: Annotated[float, Gt(0), Le(600)]
    frame_timeout: Annotated[float, Gt(0), Le(600)]
    attempts: Annotated[int, Ge(1), Le(20)]


Renderer = RaycastParameters | FilamentParameters


@dataclass(frozen=True)
class Sensor:
    """The cameras' sensors: what they do to a noise-free picture. Grey levels are of 255.

    The variance of a grey value g is read_noise² + shot_noise² g / 255: photons are counted, so
    their noise grows with the root of the light.

    Attributes:
        read_noise: standard deviation in the dark, grey levels.
        shot_noise: standard deviation that is added at full scale, grey levels.
        right_gain: brightness of the right camera over that of the left.
    """

    __pydantic_config__ = STRICT

    read_noise: Annotated[float, Ge(0), Le(50)]
    shot_noise: Annotated[float, Ge(0), Le(50)]
    right_gain: Annotated[float, Ge(0.5), Le(2)]
