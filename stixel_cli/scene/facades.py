"""Textures of houses: fronts with windows and doors, and roofs of tiles."""

import numpy as np

from stixel_cli.scene.textures import SIZE, Colour, noise, tinted


def facade(
    name: str, colour: Colour, floors: int, bays: int, brick: bool, contrast: float
) -> np.ndarray:
    """A house front, (512, 512, 3) uint8: laid on once over a wall, not repeated.

    Args:
        name: of the front; its windows and stains depend on it.
        colour: of the wall.
        floors, bays: rows and columns of windows; a door is in the middle of the lowest row.
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
    storey, bay = SIZE // floors, SIZE // bays
    for floor in range(floors):
        for column in range(bays):
            top, left = floor * storey + storey // 4, column * bay + bay // 4
            bottom, right = top + storey // 2, left + bay // 2
            if floor == floors - 1 and column == bays // 2:
                _door(image, draws, top, left, SIZE, right)
                continue
            _window(image, panes, draws, top, left, bottom, right)
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


def _window(image, panes, draws, top, left, bottom, right):
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
