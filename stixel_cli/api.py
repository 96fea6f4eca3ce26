"""The same as the command line, from Python: `from stixel_cli import compose, run, sweep`.

Calls leave no state in the process and may follow each other in any order. Errors that the user
can correct are raised as `stixel_cli.errors.UserError`, in one line.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from stixel_cli.config.compose import Composition, from_resolved
from stixel_cli.config.compose import compose as compose_overrides
from stixel_cli.experiment.run import record_run
from stixel_cli.results.result import RunResult

if TYPE_CHECKING:
    from stixel_cli.sweeps.run import SweepResult


def compose(overrides: Sequence[str] | str = ()) -> Composition:
    """The default configuration with overrides in Hydra's grammar, such as `rig=kitti`, `seed=3`.

    Raises:
        ConfigurationError: in one line, for any fault of the overrides.
    """
    return compose_overrides((overrides,) if isinstance(overrides, str) else tuple(overrides))


def run(
    experiment: Sequence[str] | str | Composition = (),
    *,
    results: Path | str | None = None,
    name: str | None = None,
    workers: int | None = None,
    cache: Path | str | None = None,
) -> RunResult:
    """Run one experiment; cached results are not computed again.

    Args:
        experiment: overrides, or the result of `compose`.
        results: parent of the result folder; None to write nothing.
        name: of the result folder; None for a name from choices and time.
        workers: None for the number in the configuration.
        cache: folder of the cache; None for the one in the configuration.

    Raises:
        UserError: for errors that the user can correct.
        StageFailure: if a stage fails for another reason.
    """
    composition = experiment if isinstance(experiment, Composition) else compose(experiment)
    composition = _on_this_machine(composition, workers, cache)
    return record_run(
        composition,
        ["stixel", "run", *composition.overrides],
        results=None if results is None else Path(results),
        name=name,
    )


def sweep(
    overrides: Sequence[str] | str = (),
    *,
    file: Path | str | None = None,
    results: Path | str | None = None,
    name: str | None = None,
    shuffle: int | None = None,
    pictures: bool = False,
    workers: int | None = None,
    cache: Path | str | None = None,
) -> "SweepResult":
    """Run all combinations of several values; stages that runs share are computed once.

    `pandas.DataFrame(sweep(…).records)` has one row per run. A failing run does not stop the
    others; see its `status`.

    Args:
        overrides: in Hydra's grammar, including several values, such as `seed=range(0,5)`.
        file: with axes, seeds and excluded runs: a path, or the name of a shipped file.
        results: parent of the sweep's folder; None to write nothing.
        name: of that folder; None for a name from the file's name and the time.
        shuffle: seed of the order of execution; None for the order of the axes.
        pictures: draw the pictures of every run.
        workers: None for the number in the configuration.
        cache: folder of the cache; None for the one in the configuration.

    Raises:
        UserError: for errors that the user can correct, before anything is computed.
    """
    from stixel_cli.config.messages import override_text
    from stixel_cli.sweeps.whole import new_sweep

    texts = [overrides] if isinstance(overrides, str) else list(overrides)
    if workers is not None:
        texts.append(override_text("executor.workers", workers))
    if cache is not None:
        texts.append(override_text("cache.folder", str(cache)))
    return new_sweep(
        texts,
        None if file is None else str(file),
        None if results is None else Path(results),
        name,
        shuffle,
        pictures,
    )


def _on_this_machine(
    composition: Composition, workers: int | None, cache: Path | str | None
) -> Composition:
    """The composition with another number of workers and another cache, if given."""
    resolved = dict(composition.resolved)
    if workers is not None:
        resolved["executor"] = resolved["executor"] | {"workers": workers}
    if cache is not None:
        resolved["cache"] = resolved["cache"] | {"folder": str(cache)}
    if resolved == composition.resolved:
        return composition
    return dataclasses.replace(
        composition, configuration=from_resolved(resolved), resolved=resolved
    )
