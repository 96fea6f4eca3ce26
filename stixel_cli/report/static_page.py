"""Fill a page that needs no template engine: commands that must start fast write such pages."""

import html
import json
from collections.abc import Sequence
from importlib import resources
from typing import Any


def filled_page(package: str, name: str, title: str, data: Any, **files: Sequence[str]) -> str:
    """The file `templates/NAME` of a package, with a text in place of each mark such as ⟦title⟧.

    `data` becomes JSON; `files` are other marks with the files in the same folder that they mean.
    """

    def text(name: str) -> str:
        return (resources.files(package) / "templates" / name).read_text("utf-8")

    parts = {mark: "\n".join(map(text, names)) for mark, names in files.items()}
    parts |= {"title": html.escape(title), "data": json_in_html(data)}
    # Split the template once, so that inserted text is never searched for marks.
    page, *pieces = text(name).split("⟦")
    for piece in pieces:
        mark, _, rest = piece.partition("⟧")
        page += parts[mark] + rest
    return page


def json_in_html(value: Any) -> str:
    """JSON for a script element: in ASCII, without `<`, `>` and `&`; NaN is refused."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text
