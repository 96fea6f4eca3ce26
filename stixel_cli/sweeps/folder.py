"""The folder of a sweep.

sweep.yaml             the request: the axes, and the overrides of every run
runs.csv               one row for each run
summary.csv .md        the options with their means, and the paired differences from the best
index.html             the page of the sweep
play.html              the player of its runs, if asked for
runs/0000/ …           config.yaml, manifest.json, metrics.json, scores.npz, lineage.json
code/                  code digests to which the runs' lineage.json refer
failed/0007/ …         config.yaml, failure.json, traceback.txt
"""

import shlex
import shutil
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.border.files import read_json, read_yaml
from stixel_cli.border.origins import check_below, write_below, written
from stixel_cli.config.folders import PRESETS, of_the_machine
from stixel_cli.config.messages import validated
from stixel_cli.config.texts import split_override
from stixel_cli.errors import UserError, counted, printable, printable_path
from stixel_cli.parameters import parameters
from stixel_cli.results import result as results
from stixel_cli.results.folder import PAGE, write_whole_folder
from stixel_cli.results.lineage import shown_revision
from stixel_cli.sweeps.design import NOT_GIVEN, SEED, over_keys

if TYPE_CHECKING:
    import pandas

    from stixel_cli.answers.page import Asked
    from stixel_cli.answers.runs import Answer, Runs


TABLE = "runs.csv"
SUMMARIES = ("summary.csv", "summary.md", "index.html")
PLAYER = "play.html"
RUNS = "runs"


@parameters
class SweepRequest:
    """The content of `sweep.yaml`.

    Attributes:
        working_directory: to which relative file names in the overrides refer.
        pictures: whether pictures are drawn.
        nodes: of the pipelines; their results are required in addition to the scores.
        axes: the keys of each axis.
        runs: overrides of each run, in the order of their indices.
        notes: command, time, revision, versions, machine; and `resumed`, the times of each resume.
        over: keys of the axes that means are over; older folders have none.
    """

    working_directory: str
    pictures: bool
    nodes: tuple[str, ...]
    axes: tuple[tuple[str, ...], ...]
    runs: tuple[tuple[str, ...], ...]
    notes: dict[str, Any]
    over: tuple[str, ...] = (SEED,)

    @property
    def keys(self) -> list[str]:
        """Every key that differs between runs."""
        return [key for axis in self.axes for key in axis]

    @property
    def text(self) -> str:
        """As YAML: the notes, then the other attributes."""
        content = {**self.notes, **vars(self)}
        del content["notes"]
        return results.yaml_text(content)

    def check(self) -> None:
        """Raise ValueError for a request without runs, or an axis that none has, or no result."""
        given = {split_override(text)[0] for run in self.runs for text in run}
        if not given or not given.issuperset(self.keys) or any(map(of_the_machine, self.keys)):
            raise ValueError("axes: must be keys of the runs that affect results")


_ENTRIES = [field.name for field in fields(SweepRequest) if field.name != "notes"]


