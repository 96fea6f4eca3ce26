"""Means, intervals and paired differences over any axes of a sweep."""

import csv

import numpy as np
import pytest
import yaml
from runs_of import run_of
from scipy.stats import ttest_1samp

from stixel_cli.cli.app import main
from stixel_cli.errors import ConfigurationError
from stixel_cli.sweeps.folder import SweepFolder
from stixel_cli.sweeps.over import marks, over_axes
from stixel_cli.sweeps.results import SweepResult

pytestmark = pytest.mark.usefixtures("no_workers")

FEW = ("measurement=fabricated", "path.duration=0.3")
AXES = (("tracker",), ("path",), ("road_user.shape_seed",), ("seed",))


def value_of(tracker, path, shape, seed):
    """An error that the path and the seed change much, and the tracker a little."""
    own = np.random.default_rng([path, shape, seed]).normal(0.0, 0.5)
    return 5.0 + 3.0 * path + own + 0.1 * tracker + 0.01 * (tracker * seed % 3)


def made(trackers=3, paths=2, shapes=1, seeds=5):
    runs = [
        run_of(
            {"tracker": f"t{t}", "path": f"p{p}", "road_user.shape_seed": str(s)},
            seed,
            {"centre_rmse_m": value_of(t, p, s, seed)},
        )
        for t in range(trackers)
        for p in range(paths)
        for s in range(shapes)
        for seed in range(seeds)
    ]
    return SweepResult(None, tuple(runs), axes=AXES)


def test_a_table_over_other_axes_than_the_seed():
    result = made()
    table = result.frame(over="seed,path").set_index("tracker")
    assert list(table.index) == ["t0", "t1", "t2"] and (table["n"] == 5).all()
    # A seed's value is its mean over the given paths: they add no variance.
    values = [np.mean([value_of(1, p, 0, seed) for p in range(2)]) for seed in range(5)]
    assert table["mean"]["t1"] == pytest.approx(np.mean(values))
    assert table["std"]["t1"] == pytest.approx(np.std(values, ddof=1))
    # Over the seed alone each path is a setting of its own; over all, there is one setting.
    assert len(result.frame(over=["seed"])) == 6
    assert len(result.frame(over=["seed", "path", "tracker"])) == 1
    # Without the seed among them, each seed is a setting.
    assert list(result.frame(over="path")["seed"].unique()) == ["0", "1", "2", "3", "4"]


def test_differences_from_the_best_are_paired():
    table = made().frame(over="seed,path").set_index("tracker")
    apart = [
        np.mean([value_of(1, p, 0, s) - value_of(0, p, 0, s) for p in range(2)]) for s in range(5)
    ]
    # Two comparisons with the best: 97.5 % each.
    ends = ttest_1samp(apart, 0.0).confidence_interval(0.975)
    row = table.loc["t1"]
    assert row["minus_best"] == pytest.approx(np.mean(apart))
    assert [row["minus_best_low"], row["minus_best_high"]] == pytest.approx([ends.low, ends.high])
    # The intervals of the means overlap; those of the differences do not contain 0.
    assert row["interval_low"] < table.loc["t0", "mean"] < row["interval_high"]
    assert table["mark"].to_list() == ["best", "", ""]


def test_the_best_is_marked_only_where_the_intervals_allow_it():
    def marked(*values):
        runs = [
            run_of({"a": str(i)}, seed, {"iou_mean": value})
            for i, of in enumerate(values)
            for seed, value in enumerate(of)
        ]
        return marks(SweepResult(None, tuple(runs)).behind["iou_mean"])

    steady, better = [0.5, 0.6, 0.5, 0.6], [0.7, 0.81, 0.7, 0.8]
    assert marked(steady, better) == {(("a", "1"),): "best"}
    assert marked(steady, [0.5, 0.7, 0.6, 0.4]) == {(("a", "0"),): "tied", (("a", "1"),): "tied"}
    assert marked(better, better, steady) == {(("a", "0"),): "tied", (("a", "1"),): "tied"}
    # Three runs of each tell nothing, and one setting has no rival.
    assert marked(steady[:3], better[:3]) == {} == marked(steady)


def test_crossed_shapes_and_seeds_give_a_wider_interval_than_as_many_runs():
    result = made(trackers=1, paths=1, shapes=4, seeds=5)
    over = result.frame(over="seed,road_user.shape_seed").iloc[0]
    assert over["n"] == 20
    values = [value_of(0, 0, s, seed) for s in range(4) for seed in range(5)]
    ends = ttest_1samp(values, 0.0).confidence_interval()
    assert over["interval_high"] - over["interval_low"] > ends.high - ends.low


def test_an_axis_is_named_by_one_of_its_keys():
    axes = (("rig", "path"), ("seed",))
    assert over_axes("path,seed", axes) == axes
    assert over_axes(["seed"], ()) == (("seed",),)
    with pytest.raises(ConfigurationError, match="over: tracker is not swept; swept: rig, path"):
        over_axes("seed,tracker", axes)


def test_a_sweep_over_paths_and_seeds_is_written_shown_and_resumed(sweeps, capsys):
    line = [*FEW, "path=turn,s_curve", "tracker.sigma_q=0.5,1", "seed=0,1"]
    swept = sweeps.run(*line, "--name", "mine", "--over", "seed,path")
    folder = sweeps.results / "mine"
    with (folder / "summary.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["metric"] == "iou_mean"]
    assert [row["n"] for row in rows] == ["2", "2"] and "path" not in rows[0]
    assert [r["n"] for r in swept["summary"] if r["metric"] == "iou_mean"] == [2, 2]
    assert {file.name for file in (folder / "figures").iterdir()} == {"tracker.sigma_q.png"}
    assert SweepFolder(folder).request().over == ("path", "seed")
    assert sweeps.run("--resume", folder)["summary"] == swept["summary"]
    # A folder of before has no such entry.
    content = yaml.safe_load((folder / "sweep.yaml").read_text())
    del content["over"]
    (folder / "sweep.yaml").write_text(yaml.safe_dump(content))
    assert main(["report", str(folder), "--output", str(sweeps.results / "a.html")]) == 0
    page = str(sweeps.results / "b.html")
    assert main(["report", str(folder), "--over", "seed,path", "--output", page]) == 0
    capsys.readouterr()
    assert main(["report", str(folder), "--over", "rig"]) == 2
    assert "over: rig is not swept; swept: path, tracker.sigma_q, seed" in capsys.readouterr().err
    assert "over: rig is not swept" in sweeps.refused(*line, "--over", "rig")
    assert "leave out --over" in sweeps.refused("--resume", folder, "--over", "seed")
