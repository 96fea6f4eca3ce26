"""What a target may look like: a bank of forms, weighted by likelihood.

A form may deviate a little along its outline (`residual.py`), as no road user is quite the mean of
its class, and no sensor sees it quite as those from which the visible shapes (`class_shape.py`)
were learned. The first form is what the sensor sees of the class. Where it sees the outline itself,
the rectangle of the class's box is another. An outline that the user states is one more.

A target may be of no class at all, a pushchair or a truck: its form is free, a rounded rectangle of
any size that may deviate more.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

from stixel_cli.tracking.contour import ray_table
from stixel_cli.tracking.contour.class_shape import (
    ClassShape,
    class_shape,
    height_insets,
)
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.contour.contour_rays import Sight, sight_of
from stixel_cli.tracking.contour.ray_kernels import OUTLINE_STD
from stixel_cli.tracking.contour.residual import Residual
from stixel_cli.tracking.contour.user_shape import RADII, read_outline
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import OTHER

FREE_STD, CORNER = 0.5, 0.25
"""Of the free form: relative standard deviation of the length and width, and the radius of its
corners, relative to the smaller side."""

LEAST_RADIUS = 0.02
"""Of an outline whose centre is outside of it, m."""


def forms_of(
    road_user: str, prior: PriorShape, tracker: ContourParameters
) -> dict[str, tuple[ClassShape, Sight]]:
    """The forms that a `road_user` may have: shape, and how the sensor sees it."""
    shape, sight = class_shape(road_user), sight_of(road_user, tracker)
    tables = {"class": (shape, sight.table)}
    if sight.outline:
        box = rectangle(shape)
        tables["rectangle"] = box, _exact_table(box.outline)
    if prior.outline is not None and road_user == prior.road_user:
        vertices = read_outline(Path(prior.outline))
        seen = None if sight.outline else sight_of(road_user, tracker, vertices)
        table = seen.table if seen else _exact_table(vertices)
        tables["outline"] = star_of(vertices), table
    return {
        form: (form_shape, replace(sight, table=form_table, residual=Residual(form_shape)))
        for form, (form_shape, form_table) in tables.items()
    }


def free_form(prior: PriorShape) -> tuple[PriorShape, ClassShape, Sight]:
    """A form of no class: the prior that it has, and as the forms of `forms_of`.

    Its size begins as the prior's, which may be off by half. How far its faces are inside of it
    higher up is as uncertain as those of the prior's class.
    """
    size = np.array([prior.length, prior.width])
    radius = CORNER * size.min()
    body = shapely.box(*(radius - 0.5 * size), *(0.5 * size - radius)).buffer(radius)
    shape = star_of(shapely.get_coordinates(shapely.orient_polygons(body))[:-1])
    table = _exact_table(shape.outline)
    insets = None if prior.road_user == "unknown" else height_insets(prior.road_user)
    sight = Sight(table, 0.0, 1.0, 0.0, Residual(shape), insets)
    prior = replace(prior, road_user=OTHER, length_std=FREE_STD, width_std=FREE_STD)
    return prior, shape, sight


def _exact_table(outline: np.ndarray) -> ray_table.RayTable:
    table = ray_table.outline_table(outline)
    ends, stds = np.full_like(table.low, OUTLINE_STD), np.full_like(table.stds, OUTLINE_STD)
    return replace(table, stds=stds, low_stds=ends, high_stds=ends)


def star_of(vertices: np.ndarray) -> ClassShape:
    """The outermost points of a polygon (n, 2) m round the centre of its box, at even angles."""
    angles = ray_table.even_aspects(RADII)
    radii = np.maximum(ray_table.outermost_radii(vertices, RADII), LEAST_RADIUS)
    return ClassShape(
        outline=radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1),
        outline_stds=np.zeros(RADII),
        size=np.ptp(vertices, axis=0),
    )


def rectangle(shape: ClassShape) -> ClassShape:
    """The rectangle of the class's box, with corners at the angles of the class's outline."""
    unit = shape.outline / np.hypot(*shape.outline.T)[:, None]
    outline = unit * (0.5 / np.abs(unit / shape.size).max(axis=1))[:, None]
    return replace(shape, outline=outline, outline_stds=np.zeros(len(outline)))
