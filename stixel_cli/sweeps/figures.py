"""A figure for each axis of a sweep: how the metrics go with its values."""

import math
from collections.abc import Mapping, Sequence

from stixel_cli.report import style
from stixel_cli.report.metrics import metric
from stixel_cli.sweeps.design import SEED
from stixel_cli.sweeps.statistics import Statistic, statistic

SHOWN = ("centre_rmse_m", "orientation_rmse_deg", "iou_mean", "lost_share")
MOST_LINES = 8
"""Combinations of the other axes that get a line each; of more, their points are taken together."""

_LONGEST_LABEL = 28
_LEGEND_WIDTH = 150
"""Characters that fit beside each other."""


def axis_figures(
    settings: Sequence[Mapping[str, str]],
    metrics: Sequence[Mapping[str, float | int | None]],
    axes: Sequence[Sequence[str]],
) -> dict[str, bytes]:
    """PNGs by file name, one an axis but for the seed's.

    Args:
        settings: of each point, without the seed.
        metrics: of each point, name to value.
        axes: the keys of each axis.
    """
    figures = {}
    for keys in axes:
        keys = [key for key in keys if key != SEED]
        if keys:
            figures[f"{'+'.join(keys)}.png"] = _figure(keys, settings, metrics)
    return figures


def _figure(
    keys: Sequence[str],
    settings: Sequence[Mapping[str, str]],
    metrics: Sequence[Mapping[str, float | int | None]],
) -> bytes:
    known = {name for point in metrics for name in point}
    names = [name for name in SHOWN if name in known] or sorted(known)[:4]
    others = list(dict.fromkeys(_label(setting, keys, inside=False) for setting in settings))
    together = len(others) > MOST_LINES
    values = list(dict.fromkeys(tuple(setting[key] for key in keys) for setting in settings))
    numbers = _numbers(values)
    if numbers is not None:
        values = [value for _, value in sorted(zip(numbers, values, strict=True))]
        numbers = sorted(numbers)
    with style.drawing():
        figure = style.new_figure(9.0, 2.9 * math.ceil(len(names) / 2), layout="constrained")
        for number, name in enumerate(names):
            axes = figure.add_subplot(math.ceil(len(names) / 2), 2, number + 1)
            for line, other in enumerate([""] if together else others):
                rows = []
                for value in values:
                    members = [
                        i
                        for i, setting in enumerate(settings)
                        if tuple(setting[key] for key in keys) == value
                        and (together or _label(setting, keys, inside=False) == other)
                    ]
                    rows.append(statistic({}, name, [metrics[i].get(name) for i in members]))
                _draw_line(axes, numbers, values, rows, style.RUNS[line], other)
            shown = metric(name)
            axes.set_title(f"{shown.label} ({shown.unit})" if shown.unit else shown.label)
            axes.set_xlabel(" + ".join(keys))
            axes.grid(True, axis="y")
            if numbers is None:
                axes.set_xticks(range(len(values)), [_shortened(" ".join(v)) for v in values])
                if len(values) > 5:
                    axes.tick_params("x", labelrotation=30)
        # A line may be missing where a metric has no value.
        legend = {
            label: handle
            for axes in figure.axes
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
            if label
        }
        if len(legend) > 1:
            columns = max(1, _LEGEND_WIDTH // (8 + max(map(len, legend))))
            figure.legend(legend.values(), legend, loc="outside lower center", ncols=columns)
        what = "mean over seeds" + (" and all other axes" if together else "")
        figure.suptitle(f"{what}, with the 95 % interval", fontsize=9.0, x=0.01, ha="left")
        return style.png(figure)


def _draw_line(
    axes,
    numbers: Sequence[float] | None,
    values: Sequence[tuple[str, ...]],
    rows: Sequence[Statistic],
    colour: str,
    label: str,
) -> None:
    places = range(len(values)) if numbers is None else numbers
    drawn = [(x, row) for x, row in zip(places, rows, strict=True) if row.mean is not None]
    if not drawn:
        return
    halves = [0.0 if row.low is None else row.mean - row.low for _, row in drawn]
    axes.errorbar(
        [x for x, _ in drawn],
        [row.mean for _, row in drawn],
        yerr=halves if any(halves) else None,
        marker="o",
        markersize=3.5,
        capsize=2.5,
        linewidth=1.2 if numbers is not None else 0.0,
        elinewidth=1.0,
        color=colour,
        label=_shortened(label, 3 * _LONGEST_LABEL),
    )


def _label(setting: Mapping[str, str], keys: Sequence[str], inside: bool) -> str:
    return " ".join(f"{k}={v}" for k, v in setting.items() if (k in keys) == inside)


def _numbers(values: Sequence[tuple[str, ...]]) -> list[float] | None:
    """The values as numbers, None unless all are and there is one key."""
    try:
        numbers = [float(value) for (value,) in values]
    except ValueError:
        return None
    return numbers if all(map(math.isfinite, numbers)) else None


def _shortened(text: str, longest: int = _LONGEST_LABEL) -> str:
    return text if len(text) <= longest else text[: longest - 1] + "…"
