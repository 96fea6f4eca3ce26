"""Pages of made runs."""

from dataclasses import replace

import pytest
from playback_runs import SCANS, make_run, with_objects, with_several_tracks

from stixel_cli.report.playback import playback_html


@pytest.fixture(scope="session")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    gp, point = make_run("gp_ekf"), make_run("point", seed=1, corners=24)
    blind = make_run("gp_ekf", with_camera=False)
    fewer = replace(blind, label="fewer", scans=without_last_points(blind.scans))
    for name, runs in (
        ("one", [gp]),
        ("two", [gp, point]),
        ("blind", [blind]),
        ("objects", [with_objects(gp)]),
        ("several", [with_several_tracks(gp)]),
        ("unlike", [gp, fewer]),
    ):
        (folder / f"{name}.html").write_text(playback_html(runs, name), encoding="utf-8")
    return folder


def without_last_points(scans):
    """The scans with the points of the last one gone."""
    rows = scans.rows(SCANS - 1)
    offsets = scans.offsets.copy()
    offsets[-1] = rows.start
    return replace(
        scans,
        offsets=offsets,
        points_world=scans.points_world[: rows.start],
        covariances_world=scans.covariances_world[: rows.start],
    )


@pytest.fixture
def one(open_page, pages):
    return open_page(pages / "one.html")
