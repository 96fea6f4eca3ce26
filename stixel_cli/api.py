"""The same as the command line, from Python: `from stixel_cli import compose, run, sweep`.

Calls leave nothing behind in the process and may follow each other in any order. What the user can
mend is a `stixel_cli.errors.UserError`, in one line.
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
        ConfigurationError: in one line, for whatever is wrong with the overrides.
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
    """Run one experiment; what is in the cache is not computed again.

    Args:
        experiment: overrides, or what `compose` gave.
        results: where a result folder is made; None to write none.
        name: of the result folder; None for one made of choices and time.
        workers: None for those of the configuration.
        cache: the cache's folder; None for that of the configuration.

    Raises:
        UserError: for whatever the user can put right.
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
    """Run all combinations of several values; what points share is computed once.

    `pandas.DataFrame(sweep(…).records)` has a row a point. A point that fails fails alone; its
    `status` says so.

    Args:
        overrides: in Hydra's grammar with its sweeps, such as `seed=range(0,5)`.
        file: that names axes, seeds and points left out; a path, or the name of one that is
            shipped.
        results: where the sweep's folder is made; None to write none.
        name: of that folder; None for one made of the file's name and the time.
        shuffle: seed of the order in which the points run; None for theirs.
        pictures: draw every point's pictures; they are in the cache.
        workers: None for those of the configuration.
        cache: the cache's folder; None for that of the configuration.

    Raises:
        UserError: for whatever the user can put right, before anything is computed.
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
    """The composition with other workers and another cache, where they are given."""
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
