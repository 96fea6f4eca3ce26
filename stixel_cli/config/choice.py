"""The options of all groups, composed by Hydra and kept in memory and on disk; values set in them.

Of the group `experiment`, whose files set options and values of several groups, two parts are not
Hydra's: `inner_options` and `sources`, see `conf/experiment/thesis.yaml`.
"""

import re
from collections.abc import Collection, Mapping
from contextlib import suppress
from functools import lru_cache
from typing import Any

from stixel_cli.border.files import read_yaml
from stixel_cli.config import folders, messages
from stixel_cli.config.folders import INNER, SOURCES
from stixel_cli.config.keys import chosen_kinds, known_keys
from stixel_cli.config.overrides import parser
from stixel_cli.config.texts import override_text, suggestion
from stixel_cli.engine.cache_folder import store_json, stored_json
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.keys import digest
from stixel_cli.engine.parameters import default_cache_folder
from stixel_cli.engine.versions import installed_version
from stixel_cli.errors import BelongsElsewhere, ConfigurationError, printable

FOLDER = "configurations"
"""In the cache folder, whose cleanup knows it; of 8 kB each."""

TOGETHER = (folders.EXPERIMENT, "road_user", "pace", "prior", "measurement", "start")
"""Outermost groups of which an option chooses that of another group, or includes another option."""

_TO_RESOLVE = re.compile(r"\$\{|\?\?\?")
_REFERENCE = re.compile(r"\$\{([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)\}")


Resolved = tuple[dict[str, Any], dict[str, str]]
"""A configuration in plain types, and the option of each group."""


@lru_cache(maxsize=1024)
def compose_options(chosen: tuple[tuple[str, str], ...], state: str) -> Resolved:
    """The configuration of `chosen` groups and options, with all others at their default.

    Interpolations are still texts. It is not to be changed: calls share it.

    A group that stands alone has the content of its option's file. Hydra composes the others. That
    takes 0.1 s and more, so it is stored in the cache folder, under a digest of the options, of the
    files of `conf/` (`state`, see `conf_state`) and of Hydra's version.
    ConfigurationError in one line, if Hydra cannot compose the options.
    """
    experiment = dict(chosen).get(folders.EXPERIMENT, folders.default_option(folders.EXPERIMENT))
    values = folders.option_values(folders.EXPERIMENT, experiment)
    together = {*TOGETHER, *map(folders.outermost_group, values)}
    alone = {g: option for g, option in chosen if folders.outermost_group(g) not in together}
    if alone and folders.PRESETS.folder is None:
        plain, options = compose_options(tuple(o for o in chosen if o[0] not in alone), state)
        sections = {group: folders.option_content(group, option) for group, option in alone.items()}
        return plain | sections, options | alone
    versions = [installed_version(name) for name in ("hydra-core", "omegaconf")]
    cache, file = default_cache_folder(), f"{digest([chosen, state, versions])}.json"
    known = stored_json(cache, FOLDER, file)
    plain, options = known or _by_hydra([override_text(g, option) for g, option in chosen], state)
    # Without a cache folder it is not stored: `verify`, for example, needs none.
    with suppress(OSError, CacheError):
        if known is None and cache.is_dir():
            store_json(cache, FOLDER, file, [plain, options])
    if options[folders.EXPERIMENT] == folders.default_option(folders.EXPERIMENT):
        return plain, options
    # Inner groups that the chosen options lack are left out.
    inner = plain.get(INNER) or {}
    if not isinstance(inner, Mapping):
        raise ConfigurationError(f"{folders.EXPERIMENT}: {INNER}: must be GROUP: OPTION pairs")
    missing = [(g, o) for g, o in inner.items() if g in options and g not in dict(chosen)]
    if missing:
        return compose_options((*chosen, *missing), state)
    plain = {name: value for name, value in plain.items() if name not in (INNER, SOURCES)}
    kinds = chosen_kinds(plain)
    lacking = [n for n, keys in known_keys().items() if not any(key.fits(kinds) for key in keys)]
    return _without(lacking, plain), options


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
    return {
        **(content.get(INNER) or {}),
        **folders.chosen_options(content),
        **{name: v for name, v in values.items() if not name.startswith((INNER, SOURCES))},
    }


