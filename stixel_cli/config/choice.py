"""The options of all groups, composed by Hydra and kept in memory and on disk; values set in them.

Of the group `experiment`, whose files set options and values of several groups, two parts are not
Hydra's: `inner_options` and `sources`, see `conf/experiment/thesis.yaml`.
"""

import json
import operator
import os
import re
import threading
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import lru_cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from stixel_cli.border import write_whole
from stixel_cli.config import folders, messages
from stixel_cli.config.keys import chosen_kinds, known_keys
from stixel_cli.config.texts import override_text
from stixel_cli.engine.cache_folder import make_folder
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.parameters import default_cache_folder
from stixel_cli.errors import BelongsElsewhere, ConfigurationError, UserError
from stixel_cli.files import read_text, read_yaml_text

FOLDER = "configurations"
"""In the cache folder; the files of `conf/` change rarely, so it has few files."""

MOST_STORED = 2000
"""Compositions on disk, of 8 kB each; the oldest are removed."""

INNER, SOURCES = "inner_options", "sources"

_REFERENCE = re.compile(r"\$\{([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)\}")

# Hydra's composition goes through a singleton of the process.
_HYDRA = threading.Lock()


@dataclass(frozen=True)
class Choice:
    """The configuration of chosen options, before values are set; not to be changed.

    Attributes:
        plain: in plain types with interpolations as text.
        options: the option of each group.
    """

    plain: dict[str, Any]
    options: dict[str, str]


@lru_cache(maxsize=1024)
def compose_options(chosen: tuple[tuple[str, str], ...], state: str) -> Choice:
    """The choice of groups and options, with all other groups at their default.

    Hydra takes 0.1 s and more, so the result is stored in the cache folder, under a digest of the
    options, of the files of `conf/` (`state`, see `conf_state`), of Hydra's version and the fields.
    A sweep has many combinations of few options: Hydra composes the options of each group once, see
    `_joined`. An experiment, and own presets, may set any group: with them it composes all at once.

    Raises:
        ConfigurationError: in one line, if Hydra cannot compose the options.
    """
    parts: dict[str, tuple[tuple[str, str], ...]] = {}
    for group, option in chosen:
        name = folders.outermost_group(group)
        parts[name] = (*parts.get(name, ()), (group, option))
    if len(parts) > 1 and folders.EXPERIMENT not in parts and folders.PRESETS.folder is None:
        # A group alone may lack what follows it, such as the prior of a class, if that is chosen.
        with suppress(ConfigurationError):
            composed = {name: compose_options(own, state) for name, own in parts.items()}
            return _joined(compose_options((), state), composed)
    versions = [version(name) for name in ("hydra-core", "omegaconf")]
    key = json.dumps([chosen, state, versions, list(Choice.__annotations__)])
    file = default_cache_folder() / FOLDER / f"{_digest(key)}.json"
    choice = _read(file)
    if choice is None:
        choice = _by_hydra([override_text(group, option) for group, option in chosen])
        _write(file, choice)
    if choice.options[folders.EXPERIMENT] == folders.default_option(folders.EXPERIMENT):
        return choice
    inner = choice.plain.get(INNER, {})
    if not isinstance(inner, Mapping):
        raise ConfigurationError(
            f"{folders.EXPERIMENT}={choice.options[folders.EXPERIMENT]}: {INNER}: must be GROUP: "
            "OPTION pairs"
        )
    # Inner groups that the chosen options lack are left out.
    missing = [(g, o) for g, o in inner.items() if g in choice.options and g not in dict(chosen)]
    if missing:
        return compose_options((*chosen, *missing), state)
    plain = {name: value for name, value in choice.plain.items() if name not in (INNER, SOURCES)}
    kinds = chosen_kinds(plain)
    lacking = [n for n, keys in known_keys().items() if not any(key.fits(kinds) for key in keys)]
    return Choice(_without(lacking, plain), choice.options)


def _joined(default: Choice, parts: Mapping[str, Choice]) -> Choice:
    """The choice of several groups, from those of each of them alone, by its name.

    A section is that of its own group, or of the one that it follows, as `prior` the `road_user`.
    """
    changed = {
        folders.outermost_group(group): part
        for part in parts.values()
        for group, option in part.options.items()
        if option != default.options.get(group)
    }
    of_groups = {name: (changed | parts).get(name, default) for name in default.plain}
    plain = {name: choice.plain[name] for name, choice in of_groups.items()}
    of_groups[folders.EXPERIMENT] = default
    found = {group: of_groups[folders.outermost_group(group)] for group in folders.group_options()}
    options = {g: choice.options[g] for g, choice in found.items() if g in choice.options}
    return Choice(plain, options)


def _without(names: Collection[str], section: Mapping[str, Any], prefix: str = "") -> Any:
    """A section without the keys that an experiment sets and the chosen options lack."""
    kept = {}
    for name, value in section.items():
        if prefix + name not in names:
            rest = _without(names, value, f"{prefix}{name}.") if isinstance(value, dict) else value
            if rest != {} or value == {}:
                kept[name] = rest
    return kept


def set_by_experiment(option: str) -> dict[str, Any]:
    """The groups and keys that an experiment's file sets, with their options and values."""
    content = folders.option_content(folders.EXPERIMENT, option)
    values = folders.option_values(folders.EXPERIMENT, option)
    inner = content.get(INNER)
    return {
        **(inner if isinstance(inner, Mapping) else {}),
        **folders.chosen_options(content),
        **{name: v for name, v in values.items() if not name.startswith((INNER, SOURCES))},
    }


