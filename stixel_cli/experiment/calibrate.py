"""Estimate the disparity error of a recording's rig."""

from stixel_cli.config.compose import Composition
from stixel_cli.engine.execute import execute
from stixel_cli.engine.locks import lease
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import open_store
from stixel_cli.errors import UserError
from stixel_cli.experiment.run import experiment_graph, one_line_errors
from stixel_cli.experiment.stages import recording_of
from stixel_cli.validation.label_errors import DisparityFit, fit_disparity_error

STAGE = "label_errors"


def calibrate(composition: Composition, progress: Progress | None = None) -> DisparityFit:
    """The offset and slope of the disparities in a recording, from all its labelled cars.

    Raises:
        UserError: if the composition has no recording, or no label can be used.
        StageFailure: if a stage fails.
    """
    configuration = composition.configuration
    if configuration.source.kind == "rendered":
        raise UserError("source: rendered is exact: choose a recording, source.folder=DIR")
    if recording_of(configuration).labels is None:
        raise UserError(f"{configuration.source.folder}: has no labels to compare with")
    store = open_store(configuration.cache)
    with one_line_errors():
        graph = experiment_graph(configuration)
        (node,) = graph.of_stage(STAGE)
        with lease(store.folder, sorted(graph.ancestors([node.key]))):
            execute(graph, [STAGE], store, executor=configuration.executor, progress=progress)
            found = store.load(node.key)
    try:
        return fit_disparity_error(found, configuration.rig)
    except ValueError as fault:
        raise UserError(f"{configuration.source.folder}: {fault}") from None
