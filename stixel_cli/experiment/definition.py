"""How the table describes one stage."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from stixel_cli.config.annotations import kind_of


@dataclass(frozen=True)
class Definition:
    """One stage of the table.

    Attributes:
        functions: "module:function" to call, by the `kind` of the settings that `chosen_by` names;
            a stage with one implementation has the single key "".
        pattern: how it runs over the frames, see `stixel_cli.engine.keys.Stage`.
        reads: argument name to the dotted path of its settings in the configuration.
        chosen_by: dotted path of the settings whose `kind` selects the function; "" if there is no
            choice.
        seeded: whether it draws random numbers, and so needs the experiment's seed.
        files: dotted paths of the settings that are files, of those that the chosen option has.
            Their content, and that of the files they refer to, is part of the key.
        recorded: the files of the recording that the function gets as `files`, an attribute of
            `Recording`, before those of `files`; "" for no file.
        pictures: whether it draws: its result is a `Pictures`.
        code: dotted paths of the settings that name the user's own functions: their code is part of
            the key.
        calls: another stage whose function this one calls: it gets the function's name as
            `function` and its settings as `settings`; "" for no stage.
    """

    functions: Mapping[str, str]
    pattern: Literal["once", "map", "fold", "pick"]
    reads: Mapping[str, str] = field(default_factory=dict)
    chosen_by: str = ""
    seeded: bool = False
    files: tuple[str, ...] = ()
    recorded: str = ""
    pictures: bool = False
    code: tuple[str, ...] = ()
    calls: str = ""


FROM_LABELS = {"rig": "rig", "tables": "recording.tables"}
"""The `reads` of stages that move the labels of a recording into the world."""


def only(function: str) -> dict[str, str]:
    """The `functions` of a stage with one implementation."""
    return {"": f"stixel_cli.{function}"}


def by_kind(options: Any, name: str) -> dict[str, str]:
    """The function `name` of each option of a union, by kind.

    It is in `KIND.py`, in the folder of the option's parameters.
    """
    functions = {}
    for option in get_args(options):
        folder, kind = option.__module__.rpartition(".")[0], kind_of(option)
        functions[kind] = f"{folder}.{kind}:{name}"
    return functions


def same(*names: str) -> dict[str, str]:
    """The `reads` of arguments with the names of their settings."""
    return {name: name for name in names}
