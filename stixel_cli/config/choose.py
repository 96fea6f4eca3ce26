"""The options of all groups, composed by Hydra and cached in memory."""

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from stixel_cli.config.folders import (
    EXPERIMENT,
    configuration_folder,
    default_option,
    group_options,
)
from stixel_cli.config.keys import chosen_kinds, known_keys
from stixel_cli.errors import ConfigurationError
from stixel_cli.files import read_yaml

if TYPE_CHECKING:
    from omegaconf import DictConfig

# Hydra's composition goes through a singleton of the process.
_HYDRA = threading.Lock()


@lru_cache(maxsize=1024)
def choose(
    chosen: tuple[tuple[str, str], ...], state: tuple[Any, ...]
) -> tuple[dict[str, Any], dict[str, str]]:
    """The configuration of the chosen options, before values are set.

    Hydra composes the choices of each top-level group on their own, and the changed sections are
    put together: a sweep of 3 road users, 8 paths and 2 trackers needs 13 compositions, not 48.
    Where choices affect sections of other groups, Hydra composes all of them together.

    Args:
        chosen: groups and their overrides, such as `path` and `path=turn`.
        state: of the files, see `conf_state`.

    Returns:
        The configuration in plain types with interpolations as text, not to be changed; and the
        option of each group.

    Raises:
        HydraException: if Hydra cannot compose the options.
    """
    from hydra.errors import HydraException

    families: dict[str, list[str]] = {}
    for group, text in chosen:
        families.setdefault(group.partition("/")[0], []).append(text)
    found = None
    if len(families) > 1 and EXPERIMENT not in families:
        # A group that follows another may need one of the other choices.
        with suppress(HydraException):
            found = _choose_apart(families, state)
    if found is None:
        _, plain, choices = choose_together(tuple(text for _, text in chosen), state)
        return plain, choices
    return found


def _choose_apart(
    families: Mapping[str, list[str]], state: tuple[Any, ...]
) -> tuple[dict[str, Any], dict[str, str]] | None:
    """As `choose`, from one composition per top-level group; None if groups affect each other."""
    _, base, base_choices = choose_together((), state)
    changed: dict[str, Any] = {}
    choices = dict(base_choices)
    for family, texts in families.items():
        _, plain, its_choices = choose_together(tuple(texts), state)
        # Some groups follow another by default, as `pace` follows `road_user`.
        following = {
            group.partition("/")[0]
            for group, option in its_choices.items()
            if option != base_choices.get(group)
        }
        differing = {name for name in plain if plain[name] != base.get(name)}
        taken = {family} | (following - families.keys())
        if (
            plain.keys() != base.keys()
            or differing - following - {family}
            or taken & changed.keys()
        ):
            return None
        changed |= {name: plain[name] for name in taken}
        choices = {g: option for g, option in choices.items() if g.partition("/")[0] not in taken}
        choices |= {g: option for g, option in its_choices.items() if g.partition("/")[0] in taken}
    ordered = {group: choices[group] for group in group_options() if group in choices}
    return base | changed, ordered


@lru_cache(maxsize=1024)
def choose_together(
    chosen: tuple[str, ...], state: tuple[Any, ...]
) -> "tuple[DictConfig, dict[str, Any], dict[str, str]]":
    """The configuration that Hydra composes of the chosen options, before values are set.

    Hydra takes about 0.05 s, so the result is cached while the files of `conf/` keep their `state`.

    Returns:
        The configuration, the same in plain types with interpolations as text, and the option of
        each group.
    """
    import hydra
    from omegaconf import OmegaConf, open_dict

    folder = str(configuration_folder())
    with (
        _HYDRA,
        _no_hydra_of_others(),
        hydra.initialize_config_dir(folder, job_name="stixel", version_base="1.3"),
    ):
        composed = hydra.compose("config", overrides=list(chosen), return_hydra_config=True)
        options = dict(composed.hydra.runtime.choices)
    choices = {group: options[group] for group in group_options() if group in options}
    with open_dict(composed):
        del composed["hydra"]
        composed.pop("sources", None)
        inner = composed.pop("inner_options", {})
        if not isinstance(inner, Mapping):
            raise ConfigurationError(
                f"{EXPERIMENT}={choices[EXPERIMENT]}: inner_options must be GROUP: OPTION pairs"
            )
        typed = {text.partition("=")[0] for text in chosen}
        missing = [
            f"{group}={option}"
            for group, option in inner.items()
            if group in choices and group not in typed
        ]
        if missing:
            return choose_together((*chosen, *missing), state)
        if choices[EXPERIMENT] != default_option(EXPERIMENT):
            _drop_values_of_other_options(composed)
    return composed, OmegaConf.to_container(composed, resolve=False), choices


def experiment_sources(option: str) -> dict[str, str]:
    """The sources that an experiment's file states: key or group to text, in the file's order."""
    content = read_yaml(configuration_folder() / EXPERIMENT / f"{option}.yaml")
    return dict((content or {}).get("sources", {}))


def _drop_values_of_other_options(composed: "DictConfig") -> None:
    """Remove the values of an experiment whose keys the chosen options do not have."""
    kinds = chosen_kinds(composed)
    for name, variants in known_keys().items():
        if not any(all(kinds.get(g) == kind for g, kind in one.owners) for one in variants):
            _remove(composed, name.split("."))


def _remove(section: Any, parts: list[str]) -> None:
    """Remove a key, and the sections that are empty without it."""
    if isinstance(section, Mapping) and parts[0] in section:
        if parts[1:]:
            _remove(section[parts[0]], parts[1:])
        if not parts[1:] or section[parts[0]] == {}:
            section.pop(parts[0])


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
