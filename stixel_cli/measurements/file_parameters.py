"""Parameters of scans that are read from a file."""

from typing import Annotated, Literal

from annotated_types import Gt, Le

from stixel_cli.measurements.disturbance_parameters import Disturbance
from stixel_cli.parameters import parameters


@parameters
class FileParameters(Disturbance):
    """Scans of any sensor, read from a table. `file.py` and `file_truth.py` describe the columns.

    Attributes:
        path: the scans, `.csv` or `.npz`; required.
        ego: the sensor's pose and the time of each scan, empty ones too; null: the sensor stays at
            the origin, and an absent k is an empty scan.
        truth: the target's true poses and size or contour; null: unknown, so no errors are scored.
        range_std: standard deviation of a point along each axis, m, if the file has no variances.
        horizontal_fov: field of view in degrees, symmetric to the sensor's heading; null: unknown.
    """

    kind: Literal["file"]
    path: str | None
    ego: str | None
    truth: str | None
    range_std: Annotated[float, Gt(0), Le(10)]
    horizontal_fov: Annotated[float, Gt(0), Le(360)] | None

    def check(self) -> None:
        """Raise ValueError for an empty file name."""
        for name in ("path", "ego", "truth"):
            if getattr(self, name) == "":
                raise ValueError(f"measurement.{name}: is empty: must be the name of a file")
