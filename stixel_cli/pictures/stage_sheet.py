"""Pictures of all stages of a frame on one sheet, for the galleries of reports."""

import io
from pathlib import Path

import matplotlib
from PIL import Image, ImageDraw, ImageFont

from stixel_cli.geometry.rig import Rig
from stixel_cli.pictures.camera import LEFT, TOP
from stixel_cli.pictures.camera import PANELS as CAMERA_PANELS

PANELS = {panel.name: panel.title for panel in CAMERA_PANELS}
"""Pictures of a frame: name to title."""
WIDTH = 1080
"""px: of a sheet."""
TITLE = 18
"""px: size of its letters; they are 10 px where the page shows it with its least width."""
GAP = 6
"""px: between pictures."""
QUALITY = 72


def by_frame(files: dict[str, bytes]) -> dict[int, dict[str, bytes]]:
    """Pictures `k0033/left.png` by frame and name."""
    found: dict[int, dict[str, bytes]] = {}
    for path, data in files.items():
        folder, _, name = path.partition("/")
        found.setdefault(int(folder[1:]), {})[name.removesuffix(".png")] = data
    return found


def contact_sheet(pictures: dict[str, bytes], rig: Rig) -> bytes:
    """The `PANELS` of a frame in two columns on white, `WIDTH` px wide, as WebP; at one scale.

    Of each picture, the image itself is shown, with its title in letters for this size.

    Args:
        pictures: name to PNG, as the stage `camera_pictures` draws them.
        rig: whose images they show.
    """
    width = WIDTH // 2 - GAP
    height = round(width * rig.height / rig.width)
    step = TITLE + 2 * GAP + height
    sheet = Image.new("RGB", (WIDTH, step * -(-len(PANELS) // 2)), "white")
    draw = ImageDraw.Draw(sheet)
    fonts = Path(matplotlib.get_data_path()) / "fonts/ttf/DejaVuSans.ttf"
    font = ImageFont.truetype(fonts, TITLE)
    for i, (name, title) in enumerate(PANELS.items()):
        image = Image.open(io.BytesIO(pictures[name])).convert("RGB")
        area = (LEFT, TOP, LEFT + rig.width, TOP + rig.height)
        place = (i % 2 * (width + 2 * GAP), i // 2 * step)
        draw.text(place, title, font=font, fill="black")
        image = image.crop(area).resize((width, height), Image.LANCZOS)
        sheet.paste(image, (place[0], place[1] + TITLE + GAP))
    buffer = io.BytesIO()
    sheet.save(buffer, "WEBP", quality=QUALITY, method=4)
    return buffer.getvalue()
