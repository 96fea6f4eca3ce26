"""What the playback page states of a run in words: its choices, its metrics, its origin."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stixel_cli.evaluation.metric_table import metric
from stixel_cli.report.metrics import shown_value
from stixel_cli.results.result import RunResult

SUMMARY = (
    "centre_rmse_m",
    "orientation_rmse_deg",
    "iou_mean",
    "iou_hull_mean",
    "iou_box_mean",
    "low_overlap_share",
    "nees_position_mean",
    "nis_mean",
)
"""The metrics that the page shows of a whole run."""

FACTS = ("road_user", "path", "ego", "measurement", "tracker")
"""The groups whose choices the page names."""


def facts_of(run: RunResult) -> list[tuple[str, str]]:
    """(name, value) pairs that describe the run."""
    measurement = run.settings["measurement"]
    if measurement.get("kind") == "file":
        facts = [(group, run.choice(group)) for group in ("prior", "start", "tracker")]
        return [
            ("scans", Path(measurement["path"]).name),
            *facts,
            ("seed", str(run.settings["seed"])),
        ]
    facts = [(group, run.choice(group)) for group in FACTS]
    mesh = run.settings["road_user"].get("mesh")
    if mesh is not None:
        facts.append(("mesh", Path(mesh).name))
    return [*facts, ("seed", str(run.settings["seed"]))]


def origin_of(manifest: Mapping[str, Any], folder: Path | None) -> dict[str, Any] | None:
    """What a page mailed to a colleague states of a run; None if it has no command.

    A run without a folder is about to be written into that of its page, so links begin there.
    """
    if "command" not in manifest:
        return None
    git, versions = manifest.get("git") or {}, manifest.get("versions") or {}
    revision = str(git.get("revision") or "unknown")[:12]
    made = [
        f"stixel {versions.get('stixel', 'unknown')}",
        f"revision {revision}{' with uncommitted changes' if git.get('dirty') else ''}",
        str(manifest.get("created", "")),
    ]
    names = {"figures": "figures/", "metrics": "metrics.json", "configuration": "config.yaml"}
    links = [] if folder is not None else [list(link) for link in names.items()]
    return {
        "command": str(manifest["command"]),
        "made": [one for one in made if one],
        "links": links,
    }


def summary_of(metrics: dict[str, float | int | None]) -> list[list[str]]:
    """[name, value with its unit] of the `SUMMARY`'s metrics that have a value."""
    return [
        [
            metric(name).short_label,
            f"{shown_value(name, metrics[name])} {metric(name).shown_unit}".strip().replace(
                " °", "°"
            ),
        ]
        for name in SUMMARY
        if metrics.get(name) is not None
    ]
