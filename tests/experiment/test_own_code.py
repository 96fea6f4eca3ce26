"""Trackers, measurements and metrics of the user's own, through the real command line."""

import importlib.metadata
import json
import shutil

import numpy as np
import pytest
import yaml
from own_files import QUICK, THREADS
from own_files import own as own
from refusals import refused
from run_cli import run_json

from stixel_cli import compose, run
from stixel_cli.cli.app import main
from stixel_cli.cli.options import complete_override
from stixel_cli.config import folders
from stixel_cli.errors import ConfigurationError
from stixel_cli.experiment.stages import experiment_graph


def keys(*words):
    graph = experiment_graph(compose([*QUICK, *words]))
    return {name: nodes[0].key for name in graph.stages if (nodes := graph.of_stage(name))}


def test_a_dry_run_plans_what_a_sweep_computes_and_compares(own, told):
    # The parameters that the line leaves at their defaults are in the keys, too.
    line = [*QUICK, THREADS, f"tracker={own.name}:track", "tracker.alpha=0.25,0.5"]
    assert main(["sweep", *line, "--results", str(own.results)]) == 0
    assert json.loads(told("sweep", "--dry-run", "--json", *line))["nodes"]["to_run"] == 0
    words = [*QUICK, THREADS, f"tracker=point,{own.name}:track", "seed=0,1"]
    assert main(["sweep", "--results", str(own.results), "--name", "s", *words]) == 0
    table = (own.results / "s" / "summary.md").read_text()
    assert f"| {own.name}:track |" in table
    both = [*QUICK, THREADS, f"tracker={own.name}:track", "tracker.alpha=0.1,0.2"]
    assert main(["sweep", "--results", str(own.results), "--name", "t", *both]) == 0
    assert main(["sweep", "--results", str(own.results), *both, "tracker.beta=1"]) == 2


@pytest.mark.parametrize("executor", ["threads", "local"])
@pytest.mark.workers
def test_every_kind_of_worker_finds_the_module(executor, own, capsys):
    words = (f"tracker={own.name}:track", "tracker.alpha=0.25", f"executor={executor}")
    answer = run_json(capsys, own.results, *QUICK, *words, "executor.workers=1", "--name", "a")
    assert answer["metrics"]["scans"] == 3
    stored = yaml.safe_load((own.results / "a" / "config.yaml").read_text())
    expected = {"kind": "own", "function": f"{own.name}:track", "alpha": 0.25, "mode": "near"}
    assert stored["tracker"] == expected
    assert stored["code_folders"] == [str(own.folder)]
    manifest = json.loads((own.results / "a" / "manifest.json").read_text())
    assert manifest["choices"]["tracker"] == f"{own.name}:track"


def test_parameters_are_a_dataclass_or_plain_keys(own):
    for function, words in ((f"{own.name}:track", ["tracker.mode=far"]), (f"{own.name}:plain", [])):
        made = run([*QUICK, THREADS, f"tracker={function}", "tracker.alpha=0.2", *words])
        base = run([*QUICK, THREADS, f"tracker={function}", "tracker.alpha=0.4", *words])
        np.testing.assert_allclose(base.track.means[:, 0] - made.track.means[:, 0], 0.2)
        assert made.record["tracker.alpha"] == 0.2


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["track", "tracker.alpha=2"], "tracker.alpha: 2 is out of range: must be > 0 and ≤ 1"),
        (["track", "tracker.alpha=much"], "tracker.alpha: 'much' is text: must be a number > 0"),
        (["track", "tracker.mode=fa"], "tracker.mode: 'fa' is not known: must be one of near, far"),
        (["track", "tracker.beta=1"], "tracker.beta: 1: is unknown; it has alpha, mode"),
        (["plain", "tracker.beta=1"], "tracker.beta: unknown parameter; it has alpha"),
        (["plain", "tracker.alpha=high"], "tracker.alpha: 'high' is text: must be a number"),
        (["track", "tracker.kind=1"], "tracker.kind: the name is reserved"),
        (["nothing"], ".py has no function nothing"),
        (["Parameters.x"], "must be module:function"),
    ],
)
def test_wrong_parameters_and_names_are_one_line(words, fault, own):
    with refused(fault, error=ConfigurationError):
        compose([f"tracker={own.name}:{words[0]}", *words[1:]])


