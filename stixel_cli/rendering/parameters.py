"""Parameters of the renderers."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from stixel_cli.parameters import parameters


@dataclass(frozen=True)
class Light:
    """The light of the scene, in linear units: a white surface in full light shines with about 1.

    Attributes:
        sun_azimuth: direction of the sun, degrees counter-clockwise from the world's +x axis
            (the ego car looks along +90 at k = 0).
        sun_elevation: height of the sun above the horizon, degrees.
        sun: irradiance of a surface that faces the sun, over pi.
        ambient: irradiance from the sky of a surface that faces up, over pi.
        exposure: factor from light to the image's linear grey, with full scale 1: white stays
            below it.
    """

    sun_azimuth: float = 200.0
    sun_elevation: float = 38.0
    sun: float = 1.2
    ambient: float = 0.34
    exposure: float = 0.85


@parameters
class RaycastParameters:
    """Rays against the meshes (Open3D's RaycastingScene): exact, repeats to the bit, no driver."""

    kind: Literal["raycast"]

    light: ClassVar[Light] = Light()
    samples: ClassVar[int] = 4
    """Its square is the number of samples in a pixel that shows an edge; 1: one ray everywhere."""


@parameters
class FilamentParameters:
    """Open3D's rasteriser (OffscreenRenderer on Filament, EGL or Vulkan), in a child process."""

    kind: Literal["filament"]

    light: ClassVar[Light] = Light()

    # About 1 start in 30 hangs: a child is restarted, and a hang does not stop a run for long.
    start_timeout: ClassVar[float] = 30.0
    """Time that the child may take until it is ready to render, s."""
    frame_timeout: ClassVar[float] = 20.0
    """Time that the child may take to render one stereo pair, s."""
    attempts: ClassVar[int] = 4
    """How often a child that hangs or crashes is started."""
