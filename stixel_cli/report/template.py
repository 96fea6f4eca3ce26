"""A study's report from its Jinja template: Markdown with numbers, tables and figures filled in.

A template has paragraphs and `#` headings, with code, emphasis and links inside. The text before
the first heading is the answer. `{{ show(tables.NAME) }}` shows a table or a figure;
`{% call show(...) %}caption{% endcall %}` also sets its caption. `folded=true` folds a table or
figure on the page, and a heading that ends with `(folded)` folds its section.
"""

import re
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import jinja2
from markdown_it import MarkdownIt

from stixel_cli.errors import ConfigurationError, UserError, counted, printable
from stixel_cli.report import metrics
from stixel_cli.report.blocks import (
    Block,
    Figure,
    Findings,
    Material,
    Paragraph,
    Picture,
    Section,
    Table,
)
from stixel_cli.report.statistics import in_words
from stixel_cli.results.reader import listed

_MARK = "\x02"
_FOLDED = " (folded)"
_MARKDOWN = MarkdownIt("zero").enable(["heading", "backticks", "emphasis", "link", "escape"])


def _interval(statistic, unit: str = "", sign: bool = False) -> str:
    """A statistic's mean with its interval."""
    return metrics.with_interval(statistic.mean, statistic.low, statistic.high, unit, sign)


FILTERS: dict[str, Callable] = {
    "number": metrics.number,
    "quantity": metrics.quantity,
    "percent": metrics.percent,
    "counted": counted,
    "interval": _interval,
    "in_words": in_words,
    "listed": listed,
    "capital": metrics.capital,
}
"""Functions of `metrics` that a template can use, by name."""


def template_of(text: str, name: str) -> jinja2.Template:
    """The template with a text; `name` is its file. It is code: see `studies.file.read_study`.

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
    return _findings(text, shown, material.files)


def _findings(text: str, shown: Sequence[Block], files: Mapping[str, str | bytes]) -> Findings:
    """Headings and paragraphs of Markdown; a mark stands for a shown block."""
    opening: list[Block] = []
    # Level, title, folding and blocks of the open sections; the first has the whole report.
    opened: list[tuple[int, str, bool, list[Block]]] = [(0, "", False, [])]
    for token, content in pairwise(_MARKDOWN.parse(text)):
        title, is_folded = content.content, content.content.endswith(_FOLDED)
        if token.type == "heading_open":
            level = int(token.tag[1:])
            _close(opened, level)
            opened.append((level, title.removesuffix(_FOLDED), is_folded, []))
        elif token.type == "paragraph_open":
            line = _line(title)
            block = shown[int(line[1:])] if line.startswith(_MARK) else Paragraph(line)
            (opening if len(opened) == 1 else opened[-1][-1]).append(block)
    _close(opened, 1)
    return Findings(tuple(opening), tuple(opened[0][-1]), files)


def _close(opened: list[tuple[int, str, bool, list[Block]]], level: int) -> None:
    """Put the sections of at least this level into those around them."""
    while opened[-1][0] >= level:
        _, title, is_folded, blocks = opened.pop()
        opened[-1][-1].append(Section(title, tuple(blocks), is_folded))


def inline_html(text: str) -> str:
    """A paragraph of Markdown as HTML; its own HTML is escaped."""
    return _MARKDOWN.renderInline(text)


def _line(text: str) -> str:
    """Text on one line; non-breaking spaces are kept."""
    return re.sub(r"[ \t\n]+", " ", text).strip(" ")
