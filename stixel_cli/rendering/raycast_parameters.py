"""Parameters of the renderer `raycast`."""

from typing import Annotated, Literal

from annotated_types import Ge, Le

from stixel_cli.parameters import parameters
from stixel_cli.scene.world_parameters import Light


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
