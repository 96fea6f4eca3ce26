"""What the package imports is what it declares: pip installs no more and no less."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions

import pytest
from minimum_versions import PYPROJECT, minimum_versions
from package_trees import trees

PROJECT = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]


EXTRAS = {
    "distributed": "distributed",
    "mlflow": "mlflow-skinny",
    "optuna": "optuna",
    "pyarrow": "pyarrow",
    "pyrecest": "pyrecest",
    "rerun": "rerun-sdk",
    "rosbags": "rosbags",
    "stixel": "pystixel-lib",
}
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
