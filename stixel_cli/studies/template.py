"""A study's report from its Jinja template: Markdown with numbers, tables and figures filled in.

A template has paragraphs and `#` headings. The text before the first heading is the answer.
`{{ show(tables.NAME) }}` shows a table or a figure; `{% call show(...) %}caption{% endcall %}` also
sets its caption. `folded=true` folds a table or figure on the page, and a heading that ends with
`(folded)` folds its section.
"""

import re
import traceback
from collections.abc import Callable
from dataclasses import replace

import jinja2

from stixel_cli.config.messages import printable
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.results.text import listed
from stixel_cli.studies import tables
from stixel_cli.studies.types import (
    Block,
    Figure,
    Findings,
    Material,
    Paragraph,
    Picture,
    Section,
    Table,
)

_MARK = "\x02"
_HEADING = re.compile(r"(#{1,3}) (.+?)( \(folded\))?")


def _interval(statistic, unit: str = "", sign: bool = False) -> str:
    """A statistic's mean with its interval."""
    return tables.with_interval(statistic.mean, statistic.low, statistic.high, unit, sign)


FILTERS: dict[str, Callable] = {
    "number": tables.number,
    "quantity": tables.quantity,
    "percent": tables.percent,
    "counted": tables.counted,
    "interval": _interval,
    "listed": listed,
    "capital": tables.capital,
}
"""Functions of `tables` that a template can use, by name."""


def template_of(text: str, name: str) -> jinja2.Template:
    """The template with a text; `name` is its file.

    Raises:
        ConfigurationError: if its syntax is not valid.
    """
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, autoescape=False
    )
    environment.filters.update(FILTERS)
    try:
        return environment.from_string(text)
    except jinja2.TemplateSyntaxError as fault:
        raise ConfigurationError(f"template: {name}: line {fault.lineno}: {fault}") from None


def findings_of(template: jinja2.Template, material: Material, name: str) -> Findings:
    """The report: the template filled with the material.

    Raises:
        UserError: if the template `name` cannot be filled, as with a value that the material lacks.
    """
    shown: list[Block] = []

    def show(block, caller: Callable[[], str] | None = None, folded: bool = False) -> str:
        if not isinstance(block, Figure | Picture | Table):
            raise TypeError("show takes a table, a figure or a picture")
        caption = block.caption if caller is None else _line(caller())
        shown.append(replace(block, caption=caption, folded=folded))
        return f"\n\n{_MARK}{len(shown) - 1}\n\n"

    try:
        text = template.render(**material.values, show=show)
    except (
        jinja2.TemplateError, ArithmeticError, AttributeError, LookupError, TypeError, ValueError
    ) as fault:  # fmt: skip
        frames = traceback.extract_tb(fault.__traceback__)
        line = [frame.lineno for frame in frames if frame.filename == "<template>"][-1:]
        where = f"{name}: line {line[0]}" if line else name
        reason = printable(f"{type(fault).__name__}: {fault}", 200)
        raise UserError(f"template: {where}: {reason}") from fault
    before: list[Block] = []
    # Level, title, folding and blocks of the open sections.
    opened: list[tuple[int, str, bool, list[Block]]] = [(0, "", False, before)]
    sections: list[Section] = []

    def close(level: int) -> None:
        while opened[-1][0] >= level:
            _, title, is_folded, blocks = opened.pop()
            section = Section(title, tuple(blocks), is_folded)
            if opened[-1][0] == 0:
                sections.append(section)
            else:
                opened[-1][-1].append(section)

    for chunk in re.split(r"\n\s*\n", text):
        chunk = _line(chunk)
        heading = _HEADING.fullmatch(chunk)
        if heading:
            close(len(heading[1]))
            opened.append((len(heading[1]), heading[2], heading[3] is not None, []))
        elif chunk.startswith(_MARK):
            opened[-1][-1].append(shown[int(chunk[1:])])
        elif chunk:
            opened[-1][-1].append(Paragraph(chunk))
    close(1)
    return Findings(tuple(before), tuple(sections), material.files)


def _line(text: str) -> str:
    """Text on one line; non-breaking spaces are kept."""
    return re.sub(r"[ \t\n]+", " ", text).strip(" ")
