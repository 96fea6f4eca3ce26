"""The table of what a change of the tracker `contour` gains or loses, of the same runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from stixel_cli.evaluation.metric_table import metric, over_runs
from stixel_cli.studies.data import chosen, names
from stixel_cli.studies.runs import metric_over_seeds, paired_difference
from stixel_cli.studies.tables import interval_columns, with_unit
from stixel_cli.studies.types import Table

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Effects:
    """The columns of a table of effects.

    Attributes:
        name: of the table.
        column: of the frame, whose values are the variants.
        heading: of that column.
        effect: "gain" or "loss": the reference minus the variant.
        measures: metrics with an effect.
        others: metrics without one.
    """

    name: str
    column: str
    heading: str
    effect: str
    measures: Sequence[str]
    others: Sequence[str]


def effects_table(effects: Effects, frame: "pd.DataFrame", references: Mapping[str, str]) -> Table:
    """One row for each road user and variant: metrics over seeds with their 95 % intervals.

    Args:
        effects: the columns.
        frame: the runs, see `data.run_frame`.
        references: road user to the variant with which the others are compared.
    """
    rows = []
    for user in names(frame, "road_user"):
        own = chosen(frame, road_user=user)
        sides = {
            variant: chosen(own, **{effects.column: variant})
            for variant in names(own, effects.column)
        }
        reference = references[user]
        for variant, runs in sides.items():
            compared = None if variant == reference else sides.get(reference)
            rows.append((user, variant, runs["seed"].nunique(), *_cells(effects, runs, compared)))
    columns: list = ["road user", effects.heading, "n"]
    for name in (*effects.measures, *effects.others):
        label = with_unit(metric(over_runs(name)))
        columns += interval_columns(label, label)
        if name in effects.measures:
            label = f"{effects.effect}, {label}"
            columns += interval_columns(label, label)
    return Table(effects.name, "", tuple(columns), tuple(rows))


def _cells(
    effects: Effects, runs: "pd.DataFrame", reference: "pd.DataFrame | None"
) -> list[float | None]:
    """The metrics of a variant, and its effects; without a reference these are empty."""
    cells: list[float | None] = []
    for name in (*effects.measures, *effects.others):
        found = [metric_over_seeds(runs, name)]
        if name in effects.measures:
            found.append(None if reference is None else paired_difference(reference, runs, name))
        for one in found:
            cells += [None] * 3 if one is None else [one.mean, one.low, one.high]
    return cells
