"""Write the gallery: `docs/gallery.md` and its pictures, each from a run of `stixel`.

    python docs/gallery.py [NAME …]

Without names it overwrites all pictures; with names (`tracker_point`) only these. It does not
recompute results that are in the cache.
"""

import io
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path

from stixel_cli.config.folders import group_options

DOCS = Path(__file__).parent
FOLDER = "figures/gallery"
QUALITY = 72

NEAR = {"car": "[-0.4,13]", "cyclist": "[-0.2,7.5]", "pedestrian": "[0,6.5]"}
"""Start of each road user for its picture, m; a new one starts where the car does."""

CARGO_BIKE = (
    "cargo_bike",
    "cyclist",
    ["road_user.mesh=pipelines/studies/shapes/cyclist/cargo_bike.obj"],
)
"""The mesh of the second tutorial: name of the picture, road user, overrides."""

STAGES = {
    "left": "Left image.",
    "disparity": "Disparity.",
    "occupancy": "Occupancy grid.",
    "free_space": "Free space.",
    "height": "Height segmentation.",
    "stixels": "Stixels.",
}
STREET = ["path=crossing", "path.duration=1.6", "pictures.frames=[15]"]
FABRICATED = ["measurement=fabricated", "pictures.frames=[]"]


@dataclass(frozen=True)
class Entry:
    """One picture.

    Attributes:
        name: the file's name without extension.
        caption: text next to the picture.
        overrides: of the run.
        source: path of the picture in the run's `figures/`.
    """

    name: str
    caption: str
    overrides: list[str]
    source: str


def sections() -> dict[str, list[Entry]]:
    """The pictures of each section, by heading."""
    options = group_options()
    users = options["road_user"]
    return {
        "The stages of one frame": [
            Entry(f"stage_{stage}", caption, STREET, f"k0015/{stage}.png")
            for stage, caption in STAGES.items()
        ],
        "Road users": [
            Entry(f"road_user_{name}", f"`road_user={user}`",
                  [f"road_user={user}", *mesh, "path=crossing",
                   f"path.start={NEAR.get(user, NEAR['car'])}",
                   "path.heading=-35", "path.duration=0.2", "rig.horizontal_fov=32",
                   "pictures.frames=[0]"],
                  "k0000/left.png")
            for name, user, mesh in [*((user, user, []) for user in users), CARGO_BIKE]
        ],
        "Paths": [
            Entry(f"path_{path}", f"`path={path}`", [f"path={path}", *FABRICATED], "path.png")
            for path in options["path"]
            if path != "recorded"  # needs files of the user's
        ],
        "Ego motions": [
            Entry(f"ego_{ego}", f"`ego={ego}`", [f"ego={ego}", "path=turn", *FABRICATED],
                  "path.png")
            for ego in options["ego"]
        ],
        "Rigs": [
            Entry(f"rig_{rig}", f"`rig={rig}`",
                  [f"rig={rig}", "path=crossing", "path.start=[-3,16]", "path.duration=0.2",
                   "pictures.frames=[0]"],
                  "k0000/left.png")
            # Rigs with a date are those of recordings, and look like `kitti`.
            for rig in options["rig"] if not rig[-1].isdigit()
        ],
        "Renderers": [
            Entry(f"renderer_{renderer}", f"`renderer={renderer}`",
                  [f"renderer={renderer}", "path=crossing", "path.start=[-3,11]",
                   "path.duration=0.2", "pictures.frames=[0]"],
                  "k0000/left.png")
            for renderer in options["renderer"]
        ],
        "Matchers": [
            Entry(f"stereo_{stereo}", f"`stereo={stereo}`", [f"stereo={stereo}", *STREET],
                  "k0015/disparity.png")
            for stereo in options["stereo"]
        ],
        "Occupancy grids": [
            Entry(f"occupancy_{grid}", f"`occupancy={grid}`", [f"occupancy={grid}", *STREET],
                  "k0015/occupancy.png")
            for grid in options["occupancy"]
        ],
        "Measurements": [
            Entry(f"measurement_{measurement}", f"`measurement={measurement}`",
                  [f"measurement={measurement}", *STREET], "k0015/birds_eye.png")
            for measurement in options["measurement"]
            if measurement != "file"  # needs a file of the user's
        ],
        "Trackers": [
            Entry(f"tracker_{tracker}", f"`tracker={tracker}`",
                  [f"tracker={tracker}", "road_user=cyclist", "measurement=fabricated", *STREET],
                  "k0015/birds_eye.png")
            for tracker in options["tracker"]
            if tracker not in {"pyrecest", "file"}  # an extra, and one of files
        ],
        "A whole run": [
            Entry("errors", "Errors over time, with their χ² bounds.", FABRICATED, "errors.png"),
        ],
    }  # fmt: skip


def page() -> str:
    """Text of `docs/gallery.md`."""
    lines = [
        "# Gallery",
        "",
        "Pictures from the `figures/` of runs, below the command, to which a caption adds.",
        "`python docs/gallery.py` writes them and this page.",
    ]
    for heading, entries in sections().items():
        shared = shared_overrides(entries)
        command = shlex.join(["stixel", "run", *shared])
        sources = {entry.source for entry in entries}
        if len(sources) == 1:
            command += f"  # figures/{entries[0].source}"
        lines += ["", f"## {heading}", "", "```sh", command, "```"]
        for entry in entries:
            added = shlex.join(one for one in entry.overrides if one not in shared)
            caption = f"`{added}`" if added else entry.caption
            lines += ["", caption, "", f"![{entry.name}]({FOLDER}/{entry.name}.webp)"]
    return "\n".join(lines) + "\n"


def shared_overrides(entries: list[Entry]) -> list[str]:
    """Overrides that all entries of a section have."""
    return [one for one in entries[0].overrides if all(one in e.overrides for e in entries)]


def small_file(png: bytes) -> bytes:
    """WebP of a PNG, of the same size: scaled down, letters would be smaller than 10 px."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.open(io.BytesIO(png)).convert("RGB").save(
        buffer, format="webp", quality=QUALITY, method=6
    )
    return buffer.getvalue()


def main(names: list[str]) -> None:
    """Run the entries with these names, or all; write their pictures, and the page.

    Raises:
        SystemExit: if no entry has one of the names.
    """
    from stixel_cli import run

    folder = DOCS / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    entries = {entry.name: entry for group in sections().values() for entry in group}
    unknown = [name for name in names if name not in entries]
    if unknown:
        raise SystemExit(f"{unknown[0]}: unknown picture; must be one of {', '.join(entries)}")
    for entry in map(entries.get, names or entries):
        pictures = run(entry.overrides).pictures
        data = small_file(pictures[entry.source])
        (folder / f"{entry.name}.webp").write_bytes(data)
        print(f"{entry.name}: {len(data) / 1000:.0f} kB", flush=True)  # noqa: T201
    for file in folder.iterdir():
        if file.stem not in entries:
            file.unlink()
    (DOCS / "gallery.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
