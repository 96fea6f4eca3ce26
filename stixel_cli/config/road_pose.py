"""The height and the pitch of a recording's cameras, from the road in its images."""

from dataclasses import replace
from functools import lru_cache
from typing import ClassVar

import cv2
import numpy as np

from stixel_cli.config.schema import Configuration
from stixel_cli.geometry.rig import Rig
from stixel_cli.pairs import matched
from stixel_cli.recordings.stereo_images import read_pairs
from stixel_cli.recordings.types import Recording
from stixel_cli.stereo.disparities import SUBPIXELS
from stixel_cli.stixels.parameters import EstimatedRoad
from stixel_cli.stixels.road import find_road, pitch_and_height

MIDDLE = 1.7
"""m, the middle of the heights that are searched: from 0.25 to 3.1 m."""

LEAST_SHARE = 0.07
"""Of the pixels, within 1 px of the road; noise and images upside down have up to 0.05."""


class _AnyRoad(EstimatedRoad):
    height_range: ClassVar[float] = 0.85


@lru_cache
def road_pose(recording: Recording, rig: Rig) -> tuple[float, float]:
    """Height in m above the road, and pitch in degrees, of the cameras: medians of three frames.

    They are searched far round those of the `rig`, `MIDDLE` and 0 for any; NaN without a road. Of
    the road's disparity a v + b, a gives the height and b the pitch: an offset of the disparities
    adds to b, too, so they count as exact but for the error that the rig states.
    """
    road = _AnyRoad(kind="estimated", least_height=0.25, pitch_range=10.0)
    found = []
    for k in (recording.count * np.array([1, 3, 5]) // 6).tolist():
        frame = range(k, k + 1)
        pairs = read_pairs(recording.images, frame, recording.calibration.rectification)
        disparities = matched((pairs.left[0], pairs.right[0]), rig)
        raw = disparities.raw(0)
        line = find_road(cv2.transpose(raw), disparities.count, rig, road)
        of_road = (line[0] * np.arange(rig.height) + line[1])[:, None]
        if np.mean((np.abs(raw / SUBPIXELS - of_road) < 1.0) & (of_road > 1.0)) > LEAST_SHARE:
            found.append(pitch_and_height(line, rig))
    pitch, height = np.median(found, axis=0) if found else (np.nan, np.nan)
    return float(height), float(np.degrees(pitch))


def contradiction(recording: Recording, configuration: Configuration) -> str | None:
    """One line if the road is not where it is searched, or gave the rig's height; else None.

    It names the overrides that mend the rig, and what the estimate assumes.
    """
    rig, road = configuration.rig, configuration.road
    height, pitch = road_pose(recording, replace(rig, camera_height=MIDDLE, pitch=0.0))
    right = {}
    if abs(height / rig.camera_height - 1.0) > EstimatedRoad.height_range:
        right["camera_height"] = f"{height:.2f}"
    if abs(pitch - rig.pitch) > getattr(road, "pitch_range", 1.0):
        right["pitch"] = f"{pitch:.1f}"
    assumed = f"rig.disparity_offset={rig.disparity_offset:g} is assumed; "
    assumed += "the road alone cannot tell it from a pitch"
    if right:
        overrides = " ".join(f"rig.{name}={value}" for name, value in right.items())
        now = " and ".join(f"{getattr(rig, name):g}" for name in right)
        return f"the road in the images contradicts the rig: set {overrides} (now {now}); {assumed}"
    if recording.calibration.camera_height is None and rig.camera_height == round(height, 2):
        return f"rig.camera_height: not given; the road shows {height:.2f} m; {assumed}"
    return None
