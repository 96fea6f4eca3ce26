"""The height and the pitch of cameras, from the road that one disparity image shows."""

from dataclasses import replace
from typing import ClassVar

import cv2
import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.stereo.disparities import SUBPIXELS, Disparities
from stixel_cli.stixels.parameters import EstimatedRoad
from stixel_cli.stixels.road import find_road, pitch_and_height

MIDDLE = 1.7
"""m, the middle of the heights that are searched: from 0.25 to 3.1 m."""

LEAST_SHARE = 0.07
"""Of the pixels, within 1 px of the road; noise and images upside down have up to 0.05."""

NO_ROAD = (
    "the disparities show no road: no plane 0.25 to 3.1 m below the camera, with a pitch of up to "
    f"10°, contains {LEAST_SHARE:.0%} of the pixels"
)

USUAL_WIDTH = 1242
"""Width of the images for which that 1 px is chosen, px; larger images are thinned."""


class _AnyRoad(EstimatedRoad):
    height_range: ClassVar[float] = 0.85


def seen_road(disparities: Disparities, rig: Rig) -> tuple[float, float] | None:
    """Pitch, rad, and height, m, of the cameras over the road in one image; None without a road.

    They are searched far round those of the `rig`, `MIDDLE` and 0 for any. Of the road's disparity
    a v + b, a gives the height and b the pitch: an offset of the disparities adds to b, too, so
    they count as exact but for the error that the rig states.
    """
    road = _AnyRoad(kind="estimated", pitch_range=10.0)
    step = max(1, round(rig.width / USUAL_WIDTH))
    raw, count = disparities.raw(0), disparities.count
    if step > 1:
        raw, count = raw[::step, ::step] // step, -(-count // step)
        rig = replace(
            rig,
            width=raw.shape[1],
            height=raw.shape[0],
            horizontal_fov=None,
            focal_length=rig.focal / step,
            principal_u=rig.u0 / step,
            principal_v=rig.v0 / step,
        )
    line = find_road(cv2.transpose(raw), count, rig, road)
    of_road = (line[0] * np.arange(rig.height) + line[1])[:, None]
    if np.mean((np.abs(raw / SUBPIXELS - of_road) < 1.0) & (of_road > 1.0)) > LEAST_SHARE:
        return pitch_and_height(line, rig)
    return None
