"""Parameters of the renderers."""

from typing import ClassVar, Literal

from stixel_cli.parameters import parameters


@parameters
class RaycastParameters:
    """Rays against the meshes (Open3D's RaycastingScene): exact, repeats to the bit, no driver."""

    kind: Literal["raycast"]

    samples: ClassVar[int] = 4
    """Its square is the number of samples in a pixel that shows an edge; 1: one ray everywhere."""


@parameters
class FilamentParameters:
    """Open3D's rasteriser (OffscreenRenderer on Filament, EGL or Vulkan), in a child process."""

    kind: Literal["filament"]

    # About 1 start in 30 hangs: a child is restarted, and a hang does not stop a run for long.
    start_timeout: ClassVar[float] = 30.0
    """Time that the child may take until it is ready to render, s."""
    frame_timeout: ClassVar[float] = 20.0
    """Time that the child may take to render one stereo pair, s."""
    attempts: ClassVar[int] = 4
    """How often a child that hangs or crashes is started."""
