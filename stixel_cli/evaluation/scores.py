"""The scores of a run: errors over time, metrics, and those of tracks at labels."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class LabelScore:
    """One label of the class, over the frames in which it is neither truncated nor occluded.

    Attributes:
        label: track id in the files.
        range_m: median distance from the camera, m; NaN without such a frame.
        speed_m_s: of the label, m/s.
        expected: 1 if a track is expected: it moves, and is in as many frames as a track needs.
        frames: number of these frames.
        tracked_frames: those of them with a track.
        found_scans: number of scans from the first that has a point of the label to the one that
            confirmed its first track; NaN without one.
        tracks: number of different tracks that match the label in any frame.
        switches: changes from one of them to another.
        iou_box: mean intersection over union of the boxes, in the tracked frames; NaN without one.
        centre_m: mean centre error there, m; NaN without one.
    """

    label: str
    range_m: float
    speed_m_s: float
    expected: int
    frames: int
    tracked_frames: int
    found_scans: float
    tracks: int
    switches: int
    iou_box: float
    centre_m: float


@dataclass(frozen=True)
class Scores:
    """Errors over time and their summary.

    Attributes:
        times: (K,) s.
        centre_error: (K,) m; and orientation_error: (K,) rad in (-pi, pi], estimated minus true.
        iou, iou_box, nees_position, nis: (K,) as those of `ScanErrors`, at all scans; NaN where the
            truth is unknown. Of several tracks `nis` is their mean.
        metrics: name to value; None if the metric has no value.
        labels: of the labels of the class, with several tracks.
    """

    times: np.ndarray
    centre_error: np.ndarray
    orientation_error: np.ndarray
    iou: np.ndarray
    iou_box: np.ndarray
    nees_position: np.ndarray
    nis: np.ndarray
    metrics: dict[str, float | int | None]
    labels: tuple[LabelScore, ...] = ()


@dataclass(frozen=True)
class Series:
    """An error over time."""

    label: str
    """Full name."""
    short_label: str
    """Name where space is short."""
    unit: str
    """Of the values shown; "" without one."""
    bounds: tuple[float | None, float | None]
    """Least and greatest possible value; None where there is no bound."""
    consistent: float | None = None
    """The value of a perfect or consistent filter, to mark; None to mark no value."""
    factor: float = 1.0
    """From the unit of the field of `Scores` to `unit`."""
    ratio: bool = False
    """Whether the axis is logarithmic."""


SERIES = {
    "centre_error": Series("Centre error", "Centre error", "m", (0.0, None)),
    "orientation_error": Series(
        "Orientation error", "Orientation error", "°", (None, None), 0.0, float(np.degrees(1.0))
    ),
    "iou": Series("IoU of the outline", "IoU, outline", "", (0.0, 1.0)),
    "iou_box": Series("IoU of the box", "IoU, box", "", (0.0, 1.0)),
    "nees_position": Series(
        "Position NEES / 2", "Position NEES / 2", "", (0.0, None), 1.0, ratio=True
    ),
    "nis": Series("NIS / degrees of freedom", "NIS / d.o.f.", "", (0.0, None), 1.0, ratio=True),
}
"""Field of `Scores` to row, in the order in which figures show them."""
