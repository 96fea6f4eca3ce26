"""Write `docs/settings.md`: all groups, options and keys, from the schema and `conf/`.

python docs/settings.py
"""

from collections.abc import Iterator
from pathlib import Path

from stixel_cli.config.descriptions import (
    groups,
    keys_of_option,
    meaning_of_group,
    meaning_of_option,
    settings_of_top,
)
from stixel_cli.config.folders import (
    EXPERIMENT,
    group_options,
    options_default_first,
    options_of_kind,
)
from stixel_cli.config.folders import option_values as values_of
from stixel_cli.config.keys import Key

PAGE = Path(__file__).parent / "settings.md"


def page() -> str:
    """The text of the page."""
    return "\n".join(_lines()) + "\n"


def _lines() -> Iterator[str]:
    yield "# Settings"
    yield ""
    yield "`python docs/settings.py` writes this page from the schema and from `conf/`."
    yield "`stixel describe` prints the same, with the stages that read a setting."
    yield "The default option comes first."
    yield ""
    yield "| group | options | meaning |"
    yield "|---|---|---|"
    for group in groups():
        options = " ".join(f"`{option}`" for option in options_default_first(group))
        yield f"| [`{group}`](#{group}) | {options} | {_cell(meaning_of_group(group))} |"
    yield ""
    yield "Without a group:"
    yield ""
    yield from _table(settings_of_top(), "")
    for group in [*groups(), *(name for name in group_options() if "/" in name)]:
        yield from _section(group)


def _section(group: str) -> Iterator[str]:
    yield ""
    yield f"## {group}"
    yield ""
    for option in options_default_first(group):
        yield f"- `{group}={option}`: {_cell(meaning_of_option(group, option))}"
    if group == EXPERIMENT:
        return
    shown = set()
    for option in options_default_first(group):
        kind = values_of(group, option).get("kind", "")
        if kind in shown:
            continue
        shown.add(kind)
        found = keys_of_option(group, option)
        if found:
            yield ""
            same = options_of_kind(group, kind) if kind else options_default_first(group)
            yield f"Keys of {' '.join(f'`{one}`' for one in same)}:"
            yield ""
            yield from _table(found, option)


def _table(found: list[Key], option: str) -> Iterator[str]:
    yield "| key | default | range | meaning |"
    yield "|---|---|---|---|"
    for one in found:
        default = one.values.get(option, one.default)
        yield f"| `{one.name}` | {_cell(default)} | {_cell(one.range)} | {_cell(one.meaning)} |"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
