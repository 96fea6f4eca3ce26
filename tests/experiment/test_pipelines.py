"""How the stages are wired: what may see the truth, and what the table says of them."""

import ast
import inspect
import re
from dataclasses import replace
from functools import cache
from itertools import product
from pkgutil import resolve_name

import pytest

from stixel_cli.config.compose import compose
from stixel_cli.config.folders import group_options
from stixel_cli.engine.code import CodeIndex
from stixel_cli.engine.keys import GIVEN
from stixel_cli.experiment.stages import pipeline_stages
from stixel_cli.experiment.table import OWN, PICTURES, REPLAYED, TABLE
from stixel_cli.results.pictures import Pictures
from stixel_cli.tracking.gp_ekf import GpEkfParameters

TRUTH = {"scenario", "render"}
MAY_SEE_TRUTH = {"render", "add_sensor_noise", "start", "scores"}
MAY_SEE_TRUTH |= {"stage_errors", "point_errors"}


def pictured_frames(composition):
    return composition.configuration.pictures.frames_of(composition.scan_count)


@pytest.fixture(autouse=True, scope="module")
def scans_file(tmp_path_factory):
    """Scans, which `measurement=file` needs, and own functions in the working directory."""
    folder = tmp_path_factory.mktemp("files")
    (folder / "scans.csv").write_text("k,t,x,y\n0,0,0,9\n")
    own = "def scans(scenario, seed): ...\ndef f(a, b, c): ...\n"
    (folder / "own_functions.py").write_text(own)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield


@cache
def stages_of(measurement, *words):
    file = ["measurement.path=scans.csv"] if measurement == "file" else []
    composed = compose([f"measurement={measurement}", *file, *words])
    return {stage.name: stage for stage in pipeline_stages(composed)}


def test_past_the_images_or_returns_only_start_scores_and_pictures_see_the_truth():
    for stage in stages_of("stixels").values():
        if stage.name not in MAY_SEE_TRUTH and stage.name not in PICTURES:
            assert TRUTH.isdisjoint(stage.inputs.values()), stage.name
    stages = stages_of("lidar")
    assert stages["scans"].inputs == {"returns": "cast_lidar", "ego_motion": "ego_motion"}
    assert stages["cast_lidar"].seed is None
    assert set(stages["cast_lidar"].settings) == {"road_user", "world", "scanner", "camera_field"}


@pytest.mark.parametrize("measurement", group_options()["measurement"])
def test_neither_the_track_nor_a_start_from_scans_sees_truth_or_pictures(measurement):
    stages = stages_of(measurement)
    assert stages["track"].inputs == {"scans": "scans", "initial": "start"}
    for stage in stages.values():
        assert not any(source in PICTURES for source in stage.inputs.values())
    start = stages_of(measurement, "start=scans")["start"]
    assert start.inputs == {"scans": "scans"}
    assert set(start.settings) == {"start", "prior"}
    assert start.seed is None


def reached(function):
    """Modules that a stage's key holds, by its function."""
    return CodeIndex().code([function.partition(":")[0]]).modules.keys()


STAGES = TABLE | {f"own_{name}": definition for name, definition in OWN.items()}
STAGES |= {f"replayed_{name}": definition for name, definition in REPLAYED.items()}
FUNCTIONS = [function for stage in STAGES.values() for function in stage.functions.values()]


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_stage_reaches_neither_another_stage_nor_the_engine(function):
    own = function.partition(":")[0]
    holders = {other.partition(":")[0] for other in FUNCTIONS} - {own}
    if own == "stixel_cli.calibration.track_points":
        # It matches the few images that it needs, before the rig of the others is known.
        holders.remove("stixel_cli.stereo.matching")
    assert not holders & reached(function)
    frame = ("engine", "experiment", "config", "cli", "sweeps", "studies")
    above = tuple(f"stixel_cli.{folder}" for folder in frame)
    assert not [module for module in reached(function) if module.startswith(above)]


