"""No seed and no shape seed is used both for class knowledge and for a reported figure.

Class knowledge (priors, templates, fitted noise) is from seeds of `FIRST_OF_KNOWLEDGE` and above.
"""

import re
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
FIRST_OF_KNOWLEDGE = 1000

KNOWLEDGE = {("rq3", "training"), ("prior_width", "")}
"""Sweeps that fit or tune something for a class: study and name of the sweep."""

SEED = re.compile(r"\b(?:shape_)?seeds?\s*[=:]\s*['\"]?([\[(\w ,.\]){}$]+)")


def sweeps():
    for path in sorted((ROOT / "pipelines" / "studies").glob("*.yaml")):
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        for name, sweep in content.get("sweeps", {"": content}).items():
            yield path.stem, name, sweep


def seeds_of(value) -> set[int]:
    return set(range(value)) if isinstance(value, int) else set(value)


def shape_seeds_of(sweep) -> set:
    """Values of `road_user.shape_seed` in a sweep, in `fixed` or in an axis."""
    found = set()
    for entries in (sweep.get("fixed", {}), sweep.get("axes", {}), *sweep.get("zipped", [])):
        value = entries.get("road_user.shape_seed")
        found |= set(value) if isinstance(value, list) else {value}
    return found - {None}


@pytest.mark.parametrize(("study", "name", "sweep"), list(sweeps()))
def test_sweeps_of_reports_and_of_class_knowledge_share_no_seed(study, name, sweep):
    found = seeds_of(sweep.get("seeds", [0])) | (shape_seeds_of(sweep) - {"${seed}"})
    if (study, name) in KNOWLEDGE:
        assert min(found) >= FIRST_OF_KNOWLEDGE
    else:
        assert max(found) < FIRST_OF_KNOWLEDGE


def test_class_knowledge_exists_and_names_seeds_of_its_own():
    assert {(study, name) for study, name, _ in sweeps()} >= KNOWLEDGE
    files = sorted((ROOT / "conf" / "measurement" / "noise").glob("fitted_*.yaml"))
    assert len(files) == 3
    for path in files:
        (line,) = re.findall(r"seeds ([\d, and]+)", path.read_text(encoding="utf-8"))
        assert min(map(int, re.findall(r"\d+", line))) >= FIRST_OF_KNOWLEDGE


@pytest.mark.parametrize("study", ["rq1", "rq2", "rq3", "prior_width"])
def test_studies_draw_a_shape_for_each_seed(study):
    own = [sweep for name, _, sweep in sweeps() if name == study]
    assert own and all(shape_seeds_of(sweep) == {"${seed}"} for sweep in own)


def test_readme_docs_and_configuration_use_seeds_of_reports_only():
    files = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    files += [p for p in (ROOT / "conf").rglob("*.yaml") if not p.name.startswith("fitted_")]
    for path in files:
        for text in SEED.findall(path.read_text(encoding="utf-8")):
            numbers = [int(number) for number in re.findall(r"\d+", text)]
            assert max(numbers, default=0) < FIRST_OF_KNOWLEDGE, (path, text)
