"""The options of all groups, composed by Hydra; each composition is kept in memory and on disk.

Of the group `experiment`, whose files set options and values of several groups, two parts are not
Hydra's: `inner_options` and `sources`, see `conf/experiment/thesis.yaml`.
"""

import copy
import json
import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from stixel_cli.config import messages
from stixel_cli.config.folders import (
    EXPERIMENT,
    chosen_options,
    configuration_folder,
    default_option,
    group_options,
    option_content,
    option_values,
    own_presets,
)
from stixel_cli.config.keys import chosen_kinds, known_keys
from stixel_cli.config.values import is_interpolated
from stixel_cli.engine.cache_folder import make_folder
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.parameters import default_cache_folder
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.files import read_text, read_yaml_text, write_whole

FOLDER = "configurations"
"""In the cache folder; the files of `conf/` change rarely, so it has few files."""

MOST_STORED = 2000
"""Compositions on disk, of 8 kB each; the oldest are removed."""

INNER, SOURCES = "inner_options", "sources"

_to_store: dict[Path, "Choice"] = {}

# Hydra's composition goes through a singleton of the process.
_HYDRA = threading.Lock()


@dataclass(frozen=True)
class Choice:
    """The configuration of chosen options, before values are set; not to be changed.

    Attributes:
        plain: in plain types with interpolations as text.
        options: the option of each group.
        interpolated: the sections of `plain` that have interpolations.
    """

    plain: dict[str, Any]
    options: dict[str, str]
    interpolated: list[str]


@lru_cache(maxsize=1024)
def compose_options(chosen: tuple[str, ...], state: str) -> Choice:
    """The choice of options such as `path=circle`, with all other groups at their default.

    Hydra takes about 0.1 s, so the result is stored in the cache folder, under a digest of the
    options, of the files of `conf/` (`state`, see `conf_state`), of Hydra's version and the fields.

    Raises:
        ConfigurationError: in one line, if Hydra cannot compose the options.
    """
    parts = [[version(name) for name in ("hydra-core", "omegaconf")], list(Choice.__annotations__)]
    key = sha256(json.dumps([chosen, state, *parts]).encode()).hexdigest()
    file = default_cache_folder() / FOLDER / f"{key}.json"
    choice = _read(file)
    if choice is None:
        choice = _to_store[file] = _by_hydra(chosen)
    if choice.options[EXPERIMENT] == default_option(EXPERIMENT):
        return choice
    missing = _missing_options(choice, chosen)
    if missing:
        return compose_options((*chosen, *missing), state)
    return replace(choice, plain=_without_other_options(choice.plain))


def experiment_sources(option: str) -> dict[str, str]:
    """The sources that an experiment's file states: key or group to text, in the file's order."""
    return dict(option_content(EXPERIMENT, option).get(SOURCES, {}))


def set_by_experiment(option: str) -> dict[str, Any]:
    """The groups and keys that an experiment's file sets, with their options and values."""
    content = option_content(EXPERIMENT, option)
    values = option_values(EXPERIMENT, option)
    return {
        **content.get(INNER, {}),
        **chosen_options(content),
        **{name: v for name, v in values.items() if not name.startswith((INNER, SOURCES))},
    }


def _missing_options(choice: Choice, chosen: Sequence[str]) -> list[str]:
    """The overrides of inner groups that an experiment wants and that are not in `chosen`.

    Groups that the chosen options lack are left out.

    Raises:
        ConfigurationError: if the experiment's `inner_options` are not pairs.
    """
    inner = choice.plain.get(INNER, {})
    if not isinstance(inner, Mapping):
        raise ConfigurationError(
            f"{EXPERIMENT}={choice.options[EXPERIMENT]}: {INNER}: must be GROUP: OPTION pairs"
        )
    return [
        f"{group}={option}"
        for group, option in inner.items()
        if group in choice.options and not any(text.startswith(f"{group}=") for text in chosen)
    ]


def _without_other_options(plain: Mapping[str, Any]) -> dict[str, Any]:
    """`plain` without the values of an experiment whose keys the chosen options do not have."""
    rest = copy.deepcopy(
        {name: value for name, value in plain.items() if name not in (INNER, SOURCES)}
    )
    kinds = chosen_kinds(rest)
    for name, variants in known_keys().items():
        if not any(all(kinds.get(g) == kind for g, kind in key.owners) for key in variants):
            _remove(rest, name.split("."))
    return rest


