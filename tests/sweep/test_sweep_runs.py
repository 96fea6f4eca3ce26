"""From overrides and files to runs: the grammar, and what is refused."""

import pytest
from refusals import refused
from runs_of import sweep_runs

from stixel_cli.config.compose import compose
from stixel_cli.config.folders import group_options
from stixel_cli.errors import ConfigurationError
from stixel_cli.sweeps.graphs import check_axes, plan_runs

USERS = group_options()["road_user"]
FABRICATED = "measurement=fabricated"
FEW = (FABRICATED, "path.duration=0.3")


def labels(*overrides, **options):
    return [run.label for run in sweep_runs(overrides, **options)]


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("seed=0,1,2", ["seed=0", "seed=1", "seed=2"]),
        ("seed=choice(3,1)", ["seed=3", "seed=1"]),
        ("seed=range(3)", ["seed=0", "seed=1", "seed=2"]),
        ("seed=range(4,0,-2)", ["seed=4", "seed=2"]),
        ("tracker.sigma_f=range(0.1,0.4,0.1)", [f"tracker.sigma_f=0.{i}" for i in (1, 2, 3)]),
        ("road_user=glob(*)", [f"road_user={one}" for one in USERS]),
        ("road_user=glob(*,exclude=car)", [f"road_user={one}" for one in USERS if one != "car"]),
        ("path=glob([t*,c*])", ["path=circle", "path=crossing", "path=turn"]),
        ("rig=kitti,default", ["rig=kitti", "rig=default"]),
        ("++seed=1,2", ["seed=1", "seed=2"]),
        ("pictures.frames=null,[0,1]", ["pictures.frames=null", "pictures.frames=[0,1]"]),
        ("tracker.sigma_f=sort(0.3,0.1)", ["tracker.sigma_f=0.1", "tracker.sigma_f=0.3"]),
    ],
)
def test_the_sweep_grammar(override, expected):
    assert labels(override) == expected


def test_a_group_within_another_is_swept_in_any_order_of_the_options(tmp_path):
    swept = "measurement/noise=stereo,constant"
    assert labels(FABRICATED, swept) == ["measurement/noise=stereo", "measurement/noise=constant"]
    file = tmp_path / "study.yaml"
    for text, overrides, count in (
        ("fixed: {measurement: fabricated}", [swept], 2),
        ("fixed: {measurement: fabricated}\nseeds: 2", ["measurement/noise=constant"], 2),
        ("axes: {measurement/noise: [stereo, constant]}", [FABRICATED], 2),
        ("axes:\n  measurement/noise: glob(fitted_*)", [FABRICATED], 3),
        (
            "fixed: {measurement: fabricated}\n"
            "zipped: [{road_user: [car], measurement/noise: [fitted_car]}]",
            ["seed=0,1"],
            2,
        ),
    ):
        file.write_text(text, encoding="utf-8")
        assert len(labels(*overrides, file=str(file))) == count, text


