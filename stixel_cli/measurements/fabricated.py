"""Fabricated scans: rays against the true contour, with noise along the ray; thesis (16)-(17)."""

from typing import Annotated, Any, Literal, get_args, get_type_hints

import numpy as np
from annotated_types import Ge, Gt, Le

from stixel_cli.geometry.pose import rotation
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.parameters import Disturbance
from stixel_cli.measurements.rays import (
    Noise,
    Rays,
    first_crossings,
    measure,
    range_std,
    spread_rays,
)
from stixel_cli.measurements.scans import FieldOfView, Scans, points_along
from stixel_cli.parameters import parameters
from stixel_cli.randomness import generator
from stixel_cli.scene.scenario import Scenario


class _ByKind:
    """Schema of an annotated union whose members differ by `kind`.

    The protocol is pydantic's; this does not import pydantic.
    """

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> dict[str, Any]:
        members = {get_args(get_type_hints(one)["kind"])[0]: one for one in get_args(source)}
        choices = {kind: handler(member) for kind, member in members.items()}
        return {"type": "tagged-union", "discriminator": "kind", "choices": choices}


@parameters
class FabricatedParameters(Disturbance):
    """Scans computed from the true contour, without images, thesis (16)-(17).

    Attributes:
        rays: number of rays n_a over the field of view; null is the image's width.
        spacing: rays even in the `angle`, or even in its `tangent` as a pinhole's columns are.
        noise: the noise model of the points, the inner group `measurement/noise`.
        missed_probability: probability that a ray which hits gives no point.
        range_max: farthest range that is measured, m.
    """

    kind: Literal["fabricated"]
    rays: Annotated[int, Ge(2), Le(4096)] | None
    spacing: Literal["angle", "tangent"]
    noise: Annotated[Noise, _ByKind()]
    missed_probability: Annotated[float, Ge(0), Le(1)]
    range_max: Annotated[float, Gt(0), Le(1000)]

    def check(self, rig: Rig) -> None:
        """Raise ValueError if there are more rays than the image of `rig` has columns."""
        if self.rays is not None and self.rays > rig.width:
            raise ValueError(
                f"measurement.rays: must be ≤ rig.width ({rig.width}), got {self.rays}"
            )


def fabricate_scans(
    scenario: Scenario, rig: Rig, measurement: FabricatedParameters, seed: int
) -> Scans:
    """Scans of the true contour by rays from the left camera, in the world frame.

    The nearest crossing of each ray is measured, with noise along the ray, see `rays.Noise`. Across
    the ray the variance is (r dtheta)² / 12, dtheta the angle that belongs to one point. The
    covariance of a point is one that a sensor could know: it comes from the measured range.
    """
    count = rig.width if measurement.rays is None else measurement.rays
    rays = spread_rays(count, rig.field_of_view, measurement.spacing == "tangent")
    scans = []
    for k, ego in enumerate(scenario.ego_poses_world):
        contour, random = scenario.contour_world(k), generator(seed, "fabricate", k)
        scans.append(fabricate_scan(contour, ego, rays, rig, measurement, random))
    view = FieldOfView(*rig.field_of_view)
    return Scans.of_each(scenario.times, scenario.ego_poses_world, scans, field_of_view=view)


def fabricate_scan(
    contour_world: np.ndarray,
    sensor_pose_world: np.ndarray,
    rays: Rays,
    rig: Rig,
    measurement: FabricatedParameters,
    random: "np.random.Generator",
) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) m and covariances (n, 2, 2) m² in the world of one scan of `contour_world`."""
    contour_sensor = (contour_world - sensor_pose_world[:2]) @ rotation(sensor_pose_world[2])
    hit, ranges = first_crossings(contour_sensor, rays)
    # Noise is drawn first, and for every hit, so that no option changes the remaining points.
    ray, ranges, measured = measure(measurement.noise, hit, ranges, rays, rig, random)
    keep = (ranges <= measurement.range_max) & (measured > 0.0)
    if measurement.missed_probability > 0.0:
        keep &= random.random(len(ray)) >= measurement.missed_probability
    angles, steps, measured = rays.angles[ray][keep], rays.steps[ray][keep], measured[keep]
    along_variance = range_std(measurement.noise, measured, angles, rig) ** 2
    across_variance = (measured * steps * measurement.noise.columns_per_point) ** 2 / 12.0
    return points_along(sensor_pose_world, angles, measured, along_variance, across_variance)
