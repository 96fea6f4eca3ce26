"""Groups within another, such as `measurement/noise`, as they are typed."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from stixel_cli.config.folders import default_option, group_options, innermost_group, outer_options
from stixel_cli.errors import BelongsElsewhere, ConfigurationError

if TYPE_CHECKING:
    from hydra.core.override_parser.types import Override


def group_by_dots(name: str, value: Any) -> str:
    """A group within another is chosen with a slash: `measurement/noise=constant`."""
    group = name.replace(".", "/")
    options = group_options()[group]
    meant = value if value in options else "|".join(options)
    return f"{name}: is a group: write {group}={meant}"


def refuse_without_outer(parsed: "Sequence[Override]") -> None:
    """Refuse a group within another whose chosen option has no such group.

    `parsed` are all overrides of one run, of one value each.

    Raises:
        BelongsElsewhere: in one line that says which option has it.
    """
    chosen = {one.key_or_group: one for one in parsed}
    for group in chosen:
        outer = group.rpartition("/")[0]
        if group not in group_options() or not outer:
            continue
        option = str(chosen[outer].value()) if outer in chosen else default_option(outer)
        owners = outer_options(group)
        if option not in owners:
            raise BelongsElsewhere(
                f"{group}: there is no such group with {outer}={option}; it belongs to "
                f"{outer}={'|'.join(owners)}"
            )


def refuse_group_as_key(name: str, value: Any) -> None:
    """Refuse a group that is typed with dots, and a `kind`, which follows from the option.

    Raises:
        ConfigurationError: in one line that says how it is written.
    """
    if name.replace(".", "/") in group_options():
        raise ConfigurationError(group_by_dots(name, value))
    group = innermost_group(name)
    if group and name == group.replace("/", ".") + ".kind":
        options = ", ".join(group_options()[group])
        raise ConfigurationError(
            f"{name}: follows from the option of {group}: write {group}=… (options: {options})"
        )