def test_each_stage_has_a_module_of_its_own_and_each_option_that_of_its_kind():
    # The parameters of Filament are in `rendering/parameters.py`.
    assert TABLE["render"].functions["filament"] == "stixel_cli.rendering.filament:render"
    assert TABLE["track"].functions["point"] == "stixel_cli.tracking.baselines.point:track"
    modules = [function.partition(":")[0] for function in FUNCTIONS]
    assert {module for module in modules if modules.count(module) > 1} == SHARED
    readers = [f for f in FUNCTIONS if "stixel_cli.tracking.gp_ekf" in reached(f)]
    assert readers == ["stixel_cli.tracking.gp_ekf:track"]
    assert GpEkfParameters.__module__ == "stixel_cli.tracking.gp_ekf"


SHARED = {f"stixel_cli.recordings.{name}" for name in ("stereo_images", "truth")}
SHARED |= {f"stixel_cli.pictures.{name}" for name in ("birds_eye", "camera", "over_time")}
SHARED |= {"stixel_cli.tracking.several"}
"""Of two stages or more each, which read the same files of a recording in the same way, draw alike,
or follow clusters."""


HIDDEN = re.compile(
    r"\b(?:import_module|__import__|importlib|sys\.modules|exec|eval|globals|resources|runpy"
    r"|open|opened|read_text|read_bytes|read_json|read_yaml|read_arrays|loadtxt|genfromtxt|fromfile|imread|Popen)\b\s*[(.\[]"
)
"""Ways to code and data that no import statement shows."""

READER = "stixel_cli.border.files"
"""The one reader of files: what calls it is looked at."""

DECLARED = {
    # The user's mesh and what it refers to: the stage's files, see `Definition.files`.
    "stixel_cli.scene.mesh_file": "files",
    # The files of a recording: the stage gets their names, and its key has their digests.
    "stixel_cli.recordings.image_files": "recorded",
    "stixel_cli.recordings.kitti_tables": "recorded",
    "stixel_cli.recordings.argoverse": "recorded",
    "stixel_cli.recordings.rosbag": "recorded",
    # The user's scans, sensor poses and truth: likewise.
    "stixel_cli.measurements.tables": "files",
    # The track of another program: likewise.
    "stixel_cli.tracking.file": "files",
    # The class and the outline of the prior: likewise.
    "stixel_cli.tracking.contour.user_shape": "files",
    # The user's own functions: their modules, see `Definition.code`.
    "stixel_cli.border.own_code": "code",
    "stixel_cli.border.origins": "code",
    # The child process runs filament_process, which the module imports; the files are its answers.
    "stixel_cli.rendering.filament": "stixel_cli.rendering.filament_process",
    "stixel_cli.rendering.filament_process": "stixel_cli.rendering.filament_process",
    # It loads a part of Open3D, which it also imports: the key has its version.
    "stixel_cli.scene.open3d_import": "stixel_cli.scene.open3d_import",
}


DECLARED_OF = {
    # Here it reads the results of a tracker, not those of a recording: `tracker.path`.
    ("stixel_cli.tracking.file:track", "stixel_cli.recordings.kitti_tables"): "files"
}
"""What declares the files of a module in one function, where that differs from `DECLARED`."""


INDEX = CodeIndex()


@cache
def hidden_lines(path):
    """Lines of a file that use code or data in a way that no import statement shows."""
    tree = ast.parse(path.read_text("utf-8"))
    return [n.lineno for n in ast.walk(tree) if HIDDEN.match(_spelled(n))]


@pytest.mark.parametrize("name", STAGES)
def test_what_imports_do_not_show_is_declared(name):
    definition = STAGES[name]
    for function in definition.functions.values():
        code = INDEX.code([function.partition(":")[0]])
        for module, (path, _) in code.files.items():
            if any(one.startswith(f"{module.partition('/')[0]}/") for one in code.modules):
                continue  # It declares its files.
            lines = hidden_lines(path)
            if not lines or module == READER:
                continue
            declared = DECLARED_OF.get((function, module), DECLARED.get(module))
            assert declared, f"{module}, lines {lines}: see CONTRIBUTING, what a key cannot see"
            assert declared in code.modules or getattr(definition, declared)


