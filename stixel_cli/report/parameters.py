"""What of a run is pictured."""

from itertools import pairwise
from typing import Annotated

from annotated_types import Ge, Le, Len

from stixel_cli.parameters import parameters


@parameters
class PicturesParameters:
    """Which frames get pictures.

    Attributes:
        frames: indices k of the pictured frames, increasing; null is four, spread evenly over the
            run.
    """

    frames: Annotated[tuple[Annotated[int, Ge(0), Le(100000)], ...], Len(0, 64)] | None

    def check(self) -> None:
        """Refuse frames which are given twice or out of order.

        Raises:
            ValueError: if `frames` is not increasing.
        """
        frames = self.frames or ()
        if any(later <= earlier for earlier, later in pairwise(frames)):
            raise ValueError(f"pictures.frames: {list(frames)} is not increasing")
