"""The blocks of a study's report, what its module returns, and its progress and provenance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal


@dataclass(frozen=True)
class Paragraph:
    """Plain text."""

    text: str


@dataclass(frozen=True)
class Figure:
    """A drawing as `report.style.svg` gives it; `name` is its file's stem, unique in a study.

    A `folded` block of a page unfolds on a click.
    """

    name: str
    caption: str
    svg: bytes
    folded: bool = False


@dataclass(frozen=True)
class Picture:
    """A raster image; `media_type` is image/png, image/jpeg or image/webp."""

    name: str
    caption: str
    data: bytes
    media_type: str
    folded: bool = False


@dataclass(frozen=True)
class Column:
    """Standard deviation ("std") or end of the interval ("low", "high") of the column before."""

    name: str
    kind: Literal["std", "low", "high"]


@dataclass(frozen=True)
class Table:
    """Rows of text and numbers, with None for missing values.

    A column is a name, or a `Column` that belongs to the value to its left; `tables` has functions
    for both.
    """

    name: str
    caption: str
    columns: tuple[str | Column, ...]
    rows: tuple[tuple[str | int | float | None, ...], ...]
    folded: bool = False

    def __post_init__(self):
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(
                    f"table {self.name}: a row has {len(row)} cells, not {len(self.columns)}"
                )


@dataclass(frozen=True)
class Section:
    """A section of the report, with its subsections among the blocks."""

    title: str
    blocks: tuple["Block", ...]
    folded: bool = False


Block = Paragraph | Figure | Picture | Table | Section


@dataclass(frozen=True)
class Material:
    """What the function `report` of a study's module returns.

    Attributes:
        values: numbers, texts, tables and figures, by their names in the template.
        files: path in the study's folder to content of further files.
    """

    values: Mapping[str, Any]
    files: Mapping[str, str | bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Findings:
    """A filled template.

    Attributes:
        opening: blocks before the first heading, in order. A page shows those up to the first
            figure as the answer, and the rest below it.
        sections: of the report, in order.
        files: path in the study's folder to content of further files.
    """

    opening: tuple[Block, ...]
    sections: tuple[Section, ...]
    files: Mapping[str, str | bytes]

    @property
    def answer(self) -> tuple[str, ...]:
        """The paragraphs before the first heading."""
        return tuple(block.text for block in self.opening if isinstance(block, Paragraph))


@dataclass(frozen=True)
class SweepState:
    """Progress of a sweep.

    Attributes:
        name: of the sweep.
        runs: their number; None if it depends on earlier sweeps.
        done: number of finished runs.
        faults: one line for each reason why others are missing.
        folder: of the sweep.
    """

    name: str
    runs: int | None
    done: int
    faults: tuple[str, ...]
    folder: Path

    @property
    def complete(self) -> bool:
        """Whether every run is finished."""
        return self.done == self.runs


@dataclass(frozen=True)
class Origin:
    """Provenance of a report.

    Attributes:
        command: command line that makes the report.
        overrides: of the command.
        notes: which overrides are left out of which sweeps.
        seeds: of the runs of each sweep.
        provenance: revision, versions and machine, as in a manifest.
        created: UTC.
        stage_cpu_seconds: CPU seconds that the results of each stage took; NaN if one is unknown.
        elapsed: s from the start of the command.
        sweeps: request of each sweep.
        configuration: of the first run, resolved.
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
