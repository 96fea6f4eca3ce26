"""The same as the command line, from Python: `from stixel_cli import compose, plot, run, sweep`.

Calls leave no state in the process and may follow each other in any order. Errors that the user
can correct are raised as `stixel_cli.errors.UserError`, in one line.
"""

import dataclasses
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from stixel_cli.config.compose import Composition, from_resolved
from stixel_cli.config.compose import compose as compose_overrides
from stixel_cli.config.texts import override_text, split_override
from stixel_cli.engine.progress import Progress, in_notebook, make_progress
from stixel_cli.errors import UserError
from stixel_cli.experiment.run import record_run
from stixel_cli.machine.kernels import uncompiled
from stixel_cli.results.result import RunResult
from stixel_cli.sweeps.index import update_index

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stixel_cli.sweeps.run import SweepResult


def _notebook_view(result: RunResult) -> str:
    """HTML of a result: verdict, main metrics, and the picture from above."""
    from stixel_cli.report.notebook import result_html

    return result_html(result)


# Notebooks look for this method; results know no page, so it is attached where Python users enter.
RunResult._repr_html_ = _notebook_view


def compose(*overrides: Sequence[str] | str, last_wins: bool = False) -> Composition:
    """The default configuration with overrides in Hydra's grammar, such as `rig=kitti`, `seed=3`.

    Args:
        overrides: texts, and lists of texts.
        last_wins: of several overrides of one key, take the last; else they are refused.

    Raises:
        ConfigurationError: in one line, for any fault of the overrides.
    """
    return compose_overrides(_texts(overrides, last_wins))


def run(
    *experiment: Sequence[str] | str | Composition,
    results: Path | str | None = None,
    name: str | None = None,
    workers: int | None = None,
    cache: Path | str | None = None,
    last_wins: bool = False,
) -> RunResult:
    """Run one experiment; cached results are not computed again.

    `run(BASE, "measurement=lidar", last_wins=True)` changes one setting of a list of overrides. A
    notebook and a terminal show the progress.

    Args:
        experiment: overrides as in `compose`, or one result of `compose`.
        results: parent of the result folder; None to write nothing.
        name: of the result folder; None for a name from choices and time.
        workers: None for the number in the configuration.
        cache: folder of the cache; None for the one in the configuration.
        last_wins: as in `compose`.

    Raises:
        UserError: for errors that the user can correct.
        StageFailure: if a stage fails for another reason.
    """
    machine = _of_this_machine(workers, cache)
    if any(isinstance(part, Composition) for part in experiment):
        if len(experiment) > 1:
            raise UserError("run: give overrides, or one composition without overrides")
        (composition,) = experiment
        if machine:
            composition = _moved(composition, workers, cache, machine)
    else:
        composition = compose(_texts(experiment, last_wins), machine)
    results = None if results is None else Path(results)
    progress = make_progress(uncompiled(), advice=True) if _visible() else Progress()
    made = record_run(composition, results, name, progress)
    update_index(results)
    return made


def sweep(
    *overrides: Sequence[str] | str,
    file: Path | str | None = None,
    results: Path | str | None = None,
    name: str | None = None,
    shuffle: int | None = None,
    pictures: bool = False,
    workers: int | None = None,
    cache: Path | str | None = None,
    last_wins: bool = False,
    trust_code: bool = False,
) -> "SweepResult":
    """Run all combinations of several values; stages that runs share are computed once.

    `sweep(…).frame()` is a pandas table with one row per run. A failing run does not stop the
    others; see its `status`.

    Args:
        overrides: as in `compose`, including several values, such as `seed=range(0,5)`.
        file: with axes, seeds and excluded runs: a path, or the name of a shipped file.
        results: parent of the sweep's folder; None to write nothing.
        name: of that folder; None for a name from the file's name and the time.
        shuffle: seed of the order of execution; None for the order of the axes.
        pictures: draw the pictures of every run.
        workers: None for the number in the configuration.
        cache: folder of the cache; None for the one in the configuration.
        last_wins: as in `compose`.
        trust_code: run the user-defined code that the file names.

    Raises:
        UserError: for errors that the user can correct, before anything is computed.
    """
    from stixel_cli.sweeps.runs import sweep_design
    from stixel_cli.sweeps.whole import new_sweep

    texts = [*_texts(overrides, last_wins), *_of_this_machine(workers, cache)]
    file = None if file is None else str(file)
    design = sweep_design(texts, file, shuffle, trust_code=trust_code)
    results = None if results is None else Path(results)
    result = new_sweep(design, results, name, pictures, visible=_visible())
    update_index(results)
    return result


def plot(result: RunResult) -> "Figure":
    """The run from above: paths with contours at several times, and the contours enlarged.

    Raises:
        UserError: if the result has no track, because it was read from a folder.
    """
    from stixel_cli.report.notebook import plot as plot_result

    return plot_result(result)


def _texts(given: Sequence[Sequence[str] | str], last_wins: bool) -> tuple[str, ...]:
    """The overrides in one tuple; of several of one key only the last if `last_wins`."""
    for part in given:
        if isinstance(part, Mapping):
            raise UserError("overrides must be texts, such as 'tracker=contour', not a mapping")
    texts = [text for part in given for text in ((part,) if isinstance(part, str) else part)]
    if not last_wins:
        return tuple(texts)
    return tuple({split_override(text)[0]: text for text in texts}.values())


def _visible() -> bool:
    """Whether progress is shown: not in a script whose output goes to a file."""
    return in_notebook() or sys.stderr.isatty()


def _moved(
    composition: Composition, workers: int | None, cache: Path | str | None, machine: list[str]
) -> Composition:
    """The composition with another number of workers and another cache, all else as it was."""
    resolved = dict(composition.resolved)
    if workers is not None:
        resolved["executor"] = resolved["executor"] | {"workers": workers}
    if cache is not None:
        resolved["cache"] = resolved["cache"] | {"folder": str(cache)}
    return dataclasses.replace(
        composition,
        configuration=from_resolved(resolved),
        resolved=resolved,
        overrides=(*composition.overrides, *machine),
    )


def _of_this_machine(workers: int | None, cache: Path | str | None) -> list[str]:
    """The overrides of a number of workers and a cache, if given."""
    given = {"executor.workers": workers, "cache.folder": None if cache is None else str(cache)}
    return [override_text(key, value) for key, value in given.items() if value is not None]
