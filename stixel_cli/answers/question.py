"""A question about many runs: what is compared, within what, over what, by which metric."""

from dataclasses import dataclass, replace

from stixel_cli.evaluation.metric_table import Metric, metric, over_runs

STATUS, LOST, FOLDER, ERROR = "status", "track_lost", "folder", "error"
"""Columns of a frame of runs that are neither settings nor asked about."""


@dataclass(frozen=True)
class Question:
    """What is asked of many runs.

    Attributes:
        compare: columns whose combinations of values are the options.
        within: columns whose combinations are scenarios, of equal weight.
        over: columns whose combinations are the units of statistics.
        metric: the column of the values.
        better: "more" or "less"; "one" for a ratio that should be 1; None as the table of metrics.
        reference: the option that others are compared with; None for the best one.
    """

    compare: tuple[str, ...]
    within: tuple[str, ...]
    over: tuple[str, ...]
    metric: str
    better: str | None = None
    reference: object = None

    @property
    def named(self) -> str:
        """The compared columns in one text; "option" where all runs are one."""
        return " ".join(self.compare) or "option"

    @property
    def row(self) -> Metric:
        """Label, unit, bounds and better direction of the metric's mean over runs."""
        row = metric(over_runs(self.metric))
        return row if self.better is None else replace(row, better=self.better)

    @property
    def heading(self) -> str:
        """Label of the metric, with its unit."""
        return self.row.heading
