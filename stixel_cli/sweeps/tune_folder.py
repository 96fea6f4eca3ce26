"""The folder of a tuning: `trials.csv`, a page, and a preset of the chosen trial."""

from pathlib import Path
from typing import Annotated, Any

import pandas as pd
from annotated_types import Ge, Le

from stixel_cli.answers.answer import Answer
from stixel_cli.answers.figures import differences
from stixel_cli.answers.render import Cells, cells_of
from stixel_cli.border import write_below, written
from stixel_cli.config.folders import group_options, of_the_machine
from stixel_cli.config.messages import validated
from stixel_cli.evaluation.metric_table import metric
from stixel_cli.files import read_yaml
from stixel_cli.parameters import parameters
from stixel_cli.report.metrics import number
from stixel_cli.report.page import drawing_for_page, page_template
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


def write_outcome(folder: Path, tuning: Tuning, command: str) -> tuple[Trial, list[Answer]]:
    """Write the files, with the gain on fresh seeds; the chosen trial and the answers of the gain.

    `command` writes them again. UserError if a run on a fresh seed fails.
    """
    best, trials = tuning.chosen(), trials_frame(tuning)
    pair = tuning.on_fresh_seeds(best)
    gain = tuning.answers(pair, pair[0].name, fresh=True)
    page = page_template(__package__, "tune.html").render(
        title=folder.resolve().name,
        chosen=best,
        gain=[(label(one.question.metric), one.sentence) for one in gain],
        gain_figures=[drawing_for_page(differences(one), f"g{i}") for i, one in enumerate(gain)],
        cells=cells_of(trials),
        parameters=_parameters(tuning, best),
        command=command,
    )
    files = {"preset/experiment/tuned.yaml": preset_text(tuning, best, command)}
    files |= {"trials.csv": trials.to_csv(index=False, lineterminator="\n"), PAGE: page}
    with written(folder):
        write_below(folder, files)
    return best, gain


def label(name: str) -> str:
    """An objective with its better direction."""
    row = metric(name)
    unit = f" ({row.unit})" if row.unit else ""
    text = f"|log({row.short_label})|" if row.better == "one" else row.short_label + unit
    return f"{text}, {'more' if row.better == 'more' else 'less'} is better"


def trials_frame(tuning: Tuning) -> pd.DataFrame:
    """One row for the default and for each trial, with its means so far."""
    front = tuning.front()
    return pd.DataFrame(
        {"trial": one.name, "state": "on the front" if one in front else one.state}
        | dict.fromkeys(tuning.parameters)
        | {override.key: override.value for override in tuning.overrides(one.settings)}
        | dict(zip(tuning.objectives, one.means.tolist() if one.values.size else (), strict=False))
        for one in (tuning.default, *tuning.trials)
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


def _parameters(tuning: Tuning, trial: Trial) -> Cells:
    """The values of a trial, with the importance of each parameter for each objective."""
    shares = [_importance(tuning, i) for i in range(len(tuning.objectives))]
    names = (f"importance for {metric(name).short_label}" for name in tuning.objectives)
    rows = (
        (key, value, *(number(own.get(key), 2) for own in shares))
        for key, value in trial.settings.items()
    )
    return Cells(("parameter", "value", *names), tuple(rows), numbers=(2, 3))


def _importance(tuning: Tuning, i: int) -> dict[str, float]:
    """Each parameter's share of an objective's variance (fANOVA); empty where it is unknown."""
    from optuna.importance import FanovaImportanceEvaluator, get_param_importances

    if len({one.means[i] for one in tuning.trials if one.state == "complete"}) < 2:
        return {}
    evaluator = FanovaImportanceEvaluator(seed=0)
    return get_param_importances(tuning.study, evaluator=evaluator, target=lambda t: t.values[i])
