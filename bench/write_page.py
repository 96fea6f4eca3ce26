"""Run the benchmarks of docs/benchmark.md and write that page: `make bench`.

With a path, write the page of a JSON file of `pytest --benchmark-json` without running anything.
"""

import json
import os
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

from bench_run import RUN, STUDY
from phase_table import DATA, FAR, WAYS, accuracy
from small import FOLDER

ROOT = Path(__file__).parents[1]
PAGE = Path(FOLDER or ROOT / "docs") / "benchmark.md"
SELECTED = (
    "bench_run.py",
    "bench_stixels.py::test_images_to_stixels",
    "bench_stixels.py::test_images_to_stixels_plain",
    "bench_stixels.py::test_files_to_track",
    "bench_stixels.py::test_files_to_track_plain",
    "bench_stixels.py::test_disparity_to_stixels",
    "bench_stixels.py::test_disparity_to_stixels_of_many_layers",
    "bench_stixels.py::test_disparity_to_stixels_plain",
    "bench_raycast.py::test_first_pair",
    "bench_raycast.py::test_plain_pair_with_four_rays_everywhere",
    "bench_rendering_parts.py",
    "bench_tracking.py::test_scan",
    "bench_tracking.py::test_track_of_100_scans",
    "bench_sweep.py::test_tracker_runs",
    "bench_sweep.py::test_scores",
)
REAL = (DATA / "kitti2015").is_dir()
INTRODUCTION = """# Benchmark

`make bench` writes this page: do not edit it. All numbers are of one run on one machine, except the
quoted ones. The first row of a table is its reference. A plain reference does the same work in
NumPy. "× faster" is the reference's time over the row's time.
"""
QUOTED = """## Quoted, not measured here

From the notes for this project's issue on speed, which record no revision of the C++ programs:

- The C++ peer (gishi) takes 70 ms to match and 22 ms from disparity to stixels: 1242 × 375 px, one
  thread, block 11, without uniqueness, left-right check and speckle filter.
- On real KITTI pairs, stixels of a public C++ program, which is not named, have a median error of
  0.68 px, 31 % beyond 1 px. `python bench/pair_scores.py` has those of this project.
"""