class SweepFolder:
    """Writes and reads the folder at `path`; raises UserError for every disk failure."""

    def __init__(self, path: Path):
        self.path = path

    def create(self, request: SweepRequest) -> None:
        """Create the folder with its `sweep.yaml`, with the errors of `whole_folder`."""
        write_whole_folder(self.path, {results.SWEEP_FILE: request.text})

    def request(self) -> SweepRequest:
        """The content of `sweep.yaml`; UserError if this is not the folder of a sweep."""
        file = self.path / results.SWEEP_FILE
        if not self.path.is_dir():
            raise UserError(f"{printable_path(self.path)}: no such folder")
        if not file.exists():
            where = printable_path(self.path)
            raise UserError(f"{where}: not the folder of a sweep ({file.name} is missing)")
        content = read_yaml(file)
        own = {name: content.pop(name) for name in _ENTRIES if name in content}
        return validated(SweepRequest, own | {"notes": content}, file)

    def resume_command(self, overrides: Iterable[str]) -> str:
        """The command line that resumes the sweep, with those of a run's overrides it needs."""
        machine = [text for text in overrides if of_the_machine(text)]
        return shlex.join(
            ["stixel", "sweep", "--resume", str(self.path), *machine, *PRESETS.option]
        )

    def run(self, index: int) -> Path:
        """The folder of a run; it may not exist."""
        return self.path / RUNS / f"{index:04d}"

    def result(self) -> "SweepResult":
        """The sweep with its runs as they are now."""
        request = self.request()
        return SweepResult(self.path, tuple(self.runs(request)), request)

    def runs(self, request: SweepRequest) -> list[results.RunResult]:
        """The runs in the order of their indices; those that are not done have no metrics."""
        runs = []
        for index, overrides in enumerate(request.runs):
            given = dict(map(split_override, overrides))
            swept = {key: given.get(key, NOT_GIVEN) for key in request.keys}
            manifest = {"run": index, "seed": swept.pop(SEED, ""), "swept": swept}
            run = results.RunResult(manifest=manifest, folder=self.run(index))
            file = self.path / results.FAILED / run.folder.name / "failure.json"
            try:
                found = {"metrics": results.read_metrics(run.folder)}
            except UserError:
                found = {"status": results.MISSING}
                if file.exists():
                    content = read_json(file)
                    skipped = content.get("status") == results.SKIPPED
                    found["status"] = results.SKIPPED if skipped else results.FAILED
                    found["failure"] = UserError(printable(str(content.get("error")), 500))
            runs.append(replace(run, **found))
        return runs

    def finished(self, count: int) -> dict[int, results.RunResult]:
        """The complete ones of `count` runs by index, with manifest and metrics."""
        runs = {index: results.listed_run(self.run(index)) for index in range(count)}
        return {i: run for i, run in runs.items() if isinstance(run.manifest.get("results"), list)}

    def write_run(self, index: int, files: Mapping[str, str | bytes], kind: str = RUNS) -> None:
        """Write the folder of a run atomically, or that of its failure (`FAILED`).

        It replaces an older one of either kind.
        """
        check_below(self.path, [f"{kind}/{index:04d}"])
        write_whole_folder(self.path / kind / f"{index:04d}", files, replace=True)
        with suppress(OSError):
            shutil.rmtree(self.path / (results.FAILED if kind == RUNS else RUNS) / f"{index:04d}")
            # An empty folder would look as if a run had failed.
            (self.path / results.FAILED).rmdir()

    def write(self, files: Mapping[str, str | bytes]) -> None:
        """Write files of the folder, by path below it, each atomically."""
        with written(self.path):
            write_below(self.path, files)

    def remove(self, patterns: Iterable[str]) -> None:
        """Remove outdated files and folders, by their paths with wildcards."""
        for path in [path for pattern in patterns for path in self.path.glob(pattern)]:
            with suppress(OSError):
                shutil.rmtree(path) if path.is_dir() else path.unlink()