def _by_hydra(chosen: list[str], state: str) -> Resolved:
    """`config.yaml` with the chosen options, by Hydra; its own settings are left out."""
    from hydra._internal.defaults_list import create_defaults_list
    from hydra.errors import HydraException
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    presets = folders.PRESETS.folder
    try:
        loader, files = _loader(state)
        parsed = [parser().parse_override(text) for text in chosen]
        listed = create_defaults_list(
            files, "config", parsed, prepend_hydra=False, skip_missing=False
        )
        composed = loader._compose_config_from_defaults_list(listed.defaults, files)
        known = listed.overrides.known_choices
        options = {group: known[group] for group in folders.group_options() if group in known}
        return OmegaConf.to_container(composed, resolve=False), options
    except (HydraException, OmegaConfBaseException) as fault:
        raise ConfigurationError(_not_composed(fault)) from None
    except Exception as fault:
        reason = printable(" ".join(str(fault).split()), 300)
        if presets is not None:
            if isinstance(fault, RecursionError):
                reason = "a preset includes itself in its defaults"
            raise ConfigurationError(f"--config-dir: {presets}: {reason}") from None
        if not isinstance(fault, YAMLError | UnicodeDecodeError | RecursionError):
            raise
        # Hydra does not name the file in some of these.
        for path in sorted(folders.shipped_folder("conf").rglob("*.yaml")):
            read_yaml(path)
        raise ConfigurationError(reason) from None


@lru_cache(maxsize=1)
def _loader(state: str) -> tuple[Any, Any]:
    """Hydra's loader, and the files of `conf/` and of own presets, each read once for a `state`.

    `hydra.compose` goes through a singleton that a notebook may use, reads all files again, and
    composes Hydra's settings of a job: three times the time. What is here is not public.
    """
    from hydra._internal.config_loader_impl import ConfigLoaderImpl
    from hydra._internal.config_repository import CachingConfigRepository
    from hydra._internal.config_search_path_impl import ConfigSearchPathImpl
    from hydra.core.plugins import Plugins

    Plugins.instance()  # It registers the kinds of files.
    search = ConfigSearchPathImpl()
    for folder in folders.roots():
        search.append("stixel", f"file://{folder}")
    search.append("schema", "structured://")  # Hydra asks for it.
    loader = ConfigLoaderImpl(search)
    return loader, CachingConfigRepository(loader.repository)


def _not_composed(fault: Exception) -> str:
    """One line for options that Hydra cannot compose."""
    # Typed options exist: a missing one follows another group, as `prior` follows `road_user`.
    group, _, option = (getattr(fault, "missing_cfg_file", None) or "").rpartition("/")
    if group not in folders.group_options():
        return printable((str(fault).splitlines() or ["no reason given"])[0], 300)
    return (
        f"{group}: unknown option {option!r}, which follows from what is chosen; add "
        f"conf/{group}/{option}.yaml, or choose {group}={'|'.join(folders.group_options()[group])}"
    )


def with_values(plain: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """`plain`, with the `values` of keys with dots, and all references `${KEY}` looked up.

    OmegaConf, whose other interpolations are refused here, takes thirty times as long.

    BelongsElsewhere for a key that the chosen options do not have. ConfigurationError for a
    reference to no key, or to itself.
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
    return {name: _resolved(section, name, tree) for name, section in tree.items()}


def _resolved(value: Any, name: str, tree: Mapping[str, Any], pending: tuple[str, ...] = ()) -> Any:
    """The value of the key or group `name` with its references looked up.

    A mapping or a list without references is itself: many configurations share it.
    """
    if isinstance(value, dict | list) and not _TO_RESOLVE.search(repr(value)):
        return value
    if isinstance(value, dict):
        return {k: _resolved(item, f"{name}.{k}", tree, pending) for k, item in value.items()}
    if isinstance(value, list):
        return [_resolved(item, name, tree, pending) for item in value]
    if value == "???":
        raise ConfigurationError(f"{name}: ??? is a missing value: give one")
    if not isinstance(value, str) or "${" not in value:
        return value
    match, target = _REFERENCE.fullmatch(value), tree
    if match is None or value in pending:
        fault = "refers to itself" if match else "cannot be looked up: write ${KEY}"
        raise ConfigurationError(f"{name}: '{printable(value)}' {fault}")
    for part in match[1].split("."):
        if not isinstance(target, Mapping) or part not in target:
            hint = suggestion(match[1], known_keys(), "${{{}}}".format)
            raise ConfigurationError(f"{name}: refers to {match[1]}, an unknown key{hint}")
        target = target[part]
    return _resolved(target, name, tree, (*pending, value))
