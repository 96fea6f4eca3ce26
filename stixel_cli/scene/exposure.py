"""The sensors: noise-free colour pictures become the grey images that all later stages see."""

import numpy as np

from stixel_cli.images import ImageStack, encode_png
from stixel_cli.randomness import generator
from stixel_cli.scene.frames import RenderedFrames, StereoPairs
from stixel_cli.scene.renderer_parameters import Sensor

LUMA = np.array([0.299, 0.587, 0.114], dtype=np.float32)
"""Weights of red, green and blue in grey, Rec. ITU-R BT.601."""


def expose(rendered: RenderedFrames, sensor: Sensor, frames: range, seed: int) -> StereoPairs:
    """Grey images (H, W) uint8 of `frames` with the sensors' noise.

    Each camera's noise at each k is drawn from (seed, stage and camera, k) alone, so the images do
    not depend on how frames are gathered into chunks.

    Args:
        rendered: noise-free pictures; holds all of `frames`.
        sensor: noise and gain.
        frames: indices k.
        seed: the experiment's.
    """
    left, right = [], []
    for k in frames:
        index = k - rendered.first
        left.append(_expose(rendered.left[index], 1.0, sensor, generator(seed, "expose left", k)))
        right.append(
            _expose(
                rendered.right[index], sensor.right_gain, sensor, generator(seed, "expose right", k)
            )
        )
    return StereoPairs(frames.start, ImageStack(tuple(left)), ImageStack(tuple(right)))


def grey_levels(colour: np.ndarray) -> np.ndarray:
    """Luma (H, W) float32 in 0 … 255 of an RGB picture (H, W, 3) uint8."""
    return colour.astype(np.float32) @ LUMA


def noise_deviation(grey: np.ndarray, sensor: Sensor) -> np.ndarray:
    """Standard deviation of the noise in grey levels at the grey levels `grey`, any shape."""
    shot = np.float32(sensor.shot_noise**2 / 255.0) * np.maximum(grey, 0)
    return np.sqrt(np.float32(sensor.read_noise**2) + shot)


def _expose(colour, gain: float, sensor: Sensor, random: np.random.Generator) -> bytes:
    grey = grey_levels(colour) * np.float32(gain)
    noise = random.standard_normal(grey.shape, dtype=np.float32)
    grey += noise * noise_deviation(grey, sensor)
    return encode_png(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
