"""The shipped folders, and the groups and options of `conf/` by name.

Shell completion and messages need only names, fast: no schema is imported.
"""

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from glob import glob
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from stixel_cli.border.files import read_yaml, remembered
from stixel_cli.border.origins import Origin, forget_told
from stixel_cli.errors import ConfigurationError, UserError, located

EXPERIMENT = "experiment"
"""The group whose options set options and values of other groups; it has no keys of its own."""

PACE = "pace"
"""The group of speeds and first positions of each class, which the options of `path` refer to."""

INNER, SOURCES = "inner_options", "sources"
"""Parts of the files of `EXPERIMENT` that are no settings."""

OF_THE_MACHINE = ("executor", "cache")
"""Groups that name where to compute, not what: they never come from a result folder."""

ENTRY_POINTS = {
    "tracker": "stixel.trackers",
    "measurement": "stixel.measurements",
    "metrics": "stixel.metrics",
}
"""Groups of entry points in which installed packages name their functions."""

STUDIES = (
    *("accuracy", "consistency", "motions", "robustness", "robustness_real"),
    *("rq1", "rq2", "rq3", "thesis"),
)
"""The shipped studies, in pipelines/studies/; any other file there is as one from anybody."""

_PACKAGE = Path(__file__).resolve().parents[1]


def outermost_group(text: str) -> str:
    """`measurement` of `measurement/noise`, `measurement.rays` and `measurement=lidar`."""
    return re.split(r"[./@:=]", text.lstrip("+~ "), maxsplit=1)[0].strip()


def of_the_machine(text: str) -> bool:
    """Whether an override belongs to a group of `OF_THE_MACHINE`, so no result depends on it."""
    return outermost_group(text) in OF_THE_MACHINE


def absolute(name: str, working_directory: str) -> str:
    """The full name of a file or folder as typed; `~` is the user's home."""
    return os.path.abspath(os.path.join(working_directory, os.path.expanduser(name)))


@cache
def shipped_folder(name: str) -> Path:
    """The folder `name` (`conf`, `pipelines`) of the checkout, or else of the installed package.

    An editable install can leave a stale copy in the package, so the checkout comes first. It is
    recognised by its `pyproject.toml`: next to an installed package, a folder of that name can
    belong to another project. ConfigurationError if neither exists.
    """
    checkout = _PACKAGE.parent / name
    if (_PACKAGE.parent / "pyproject.toml").is_file() and checkout.is_dir():
        return checkout
    inside = _PACKAGE / name
    if inside.is_dir():
        return inside
    raise ConfigurationError(f"{inside}: the folder is missing: install stixel again")


@dataclass
class Presets:
    """The user's own presets of this command."""

    folder: Path | None = None
    """`--config-dir`; None without one."""
    trusted: bool = False
    """Whether they may name code, by `--trust-code`."""

    @property
    def option(self) -> list[str]:
        """`--config-dir DIR` of a command line; empty without a folder."""
        return [] if self.folder is None else ["--config-dir", str(self.folder)]

    @property
    def origin(self) -> Origin:
        """Where what no override gives was written. `conf/` as shipped names no code."""
        return Origin(str(self.folder or shipped_folder("conf")), self.trusted)


PRESETS = Presets()


def trust_presets(trusted: bool) -> bool:
    """Let the user's own presets name code, or not; returns `trusted`."""
    PRESETS.trusted = trusted
    forget_told()
    return trusted


