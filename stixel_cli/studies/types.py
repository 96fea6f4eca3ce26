"""What a study's report is made of (its data), and what it consists of (its findings)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from stixel_cli.config.schema import Configuration
from stixel_cli.evaluation.metric_table import Scores


@dataclass(frozen=True)
class StudyRun:
    """One experiment of a sweep.

    Attributes:
        index: its number in the sweep.
        setting: keys that differ between the sweep's runs, without the seed, to values as typed.
        seed: of its random numbers.
        configuration: of the experiment.
        metrics: name to value, None where one has no value.
        scores: errors over time.
        cpu_seconds: stage to the CPU seconds that its nodes took when they were computed, summed;
            NaN if those of one are not known.
        load: gives a step's result by the step's name, or the list of its chunks' results where
            it works in chunks; read when asked for, of the steps that the sweep names.
    """

    index: int
    setting: Mapping[str, str]
    seed: int
    configuration: Configuration
    metrics: Mapping[str, float | int | None]
    scores: Scores
    cpu_seconds: Mapping[str, float]
    load: Callable[[str], Any]


@dataclass(frozen=True)
class StudySweep:
    """One sweep of a study; `keys` are those of its axes, the seed among them if it is swept."""

    name: str
    keys: tuple[str, ...]
    runs: tuple[StudyRun, ...]


@dataclass(frozen=True)
class StudyData:
    """All that a study's report is made from: its sweeps by name, in the order they ran."""

    name: str
    title: str
    question: str
    sweeps: Mapping[str, StudySweep]


@dataclass(frozen=True)
class Paragraph:
    """Plain text."""

    text: str


@dataclass(frozen=True)
class Figure:
    """A drawing as `report.style.svg` gives it; `name` is its file's stem, unique in a study."""

    name: str
    caption: str
    svg: bytes


@dataclass(frozen=True)
class Picture:
    """A raster image; `media_type` is image/png, image/jpeg or image/webp."""

    name: str
    caption: str
    data: bytes
    media_type: str


@dataclass(frozen=True)
class Table:
    """Rows of text and numbers; None where there is no value."""

    name: str
    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str | int | float | None, ...], ...]


@dataclass(frozen=True)
class Section:
    """A chapter, or a part of one."""

    title: str
    blocks: tuple["Block", ...]


Block = Paragraph | Figure | Picture | Table | Section


@dataclass(frozen=True)
class Material:
    """What a study's module gives to the template.

    Attributes:
        values: numbers, texts, tables and figures, by the names that the template uses.
        files: more files for the study's folder, by path.
    """

    values: Mapping[str, Any]
    files: Mapping[str, str | bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Findings:
    """What a study found.

    Attributes:
        answer: to its question, in a few sentences.
        sections: of the report, in order.
        files: more files for the study's folder, by name.
        summary: the numbers that the answer rests on, shown beneath it.
    """

    answer: tuple[str, ...]
    sections: tuple[Section, ...]
    files: Mapping[str, str | bytes]
    summary: tuple[Table, ...] = ()
