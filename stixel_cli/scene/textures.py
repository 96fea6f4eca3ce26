"""Procedural textures: detail at every scale, so that stereo matches them from near and far.

Each is an RGB image (h, w, 3) uint8, h and w powers of two, that repeats without a seam, but for
the fronts of houses. The noise has as much variance in each octave as in the next, like many a real
surface.
"""

import zlib
from functools import lru_cache

import numpy as np

SIZE, BAYS = 512, 3

Colour = tuple[float, float, float]
"""Red, green, blue, 0 … 255 each."""


@lru_cache(maxsize=64)
def noise(name: str, size: int = SIZE, coarsest: float = 1.0, finest: float = 256.0) -> np.ndarray:
    """Seamless noise (size, size) float32 of mean 0 and variance 1, always the same for a `name`.

    Octaves between `coarsest` and `finest` cycles an image have equal variance.
    """
    draws = np.random.default_rng(zlib.crc32(name.encode())).standard_normal((size, size))
    frequency, gain = _frequencies(size)
    spectrum = np.fft.rfft2(draws)
    spectrum *= np.where((frequency >= coarsest) & (frequency <= finest), gain, 0.0)
    values = np.fft.irfft2(spectrum, s=(size, size))
    values -= values.mean()
    # NumPy's `std` would subtract the mean again.
    values = (values / np.sqrt(np.mean(values * values))).astype(np.float32)
    values.setflags(write=False)
    return values


@lru_cache(maxsize=4)
def _frequencies(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (size, size // 2 + 1), cycles an image, and 1 / frequency, 1 where below 1."""
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)) * size
    return frequency, 1.0 / np.maximum(frequency, 1.0)


def tinted(colour: Colour, values: np.ndarray, hue: np.ndarray | None = None) -> np.ndarray:
    """`colour`, brightened by the factors exp(`values`), (h, w).

    `hue` (h, w) shifts it from blue to red by that share.
    """
    brightness = np.exp(values)
    image = np.empty((*brightness.shape, 3), dtype=np.uint8)
    # Channel by channel: NumPy is slow where the last axis has three values.
    for channel, (level, shift) in enumerate(
        zip(np.array(colour, np.float32), np.array([1.0, 0.1, -1.0], np.float32), strict=True)
    ):
        plane = level * brightness
        if hue is not None:
            plane *= 1.0 + hue * shift
        image[..., channel] = np.clip(np.rint(plane, out=plane), 0, 255, out=plane)
    return image


@lru_cache(maxsize=64)
def mottled(name: str, colour: Colour, depth: float, coarsest: float = 1.0) -> np.ndarray:
    """`colour` with noise of relative standard deviation `depth`, and a little of it in hue."""
    values = np.clip(noise(name, 256, coarsest), -2.5, 2.5)
    hue = np.clip(noise(name + " hue", 256, coarsest), -2.5, 2.5)
    image = tinted(colour, depth * values - 0.5 * depth**2, 0.15 * depth * hue)
    image.setflags(write=False)
    return image


def paint(colour: Colour, contrast: float) -> np.ndarray:
    """Car paint: plain at `contrast` 0; clouded, with flakes and grime, at 1."""
    flakes = noise("paint flakes", coarsest=12.0)
    clouds = noise("paint clouds", finest=24.0)
    values = contrast * (0.26 * np.clip(flakes, -2.2, 2.2) + 0.17 * np.clip(clouds, -2, 2))
    return tinted(colour, values, 0.06 * contrast * clouds)


def cloth(colour: Colour, contrast: float, checks: int = 0) -> np.ndarray:
    """Cloth: folds and weave; with `checks` bands a tile, a checked shirt."""
    folds = np.clip(noise("folds", coarsest=3.0), -2.3, 2.3)
    values = contrast * 0.23 * folds
    if checks:
        phase = (np.arange(SIZE) * checks / SIZE) % 1.0
        band = np.where(phase < 0.5, 1.0, -1.0) + np.where(abs(phase - 0.75) < 0.06, 1.4, 0.0)
        values = values + contrast * 0.17 * (band[:, None] + band[None, :])
    return tinted(colour, values.astype(np.float32), 0.05 * contrast * folds)


def asphalt(contrast: float) -> np.ndarray:
    """Asphalt: stones, patches, and a few tarred cracks. Made for tiles of some metres."""
    size = 1024
    stones = np.clip(noise("asphalt stones", size, 48.0, 512.0), -2.5, 2.5)
    patches = np.clip(noise("asphalt patches", size, 1.0, 48.0), -2.2, 2.2)
    cracks = np.abs(noise("asphalt cracks", size, 2.0, 64.0))
    tar = -0.55 * np.exp(-((cracks / 0.012) ** 2)) * (noise("tar", size, 1.0, 6.0) > 0.6)
    values = contrast * (0.19 * stones + 0.10 * patches + tar)
    return tinted((108, 108, 110), values.astype(np.float32), 0.02 * contrast * patches)


