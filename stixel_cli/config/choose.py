"""The options of all groups, composed by Hydra; its results are cached in memory and on disk."""

import json
import os
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import lru_cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from stixel_cli.config.folders import (
    EXPERIMENT,
    configuration_folder,
    default_option,
    group_options,
    own_presets,
)
from stixel_cli.engine.parameters import default_cache_folder
from stixel_cli.errors import UserError
from stixel_cli.files import read_text

FOLDER = "configurations"
"""In the cache folder; the files of `conf/` change rarely, so it has few files."""

MOST_STORED = 500

_to_store: dict[Path, tuple[dict[str, Any], dict[str, str]]] = {}

# Hydra's composition goes through a singleton of the process.
_HYDRA = threading.Lock()


@lru_cache(maxsize=1024)
def choose(
    chosen: tuple[tuple[str, str], ...], state: str
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
    families: dict[str, list[str]] = {}
    for group, text in chosen:
        families.setdefault(group.partition("/")[0], []).append(text)
    found = None
    if len(families) > 1 and EXPERIMENT not in families:
        try:
            found = _choose_apart(families, state)
        except Exception as fault:
            from hydra.errors import HydraException

            # A group that follows another may need one of the other choices.
            if not isinstance(fault, HydraException):
                raise
    if found is None:
        return choose_together(tuple(text for _, text in chosen), state)
    return found


def _choose_apart(
    families: Mapping[str, list[str]], state: str
) -> tuple[dict[str, Any], dict[str, str]] | None:
    """As `choose`, from one composition per top-level group; None if groups affect each other."""
    base, base_choices = choose_together((), state)
    changed: dict[str, Any] = {}
    choices = dict(base_choices)
    for family, texts in families.items():
        plain, its_choices = choose_together(tuple(texts), state)
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
def choose_together(chosen: tuple[str, ...], state: str) -> tuple[dict[str, Any], dict[str, str]]:
    """The configuration that Hydra composes of the chosen options, before values are set.

    Hydra takes about 0.1 s, so the result is stored in the cache folder, under a digest of the
    options, of the files of `conf/` (`state`) and of Hydra's version.

    Returns:
        The configuration in plain types with interpolations as text, and the option of each group.
    """
    versions = [version(name) for name in ("hydra-core", "omegaconf")]
    key = sha256(json.dumps([chosen, state, versions]).encode()).hexdigest()
    file = default_cache_folder() / FOLDER / f"{key}.json"
    stored = _read(file)
    if stored is None:
        stored = _by_hydra(chosen)
        _to_store[file] = stored
    plain, choices = stored
    if choices[EXPERIMENT] == default_option(EXPERIMENT):
        return stored
    from stixel_cli.config.experiments import missing_options, without_other_options

    missing = missing_options(plain, choices, chosen)
    if missing:
        return choose_together((*chosen, *missing), state)
    return without_other_options(plain), choices


def store_compositions() -> None:
    """Store the new compositions; called for valid configurations, so wrong input writes nothing.

    Nothing happens if there is no cache folder, or if it cannot be written.
    """
    for file in list(_to_store):
        composition = _to_store.pop(file, None)  # another thread may have stored it
        if composition is not None:
            _write(file, composition)


def _by_hydra(chosen: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, str]]:
    import hydra
    from omegaconf import OmegaConf, open_dict

    folder = str(configuration_folder())
    own = own_presets()
    search = [] if own is None else [f'hydra.searchpath=["file://{own}"]']
    with (
        _HYDRA,
        _no_hydra_of_others(),
        hydra.initialize_config_dir(folder, job_name="stixel", version_base="1.3"),
    ):
        composed = hydra.compose("config", overrides=[*chosen, *search], return_hydra_config=True)
        options = dict(composed.hydra.runtime.choices)
    with open_dict(composed):
        del composed["hydra"]
    choices = {group: options[group] for group in group_options() if group in options}
    return OmegaConf.to_container(composed, resolve=False), choices


def _read(file: Path) -> tuple[dict[str, Any], dict[str, str]] | None:
    """A stored composition; None if it is missing or damaged."""
    try:
        digest, _, text = read_text(file).partition("\n")
    except (UserError, OSError):
        return None
    if sha256(text.encode()).hexdigest() != digest:
        return None
    plain, choices = json.loads(text)
    return plain, choices


def _write(file: Path, composition: tuple[dict[str, Any], dict[str, str]]) -> None:
    text = json.dumps(composition)
    if tuple(json.loads(text)) != composition:
        return  # a key of the user's own file that JSON turns into text, such as a number
    partial = file.with_name(f"{file.stem}-{os.getpid()}-{threading.get_ident()}.partial")
    with suppress(OSError):
        # Without parents: a command that needs no cache, such as `verify`, creates none.
        file.parent.mkdir(exist_ok=True)
        partial.write_text(f"{sha256(text.encode()).hexdigest()}\n{text}", encoding="utf-8")
        partial.replace(file)
        others = sorted(file.parent.iterdir(), key=lambda other: other.stat().st_mtime)
        for other in others[:-MOST_STORED]:
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