def _spelled(node):
    """The name of a call, an attribute or an item, as far as `HIDDEN` looks at it."""
    if isinstance(node, ast.Call):
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        return f"{name}("
    if isinstance(node, ast.Attribute | ast.Subscript):
        return ast.unparse(node) + ("." if isinstance(node, ast.Attribute) else "")
    if isinstance(node, ast.Import | ast.ImportFrom):
        names = [getattr(node, "module", None) or "", *(alias.name for alias in node.names)]
        return next((f"{name}." for name in names if name.partition(".")[0] == "importlib"), "")
    return ""


# The stages of a recording are wired only with its folder: see tests/recordings.
OF_RECORDINGS = {name for name in STAGES if STAGES[name].recorded}
OF_RECORDINGS |= {"objects", "find_tracks", "track_each", "label_scores"}
OF_RECORDINGS |= {"moving_pictures", "track_points", "calibrated_rig", "rig_pictures"}


@pytest.mark.parametrize("name", [name for name in STAGES if name not in OF_RECORDINGS])
def test_a_stages_arguments_are_those_of_every_function_it_may_call(name):
    definition = STAGES[name]
    own = ("tracker=own_functions:f", "metrics=[own_functions:f]")
    ways = ((), ("start=scans", "measurement.clutter_rate=1.0"), own)
    each = product((*group_options()["measurement"], "own_functions:scans"), ways)
    stages = [stage for kind, words in each for stage in stages_of(kind, *words).values()]
    wired = [stage for stage in stages if stage.function in definition.functions.values()]
    assert wired, "no pipeline uses this stage"
    given = {*wired[0].inputs, *wired[0].settings, *GIVEN[definition.pattern]}
    given |= {"seed"} if definition.seeded else set()
    for function in definition.functions.values():
        parameters = inspect.signature(resolve_name(function)).parameters.values()
        needed = {p.name for p in parameters if p.default is p.empty}
        assert needed <= given, function
        assert given <= {p.name for p in parameters}, function


@pytest.mark.parametrize("kind", [*group_options()["measurement"], "own_functions:scans"])
def test_every_kind_of_measurement_has_dropout_and_clutter_after_its_own_stages(kind):
    plain = stages_of(kind)
    stages = stages_of(kind, "measurement.dropout=[1,2]", "measurement.clutter_rate=3.0")
    assert "clean_scans" not in plain
    assert stages["scans"].inputs == {"scans": "clean_scans"}
    assert stages["scans"].settings["dropout"] == (1.0, 2.0)
    assert stages["scans"].settings["clutter_rate"] == 3.0
    # The sensor's own stages do not see the options, so such runs share their results.
    assert replace(stages["clean_scans"], name="scans") == plain["scans"]
    for name, one in plain.items():
        assert name == "scans" or stages[name] == one


def test_the_stages_that_draw_are_marked():
    stages = stages_of("stixels")
    drawing = {name for name in stages if name in PICTURES}
    assert drawing == {"camera_pictures", "track_pictures", "path_pictures", "error_pictures"}
    for stage in map(stages.get, drawing):
        function = resolve_name(stage.function)
        assert inspect.get_annotations(function)["return"] is Pictures


def test_pictured_frames_are_those_chosen_or_four_spread_over_the_run():
    assert pictured_frames(compose()) == (12, 37, 62, 87)
    chosen = compose(["pictures.frames=[3,99]"])
    assert pictured_frames(chosen) == (3, 99)
    short = compose(["path.duration=0.2"])
    assert (short.scan_count, pictured_frames(short)) == (2, (0, 1))
