"""Write `docs/settings.md`: all groups, options and keys, from the schema and `conf/`.

python docs/settings.py
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from stixel_cli.config.folders import group_options, options_of_kind
from stixel_cli.config.keys import (
    Key,
    groups,
    keys_of_option,
    meaning_of_group,
    meaning_of_option,
    settings_of_top,
)

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
        options = " ".join(f"`{option}`" for option in options_of_kind(group))
        yield f"| [`{group}`](#{group}) | {options} | {_cell(meaning_of_group(group))} |"
    yield ""
    yield "Without a group:"
    yield ""
    yield from _table({"": settings_of_top()})
    for group in [*groups(), *(name for name in group_options() if "/" in name)]:
        yield from _section(group)


def _section(group: str) -> Iterator[str]:
    yield ""
    yield f"## {group}"
    yield ""
    options = options_of_kind(group)
    for option in options:
        yield f"- `{group}={option}`: {_cell(meaning_of_option(group, option))}"
    if not any(keys_of_option(group, option) for option in options):
        return
    yield ""
    yield from _table({option: keys_of_option(group, option) for option in options})


def _table(keys: Mapping[str, Sequence[Key]]) -> Iterator[str]:
    """The rows of the keys of each option: one for those that mean the same."""
    rows: dict[tuple[str, ...], dict[str, list[str]]] = {}
    for option, found in keys.items():
        for key in found:
            row = rows.setdefault((key.name, key.range, key.meaning), {})
            row.setdefault(key.values.get(option, key.default), []).append(f"`{option}`")
    yield "| key | options | default | range | meaning |"
    yield "|---|---|---|---|---|"
    for (name, range_, meaning), values in rows.items():
        options = [option for same in values.values() for option in same]
        others = [f"`{option}`" for option in keys if f"`{option}`" not in options]
        which = " ".join(options)
        if len(others) < len(options):
            which = f"all but {' '.join(others)}" if others else ""
        default = next(iter(values))
        if len(values) > 1:
            default = "; ".join(f"{value}: {' '.join(same)}" for value, same in values.items())
        yield f"| `{name}` | {which} | {_cell(default)} | {_cell(range_)} | {_cell(meaning)} |"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
