"""The table of all stages.

A definition names the function, the settings that each of its arguments takes, and how the stage
runs over the frames. Each node of `pipelines/*.yaml` names its stage and its inputs.
"""

from stixel_cli.engine.graph import Graph
from stixel_cli.engine.keys import Stage
from stixel_cli.experiment.table import images, tracks
from stixel_cli.experiment.table.definition import Definition
from stixel_cli.experiment.table.images import REPLAYED
from stixel_cli.experiment.table.tracks import OWN

TABLE = images.STAGES | tracks.STAGES


def readers(name: str) -> list[str]:
    """The stages that read a group or a key, given by its name with dots."""

    def reads(stage: Definition) -> bool:
        paths = [*stage.reads.values(), *stage.files, *stage.code]
        paths += ["seed"] * stage.seeded + ["pictures.frames"] * (stage.pattern == "pick")
        return any(
            f"{path}.".startswith(f"{name}.") or name.startswith(f"{path}.") for path in paths
        )

    found = [
        stage for table in (TABLE, OWN, REPLAYED) for stage, its in table.items() if reads(its)
    ]
    return list(dict.fromkeys(found))


_DRAWING = {f for stage in TABLE.values() if stage.pictures for f in stage.functions.values()}


def draws(stage: Stage) -> bool:
    """Whether the result of a stage is a `Pictures`."""
    return stage.function in _DRAWING


def picture_stages(graph: Graph) -> list[str]:
    """Names of the stages of a graph that draw."""
    return [
        name for name in graph.stages if any(draws(node.stage) for node in graph.of_stage(name))
    ]
