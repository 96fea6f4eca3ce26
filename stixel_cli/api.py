"""The same as the command line: `from stixel_cli import compose, load, plot, run, sweep, track`.

Settings are given as texts in Hydra's grammar, as mappings or as keywords, which may be mixed:
`run("tracker=contour", {"path.duration": 2}, seed=3)`, see `config.texts.mapping_texts`. A function
of a module, a script or a notebook is a tracker of your own: `run(tracker=function)`.
Calls leave no state in the process and may follow each other in any order. Errors that the user
can correct are raised as `stixel_cli.errors.UserError`, in one line.
"""

import dataclasses
import sys
from collections.abc import Mapping, Sequence
from itertools import starmap
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.config.choice import with_values
from stixel_cli.config.compose import Composition, from_resolved
from stixel_cli.config.compose import compose as compose_overrides
from stixel_cli.config.texts import mapping_texts, override_text, split_override
from stixel_cli.engine.progress import Progress
from stixel_cli.errors import UserError
from stixel_cli.evaluation.scores import Scores
from stixel_cli.experiment.run import record_run
from stixel_cli.experiment.stored import read_stored_run
from stixel_cli.measurements.scans import Scans
from stixel_cli.results.folder import check_results
from stixel_cli.results.result import SWEEP_FILE, RunResult
from stixel_cli.results.tables import with_arrays
from stixel_cli.scene.scenario import Scenario
from stixel_cli.sweeps.index import update_index
from stixel_cli.tracking.track import Track

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stixel_cli.answers.runs import Runs
    from stixel_cli.sweeps.run import SweepResult


Overrides = str | Mapping[str, Any] | Sequence[str]
"""A text, a mapping of keys or groups to values, or a list of texts."""


def compose(*overrides: Overrides, last_wins: bool = False, **settings: Any) -> Composition:
    """The default configuration with overrides, such as `"rig=kitti"`, `{"seed": 3}`, `seed=3`.

    Args:
        overrides: texts in Hydra's grammar, lists of texts, and mappings.
        last_wins: of several overrides of one key, take the last; else they are refused.
        settings: groups and keys without a dot as keywords.

    ConfigurationError in one line, for any fault of the overrides.

    Example:
        >>> composition = compose("rig=kitti", {"path.duration": 2}, seed=3)
        >>> composition.configuration.rig.baseline, composition.value("path.duration")
        (0.5327, 2)
    """
    return compose_overrides(_texts((*overrides, settings), last_wins))


def run(
    *experiment: Overrides | Composition,
    results: Path | str | None = None,
    name: str | None = None,
    workers: int | None = None,
    cache: Path | str | None = None,
    last_wins: bool = False,
    **settings: Any,
) -> RunResult:
    """Run one experiment; cached results are not computed again.

    `run(BASE, measurement="lidar", last_wins=True)` changes one setting of a list of overrides. A
    notebook and a terminal show the progress.

    Args:
        experiment: overrides as in `compose`, or one result of `compose`.
        results: parent of the result folder; None to write nothing.
        name: of the result folder; None for a name from choices and time.
        workers: None for the number in the configuration.
        cache: folder of the cache; None for the one in the configuration.
        last_wins, settings: as in `compose`.

    Raises:
        UserError: for errors that the user can correct.
        StageFailure: if a stage fails for another reason.

    Example:
        >>> result = run("measurement=fabricated", {"path.duration": 1}, tracker="point")
        >>> result.track.means.shape, result.scans.points_world.shape[1]
        ((10, 6), 2)
        >>> 0.0 < result.metrics["iou_mean"] < 1.0
        True
    """
    machine = _of_this_machine(workers, cache)
    texts = starmap(override_text, machine.items())
    if any(isinstance(part, Composition) for part in experiment):
        if len(experiment) > 1 or settings:
            raise UserError("run: give overrides, or one composition without overrides")
        (composition,) = experiment
        if machine:
            resolved = with_values(composition.resolved, machine)
            composition = dataclasses.replace(
                composition,
                configuration=from_resolved(resolved),
                resolved=resolved,
                overrides=(*composition.overrides, *texts),
            )
    else:
        composition = compose(_texts((*experiment, settings), last_wins), [*texts])
    results = None if results is None else Path(results)
    progress = Progress(visible=_visible(), advice=_visible())
    made = record_run(composition, results, name, progress)
    update_index(results)
    return made


