"""The tables of all rows: each set of sequences is `Runs`, and its page an answer about trackers.

A scene is a class, a case and a seed: its sequences of several sensors share road user, path and
start. Sensors, classes and cases are scenarios, seeds the units.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from stixel_cli.answers import render
from stixel_cli.answers.page import Asked, answers_page
from stixel_cli.answers.runs import Runs
from stixel_cli.benchmark import sequences
from stixel_cli.benchmark.packs import (
    CONSISTENT,
    FIXED,
    FRESH,
    TIME,
    first_scored,
    read_pack,
    scored_track,
)
from stixel_cli.benchmark.sequences import FROZEN, Data, named, planned
from stixel_cli.report.page import page_template
from stixel_cli.report.playback import playback_html
from stixel_cli.results.result import DONE, RunResult, listed

AXES = ("tracker", "sensor", "road_user", "case", "seed")
SHOWN = (
    *("iou_mean", "iou_box_mean", "centre_rmse_m", "orientation_rmse_deg", "track_lost"),
    *(CONSISTENT, TIME),
)
"""Metrics of the page, the main one first."""
BETTER = {CONSISTENT: "more"}
"""Direction of those that the table of metrics does not have."""
RANKED = "ranked"
_COLUMNS = (
    "In nees band: share of sequences whose mean NEES / 2 of the position is in the 95 % band of a "
    "consistent filter. Ms per scan: milliseconds, on the machine that ran the tracker."
)


def kind_of(row: Mapping[str, Any]) -> str:
    """`RANKED`, or what keeps a row out of the comparison."""
    if row["tier"] == FIXED:
        return FIXED
    about = row["tracker"]
    notes = ["not causal"] * (not about["causal"]) + ["per class"] * about["per_class"]
    return ", ".join(notes + ["own start"] * (about["start"] == "own")) or RANKED


def score_frame(rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """One line for each row and sequence, with all scores; `folder` is the sequence's name.

    Rows of one tracker have its version, tier, data and pack in their names.
    """
    names = [row["tracker"]["name"] for row in rows]
    frames = []
    for row, name in zip(rows, names, strict=True):
        kind = kind_of(row)
        if names.count(name) > 1:
            tracker, pack = row["tracker"], row.get("pack", "")
            about = (tracker["version"][:14], row["tier"], row["benchmark"][:8], pack[:8])
            name = " ".join(filter(None, (name, *about)))
        frame = pd.DataFrame([vars(named(sequence)) for sequence in row["sequences"]])
        values = {metric: np.array(column, float) for metric, column in row["scores"].items()}
        named_so = name if kind == RANKED else f"{name} ({kind})"
        about = {"tracker": named_so, "kind": kind, "status": DONE, "folder": row["sequences"]}
        frames.append(frame.assign(pack=row.get("pack", ""), **about, **values))
    return pd.concat(frames, ignore_index=True)


def bench_pages(
    rows: Sequence[Mapping[str, Any]],
    played: Collection[str] = (),
    command: Sequence[str] = ("stixel", "bench", "page"),
) -> dict[str, str]:
    """The content of `index.html`, and of `ID.html`, `.csv` and `.md` for each set of sequences.

    Fresh rows, on seeds that the pack draws, are a set of their own. `played` are the SHA-256 of
    the packs whose sequences have a playback page, `SEQUENCE.html`; `command` writes the pages.
    """
    files: dict[str, str] = {}
    index = []
    # Not by the id of the data: another processor renders the same sequences to other last bits.
    for names in dict.fromkeys(tuple(row["sequences"]) for row in rows):
        own = [row for row in rows if tuple(row["sequences"]) == names]
        fresh = own[0]["tier"] == FRESH
        for part, frame in score_frame(own).groupby("part"):
            data = own[0]["benchmark"][:12]
            name = data + "-fresh" * fresh + f"-{part}" * (part != FROZEN)
            asked = _asked(data, str(part), fresh, frame.reset_index(drop=True))
            shown = {*frame.loc[frame["pack"].isin(played), "folder"]}
            links = {sequence: f"{sequence}.html" for sequence in shown}
            files[f"{name}.html"] = answers_page(asked, links, command)
            files |= {
                f"{name}.{form}": render.TABLES[form](asked.answers) for form in ("csv", "md")
            }
            index.append((name, asked, frame["folder"].nunique()))
    page = page_template(__package__, "benchmark.html").render(sets=index)
    return files | {"index.html": page}


def _asked(data: str, part: str, fresh: bool, frame: pd.DataFrame) -> Asked:
    ranked = frame[frame["kind"] == RANKED].reset_index(drop=True)
    # Where no row is compared, such as the fixed ones alone, all are listed.
    asked = Runs(ranked if len(ranked) else frame, AXES)
    # A seed of one sensor, or of one case, is no unit of the others' scenarios.
    by_seed = frame.groupby("seed")
    within = [name for name in AXES[1:-1] if by_seed[name].nunique().max() > 1]
    parts = {"compare": "tracker", "within": within, "over": "seed"}
    known = [name for name in SHOWN if name in asked.metrics]
    answers = [asked.ask(metric=name, better=BETTER.get(name), **parts) for name in known]
    beside = [name for name in frame["tracker"].unique() if name not in {*asked.frame["tracker"]}]
    remarks = [f"Not compared, in “All runs” only: {listed(beside)}."] * bool(beside) + [_COLUMNS]
    title = f"Benchmark 1.0, {part_in_words({*frame['folder']}, part, fresh)}, data {data}"
    return Asked(title, Runs(frame.drop(columns="part"), AXES), answers, remarks)


def part_in_words(names: Collection[str], part: str, fresh: bool = False) -> str:
    """What a set of sequences is of a part: all of it has its name."""
    whole, mini = (
        {one.name for one in of}
        for of in (sequences.sequences(part), sequences.whole_set(mini=True))
    )
    if fresh:
        return f"fresh seeds of {part}, drawn by a pack"
    if names == mini:
        return f"mini: seeds {listed(sequences.definitions()['mini_seeds'])} of {part}"
    if names == whole:
        return f"part {part}"
    return f"some sequences of {part}" if names <= whole else f"other seeds than those of {part}"


NOTES = ("A pack does not say which points a tracker used, nor its NIS: here it used them all.",)


def playback_pages(packs: Sequence[Path], data: Data) -> Iterator[tuple[str, str]]:
    """The file name and the page of each sequence; UserError for a pack that is refused."""
    read = [read_pack(file, data) for file in packs]
    for name, run in zip(data.names, planned(map(named, data.names), {}), strict=True):
        given, results = data.read(name), []
        for manifest, tracks in read:
            track, scores, _ = scored_track(tracks[name], given, first_scored(manifest))
            tracker = manifest["tracker"]["name"]
            # The noise that a tracker assumed is not known: the page shows that of the scan.
            configuration = replace(run.composition.configuration, tracker=None)
            results.append(
                RunResult(
                    settings=run.composition.resolved,
                    manifest={"choices": run.composition.choices | {"tracker": tracker}},
                    metrics=scores.metrics,
                    composition=replace(run.composition, configuration=configuration),
                    scenario=given.truth,
                    scans=given.scans,
                    track=track,
                    scores=scores,
                    label=tracker,
                )
            )
        yield f"{name}.html", playback_html(results, name, NOTES)
