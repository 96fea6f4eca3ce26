"""The table of all rows, as a page, CSV and Markdown: means over scenes, intervals, ranks.

A scene is a class, a case and a seed: its sequences of several sensors share road user, path and
start, so its value is their mean. Cases of classes are strata.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import rankdata

from stixel_cli.benchmark import score
from stixel_cli.benchmark.sequences import FROZEN, named
from stixel_cli.report import intervals
from stixel_cli.report.blocks import Cell, Table
from stixel_cli.report.page import page_template, table_for_page
from stixel_cli.report.statistics import Statistic
from stixel_cli.report.tables import ends, label_of, table_csv, table_markdown

IOU, REFERENCE, ALL = "iou_mean", "gp_ekf", ("all sensors", "all classes")
SCENE = ["road_user", "case", "seed"]
LABELS = {name: label_of(name) for name in score.METRICS}
LABELS |= {score.CONSISTENT: "in the NEES band", score.MISSING: "missing scans"}
LABELS |= {score.TIME: "ms a scan"}

DRAWN = (LABELS[IOU], LABELS[score.TIME], LABELS[score.CONSISTENT])
"""Columns of the figures: the first against each of the others."""


def score_frame(rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """One line for each row and sequence, with all scores."""
    frames = []
    for i, row in enumerate(rows):
        frame = pd.DataFrame([vars(named(name)) for name in row["sequences"]])
        values = {name: np.array(column, float) for name, column in row["scores"].items()}
        frames.append(frame.assign(row=i, **values))
    return pd.concat(frames, ignore_index=True)


def kind_of(row: Mapping[str, Any]) -> str:
    """`ranked`, or what keeps a row out of the ranking."""
    if row["tier"] == score.FIXED:
        return score.FIXED
    about = row["tracker"]
    notes = ["not causal"] * (not about["causal"]) + ["per class"] * about["per_class"]
    return ", ".join(notes + ["own start"] * (about["start"] == "own")) or "ranked"


def estimate(values: pd.Series, bounds: tuple = (None, None)) -> Statistic:
    """Mean and 95 % interval of values of scenes, whose index is `SCENE`; without those missing."""
    known = values.dropna()
    if known.empty:
        return Statistic()
    mean, parts = float(known.mean()), intervals.stratified_parts(known.to_numpy(), strata(known))
    return Statistic(mean, *intervals.combined_interval(mean, parts, bounds), len(known))


def strata(scenes: pd.Series | pd.DataFrame) -> list[str]:
    """The stratum of each scene: its class and case; one for all if any has a single scene."""
    found = [f"{user} {case}" for user, case, _ in scenes.index]
    return found if min(Counter(found).values()) > 1 else [""] * len(found)


def table_rows(rows: Sequence[Mapping[str, Any]], frame: pd.DataFrame) -> Iterator[dict[str, Cell]]:
    """The lines of the table: each row, over all sequences of a `frame`, each sensor and class."""
    frame = frame.assign(**{name: name for name in ALL})
    kinds = [kind_of(row) for row in rows]
    for sensors in (ALL[0], "sensor"):
        for classes in (ALL[1], "road_user"):
            for (sensor, road_user), own in frame.groupby([sensors, classes], sort=False):
                means = own.groupby(["row", *SCENE]).mean(numeric_only=True)
                ious = means[IOU].unstack("row")
                ranks = _ranks(ious[[i for i in ious if kinds[i] == "ranked"]])
                named_so = [i for i in ranks if rows[i]["tracker"]["name"] == REFERENCE]
                references = {rows[i]["benchmark"]: i for i in reversed(named_so)}
                for i in sorted(ious, key=lambda i: -ious[i].mean()):
                    about, data = rows[i]["tracker"], rows[i]["benchmark"]
                    apart = ious[i] - ious[references.get(data, (named_so or [i])[0])]
                    line = {"tracker": about["name"], "version": about["version"][:14]}
                    line |= {"tier": rows[i]["tier"], "kind": kinds[i], "data": data[:8]}
                    line |= {"sensor": sensor, "class": road_user, "scenes": len(ious)}
                    line |= ends(LABELS[IOU], estimate(ious[i], (0.0, 1.0)))
                    line |= ends("rank", ranks.get(i))
                    line |= ends(f"IoU minus {REFERENCE}", estimate(apart) if named_so else None)
                    of_row = means.loc[i].mean()
                    for name, label in list(LABELS.items())[1:]:
                        value = of_row.get(name, np.nan)
                        line[label] = None if np.isnan(value) else float(value)
                    yield line


def _ranks(ious: pd.DataFrame) -> dict[int, Statistic]:
    """The rank of each column of IoUs of scenes (n, rows), with its bootstrap interval."""
    if ious.empty:
        return {}
    weights = intervals.bootstrap_weights(strata(ious), "bench")
    drawn = rankdata(-(weights @ ious.to_numpy()), axis=1, method="min")
    ranks = rankdata(-ious.mean().to_numpy(), method="min")
    return {
        row: Statistic(int(ranks[j]), *map(round, intervals.bootstrap_interval(drawn[:, j])))
        for j, row in enumerate(ious)
    }


def fresh_gaps(rows: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Cell]]:
    """Mean IoU on frozen minus that on fresh sequences, by tracker, with Welch's interval."""
    packs = {row["pack"]: row for row in rows if "pack" in row}
    for row in (row for row in rows if row.get("fresh_of") in packs):
        both = score_frame([packs[row["fresh_of"]], row])
        sensors = both.loc[both["row"] == 1, "sensor"].unique()
        same = (both["part"] == FROZEN) & both["sensor"].isin(sensors)
        both = both[same].groupby(["row", *SCENE])[IOU].mean()
        sides = both[0], both[1]
        frozen, fresh = (float(side.mean()) for side in sides)
        parts = [(float(side.var()) / len(side), len(side) - 1) for side in sides]
        gap = frozen - fresh, *intervals.combined_interval(frozen - fresh, parts)
        line = {"tracker": row["tracker"]["name"], "frozen": frozen, "fresh": fresh}
        line["sensors"] = ", ".join(sensors)
        yield line | ends("frozen - fresh", Statistic(*gap))


