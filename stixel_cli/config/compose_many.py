"""Many configurations at once: what `compose` gives, at a thirtieth of its time a point.

Hydra and OmegaConf take 8 ms a point. Here the options' files are read once each, put together as
plain dicts, and the few interpolations that `conf/` has, `${a.b}` alone, are looked up. Whatever is
more than that, and whatever is wrong, is left to `compose`: its result, or its message, stands.
"""

import json
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from stixel_cli.config.checks import check
from stixel_cli.config.compose import Composition, compose, name_files_in_full
from stixel_cli.config.folders import configuration_folder, group_options
from stixel_cli.config.overrides import check_one_run, check_overrides, parse_overrides
from stixel_cli.config.schema import Configuration, adapter
from stixel_cli.errors import ConfigurationError
from stixel_cli.files import read_yaml_text

if TYPE_CHECKING:
    from hydra.core.override_parser.types import Override

_INTERPOLATION = re.compile(r"\$\{([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)\}")


class _Beyond(Exception):
    """More than plain dicts can do: `compose` has to do it."""


class Composer:
    """Composes one configuration after the other, as the files of `conf/` were at the first.

    Equal groups of different configurations are one object, so that what is derived of a group can
    be kept by its identity. `working_directory` is as that of `compose`.
    """

    def __init__(self, working_directory: str = ""):
        self._working_directory = working_directory
        group_options.cache_clear()
        self._parsed: dict[str, Override] = {}
        self._files: dict[tuple[str, str], dict[str, Any]] = {}
        self._bases: dict[tuple[tuple[str, str], ...], tuple[dict[str, Any], dict[str, str]]] = {}
        self._parts: dict[tuple[str, str], Any] = {}
        self._defaults: list[tuple[str, str]] | None = None
        self._own: dict[str, Any] = {}

    def compose(self, overrides: Sequence[str]) -> Composition:
        """The same as `compose(overrides)` of `stixel_cli.config.compose`.

        Raises:
            ConfigurationError: as that does.
        """
        texts = tuple(overrides)
        parsed = [self.parse(text) for text in texts]
        try:
            check_overrides(parsed)
            check_one_run(parsed)
            resolved, choices = self._resolved(parsed)
            name_files_in_full(resolved, self._working_directory)
            text = json.dumps(resolved)
            configuration = adapter().validate_json(text)
            check(configuration)
        except (_Beyond, ConfigurationError, TypeError, ValueError):
            # The unusual way, or the one that knows how to say what is wrong.
            composition = compose(texts, self._working_directory)
            resolved, choices = composition.resolved, composition.choices
            configuration = composition.configuration
        return Composition(self._shared(configuration, resolved), choices, texts, resolved)

    def parse(self, text: str) -> "Override":
        """One override, parsed once however often it is asked for."""
        if text not in self._parsed:
            self._parsed[text] = parse_overrides([text])[0]
        return self._parsed[text]

    def _shared(self, configuration: Configuration, resolved: dict[str, Any]) -> Configuration:
        parts = {
            # By the text, for 0.0 and -0.0 are equal and give different keys.
            name: self._parts.setdefault((name, json.dumps(value)), getattr(configuration, name))
            for name, value in resolved.items()
        }
        return Configuration(**parts)

    def _resolved(self, parsed: "Sequence[Override]") -> tuple[dict[str, Any], dict[str, str]]:
        chosen: dict[str, str] = {}
        values: list[tuple[str, Any]] = []
        for override in parsed:
            name, value = override.key_or_group, override.value()
            if name in group_options():
                chosen[name] = str(value)
            else:
                values.append((name, value))
        base, choices = self._base(chosen)
        tree = {
            name: dict(section) if isinstance(section, dict) else section
            for name, section in base.items()
        }
        for name, value in values:
            _put(tree, name.split("."), value)
        return _Resolver(tree).all(), dict(choices)

    def _base(self, chosen: dict[str, str]) -> tuple[dict[str, Any], dict[str, str]]:
        """The options put together, not resolved yet, and which they are."""
        key = tuple(sorted(chosen.items()))
        if key not in self._bases:
            self._bases[key] = self._put_together(chosen)
        return self._bases[key]

    def _put_together(self, chosen: dict[str, str]) -> tuple[dict[str, Any], dict[str, str]]:
        defaults = self._read_defaults()
        options = {group: chosen.get(group, option) for group, option in defaults}
        tree: dict[str, Any] = {}
        for group, _ in defaults:
            if group == "_self_":
                tree.update(self._own)
                continue
            option = options[group]
            follows = _INTERPOLATION.fullmatch(option)
            if follows:
                option = options[group] = options[follows[1]]
            tree[group] = self._with_inner(group, option, chosen, options)
        if not chosen.keys() <= options.keys():
            raise _Beyond
        choices = {group: options[group] for group in group_options() if group in options}
        return tree, choices

    def _read_defaults(self) -> list[tuple[str, str]]:
        """Group and option as `config.yaml` names them, in its order; ("_self_", "") for itself."""
        if self._defaults is None:
            content = _load(configuration_folder() / "config.yaml")
            defaults = []
            for item in content.pop("defaults", ()):
                if item == "_self_":
                    defaults.append((item, ""))
                elif isinstance(item, dict) and len(item) == 1:
                    ((group, option),) = item.items()
                    if group not in group_options() or not isinstance(option, str):
                        raise _Beyond
                    defaults.append((group, option))
                else:
                    raise _Beyond
            self._own, self._defaults = content, defaults
        return self._defaults

    def _with_inner(
        self, group: str, option: str, chosen: dict[str, str], options: dict[str, str]
    ) -> dict[str, Any]:
        """Content of an option with the groups in it, whose options are put into `options`.

        Hydra puts what the defaults name in their order, the file's own keys where `_self_` is.
        """
        content = dict(self._option(group, option))
        defaults = content.pop("defaults", ["_self_"])
        tree: dict[str, Any] = {}
        for item in defaults:
            if item == "_self_":
                tree.update(content)
            elif isinstance(item, dict) and len(item) == 1:
                ((inner, its),) = item.items()
                name = f"{group}/{inner}"
                if name not in group_options() or inner in content or not isinstance(its, str):
                    raise _Beyond
                options[name] = chosen.get(name, its)
                if "${" in options[name]:
                    raise _Beyond
                tree[inner] = self._with_inner(name, options[name], chosen, options)
            else:
                raise _Beyond
        if "_self_" not in defaults:
            raise _Beyond
        return tree

    def _option(self, group: str, option: str) -> dict[str, Any]:
        if (group, option) not in self._files:
            self._files[group, option] = _load(configuration_folder() / group / f"{option}.yaml")
        return self._files[group, option]