def use_presets(folder: Path | None) -> Path | None:
    """Add the options in `folder`, laid out as `conf/`, to those of `conf/`; returns `folder`.

    UserError if a group is unknown, an option of that name exists, or a file is not a preset.
    """
    if PRESETS.folder is not None or folder is not None:
        group_options.cache_clear()
        installed_functions.cache_clear()
    PRESETS.folder, PRESETS.trusted = None, False
    if folder is None:
        return None
    if not folder.is_dir():
        raise ConfigurationError(f"--config-dir: {folder}: no such folder")
    groups = group_options()
    for path in sorted(folder.rglob("*.yaml")):
        group, option = path.parent.relative_to(folder).as_posix(), path.stem
        if group not in groups:
            raise ConfigurationError(
                f"--config-dir: {path}: must be in a folder of a group's name, such as tracker/"
            )
        if option in groups[group]:
            raise ConfigurationError(f"--config-dir: {path}: {group}={option} exists; rename it")
        with located("--config-dir", ConfigurationError, UserError):
            content = read_yaml(path)
        for key, kind in (("defaults", list), ("inner_options", dict), ("sources", dict)):
            if not isinstance(content.get(key, kind()), kind):
                what = "list" if kind is list else "mapping"
                raise ConfigurationError(f"--config-dir: {path}: {key}: must be a {what}")
    group_options.cache_clear()
    PRESETS.folder = folder.resolve()
    return folder


def roots() -> list[Path]:
    """`conf/`, and the folder of the user's own presets, if there is one."""
    return [shipped_folder("conf"), *([] if PRESETS.folder is None else [PRESETS.folder])]


def option_file(group: str, option: str) -> Path:
    """The file of an option, in `conf/` or among the user's own presets."""
    files = [root / group / f"{option}.yaml" for root in roots()]
    return next((file for file in files[1:] if file.is_file()), files[0])


def conf_state() -> str:
    """The names, and digests of the contents, of all files of `conf/` and of own presets."""
    return "\n".join(
        f"{folder if folder == PRESETS.folder else ''} {name} {_content_digest(folder / name)}"
        for folder in roots()
        for name in sorted(glob("**/*.yaml", root_dir=folder, recursive=True))
    )


@remembered
def _content_digest(path: Path) -> str:
    from hashlib import sha256

    return sha256(path.read_bytes()).hexdigest()


@cache
def group_options() -> dict[str, tuple[str, ...]]:
    """Every group with the names of its options, both in alphabetical order.

    An inner group, which some options of the outer group have, is named `outer/inner`.
    """
    groups: dict[str, list[str]] = {}
    for root in map(str, roots()):
        for folder, _, files in os.walk(root):
            options = [name[:-5] for name in files if name.endswith(".yaml")]
            if options and folder != root:
                group = os.path.relpath(folder, root).replace(os.sep, "/")
                groups.setdefault(group, []).extend(options)
    return {group: tuple(sorted(options)) for group, options in sorted(groups.items())}


@cache
def installed_functions(group: str) -> dict[str, str]:
    """Functions of installed packages for `tracker`, `measurement` or `metrics`; not imported.

    Returns:
        Name to "module:function".
    """
    # It takes a tenth of a second to import.
    from importlib.metadata import entry_points

    shipped = group_options().get(group, ())
    points = entry_points(group=ENTRY_POINTS[group])
    return {point.name: point.value for point in points if point.name not in shipped}


def innermost_group(key: str) -> str:
    """The group that the key is in, or that its dots name: `measurement.noise.x` is in
    `measurement/noise`. Empty if it is in no group.
    """
    parts = key.split(".")
    names = ["/".join(parts[: i + 1]) for i in range(len(parts))]
    return next((name for name in reversed(names) if name in group_options()), "")


def option_content(group: str, option: str) -> dict[str, Any]:
    """The content of an option's file, in plain types, not to be changed; UserError if invalid."""
    return _content(option_file(group, option))


def values_beside_groups(name: str) -> dict[str, Any]:
    """The content of a file of `conf/` that is no option, `config` or `recorded`; as above."""
    return _content(shipped_folder("conf") / f"{name}.yaml")


