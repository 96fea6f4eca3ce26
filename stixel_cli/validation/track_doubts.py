"""What is probably wrong with the file of `tracker=file`: its track beside the truth."""

from pathlib import Path

import numpy as np

from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.file import FileTrackParameters, rows_of_scans, states_of
from stixel_cli.tracking.track import Track

LEAST_OFFSET, FAR = 0.001, 2.0
"""Of rows from scans, s; of places from the truth, m: less is no fault of the file."""


def track_doubts(
    tracker: FileTrackParameters, scans: Scans, track: Track, truth: np.ndarray
) -> list[str]:
    """What is probably wrong with the file of a track, one line each.

    `track` is that of the file, `truth` (K, 3) the true poses in the world, NaN where unknown.
    """
    table, doubts = rows_of_scans(scans, tracker), []
    missing = len(scans) - len(table)
    if missing:
        of_all = f"{missing} of {len(scans)} scans have no row"
        doubts.append(f"{of_all}: each keeps the previous estimate")
    if "t" in table:
        offset = float(np.median(table["t"] - scans.times[table.index]))
        if abs(offset) > LEAST_OFFSET:
            doubts.append(f"its times differ by {offset:+.3f} s (median) from those of the scans")
    if "length" in table and table["length"].median() < table["width"].median():
        doubts.append("length and width are probably exchanged")
    if table["heading"].abs().max() > 4.0 * np.pi:
        doubts.append("the headings are probably in degrees: must be in radians")
    table = table[np.isfinite(truth[table.index]).all(axis=1)]
    if len(table):
        true, distances = truth[table.index], {}
        exchanged = table.rename(columns={"x": "y", "y": "x"})
        for name, rows in (("as they are", table), ("exchanged", exchanged)):
            for frame in ("world", "camera"):
                away = states_of(rows, scans, frame)[0][:, :2] - true[:, :2]
                distances[name, frame] = float(np.median(np.hypot(*away.T)))
        far, best = distances["as they are", tracker.frame], min(distances, key=distances.get)
        if far > max(FAR, 4.0 * distances[best]):
            name, frame = best
            doubts.append(
                f"with x and y (of KITTI: x and z) {name} and tracker.frame={frame} the median "
                f"distance to the truth would be {distances[best]:.2g} m instead of {far:.2g} m"
            )
        turned = wrap_angle(track.means[table.index, 2] - true[:, 2])
        angle = 90 * round(np.degrees(np.median(np.abs(turned))) / 90)
        if angle:
            doubts.append(f"the headings are probably off by {angle}°")
    return [f"tracker.path: {Path(tracker.path)}: {doubt}" for doubt in doubts]
