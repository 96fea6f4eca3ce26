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
        found_s: time from the first of these frames to the first with a track, s; NaN without one.
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
    found_s: float
    tracks: int
    switches: int
    iou_box: float
    centre_m: float


@dataclass(frozen=True)
class LabelScores:
    """The labels of the class, in the order of the files, and the tracks.

    Attributes:
        labels: one score per label of the class.
        tracks: number of tracks.
        false_tracks: those that match no label in more than half of their scans. Labels of other
            classes and hidden ones count as labels here.
    """

    labels: tuple[LabelScore, ...]
    tracks: int
    false_tracks: int

    @property
    def metrics(self) -> dict[str, float | int | None]:
        """Sums over the expected labels, by the names of `metric_table.OF_LABELS`."""
        expected = [one for one in self.labels if one.expected]
        tracked = [one for one in expected if one.tracked_frames]
        frames = sum(one.tracked_frames for one in tracked)

        def over_frames(name: str) -> float | None:
            values = sum(getattr(one, name) * one.tracked_frames for one in tracked)
            return values / frames if frames else None

        return {
            "labels_expected": len(expected),
            "labels_tracked": len(tracked),
            "labels_tracked_share": (
                frames / sum(one.frames for one in expected) if expected else None
            ),
            "labels_iou_box_mean": over_frames("iou_box"),
            "labels_centre_mean_m": over_frames("centre_m"),
            "label_switches": sum(one.switches for one in expected),
            "tracks_found": self.tracks,
            "tracks_false": self.false_tracks,
        }


@dataclass(frozen=True)
class Scores:
    """Errors over time and their summary.

    Attributes:
        times: (K,) s.
        centre_error: (K,) m.
        orientation_error: (K,) rad in (-pi, pi], estimated minus true; NaN if missing.
        iou: (K,) intersection over union of the estimated and the true outline, 0 … 1; NaN where
            only the true box is known.
        iou_box: (K,) the same of the boxes, each along its own heading.
        nees_position: (K,) position NEES divided by 2: 1 is consistent.
        nis: (K,) NIS divided by its degrees of freedom: 1 is consistent; NaN for an empty scan.
        metrics: name to value; None if the metric has no value.
        labels: of the tracks of moving objects, against the labels; None without.
    """

    times: np.ndarray
    centre_error: np.ndarray
    orientation_error: np.ndarray
    iou: np.ndarray
    iou_box: np.ndarray
    nees_position: np.ndarray
    nis: np.ndarray
    metrics: dict[str, float | int | None]
    labels: LabelScores | None = None


@dataclass(frozen=True)
class Series:
    """An error over time.

    Attributes:
        label: full name.
        short_label: name where space is short.
        unit: of the values shown; "" without one.
        factor: from the unit of the field of `Scores` to `unit`.
        bounds: least and greatest possible value; None where there is no bound.
        consistent: the value of a perfect or consistent filter, to mark; None to mark no value.
        ratio: whether the axis is logarithmic.
    """

    label: str
    short_label: str
    unit: str
    bounds: tuple[float | None, float | None]
    consistent: float | None = None
    factor: float = 1.0
    ratio: bool = False


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
