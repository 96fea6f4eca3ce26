"""The gallery of RQ1: what the stages give for each road user, near and far."""

import io

from PIL import Image

from stixel_cli.report.style import DEPTH_TICKS
from stixel_cli.studies.rq1.pool import by_label, road_user, text
from stixel_cli.studies.types import Paragraph, Picture, Section, StudySweep

PANELS = ("left", "disparity", "occupancy", "free_space", "height", "stixels")
WIDTH = 1080
QUALITY = 72


def gallery_section(sweep: StudySweep) -> Section:
    """A picture for each road user and pictured frame, the stages side by side."""
    blocks: list[Paragraph | Picture] = [
        Paragraph(
            "Left camera without noise, disparity, occupancy grid from above, free space, free "
            "space with height, and stixels. Colours of disparity and stixels mean depth, from "
            f"yellow at {DEPTH_TICKS[0]:g} m to violet at {DEPTH_TICKS[-1]:g} m; the grid is dark "
            "where an obstacle is likely; green is free, red is an obstacle."
        )
    ]
    for label, points in by_label(sweep.runs, road_user).items():
        point = points[0]
        frames = sorted(
            (frame, files)
            for pictures in point.load("camera_pictures")
            for frame, files in by_frame(pictures.files).items()
        )
        path = point.configuration.path
        for frame, files in frames:
            time = frame * path.sample_time
            blocks.append(
                Picture(
                    f"gallery_{label}_{frame:04d}",
                    f"{label.capitalize()} at t = {text(time, 2, 's')}, seed {point.seed}.",
                    contact_sheet([files[name] for name in PANELS]),
                    "image/webp",
                )
            )
    return Section("Gallery of the stages", tuple(blocks))


def by_frame(files: dict[str, bytes]) -> dict[int, dict[str, bytes]]:
    """Pictures `k0033/left.png` by frame and name."""
    found: dict[int, dict[str, bytes]] = {}
    for path, data in files.items():
        folder, _, name = path.partition("/")
        found.setdefault(int(folder[1:]), {})[name.removesuffix(".png")] = data
    return found


def contact_sheet(pictures: list[bytes]) -> bytes:
    """Pictures in two columns on white, `WIDTH` px wide, as WebP; all at one scale."""
    images = [Image.open(io.BytesIO(data)).convert("RGB") for data in pictures]
    scale = 0.5 * WIDTH / max(image.width for image in images)
    images = [
        image.resize((round(scale * image.width), round(scale * image.height)), Image.LANCZOS)
        for image in images
    ]
    pairs = [images[i : i + 2] for i in range(0, len(images), 2)]
    heights = [max(image.height for image in pair) for pair in pairs]
    sheet = Image.new("RGB", (WIDTH, sum(heights)), "white")
    top = 0
    for pair, height in zip(pairs, heights, strict=True):
        for i, image in enumerate(pair):
            sheet.paste(image, (i * WIDTH // 2, top))
        top += height
    buffer = io.BytesIO()
    sheet.save(buffer, "WEBP", quality=QUALITY, method=4)
    return buffer.getvalue()