def _by_hydra(chosen: list[str]) -> Choice:
    """`config.yaml` with the chosen options, by Hydra."""
    import hydra
    from hydra.errors import HydraException
    from omegaconf import OmegaConf, open_dict
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    presets = folders.PRESETS.folder
    search = [] if presets is None else [f'hydra.searchpath=["file://{presets}"]']
    folder = str(folders.shipped_folder("conf"))
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
        plain = OmegaConf.to_container(composed, resolve=False)
        return Choice(
            plain, {group: options[group] for group in folders.group_options() if group in options}
        )
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
        for path in sorted(folders.shipped_folder("conf").rglob("*.yaml")):
            read_yaml_text(path)
        raise ConfigurationError(reason) from None


def _not_composed(fault: Exception) -> str:
    """One line for options that Hydra cannot compose."""
    # Typed options exist: a missing one follows another group, as `prior` follows `road_user`.
    group, _, option = (getattr(fault, "missing_cfg_file", None) or "").rpartition("/")
    if group not in folders.group_options():
        return messages.first_line(fault)
    return (
        f"{group}: unknown option {option!r}, which follows from what is chosen; add "
        f"conf/{group}/{option}.yaml, or choose {group}={'|'.join(folders.group_options()[group])}"
    )


def _read(file: Path) -> Choice | None:
    """A stored composition; None if it is missing or damaged."""
    with suppress(UserError, OSError):
        digest, _, text = read_text(file).partition("\n")
        if _digest(text) == digest:
            return Choice(**json.loads(text))
    return None


def _write(file: Path, choice: Choice) -> None:
    """Store a composition, unless there is no cache folder: `verify`, for example, needs none."""
    folder, text = file.parent, json.dumps(asdict(choice))
    if not folder.parent.is_dir():
        return
    with suppress(OSError, CacheError):
        make_folder(folder.parent, FOLDER)
        write_whole(file, f"{_digest(text)}\n{text}")
        if len(os.listdir(folder)) > MOST_STORED:
            paths = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime)
            for other in paths[:-MOST_STORED]:
                other.unlink()


def _digest(text: str) -> str:
    return sha256(text.encode()).hexdigest()


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


def with_values(plain: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """`plain` with the values of some keys replaced and all interpolations resolved.

    References `${a.b}` are looked up here; OmegaConf resolves the rest, which takes thirty times
    as long.

    Args:
        plain: a configuration in plain types with interpolations as text; not changed.
        values: keys, with dots, to their values.

    Raises:
        BelongsElsewhere: for a key that the chosen options do not have.
        ConfigurationError: for an interpolation that cannot be resolved.
    """
    tree = dict(plain)
    for name, value in values.items():
        *outer, last = name.split(".")
        section = tree
        for part in outer:
            inner = section.get(part)
            # The dicts that contain the value are copied, because they are shared.
            section[part] = section = dict(inner) if isinstance(inner, Mapping) else {}
        if last not in section:
            raise BelongsElsewhere(messages.unknown_key(name, chosen_kinds(plain)), name)
        section[last] = value
    try:
        return {name: _resolved(section, tree) for name, section in tree.items()}
    except (LookupError, TypeError):
        return _by_omegaconf(tree)


def _resolved(value: Any, tree: Mapping[str, Any], pending: tuple[str, ...] = ()) -> Any:
    """The value with its references looked up; LookupError or TypeError for any other text.

    A mapping or a list without references is itself: many configurations share it.
    """
    if isinstance(value, dict):
        found = {name: _resolved(item, tree, pending) for name, item in value.items()}
        return value if all(map(operator.is_, found.values(), value.values())) else found
    if isinstance(value, list):
        found = [_resolved(item, tree, pending) for item in value]
        return value if all(map(operator.is_, found, value)) else found
    if not isinstance(value, str) or ("${" not in value and "???" not in value):
        return value
    match = _REFERENCE.fullmatch(value)
    if match is None or value in pending:
        raise LookupError(value)
    target: Any = tree
    for part in match[1].split("."):
        target = target[part]
    return _resolved(target, tree, (*pending, value))


def _by_omegaconf(tree: dict[str, Any]) -> dict[str, Any]:
    from omegaconf import OmegaConf
    from omegaconf.errors import (
        InterpolationKeyError,
        MissingMandatoryValue,
        OmegaConfBaseException,
    )

    try:
        container = OmegaConf.create(tree)
        return OmegaConf.to_container(container, resolve=True, throw_on_missing=True)
    except MissingMandatoryValue as fault:
        raise ConfigurationError(f"{fault.full_key}: ??? is a missing value: give one") from None
    except OmegaConfBaseException as fault:
        reason = messages.first_line(fault.msg or fault)
        wanted = re.search("key '(.*)'", reason)
        if isinstance(fault, InterpolationKeyError) and wanted:
            hint = messages.suggestion(wanted[1], known_keys(), form="${{{}}}")
            reason = f"refers to {wanted[1]}, an unknown key{hint}"
        name = fault.full_key or "the configuration"
        raise ConfigurationError(f"{name}: {reason}") from None
