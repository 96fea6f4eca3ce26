from dataclasses import fields

import numpy as np
import pytest
from constants import with_constants
from scipy.special import ndtr

from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering import frames
from stixel_cli.rendering.frames import RenderedFrames, StereoPairs
from stixel_cli.rendering.images import encode_png
from stixel_cli.rendering.sensor_noise import (
    Sensor,
    add_sensor_noise,
    grey_levels,
    noise_std,
    normal_quantiles,
)

NOTHING = (0.0, 0.0, 0.0)
SENSOR = with_constants(Sensor(read_noise=1.2, disparity_error=NOTHING), right_gain=1.0)
RIG = Rig(160, 120, 60.0, None, None, None, 0.3, 1.2, 0.0, None)


def noise_free(disparity_error=NOTHING, right_gain=1.0):
    return with_constants(Sensor(0.0, disparity_error), shot_noise=0.0, right_gain=right_gain)


def flat(count: int, value: int, first: int = 0, shape=(120, 160)) -> RenderedFrames:
    picture = np.full((*shape, 3), value, dtype=np.uint8)
    depth, ids = np.full(shape, 10.0), np.zeros(shape, dtype=np.uint8)
    return RenderedFrames.from_frames(first, ((picture, picture, depth, ids),) * count)


def test_sensor_images_do_not_depend_on_the_chunks_and_contain_no_truth():
    rendered = flat(4, 128, first=10)
    together = add_sensor_noise(rendered, SENSOR, RIG, range(10, 14), seed=3)
    assert together.first == 10 and len(together.left) == 4
    for some in (range(10, 12), range(12, 14)):
        part = add_sensor_noise(rendered, SENSOR, RIG, some, seed=3)
        at = slice(some.start - 10, some.stop - 10)
        assert part.first == some.start
        assert part.left.encoded == together.left.encoded[at]
        assert part.right.encoded == together.right.encoded[at]
    assert [field.name for field in fields(StereoPairs)] == ["first", "left", "right"]


def test_noise_differs_between_frames_cameras_and_seeds():
    rendered = flat(2, 128)
    pairs = add_sensor_noise(rendered, SENSOR, RIG, range(2), seed=3)
    other = add_sensor_noise(rendered, SENSOR, RIG, range(2), seed=4)
    images = [pairs.left[0], pairs.right[0], pairs.left[1], pairs.right[1], other.left[0]]
    correlation = np.corrcoef([image.ravel() for image in images])
    assert np.abs(correlation - np.eye(5)).max() < 0.03


@pytest.mark.parametrize("value", [20, 128, 220])
def test_noise_has_the_standard_deviation_of_the_parameters(value):
    image = add_sensor_noise(flat(1, value), SENSOR, RIG, range(1), seed=0).left[0].astype(float)
    expected = np.sqrt(1.2**2 + 1.8**2 * value / 255 + 1 / 12)
    assert abs(image.std() / expected - 1) < 0.03
    assert abs(image.mean() - value) < 0.06


def test_image_without_noise_is_the_luma_with_gain_on_the_right():
    picture = np.random.default_rng(0).integers(0, 256, (40, 50, 3)).astype(np.uint8)
    depth, ids = np.ones((40, 50)), np.zeros((40, 50), dtype=np.uint8)
    rendered = RenderedFrames.from_frames(0, [(picture, picture, depth, ids)])
    pairs = add_sensor_noise(rendered, noise_free(right_gain=1.1), RIG, range(1), seed=0)
    exact = picture @ np.array([0.299, 0.587, 0.114])
    assert np.abs(pairs.left[0] - exact).max() <= 0.5 + 1e-4
    assert np.abs(pairs.right[0] - np.minimum(1.1 * exact, 255)).max() <= 0.5 + 1e-4
    assert np.allclose(grey_levels(picture), exact, atol=1e-4)


def test_noise_is_normal_and_a_dark_image_has_only_read_noise():
    deviates = normal_quantiles().astype(float)
    assert np.array_equal(deviates, -deviates[::-1])
    below = (np.arange(65536) + 0.5) / 65536
    assert np.allclose(ndtr(deviates), below, rtol=1e-5, atol=1e-9)
    assert abs(deviates.std() - 1) < 2e-5
    # And every one of them can be drawn.
    dark = with_constants(Sensor(12.0, NOTHING), shot_noise=0.0)
    image = add_sensor_noise(flat(1, 128), dark, RIG, range(1), seed=1).left[0]
    noise = (image.astype(float) - 128) / 12
    assert abs((noise**4).mean() - 3) < 0.15 and noise.max() > 3.5 and noise.min() < -3.5
    assert noise_std(np.array([-3.0, 0.0]), SENSOR) == pytest.approx(1.2)


def test_frames_are_compressed_one_at_a_time(monkeypatch):
    """No frame is asked for before the one before it is stored: memory does not pile up."""
    picture = np.zeros((8, 8, 3), dtype=np.uint8)
    events = []

    def encode(image):
        events.append("store")
        return encode_png(image)

    def frame_arrays():
        for k in range(3):
            events.append("render")
            yield picture + np.uint8(k), picture, np.full((8, 8), k + 0.5), picture[..., 0]

    for name in ("encode_png", "encode_pnm"):
        monkeypatch.setattr(frames, name, encode)
    rendered = RenderedFrames.from_frames(5, frame_arrays())
    assert events == ["render", *["store"] * 5] * 3
    assert len(rendered.left) == 3 and rendered.left[2].max() == 2
    assert np.all(rendered.depth(1) == 1.5)


@pytest.mark.parametrize("curve", [(0.3, 0.0, 0.0), (0.0, 2.0, 0.0), (0.1, 0.0, 4.0)])
def test_the_right_image_is_shifted_by_the_error_of_disparity(curve):
    """A smooth stripe: its centre moves by exactly the error, in the right image alone."""
    columns = np.arange(160)

    def picture(centre):
        row = 200.0 * np.exp(-0.5 * ((columns - centre) / 6.0) ** 2)
        return np.rint(np.broadcast_to(row[None, :, None], (40, 160, 3))).astype(np.uint8)

    # At 10 px all of the picture has the stripe's disparity.
    depth = np.full((40, 160), RIG.depth_from_disparity(10.0))
    ids = np.zeros((40, 160), dtype=np.uint8)
    rendered = RenderedFrames.from_frames(0, [(picture(90.0), picture(80.0), depth, ids)])
    pairs = add_sensor_noise(rendered, noise_free(curve), RIG, range(1), seed=0)
    left, right = (image[0].astype(float).sum(axis=0) for image in (pairs.left, pairs.right))
    disparity = columns @ left / left.sum() - columns @ right / right.sum()
    x = (90.0 - RIG.u0) / RIG.focal
    assert disparity == pytest.approx(10.0 + np.dot(curve, [1.0, x, x**2]), abs=0.03)