def test_modules_that_cannot_be_used_are_refused_in_one_line(own):
    (own.folder / "json.py").write_text("def track(): pass\n")
    (own.folder / "numba.py").write_text("def track(): pass\n")
    (own.folder / "broken_tracker.py").write_text("import numpy\n1 / 0\n")
    (own.folder / "odd_tracker.py").write_text("def track(:\n")
    for function, fault in (
        ("__main__:track", "a worker cannot import __main__"),
        ("absent_module:track", "no module absent_module found in"),
        (f"{own.name}.inner:track", f"no module {own.name}.inner found in"),
        ("json:track", "rename the file"),
        ("numba:track", "rename the file"),
        (f"{own.name}:scans", "has no function scans|is not a function"),
        ("broken_tracker:track", r"ZeroDivisionError.*broken_tracker.py, line 2: `1 / 0`"),
        ("odd_tracker:track", r"odd_tracker.py.* line 1"),
    ):
        with refused(match=fault):
            compose([f"tracker={function}"])


def test_the_code_of_all_modules_that_it_reaches_is_in_the_key(own):
    words = (f"tracker={own.name}:track",)
    before = keys(*words)
    helper = own.folder / f"{own.helper}.py"
    helper.write_text("# a comment\nOFFSET = 1.0\n")
    assert keys(*words) == before
    helper.write_text("OFFSET = 2.0\n")
    after = keys(*words)
    changed = {name for name in before if before[name] != after[name]}
    assert changed == {"track", "scores", "path_pictures", "error_pictures"}
    assert keys(*words, "tracker.alpha=0.3")["track"] != after["track"]
    assert keys("tracker=point") == keys("tracker=point")


def test_an_edit_and_another_folder_take_effect_in_the_same_process(own, tmp_path, monkeypatch):
    words = [*QUICK, THREADS, f"tracker={own.name}:track"]
    first = run(words)
    other = tmp_path / "other"
    shutil.copytree(own.folder, other, ignore=shutil.ignore_patterns("__pycache__"))
    (own.folder / f"{own.helper}.py").write_text("OFFSET = 3.0\n")
    edited = run(words)
    np.testing.assert_allclose(edited.track.means[:, 0] - first.track.means[:, 0], 1.0)
    # A module of the same name in another folder is another module.
    (other / f"{own.helper}.py").write_text("OFFSET = 5.0\n")
    monkeypatch.chdir(other)
    moved = run(words)
    np.testing.assert_allclose(moved.track.means[:, 0] - first.track.means[:, 0], 2.0)


def test_the_folders_name_is_not_in_the_key(own, tmp_path, monkeypatch):
    before = keys(f"tracker={own.name}:track")
    own.folder.rename(tmp_path / "moved")
    monkeypatch.chdir(tmp_path / "moved")
    assert keys(f"tracker={own.name}:track") == before


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["tracker={}:fails"], "np.zeros(3) + np.zeros(2)"),
        (["tracker={}:wrong"], "must return a Track, returned a dict"),
        (["tracker={}:short"], "nis of its track must have shape (3), got (1,)"),
        (["measurement={}:no_scans"], "must return Scans, returned a list"),
        (["measurement={}:no_view"], "must be a FieldOfView or None, got a tuple"),
        (["metrics=[{}:words]"], "must return a number, returned a str"),
    ],
)
def test_an_error_names_its_cause_and_the_users_line(words, fault, own, capsys, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(own.folder / "state"))
    words = [word.format(own.name) for word in words]
    base = [w for w in QUICK if not any(word.startswith(w.partition("=")[0]) for word in words)]
    assert main(["run", "--results", str(own.results), *base, THREADS, *words]) != 0
    last = capsys.readouterr().err.splitlines()[-1]
    assert fault in last
    if "fails" in words[0]:
        assert f"{own.name}.py, line " in last
    assert not own.results.exists()


@pytest.mark.sketched
def test_a_source_of_measurements_and_a_metric_of_ones_own(own, capsys):
    words = (f"measurement={own.name}:dots", "measurement.spread=0.2", "path.duration=0.4",
             f"metrics=[{own.name}:offset_m]", THREADS, "pictures.frames=[1]", "start=scans",
             "start.range=[5,60]", "prior=pedestrian")  # fmt: skip
    answer = run_json(capsys, own.results, *words)
    assert answer["metrics"]["points_per_scan_mean"] == 3.0
    assert abs(answer["metrics"]["offset_m"]) < 2.0
    again = run_json(capsys, own.results, *words, "--name", "again")
    assert {stage["status"] for stage in again["stages"]} == {"cached"}


@pytest.fixture
def stored(own, capsys):
    run_json(capsys, own.results, *QUICK, f"tracker={own.name}:track", THREADS, "--name", "run")
    words = [*QUICK, THREADS, f"tracker={own.name}:track", "seed=0,1"]
    assert main(["sweep", "--results", str(own.results), "--name", "sweep", *words]) == 0
    own.forget()
    return own


