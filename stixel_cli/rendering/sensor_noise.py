"""The sensors: noise-free colour pictures become the grey images that all later stages see."""

from functools import cache
from statistics import NormalDist
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Le

from stixel_cli.geometry.rig import Pixels, Rig
from stixel_cli.parameters import parameters
from stixel_cli.randomness import generator
from stixel_cli.rendering.frames import RenderedFrames, StereoPairs
from stixel_cli.rendering.images import ImageStack, encode_pnm


@parameters
class Sensor:
    """The cameras' sensors: their effect on a noise-free picture. Grey levels are of 255.

    The variance of a grey value g is read_noise² + shot_noise² g / 255: photons are counted, so
    their noise grows with the root of the light.

    Attributes:
        read_noise: standard deviation in the dark, grey levels.
        disparity_error: px by which disparities are too large, as by a rig that is out of
            calibration: as `rig.disparity_error`, which does not follow it.
    """

    read_noise: Annotated[float, Ge(0), Le(50)]
    disparity_error: tuple[Pixels, Pixels, Pixels]

    shot_noise: ClassVar[float] = 1.8
    """Standard deviation that is added at full scale, grey levels."""
    right_gain: ClassVar[float] = 1.01
    """Brightness of the right camera over that of the left."""


LUMA = np.array([0.299, 0.587, 0.114], dtype=np.float32)
"""Weights of red, green and blue in grey, Rec. ITU-R BT.601."""


def add_sensor_noise(
    rendered: RenderedFrames, sensor: Sensor, rig: Rig, frames: range, seed: int
) -> StereoPairs:
    """Grey images (H, W) uint8 of `frames` with the sensors' noise.

    Each camera's noise at each k is drawn only from (seed, stage and camera, k), so the images do
    not depend on how frames are gathered into chunks. `rendered` has all of `frames`.
    """
    left, right = [], []
    for k in frames:
        index = k - rendered.first
        grey = grey_levels(rendered.left[index])
        left.append(_noisy(grey, sensor, generator(seed, "expose left", k)))
        grey = _moved_right(rendered, index, sensor, rig)
        grey *= np.float32(sensor.right_gain)
        right.append(_noisy(grey, sensor, generator(seed, "expose right", k)))
    return StereoPairs(frames.start, ImageStack(tuple(left)), ImageStack(tuple(right)))


def grey_levels(colour: np.ndarray) -> np.ndarray:
    """Luma (H, W) float32 in 0 … 255 of an RGB picture (H, W, 3) uint8."""
    return colour.astype(np.float32) @ LUMA


def noise_std(grey: np.ndarray, sensor: Sensor) -> np.ndarray:
    """Standard deviation of the noise in grey levels at the grey levels `grey`, any shape."""
    shot = np.float32(sensor.shot_noise**2 / 255.0) * np.maximum(grey, 0)
    return np.sqrt(np.float32(sensor.read_noise**2) + shot)


def _moved_right(rendered: RenderedFrames, index: int, sensor: Sensor, rig: Rig) -> np.ndarray:
    """Luma (H, W) of the right camera, moved to the left by the error, by cubic splines.

    The error of a point is that of its column in the left image.
    """
    grey = grey_levels(rendered.right[index])
    if not any(sensor.disparity_error):
        return grey
    from scipy.ndimage import map_coordinates

    v, u = np.mgrid[: grey.shape[0], : grey.shape[1]].astype(np.float64)
    seen = u - rig.disparity_from_depth(rendered.depth(index))
    # Where two points have one column in the right image, that on the right in the left is nearer.
    seen = np.minimum.accumulate(seen[:, ::-1], axis=1)[:, ::-1]
    columns = np.concatenate([np.interp(u[0], row, u[0]) for row in seen])
    error = rig.disparity_error_basis(columns) @ sensor.disparity_error
    return map_coordinates(grey, (v, u + error.reshape(u.shape)), order=3, mode="nearest")


def _noisy(grey: np.ndarray, sensor: Sensor, random: "np.random.Generator") -> bytes:
    drawn = random.integers(0, len(normal_quantiles()), grey.shape, dtype=np.uint16)
    grey += normal_quantiles()[drawn] * noise_std(grey, sensor)
    np.clip(np.rint(grey, out=grey), 0, 255, out=grey)
    return encode_pnm(grey.astype(np.uint8))


@cache
def normal_quantiles() -> np.ndarray:
    """Standard normal deviates (65536,) float32 that are equally likely, in ascending order.

    An integer of 16 bits that selects one costs a tenth of a normal deviate of NumPy's. Noise is
    rounded to grey levels afterwards, so steps this fine are not seen; the last deviate is 4.3.
    """
    count = 1 << 16
    quantile = NormalDist().inv_cdf
    return np.array([quantile((i + 0.5) / count) for i in range(count)], dtype=np.float32)
