import numpy as np
import pytest

from stixel_cli.images import ImageStack, decode_image, encode_png, encode_pnm

SHAPE = 60, 80
RANDOM = np.random.default_rng(0)
IMAGES = {
    "picture": (np.indices(SHAPE).sum(axis=0)[:, :, None] + [0, 50, 100]).astype(np.uint8),
    "noise": RANDOM.normal(120.0, 3.0, SHAPE).astype(np.uint8),
    "any colours": RANDOM.integers(0, 256, (*SHAPE, 3), dtype=np.uint8),
    "upper 16 bits": np.full(SHAPE, 3, dtype=np.uint16),
    "lower 16 bits": RANDOM.integers(0, 65536, SHAPE, dtype=np.uint16),
    "ids": (np.indices(SHAPE)[1] // 20).astype(np.uint8),
}


@pytest.mark.parametrize("encode", [encode_png, encode_pnm])
@pytest.mark.parametrize("kind", IMAGES)
def test_an_image_survives_compression_and_its_bytes_repeat(kind, encode):
    image = IMAGES[kind]
    data = encode(image)
    assert data == encode(np.asfortranarray(image))
    again = decode_image(data)
    assert again.dtype == image.dtype and np.array_equal(again, image)
    stack = ImageStack.from_images([image, image[::-1]])
    assert len(stack) == 2 and np.array_equal(stack[1], image[::-1])


@pytest.mark.parametrize("kind", ["picture", "noise", "upper 16 bits", "ids"])
def test_what_can_be_compressed_is(kind):
    assert len(encode_png(IMAGES[kind])) < 0.75 * IMAGES[kind].nbytes


def test_what_is_no_image_is_refused():
    with pytest.raises(ValueError, match="not an image"):
        decode_image(b"no image")
    for image in (np.zeros((2, 3, 5), dtype=np.uint8), np.zeros((2, 3)), np.zeros((2, 3, 3))):
        with pytest.raises(ValueError, match=r"cannot encode an image of shape \(2, 3"):
            encode_png(image)
