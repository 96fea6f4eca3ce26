"""The page of `stixel assess`: sentences, pictures, a table of values and times."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize

from stixel_cli.border.files import read_json
from stixel_cli.pictures import style
from stixel_cli.report.metrics import NO_VALUE
from stixel_cli.report.page import page_template, picture_for_page
from stixel_cli.stixels.types import Stixels
from stixel_cli.validation.pair_errors import AreaErrors

ERROR_MAP = "errors"
PICTURES = (
    (ERROR_MAP, "Errors of stixels; outlines: no truth"),
    ("rig_error", "Disparity error of the rig"),
    ("stixels", "Stixels, coloured by their depth"),
    ("height", "Free space (green), unknown (violet) and obstacles (red)"),
    ("disparity", "Disparity, coloured by the depth that it means"),
)
"""Name and caption of the pictures."""
MOST_ERROR = 3.0
"""px: greater errors have the same colour."""


@dataclass(frozen=True)
class Assessment:
    """How good the stixels of one pair are."""

    values: Mapping[str, Any]
    """By name; a value is None where its truth is missing. Their meaning is in `LABELS`."""
    pictures: Mapping[str, bytes]
    """PNG by name."""
    seconds: Mapping[str, float]
    """Time by stage, without loading or compiling code."""
    rig: Mapping[str, Any] = field(default_factory=dict)
    """What is known of the rig's disparity error, by name, and as `text`."""


LABELS = read_json(Path(__file__).parent / "templates" / "assess_labels.json")
"""Label and unit of each value; a share is shown in %."""


def page_html(found: Assessment, command: str) -> str:
    """The page of an assessment; `command` is the command line that writes it."""
    return page_template(__package__, "assess.html").render(
        sentences=sentences(found),
        rows=value_rows(found),
        pictures=[
            (caption, picture_for_page(found.pictures[name]))
            for name, caption in PICTURES
            if name in found.pictures
        ],
        seconds=[(stage, f"{1000.0 * time:.0f} ms") for stage, time in found.seconds.items()],
        command=command,
    )


def error_map(image: np.ndarray, stixels: Stixels, errors: AreaErrors) -> bytes:
    """PNG of the first frame's stixels in the colours of their errors, over the left image.

    Blue is too far, red too near. Stixels without enough true disparities are outlines. The image
    is (H, W) or (H, W, 3) uint8.
    """
    height, width = image.shape[:2]
    sides = np.stack([stixels.left, stixels.right, stixels.right, stixels.left], axis=1)
    ends = np.stack([stixels.top, stixels.top, stixels.base + 1, stixels.base + 1], axis=1)
    corners = np.stack([sides, ends], axis=2)[stixels.rows(0)] - 0.5
    scale = {"cmap": "coolwarm", "norm": Normalize(-MOST_ERROR, MOST_ERROR)}
    with style.drawing():
        figure = style.new_figure(12.0, 12.0 * height / width + 1.0, layout="constrained")
        axes = figure.subplots()
        axes.imshow(image, cmap="gray", vmin=0, vmax=255)
        axes.set_axis_off()
        axes.add_collection(PolyCollection(corners, facecolors="none", edgecolors="#ffffff80"))
        known = corners[errors.stixels]
        drawn = axes.add_collection(
            PolyCollection(known, array=errors.errors, edgecolors="face", **scale)
        )
        below = {"orientation": "horizontal", "extend": "both", "aspect": 60, "fraction": 0.05}
        figure.colorbar(drawn, ax=axes, label="found minus true disparity (px)", **below)
        return style.png(figure)


def value_rows(found: Assessment) -> list[tuple[str, str, str]]:
    """Label, text and unit of the values that are known."""
    return [
        (label, shown(name, found.values[name]), unit)
        for name, (label, unit) in LABELS.items()
        if found.values[name] is not None
    ]


def shown(name: str, value: Any) -> str:
    """A value as text, in its unit."""
    if value is None:
        return NO_VALUE
    if isinstance(value, int):
        return str(value)
    _, unit = LABELS[name]
    return f"{100.0 * value:.1f}" if unit == "%" else f"{value:.2f}"


def sentences(found: Assessment) -> list[str]:
    """The answers, the most important first."""
    text = {name: shown(name, value) for name, value in found.values.items()}
    template = page_template(__package__, "assess.txt")
    paragraphs = template.render(values=found.values, text=text, rig=found.rig).split("\n\n")
    lines = (" ".join(paragraph.splitlines()).strip() for paragraph in paragraphs)
    return [line for line in lines if line]