@dataclass(frozen=True)
class SweepResult:
    """A sweep with its results, computed or read."""

    folder: Path | None
    """Its folder; None if nothing was written."""
    runs: tuple[results.RunResult, ...]
    """One entry for each run, in the order of their indices."""
    request: SweepRequest
    """What was asked for. Means are `over` keys: seeds are the units of statistics, others are
    scenarios."""
    computed: int = 0
    """Number of nodes that this call computed."""
    cached: int = 0
    """Number of needed nodes that were in the store before."""

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of `runs.csv`."""
        rows = []
        for run in self.runs:
            failure = run.failure
            at = "failed" if failure is not None else "runs" if run.status == results.DONE else None
            rows.append(
                {
                    "run": run.index,
                    "status": run.status,
                    **run.setting,
                    SEED: run.manifest.get("seed", ""),
                    "overrides": " ".join(map(shlex.quote, run.overrides)),
                    "folder": None if None in (at, self.folder) else f"{at}/{run.index:04d}",
                    "failed_stage": getattr(failure, "stage", None),
                    "error": None if failure is None else " ".join(str(failure).split()),
                    **run.metrics,
                }
            )
        return rows

    @property
    def records(self) -> list[dict[str, Any]]:
        """The rows with values of keys that differ between runs in their own types."""
        return [
            row | {k: run.composition.value(k) for k, v in run.setting.items() if v != NOT_GIVEN}
            for row, run in zip(self.rows, self.runs, strict=True)
        ]

    def frame(self) -> "pandas.DataFrame":
        """The records as a table: one row per run, with its settings, status and metrics."""
        import pandas

        return pandas.DataFrame(self.records)

    @cached_property
    def table(self) -> "Runs":
        """The runs of which questions are asked; settings as typed, `folder` the whole path."""
        import pandas

        from stixel_cli.answers.runs import Runs

        rows = [
            row | {"folder": None if row["folder"] is None else str(self.folder / row["folder"])}
            for row in self.rows
        ]
        keys = [key for key in self.request.keys if any(key in row for row in rows)] or [SEED]
        frame = pandas.DataFrame(rows).set_index("run")
        numbers = dict.fromkeys(name for run in self.runs for name in run.metrics)
        typed = frame.astype({name: float for name in numbers if name not in keys})
        rest = (name for name in (SEED, "overrides", "failed_stage") if name not in keys)
        typed = typed.drop(columns=[*rest])
        return Runs(typed, tuple(keys), question_over(self.request.over, self.request.axes))

    def ask(self, **parts: Any) -> "Answer":
        """The answer of a question about the runs, see `answers.runs.Runs.ask`."""
        return self.table.ask(**parts)

    def __repr__(self) -> str:
        """The numbers of runs and nodes, and the folder, in one line."""
        runs = f"{self.count(results.DONE)} of {len(self.runs)} runs done"
        nodes = f"{self.computed} nodes computed, {self.cached} cached"
        return f"<SweepResult {runs}; {nodes} {self.folder or ''}>"

    def _repr_html_(self) -> str:
        """What a notebook shows: the table of the runs."""
        return self.frame()._repr_html_()

    @property
    def complete(self) -> bool:
        """Whether every run is done."""
        return self.count(results.DONE) == len(self.runs)

    def count(self, status: str) -> int:
        """Number of runs with a status."""
        return sum(run.status == status for run in self.runs)

    def faults(self, most: int) -> list[str]:
        """A line for each run that failed or was skipped, at most so many of each status."""
        lines = []
        for status in (results.FAILED, results.SKIPPED):
            runs = [run for run in self.runs if run.status == status]
            for run in runs[:most]:
                reason = printable(" ".join(str(run.failure).split()), 500)
                lines.append(f"run {run.index} {status} ({run.label}): {reason}")
            if len(runs) > most:
                lines.append(f"{counted(len(runs) - most, 'more run')} {status}, see runs.csv")
        return lines


def question_over(over: Sequence[str], axes: Sequence[Sequence[str]]) -> dict[str, Any]:
    """The parts of a question whose means are over some keys of axes; {} for the seed alone.

    Seeds are units; where none is named, all named keys are. The other named keys are scenarios,
    and the keys that are not named are compared.
    """
    if tuple(over) == (SEED,):
        return {}
    averaged = [axis for axis in axes if set(axis) & set(over)]
    drawn = [axis for axis in averaged if any(key.endswith(SEED) for key in axis)] or averaged
    named = [key for axis in averaged for key in axis]
    units = [key for axis in drawn for key in axis]
    compare = [key for axis in axes for key in axis if key not in named]
    return {
        "over": units,
        "within": [key for key in named if key not in units],
        **({"compare": compare} if compare else {}),
    }


def summary_files(result: SweepResult) -> dict[str, str]:
    """The summaries and the page by file name."""
    from stixel_cli.answers import render

    every, shown = result.table.answers(result.table.metrics), result.table.answers()
    page = result.folder / PAGE
    texts = (
        render.csv(every),
        f"# {result.request.notes['command']}\n\n{render.markdown(shown)}",
        sweep_page(of_sweep(result, shown), page, ["stixel", "report", str(result.folder)]),
    )
    return dict(zip(SUMMARIES, texts, strict=True))


def read_sweep(folder: Path) -> SweepResult:
    """The sweep in a folder; UserError if it is no sweep, or no run is done."""
    result = SweepFolder(folder).result()
    if not result.count(results.DONE):
        raise UserError(f"{folder}: no run is done; resume with: stixel sweep --resume {folder}")
    return result


def of_sweep(result: SweepResult, answers: "Sequence[Answer]") -> "Asked":
    """What is asked of a sweep."""
    from stixel_cli.answers.page import Asked

    notes, player = result.request.notes, result.folder / PLAYER
    git = notes.get("git")
    origin = {
        "command": notes.get("command", ""),
        "created": notes.get("created", "–"),
        "revision": (shown_revision(git) if isinstance(git, dict) else None) or "–",
    }
    title = f"Sweep {result.folder.resolve().name}"
    is_played = player if player.exists() else None
    return Asked(title, result.table, answers, (), origin, is_played)


def asked_folders(
    folders: Sequence[Path],
    metrics: str | None = None,
    reference: str | None = None,
    over: str | None = None,
    compare: str | None = None,
) -> "Asked":
    """What is asked of one sweep's folder, or of the folders of several runs.

    The other arguments are those of `answers.runs.Runs.question`, names by commas; the last two are
    of a sweep only. UserError for a folder that is neither, and as of `Runs.ask`.
    """
    names = metrics.split(",") if metrics else ()
    if len(folders) > 1 or not (folders[0] / results.SWEEP_FILE).exists():
        for option, value in (("--over", over), ("--compare", compare)):
            if value is not None:
                raise UserError(f"{option}: is for one sweep; these are runs")
        from stixel_cli.answers.page import asked_runs

        return asked_runs(folders, names, reference)
    result = read_sweep(folders[0])
    if over is not None:
        keys = over_keys(over, result.request.axes)
        result = replace(result, request=replace(result.request, over=keys))
    compared = None if compare is None else compare.split(",")
    answers = result.table.answers(names, compare=compared, reference=reference)
    return of_sweep(result, answers)


def sweep_page(asked: "Asked", page: Path, command: Sequence[str]) -> str:
    """The page; `page` is its file, `command` the one that writes it."""
    from stixel_cli.answers.page import answers_page, page_links

    frame = asked.runs.frame
    folders = [Path(one) for one in frame["folder"].dropna()] if "folder" in frame else []
    links = page_links([*folders, *filter(None, [asked.player])], page, PAGE)
    return answers_page(asked, links, command)
