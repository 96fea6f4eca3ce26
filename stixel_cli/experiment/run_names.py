"""What differs between a run and the default, in few words: names of folders and lists of runs."""

import re
from collections.abc import Mapping, Sequence

from stixel_cli.config import folders
from stixel_cli.config.folders import group_options, innermost_group
from stixel_cli.config.texts import split_override, value_text

ALWAYS = ("road_user", "path")
"""Groups whose options begin each name, whether they are the default or not."""

WITHOUT_KEY = ("measurement", "tracker")
"""Groups whose options are understood without the group's name."""

OF_NO_RESULT = ("executor", "cache", "pictures")
"""Groups that do not affect the scores."""

LONGEST_PART = 32
LONGEST_NAME = 90


def differences(choices: Mapping[str, str], overrides: Sequence[str]) -> list[str]:
    """The options of `ALWAYS`, then each override that differs from the default, shortened.

    For example `car`, `turn`, `fabricated`, `rig=kitti`, `sigma_f=0.5`. `choices` has the option of
    each group; the `overrides` have one value each, as typed.
    """
    # The path of scans from a file is in the file.
    named = ALWAYS[:1] if choices.get("measurement") == "file" else ALWAYS
    parts = [str(choices[group]) for group in named if group in choices]
    for text in overrides:
        key, value = split_override(text)
        group = innermost_group(key)
        if key in ALWAYS or group.partition("/")[0] in OF_NO_RESULT:
            continue
        if not _is_default(key, value, group, choices):
            parts.append(short_setting(key, value))
    return [printed for printed in map(_printable, parts) if printed]


def short_setting(key: str, value: str) -> str:
    """`sigma_f=0.5` for `tracker.sigma_f=0.5`; only the option of a group in `WITHOUT_KEY`."""
    if "/" in value:
        value = value.rstrip("/").rpartition("/")[2]  # a file, such as a mesh
    if key in WITHOUT_KEY:
        return value
    return f"{_last(key)}={value}"


def swept_setting(keys: Sequence[str], values: Sequence[str]) -> str:
    """`tracker=gp_ekf,contour` or `seed=0..9`: an axis of a sweep, shortened.

    Of several zipped `keys`, the first is shown with the number of the others; the `values`, as
    typed, are its own.
    """
    whole = [int(value) for value in values if re.fullmatch(r"-?\d{1,9}", value)]
    if len(whole) == len(values) > 2 and whole == list(range(whole[0], whole[-1] + 1)):
        text = f"{whole[0]}..{whole[-1]}"
    else:
        text = ",".join(_printable(value.rstrip("/").rpartition("/")[2]) for value in values)
        if len(text) > LONGEST_PART:
            text = f"{len(values)} values"
    others = f"+{len(keys) - 1}" if len(keys) > 1 else ""
    return f"{_printable(_last(keys[0]))}{others}={text}"


def joined_name(parts: Sequence[str]) -> str:
    """The parts joined to a valid name of a folder; `+2` at its end for two that are left out."""
    kept = [re.sub(r"[^A-Za-z0-9_.+=,-]+", "_", part) for part in parts]
    while len(kept) > 1 and len("-".join(kept)) > LONGEST_NAME:
        kept.pop()
    left_out = len(parts) - len(kept)
    return "-".join(kept) + (f"+{left_out}" if left_out else "")


def _last(key: str) -> str:
    return re.split("[./]", key)[-1]


def _is_default(key: str, value: str, group: str, choices: Mapping[str, str]) -> bool:
    if key in group_options():
        return folders.configured_option(key) == value
    option = choices.get(group, "")
    if option not in group_options().get(group, ()):
        return False
    values = folders.option_values(group, option)
    name = key[len(group) + 1 :]
    return name in values and value_text(values[name]) == value


def _printable(part: str) -> str:
    part = re.sub(r"[\[\]{}()'\"\s]", "", part)
    part = "".join(character for character in part if character.isprintable())
    return part if len(part) <= LONGEST_PART else f"{part[: LONGEST_PART - 2]}.."
