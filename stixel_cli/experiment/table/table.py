"""The table of all stages.

A definition names the function, the settings that each of its arguments takes, and how the stage
runs over the frames. Each node of `pipelines/*.yaml` names its stage and its inputs.
"""

from stixel_cli.experiment.table import images, tracks
from stixel_cli.experiment.table.definition import Definition
from stixel_cli.experiment.table.images import REPLAYED
from stixel_cli.experiment.table.tracks import OWN

TABLE = images.STAGES | tracks.STAGES

PICTURES = tuple(name for name, stage in TABLE.items() if stage.pictures)
"""The stages that draw; their nodes have the same names."""


def readers(name: str) -> list[str]:
    """The stages that read a group or a key, given by its name with dots."""

    def reads(stage: Definition) -> bool:
        paths = [*stage.reads.values(), *stage.files, *stage.code]
        paths += ["seed"] * stage.seeded + ["pictures.frames"] * (stage.pattern == "pick")
        return any(
            f"{path}.".startswith(f"{name}.") or name.startswith(f"{path}.") for path in paths
        )

    rows = [row for table in (TABLE, OWN, REPLAYED) for row in table.items()]
    return list(dict.fromkeys(name for name, stage in rows if reads(stage)))