def test_commands_that_only_read_a_folder_import_nothing_from_it(stored, capsys):
    (stored.folder / f"{stored.helper}.py").write_text("OFFSET = 7.0\n")
    sweep = str(stored.results / "sweep")
    runs = [str(stored.results / "run"), f"{sweep}/runs/0001"]
    page = ["--output", str(stored.folder / "page.html")]
    reading = (["ls", str(stored.results)], ["ls", runs[0]], ["ls", *runs], ["ls", sweep])
    for words in (*reading, ["report", *runs, *page], ["explain", runs[0]], ["explain", sweep]):
        capsys.readouterr()
        assert main(words) == 0, capsys.readouterr().err
        assert stored.imports() == 0
        assert words[0] != "explain" or stored.helper in capsys.readouterr().out


@pytest.mark.parametrize(
    "command", ["run", "verify", "report --play", "export --format csv", "sweep --resume"]
)
def test_commands_that_compute_refuse_the_code_of_a_folder_unless_it_is_trusted(
    command, stored, tmp_path, monkeypatch, capsys, told
):
    monkeypatch.chdir(tmp_path)
    folder, line = computing(command, stored.results, tmp_path)
    # One from somebody else, at the place of one that was made here.
    changed = folder / ("sweep.yaml" if "sweep" in command else "lineage.json")
    changed.write_text(changed.read_text() + "\n")
    lines = told(*line, code=2).splitlines()
    assert len(lines) == 1
    assert f"{stored.name}:track" in lines[0]
    assert "review it, then add --trust-code" in lines[0]
    assert stored.imports() == 0
    assert main([*line, "--trust-code"]) == 0, capsys.readouterr().err
    assert stored.imports() > 0


def computing(command, results, output):
    """A folder and the command line that computes with it."""
    folder = results / ("sweep" if "sweep" in command else "run")
    line = [*command.split(), str(folder)]
    if command.startswith(("report", "export")):
        line += ["--output", str(output / "page.html")]
    return folder, line + (["--results", str(output / "new")] if command == "run" else [])


@pytest.mark.parametrize("command", ["run", "verify", "report --play", "sweep --resume"])
def test_a_folder_that_was_made_here_needs_no_trust_while_its_code_is_the_same(
    command, stored, tmp_path, monkeypatch, capsys, told
):
    monkeypatch.chdir(tmp_path)
    folder, line = computing(command, stored.results, tmp_path)
    assert main(line) == 0, capsys.readouterr().err
    assert "trust" not in capsys.readouterr().err
    (tmp_path / "page.html").unlink(missing_ok=True)
    if "sweep" not in command:
        (stored.folder / f"{stored.helper}.py").write_text("OFFSET = 7.0\n")
        imports = stored.imports()
        assert "--trust-code" in told(*line, code=2) and stored.imports() == imports
    # Elsewhere it is anybody's folder.
    there = folder.rename(folder.with_name("moved"))
    assert "--trust-code" in told(*[word.replace(str(folder), str(there)) for word in line], code=2)


def test_a_module_in_the_working_directory_is_proposed_as_a_tracker(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").touch()
    with pytest.raises(ConfigurationError, match=r"did you mean tracker=mine:track\?"):
        compose(["tracker=mine"])
    for wrong in ("tracker=other", "measurement=mine"):
        with pytest.raises(ConfigurationError) as refusal:
            compose([wrong])
        assert ":track" not in str(refusal.value)


def test_functions_of_installed_packages_are_options(own, monkeypatch, capsys):
    def points(group):
        names = {"stixel.trackers": "plain", "stixel.measurements": "dots"}
        function = f"{own.name}:{names.get(group, 'offset_m')}"
        return [importlib.metadata.EntryPoint("mine", function, group)]

    monkeypatch.setattr(importlib.metadata, "entry_points", points)
    folders.installed_functions.cache_clear()
    try:
        for name in ((), ("metrics",)):
            assert main(["describe", *name]) == 0
        assert capsys.readouterr().out.count("mine") == 3
        assert complete_override("tracker=mi") == ["tracker=mine"]
        assert complete_override("measurement=mi") == ["measurement=mine"]
        words = [*QUICK, THREADS, "tracker=mine", "tracker.alpha=0.1", "--name", "a"]
        answer = run_json(capsys, own.results, *words)
        assert answer["metrics"]["scans"] == 3
        composed = compose(["measurement=mine", "metrics=[mine]"]).resolved
        assert composed["measurement"]["function"] == f"{own.name}:dots"
        assert composed["metrics"] == [f"{own.name}:offset_m"]
        with pytest.raises(ConfigurationError, match="tracker: unknown option 'min'"):
            compose(["tracker=min"])
        with pytest.raises(ConfigurationError, match="'min': must be module:function"):
            compose(["metrics=[min]"])
    finally:
        folders.installed_functions.cache_clear()