def _remove(section: Any, parts: list[str]) -> None:
    """Remove a key, and the sections that are empty without it."""
    if isinstance(section, dict) and parts[0] in section:
        if parts[1:]:
            _remove(section[parts[0]], parts[1:])
        if not parts[1:] or section[parts[0]] == {}:
            section.pop(parts[0])


def store_choices() -> None:
    """Store the new compositions; called for valid configurations, so wrong input writes nothing.

    Nothing happens if there is no cache folder, or if it cannot be written.
    """
    for file in list(_to_store):
        choice = _to_store.pop(file, None)  # another thread may have stored it
        if choice is not None:
            _write(file, choice)


def _by_hydra(chosen: tuple[str, ...]) -> Choice:
    import hydra
    from hydra.errors import HydraException
    from omegaconf import OmegaConf, open_dict
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    presets = own_presets()
    search = [] if presets is None else [f'hydra.searchpath=["file://{presets}"]']
    folder = str(configuration_folder())
    try:
        with (
            _HYDRA,
            _no_hydra_of_others(),
            hydra.initialize_config_dir(folder, job_name="stixel", version_base="1.3"),
        ):
            composed = hydra.compose("config", [*chosen, *search], return_hydra_config=True)
            options = dict(composed.hydra.runtime.choices)
        with open_dict(composed):
            del composed["hydra"]
        ordered = {group: options[group] for group in group_options() if group in options}
        plain = OmegaConf.to_container(composed, resolve=False)
        return Choice(plain, ordered, [name for name in plain if is_interpolated(plain[name])])
    except (HydraException, OmegaConfBaseException) as fault:
        raise ConfigurationError(_not_composed(fault)) from None
    except Exception as fault:
        reason = messages.printable(" ".join(str(fault).split()), 300)
        if presets is not None:
            if isinstance(fault, RecursionError):
                reason = "a preset includes itself in its defaults"
            raise ConfigurationError(f"--config-dir: {presets}: {reason}") from None
        if not isinstance(fault, YAMLError | UnicodeDecodeError | RecursionError):
            raise
        # Hydra does not name the file in some of these.
        for path in sorted(configuration_folder().rglob("*.yaml")):
            read_yaml_text(path)
        raise ConfigurationError(reason) from None


def _not_composed(fault: Exception) -> str:
    """One line for options that Hydra cannot compose.

    Typed options have been checked before: a missing option follows another group, as `pace` and
    `prior` follow `road_user`.
    """
    group, _, option = (getattr(fault, "missing_cfg_file", None) or "").rpartition("/")
    if group not in group_options():
        return messages.first_line(fault)
    return (
        f"{group}: unknown option {option!r}, which follows from what is chosen; add "
        f"conf/{group}/{option}.yaml, or choose {group}={'|'.join(group_options()[group])}"
    )


def _read(file: Path) -> Choice | None:
    """A stored composition; None if it is missing or damaged."""
    try:
        digest, _, text = read_text(file).partition("\n")
    except (UserError, OSError):
        return None
    if sha256(text.encode()).hexdigest() != digest:
        return None
    return Choice(**json.loads(text))


def _write(file: Path, choice: Choice) -> None:
    text = json.dumps(asdict(choice))
    if Choice(**json.loads(text)) != choice:
        return  # a key of the user's own file that JSON turns into text, such as a number
    if not file.parents[1].is_dir():
        return  # a command that needs no cache, such as `verify`, creates none
    with suppress(OSError, CacheError):
        make_folder(file.parents[1], FOLDER)
        write_whole(file, f"{sha256(text.encode()).hexdigest()}\n{text}")
        others = os.listdir(file.parent)
        if len(others) > MOST_STORED:
            paths = sorted(map(file.parent.joinpath, others), key=lambda path: path.stat().st_mtime)
            for other in paths[:-MOST_STORED]:
                other.unlink()


@contextmanager
def _no_hydra_of_others() -> Iterator[None]:
    """Hydra's singleton empty, and as it was afterwards: a notebook may have its own."""
    from hydra.core.global_hydra import GlobalHydra

    theirs = GlobalHydra.instance().hydra
    GlobalHydra.instance().clear()
    try:
        yield
    finally:
        GlobalHydra.instance().hydra = theirs
