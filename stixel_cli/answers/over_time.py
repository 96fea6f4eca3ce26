"""Errors over time of the options of an answer, read from the folders of their runs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.answers.answer import Answer
from stixel_cli.answers.question import FOLDER, STATUS
from stixel_cli.errors import UserError
from stixel_cli.evaluation.scores import SERIES
from stixel_cli.report.error_curves import MOST_LINES, Errors
from stixel_cli.results.reader import read_series
from stixel_cli.results.result import DONE

SHARES = np.linspace(0.0, 1.0, 101)
"""Shares of a run at which errors over time are compared where the runs have different times."""
MOST_READ = 400
"""Most runs whose errors over time a page reads: two seconds."""

Series = dict[str, np.ndarray]
"""Fields of `Scores` to their values over time."""


def over_time(answer: Answer) -> dict[str, Errors]:
    """Errors over time of the best options: of each, the mean of each unit's runs.

    Over the time, if all runs have the same times; else over the share of each run. {} where
    `errors_of_runs` is.
    """
    found = errors_of_runs(answer)
    every = [one for units in found.values() for own in units.values() for one in own]
    if not every:
        return {}
    same = all(np.array_equal(every[0][0], times) for times, _ in every)
    names = set.intersection(*(set(series) for _, series in every))
    return {
        option: (every[0][0] if same else SHARES, _stacked(units, names, same))
        for option, units in found.items()
    }


def errors_of_runs(answer: Answer) -> dict[str, dict[Any, list[tuple[np.ndarray, Series]]]]:
    """Times and errors of the runs of each unit of the best options.

    They are of the scenarios and units that the means are over. {} without folders, with too many
    of them, or if a file cannot be read.
    """
    runs = answer.runs[answer.runs[STATUS] == DONE]
    balanced = runs["scenario"].isin(answer.scenarios) & runs["unit"].isin(answer.values.index)
    runs = runs[balanced]
    options = answer.order[:MOST_LINES]
    if FOLDER not in runs or len(runs[runs["option"].isin(options)]) > MOST_READ:
        return {}
    found: dict[str, dict[Any, list[tuple[np.ndarray, Series]]]] = {}
    for option in options:
        for _, run in runs[runs["option"] == option].iterrows():
            try:
                errors = read_series(Path(str(run[FOLDER])) / "scores.npz")
            except UserError:
                return {}
            found.setdefault(str(option), {}).setdefault(run["unit"], []).append(errors)
    return found


def _stacked(units: Mapping, names: set[str], same: bool) -> dict[str, np.ndarray]:
    stacked = {}
    for name in names:
        rows = [
            np.mean([_resampled(*one, name, same) for one in own], axis=0) for own in units.values()
        ]
        values = SERIES[name].factor * np.stack(rows)
        stacked[name] = np.abs(values) if name == "orientation_error" else values
    return {name: values for name, values in stacked.items() if np.isfinite(values).any()}


def _resampled(
    times: np.ndarray, series: Mapping[str, np.ndarray], name: str, same: bool
) -> np.ndarray:
    if same or len(times) < 2:
        return series[name]
    share = (times - times[0]) / (times[-1] - times[0])
    return np.interp(SHARES, share, series[name])