def sweep(
    *overrides: Overrides,
    file: Path | str | None = None,
    results: Path | str | None = None,
    name: str | None = None,
    pictures: bool = False,
    workers: int | None = None,
    cache: Path | str | None = None,
    last_wins: bool = False,
    trust_code: bool = False,
    **settings: Any,
) -> "SweepResult":
    """Run all combinations of several values; stages that runs share are computed once.

    `sweep(…).frame()` is a pandas table with one row per run. A failing run does not stop the
    others; see its `status`.

    Args:
        overrides: as in `compose`, including several values: `"seed=range(0,5)"`, and of a mapping
            or keyword a tuple or range, `tracker=("contour", "gp_ekf"), seed=range(5)`.
        file: with axes, seeds and excluded runs: a path, or the name of a shipped file.
        results, name, workers, cache: as in `run`, of the sweep's folder.
        pictures: draw the pictures of every run.
        last_wins, settings: as in `compose`.
        trust_code: run the user-defined code that the file names.

    Raises:
        UserError: for errors that the user can correct, before anything is computed.

    Example:
        >>> base = {"measurement": "fabricated", "path.duration": 1}
        >>> frame = sweep(base, tracker=("point", "box"), seed=range(2)).frame()
        >>> frame.groupby("tracker")["iou_mean"].count().to_dict()
        {'box': 2, 'point': 2}
    """
    from stixel_cli.sweeps.design import sweep_design
    from stixel_cli.sweeps.graphs import plan_sweep
    from stixel_cli.sweeps.run import new_sweep

    machine = starmap(override_text, _of_this_machine(workers, cache).items())
    texts = [*_texts((*overrides, settings), last_wins), *machine]
    file = None if file is None else str(file)
    results = None if results is None else Path(results)
    if results is not None:
        check_results(results, name)
    plan = plan_sweep(sweep_design(texts, file, trust_code), pictures)
    result = new_sweep(plan, results, name, visible=_visible())
    update_index(results)
    return result


def track(scans: Scans, prior: str = "car", *, tracker: str = "contour", **settings: Any) -> Track:
    """Track one target through `scans` of your own, from the cluster of points that moves.

    Args:
        scans: see `Scans.of_each`.
        prior: class of the road user: `car`, `cyclist`, `pedestrian` or `unknown`.
        tracker: an option of `tracker`.
        settings: groups as keywords, or `**{"start.bearing": [-5, 5]}`, as in `compose`.

    Raises:
        UserError: for errors that the user can correct.
        ValueError: if no cluster of the class's size moves; `start.bearing` then names one.

    Example:
        >>> result = run("measurement=fabricated", {"path.duration": 3})
        >>> track(result.scans, "car").to_frame()["width"].iloc[-1].round().item()
        2.0
    """
    from stixel_cli.border.own_code import loaded
    from stixel_cli.experiment.table import TABLE
    from stixel_cli.tracking.several import start_from_scans

    chosen = {"prior": prior, "tracker": tracker, "start": "scans"} | settings
    if not any("seen_by" in one for one in chosen) and tracker in ("contour", "gp_ekf"):
        chosen["tracker.seen_by"] = "file"
    configuration = compose(chosen, last_wins=True).configuration
    initial = start_from_scans(scans, configuration.start, configuration.prior)
    track_of = loaded(TABLE["track"].functions[configuration.tracker.kind])
    return track_of(scans, initial, configuration.prior, configuration.tracker)