def _load(path: Any) -> dict[str, Any]:
    from omegaconf import OmegaConf
    from yaml import YAMLError

    try:
        text = read_yaml_text(path)
        if "@package" in text:
            raise _Beyond
        # Its YAML takes 1e-6 for a number, which YAML's own does not.
        content = OmegaConf.to_container(OmegaConf.create(text), resolve=False)
    except (AssertionError, YAMLError):
        raise _Beyond from None
    if not isinstance(content, dict):
        raise _Beyond
    return content


def _put(tree: dict[str, Any], parts: list[str], value: Any) -> None:
    """Replace a value; the dicts on the way to it are copied, for they are shared."""
    section = tree
    for part in parts[:-1]:
        inner = section.get(part)
        if not isinstance(inner, dict):
            raise _Beyond
        section[part] = section = dict(inner)
    if parts[-1] not in section or isinstance(section[parts[-1]], dict) or isinstance(value, dict):
        raise _Beyond
    section[parts[-1]] = value


class _Resolver:
    """A tree with its interpolations looked up."""

    def __init__(self, tree: dict[str, Any]):
        self._tree = tree
        self._on_the_way: list[str] = []

    def all(self) -> dict[str, Any]:
        return {name: self._resolve(value) for name, value in self._tree.items()}

    def _resolve(self, value: Any) -> Any:
        if isinstance(value, dict):
            return {name: self._resolve(item) for name, item in value.items()}
        if isinstance(value, list):
            return [self._resolve(item) for item in value]
        if isinstance(value, str) and ("${" in value or value == "???"):
            return self._look_up(value)
        return value

    def _look_up(self, text: str) -> Any:
        match = _INTERPOLATION.fullmatch(text)
        if match is None or text in self._on_the_way:
            raise _Beyond
        value: Any = self._tree
        for part in match[1].split("."):
            if not isinstance(value, dict) or part not in value:
                raise _Beyond
            value = value[part]
        self._on_the_way.append(text)
        value = self._resolve(value)
        self._on_the_way.pop()
        return value
