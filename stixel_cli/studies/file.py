"""A study's file: YAML with title, question, template and module of the report, and sweeps.

`template` is a file next to the study's own, or one of the package's. `module` is a Python file
next to the study's own (`report.py`), or the dotted name of an installed module. Only
`stixel study` imports it.
"""

import re
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import jinja2

from stixel_cli.config import messages
from stixel_cli.config.folders import shipped_folder
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.files import read_text
from stixel_cli.studies.data import StudyData
from stixel_cli.studies.template import findings_of, template_of
from stixel_cli.studies.types import Findings, Material
from stixel_cli.sweeps.design import Design
from stixel_cli.sweeps.file import ENTRIES as SWEEP_ENTRIES
from stixel_cli.sweeps.file import design_of, is_study, read_mapping, refuse_unknown

ALL = "all"
ENTRIES = ("title", "question", "template", "module", "sweeps")
_SWEEP_ENTRIES = (*SWEEP_ENTRIES, "results", "derive", "axes_of")
_LONGEST_PATH = 200
_SWEEP_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


@dataclass(frozen=True)
class SweepEntry:
    """A sweep of the file.

    Attributes:
        name: of the sweep.
        content: entries as in a sweep's file.
        steps: stages whose results the report reads in addition to the scores.
        derive: name of the module's function that returns further axes, from the data of the
            earlier sweeps; or None.
        axes_of: name of the module's function that returns further axes when the study is
            planned, such as those of the user's data; or None.
    """

    name: str
    content: Mapping[str, Any]
    steps: tuple[str, ...]
    derive: str | None
    axes_of: str | None

    def design(self, derived: list[dict[str, list]] | None = None) -> Design:
        """The design of the runs, with further axes.

        Raises:
            ConfigurationError: in one line that names the sweep and the entry.
        """
        content = dict(self.content)
        for keys in derived or []:
            if len(keys) == 1:
                content["axes"] = {**(content.get("axes") or {}), **keys}
            else:
                content["zipped"] = [*(content.get("zipped") or []), keys]
        try:
            return design_of(content, shuffled=False)
        except ConfigurationError as fault:
            raise ConfigurationError(f"sweeps: {self.name}: {fault}") from None


@dataclass(frozen=True)
class StudyFile:
    """The content of a study's file.

    Attributes:
        path: of the file.
        title, question: of the report.
        template_name, module_name: as in the file.
        template: of the report.
        module: its function `report` returns a `Material` from `StudyData`; its functions that
            `derive` names return further axes.
        sweeps: in the order of the file.
    """

    path: Path
    title: str
    question: str
    template_name: str
    module_name: str
    template: jinja2.Template
    module: ModuleType
    sweeps: tuple[SweepEntry, ...]

    @property
    def name(self) -> str:
        """Name of the study, and the begin of its folder's name."""
        return self.path.stem

    def function(self, name: str) -> Callable:
        """A function of the report's module.

        Raises:
            ConfigurationError: if the module has no function of that name.
        """
        function = getattr(self.module, name, None)
        if not callable(function):
            raise ConfigurationError(
                f"{_shown(self.path)}: {messages.printable(self.module_name)} has no function "
                f"{messages.printable(name)}"
            )
        return function

    def findings(self, data: StudyData) -> Findings:
        """The report of the complete study.

        Raises:
            UserError: if the module fails, or lacks a value of the template.
        """
        material = self.call("report", data)
        if not isinstance(material, Material):
            raise UserError(f"{self.module_name}: report must return a Material")
        return findings_of(self.template, material, self.template_name)

    def design(self, sweep: SweepEntry) -> Design:
        """The design of a sweep with the axes of `axes_of`; raises as `further_axes` does."""
        return sweep.design(sweep.axes_of and self.further_axes(sweep.axes_of))

    def further_axes(self, name: str, *data: StudyData) -> list[dict[str, list]]:
        """Axes from a function that `derive` (with the data) or `axes_of` (without) names.

        Raises:
            UserError: if the function fails or returns another type.
        """
        axes = self.call(name, *data)
        if not isinstance(axes, list) or not all(
            isinstance(axis, dict) and all(isinstance(values, list) for values in axis.values())
            for axis in axes
        ):
            raise UserError(
                f"{self.module_name}: {name} must return a list of mappings from key to values"
            )
        return axes

    def call(self, name: str, *data: StudyData) -> Any:
        """What a function of the report's module returns.

        Raises:
            UserError: if the function of a study outside the package fails; the line names the
                module's file and line.
        """
        function = self.function(name)
        try:
            return function(*data)
        except UserError:
            raise
        except Exception as fault:
            if self.module.__name__.startswith("stixel_cli."):
                raise
            raise UserError(f"{name}: {_place_and_reason(fault, self.module)}") from fault


def shipped_studies() -> list[str]:
    """Names of the shipped studies; plain sweeps are in the same folder."""
    files = sorted((shipped_folder("pipelines") / "studies").glob("*.yaml"))
    return [file.stem for file in files if is_study(file)]


