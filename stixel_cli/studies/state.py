"""How far a study is, and where its results come from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class SweepState:
    """How far a sweep is.

    Attributes:
        name: of the sweep.
        runs: how many it has; None where that is not known yet.
        done: how many of them are there.
        faults: why the others are not, a line each.
        folder: of its sweep.
    """

    name: str
    runs: int | None
    done: int
    faults: tuple[str, ...]
    folder: Path

    @property
    def complete(self) -> bool:
        """Whether every run is there."""
        return self.done == self.runs


@dataclass(frozen=True)
class Origin:
    """Where a report comes from.

    Attributes:
        command: that makes it.
        overrides: that were given.
        notes: which of them are left out of which sweeps.
        seeds: of each sweep's runs.
        provenance: revision, versions and machine as a manifest has them.
        created: when, UTC.
        stage_cpu_seconds: that the results of each stage took when they were computed; NaN if those
            of one are not known.
        elapsed: s that the command took, with what it did not need to compute.
        sweeps: what was asked for, by sweep.
        configuration: of the first point, resolved.
    """

    command: str
    overrides: Sequence[str]
    notes: Sequence[str]
    seeds: Mapping[str, Sequence[int]]
    provenance: Mapping[str, Any]
    created: str
    stage_cpu_seconds: Mapping[str, float]
    elapsed: float
    sweeps: Mapping[str, Mapping[str, Any]]
    configuration: Mapping[str, Any]
