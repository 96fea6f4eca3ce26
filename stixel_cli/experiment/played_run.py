"""A run as the page that plays it back is given it."""

import math
from pathlib import Path

from stixel_cli.config.compose import Composition
from stixel_cli.config.schema import Configuration
from stixel_cli.experiment.run import Outcome
from stixel_cli.report.playback import PlayedRun, playback_html

_SHOWN = ("road_user", "path", "ego", "measurement", "tracker")


def run_page(name: str, composition: Composition, outcome: Outcome) -> str:
    """The page of one run whose folder is called `name`."""
    return playback_html([played_run(name, composition, outcome)], name)


def played_run(
    label: str, composition: Composition, outcome: Outcome, folder: str | None = None
) -> PlayedRun:
    """A run called `label` with what the page says of it; `folder` is named where it is given."""
    facts = [("folder", folder)] if folder is not None else []
    facts += [(group, choice(composition, group)) for group in _SHOWN]
    mesh = composition.configuration.road_user.mesh
    if mesh is not None:
        facts.append(("mesh", Path(mesh).name))
    facts.append(("seed", str(composition.configuration.seed)))
    return PlayedRun(
        label=label,
        facts=tuple(facts),
        field_of_view=_field_of_view(composition.configuration),
        scenario=outcome.scenario,
        scans=outcome.scans,
        track=outcome.track,
        scores=outcome.scores,
        camera=outcome.camera,
    )


def choice(composition: Composition, group: str) -> str:
    """The option of a group that was chosen; where it is not known, the kind that it is of."""
    value = composition.resolved[group]
    kind = value.get("kind", "own") if isinstance(value, dict) else str(value)
    return composition.choices.get(group, str(kind))


def _field_of_view(configuration: Configuration) -> tuple[float, float]:
    """The sensor's right and left border, rad: a lidar may have a field of its own."""
    measurement = configuration.measurement
    own = measurement.scanner.horizontal_fov if measurement.kind == "lidar" else None
    if own is None:
        return configuration.rig.field_of_view
    return -math.radians(0.5 * own), math.radians(0.5 * own)
