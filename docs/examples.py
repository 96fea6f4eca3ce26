"""Write the README's pictures of runs, `docs/figures/example_NAME.webp`, from its commands.

    python docs/examples.py

The images of one example take minutes, or seconds if they are in the cache.
"""

import io
import re
import shlex
from pathlib import Path

from PIL import Image

from stixel_cli import run, sweep

DOCS = Path(__file__).parent
PICTURES = {
    "default": "k0062/camera.png",
    "fabricated": "k0062/birds_eye.png",
    "cyclist": "k0024/stixels.png",
    "contour": "k0062/birds_eye.png",
    "sweep": "answer",
}
"""What is shown of the default experiment and of the README's runs and sweep, in its order: a
file of `figures/`, or the answer of a sweep."""


def examples() -> dict[str, list[str]]:
    """The overrides of each example."""
    text = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    lines = re.findall(r"^stixel (?:run|sweep) (.*?)(?:--name .*)?$", text, flags=re.MULTILINE)
    overrides = [shlex.split(line, comments=True) for line in lines]
    return dict(zip(PICTURES, [[], *overrides], strict=True))


def picture(overrides: list[str], shown: str) -> bytes:
    """The picture of one example as a PNG."""
    if shown != "answer":
        return run(overrides).pictures[shown]
    buffer = io.BytesIO()
    sweep(overrides).ask().figure().savefig(buffer, format="png")
    return buffer.getvalue()


def main() -> None:
    """Write all pictures."""
    for name, overrides in examples().items():
        image = Image.open(io.BytesIO(picture(overrides, PICTURES[name]))).convert("RGB")
        image.save(DOCS / "figures" / f"example_{name}.webp", quality=72, method=6)


if __name__ == "__main__":
    main()
