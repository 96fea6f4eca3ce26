"""Playback pages of packs: the tracks of all of them on one sequence, scan by scan."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from stixel_cli.benchmark.data import Data
from stixel_cli.benchmark.packs import first_scored, read_pack
from stixel_cli.benchmark.score import scored_track
from stixel_cli.benchmark.sequences import named, planned
from stixel_cli.report.playback import playback_html
from stixel_cli.results.result import RunResult

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
