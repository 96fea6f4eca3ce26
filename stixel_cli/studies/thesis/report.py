"""The report of the thesis's experiment, in the order of its chapter 9."""

from typing import TYPE_CHECKING, Any

from stixel_cli.config.folders import EXPERIMENT
from stixel_cli.studies.data import STIXELS, StudyData, StudyRun, chosen, names
from stixel_cli.studies.forest import difference_row, forest
from stixel_cli.studies.real_time import on_cores, real_time_table, seconds_a_scan
from stixel_cli.studies.rq1.report import by_frame, contact_sheet
from stixel_cli.studies.rq2.figures import over_time
from stixel_cli.studies.runs import (
    SCAN_ERRORS,
    ceilings_table,
    paired_difference,
    quantity,
    scan_frame,
)
from stixel_cli.studies.tables import MINUS
from stixel_cli.studies.thesis import figures
from stixel_cli.studies.thesis.runs import (
    MEASURES,
    NEAR,
    consistency_table,
    frame_of,
    level_table,
    scans_table,
    settings_table,
    statistics,
    tracking_table,
)
from stixel_cli.studies.types import Figure, Material, Picture

if TYPE_CHECKING:
    import pandas as pd

LEVELS = {
    "constant_noise": ("measurement.noise.range_std", "σ (m)"),
    "stereo_noise": ("measurement.noise.disparity_std", "σ (px)"),
}
"""Sweep of noise levels to its key and its label."""


def report(data: StudyData) -> Material:
    """Values, tables and figures of the template."""
    import pandas as pd

    frames = {
        name: frame_of(sweep, LEVELS.get(name, ("",))[0]) for name, sweep in data.sweeps.items()
    }
    runs = pd.concat([frames["fabricated"], frames["simulated"]], ignore_index=True)
    path = names(frames["simulated"], "path")[0]
    on_path = chosen(runs, path=path)
    ego = names(runs, "ego")[0]
    parked = chosen(on_path, ego=ego)
    users = names(runs, "road_user")
    options = list(dict.fromkeys(run.setting.get(EXPERIMENT, "thesis") for run in runs["run"]))
    matchers = pd.concat(
        [chosen(frames["simulated"], ego=ego), frames["block_matching"]], ignore_index=True
    )
    matchers["matcher"] = [run.configuration.stereo.kind for run in matchers["run"]]
    starts = pd.concat(
        [chosen(frames["fabricated"], ego=ego, path=path), frames["true_rates"]],
        ignore_index=True,
    )
    starts["rates"] = [run.configuration.start.rates for run in starts["run"]]
    return Material(
        {
            "users": users,
            "paths": names(runs, "path"),
            "path": path,
            "ego": ego,
            "egos": names(runs, "ego"),
            "kernels": names(runs, "tracker"),
            "measures": [(metric.short_label, metric.unit) for metric in MEASURES],
            "seeds": {name: sorted(names(frame, "seed")) for name, frame in frames.items()},
            "near": NEAR,
            "answers": _answers(parked),
            "ego_effect": _ego_effect(on_path),
            "forest": _forest(parked),
            "errors": {name: quantity(metric) for name, metric in SCAN_ERRORS.items()},
            "answer_table": tracking_table("answer", parked, ("road_user", "measurement")),
            "settings": settings_table("settings", options, users),
            "chapters": [_chapter(user, chosen(on_path, road_user=user), ego) for user in users],
            "pictures": _pictures(data),
            "all_paths": tracking_table(
                "all_paths", runs, ("road_user", "measurement", "path", "ego")
            ),
            "matchers": tracking_table("matchers", matchers, ("road_user", "matcher")),
            "starts": tracking_table("starts", starts, ("road_user", "rates")),
            "levels": {
                name: {
                    "figure": figures.levels(name, frames[name], key, label),
                    "table": level_table(f"{name}_table", frames[name], key, label),
                }
                for name, (key, label) in LEVELS.items()
            },
            "real_time": real_time_table("real_time", _kinds(parked)),
            "realtime_factor": _realtime_factor(parked),
        }
    )


def _answers(runs: "pd.DataFrame") -> list[dict[str, Any]]:
    """For each road user and kernel, the measures of each measurement."""
    return [
        {
            "user": user,
            "kernel": kernel,
            "measured": {
                measurement: statistics(
                    chosen(runs, road_user=user, tracker=kernel, measurement=measurement)
                )
                for measurement in names(runs, "measurement")
            },
        }
        for user in names(runs, "road_user")
        for kernel in names(runs, "tracker")
    ]


