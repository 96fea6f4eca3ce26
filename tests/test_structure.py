"""What the package imports: folders downwards, what is declared, and docstrings that are right."""

import ast
import doctest
import re
import sys
import tomllib
from importlib import import_module
from importlib.metadata import packages_distributions

import pytest
from minimum_versions import PYPROJECT, minimum_versions
from package_trees import PACKAGE, trees

ORDER = (
    "cli", "live", "benchmark", "studies", "export", "sweeps", "experiment", "machine", "config",
    "answers", "report", "pictures", "results", "validation", "calibration", "evaluation",
    "tracking", "measurements", "stixels", "stereo", "recordings", "rendering", "scene", "geometry",
    "border",
)  # fmt: skip
"""From the top. `engine` stands apart, and modules of the top level may be used by all."""


def imported_folders(tree):
    for node in ast.walk(tree):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        for name in names:
            parts = name.split(".")
            if parts[0] == "stixel_cli" and len(parts) > 1 and (PACKAGE / parts[1]).is_dir():
                yield parts[1]


def arrows():
    for file, tree in trees().items():
        folder = file.partition("/")[0]
        if folder in ORDER:
            for other in imported_folders(tree):
                yield folder, other, file


def test_folders_have_their_place_and_import_none_above():
    rank = {name: at for at, name in enumerate(ORDER)}
    ranked = [arrow for arrow in arrows() if arrow[1] in rank]
    up = {(file, other) for folder, other, file in ranked if rank[other] < rank[folder]}
    assert up == set()
    folders = {path.parent.relative_to(PACKAGE).parts[0] for path in PACKAGE.glob("*/**/*.py")}
    assert folders == {*ORDER, "engine"}
    # `stixel_cli/__init__.py` hands on names of `api.py`: from below that would be an arrow up.
    nodes = [(file, node) for file, tree in trees().items() for node in ast.walk(tree)]
    faces = [one for one in nodes if getattr(one[1], "module", "") == "stixel_cli"]
    names = {(file, alias.name) for file, node in faces for alias in node.names}
    assert {one for one in names if not (PACKAGE / f"{one[1]}.py").exists()} == set()


PROJECT = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]


EXTRAS = {one: one for one in ("distributed", "optuna", "pyarrow", "pyrecest", "rosbags")}
EXTRAS |= {"mlflow": "mlflow-skinny", "rerun": "rerun-sdk", "stixel": "pystixel-lib"}
"""What extras install: the name of the import, that of the distribution."""
IMPORTED_BY_MLFLOW = {"alembic", "sqlalchemy"}
"""mlflow's client needs them for a database in a file, and does not declare them."""


def plain(name):
    """A distribution's name as pip compares it; the two wheels of Open3D are one library."""
    return re.sub(r"[-_.]+", "-", name).lower().removesuffix("-cpu")


def numbers(version):
    return [int(number) for number in re.findall(r"\d+", version)]


def declared():
    extras = PROJECT["optional-dependencies"]
    named = [extra for name, extra in extras.items() if name not in ("coverage", "docs", "test")]
    optional = [text for extra in named for text in extra]
    needed = [*PROJECT["dependencies"], *optional]
    return {plain(re.match(r"[\w.-]+", text)[0]) for text in needed}


def imported():
    names = set()
    for tree in trees().values():
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                names.add(node.module.split(".")[0])
    return names - set(sys.stdlib_module_names) - {"stixel_cli"}


def test_what_is_imported_is_declared_and_what_is_declared_is_imported():
    distributions = packages_distributions()
    names = imported()
    found = {plain(distributions[name][0]) for name in names if name in distributions}
    # Extras: where one is not installed it cannot be looked up.
    missing = {EXTRAS.get(name) for name in names if name not in distributions}
    assert missing <= {*EXTRAS.values()}
    assert found | missing == declared() - IMPORTED_BY_MLFLOW


@pytest.mark.parametrize("file", ["constraints.txt", "constraints-3.13.txt"])
def test_every_dependency_has_a_lowest_version_that_the_pinned_one_is_not_below(file):
    lines = (PYPROJECT.parent / file).read_text(encoding="utf-8").splitlines()
    pinned = dict(line.split("==") for line in lines if not line.startswith("#"))
    pinned = {plain(name): numbers(version) for name, version in pinned.items()}
    found = [line.split(";")[0].split("==") for line in minimum_versions(PYPROJECT.read_text())]
    assert len(found) > 30
    for name, lowest in found:
        # Where it is not pinned: too large for an extra that few want.
        assert numbers(lowest) <= pinned.get(plain(name), numbers(lowest)), name


def test_a_dependency_without_a_lowest_version_is_named():
    text = '[project]\ndependencies = ["numpy<3"]\noptional-dependencies = {}\n'
    with pytest.raises(ValueError, match="numpy<3"):
        minimum_versions(text)


MODULES = ("stixel_cli.api", "stixel_cli.live.pairs", "stixel_cli.measurements.scans")


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_give_what_they_show(name):
    result = doctest.testmod(import_module(name))
    assert result.attempted > 0 and result.failed == 0
