"""The templates of HTML pages."""

from importlib import resources

import jinja2


def page_template(package: str, name: str) -> jinja2.Template:
    """`templates/NAME.html.j2` of a package; a name without a value is an error."""
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    text = resources.files(package).joinpath(f"templates/{name}.html.j2").read_text("utf-8")
    return environment.from_string(text)
