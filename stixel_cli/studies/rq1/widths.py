"""Stixels of several widths, judged by the tracker on a turn; and the same with fewer points."""

import numpy as np

from stixel_cli.evaluation.evaluate import evaluate
from stixel_cli.measurements.scans import Scans
from stixel_cli.report.blocks import Table
from stixel_cli.report.statistics import Statistic, over_seeds
from stixel_cli.report.tables import ends, spread
from stixel_cli.studies.data import StudyRun, StudySweep
from stixel_cli.tracking import gp_ekf


def width_values(sweep: StudySweep) -> dict[str, dict[str, Statistic]]:
    """Label of a width to its statistics over the seeds: `iou`, `nees`, `points`, `bias`, `std`.

    The widths as they are; then the narrowest, with so few of its points that a scan has about as
    many as with the widest: every m-th in order of the bearing. `bias` and `std` are those of the
    points along the ray, m.
    """
    widths = sorted({run.configuration.extraction.width for run in sweep.runs})
    found = {}
    for width in widths:
        runs = [run for run in sweep.runs if run.configuration.extraction.width == width]
        found[f"{width} px"] = _statistics(runs, 1)
    step = round(widths[-1] / widths[0])
    if step > 1:
        runs = [run for run in sweep.runs if run.configuration.extraction.width == widths[0]]
        found[f"{widths[0]} px, one point of {step}"] = _statistics(runs, step)
    return found


def _statistics(runs: list[StudyRun], step: int) -> dict[str, Statistic]:
    values: dict[str, list[float | None]] = {}
    for run in runs:
        errors, metrics, scans = run.load("point_errors"), run.metrics, run.load("scans")
        if step > 1:
            scans = every(scans, step)
            tracker, prior = run.configuration.tracker, run.configuration.prior
            track = gp_ekf.track(scans, run.load("start"), prior, tracker)
            metrics = evaluate(track, run.load("scenario"), scans).metrics
        own = {
            "points": float(np.diff(scans.offsets).mean()),
            "bias": float(errors.along.mean()) if len(errors.along) else None,
            "std": float(errors.along.std()) if len(errors.along) else None,
            "iou": metrics["iou_mean"],
            "nees": metrics["nees_position_mean"],
        }
        for name, value in own.items():
            values.setdefault(name, []).append(value)
    return {name: over_seeds(own) for name, own in values.items()}


def every(scans: Scans, step: int) -> Scans:
    """The scans with every `step`-th point, in order of the bearing from the sensor."""
    kept = []
    for k, pose in enumerate(scans.sensor_poses_world):
        rows = scans.rows(k)
        points, covariances = scans.points_world[rows], scans.covariances_world[rows]
        away = points - pose[:2]
        order = np.argsort(np.arctan2(away[:, 1], away[:, 0]), kind="stable")[step // 2 :: step]
        kept.append((points[order], covariances[order]))
    return Scans.of_each(
        scans.times, scans.sensor_poses_world, kept, field_of_view=scans.field_of_view
    )


def width_table(values: dict[str, dict[str, Statistic]]) -> Table:
    """One row for each width of `width_values`."""
    return Table.of(
        "widths",
        (
            {
                "width": label,
                "points a scan": own["points"].mean,
                "bias along the ray (m)": own["bias"].mean,
                **spread("std along the ray (m)", own["std"]),
                "n": own["iou"].n,
                **ends("mean IoU", own["iou"]),
                **ends("mean NEES / 2", own["nees"]),
            }
            for label, own in values.items()
        ),
    )
