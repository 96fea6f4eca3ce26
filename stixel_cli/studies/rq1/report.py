"""RQ1: are these stixels like those of *The Stixel World*?

Each stage is compared with its ideal result, from the records of `validation.stage_errors`.
"""

import io
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib
from PIL import Image, ImageDraw, ImageFont

from stixel_cli.geometry.rig import Rig
from stixel_cli.report.camera import LEFT, TOP
from stixel_cli.report.camera import PANELS as CAMERA_PANELS
from stixel_cli.report.style import DEPTH_TICKS
from stixel_cli.studies.data import StudyData, StudySweep
from stixel_cli.studies.inference import DRAWS
from stixel_cli.studies.rq1 import figures, tables
from stixel_cli.studies.rq1.answer import answer_table, answer_values
from stixel_cli.studies.rq1.pool import (
    EDGES,
    INSIDE,
    LEAST,
    OTHERS,
    ROUND,
    SW_DEPTH,
    SW_STD,
    Group,
    by_label,
    contrast,
    counts,
    grid,
    groups,
    matcher,
    pool,
    rig,
    road_user,
    seeds,
)
from stixel_cli.studies.rq1.setup import setup_values
from stixel_cli.studies.rq1.widths import width_table, width_values
from stixel_cli.studies.types import Material, Picture
from stixel_cli.validation.stage_errors import BORDER, GROSS
from stixel_cli.validation.stage_stixels import SQUARE

PANELS = {panel.name: panel.title for panel in CAMERA_PANELS}
"""Pictures of a frame: name to title."""
WIDTH = 1080
"""px: of a picture of the gallery."""
TITLE = 18
"""px: size of its letters; they are 10 px where the page shows it with its least width."""
GAP = 6
"""px: between pictures."""
QUALITY = 72


def report(data: StudyData) -> Material:
    """Values, tables and figures of the template."""
    sweeps = data.sweeps
    users = groups(sweeps["ranges"], road_user)
    every = pool("all", [run for group in users for run in group.runs])
    by_contrast = contrast_lines(sweeps["contrast"])
    by_rig = {
        label: [pool(user, own) for user, own in by_label(runs, road_user).items()]
        + [pool("all", runs)]
        for label, runs in by_label(sweeps["rigs"].runs, rig).items()
    }
    lines = {
        "users": users,
        "rigs": groups(sweeps["rigs"], rig),
        "matchers": groups(sweeps["matchers"], matcher),
        "grids": groups(sweeps["grids"], grid),
    }
    contrasts = sorted(groups(sweeps["contrast"], lambda run: f"{contrast(run):g}"), key=_number)
    by_width = width_values(sweeps["widths"])
    ends = contrasts[:: len(contrasts) - 1] if len(contrasts) > 1 else []
    first = users[0].runs[0].configuration
    return Material(
        {
            **answer_values(every, users, lines | {"contrasts": ends}),
            **setup_values(data),
            "summary": answer_table(every),
            "edges": EDGES,
            "round": ROUND,
            "depth": SW_DEPTH,
            "std": SW_STD,
            "depth_ticks": DEPTH_TICKS,
            "road": first.road,
            "free_space": first.free_space,
            "farthest": first.occupancy.farthest,
            "sample_time": first.path.sample_time,
            "poses_in_a_range": _poses_in_a_range(users),
            "draws": DRAWS,
            "least": LEAST,
            "gross": GROSS,
            "border": BORDER,
            "square": SQUARE,
            "counts": {name: counts(own) for name, own in lines.items()}
            | {"contrast": counts(group for own in by_contrast.values() for _, group in own)},
            "seeds_per_pose": {name: seeds(own) for name, own in lines.items()},
            "stixels_of": [(g.label, int(figures.stixels(g)[:, 0].sum())) for g in users],
            "figures": {
                "disparity": figures.disparity("disparity", users, border=True),
                "matchers": figures.disparity("matchers", lines["matchers"], border=False),
                "locking": figures.locking(
                    lines["matchers"],
                    {"inside the target": INSIDE, "inside other obstacles": OTHERS},
                ),
                "free_space": figures.columns(
                    "free_space", users, {"path": "path", "grid": "grid"}
                ),
                "grids": figures.columns("grids", lines["grids"], {"": "path"}),
                **figures.of_stixels(users),
                "normalised": figures.normalised(users),
                "rigs": figures.rigs(lines["rigs"]),
                "contrast": figures.contrast(by_contrast),
            },
            "tables": {
                "disparity": tables.disparity_table(users),
                "matchers": tables.matcher_table(lines["matchers"]),
                "grids": tables.grid_table(lines["grids"]),
                "height": tables.height_table(users),
                "stixels": tables.stixel_table(users),
                "rigs": tables.rig_table(lines["rigs"]),
                "depths": tables.depth_table(by_rig),
                "contrast": tables.contrast_table(by_contrast),
            },
            "widths": by_width,
            "width_table": width_table(by_width),
            "gallery": gallery(sweeps["gallery"]),
        }
    )


def contrast_lines(sweep: StudySweep) -> dict[str, list[tuple[float, Group]]]:
    """Road user to its contrasts in ascending order, each with its runs."""
    return {
        label: sorted(
            ((at, pool(label, same)) for at, same in by_label(runs, contrast).items()),
            key=lambda pair: pair[0],
        )
        for label, runs in by_label(sweep.runs, road_user).items()
    }


def _number(group: Group) -> float:
    return float(group.label)


def _poses_in_a_range(users: Sequence[Group]) -> int:
    """The largest number of poses of a road user in any of the figures' ranges."""
    return max(
        len(set(group.poses[group.frames(low, high)].tolist()))
        for group in users
        for low, high in pairwise(EDGES)
    )


def gallery(sweep: StudySweep) -> list[dict[str, Any]]:
    """A picture of the stages for each road user and pictured frame, with its caption's values."""
    found = []
    for label, runs in by_label(sweep.runs, road_user).items():
        run = runs[0]
        frames = sorted(
            (frame, files)
            for pictures in run.load("camera_pictures")
            for frame, files in by_frame(pictures.files).items()
        )
        for frame, files in frames:
            sheet = contact_sheet(files, run.configuration.rig)
            found.append(
                {
                    "picture": Picture(f"gallery_{label}_{frame:04d}", "", sheet, "image/webp"),
                    "user": label,
                    "time": frame * run.configuration.path.sample_time,
                    "seed": run.seed,
                }
            )
    return found


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
