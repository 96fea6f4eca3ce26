"""The result of a sweep: its runs as rows, as a frame, and as `Runs`, which answer questions."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.errors import ConfigurationError, printable
from stixel_cli.results.result import DONE, RunResult
from stixel_cli.sweeps.design import NOT_GIVEN, SEED

if TYPE_CHECKING:
    import pandas

    from stixel_cli.answers.answer import Answer
    from stixel_cli.answers.runs import Runs


@dataclass(frozen=True)
class SweepResult:
    """A sweep with its results, computed or read.

    Attributes:
        folder: its folder; None if nothing was written.
        runs: one entry for each run, in the order of their indices.
        computed: number of nodes that this call computed.
        cached: number of needed nodes that were in the store before.
        axes: the keys of each axis.
        over: keys that means are over: seeds are the units of statistics, others are scenarios.
    """

    folder: Path | None
    runs: tuple[RunResult, ...]
    computed: int = 0
    cached: int = 0
    axes: tuple[tuple[str, ...], ...] = ()
    over: tuple[str, ...] = (SEED,)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of `runs.csv`."""
        rows = []
        for run in self.runs:
            failure = run.failure
            at = "failed" if failure is not None else "runs" if run.status == DONE else None
            rows.append(
                {
                    "run": run.index,
                    "status": run.status,
                    **run.setting,
                    SEED: run.manifest.get("seed", ""),
                    "overrides": " ".join(map(shlex.quote, run.overrides)),
                    "folder": None if None in (at, self.folder) else f"{at}/{run.index:04d}",
                    "failed_stage": getattr(failure, "stage", None),
                    "error": None if failure is None else " ".join(str(failure).split()),
                    **run.metrics,
                }
            )
        return rows

    @property
    def records(self) -> list[dict[str, Any]]:
        """The rows with values of keys that differ between runs in their own types."""
        return [
            row | {k: run.composition.value(k) for k, v in run.setting.items() if v != NOT_GIVEN}
            for row, run in zip(self.rows, self.runs, strict=True)
        ]

    def frame(self) -> "pandas.DataFrame":
        """The records as a table: one row per run, with its settings, status and metrics."""
        import pandas

        return pandas.DataFrame(self.records)

    @cached_property
    def table(self) -> "Runs":
        """The runs of which questions are asked; settings as typed, `folder` the whole path."""
        import pandas

        from stixel_cli.answers.runs import Runs

        rows = [
            row | {"folder": None if row["folder"] is None else str(self.folder / row["folder"])}
            for row in self.rows
        ]
        keys = [key for axis in self.axes for key in axis if any(key in row for row in rows)]
        keys = keys or [SEED]
        frame = pandas.DataFrame(rows).set_index("run")
        numbers = dict.fromkeys(name for run in self.runs for name in run.metrics)
        typed = frame.astype({name: float for name in numbers if name not in keys})
        rest = (name for name in (SEED, "overrides", "failed_stage") if name not in keys)
        typed = typed.drop(columns=[*rest])
        return Runs(typed, tuple(keys), question_over(self.over, self.axes))

    def ask(self, **parts: Any) -> "Answer":
        """The answer of a question about the runs, see `answers.runs.Runs.ask`."""
        return self.table.ask(**parts)

    def __repr__(self) -> str:
        """The numbers of runs and nodes, and the folder, in one line."""
        runs = f"{self.count(DONE)} of {len(self.runs)} runs done"
        nodes = f"{self.computed} nodes computed, {self.cached} cached"
        return f"<SweepResult {runs}; {nodes} {self.folder or ''}>"

    def _repr_html_(self) -> str:
        """What a notebook shows: the table of the runs."""
        return self.frame()._repr_html_()

    @property
    def complete(self) -> bool:
        """Whether every run is done."""
        return self.count(DONE) == len(self.runs)

    def count(self, status: str) -> int:
        """Number of runs with a status."""
        return sum(run.status == status for run in self.runs)


def question_over(over: Sequence[str], axes: Sequence[Sequence[str]]) -> dict[str, Any]:
    """The parts of a question whose means are over some keys of axes; {} for the seed alone.

    Seeds are units; where none is named, all named keys are. The other named keys are scenarios,
    and the keys that are not named are compared.
    """
    if tuple(over) == (SEED,):
        return {}
    averaged = [axis for axis in axes if set(axis) & set(over)]
    drawn = [axis for axis in averaged if any(key.endswith(SEED) for key in axis)] or averaged
    named = [key for axis in averaged for key in axis]
    units = [key for axis in drawn for key in axis]
    compare = [key for axis in axes for key in axis if key not in named]
    return {
        "over": units,
        "within": [key for key in named if key not in units],
        **({"compare": compare} if compare else {}),
    }


def over_keys(names: str | Sequence[str], axes: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """The keys `names`, a list or separated by commas, each of which an axis has.

    Raises:
        ConfigurationError: for a key that no axis has.
    """
    names = names.split(",") if isinstance(names, str) else list(names)
    swept = [key for axis in axes for key in axis]
    for name in (name for name in names if name not in swept and names != [SEED]):
        raise ConfigurationError(
            f"over: {printable(name, 60)} is not swept; swept: {', '.join(swept) or 'nothing'}"
        )
    return tuple(names)
