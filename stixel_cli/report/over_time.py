"""Pictures of a whole run."""

from stixel_cli.evaluation.scores import Scores
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.scans import Scans
from stixel_cli.report import style
from stixel_cli.report.errors_figure import errors_figure
from stixel_cli.report.path_figure import path_figure
from stixel_cli.results.pictures import Pictures
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track


def run_pictures(
    scans: Scans, track: Track, scenario: Scenario, scores: Scores, rig: Rig
) -> Pictures:
    """`path` (contours along the path) and `errors` (over time), each as `.png` and `.svg`."""
    files = {}
    with style.drawing():
        for name, figure in (
            ("path", path_figure(track, scenario, rig)),
            ("errors", errors_figure(scans, track, scores)),
        ):
            files[f"{name}.png"] = style.png(figure)
            files[f"{name}.svg"] = style.svg(figure)
    return Pictures(files)
