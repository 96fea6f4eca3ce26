"""The page of `stixel assess`: sentences, pictures, a table of values and times."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from stixel_cli.report.metrics import NO_VALUE
from stixel_cli.report.page import page_template, picture_for_page

PICTURES = (
    ("stixels", "Stixels, coloured by their depth"),
    ("height", "Free space (green), unknown (violet) and obstacles (red)"),
    ("disparity", "Disparity, coloured by the depth that it means"),
)
"""Name and caption of the pictures."""


@dataclass(frozen=True)
class Assessment:
    """How good the stixels of one pair are.

    Attributes:
        values: by name; a value is None where its truth is missing. Their meaning is in `LABELS`.
        pictures: PNG by name.
        seconds: time by stage; None for a stage whose result was in the cache.
    """

    values: Mapping[str, Any]
    pictures: Mapping[str, bytes]
    seconds: Mapping[str, float | None]


LABELS = {
    "stixel_share": ("columns with a stixel", "%", 100.0),
    "free_share": ("columns without an obstacle", "%", 100.0),
    "unknown_share": ("columns with an unknown part", "%", 100.0),
    "disparity_share": ("pixels with a disparity", "%", 100.0),
    "obstacle_columns": ("columns with a true obstacle", "", 1.0),
    "obstacle_covered_share": ("of them with a stixel", "%", 100.0),
    "compared_share": ("stixels with true disparities in their area", "%", 100.0),
    "stixels_compared": ("stixels compared", "", 1.0),
    "median_px": ("median size of the error", "px", 1.0),
    "beyond_1px_share": ("errors beyond 1 px", "%", 100.0),
    "square_compared": ("stixels compared, on square surfaces", "", 1.0),
    "square_median_px": ("median size of the error, on square surfaces", "px", 1.0),
    "square_beyond_1px_share": ("errors beyond 1 px, on square surfaces", "%", 100.0),
    "offset_px": ("offset of the images against the truth", "px", 1.0),
    "patches": ("patches that show it", "", 1.0),
    "square_median_px_aligned": ("median on square surfaces, offset removed", "px", 1.0),
    "square_beyond_1px_share_aligned": (
        "beyond 1 px on square surfaces, offset removed",
        "%",
        100.0,
    ),
    "near_columns": ("columns with a true obstacle nearer than 6 m", "", 1.0),
    "near_called_free": ("of them called free", "", 1.0),
}
"""Label, unit and factor of each value."""


def page_html(found: Assessment, command: str) -> str:
    """The page of an assessment; `command` is the command line that writes it."""
    return page_template(__package__, "assess").render(
        sentences=sentences(found),
        rows=[
            (label, shown(name, found.values[name]), unit)
            for name, (label, unit, _) in LABELS.items()
            if found.values[name] is not None
        ],
        pictures=[(caption, picture_for_page(found.pictures[name])) for name, caption in PICTURES],
        seconds=[
            (stage, "cached" if time is None else f"{1000.0 * time:.0f} ms")
            for stage, time in found.seconds.items()
        ],
        command=command,
    )


def shown(name: str, value: Any) -> str:
    """A value as text, in its unit."""
    if value is None:
        return NO_VALUE
    if isinstance(value, int):
        return str(value)
    _, unit, factor = LABELS[name]
    return f"{factor * value:.1f}" if unit == "%" else f"{factor * value:.2f}"


def sentences(found: Assessment) -> list[str]:
    """The answers, the most important first."""
    values = found.values

    def text(name: str) -> str:
        return shown(name, values[name])

    lines = []
    if values["square_median_px"] is not None:
        lines.append(
            f"On square surfaces the median error is {text('square_median_px')} px, and "
            f"{text('square_beyond_1px_share')} % of the errors are beyond 1 px "
            f"({text('square_compared')} stixels; {text('obstacle_covered_share')} % of the "
            "columns with a true obstacle have a stixel)."
        )
    if values["square_median_px_aligned"] is not None:
        lines.append(
            f"The images themselves are {text('offset_px')} px off the truth. Without this, the "
            f"median is {text('square_median_px_aligned')} px, and "
            f"{text('square_beyond_1px_share_aligned')} % are beyond 1 px."
        )
    if values["near_columns"] == 0:
        lines.append("No true obstacle is nearer than 6 m.")
    elif values["near_columns"] is not None:
        lines.append(
            f"{text('near_called_free')} of {text('near_columns')} columns with a true obstacle "
            "nearer than 6 m are called free."
        )
    lines.append(
        f"{text('stixel_share')} % of the columns have a stixel, {text('free_share')} % have no "
        f"obstacle, {text('unknown_share')} % have an unknown part."
    )
    return lines