def find_study(name: str) -> Path:
    """The file of a study: a path to a YAML file, or the name of a shipped study.

    Raises:
        ConfigurationError: if there is no such study, or it is a plain sweep.
    """
    path = Path(name)
    if path.suffix == ".yaml" and path.exists():
        return path
    known = shipped_studies()
    inside = shipped_folder("pipelines") / "studies" / f"{name}.yaml"
    if path.name == name and inside.is_file():
        if name in known:
            return inside
        raise ConfigurationError(
            f"{name}: is a sweep, not a study: run it by stixel sweep --from {name}"
        )
    hint = messages.suggestion(name, [*known, ALL]) or f" (studies: {', '.join(known)}, or {ALL})"
    raise ConfigurationError(f"{messages.printable(name)}: there is no such study{hint}")


def read_study(path: Path) -> StudyFile:
    """The study of a file, with valid designs of its sweeps.

    Raises:
        ConfigurationError: in one line that names the file and the entry.
    """
    content = read_mapping(path, ENTRIES)
    try:
        if "sweeps" not in content and not set(content) - set(SWEEP_ENTRIES):
            raise ConfigurationError(f"is a sweep, not a study: stixel sweep --from {_shown(path)}")
        refuse_unknown(content, ENTRIES)
        title, question, template, module = (_text(content, name) for name in ENTRIES[:4])
        study = StudyFile(
            path,
            title,
            question,
            template,
            module,
            template_of(read_text(_template_file(path.parent, template)), template),
            _module(path.parent, module),
            tuple(_sweeps(content)),
        )
        if study.sweeps[0].derive is not None:
            raise ConfigurationError(f"sweeps: {study.sweeps[0].name}: derive: no earlier sweep")
        for sweep in study.sweeps:
            sweep.design()
            for name in (sweep.derive, sweep.axes_of):
                if name is not None:
                    study.function(name)
        study.function("report")
    except ConfigurationError as fault:
        where = _shown(path)
        text = str(fault)
        raise ConfigurationError(text if where in text else f"{where}: {text}") from None
    return study


def _template_file(folder: Path, name: str) -> Path:
    for place in (folder, Path(__file__).parent / "templates"):
        if (place / name).is_file():
            return place / name
    raise ConfigurationError(f"template: no file {messages.printable(name)} in {_shown(folder)}")


def _module(folder: Path, name: str) -> ModuleType:
    """The module of a study: a Python file in its folder, or an installed module."""
    if not name.endswith(".py"):
        try:
            return import_module(name)
        except (ImportError, ValueError, TypeError):
            raise ConfigurationError(f"module: no module {messages.printable(name)}") from None
    file = folder / name
    if not file.is_file():
        raise ConfigurationError(f"module: no file {messages.printable(name)} in {_shown(folder)}")
    spec = spec_from_file_location(f"stixel_study_{file.stem}", file)
    module = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as fault:
        reason = _place_and_reason(fault, module)
        raise ConfigurationError(f"module: cannot be imported: {reason}") from fault
    return module


def _shown(path: Path) -> str:
    return messages.printable(str(path), _LONGEST_PATH)


def _place_and_reason(fault: Exception, module: ModuleType) -> str:
    """Last line of the module's file that led to the fault, and the fault, in one line."""
    file, line = module.__file__, None
    for frame in traceback.extract_tb(fault.__traceback__):
        if frame.filename == file:
            line = frame.lineno
    if isinstance(fault, SyntaxError) and fault.filename == file:
        line = fault.lineno
    place = messages.printable(file, _LONGEST_PATH) + (f": line {line}" if line else "")
    return f"{place}: {messages.printable(f'{type(fault).__name__}: {fault}', 200)}"


def _text(content: Mapping[str, Any], name: str) -> str:
    value = content.get(name)
    if not isinstance(value, str) or not value.strip():
        raise ConfigurationError(f"{name}: is required and must be a string")
    return " ".join(value.split())


def _sweeps(content: Mapping[str, Any]) -> list[SweepEntry]:
    sweeps = content.get("sweeps")
    if not isinstance(sweeps, dict) or not sweeps:
        raise ConfigurationError("sweeps: must be names, each with a sweep's entries")
    found = []
    for name, entries in sweeps.items():
        where = f"sweeps: {messages.printable(str(name))}"
        if not isinstance(name, str) or not _SWEEP_NAME.fullmatch(name):
            raise ConfigurationError(f"{where}: a name of letters, digits and _ is needed")
        if not isinstance(entries, dict):
            raise ConfigurationError(f"{where}: must have a sweep's entries, as KEY: VALUE")
        try:
            refuse_unknown(entries, _SWEEP_ENTRIES)
        except ConfigurationError as fault:
            raise ConfigurationError(f"{where}: {fault}") from None
        steps = entries.get("results") or []
        if not isinstance(steps, list) or not all(isinstance(step, str) for step in steps):
            raise ConfigurationError(f"{where}: results: must be a list of steps")
        functions = {entry: entries.get(entry) for entry in ("derive", "axes_of")}
        for entry, function in functions.items():
            if not isinstance(function, str | None):
                raise ConfigurationError(f"{where}: {entry}: must be the name of a function")
        sweep = {key: value for key, value in entries.items() if key in SWEEP_ENTRIES}
        found.append(SweepEntry(name, sweep, tuple(steps), **functions))
    return found