def load(folder: Path | str) -> "RunResult | Runs":
    """The run in a result folder, or the runs of a sweep's folder; nothing is computed.

    A run has its scenario, scans, track and scores; what the folder lacks is in `results.tables`.
    The `Runs` of a sweep answer questions: `load("results/sweep").ask(metric="iou_mean")`.
    UserError as `stixel run FOLDER` and `stixel report` have it.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> with TemporaryDirectory() as folder:
        ...     made = run("measurement=fabricated path.duration=1".split(), results=folder)
        ...     stored = load(made.folder)
        >>> stored.metrics == made.metrics and stored.track.means.shape == made.track.means.shape
        True
    """
    if (Path(folder) / SWEEP_FILE).exists():
        from stixel_cli.sweeps.folder import read_sweep

        return read_sweep(Path(folder)).table
    return with_arrays(read_stored_run(Path(folder)))


def plot(result: RunResult, ax: "Axes | None" = None) -> "Figure":
    """The run from above: paths with contours at several times, and the contours enlarged.

    `result.plot()` is the same. With `ax`, axes of your own, only the paths are drawn, there.
    UserError if the result has no track, because it is of a sweep.

    Example:
        >>> figure = plot(run("measurement=fabricated", {"path.duration": 1}, tracker="point"))
        >>> len(figure.axes) > 1
        True
    """
    from stixel_cli.pictures import style
    from stixel_cli.pictures.path_figure import path_figure

    if result.track is None or result.scenario is None:
        raise UserError("the result has no track: give a result of run(…) or load(…)")
    with style.drawing():
        view = result.configuration.field_of_view
        figure = path_figure(result.track, result.scenario, view, ax)
    if ax is None:
        # A notebook that has not imported pyplot shows a figure by this method.
        figure._repr_png_ = lambda: style.png(figure)
    return figure


def _notebook_view(result: RunResult) -> str:
    """HTML of a result: verdict, main metrics, and the picture from above, if it has one."""
    from stixel_cli.evaluation.verdict import verdict
    from stixel_cli.report import metrics
    from stixel_cli.report.page import page_template, picture_for_page

    picture = result.pictures.get("path.png")
    return page_template("stixel_cli.report", "notebook.html").render(
        verdict=verdict(result.metrics),
        rows=metrics.score_table(metrics.main_metrics(result.metrics))[1],
        picture=picture and picture_for_page(picture)["source"],
    )


def _shapes(value: Scans | Scenario | Scores | Track) -> str:
    """The arrays of a value with their shapes, in one line."""
    arrays = {name: getattr(array, "shape", None) for name, array in vars(value).items()}
    shown = ", ".join(f"{name} {shape}" for name, shape in arrays.items() if shape is not None)
    return f"<{type(value).__name__} {shown}>"


# Results know neither pages nor notebooks, so this is attached where Python users enter.
RunResult._repr_html_ = _notebook_view
RunResult.plot = plot
for _kind in (Scans, Scenario, Scores, Track):
    _kind.__repr__ = _shapes


def _texts(given: Sequence[Overrides], last_wins: bool) -> tuple[str, ...]:
    """The overrides in one tuple; of several of one key only the last if `last_wins`."""
    texts: list[str] = []
    for part in given:
        if isinstance(part, Mapping):
            texts += mapping_texts(part)
        else:
            texts += [part] if isinstance(part, str) else part
    if not last_wins:
        return tuple(texts)
    return tuple({split_override(text)[0]: text for text in texts}.values())


def _visible() -> bool:
    """Whether progress is shown: on a terminal or in a notebook, else the output goes to a file."""
    # Not imported here: a notebook has imported it.
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel") or sys.stderr.isatty()


def _of_this_machine(workers: int | None, cache: Path | str | None) -> dict[str, Any]:
    """The keys of a number of workers and a cache with their values, if given."""
    given = {"executor.workers": workers, "cache.folder": None if cache is None else str(cache)}
    return {key: value for key, value in given.items() if value is not None}
