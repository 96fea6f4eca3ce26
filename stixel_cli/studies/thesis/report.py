"""The report of the thesis's experiment, in the order of its chapter 9."""

import re
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import pandas as pd

from stixel_cli.config.choice import experiment_sources
from stixel_cli.config.compose import compose
from stixel_cli.config.folders import EXPERIMENT, shipped_folder
from stixel_cli.evaluation.metric_table import METRICS, metric, over_runs
from stixel_cli.report import scan_frame, tables
from stixel_cli.report.blocks import Cell, Figure, Material, Picture, Table
from stixel_cli.report.cost import on_cores, real_time_table, seconds_a_scan
from stixel_cli.report.forest import difference_row, forest
from stixel_cli.report.metrics import MINUS
from stixel_cli.report.run_frame import GROUPS, STIXELS, run_frame
from stixel_cli.studies.data import StudyData
from stixel_cli.studies.thesis import figures
from stixel_cli.studies.thesis.figures import MEASURES
from stixel_cli.sweeps.results import SweepResult

LEVELS = {
    "constant_noise": ("measurement.noise.range_std", "σ (m)"),
    "stereo_noise": ("measurement.noise.disparity_std", "σ (px)"),
}
"""Sweep of noise levels to its key and its label."""
CONSISTENCY = (
    *("nees_position_mean", "nis_mean"),
    *("iou_hull_mean", "iou_box_mean", "low_overlap_share", "track_lost"),
)
KERNELS = {"thesis": "the thesis", "thesis_improved": "our improvements"}


def report(data: StudyData) -> Material:
    """Values, tables and figures of the template."""
    frames = {
        name: frame_of(sweep, LEVELS.get(name, ("",))[0]) for name, sweep in data.sweeps.items()
    }
    runs = pd.concat([frames["fabricated"], frames["simulated"]], ignore_index=True)
    path, ego = tables.names(frames["simulated"], "path")[0], tables.names(runs, "ego")[0]
    on_path = tables.chosen(runs, path=path)
    parked = tables.chosen(on_path, ego=ego)
    users = tables.names(runs, "road_user")
    options = list(dict.fromkeys(run.setting.get(EXPERIMENT, "thesis") for run in runs["run"]))
    simulated = tables.chosen(frames["simulated"], ego=ego)
    matchers = pd.concat([simulated, frames["block_matching"]], ignore_index=True)
    matchers["matcher"] = [run.configuration.stereo.kind for run in matchers["run"]]
    fabricated = tables.chosen(frames["fabricated"], ego=ego, path=path)
    starts = pd.concat([fabricated, frames["true_rates"]], ignore_index=True)
    starts["rates"] = [run.configuration.start.rates for run in starts["run"]]
    by_kind = {
        f"{user}, {kind}": own["run"].tolist()
        for (user, kind), own in parked.groupby(["road_user", "measurement"], sort=False)
    }
    return Material(
        {
            "users": users,
            "paths": tables.names(runs, "path"),
            "path": path,
            "ego": ego,
            "egos": tables.names(runs, "ego"),
            "kernels": tables.names(runs, "tracker"),
            "seeds": {name: sorted(tables.names(frame, "seed")) for name, frame in frames.items()},
            "near": scan_frame.NEAR,
            "answers": _answers(parked),
            "lost": lost_share(tables.chosen(frames["fabricated"], ego=ego)),
            "page": page_table("thesis_and_project"),
            "ego_effect": _ego_effect(on_path),
            "forest": _forest(parked),
            "errors": scan_frame.ERROR_LABELS,
            "answer_table": tracking_table("answer", parked, ("road_user", "measurement")),
            "settings": Table.of("settings", settings_rows(options, users)),
            "chapters": [
                _chapter(user, tables.chosen(on_path, road_user=user), ego) for user in users
            ],
            "pictures": _pictures(data),
            "all_paths": tracking_table(
                "all_paths", runs, ("road_user", "measurement", "path", "ego")
            ),
            "matchers": tracking_table("matchers", matchers, ("road_user", "matcher")),
            "starts": tracking_table("starts", starts, ("road_user", "rates")),
            "levels": {name: _level(name, frames[name]) for name in LEVELS},
            "real_time": real_time_table("real_time", by_kind),
            "realtime_factor": _realtime_factor(parked),
        }
    )


