"""The templates of HTML pages."""

from collections.abc import Callable, Mapping
from importlib import resources
from typing import Any

import jinja2


def page_template(
    package: str, name: str, filters: Mapping[str, Callable[..., Any]] | None = None
) -> jinja2.Template:
    """`templates/NAME.html.j2` of a package; a name without a value is an error."""
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters |= filters or {}
    text = resources.files(package).joinpath(f"templates/{name}.html.j2").read_text("utf-8")
    return environment.from_string(text)
