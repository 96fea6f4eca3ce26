"""The folder of a tuning: `trials.csv`, a page, and a preset of the chosen trial."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Le
from matplotlib.axes import Axes

from stixel_cli.border import write_below, written
from stixel_cli.config.folders import group_options, of_the_machine
from stixel_cli.config.messages import validated
from stixel_cli.evaluation.metric_table import metric
from stixel_cli.files import read_yaml
from stixel_cli.parameters import parameters
from stixel_cli.pictures import style
from stixel_cli.report.blocks import Table
from stixel_cli.report.charts import Panel, chart
from stixel_cli.report.page import drawing_for_page, page_template, table_for_page
from stixel_cli.report.statistics import statistic
from stixel_cli.report.tables import ends, plain_label, table_csv, with_unit
from stixel_cli.results.folder import PAGE, write_whole_folder
from stixel_cli.results.reader import yaml_text
from stixel_cli.sweeps.tuning import Trial, Tuning

REQUEST = "tune.yaml"


@parameters
class TuneRequest:
    """The content of `tune.yaml`: the arguments of `Tuning`, and the number of trials."""

    overrides: list[str]
    objectives: list[str]
    over: list[str]
    seeds: Annotated[int, Ge(1), Le(1000)]
    trials: Annotated[int, Ge(1), Le(10_000)]


def create(folder: Path, request: TuneRequest) -> None:
    """Create the folder with its `tune.yaml`, with the errors of `whole_folder`."""
    write_whole_folder(folder, {REQUEST: yaml_text(vars(request))})


def read_request(folder: Path) -> TuneRequest:
    """The content of `tune.yaml`; UserError if this is not the folder of a tuning."""
    file = folder / REQUEST
    return validated(TuneRequest, read_yaml(file), file)


def write_outcome(folder: Path, tuning: Tuning, command: str) -> tuple[Trial, Table]:
    """Write the files, with the gain on fresh seeds; the chosen trial and the table of the gain.

    `command` writes them again. UserError if a run on a fresh seed fails.
    """
    best, trials = tuning.chosen(), _trials(tuning)
    pair = tuning.on_fresh_seeds(best)
    rows = zip(tuning.objectives, *(one.values for one in pair), strict=True)
    gains = zip(rows, tuning.differences(*reversed(pair), fresh=True), strict=True)
    gain = Table.of(
        "gain",
        (
            {"objective": _label(name), "n": one.n}
            | ends("default", statistic("", default))
            | ends("tuned", statistic("", tuned))
            | ends("tuned minus default", one)
            for (name, default, tuned), one in gains
        ),
    )
    page = page_template(__package__, "tune.html").render(
        title=folder.resolve().name,
        chosen=best,
        tables=[table_for_page(gain), table_for_page(trials)],
        figures=[
            (title, drawing_for_page(chart(f"t{i}", [panel]).svg.decode(), f"t{i}"))
            for i, (title, panel) in enumerate(_panels(tuning).items())
        ],
        command=command,
    )
    files = {"preset/experiment/tuned.yaml": preset_text(tuning, best, command)}
    with written(folder):
        write_below(folder, files | {"trials.csv": table_csv(trials), PAGE: page})
    return best, gain


def _label(name: str) -> str:
    """An objective with its better direction."""
    row = metric(name)
    text = f"|log({plain_label(row)})|" if row.better == "one" else with_unit(row)
    return f"{text}, {'more' if row.better == 'more' else 'less'} is better"


def _trials(tuning: Tuning) -> Table:
    """One row for the default and for each trial, with its means so far."""
    front = tuning.front()
    return Table.of(
        "trials",
        (
            {"trial": one.name, "state": "on the front" if one in front else one.state}
            | dict.fromkeys(tuning.parameters)
            | {override.key: override.value for override in tuning.overrides(one.settings)}
            | dict(
                zip(tuning.objectives, one.means.tolist() if one.values.size else (), strict=False)
            )
            for one in (tuning.default, *tuning.trials)
        ),
    )


def preset_text(tuning: Tuning, trial: Trial, command: str) -> str:
    """The experiment with the options and values of a trial, without seeds."""
    given = [*tuning.fixed, *tuning.overrides(trial.settings)]
    given = [one for one in given if not of_the_machine(one.key)]
    options = {one.key: one.value for one in given if one.key in group_options()}
    content: dict[str, Any] = {
        "defaults": [
            *({f"override /{k}": o} for k, o in options.items() if "/" not in k),
            "_self_",
        ],
        "inner_options": {k: o for k, o in options.items() if "/" in k},
    }
    for one in (one for one in given if one.key not in options):
        *parts, last = one.key.split(".")
        section = content
        for part in parts:
            section = section.setdefault(part, {})
        section[last] = one.value
    content["sources"] = dict.fromkeys(trial.settings, f"tuned: {command}")
    return f"# @package _global_\n{yaml_text(content)}"


def _panels(tuning: Tuning) -> dict[str, Panel]:
    """The objectives over the trials, the front of two, and the importance of each parameter."""
    tried = [one for one in tuning.trials if one.values.size and "failed" not in one.state]
    means, labels = np.array([one.means for one in tried]), [*map(_label, tuning.objectives)]

    def points(columns: np.ndarray, axes: Axes) -> None:
        for state, color in (("complete", style.RUNS[0]), ("stopped", style.UNUSED)):
            own = [i for i, one in enumerate(tried) if one.state == state]
            axes.plot(*columns[own].T, "o", color=color, markersize=3.0, label=state)

    def history(i: int, axes: Axes) -> None:
        points(np.column_stack([[int(one.name) for one in tried], means[:, i]]), axes)
        axes.axhline(tuning.default.means[i], color=style.TRUTH, linestyle="--", label="default")

    def pareto(axes: Axes) -> None:
        points(means, axes)
        axes.plot(*tuning.default.means, "*", color=style.TRUTH, label="default")
        axes.plot(*np.transpose([one.means for one in tuning.front()]), color=style.RUNS[2])

    panels = {
        f"History: {x}": Panel(partial(history, i), "", "trial", x) for i, x in enumerate(labels)
    }
    if len(labels) == 2:
        panels["Front"] = Panel(pareto, "", *labels)
    for i, label in enumerate(labels):
        shares = _importance(tuning, i)
        bars = partial(Axes.barh, y=[*shares], width=[*shares.values()], color=style.RUNS[0])
        panels |= {f"Importance: {label}": Panel(bars, x="share of the variance")} if shares else {}
    return panels


def _importance(tuning: Tuning, i: int) -> dict[str, float]:
    """Each parameter's share of an objective's variance (fANOVA); empty where it is unknown."""
    from optuna.importance import FanovaImportanceEvaluator, get_param_importances

    if len({one.means[i] for one in tuning.trials if one.state == "complete"}) < 2:
        return {}
    evaluator = FanovaImportanceEvaluator(seed=0)
    return get_param_importances(tuning.study, evaluator=evaluator, target=lambda t: t.values[i])