def test_all_combinations_with_the_seed_running_fastest():
    runs = sweep_runs(["seed=0,1", FABRICATED, "path=turn,circle"])
    paths = ("turn", "turn", "circle", "circle")
    assert [run.label for run in runs] == [f"path={p} seed={i % 2}" for i, p in enumerate(paths)]
    for index, run in enumerate(runs):
        assert run.index == index
        assert run.composition == compose(run.overrides)
    assert runs[1].setting == {"path": "turn"}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (["seed=0,1,0"], "runs 0 and 2 are equal: seed=0 and seed=0 give the same configuration"),
        (["tracker.sigma_f=0.1,0.10"], "give the same configuration"),
        (["seed=1"], "nothing to sweep"),
        ([], "nothing to sweep"),
        (["path=glob(x*)"], "must have 1 to 100000 values (options: approach"),
        (["seed=glob(*)"], "glob is for options of a group"),
        (["tracker.sigma_f=range(0,1,0)"], "the step must not be 0"),
        (["seed=range(1000000000)"], "must have 1 to 100000 values"),
        (["seed=range(1000)", "tracker.sigma_q=range(1,2,0.001)"], "would have 1000000 runs"),
        (["path=turn,trun"], "did you mean path=turn?"),
        (["seed=0,-1"], "out of range: must be ≥ 0 and ≤ 9223372036854775807 (run 1: seed=-1)"),
        (["path=turn,approach", "path.radius=5,-6"], "(run 1: path=turn path.radius=-6)"),
        (["+path.radius=5,6"], "no key can be added or removed: leave out the +"),
        (["road_user=glob()"], "with a value beside each comma and in brackets"),
        (["seed=1,"], "cannot be read: brackets and quotes must match, with a value beside"),
        (["rig.width=640,640,'${rig.height}'"], "runs 0 and 1 are equal: rig.width=640 and"),
        (["rig.width='${rig.height}',480"], "give the same configuration"),
        (["hydra.job.name=a,b"], "no effect here"),
        (["measurement/noise=stereo,constant"], "with measurement=stixels; it belongs to"),
        (["measurement=fabricated,stixels", "measurement/noise=stereo"], "(run 1: "),
        (["road_user=choice(car,cyclist),pedestrian"], "list the values, road_user=A,B,C"),
        (["seed=range(0,2),range(5,7)"], "nested sweeps are not supported"),
    ],
)
def test_an_invalid_line_is_refused(line, said):
    with refused(said, error=ConfigurationError):
        sweep_runs(line)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (["sensor.read_noise=0,1"], "sensor.read_noise: no stage reads it"),
        (["executor.workers=1,2"], "it does not affect results"),
        (["executor=local,threads", "seed=1,2"], "it does not affect results"),
        (["cache.max_size=null,1GB"], "it does not affect results"),
        (["pictures.frames=[0],[1]"], "only with --pictures"),
    ],
)
def test_an_axis_that_no_stage_reads_is_refused(line, said):
    planned = plan_runs(sweep_runs([FABRICATED, *line])).runs
    with pytest.raises(ConfigurationError) as error:
        check_axes(planned)
    assert said in str(error.value)


def test_runs_with_equal_results_are_noted():
    line = ["measurement=fabricated,stixels", "sensor.read_noise=0,1"]
    (note,) = check_axes(plan_runs(sweep_runs(line)).runs)
    assert "runs 0 and 1 give equal results: measurement=fabricated sensor.read_noise=0" in note
    assert check_axes(plan_runs(sweep_runs([FABRICATED, "seed=0,1"])).runs) == []
    pictured = plan_runs(sweep_runs([FABRICATED, "pictures.frames=[0],[1]"]), pictures=True).runs
    assert check_axes(pictured) == []


FILE = """
fixed: {measurement: fabricated, path.duration: 0.5}
axes:
  tracker.sigma_f: [0.1, 1e-1, 0.3]
  tracker.length_scale: range(0.2,0.5,0.1)
zipped:
  - road_user: [car, cyclist]
    path: [turn, crossing]
seeds: 2
leave_out:
  - {road_user: cyclist, tracker.sigma_f: 0.3}
  - {seed: 1, tracker.length_scale: 0.2}
""".replace("0.1, 1e-1, ", "1e-1, ")


