"""Overrides of runs whose scans come from a file: what they imply, and what has no effect."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from stixel_cli.errors import BelongsElsewhere

if TYPE_CHECKING:
    from stixel_cli.config.overrides import Override

WITHOUT_EFFECT = (
    "pace",
    "path",
    "ego",
    "rig",
    "world",
    "renderer",
    "sensor",
    "stereo",
    "road",
    "occupancy",
    "free_space",
    "height",
    "extraction",
)
"""Groups of the scene and the cameras, which scans from a file do not have."""


def implied_by_file(parsed: "Sequence[Override]") -> list[str]:
    """Further overrides of one run: `start=scans` for scans from a file without truth.

    Args:
        parsed: all overrides of the run, of one value each.

    Raises:
        BelongsElsewhere: for a setting that has no effect on such a run.
    """
    values = {one.key: one.value for one in parsed}
    if values.get("measurement") != "file":
        return []
    for name in values:
        if name.partition(".")[0] in WITHOUT_EFFECT or name.startswith("road_user."):
            more = "; prior.… sets the class's size" if name.startswith("road_user.") else ""
            raise BelongsElsewhere(
                f"{name}: has no effect with measurement=file, which has no scene and no cameras: "
                f"leave it out{more}"
            )
    return [] if values.get("measurement.truth") or "start" in values else ["start=scans"]
