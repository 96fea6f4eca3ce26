"""Shell completion of overrides, from the text of the files of `conf/`; no schema is read."""

import os

from stixel_cli.config.choice import compose_options
from stixel_cli.config.folders import (
    ENTRY_POINTS,
    STUDIES,
    flat,
    group_options,
    installed_functions,
)
from stixel_cli.config.texts import override_text, split_override
from stixel_cli.errors import UserError


def complete_override(incomplete: str) -> list[str]:
    """Complete to groups with their options, or to keys with their values.

    After a comma, as in a sweep, complete to a further option of the group. Bash splits words at
    `=` and expects the part after it.
    """
    words, group = _words_in_bash(incomplete)
    before = f"{group}=" if group else ""
    try:
        matches = _candidates(before + incomplete, words)
    except (OSError, UserError):
        return []
    return [word.removeprefix(before) for word in matches if word != before]


def complete_setting(incomplete: str) -> list[str]:
    """Complete to groups, options and keys, without values."""
    words = complete_override(incomplete)
    return [w.removesuffix("=") for w in words if w.endswith("=") or "." not in w]


def complete_study(incomplete: str) -> list[str]:
    """Complete to names of studies, and to overrides as in a sweep."""
    studies = [name for name in (*STUDIES, "all") if name.startswith(incomplete)]
    return studies + (complete_override(incomplete) if incomplete else [])


def complete_folder(incomplete: str) -> list[str]:
    """Complete to result folders, and to folders that may contain them."""
    folder, slash, name = incomplete.rpartition("/")
    paths: list[str] = []
    try:
        # `results/` is the default parent folder.
        places = [f"{folder}{slash}"] if incomplete else ["", "results/"]
        for place in places:
            with os.scandir(os.path.expanduser(place) or ".") as entries:
                folders = sorted(entry.name for entry in entries if entry.is_dir())
            for child in folders:
                if child.startswith(name) and (name or not child.startswith(".")):
                    path = place + child
                    is_run = os.path.isfile(os.path.join(os.path.expanduser(path), "manifest.json"))
                    paths.append(path if is_run else f"{path}/")
    except OSError:
        pass
    return paths


def complete_run_or_override(incomplete: str) -> list[str]:
    """Complete to result folders and overrides."""
    return [*complete_override(incomplete), *complete_folder(incomplete)]


def _words_in_bash(incomplete: str) -> tuple[list[str], str]:
    """The words of the line, and the word before the `=` that `incomplete` follows."""
    words = os.environ.get("COMP_WORDS", os.environ.get("_TYPER_COMPLETE_ARGS", "")).split()
    current = os.environ.get("COMP_CWORD", "")
    if not current.isdecimal():
        return words, ""
    head = words[: int(current) + (not incomplete)]
    return words, head[-2] if len(head) > 1 and head[-1] == "=" else ""


def _candidates(typed: str, words: list[str]) -> list[str]:
    key, values = split_override(typed)
    *given, last = values.split(",")
    if given:
        further = [o for o in group_options().get(key, ()) if o.startswith(last) and o not in given]
        return [f"{key}={','.join((*given, option))}" for option in further]
    groups = [group for group in group_options() if group.startswith(key)]
    if "=" in typed or len(groups) == 1:
        # The shell appends a space to a single `group=`, so complete to its options.
        matches = [f"{group}={option}" for group in groups for option in group_options()[group]]
        for group in {*ENTRY_POINTS}.intersection(groups):
            matches += [f"{group}={name}" for name in installed_functions(group)]
    else:
        matches = [f"{group}=" for group in groups]
    if key and "seed".startswith(key):
        matches.append("seed=")
    matches += _keys(key, words) if "." in key else []
    return [word for word in matches if word.startswith(typed)]


def _keys(typed: str, words: list[str]) -> list[str]:
    """The keys of the options that the line chooses; a single key also with its value."""
    line = map(split_override, "".join(f" {word}" for word in words).replace(" = ", "=").split())
    chosen = {group: option for group, option in line if option in group_options().get(group, ())}
    values = dict(flat(compose_options(chosen).plain))
    matches = [key for key in values if key.startswith(typed) and not key.endswith(".kind")]
    if len(matches) != 1:
        return [f"{key}=" for key in matches]
    plain = values[matches[0]]
    of_another = isinstance(plain, list) or "$" in str(plain)
    return [f"{matches[0]}="] + ([] if of_another else [override_text(matches[0], plain)])