def frame_of(sweep: SweepResult, level: str = "") -> pd.DataFrame:
    """The frame of a sweep's runs, as `data.run_frame`, with three columns set.

    `ego`: kind of the ego car's motion. `tracker`: the kernel, which depends on the option of
    `experiment`. `measurement`: its kind; further swept keys but the noise `level` follow.
    """
    runs = run_frame(sweep.runs)
    known = {*GROUPS, EXPERIMENT, "ego", "stereo", level}
    measured, kernels = [], []
    for run in runs["run"]:
        further = [f"{key} {value}" for key, value in run.setting.items() if key not in known]
        kind = run.configuration.measurement.kind
        measured.append(", ".join(["simulated" if kind == STIXELS else kind, *further]))
        option = run.setting.get(EXPERIMENT, "thesis")
        kernels.append(KERNELS.get(option, option))
    egos = [run.configuration.ego.kind for run in runs["run"]]
    return runs.assign(ego=egos, measurement=measured, tracker=kernels)


def tracking_table(
    name: str,
    runs: pd.DataFrame,
    keys: Sequence[str],
    measures: Sequence[str] = MEASURES,
    cells=tables.ends,
) -> Table:
    """One row for each combination of `keys`, and the measures of each kernel over the seeds."""
    labels = {one: tables.axis_label(metric(over_runs(one))) for one in measures}
    return Table.of(name, tables.rows_by(runs, keys, labels, cells, across="tracker"))


def _answers(runs: pd.DataFrame) -> list[dict[str, Any]]:
    """For each road user and kernel, the measures of each measurement."""
    return [
        {
            "user": user,
            "kernel": kernel,
            "measured": {
                measurement: [tables.mean_over(same, one) for one in MEASURES]
                for (measurement,), same in tables.groups(own, ["measurement"])
            },
        }
        for (user, kernel), own in tables.groups(runs, ["road_user", "tracker"])
    ]


def _forest(runs: pd.DataFrame) -> Figure | None:
    """Simulated minus fabricated: the measures of each road user and kernel."""
    rows = []
    by_kernel = tables.groups(runs, ["road_user", "tracker"])
    for name, ((user, kernel), own) in product(MEASURES, by_kernel):
        sides = (tables.chosen(own, measurement_kind=kind) for kind in (STIXELS, "fabricated"))
        apart = tables.difference(*sides, name)
        label = f"simulated {MINUS} fabricated"
        rows.append(difference_row(METRICS[name], label, user, kernel, apart))
    return forest("answer_forest", rows, "simulated better", "simulated worse")


def _ego_effect(runs: pd.DataFrame) -> dict[str, dict[str, tuple[float, float]]]:
    """Measurement to ego motion to the least and greatest mean IoU over road users and kernels."""
    found: dict[str, dict[str, tuple[float, float]]] = {}
    for (measurement, ego), own in runs.groupby(["measurement", "ego"], sort=False):
        means = own.groupby(["road_user", "tracker"])["iou_mean"].mean()
        found.setdefault(measurement, {})[ego] = (float(means.min()), float(means.max()))
    return found


def _chapter(user: str, runs: pd.DataFrame, ego: str) -> dict[str, Any]:
    """The values of one road user: sections 9.x.1 to 9.x.3, and its appendix."""
    measurements = tables.names(runs, "measurement")
    parked = tables.chosen(runs, ego=ego)
    fabricated = tables.chosen(parked, measurement_kind="fabricated")
    first = tables.chosen(runs, tracker=runs["tracker"].iloc[0])
    by_measurement = enumerate(tables.groups(parked, ["measurement"]))
    return {
        "user": user,
        "paths": figures.paths(f"{user}_paths", tables.chosen(runs, measurement_kind="fabricated")),
        "rays": figures.rays(f"{user}_rays", fabricated.sort_values("seed")["run"].iloc[0]),
        "scans": Table.of(f"{user}_scans", scan_frame.scan_rows(first, ["measurement", "ego"])),
        "tracking": tracking_table(f"{user}_tracking", runs, ("measurement", "ego")),
        "upper_bounds": scan_frame.upper_bounds_table(
            f"{user}_upper_bounds", runs, ("measurement",)
        ),
        "consistency": tracking_table(
            f"{user}_consistency", runs, ("measurement", "ego"), CONSISTENCY, tables.mean_cell
        ),
        "over_time": {
            one: scan_frame.over_time(
                f"{user}_{one}_over_time", scan_frame.scan_frame(own), measurements
            )
            for (one,), own in tables.groups(runs, ["ego"])
        },
        "radial": {
            name: figures.radial_functions(f"{user}_radius_{i}", own)
            for i, ((name,), own) in by_measurement
        },
    }


