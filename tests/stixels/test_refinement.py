import cv2
import numpy as np
import pytest

from stixel_cli.stixels.refinement import TOLERANCE, aligned

HEIGHT, WIDTH = 60, 80
AREA = np.array([[40, 43, 10, 49]])


def shifted(disparity, seed=0, noise=0.0):
    """Left and right images (H, W) uint8 of a smooth texture `disparity` px away."""
    random = np.random.default_rng(seed)
    texture = cv2.GaussianBlur(random.uniform(0, 255, (HEIGHT, 4 * WIDTH)), (0, 0), 7.0)
    texture = 128 + 10.0 * (texture - texture.mean())
    u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    images = []
    for offset in (0.0, disparity):
        at = (4.0 * (u + offset) - 200.0 + 240.0).astype(np.float32) % (4 * WIDTH - 8)
        image = cv2.remap(texture.astype(np.float32), at, v.astype(np.float32), cv2.INTER_CUBIC)
        image = image + noise * random.normal(size=image.shape)
        images.append(np.clip(np.rint(image), 0, 255).astype(np.uint8))
    return images


def align(left, right, start, scale=None, columns=None, error=0.0):
    scale = np.full(HEIGHT, 1 / 16, dtype=np.float32) if scale is None else scale
    if columns is None:
        columns = np.rint(start / scale).astype(np.int16)[None, :].repeat(WIDTH, axis=0)
    return aligned(left, right, columns, AREA, np.array([start]), scale, np.full(WIDTH, error))[0]


@pytest.mark.parametrize("fraction", [0.0, 0.13, 0.3, 0.5, 0.77])
def test_alignment_finds_the_shift_of_the_images(fraction):
    true = 7.0 + fraction
    left, right = shifted(true)
    for away in (-0.2, -0.1, 0.0, 0.15):
        assert align(left, right, true + away) == pytest.approx(true, abs=0.02)


def test_pitch_and_the_errors_of_the_rig_are_in_the_disparity_as_they_should():
    left, right = shifted(7.3)
    scale = np.full(HEIGHT, 1.25 / 16, dtype=np.float32)
    assert align(left, right, 7.2 * 1.25, scale) == pytest.approx(7.3 * 1.25, abs=0.03)
    left, right = shifted(7.5)
    assert align(left, right, 6.9, error=0.5) == pytest.approx(
        align(left, right, 7.4) - 0.5, abs=0.02
    )


def test_what_is_behind_the_face_does_not_count():
    """The stixel's own columns show a face; those next to it what is 0.6 px behind."""
    for seed in range(3):
        (left, right), (_, behind) = shifted(7.4, seed), shifted(6.8, seed)
        right[:, 36:], right[:, :31] = behind[:, 36:], behind[:, :31]
        columns = np.full((WIDTH, HEIGHT), round(16 * 6.8), dtype=np.int16)
        columns[40:43] = round(16 * 7.4)
        assert align(left, right, 7.35, columns=columns) == pytest.approx(7.4, abs=0.06)


def test_disparity_stays_where_the_images_say_nothing_better():
    left, right = shifted(7.3)
    # No texture; no row with the disparity; and a shift that is too far away to be reached.
    flat = np.full_like(left, 90)
    assert align(flat, flat, 7.2) == 7.2
    none = np.full((WIDTH, HEIGHT), -1, dtype=np.int16)
    assert align(left, right, 7.2, columns=none) == 7.2
    assert abs(align(left, right, 8.3) - 8.3) <= TOLERANCE
    # At the image's border there is nothing to align with.
    left_most = np.array([[0, 3, 10, 49]])
    scale = np.full(HEIGHT, 1 / 16, dtype=np.float32)
    columns = np.full((WIDTH, HEIGHT), 115, dtype=np.int16)
    assert (
        aligned(left, right, columns, left_most, np.array([7.2]), scale, np.zeros(WIDTH))[0] == 7.2
    )
