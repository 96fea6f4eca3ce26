"""The templates of HTML pages; all begin with `templates/base.html.j2`."""

from collections.abc import Callable, Mapping
from typing import Any

import jinja2

from stixel_cli.pictures import style


def page_template(
    package: str, name: str, filters: Mapping[str, Callable[..., Any]] | None = None
) -> jinja2.Template:
    """`templates/NAME.html.j2` of a package; a name without a value is an error."""
    places = [jinja2.PackageLoader(one) for one in (package, __package__)]
    environment = jinja2.Environment(
        loader=jinja2.ChoiceLoader(places),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= filters or {}
    environment.globals["run_colours"] = style.RUNS
    return environment.get_template(f"{name}.html.j2")
