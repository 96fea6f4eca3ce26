"""The height and the pitch of a recording's cameras, and the vertical disparity of its images."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.stereo_images import read_pairs
from stixel_cli.recordings.types import Recording
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.stereo.matching import SgmParameters, match
from stixel_cli.stereo.rectification import Rows, compare_rows
from stixel_cli.stixels.parameters import EstimatedRoad, RoadParameters
from stixel_cli.stixels.road import MIDDLE, seen_road


@lru_cache
def road_pose(recording: Recording, rig: Rig, stereo: SgmParameters) -> tuple[float, float]:
    """Height in m above the road, and pitch in degrees, of the cameras: medians of three frames.

    They are searched round those of the `rig`, as `seen_road` has it, in disparities of `stereo`;
    NaN without a road.
    """
    found = []
    for k in (recording.count * np.array([1, 3, 5]) // 6).tolist():
        disparities = match(_pairs(recording, k), stereo, rig, range(k, k + 1))
        seen = seen_road(disparities, rig)
        found += [] if seen is None else [seen]
    pitch, height = np.median(found, axis=0) if found else (np.nan, np.nan)
    return float(height), float(np.degrees(pitch))


@lru_cache
def compared_rows(recording: Recording, far_disparity: float, check: bool) -> Rows | None:
    """The rows of the images, as `compare_rows`, of the first of three frames with enough corners.

    UserError for a pair that is to be refused, if `check`, `source.check_rectification`.
    """
    for k in (recording.count * np.array([3, 1, 5]) // 6).tolist():
        pairs = _pairs(recording, k)
        rows = compare_rows(pairs.left[0], pairs.right[0], far_disparity)
        if rows is not None:
            if rows.refused and check:
                raise UserError(f"source: {rows.fault}; or set source.check_rectification=false")
            return rows
    return None


def _pairs(recording: Recording, k: int) -> StereoPairs:
    """The grey images of frame `k`."""
    rectification = recording.calibration.rectification
    return read_pairs(recording.images, range(k, k + 1), rectification, recording.messages)


def contradiction(
    recording: Recording, rig: Rig, road: RoadParameters, stereo: SgmParameters
) -> str | None:
    """One line if the road is not where it is searched, or gave the rig's height; else None.

    It names the overrides that mend the rig, and what the estimate assumes.
    """
    height, pitch = road_pose(recording, replace(rig, camera_height=MIDDLE, pitch=0.0), stereo)
    right = {}
    if abs(height / rig.camera_height - 1.0) > EstimatedRoad.height_range:
        right["camera_height"] = f"{height:.2f}"
    if abs(pitch - rig.pitch) > getattr(road, "pitch_range", 1.0):
        right["pitch"] = f"{pitch:.1f}"
    assumed = f"rig.disparity_error={[*rig.disparity_error]} is assumed; "
    assumed += "the road alone cannot tell it from a pitch"
    if right:
        overrides = " ".join(f"rig.{name}={value}" for name, value in right.items())
        now = " and ".join(f"{getattr(rig, name):g}" for name in right)
        return f"the road in the images contradicts the rig: set {overrides} (now {now}); {assumed}"
    if recording.calibration.camera_height is None and rig.camera_height == round(height, 2):
        return f"rig.camera_height: not given; the road shows {height:.2f} m; {assumed}"
    return None
