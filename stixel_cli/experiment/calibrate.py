"""Estimate the disparity error of a recording's rig."""

from stixel_cli.calibration.disparity_fit import DisparityFit
from stixel_cli.calibration.label_errors import fit_label_errors
from stixel_cli.calibration.motion_errors import fit_motion_error
from stixel_cli.calibration.truth_alignment import fit_truth_error
from stixel_cli.config.compose import Composition
from stixel_cli.engine.execute import execute
from stixel_cli.engine.locks import lease
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import open_store
from stixel_cli.errors import UserError
from stixel_cli.experiment.run import experiment_graph, one_line_errors
from stixel_cli.recordings.types import Recording

METHODS = {
    "labels": ("label_errors", fit_label_errors, "label_files", "labels"),
    "truth": ("truth_alignment", fit_truth_error, "true_disparities", "true disparities"),
    "motion": ("motion_tracks", fit_motion_error, "pose_files", "poses of the ego car"),
}
"""By name: the stage, the fit to its result, the files that it needs, and their noun."""


def calibrate(
    composition: Composition, method: str | None = None, progress: Progress | None = None
) -> DisparityFit:
    """The offset and slope of the disparities in a recording.

    Args:
        composition: of the recording.
        method: a name of `METHODS`; None for the first whose files the recording has.
        progress: reports the progress.

    Raises:
        UserError: if the composition has no recording, or nothing to compare with.
        StageFailure: if a stage fails.
    """
    configuration = composition.configuration
    if configuration.source.kind == "rendered":
        raise UserError("source: rendered is exact: choose a recording, source.folder=DIR")
    folder = configuration.source.folder
    stage, fit, _, _ = METHODS[chosen_method(composition.recording, folder, method)]
    store = open_store(configuration.cache)
    with one_line_errors():
        graph = experiment_graph(composition)
        (node,) = graph.of_stage(stage)
        with lease(store.folder, sorted(graph.ancestors([node.key]))):
            execute(graph, [stage], store, executor=configuration.executor, progress=progress)
            found = store.load(node.key)
    try:
        return fit(found, configuration.rig)
    except ValueError as fault:
        raise UserError(f"{folder}: {fault}") from None


def chosen_method(recording: Recording, folder: str, method: str | None) -> str:
    """The name of the method to use.

    Raises:
        UserError: if it is unknown, or the recording lacks its files.
    """
    if method is not None and method not in METHODS:
        raise UserError(f"--from: {method!r} is not known: must be one of {', '.join(METHODS)}")
    lacking = []
    for name in METHODS if method is None else (method,):
        _, _, files, noun = METHODS[name]
        if getattr(recording, files):
            return name
        lacking.append(noun)
    raise UserError(f"{folder}: has no {' and no '.join(lacking)} to compare with")
