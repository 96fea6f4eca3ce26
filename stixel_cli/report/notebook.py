"""A run in a notebook: its verdict, its main metrics, and its picture from above."""

import base64
import html

from stixel_cli.evaluation.metric_table import metric
from stixel_cli.evaluation.verdict import verdict
from stixel_cli.report.metrics import main_metrics, shown_value, with_value
from stixel_cli.results.result import RunResult

PICTURE = "path.png"
"""The picture from above among those of a run."""


def result_html(result: RunResult) -> str:
    """HTML of a run for a notebook; its picture only if the result has one."""
    rows = "".join(
        f"<tr><td style='text-align:left'>{html.escape(metric(name).label)}</td>"
        f"<td>{shown_value(name, value)} {metric(name).shown_unit}</td></tr>"
        for name, value in with_value(main_metrics(result.metrics)).items()
    )
    page = f"<p><b>{html.escape(' '.join(verdict(result.metrics)))}</b></p><table>{rows}</table>"
    if PICTURE in result.pictures:
        data = base64.b64encode(result.pictures[PICTURE]).decode()
        look = 'alt="The run from above" style="max-width:100%"'
        page += f'<img {look} src="data:image/png;base64,{data}">'
    return page
