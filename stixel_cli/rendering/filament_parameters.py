"""Parameters of the renderer `filament`."""

from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from stixel_cli.parameters import parameters
from stixel_cli.scene.world_parameters import Light


@parameters
class FilamentParameters:
    """Open3D's rasteriser (OffscreenRenderer on Filament and EGL), in a child process.

    Attributes:
        kind: `filament`.
        light: the sun, the sky and the exposure.
        start_timeout: time that the child may take until it is ready to render, s.
        frame_timeout: time that the child may take to render one stereo pair, s.
        attempts: how often a child that hangs or crashes is restarted.
    """

    kind: Literal["filament"]
    light: Light
    start_timeout: Annotated[float, Gt(0), Le(600)]
    frame_timeout: Annotated[float, Gt(0), Le(600)]
    attempts: Annotated[int, Ge(1), Le(20)]
