"""The folders that ship with the package, and what the configuration's folder holds by name.

Nothing here reads YAML: the command line's completion and the messages need names alone, fast.
"""

import os
import re
from functools import cache
from pathlib import Path

from stixel_cli.errors import ConfigurationError

_PACKAGE = Path(__file__).resolve().parents[1]
_LINE = re.compile(r"^( *)([A-Za-z_]\w*):(.*)$", re.MULTILINE)


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
    files = sorted(path for pattern in ("*.yaml", "*/*.yaml") for path in folder.glob(pattern))
    stats = [(path, path.stat()) for path in files]
    return tuple((str(path), stat.st_mtime_ns, stat.st_size) for path, stat in stats)


@cache
def group_options() -> dict[str, tuple[str, ...]]:
    """Every group with the names of its options, both in alphabetical order."""
    groups = {}
    with os.scandir(configuration_folder()) as entries:
        folders = sorted(entry.path for entry in entries if entry.is_dir())
    for folder in folders:
        options = sorted(name[:-5] for name in os.listdir(folder) if name.endswith(".yaml"))
        if options:
            groups[os.path.basename(folder)] = tuple(options)
    return groups


def default_option(group: str) -> str:
    """The option of a group that `config.yaml` chooses, the first if that follows another group."""
    text = (configuration_folder() / "config.yaml").read_text(encoding="utf-8")
    chosen = re.search(rf"^ *- {group}: *(\w+)", text, re.MULTILINE)
    return chosen[1] if chosen else group_options()[group][0]


def option_values(group: str, option: str) -> dict[str, str]:
    """The keys of an option's file with what stands there, empty for what is not plain.

    Keys of nested groups have dots. It reads YAML as far as `conf/` uses it, and takes a hundredth
    of a parser's time.
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
    return values