def values_that_suit(suitable: Mapping[str, Any], facts: Mapping[str, Any]) -> dict[str, Any]:
    """Values by key for real data, of a section of `conf/recorded.yaml`.

    `facts` has the option of each group; None, or nothing, for a group that the user does not set.
    """
    return {
        key: value
        for entry in suitable["values"]
        if all(facts.get(name) in options for name, options in entry.get("when", {}).items())
        for key, value in entry["set"].items()
    }


@remembered
def _content(path: Path) -> dict[str, Any]:
    with located("", ConfigurationError, UserError):
        return read_yaml(path)


def chosen_options(content: Mapping[str, Any]) -> dict[str, str]:
    """Group to option, as the list of defaults in a file of `conf/` chooses them."""
    return {
        name.removeprefix("override").strip(" /"): option
        for entry in content.get("defaults") or ()
        if isinstance(entry, dict)
        for name, option in entry.items()
    }


def inner_options(group: str, option: str) -> dict[str, str]:
    """The inner groups that an `option` of `group` has, with the option that it chooses of each."""
    chosen = chosen_options(option_content(group, option))
    return {f"{group}/{inner}": name for inner, name in chosen.items()}


def outer_options(group: str) -> tuple[str, ...]:
    """The options of the outer group that have the inner `group`; () if there is no outer group."""
    outer = group.rpartition("/")[0]
    options = group_options().get(outer, ())
    return tuple(option for option in options if group in inner_options(outer, option))


def default_option(group: str) -> str:
    """The option of a group that `config.yaml` chooses; the first if that follows another group.

    For an inner group, the choice of the first outer option that has it.
    """
    outer = group.rpartition("/")[0]
    if outer:
        owners = outer_options(group)
        return inner_options(outer, owners[0])[group] if owners else group_options()[group][0]
    chosen = configured_option(group)
    return group_options()[group][0] if chosen is None or "$" in chosen else chosen


def options_of_kind(group: str, kind: str | None = None) -> list[str]:
    """The options of a group, only those of a `kind` if it is given; the default first."""
    options = sorted(group_options()[group], key=lambda option: option != default_option(group))
    return [o for o in options if kind is None or option_values(group, o).get("kind") == kind]


def configured_option(group: str) -> str | None:
    """The option of a group in `config.yaml`; `${road_user}` for one that follows another group."""
    return chosen_options(values_beside_groups("config")).get(group)


def option_values(group: str, option: str) -> dict[str, Any]:
    """The keys of an option's file with their values; keys of nested groups have dots."""
    return {n: v for n, v in flat(option_content(group, option)) if n != "defaults"}


def flat(section: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The keys of a mapping of mappings, with dots, and their values."""
    for name, value in section.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


@cache
def real_image_parameters() -> SimpleNamespace:
    """The parameters of the groups from real images to scans, as `source=pair` composes them.

    They are the values of `conf/`, with what `conf/recorded.yaml` sets for real images; a test
    compares them with those of `compose(["source=pair", …])`. Hydra is not imported.
    """
    from stixel_cli.measurements.stixels import StixelsParameters
    from stixel_cli.stereo.matching import SgmParameters
    from stixel_cli.stixels import parameters

    # Where `conf/` chooses another option by default, its schema belongs here.
    schemas = {
        "stereo": SgmParameters,
        "road": parameters.EstimatedRoad,
        "occupancy": parameters.OccupancyParameters,
        "free_space": parameters.FreeSpaceParameters,
        "height": parameters.HeightParameters,
        "extraction": parameters.ExtractionParameters,
        "measurement": StixelsParameters,
    }
    suitable = values_beside_groups("recorded")["source"]
    options = suitable["options"]
    suiting = values_that_suit(suitable, options | {"source": "pair", "auto": False})
    sections = {
        group: option_values(group, options.get(group) or configured_option(group))
        for group in schemas
    }
    for key, value in suiting.items():
        group, _, name = key.partition(".")
        if group in sections:
            sections[group][name] = value
    return SimpleNamespace(**{group: schemas[group](**v) for group, v in sections.items()})