def _forest(runs: "pd.DataFrame") -> Figure | None:
    """Simulated minus fabricated: the measures of each road user and kernel."""
    rows = []
    for metric in MEASURES:
        for user in names(runs, "road_user"):
            for kernel in names(runs, "tracker"):
                own = chosen(runs, road_user=user, tracker=kernel)
                sides = (chosen(own, measurement_kind=kind) for kind in (STIXELS, "fabricated"))
                apart = paired_difference(*sides, metric.name)
                label = f"simulated {MINUS} fabricated"
                rows.append(difference_row(metric, label, user, kernel, apart))
    return forest("answer_forest", rows, "simulated better", "simulated worse")


def _ego_effect(runs: "pd.DataFrame") -> dict[str, dict[str, tuple[float, float]]]:
    """Measurement to ego motion to the least and greatest mean IoU over road users and kernels."""
    found: dict[str, dict[str, tuple[float, float]]] = {}
    for (measurement, ego), own in runs.groupby(["measurement", "ego"], sort=False):
        means = own.groupby(["road_user", "tracker"])["iou_mean"].mean()
        found.setdefault(measurement, {})[ego] = (float(means.min()), float(means.max()))
    return found


def _chapter(user: str, runs: "pd.DataFrame", ego: str) -> dict[str, Any]:
    """The values of one road user: sections 9.x.1 to 9.x.3, and its appendix."""
    scans = {one: scan_frame(chosen(runs, ego=one)) for one in names(runs, "ego")}
    measurements = names(runs, "measurement")
    parked = chosen(runs, ego=ego)
    fabricated = chosen(parked, measurement_kind="fabricated")
    first = runs["tracker"].iloc[0]
    return {
        "user": user,
        "paths": figures.paths(f"{user}_paths", chosen(runs, measurement_kind="fabricated")),
        "rays": figures.rays(f"{user}_rays", fabricated.sort_values("seed")["run"].iloc[0]),
        "scans": scans_table(f"{user}_scans", chosen(runs, tracker=first)),
        "tracking": tracking_table(f"{user}_tracking", runs, ("measurement", "ego")),
        "ceilings": ceilings_table(f"{user}_ceilings", runs, ("measurement",)),
        "consistency": consistency_table(f"{user}_consistency", runs, ("measurement", "ego")),
        "over_time": {
            one: over_time(f"{user}_{one}_over_time", own, measurements)
            for one, own in scans.items()
        },
        "radial": {
            measurement: figures.radial_functions(
                f"{user}_radius_{i}", chosen(parked, measurement=measurement)
            )
            for i, measurement in enumerate(measurements)
        },
    }


def _pictures(data: StudyData) -> dict[str, list[Picture]]:
    """Road user to the pictures of every stage, from its first run."""
    found: dict[str, list[Picture]] = {}
    for run in data.sweeps["pictures"].runs:
        user = _user(run)
        if user in found:
            continue
        for pictures in run.load("camera_pictures"):
            for frame, files in by_frame(pictures.files).items():
                sheet = contact_sheet(files, run.configuration.rig)
                name = f"{user}_stages_{frame:04d}"
                found.setdefault(user, []).append(Picture(name, "", sheet, "image/webp"))
    return found


def _user(run: StudyRun) -> str:
    return run.setting.get("road_user", run.configuration.road_user.kind)


def _kinds(runs: "pd.DataFrame") -> dict[str, list]:
    """Road user and measurement to their runs."""
    return {
        f"{user}, {measurement}": own["run"].tolist()
        for (user, measurement), own in runs.groupby(["road_user", "measurement"], sort=False)
    }


def _realtime_factor(runs: "pd.DataFrame") -> dict[str, tuple[float, float]]:
    """Measurement to the least and greatest sum / T on one core over the road users."""
    found: dict[str, list[float]] = {}
    for (measurement, _), own in runs.groupby(["measurement", "road_user"], sort=False):
        one, _ = on_cores(seconds_a_scan(own["run"].tolist()))
        sample_time = own["run"].iloc[0].configuration.path.sample_time
        found.setdefault(measurement, []).append(one / sample_time)
    return {measurement: (min(own), max(own)) for measurement, own in found.items()}