def paving(contrast: float) -> np.ndarray:
    """Pavement of square slabs, eight a tile."""
    slabs, step = 8, SIZE // 8
    rows = np.arange(SIZE) % step
    joint = (rows < 3)[:, None] | (rows < 3)[None, :]
    tones = np.random.default_rng(11).normal(0.0, 0.10, (slabs, slabs))
    slab = np.kron(tones, np.ones((step, step)))
    grain = np.clip(noise("paving", coarsest=4.0), -2.4, 2.4)
    values = contrast * (slab + 0.15 * grain - 0.5 * joint)
    return tinted((150, 145, 137), values.astype(np.float32))


def leaves(name: str, colour: Colour, contrast: float) -> np.ndarray:
    """Foliage: clumps of light and shadow."""
    clumps = noise(name, SIZE, 5.0, 128.0)
    values = contrast * 0.5 * np.clip(clumps, -2.2, 2.0)
    return tinted(colour, values, 0.10 * contrast * np.clip(noise(name + " hue"), -2, 2))


def facade(name: str, colour: Colour, floors: int, brick: bool, contrast: float) -> np.ndarray:
    """A house front, (512, 512, 3) uint8: laid on once over a wall, not repeated.

    Args:
        name: of the front; its windows and stains depend on it.
        colour: of the wall.
        floors: rows of `BAYS` windows; a door is in the middle of the lowest row.
        brick: courses of bricks, or plaster.
        contrast: 0 … 1.
    """
    grain = np.clip(noise(name, SIZE, 2.0), -2.4, 2.4)
    values = contrast * (0.11 if brick else 0.13) * grain
    if brick:
        values = values + contrast * _bricks(name)
    image = tinted(colour, values.astype(np.float32), 0.02 * grain).astype(np.float32)
    draws = np.random.default_rng(len(name) * 7919 + sum(name.encode()))
    panes = tinted((58, 68, 80), 0.30 * np.clip(noise(name + " panes", SIZE, 3.0), -2, 2))
    storey, bay = SIZE // floors, SIZE // BAYS
    for floor in range(floors):
        for column in range(BAYS):
            top, left = floor * storey + storey // 4, column * bay + bay // 4
            bottom, right = top + storey // 2, left + bay // 2
            if floor == floors - 1 and column == BAYS // 2:
                _door(image, draws, top, left, SIZE, right)
                continue
            _window(image, panes, draws, (top, left, bottom, right))
        # A ledge below each storey, in light and in its own shadow.
        edge = floor * storey
        image[edge : edge + 5] *= 1.25
        image[edge + 5 : edge + 10] *= 0.70
    image[-14:] *= 0.62
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def _bricks(name: str) -> np.ndarray:
    """Logarithmic brightness of courses of bricks: 64 courses, every second one shifted."""
    course, length = 8, 16
    rows, columns = np.indices((SIZE, SIZE))
    shifted = columns + (rows // course % 2) * (length // 2)
    tones = np.random.default_rng(sum(name.encode())).normal(0.0, 0.17, (64, 32))
    brick = tones[rows // course, shifted // length % 32]
    joint = (rows % course == 0) | (shifted % length == 0)
    return np.where(joint, 0.30, brick)


def _window(image, panes, draws, place):
    top, left, bottom, right = place
    frame = np.array([232.0, 230.0, 224.0]) * draws.uniform(0.75, 1.0)
    image[top - 6 : bottom + 4, left - 6 : right + 6] *= 0.72
    image[top - 3 : bottom + 3, left - 3 : right + 3] = frame
    image[top:bottom, left:right] = panes[top:bottom, left:right] * draws.uniform(0.7, 1.7)
    middle = (left + right) // 2
    image[top:bottom, middle - 1 : middle + 2] = frame
    bar = top + (bottom - top) // 3
    image[bar : bar + 3, left:right] = frame
    if draws.uniform() < 0.5:
        curtain = (right - left) // 5
        tone = draws.uniform(0.55, 0.95)
        for side in (slice(left, left + curtain), slice(right - curtain, right)):
            image[bar + 3 : bottom, side] = np.array([214.0, 200.0, 176.0]) * tone
    image[bottom + 3 : bottom + 8, left - 9 : right + 9] = frame * 0.85
    image[bottom + 8 : bottom + 12, left - 9 : right + 9] *= 0.6


def _door(image, draws, top, left, bottom, right):
    colour = draws.uniform(40.0, 130.0, 3)
    image[top - 8 : bottom, left - 8 : right + 8] = np.array([196.0, 190.0, 180.0])
    image[top:bottom, left:right] = colour
    height, width = (bottom - top) // 4, (right - left) // 2
    for row in range(4):
        for column in range(2):
            r, c = top + row * height + 6, left + column * width + 5
            image[r : r + height - 10, c : c + width - 10] = colour * (0.75 if row else 1.5)


def roof_tiles(name: str, colour: Colour, contrast: float) -> np.ndarray:
    """Rows of roof tiles, (512, 512, 3) uint8, seamless."""
    rows, columns = np.indices((SIZE, SIZE))
    step = 32
    tones = np.random.default_rng(sum(name.encode())).normal(0.0, 0.16, (16, 16))
    tile = tones[rows // step, (columns + rows // step % 2 * step // 2) // step % 16]
    lip = -0.5 * (rows % step < 4) + 0.12 * np.cos(2.0 * np.pi * columns / step)
    grain = np.clip(noise(name, SIZE, 2.0), -2.4, 2.4)
    return tinted(colour, (contrast * (tile + lip + 0.15 * grain)).astype(np.float32))