def _level(name: str, runs: pd.DataFrame) -> dict[str, Figure | Table]:
    """The figure and the table of a sweep of noise levels."""
    key, label = LEVELS[name]
    keys = ("road_user", label)
    return {
        "figure": figures.levels(name, runs, key, label),
        "table": tracking_table(f"{name}_table", runs.rename(columns={key: label}), keys),
    }


def _pictures(data: StudyData) -> dict[str, list[Picture]]:
    """Road user to the pictures of every stage, from its first run."""
    found: dict[str, list[Picture]] = {}
    for run in data.sweeps["pictures"].runs:
        user = run.setting.get("road_user", run.configuration.road_user.kind)
        if user not in found:
            found[user] = [
                picture for _, picture in scan_frame.stage_pictures(f"{user}_stages", run)
            ]
    return found


def settings_rows(options: Sequence[str], users: Sequence[str]) -> Iterator[dict[str, Cell]]:
    """Every choice and value of the experiments with its source, as their files state it."""
    sources = [experiment_sources(option) for option in options]
    for key in dict.fromkeys(key for own in sources for key in own):
        source = dict.fromkeys(own[key] for own in sources if key in own)
        values = {KERNELS.get(one, one): _value(one, key, users) for one in options}
        yield {"option or key": key, **values, "source": "; ".join(source)}


def _value(option: str, key: str, road_users: Sequence[str]) -> str:
    """The choice or value that an experiment gives; "by class" if the road users differ."""
    found = []
    for road_user in road_users:
        more = ["measurement=fabricated"] if key != "measurement" else []
        composed = compose([f"{EXPERIMENT}={option}", f"road_user={road_user}", *more])
        if key == "measurement.noise.disparity_std":
            # A key of the other noise.
            composed = compose([*composed.overrides, "measurement/noise=stereo"])
        found.append(composed.value(key))
    if len(set(map(str, found))) > 1:
        return "by class"
    value = found[0]
    return "null" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def lost_share(runs: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Kernel to the share of runs that lost the track, for each road user and path with any."""
    found: dict[str, dict[str, float]] = {one: {} for one in tables.names(runs, "tracker")}
    for (kernel, user, path), own in runs.groupby(["tracker", "road_user", "path"], sort=False):
        if own["track_lost"].any():
            found[kernel][f"{user} on {path}"] = float(own["track_lost"].mean())
    return found


def page_table(name: str) -> Table:
    """The table of docs/thesis.md: section by section, what is the same and what differs."""
    text = (shipped_folder("docs") / "thesis.md").read_text(encoding="utf-8")
    lines = re.findall(r"^\|(.*)\|$", re.sub(r"`|\]\([^)]*\)|\[", "", text), re.MULTILINE)
    rows = [tuple(cell.strip() for cell in line.split("|")) for line in lines]
    return Table(name, "", rows[0], tuple(rows[2:]))


def _realtime_factor(runs: pd.DataFrame) -> dict[str, tuple[float, float]]:
    """Measurement to the least and greatest sum / T on one core over the road users."""
    found: dict[str, list[float]] = {}
    for (measurement, _), own in runs.groupby(["measurement", "road_user"], sort=False):
        one, _ = on_cores(seconds_a_scan(own["run"].tolist()))
        sample_time = own["run"].iloc[0].configuration.path.sample_time
        found.setdefault(measurement, []).append(one / sample_time)
    return {measurement: (min(own), max(own)) for measurement, own in found.items()}