def test_a_file_names_axes_seeds_zipped_axes_and_left_out_runs(tmp_path):
    file = tmp_path / "study.yaml"
    file.write_text(FILE, encoding="utf-8")
    runs = sweep_runs(["start.position=0.2"], file=str(file))
    settings = [run.setting | {"seed": str(run.seed)} for run in runs]
    assert len(settings) == 2 * 3 * 2 * 2 - 3 * 2 - 1 * 3
    zipped = {(s["road_user"], s["path"]) for s in settings}
    assert zipped == {("car", "turn"), ("cyclist", "crossing")}
    assert not any(s["road_user"] == "cyclist" and s["tracker.sigma_f"] == "0.3" for s in settings)
    assert not any(s["seed"] == "1" and s["tracker.length_scale"] == "0.2" for s in settings)
    assert all(p.composition.configuration.start.position == 0.2 for p in runs)
    assert all(p.composition.configuration.path.duration == 0.5 for p in runs)
    assert len(sweep_runs([], file="prior_width")) == 3 * 3 * 3 * 5 - 3 * 5


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("axes: {seed: 3}", "study.yaml: axes: seed: 3 is one value: write a list"),
        ("axes: {seed: []}", "study.yaml: axes: seed has no values"),
        ("axes:\n  seed: range(2,2)", "seed=range(2,2): must have 1 to 100000 values"),
        ("axes: {sede: [1, 2]}", "did you mean seed?"),
        ("axes: {seed: [1, 2]}\nseeds: 3", "seed: is given twice"),
        ("axes: {seed: [1, 2]}\naxes: {path: [turn, circle]}", "line 2: axes: is given twice"),
        ("axis: {seed: [1, 2]}", "axis: is unknown; did you mean axes?"),
        ("axes: [seed]", "axes: must be an object"),
        ("axes:\n  tracker.sigma_f: interval(0.1,1)", "STEP"),
        ("fixed: {seed: '0,1'}\naxes: {path: [turn, circle]}", "'0,1' is text"),
        ("fixed: {path: [turn]}\nseeds: 2", "one option is needed"),
        ("seeds: 0", "seeds: must be a number from 1 to 100000 or a list, got 0"),
        ("seeds: a", "'a' is one value"),
        ("zipped: [{seed: [1, 2]}]", "zipped.0: "),
        ("zipped: {seed: [1, 2]}", "zipped: must be a"),
        ("zipped: [{seed: [1, 2], path: [turn]}]", "need the same number of values: seed 2"),
        ("zipped: [{seed: [1, 1], path: [turn, turn]}]", "runs 0 and 1 are equal: seed=1 path="),
        ("seeds: 2\nleave_out: [{path: turn}]", "path is not on any axis"),
        ("seeds: 2\nleave_out: [{seed: 7}]", "study.yaml: leave_out: no run has seed=7"),
        ("seeds: 2\nleave_out: [{seed: 0}, {seed: 1}]", "leave_out: every run is left out"),
        ("seeds: 2\nleave_out: [seed]", "leave_out.0: must be an object"),
        ("- 1", "must map names to values, not be a list"),
        ("", "nothing to sweep"),
        ("axes: {seed: [1, 2", "did not find expected"),
        ("seeds: 2\nfixed: {rig.width: wide}", "rig.width: 'wide' is text"),
        ("\t", "line 1"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path, text, said):
    file = tmp_path / "study.yaml"
    file.write_text(text, encoding="utf-8")
    with refused(said):
        sweep_runs([], file=str(file))


def test_a_key_in_the_file_and_on_the_line_is_refused(tmp_path):
    file = tmp_path / "study.yaml"
    file.write_text("fixed: {path.duration: 1}\nseeds: 2", encoding="utf-8")
    for again in ("seed=3", "seed=1,2", "path.duration=2"):
        with pytest.raises(ConfigurationError, match=r"is given twice, .*, in .*study.yaml or on"):
            sweep_runs([again], file=str(file))


@pytest.mark.parametrize("name", ["nowhere.yaml", "prior_widht", "", "a\nb"])
def test_no_such_file(name):
    # A study is no sweep: it is not offered.
    with refused("no such file", match="^(?!.*rq1)", error=ConfigurationError):
        sweep_runs([], file=name)


def test_a_key_that_some_swept_options_lack_has_no_value_there_and_of_none_is_refused(sweeps):
    runs = sweep_runs(["tracker=gp_ekf,point", "tracker.basis_points=9"])
    trackers = [one.composition.configuration.tracker for one in runs]
    basis_points = [getattr(one, "basis_points", None) for one in trackers]
    assert basis_points == [9, None]
    with pytest.raises(ConfigurationError, match=r"^tracker\.basis_points: unknown key"):
        sweep_runs(["tracker=box,point", "tracker.basis_points=9"])
    line = ("tracker=gp_ekf,point", "tracker.length_scale=0.2,0.4", "seed=0,1", *FEW)
    swept = sweeps.run(*line, "--name", "mine")
    key = "tracker.length_scale"
    named = [(run["tracker"], run.get(key), run["seed"]) for run in swept["runs"]]
    once = [("gp_ekf", 0.2), ("gp_ekf", 0.4), ("point", "–")]
    assert named == [(*point, seed) for point in once for seed in (0, 1)]
    assert [row["run"] for row in swept["runs"]] == [*range(6)]
    assert len({row[f"tracker {key}"] for row in swept["summary"]}) == 3
    assert sweeps.run("--resume", sweeps.results / "mine")["nodes"]["computed"] == 0
