"""The folders that ship with the package, and what the configuration's folder holds by name.

Nothing here reads YAML: the command line's completion and the messages need names alone, fast.
"""

import os
import re
from functools import cache
from pathlib import Path

from stixel_cli.errors import ConfigurationError

EXPERIMENT = "experiment"
"""The group whose options set options and values of other groups; it has no keys of its own."""

_PACKAGE = Path(__file__).resolve().parents[1]
_LINE = re.compile(r"^( *)([A-Za-z_]\w*):(.*)$", re.MULTILINE)
_DEFAULTS = re.compile(r"^defaults:.*\n((?: *-.*\n)+)", re.MULTILINE)
_DEFAULT = re.compile(r"^ *- ([A-Za-z_]\w*): *(\w+)", re.MULTILINE)


def shipped_folder(name: str) -> Path:
    """The folder `name` (`conf`, `pipelines`): of the checkout if this is one, else the installed.

    An editable install can leave a stale copy within the package, so the checkout comes first. A
    folder of that name beside an installed package is somebody else's: hence the project's file.

    Raises:
        ConfigurationError: if there is neither.
    """
    beside = _PACKAGE.parent / name
    if (_PACKAGE.parent / "pyproject.toml").is_file() and beside.is_dir():
        return beside
    inside = _PACKAGE / name
    if inside.is_dir():
        return inside
    raise ConfigurationError(f"{inside}: the folder is missing: install stixel again")


def configuration_folder() -> Path:
    """The folder of the configuration's groups."""
    return shipped_folder("conf")


def conf_state() -> tuple[tuple[str, int, int], ...]:
    """Name, time and size of every file of `conf/`: equal as long as nobody has edited one."""
    folder = configuration_folder()
    stats = [(path, path.stat()) for path in sorted(folder.rglob("*.yaml"))]
    return tuple((str(path), stat.st_mtime_ns, stat.st_size) for path, stat in stats)


@cache
def group_options() -> dict[str, tuple[str, ...]]:
    """Every group with the names of its options, both in alphabetical order.

    A group within another, which some of its options have, is named `outer/inner`.
    """
    root = str(configuration_folder())
    groups = {}
    for folder, _, files in os.walk(root):
        options = sorted(name[:-5] for name in files if name.endswith(".yaml"))
        if options and folder != root:
            groups[os.path.relpath(folder, root).replace(os.sep, "/")] = tuple(options)
    return dict(sorted(groups.items()))


def innermost_group(key: str) -> str:
    """The group that the key is in, or that its dots name: `measurement.noise.x` is in
    `measurement/noise`. Empty if there is none.
    """
    parts = key.split(".")
    names = ["/".join(parts[: i + 1]) for i in range(len(parts))]
    return next((name for name in reversed(names) if name in group_options()), "")


def inner_options(group: str, option: str) -> dict[str, str]:
    """The groups within `group` that its `option` has, and the option of each that it chooses."""
    text = (configuration_folder() / group / f"{option}.yaml").read_text(encoding="utf-8")
    lists = "".join(_DEFAULTS.findall(text))
    return {f"{group}/{inner}": chosen for inner, chosen in _DEFAULT.findall(lists)}


def outer_options(group: str) -> tuple[str, ...]:
    """The options of the group around `group` that have it; () if there is no such group."""
    outer = group.rpartition("/")[0]
    options = group_options().get(outer, ())
    return tuple(option for option in options if group in inner_options(outer, option))


def options_of_kind(group: str, kind: str) -> tuple[str, ...]:
    """The options of a group whose `kind` this is; the one that bears its name stands for all."""
    options = group_options()[group]
    if kind in options:
        return (kind,)
    return tuple(one for one in options if option_values(group, one).get("kind") == kind)


def default_option(group: str) -> str:
    """The option of a group that `config.yaml` chooses, the first if that follows another group.

    Of a group within another it is what the first option that has it chooses.
    """
    outer = group.rpartition("/")[0]
    if outer:
        owners = outer_options(group)
        return inner_options(outer, owners[0])[group] if owners else group_options()[group][0]
    text = (configuration_folder() / "config.yaml").read_text(encoding="utf-8")
    chosen = re.search(rf"^ *- {group}: *(\w+)", text, re.MULTILINE)
    return chosen[1] if chosen else group_options()[group][0]


def option_values(group: str, option: str) -> dict[str, str]:
    """The keys of an option's file with what stands there, empty for what is not plain.

    Keys of nested groups have dots; the list of defaults is no key. It reads YAML as far as `conf/`
    uses it, and takes a hundredth of a parser's time.
    """
    text = (configuration_folder() / group / f"{option}.yaml").read_text(encoding="utf-8")
    values: dict[str, str] = {}
    outer: list[tuple[int, str]] = []
    for indent, key, value in _LINE.findall(text):
        while outer and outer[-1][0] >= len(indent):
            outer.pop()
        name = ".".join([*(parent for _, parent in outer), key])
        if outer:
            values.pop(name.rpartition(".")[0], None)
        values[name] = value.partition(" #")[0].strip()
        if values[name].startswith("{"):
            inner = re.findall(r"(\w+):", values.pop(name))
            values |= dict.fromkeys((f"{name}.{key}" for key in inner), "")
        outer.append((len(indent), key))
    values.pop("defaults", None)
    return values
