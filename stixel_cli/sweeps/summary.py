"""What a sweep says of its settings: statistics of those that are complete, the names of others."""

from collections.abc import Sequence
from dataclasses import dataclass

from stixel_cli.sweeps.folder import SweepFolder
from stixel_cli.sweeps.results import DONE, IncompleteSetting, PointResult
from stixel_cli.sweeps.statistics import Statistic, summarise

SUMMARIES = ("summary.csv", "summary.md", "summary.tex")


@dataclass(frozen=True)
class Summary:
    """The settings of a sweep.

    Attributes:
        complete: the points of settings all of whose points are done.
        statistics: over them.
        incomplete: the other settings.
    """

    complete: tuple[PointResult, ...]
    statistics: list[Statistic]
    incomplete: tuple[IncompleteSetting, ...]


def summary_of(points: Sequence[PointResult]) -> Summary:
    """The statistics of the settings whose points are all done; seeds that lack would bias them."""
    groups: dict[tuple, list[PointResult]] = {}
    for point in points:
        groups.setdefault(tuple(point.planned.point.setting.items()), []).append(point)
    complete, incomplete = [], []
    for setting, members in groups.items():
        done = sum(point.status == DONE for point in members)
        if done == len(members):
            complete += members
        else:
            incomplete.append(IncompleteSetting(dict(setting), len(members), done))
    statistics = summarise(
        [point.planned.point.setting for point in complete], [point.metrics for point in complete]
    )
    return Summary(tuple(complete), statistics, tuple(incomplete))


def write_tables(folder: SweepFolder, summary: Summary, title: str) -> None:
    """Write the tables, unless no setting is complete.

    Raises:
        UserError: if the folder cannot be written.
    """
    from stixel_cli.sweeps.tables import summary_csv, summary_latex, summary_markdown

    if not summary.statistics:
        return
    given = summary.statistics, summary.incomplete
    folder.write_table("summary.csv", summary_csv(*given))
    folder.write_table("summary.md", summary_markdown(*given, title))
    folder.write_table("summary.tex", summary_latex(*given, title))


def write_figures(folder: SweepFolder, summary: Summary, axes: Sequence[Sequence[str]]) -> None:
    """Write the figures, unless no setting is complete.

    Raises:
        UserError: if the folder cannot be written.
    """
    from stixel_cli.sweeps.figures import axis_figures

    if not summary.statistics:
        return
    figures = axis_figures(
        [point.planned.point.setting for point in summary.complete],
        [point.metrics for point in summary.complete],
        axes,
        len(summary.incomplete),
    )
    if figures:
        folder.write_figures(figures)
