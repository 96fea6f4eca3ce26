"""`stixel tune`: search for the best values of settings with Optuna."""

import shlex
from datetime import UTC, datetime
from pathlib import Path

from stixel_cli.border import TYPED
from stixel_cli.cli import options
from stixel_cli.cli.terminal import print_json, say, say_wrapped
from stixel_cli.config.folders import PRESETS, of_the_machine
from stixel_cli.errors import UserError


def tune(
    overrides: options.SweepOverrides = None,
    objective: options.option(
        str, "One metric, or two for a Pareto front: A,B.", "METRICS"
    ) = "iou_mean",
    trials: options.option(int, "Number of trials.", min=1, max=10_000) = 40,
    seeds: options.option(
        int, "Seeds from 1000 to tune on, and from 0 to report.", min=1, max=1000
    ) = 10,
    over: options.Over = None,
    name: options.Name = None,
    results: options.Results = Path("results"),
    workers: options.Workers = None,
    resume: options.Resume = None,
    trust_code: options.TrustCode = False,
    json: options.Json = False,
    config_dir: options.ConfigDir = None,
) -> int:
    """Search for the best values of settings with Optuna.

    Parameters have several values, KEY='interval(A,B)', or KEY='tag(log,interval(A,B))'. A trial
    is averaged over seeds from 1000, and stops if it is clearly worse after the first four. The
    gain over the default is that on seeds from 0, in pairs. An objective that should be 1, such as
    nees_position_mean, counts by its |log|. The folder has a page, a table of the trials, and a
    preset: stixel run --config-dir FOLDER/preset experiment=tuned.

    Example: stixel tune measurement=fabricated tracker.sigma_q='tag(log,interval(0.1,10))'
    """
    from stixel_cli.answers.render import records
    from stixel_cli.config.override_checks import read_overrides
    from stixel_cli.results.folder import check_results, new_folder
    from stixel_cli.results.made_here import origin_of
    from stixel_cli.sweeps.run import SweepInterrupted
    from stixel_cli.sweeps.tune_folder import (
        TuneRequest,
        create,
        label,
        read_request,
        write_outcome,
    )
    from stixel_cli.sweeps.tuning import Tuning
    from stixel_cli.sweeps.whole import resumed_overrides

    words = options.with_workers(overrides or [], workers)
    if resume is not None:
        if over or name:
            raise UserError("--resume continues the tuning of that folder: leave out the rest")
        request = read_request(resume)
        origin = origin_of(resume, trust_code)
        (given,) = resumed_overrides([request.overrides], words, origin)
    else:
        check_results(results, name)
        swept = (over or "seed").split(",")
        request = TuneRequest(list(words), objective.split(","), swept, seeds, trials)
        given = read_overrides(words, TYPED)
    tuning = Tuning(given, request.objectives, request.over, request.seeds)
    folder = resume or new_folder(
        results, name, "tune", datetime.now(UTC), lambda path: create(path, request)
    )
    machine = [word for word in words if of_the_machine(word)]
    command = ["stixel", "tune", "--resume", str(folder), *machine, *PRESETS.option]
    command = shlex.join(command)
    try:
        tuning.search(request.trials)
        best, gain = write_outcome(folder, tuning, command)
    except SweepInterrupted:
        raise SweepInterrupted(f"interrupted; resume with: {command}") from None
    if json:
        answer = {"trial": best.name, "settings": best.settings, "gain": records(gain)}
        print_json({"folder": str(folder.absolute()), **answer})
    else:
        for one in gain:
            say_wrapped(f"{label(one.question.metric)}. {one.sentence}")
        chosen = " ".join(f"{key}={value}" for key, value in best.settings.items())
        say(f"trial {best.name}: {chosen}", folder)
    return 0
