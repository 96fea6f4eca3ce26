"""Parameters with other constants than those of their class."""

from typing import Any


def with_constants(parameters: Any, **values: Any) -> Any:
    """The same parameters, of a subclass with other values of its constants."""
    own = type(parameters)
    return type(own.__name__, (own,), values)(**vars(parameters))
