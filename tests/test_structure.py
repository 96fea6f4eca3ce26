"""Folders import downwards, in the order of docs/data-flow.md: no arrow up, no circle."""

import ast

from package_trees import PACKAGE, trees

ORDER = (
    "cli", "live", "benchmark", "studies", "export", "sweeps", "experiment", "machine", "config",
    "answers", "report", "pictures", "results", "validation", "calibration", "evaluation",
    "tracking", "measurements", "stixels", "stereo", "recordings", "rendering", "scene", "geometry",
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


def test_no_folder_imports_one_above_it():
    rank = {name: at for at, name in enumerate(ORDER)}
    up = {
        (file, other)
        for folder, other, file in arrows()
        if other in rank and rank[other] < rank[folder]
    }
    assert up == set()


def test_every_folder_has_its_place():
    folders = {path.parent.relative_to(PACKAGE).parts[0] for path in PACKAGE.glob("*/**/*.py")}
    assert folders == {*ORDER, "engine"}


def test_no_module_imports_the_face_of_the_package():
    # `stixel_cli/__init__.py` hands on names of `api.py`: from below that would be an arrow up.
    faces = [
        file
        for file, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        and node.module == "stixel_cli"
        and any(not (PACKAGE / f"{alias.name}.py").exists() for alias in node.names)
    ]
    assert faces == []
