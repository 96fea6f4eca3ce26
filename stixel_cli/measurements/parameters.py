"""Parameters of the three ways to scans: the schema of the group `measurement`."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args, get_type_hints

from annotated_types import Ge, Gt, Le, Lt

from stixel_cli.geometry.rig import STRICT, Rig


@dataclass(frozen=True)
class SimulatedParameters:
    """Scans from stixels. The gates look at the stixel alone: at no tracker and at no truth.

    Attributes:
        height_min, height_max: a stixel's height above the road, m, to be a candidate: below are
            kerbs and errors of the road, above are walls, poles and trees.
        range_min, range_max: distance from the sensor on the ground plane, m.
    """

    __pydantic_config__ = STRICT

    kind: Literal["simulated"]
    height_min: Annotated[float, Ge(0), Le(10)]
    height_max: Annotated[float, Gt(0), Le(100)]
    range_min: Annotated[float, Ge(0), Le(1000)]
    range_max: Annotated[float, Gt(0), Le(1000)]

    def check(self) -> None:
        """Raise ValueError unless both gates are open."""
        _check_gates(self)


@dataclass(frozen=True)
class StereoNoise:
    """Noise along the ray that grows with the depth: white in the disparity.

    Attributes:
        disparity_deviation: standard deviation of the disparity, px.
    """

    __pydantic_config__ = STRICT

    kind: Literal["stereo"]
    disparity_deviation: Annotated[float, Ge(0), Le(10)]


@dataclass(frozen=True)
class ConstantNoise:
    """Noise along the ray that is the same at every range.

    Attributes:
        range_deviation: standard deviation of the range, m.
    """

    __pydantic_config__ = STRICT

    kind: Literal["constant"]
    range_deviation: Annotated[float, Ge(0), Le(10)]


@dataclass(frozen=True)
class FittedNoise:
    """Noise fitted to the errors of simulated points: `stixel study rq3` makes the presets.

    Columns are rays. The error along the ray is `range_bias` + e; e has the standard deviation
    `disparity_deviation` dr/dd, dr/dd the range that a pixel of disparity is worth, and is
    correlated along the row. One part each for bias, spread and ends: with a second (bias of the
    disparity, spread of the range, ends in columns) the fit follows the ranges of its own paths,
    and is farther from the points of others.

    Attributes:
        columns_per_point: columns that make one point, as those of a stixel do.
        range_bias: measured minus true range, m: the seen surface lies behind the contour, which
            is the outermost outline over all heights.
        disparity_deviation: standard deviation, px.
        correlation_columns: columns over which the correlation of neighbours falls to 1/e; 0:
            none.
        edge_metres, edge_metres_deviation: how far the points reach beyond either end of the
            silhouette, mean and standard deviation, metres at the target. Positive is edge
            fattening, points beside the target; negative are ends that give no points, such as
            arms and wheels too slight for a stixel.
        edge_disparity_deviation: standard deviation, px, that the outermost point of either end
            has besides: depths that are mixed there.
        missed_share: share of the points between the ends that are missed.
        missed_columns: mean length of a run of missed points, columns.
    """

    __pydantic_config__ = STRICT

    kind: Literal["fitted"]
    columns_per_point: Annotated[int, Ge(1), Le(256)]
    range_bias: Annotated[float, Ge(-10), Le(10)]
    disparity_deviation: Annotated[float, Ge(0), Le(10)]
    correlation_columns: Annotated[float, Ge(0), Le(1000)]
    edge_metres: Annotated[float, Ge(-10), Le(10)]
    edge_metres_deviation: Annotated[float, Ge(0), Le(10)]
    edge_disparity_deviation: Annotated[float, Ge(0), Le(10)]
    missed_share: Annotated[float, Ge(0), Lt(1)]
    missed_columns: Annotated[float, Ge(1), Le(1000)]


Noise = StereoNoise | ConstantNoise | FittedNoise


class _ByKind:
    """Says to the schema that `kind` alone tells the members of an annotated union apart.

    The protocol is pydantic's, as `__pydantic_config__` is, and takes no import of it.
    """

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> dict[str, Any]:
        members = {get_args(get_type_hints(one)["kind"])[0]: one for one in get_args(source)}
        choices = {kind: handler(member) for kind, member in members.items()}
        return {"type": "tagged-union", "discriminator": "kind", "choices": choices}


@dataclass(frozen=True)
class FabricatedParameters:
    """Scans straight from the true contour, thesis (16)-(17).

    Attributes:
        rays: number of rays n_a over the field of view; null is the image's width.
        spacing: rays even in the `angle`, or even in its `tangent` as a pinhole's columns are.
        noise: what is between the crossings and the points, a group of its own.
        clutter_rate: mean number of clutter points a scan, uniform over field of view and range.
        missed_probability: probability that a ray which hits gives no point.
        range_max: farthest range that is measured, m.
    """

    __pydantic_config__ = STRICT

    kind: Literal["fabricated"]
    rays: Annotated[int, Ge(2), Le(4096)] | None
    spacing: Literal["angle", "tangent"]
    noise: Annotated[Noise, _ByKind()]
    clutter_rate: Annotated[float, Ge(0), Le(1000)]
    missed_probability: Annotated[float, Ge(0), Le(1)]
    range_max: Annotated[float, Gt(0), Le(1000)]

    def check(self, rig: Rig) -> None:
        """Raise ValueError if there are more rays than the image of `rig` has columns."""
        if self.rays is not None and self.rays > rig.width:
            raise ValueError(
                f"measurement.rays: {self.rays} rays are more than the {rig.width} columns of the "
                "image (rig.width)"
            )


@dataclass(frozen=True)
class Scanner:
    """Where a lidar's beams go: all that its noise-free returns depend on.

    Attributes:
        layers: number of layers, even in elevation from the lowest to the highest; a single one
            lies in the middle.
        elevation_lowest, elevation_highest: degrees above the horizon, of the middle of a beam.
        azimuth_step: degrees between neighbouring beams of a layer.
        horizontal_fov: degrees, straight ahead in its middle; null is that of the camera rig.
        mount_height: of the lidar above the road, m.
    """

    __pydantic_config__ = STRICT

    layers: Annotated[int, Ge(1), Le(256)]
    elevation_lowest: Annotated[float, Ge(-80), Le(80)]
    elevation_highest: Annotated[float, Ge(-80), Le(80)]
    azimuth_step: Annotated[float, Ge(0.02), Le(30)]
    horizontal_fov: Annotated[float, Gt(0), Le(360)] | None
    mount_height: Annotated[float, Gt(0), Le(5)]


@dataclass(frozen=True)
class LidarParameters:
    """Scans from a lidar. The gates look at the return alone: at no tracker and at no truth.

    Attributes:
        scanner: layers, beams and mounting.
        range_deviation: standard deviation of the range along the beam, m.
        missed_probability: probability that a beam which hits gives no return.
        returns: per azimuth the `nearest` return that passes the gates, or `all` of them.
        height_min, height_max: of the measured point above the road, m: the ground is below.
        range_min, range_max: distance from the sensor on the ground plane, m.
    """

    __pydantic_config__ = STRICT

    kind: Literal["lidar"]
    scanner: Scanner
    range_deviation: Annotated[float, Ge(0), Le(10)]
    missed_probability: Annotated[float, Ge(0), Le(1)]
    returns: Literal["nearest", "all"]
    height_min: Annotated[float, Ge(0), Le(10)]
    height_max: Annotated[float, Gt(0), Le(100)]
    range_min: Annotated[float, Ge(0), Le(1000)]
    range_max: Annotated[float, Gt(0), Le(1000)]

    def check(self) -> None:
        """Raise ValueError unless both gates are open and the layers go upwards."""
        scanner = self.scanner
        if scanner.elevation_highest < scanner.elevation_lowest:
            raise ValueError(
                f"measurement.scanner.elevation_highest: {scanner.elevation_highest} degrees is "
                f"below measurement.scanner.elevation_lowest, {scanner.elevation_lowest} degrees"
            )
        if scanner.layers > 1 and scanner.elevation_highest == scanner.elevation_lowest:
            raise ValueError(
                f"measurement.scanner.layers: {scanner.layers} layers at one elevation, "
                f"{scanner.elevation_lowest} degrees (measurement.scanner.elevation_highest)"
            )
        _check_gates(self)


MeasurementParameters = SimulatedParameters | FabricatedParameters | LidarParameters


def _check_gates(gates: SimulatedParameters | LidarParameters) -> None:
    if gates.height_max <= gates.height_min:
        raise ValueError(
            f"measurement.height_max: {gates.height_max} m is not above "
            f"measurement.height_min, {gates.height_min} m"
        )
    if gates.range_max <= gates.range_min:
        raise ValueError(
            f"measurement.range_max: {gates.range_max} m is not above "
            f"measurement.range_min, {gates.range_min} m"
        )
