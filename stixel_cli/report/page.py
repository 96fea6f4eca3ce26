"""Templates of HTML pages, and drawings in the page's colours, with legible text."""

import base64
import math
import re
from typing import Any

import jinja2
from markupsafe import Markup

from stixel_cli.pictures import style

_COLOURS = {
    "#000000": "currentColor",
    style.TRUTH: "currentColor",
    "#ffffff": "var(--paper)",
    "#e3e3e3": "var(--grid)",
    style.CONSISTENT: "var(--band)",
    **{colour: f"var(--run-{i})" for i, colour in enumerate(style.RUNS)},
}
_PIXELS_A_POINT = 1.25
"""Largest scale of a figure, px per point: its text is then nearly as large as that of tables."""
_LEAST_TEXT = 10
"""px: a drawing is never shown so small that its smallest text is below this."""


def drawing_for_page(drawing: bytes, name: str) -> dict[str, Any]:
    """An SVG file as a page shows it: its element `svg`; `name` makes its ids unique.

    `width` is the largest one, px, `least` that below which text would be too small.
    """
    svg, points = svg_for_page(drawing.decode(), name)
    least = math.ceil(_LEAST_TEXT * points / smallest_text(svg))
    width = max(least, round(points * _PIXELS_A_POINT))
    return {"svg": Markup(svg), "width": width, "least": least}


def picture_for_page(png: bytes) -> dict[str, Any]:
    """`source` of a PNG by `style.png`, and the `least` width at which its text is legible, px."""
    width, letters = int.from_bytes(png[16:20]), 8.0 * style.DPI / 72.0
    source = "data:image/png;base64," + base64.b64encode(png).decode()
    return {"source": source, "least": math.ceil(_LEAST_TEXT * min(width, 4096) / letters)}


def smallest_text(svg: str) -> float:
    """Size in points of the smallest text of a drawing by Matplotlib; 10 without text.

    Matplotlib writes letters as paths of size 100 and scales them.
    """
    scales = re.findall(r"scale\((\d*\.?\d+) -", svg)
    return min((100.0 * float(scale) for scale in scales), default=10.0)


def svg_for_page(text: str, name: str) -> tuple[str, float]:
    """An SVG file as an element of a page, and its width in points.

    Its ids become unique by `name`, black and the colours of runs become those of the
    page, and references to other documents are removed.
    """
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    # A style element would apply to the whole page.
    text = re.sub(r"<style[^>]*>.*?</style>", "", text, flags=re.S)
    text = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", text)
    width = re.search(r'<svg\b[^>]*?\swidth="([\d.]+)(?:pt)?"', text)
    text = re.sub(r'(<svg\b[^>]*?)\swidth="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(<svg\b[^>]*?)\sheight="[^"]*"', r"\1", text, count=1)
    text = text.replace("<svg", '<svg fill="currentColor"', 1).replace("xlink:href=", "href=")
    # Matplotlib's ids depend on the content, so figures of a page can share them.
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'(url\(|href=")#', rf"\1#{name}-", text)
    for colour, name in _COLOURS.items():
        text = text.replace(colour, name)
    text = re.sub(r">\s+<", "><", text)
    # A hundredth of a point is finer than any screen.
    text = re.sub(r'\sd="[^"]*"', lambda d: re.sub(r"(\.\d\d)\d+", r"\1", d[0]), text)
    return text, float(width[1]) if width else 504.0


def page_template(package: str, name: str) -> jinja2.Template:
    """`templates/NAME.j2` of a package; a name without a value is an error."""
    places = [jinja2.PackageLoader(one) for one in (package, __package__)]
    environment = jinja2.Environment(
        loader=jinja2.ChoiceLoader(places),
        autoescape=lambda name: name.endswith(".html.j2"),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template(f"{name}.j2")
