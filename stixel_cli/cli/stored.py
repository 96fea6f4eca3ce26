"""`stixel verify` and `stixel export`: a stored run, repeated or in the format of other tools."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.cli import options
from stixel_cli.cli.terminal import Interrupted, print_json, say, tell
from stixel_cli.errors import UserError

if TYPE_CHECKING:
    from stixel_cli.experiment.verify import Verification
    from stixel_cli.results.result import RunResult


def stored_run(folder: Path, workers: int | None, trust_code: bool) -> "RunResult":
    """The run of a result folder, to be computed with the executor and cache of this machine.

    UserError if the folder cannot be read, or names user-defined code that is not trusted.
    """
    from stixel_cli.experiment.run import read_stored_run, trust_stored_run

    stored = read_stored_run(folder, tuple(options.with_workers((), workers)))
    trust_stored_run(stored, trust_code)
    return stored


def tell_changed_code(stored: "RunResult") -> None:
    """Name each of the user's modules on stderr that differs from the copy in a folder."""
    from stixel_cli.experiment.run import changed_code
    from stixel_cli.results.lineage import CODE_FOLDER

    for name in changed_code(stored):
        tell(f"{name}: is not as in {stored.folder / CODE_FOLDER}: today's is used")


def verify(
    folder: options.Folder,
    cached: options.flag("--cached", "Take unchanged results from the cache.") = False,
    workers: options.Workers = None,
    trust_code: options.TrustCode = False,
    json: options.Json = False,
) -> int:
    """Repeat a run and check that the results are identical.

    All stages are computed again, outside the cache. If results differ, the command reports the
    first stage that differs, by how much, and which version or function changed. The exit code is
    0 if all results are identical, otherwise 1.

    Example: stixel verify results/contour
    """
    import tempfile

    from stixel_cli.engine.progress import Progress
    from stixel_cli.engine.store import Store, open_store
    from stixel_cli.experiment.verify import verify_run
    from stixel_cli.results.lineage import provenance

    stored = stored_run(folder, workers, trust_code)
    tell_changed_code(stored)
    store = open_store(stored.composition.configuration.cache)
    progress = Progress(visible=True)
    if cached:
        verification = verify_run(stored, store, store, provenance(), progress)
    else:
        try:
            temporary = tempfile.TemporaryDirectory(prefix="stixel-verify-")
        except OSError as error:
            raise UserError(
                f"cannot create a temporary folder for the results: {error.strerror}"
            ) from error
        try:
            with temporary as scratch:
                verification = verify_run(stored, Store(scratch), store, provenance(), progress)
        except KeyboardInterrupt:
            raise Interrupted("the results are discarded (--cached keeps them)") from None
    if json:
        print_json(_as_json(folder, verification))
    else:
        say(*_as_text(verification, stored.lineage is None))
    return 0 if verification.identical else 1


def _as_json(folder: Path, verification: "Verification") -> dict[str, Any]:
    return {
        "folder": str(folder),
        "identical": verification.identical,
        "files_compared": verification.compared,
        "files": [vars(file) for file in verification.files],
        "first_by_key": None if verification.by_key is None else vars(verification.by_key),
        "first_by_value": None if verification.by_value is None else vars(verification.by_value),
        "changes": list(verification.changes),
        "stages": verification.stages,
    }


def _as_text(verification: "Verification", no_record: bool) -> list[str]:
    computed = sum(stage["nodes_computed"] for stage in verification.stages)
    nodes = sum(stage["nodes"] for stage in verification.stages)
    again = f"{computed} of {nodes} nodes computed again"
    if verification.identical:
        lines = [f"identical: {verification.compared} files compared, {again}"]
    else:
        lines = [f"differs: {len(verification.files)} of {verification.compared} files, {again}"]
        lines += [f"  {file.file}: {file.what}" for file in verification.files]
    for kind, stage in (("key", verification.by_key), ("result", verification.by_value)):
        if stage is not None:
            lines.append(f"first stage with another {kind}: {stage.stage}: {stage.what}")
            lines += [f"  {cause}" for cause in stage.causes]
    if no_record:
        lines.append("the keys of the stages are unknown: lineage.json is missing")
    if verification.changes:
        lines.append("since then:")
        lines += [f"  {change}" for change in verification.changes]
    return lines


NAMES = "kitti|csv|tum|stx1|rerun|mlflow"
"""The formats, here because completion must not import them."""


def export(
    folder: options.Folder,
    format: options.option(
        str,
        "kitti: images, calibration, labels, poses, disparity as a clip of KITTI's "
        "tracking benchmark. csv: scans, track, truth, contours, and their columns. tum: "
        "trajectories, as evo reads them. stx1: stixels for pyStixel-lib. rerun: run.rrd. "
        "mlflow: settings, scores, pages, of a sweep too.",
        NAMES,
        "--format",
        autocompletion=lambda incomplete: [
            name for name in NAMES.split("|") if name.startswith(incomplete)
        ],
        show_default=False,
    ),
    output: options.NewFolder = None,
    workers: options.Workers = None,
    trust_code: options.TrustCode = False,
) -> int:
    """Write a run, or with mlflow a sweep, in the format of other tools.

    Missing results are computed, but for mlflow.

    \b
    Examples:
      stixel export results/contour --format kitti --output clip
      stixel export results/contour --format csv
      stixel export results/my_sweep --format mlflow
    """
    from stixel_cli.engine.progress import Progress
    from stixel_cli.export.export import export as write
    from stixel_cli.export.mlflow_folder import export_mlflow

    known = NAMES.split("|")
    if format not in known:
        raise UserError(f"--format: {format!r} is not known: must be one of {', '.join(known)}")
    target = options.new_file(output or Path(f"{folder.resolve().name}-{format}"))
    if format == "mlflow":
        export_mlflow(folder.resolve(), target.absolute())
    else:
        stored = stored_run(folder, workers, trust_code)
        answer = write(stored, target.absolute(), format, Progress(visible=True))
    say(target)
    if format == "kitti":
        say(shlex.join(["stixel", "run", *answer]))
    return 0
