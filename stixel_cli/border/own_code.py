"""The user's own functions: `module:function`, outside of this package, and their parameters."""

import dataclasses
import inspect
import re
from collections.abc import Callable, Mapping
from typing import Any, Literal, get_type_hints

from stixel_cli.border.origins import TYPED, imported
from stixel_cli.parameters import STRICT, parameters

_NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*")


@parameters
class OwnCode:
    """An option that is the user's own function.

    Attributes:
        function: "package.module:function".
        parameters: keys of the group as typed, in plain types.
    """

    kind: Literal["own"]
    function: str
    parameters: dict[str, Any]

    def check(self) -> None:
        """Raise ValueError unless `function` has the form of a name."""
        check_name(self.function)


def check_name(function: str) -> None:
    """Raise ValueError unless the text is `module:function` of a module that can be imported."""
    if not _NAME.fullmatch(function):
        raise ValueError(f"{function!r}: must be module:function, such as my_tracker:track")
    if function.partition(":")[0] == "__main__":
        raise ValueError(
            f"{function}: a worker cannot import __main__: put the function into a file"
        )


def loaded(name: str) -> Callable[..., Any]:
    """The function "module:function"; ValueError if the module has no such function."""
    module, _, attribute = name.partition(":")
    function = getattr(imported(module, TYPED), attribute, None)
    if not callable(function):
        raise ValueError(f"{name}: the module {module} has no function {attribute}")
    return function


def parameters_type(function: Callable[..., Any], given: int) -> type | None:
    """The dataclass that annotates the parameter after the first `given` ones; None without one."""
    names = list(inspect.signature(function).parameters)[given:]
    hint = get_type_hints(function).get(names[0]) if names else None
    return hint if isinstance(hint, type) and dataclasses.is_dataclass(hint) else None


def further_arguments(
    function: Callable[..., Any], given: int, values: Mapping[str, Any]
) -> dict[str, Any]:
    """The keyword arguments of a function after its first `given` ones, from the user's keys.

    If the next parameter is annotated with a dataclass, it is one object of it, validated as the
    parameters of this package are; else each key is an argument. pydantic.ValidationError if the
    values do not fit the dataclass. ValueError if an argument is unknown or missing; the text
    begins with its name.
    """
    signature = inspect.signature(function).parameters
    further = dict(list(signature.items())[given:])
    schema = parameters_type(function, given)
    if schema is not None:
        return {next(iter(further)): _validated(schema, values)}
    kinds = {parameter.kind for parameter in further.values()}
    for name in values:
        if name not in further and inspect.Parameter.VAR_KEYWORD not in kinds:
            known = f"it has {', '.join(further)}" if further else "it has no parameters"
            raise ValueError(f"{name}: unknown parameter; {known}")
    for name, parameter in further.items():
        variable = parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL)
        if parameter.default is parameter.empty and name not in values and not variable:
            raise ValueError(f"{name}: is missing")
        value, untyped = values.get(name), parameter.annotation is parameter.empty
        if untyped and type(parameter.default) in (int, float) and isinstance(value, str):
            right = f"must be a number, such as {parameter.default}"
            raise ValueError(f"{name}: {value[:60]!r} is text: {right}")
    return dict(values)


def all_values(
    function: Callable[..., Any], given: int, values: Mapping[str, Any]
) -> dict[str, Any]:
    """`values` with the defaults of the other parameters, except those that are not plain.

    pydantic.ValidationError, ValueError as `further_arguments` does.
    """
    from pydantic import ValidationError

    arguments = further_arguments(function, given, values)
    schema = parameters_type(function, given)
    if schema is None:
        further = list(inspect.signature(function).parameters.items())[given:]
        defaults = {n: p.default for n, p in further if p.default is not p.empty}
        arguments = defaults | arguments
    else:
        (made,) = arguments.values()
        fields = [field.name for field in dataclasses.fields(schema) if field.init]
        arguments = {name: getattr(made, name) for name in fields}
        # A list in a file becomes a tuple again.
        arguments = {n: list(v) if isinstance(v, tuple) else v for n, v in arguments.items()}
    plain = {name: value for name, value in arguments.items() if _is_plain(value)} | dict(values)
    try:
        further_arguments(function, given, plain)
    except ValidationError:
        return dict(values)  # A default need not be of its annotated type.
    return plain


def _is_plain(value: Any) -> bool:
    """Whether a YAML file can have the value as it is."""
    import json

    try:
        return json.loads(json.dumps(value, allow_nan=False)) == value
    except (TypeError, ValueError):
        return False


def _validated(schema: type, values: Mapping[str, Any]) -> Any:
    import json

    from pydantic import TypeAdapter

    if not hasattr(schema, "__pydantic_config__"):
        schema.__pydantic_config__ = dict(STRICT)
    return TypeAdapter(schema).validate_json(json.dumps(dict(values)))
