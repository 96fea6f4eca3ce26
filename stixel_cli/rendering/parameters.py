"""Parameters of the renderers."""

from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le

from stixel_cli.parameters import parameters
from stixel_cli.scene.parameters import Light


@parameters
class RaycastParameters:
    """Rays against the meshes (Open3D's RaycastingScene): exact, repeats to the bit, no driver.

    Attributes:
        kind: `raycast`.
        samples: its square is the number of samples in a pixel that shows an edge; 1 is one ray
            everywhere.
        light: the sun, the sky and the exposure.
    """

    kind: Literal["raycast"]
    samples: Annotated[int, Ge(1), Le(8)]
    light: Light


@parameters
class FilamentParameters:
    """Open3D's rasteriser (OffscreenRenderer on Filament, with EGL or Vulkan), in a child process.

    Attributes:
        kind: `filament`.
        light: the sun, the sky and the exposure.
    """

    kind: Literal["filament"]
    light: Light

    # About 1 start in 30 hangs: a child is restarted, and a hang does not stop a run for long.
    start_timeout: ClassVar[float] = 30.0
    """Time that the child may take until it is ready to render, s."""
    frame_timeout: ClassVar[float] = 20.0
    """Time that the child may take to render one stereo pair, s."""
    attempts: ClassVar[int] = 4
    """How often a child that hangs or crashes is started."""
