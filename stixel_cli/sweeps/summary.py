"""What a sweep says of its settings: statistics of those that are complete, the names of others."""

from collections.abc import Sequence
from dataclasses import dataclass

from stixel_cli.sweeps.folder import SweepFolder
from stixel_cli.sweeps.results import DONE, IncompleteSetting, RunOutcome
from stixel_cli.sweeps.statistics import Statistic, summarise

SUMMARIES = ("summary.csv", "summary.md", "summary.tex")


@dataclass(frozen=True)
class Summary:
    """The settings of a sweep.

    Attributes:
        complete: the runs of settings all of whose runs are done.
        statistics: over them.
        incomplete: the other settings.
    """

    complete: tuple[RunOutcome, ...]
    statistics: list[Statistic]
    incomplete: tuple[IncompleteSetting, ...]


def summary_of(runs: Sequence[RunOutcome]) -> Summary:
    """The statistics of the settings whose runs are all done; seeds that lack would bias them."""
    groups: dict[tuple, list[RunOutcome]] = {}
    for run in runs:
        groups.setdefault(tuple(run.planned.run.setting.items()), []).append(run)
    complete, incomplete = [], []
    for setting, members in groups.items():
        done = sum(run.status == DONE for run in members)
        if done == len(members):
            complete += members
        else:
            incomplete.append(IncompleteSetting(dict(setting), len(members), done))
    statistics = summarise(
        [run.planned.run.setting for run in complete], [run.metrics for run in complete]
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
        [run.planned.run.setting for run in summary.complete],
        [run.metrics for run in summary.complete],
        axes,
        len(summary.incomplete),
    )
    if figures:
        folder.write_figures(figures)
