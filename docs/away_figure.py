"""Write `docs/figures/away.webp`: points coloured by height, the truth, and `contour`.

STIXEL_DATA=DIR python docs/away_figure.py

DIR has the folder `pandaset`, see real-data.md. The scans are of PandaSet (Hesai and Scale AI,
pandaset.org, CC BY 4.0), but those of the last panel, which are rendered.
"""

from io import BytesIO
from pathlib import Path

from home_away import ROAD_Z
from PIL import Image

from stixel_cli import run
from stixel_cli.geometry.pose import target_from_world
from stixel_cli.pictures import style
from stixel_cli.studies.report import data_folder

FILE = Path(__file__).parent / "figures" / "away.webp"
HIDDEN = "hidden"
PANELS = (
    ("car-8febbea0", 25, "saloon, 45 m: rear window, no bumper"),
    ("car-d0070c93", 25, "car, 20 m: bumper and one side"),
    ("cyclist-410fda6c", 40, "motorcycle, 43 m: the rider's back"),
    (HIDDEN, 30, "rendered, behind a parked car: a cabin"),
)
"""Recording, scan, and what is to be seen."""


def main() -> None:
    """Draw each panel in the frame of the truth: heading to the right."""
    with style.drawing():
        figure = style.new_figure(15.0, 3.2, layout="constrained")
        panels = figure.subplots(1, len(PANELS))
        for axes, (name, k, title) in zip(panels, PANELS, strict=True):
            for known, line in ((False, "--"), (True, "-")):
                result = hidden(known) if name == HIDDEN else recorded(name, known)
                pose = result.scenario.target_poses_world[k]
                contour = target_from_world(result.track.contours_world[k], pose)
                label = f"estimate, heights {'known' if known else 'not known'}"
                ring = [*range(len(contour)), 0]
                axes.plot(*contour[ring].T, line, color=style.ESTIMATE, label=label)
            box = result.scenario.contours_target[0]
            axes.plot(*box[[*range(len(box)), 0]].T, color=style.TRUTH, label="truth")
            rows = result.scans.rows(k)
            points = target_from_world(result.scans.points_world[rows], pose)
            found = axes.scatter(*points.T, 12, result.scans.heights[rows], vmin=0.0, vmax=2.0)
            axes.set(xlim=(-3.5, 3.5), ylim=(-2.4, 1.6), aspect="equal")
            axes.set_title(title, fontsize=10)
            axes.set_xlabel("along the heading, m")
        panels[0].legend(fontsize=8, loc="lower left", ncols=2)
        figure.colorbar(found, ax=panels, label="height above the road, m")
        stream = BytesIO()
        figure.savefig(stream, format="png", dpi=110)
    Image.open(stream).convert("RGB").save(FILE, quality=80)


def recorded(name: str, heights: bool):
    """The run of `contour` on a recording, with seed 0."""
    folder = data_folder("pandaset", "pandaset") / name
    tables = {"path": "scans", "ego": "ego", "truth": "truth"}
    return run(
        "experiment=pandaset",
        f"road_user={name.partition('-')[0]}",
        *(f"measurement.{key}={folder / file}.csv" for key, file in tables.items()),
        f"measurement.road_z={ROAD_Z if heights else 'null'}",
        "tracker=contour",
    )


def hidden(heights: bool):
    """The run of `contour` on a car behind a parked one, with seed 0."""
    return run(
        *("measurement=lidar_64", "tracker=contour", "world.occluder=parked_car"),
        *(f"{key}=0" for key in ("seed", "road_user.shape_seed", "world.seed")),
        f"measurement.returns={'all' if heights else 'nearest'}",
    )


if __name__ == "__main__":
    main()
