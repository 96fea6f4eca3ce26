"""The blocks of a report, and what the module of a study returns."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any


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


Cell = str | int | float | None


@dataclass(frozen=True)
class Table:
    """Rows of text and numbers, with None for missing values.

    The columns `low X` and `high X` are the ends of the 95 % interval of the column before them,
    and `± X` is its standard deviation: a page shows them in one cell.
    """

    name: str
    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    folded: bool = False

    def __post_init__(self):
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(
                    f"table {self.name}: a row has {len(row)} cells, not {len(self.columns)}"
                )

    @classmethod
    def of(cls, name: str, rows: Iterable[Mapping[str, Cell]]) -> "Table":
        """The table of rows that map columns to cells; a row may lack columns of others."""
        rows = list(rows)
        columns = tuple(dict.fromkeys(column for row in rows for column in row))
        return cls(name, "", columns, tuple(tuple(map(row.get, columns)) for row in rows))


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

    def __post_init__(self) -> None:
        """Raise TypeError for a module, a class or a function: others write templates, too."""
        for name, value in self.values.items():
            if isinstance(value, ModuleType) or callable(value):
                raise TypeError(f"{name}: a {type(value).__name__}: a template is given data only")


@dataclass(frozen=True)
class Findings:
    """A filled template.

    Attributes:
        opening: blocks before the first heading. A page shows those up to the first figure as the
            answer, and the rest below it.
        files: path in the study's folder to content of further files.
    """

    opening: tuple[Block, ...]
    sections: tuple[Section, ...]
    files: Mapping[str, str | bytes]

    @property
    def answer(self) -> tuple[str, ...]:
        """The paragraphs before the first heading."""
        return tuple(block.text for block in self.opening if isinstance(block, Paragraph))

    def blocks(self, kind: type) -> Iterator:
        """Every block of a kind, such as `Table`, in the order of the report."""
        inside = list(self.opening) + list(self.sections)
        while inside:
            block = inside.pop(0)
            if isinstance(block, kind):
                yield block
            inside[:0] = block.blocks if isinstance(block, Section) else ()
