"""The shipped studies: every question can be asked of the runs that its sweeps will have."""

import itertools
import runpy
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from stixel_cli.answers.runs import Runs
from stixel_cli.config.compose import compose
from stixel_cli.config.folders import STUDIES, shipped_folder
from stixel_cli.config.texts import override_text, split_override
from stixel_cli.evaluation.metric_table import MAIN
from stixel_cli.evaluation.metric_table import METRICS as KNOWN
from stixel_cli.results.result import GROUPS
from stixel_cli.scene.mesh_file import load_mesh
from stixel_cli.studies import robustness, rq1, rq3
from stixel_cli.studies.file import read_study
from stixel_cli.studies.report import answer_text, asked, frame_of, rows_of, with_columns
from stixel_cli.sweeps.design import find_file

MESHES = sorted((shipped_folder("pipelines") / "studies" / "meshes").glob("*/*.obj"))
TABLES = "/data/{}/scans.csv"
TRACKS = {"path.target": [3, 8], "seed": [0, 1]}
NOISES = {"road_user": ["car"] * 3 + ["cyclist"] * 3 + ["pedestrian"] * 3}
NOISES |= {"path": ["turn", "crossing", "approach"] * 3}
NOISES |= {"measurement.noise.range_bias": [0.1 * i for i in range(9)]}
CARS = {"road_user": ["car"] * 2, "measurement.path": [*map(TABLES.format, ("car-a", "car-b"))]}
DATA = {
    "pandaset": CARS,
    "lidarrm": {"measurement.path": [*map(TABLES.format, ("default-0", "default-1"))]},
    "clip": {"source.target": [31, 0, 1]},
    "every_track": TRACKS,
    "some_tracks": TRACKS,
    "fitted_noise": NOISES,
}
"""Axes that depend on the user's data, or on results."""


@cache
def study_of(name):
    return read_study(find_file(name, study=True))


@cache
def runs_of(name, number, seeds=2):
    """Runs of a study's sweep, with few seeds and random metrics, without computing one."""
    study = study_of(name)
    sweep = study.sweeps[number]
    name = sweep.derive or sweep.axes_of
    further = [DATA[name]] if name in DATA else study.further_axes(sweep.axes_of)
    design = sweep.design(further)
    fixed = dict(split_override(one.text) for one in design.fixed)
    rows = []
    for steps in itertools.product(*(axis.steps for axis in design.axes)):
        setting = dict(split_override(one.text) for step in steps for one in step)
        if "seed" in fixed or int(setting.get("seed", 0)) % 1000 < seeds:
            groups = {group: (fixed | setting).get(group, f"the {group}") for group in GROUPS}
            rows.append({**setting, **groups, "variant": sweep.variant_of(setting)})
    frame = pd.DataFrame(rows)
    axes = [key for axis in design.axes for key in axis.keys]
    varied = {key for own in sweep.variants.values() for key in own} - {*GROUPS}
    axes = [axis for axis in axes if axis not in varied]
    frame = frame[list(dict.fromkeys([*axes, *GROUPS, "variant"]))].assign(status="done")
    rng = np.random.default_rng(0)
    values = {one: rng.uniform(size=len(frame)) for one in (*MAIN, "nees_position_mean")}
    return Runs(frame.assign(**values), (*axes, *(["variant"] if sweep.variants else [])))


def with_module(study, sweep, seeds=2):
    """Its runs with the columns of the study's module, as far as they need no results."""
    runs = runs_of(study.name, study.sweeps.index(sweep), seeds)
    if study.module is robustness:
        return robustness.columns(sweep.name, runs, [None] * len(runs))
    if study.name == "motions":
        axes = [axis for axis in runs.axes if not axis.startswith("path")]
        axes = [axis for axis in axes if axis != "seed" or sweep.name == "hand_made"]
        motion = runs.frame["path"] + runs.frame.get("path.target", pd.Series("", runs.frame.index))
        return with_columns(Runs(runs.frame, tuple(axes)), motion=motion)
    if study.module is rq1 and "stage_errors" in sweep.results:
        metrics = rq1.stage_metrics(*EMPTY)
        each = [{"range": f"{a:g}–{b:g} m", **dict.fromkeys(metrics, 0.5)} for a, b in rq1.RANGES]
        return rows_of(runs, [each] * len(runs), ("range",))
    if study.module is rq3:
        axes = tuple(axis for axis in runs.axes if not axis.startswith("measurement"))
        return with_columns(Runs(runs.frame, axes), **dict.fromkeys(rq3.POINTS.values(), 0.5))
    return runs


