"""Scores of the labels of a recording: the result of the stage `label_scores`."""

from dataclasses import dataclass


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