def markdown(header: list[str], rows: list[list[str]]) -> str:
    """A table; the first column is text, the others are right-aligned."""
    lines = [header, ["---"] + ["---:"] * (len(header) - 1), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def seconds(time: float) -> str:
    """A time in s or ms, three digits."""
    return f"{time:.3g} s" if time >= 1 else f"{1e3 * time:.3g} ms"


def named(benchmark: dict) -> str:
    """A row's name: the test's parameters, else its own name in words."""
    name = benchmark["name"].removeprefix("test_").replace("_", " ")
    return name.partition("[")[2].removesuffix("]") or name


def timed(rows: list[tuple[str, float, str]]) -> str:
    """A table of name, seconds and accuracy; the first row is the reference."""
    known = any(row[2] for row in rows)
    lines = [
        [name, seconds(time), f"{rows[0][1] / time:.3g}", *([text] if known else [])]
        for name, time, text in rows
    ]
    return markdown(["way", "time", "× faster", *(["accuracy or size"] if known else [])], lines)


def processes(found: list[dict]) -> str:
    """The table of whole processes; the first row is the cold run."""
    lines = []
    for one in found:
        info = one["extra_info"]
        ratio = found[0]["extra_info"]["wall_s"] / info["wall_s"]
        values = (f"{info[key]:.2f}" for key in ("scores_s", "wall_s", "cpu_s"))
        lines.append([named(one), *values, f"{info['peak_mb']:.0f}", f"{ratio:.3g}"])
    return markdown(["run", "to scores, s", "to end, s", "CPU, s", "MB", "× faster"], lines)


def sections(benchmarks: list[dict]) -> list[str]:
    """A section for each group, in the order of the benchmarks."""
    groups: dict[str, list[dict]] = {}
    parts = []
    for one in benchmarks:
        for title, ways in one["extra_info"].get("ways", {}).items():
            rows = [(name, w["seconds"], w.get("accuracy", "")) for name, w in ways.items()]
            parts.append(f"## {title[0].upper()}{title[1:]}, CPU time\n\n{timed(rows)}")
        # Those of SELECTED have a group.
        if "ways" not in one["extra_info"] and one["group"]:
            groups.setdefault(one["group"], []).append(one)
    wholes = []
    for title, found in groups.items():
        if title in (RUN, STUDY):
            wholes.append(f"## {title}\n\n{processes(found)}")
            continue
        # The reference first: the plain one, else the slowest.
        found.sort(key=lambda b: ("plain" not in b["name"], -b["stats"]["median"]))
        rows = [
            (named(one), one["stats"]["median"], one["extra_info"].get("accuracy", ""))
            for one in found
        ]
        wholes.append(f"## {title[0].upper()}{title[1:]}\n\n{timed(rows)}")
    return wholes + parts


def machine(record: dict) -> str:
    """The machine, the data and the revision of a record of pytest-benchmark."""
    cpu = record["machine_info"]["cpu"]
    packages = ("numpy", "numba", "opencv-python-headless", "scipy")
    versions = ", ".join(f"{name} {version(name)}" for name in packages)
    commit = record["commit_info"]
    return (
        f"- Machine: {cpu.get('brand_raw', cpu.get('arch', 'unknown'))}, {os.cpu_count()} cores; "
        f"load {os.getloadavg()[0]:.1f} at the end\n"
        f"- Python {record['machine_info']['python_version']}, {versions}\n"
        f"- Revision {commit['id'][:12]}{' with changes' if commit['dirty'] else ''}, "
        f"{record['datetime'][:10]}\n"
        f"- Data: rendered pairs of seed 0; {'pair 0 of KITTI 2015' if REAL else 'a made street'} "
        "for images to stixels\n- Scripts: "
        + ", ".join(f"`bench/{name}`" for name in dict.fromkeys(s.split("::")[0] for s in SELECTED))
        + "\n"
    )


def subpixel_accuracy() -> str:
    """The section on the accuracy of `stereo.subpixel`."""
    lines = [
        [f"{images}, {zone}", *(f"{x:.3f} ({x / found[WAYS[0]]:.2f})" for x in found.values())]
        for images, zone, found in accuracy()
    ]
    return (
        "## Accuracy of `stereo.subpixel`\n\n`python bench/phase_table.py`: RMS error of the "
        f"disparity, px, without errors above 1 px, and its ratio to `{WAYS[0]}`. "
        f"The far target is at {FAR:g} m or more.\n\n" + markdown(["images, pixels", *WAYS], lines)
    )


def selected(benchmarks: list[dict]) -> list[dict]:
    """The benchmarks of the page, in its order; a small run has others, too."""
    found = []
    for test in SELECTED:
        chosen = [
            one
            for one in benchmarks
            if f"bench/{test}" in (one["fullname"].partition(end)[0] for end in ("[", "::"))
        ]
        if not chosen:
            sys.exit(f"bench/{test}: no benchmark found")
        found += chosen
    return found


def main() -> None:
    """Run, then write the page."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(folder) / "bench.json"
        if len(sys.argv) == 1:
            tests = [f"bench/{name}" for name in SELECTED]
            options = ["-o", "python_files=bench_*.py", f"--benchmark-json={path}"]
            if FOLDER:
                tests = ["bench"]
                options += ["--benchmark-min-rounds=1", "--benchmark-max-time=0"]
            subprocess.run([sys.executable, "-m", "pytest", *options, *tests], cwd=ROOT, check=True)
        record = json.loads(path.read_text())
    parts = [
        INTRODUCTION,
        machine(record),
        *sections(selected(record["benchmarks"])),
        subpixel_accuracy(),
        QUOTED,
    ]
    PAGE.write_text("\n".join(parts), encoding="utf-8")


if __name__ == "__main__":
    main()