def bench_page(rows: Sequence[Mapping[str, Any]], played: Collection[str] = ()) -> dict[str, str]:
    """The content of `index.html`, and of `ID.csv` and `ID.md` for each set of sequences.

    `played` are the SHA-256 of the packs whose sequences have a playback page, `SEQUENCE.html`.
    """
    files, sets = {}, []
    # Not by the id of the data: another processor renders the same sequences to other last bits.
    ranked = [row for row in rows if row["tier"] != score.FRESH]
    for names in dict.fromkeys(tuple(row["sequences"]) for row in ranked):
        own = [row for row in ranked if tuple(row["sequences"]) == names]
        listed, identity = own, own[0]["benchmark"]
        for part, frame in score_frame(own).groupby("part"):
            name = identity[:12] + f"-{part}" * (part != FROZEN)
            lines = list(table_rows(own, frame))
            whole = [line for line in lines if (line["sensor"], line["class"]) == ALL]
            files[f"{name}.csv"] = table_csv(Table.of(name, lines))
            files[f"{name}.md"] = table_markdown(Table.of(name, whole))
            points = [[line["tracker"], *(line[key] for key in DRAWN)] for line in whole]
            count = frame.groupby(["sensor", *SCENE]).ngroups
            sets.append((name, table_for_page(Table.of(name, lines)), points, listed, part, count))
            listed = []
    gaps = list(fresh_gaps(rows))
    gaps = table_for_page(Table.of("fresh", gaps)) if gaps else None
    page = page_template(__package__, "bench.html")
    return files | {"index.html": page.render(sets=sets, gaps=gaps, drawn=DRAWN, played=played)}
