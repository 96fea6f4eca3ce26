"""The runs of a study as one pandas frame."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import pandas as pd

from stixel_cli.results.result import RunResult

STIXELS, LIDAR, BASELINE = "stixels", "lidar", "point"
"""Kinds of measurement and of tracker that the questions name."""

GROUPS = ("road_user", "path", "measurement", "tracker")
"""Groups of the configuration that a frame of runs always has as columns."""


def run_frame(runs: Iterable[RunResult]) -> pd.DataFrame:
    """One row for each run: `run` itself, its setting, `seed` and metrics.

    Columns of the setting: `GROUPS`, each option as typed, or its kind if it is not swept;
    `measurement_kind` and `tracker_kind`; the other swept keys, as typed. `measurement` and
    `tracker` have the names of the field ("stixels", "GP-EKF"), followed by the other swept keys
    that distinguish them. Metrics are floats, NaN for a missing value.
    """
    runs = list(runs)
    names = {
        "measurement": _distinct_names(runs, "measurement", measurement_name),
        "tracker": _distinct_names(runs, "tracker", tracker_name),
    }
    rows = [
        {
            **{group: _option(run, group) for group in GROUPS},
            **run.setting,
            **{group: found[_setting(run, group)] for group, found in names.items()},
            "measurement_kind": run.configuration.measurement.kind,
            "tracker_kind": run.configuration.tracker.kind,
            "variant": run.variant,
            "seed": run.seed,
            "run": run,
            **run.metrics,
        }
        for run in runs
    ]
    columns = (
        None if rows else [*GROUPS, "measurement_kind", "tracker_kind", "variant", "seed", "run"]
    )
    frame = pd.DataFrame(rows, columns=columns)
    return frame.astype({name: float for run in runs for name in run.metrics})


def measurement_name(option: str, configuration: Any) -> str:
    """The field's name of a measurement: stixels, fabricated rays, a lidar with its layers."""
    measurement = configuration.measurement
    if measurement.kind == LIDAR:
        return f"{measurement.scanner.layers}-layer lidar"
    return {STIXELS: "stixels", "fabricated": "fabricated rays"}.get(measurement.kind, option)


def tracker_name(option: str, configuration: Any) -> str:
    """The field's name of a tracker, or else the option."""
    return {"gp_ekf": "GP-EKF", BASELINE: "point tracker"}.get(configuration.tracker.kind, option)


def _distinct_names(
    runs: Sequence[RunResult], group: str, name: Callable[[str, Any], str]
) -> dict[tuple, str]:
    """Setting of a group to a name; different settings have different names."""
    found: dict[tuple, tuple[str, str]] = {}
    for run in runs:
        key = _setting(run, group)
        if key not in found:
            option = _option(run, group)
            found[key] = (name(option, run.configuration), option)
    # Two options of one kind have the same name; the other swept keys do not make them two.
    options: dict[str, set[str]] = defaultdict(set)
    for text, option in found.values():
        options[text].add(option)
    return {
        key: ", ".join(
            [
                text if len(options[text]) == 1 else f"{text} ({option})",
                *(f"{name} {value}" for name, value in key[1:]),
            ]
        )
        for key, (text, option) in found.items()
    }


def _option(run: RunResult, group: str) -> str:
    return run.setting.get(group, getattr(run.configuration, group).kind)


def _setting(run: RunResult, group: str) -> tuple:
    """A group's option and other swept keys: the tracker's keys for it, the rest for the scans."""
    rest = [
        (key, value)
        for key, value in run.setting.items()
        if key not in GROUPS and key.startswith("tracker.") == (group == "tracker")
    ]
    return (run.setting.get(group), *rest)
