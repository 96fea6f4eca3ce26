"""The decorator of all parameter dataclasses."""

from dataclasses import dataclass
from typing import Any, dataclass_transform

STRICT = {"extra": "forbid", "strict": True, "allow_inf_nan": False}


@dataclass_transform(frozen_default=True)
def parameters(cls: Any = None, *, kw_only: bool = False) -> Any:
    """A frozen dataclass that pydantic validates strictly.

    Unknown keys, wrong types and non-finite numbers are refused. The protocol is pydantic's, but
    this does not import pydantic.
    """

    def decorate(decorated: type) -> type:
        decorated.__pydantic_config__ = dict(STRICT)
        return dataclass(frozen=True, kw_only=kw_only)(decorated)

    return decorate if cls is None else decorate(cls)