def columns_of(*names):
    return pd.DataFrame({name: np.zeros(0) for name in names})


FRAME = columns_of("valid", "pixels", "gross", "total", "squares", "columns", "missed", "uncovered")
EMPTY = (FRAME, columns_of("disparity", "error", "square", "sigma", "lateral", "height"))


@pytest.mark.parametrize("name", STUDIES)
def test_every_question_compares_options_that_are_balanced(name, monkeypatch):
    monkeypatch.setattr(robustness, "_found_again", lambda run: 1.0)
    study = study_of(name)
    frames = {sweep.name: with_module(study, sweep) for sweep in study.sweeps}
    asked_of = set()
    for question in study.questions:
        columns = {column for sweep in question.sweeps for column in frames[sweep].frame}
        assert {*question.metrics} <= {*KNOWN, *columns}
        section = asked(replace(question, metrics=question.metrics[:1]), frames)
        assert section.groups, question.name
        for label, answers in section.groups:
            assert answers[0].values.shape[1] > 1, (question.name, label)
            assert answers[0].units > 0 and not answers[0].left_out, (question.name, label)
        if question.reference is not None:
            assert all(own[0].question.reference for _, own in section.groups), question.name
        asked_of |= set(question.sweeps)
    unasked = {sweep.name for sweep in study.sweeps} - asked_of
    assert unasked <= {"training", "gallery", "pictures"}


def test_of_a_sweep_with_variants_only_their_own_keys_are_no_axes():
    frame = pd.DataFrame({"tracker.slip": [0.1, 0.1, 0.2, 0.2], "measurement.path": ["a", "b"] * 2})
    frame = frame.assign(**dict.fromkeys(GROUPS, "one"), seed=0, status="done")
    runs = [SimpleNamespace(variant=name) for name in ("–", "–", "slip", "slip")]
    table = Runs(frame, ("tracker.slip", "measurement.path", "seed"))
    sweep = SimpleNamespace(table=table, runs=runs)
    assert frame_of(sweep).axes == ("measurement.path", "seed", "variant")


@pytest.mark.parametrize("name", STUDIES)
def test_the_first_paragraph_has_sixty_words_at_most(name):
    study = study_of(name)
    first = study.text.partition("\n\n")[0]
    questions = [one for one in study.questions if f"{{{one.name}}}" in first]
    sweeps = [one for one in study.sweeps if any(one.name in own.sweeps for own in questions)]
    made = {sweep.name: with_module(study, sweep, 5) for sweep in sweeps}
    (text,) = answer_text(first, [asked(one, made) for one in questions])
    assert len(text.split()) <= 60, text


@pytest.mark.parametrize(
    ("study", "name", "terms", "plain"),
    [
        ("accuracy", "ablation", 7, ["road_user=cyclist", "measurement=lidar_64"]),
        ("robustness_real", "terms", 6, ["experiment=pandaset", "road_user=cyclist"]),
    ],
)
def test_each_variant_of_the_ablation_switches_one_term_off(study, name, terms, plain):
    (sweep,) = [one for one in study_of(study).sweeps if one.name == name]
    (axis,) = [axis for axis in sweep.design().axes if len(axis.keys) > 1]
    steps = [tuple(one.text for one in step) for step in axis.steps]
    variants = [own.items() for own in sweep.variants.values()]
    texts = [tuple(override_text(*item) for item in own) for own in variants]
    assert texts == steps
    whole, *others = map(set, texts)
    changed = [tuple(text.partition("=")[0] for text in own - whole) for own in others]
    assert len(changed) == len(set(changed)) == terms
    assert {key for keys in changed for key in keys} == set(axis.keys)
    # The first is the tracker as it is.
    plain = [*plain, "tracker=contour"]
    assert compose([*plain, *steps[0]]).configuration == compose(plain).configuration


