"""Fill a page that needs no template engine: commands that must start fast write such pages."""

import html
import json
from collections.abc import Mapping
from importlib import resources
from typing import Any


def filled_page(package: str, name: str, title: str, data: Any, parts: Mapping[str, str]) -> str:
    """The file `templates/NAME` of a package, with a text in place of each mark such as ⟦title⟧.

    `data` becomes JSON; `parts` has the texts of other marks, which are inserted as they are.
    """
    parts = {"title": html.escape(title), "data": json_in_html(data), **parts}
    # Split the template once, so that inserted text is never searched for marks.
    first, *pieces = template_text(package, name).split("⟦")
    page = [first]
    for piece in pieces:
        mark, _, rest = piece.partition("⟧")
        page += [parts[mark], rest]
    return "".join(page)


def template_text(package: str, name: str) -> str:
    """The text of the file `templates/NAME` of a package."""
    return (resources.files(package) / "templates" / name).read_text("utf-8")


def json_in_html(value: Any) -> str:
    """JSON for a script element: in ASCII, without `<`, `>` and `&`; NaN is refused."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text