def test_each_sweep_of_rq1_changes_one_setting():
    sweeps = {sweep.name: sweep for sweep in study_of("rq1").sweeps}
    approach = sweeps["ranges"].content["fixed"]
    del sweeps["widths"]
    for sweep in sweeps.values():
        fixed = dict(sweep.content["fixed"])
        fixed.pop("pictures.frames", None)
        assert fixed == approach, sweep.name
        own = [key for key in sweep.content["axes"] if key != "road_user"]
        assert len(own) + len(sweep.content.get("zipped") or []) <= 1, sweep.name
    frames = round(approach["path.duration"] / approach["path.sample_time"])
    last = approach["path.start"][1] - (frames - 1) * approach["path.sample_time"] * 5.0
    assert approach["path.start"][1] > 50.0 and last <= 5.3


def test_shipped_presets_name_their_origin():
    for user in ("car", "cyclist", "pedestrian"):
        path = shipped_folder("conf") / "measurement" / "noise" / f"fitted_{user}.yaml"
        text = path.read_text("utf-8")
        assert "stixel study rq3" in text and user in text.splitlines()[1]


def test_the_held_out_meshes_are_those_that_the_script_makes(tmp_path, monkeypatch):
    script = runpy.run_path(str(MESHES[0].parents[4] / "docs" / "held_out_meshes.py"))
    monkeypatch.setitem(script["main"].__globals__, "FOLDER", tmp_path)
    script["main"]()
    made = {str(f.relative_to(tmp_path)): f.read_bytes() for f in tmp_path.glob("*/*/*.obj")}
    assert {file.parent.name for file in MESHES} == {"car", "cyclist", "pedestrian"}
    studies = shipped_folder("pipelines") / "studies"
    files = [*MESHES, *studies.glob("shapes/*/*.obj"), *studies.glob("odd/*/*.obj")]
    root = MESHES[0].parents[2]
    assert made == {str(file.relative_to(root)): file.read_bytes() for file in files}
    for file in files:
        assert len(load_mesh(str(file), 0.6)) >= 1


@pytest.mark.parametrize(
    ("kept", "said", "unsaid"),
    [
        # stixel study rq3 road_user=car path=turn 'seed=range(0,5)'
        ({"path": ["turn"]}, "too few to compare, 4 are needed", "path"),
        ({"road_user": ["car"]}, "each the mean of 3 scenarios", "pedestrian"),
        ({"seed": ["0"]}, "too few to compare, 4 are needed", "2 seeds"),
        ({"path": ["turn"], "road_user": ["car"], "seed": ["0"]}, "too few to compare", "cyclist"),
    ],
)
def test_the_text_of_rq3_is_right_of_few_runs(kept, said, unsaid):
    study = study_of("rq3")
    frames = {}
    for sweep in study.sweeps:
        runs = with_module(study, sweep)
        # A training sweep has seeds of its own.
        mine = sweep.name != "training"
        wanted = {key: values for key, values in kept.items() if mine or key != "seed"}
        frame = runs.frame
        for column, values in wanted.items():
            frame = frame[frame[column].astype(str).isin(values)]
        frames[sweep.name] = Runs(frame.reset_index(drop=True), runs.axes)
    text = answer_text(study.text, [asked(question, frames) for question in study.questions])[0]
    assert said in text and unsaid not in text
    # Nothing that one unit cannot say: no ratio, no quartile, no interval, no missing number.
    assert not any(word in text for word in ("nan", "ratio", "quartile", "[", "{", "–"))
    incomplete = {name: Runs(own.frame.iloc[:-1], own.axes) for name, own in frames.items()}
    sections = [asked(question, incomplete) for question in study.questions]
    assert "{" not in " ".join(answer_text(study.text, sections))
