"""A study's file: YAML with title, question, sweeps, questions, and the text of the answer.

`module`, which it may leave out, is a Python file next to the study's own (`report.py`), or the
dotted name of an installed module. Only `stixel study` imports it.
"""

import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

from annotated_types import MinLen
from pydantic import StringConstraints

from stixel_cli.border import TYPED, Origin, admit, imported, imported_file
from stixel_cli.config import messages
from stixel_cli.config.folders import STUDIES, shipped_folder
from stixel_cli.config.texts import value_text
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.parameters import parameters
from stixel_cli.studies.questions import NAME, PLACE, StudyQuestion, study_question
from stixel_cli.sweeps.design import SWEEP_ENTRIES, Design, design_of, is_study, read_mapping

Axes = Sequence[Mapping[str, list]]
"""Further axes of a sweep: each maps one key, or several zipped ones, to values."""


@parameters
class _Entries:
    """The entries of a sweep that a sweep's own file does not have."""

    name: Annotated[str, StringConstraints(pattern=NAME)]
    results: tuple[str, ...] = ()
    derive: str | None = None
    axes_of: str | None = None
    variants: dict[str, dict[str, Any]] = field(default_factory=dict)

    def check(self) -> None:
        """Raise ValueError for a variant with a key that the first one lacks."""
        first = next(iter(self.variants.values()), {})
        for name, own in self.variants.items():
            unknown = next((key for key in own if key not in first), None)
            if unknown is not None or not first:
                raise ValueError(
                    f"variants: {name}: {unknown} must have a value in the first variant too"
                )


@dataclass(frozen=True)
class SweepEntry:
    """A sweep of the file.

    Attributes:
        content: entries as in a sweep's file.
        steps: stages whose results the report reads in addition to the scores.
        derive: name of the module's function that returns further axes, from the data of the
            earlier sweeps; or None.
        axes_of: name of the module's function that returns further axes when the study is
            planned, such as those of the user's data; or None.
        variants: name to key to value, the same keys in all.
        origin: of all that the file names.
    """

    name: str
    content: Mapping[str, Any]
    steps: tuple[str, ...]
    derive: str | None
    axes_of: str | None
    variants: Mapping[str, Mapping[str, Any]]
    origin: Origin

    def variant_of(self, setting: Mapping[str, str]) -> str:
        """Name of the variant that a run has; "" without any."""
        for name, values in self.variants.items():
            if all(setting.get(key) == value_text(value) for key, value in values.items()):
                return name
        return ""

    def design(self, further: Axes = ()) -> Design:
        """The design of the runs, with further axes.

        Raises:
            ConfigurationError: in one line that names the sweep and the entry.
        """
        axes, zipped = self.content.get("axes"), self.content.get("zipped")
        variants = list(self.variants.values())
        own = {key: [values[key] for values in variants] for key in (variants or [{}])[0]}
        for keys in (*([own] if own else []), *further):
            if len(keys) == 1:
                axes = {**(axes or {}), **keys}
            else:
                zipped = [*(zipped or []), keys]
        content = {**self.content, "axes": axes, "zipped": zipped}
        return design_of(content, f"sweeps: {self.name}", self.origin)


def sweep_entry(name: Any, entries: Any, origin: Origin) -> SweepEntry:
    """A sweep of the file; ConfigurationError in one line that names it and the entry."""
    where = f"sweeps: {messages.printable(str(name))}"
    if not isinstance(entries, dict):
        raise ConfigurationError(f"{where}: must have a sweep's entries, as KEY: VALUE")
    content = {key: value for key, value in entries.items() if key in SWEEP_ENTRIES}
    given = {k: v for k, v in entries.items() if k not in SWEEP_ENTRIES and v is not None}
    known = [*SWEEP_ENTRIES, *(one.name for one in fields(_Entries))]
    own = messages.validated(_Entries, {**given, "name": name}, where, known)
    first = next(iter(own.variants.values()), {})
    # The first variant gives all keys, the others those that differ.
    variants = {variant: {**first, **values} for variant, values in own.variants.items()}
    return SweepEntry(name, content, own.results, own.derive, own.axes_of, variants, origin)


ALL = "all"
FUNCTIONS = ("columns", "material")
"""Functions of a module that add to the report, if it has them."""
_LONGEST_PATH = 200
_Text = Annotated[str, StringConstraints(pattern=r"\S")]


@parameters
class _Content:
    """The entries of a study's file."""

    title: _Text
    question: _Text
    text: _Text
    sweeps: Annotated[dict[str, Any], MinLen(1)]
    questions: dict[str, Any] = field(default_factory=dict)
    module: str = ""


ENTRIES = tuple(one.name for one in fields(_Content))


@dataclass(frozen=True)
class StudyFile:
    """The content of a study's file.

    Attributes:
        title, question: of the report.
        text: its paragraphs, the answer first, see `studies.report`.
        module_name: as in the file; "" without a module.
        module: its functions that `derive` and `axes_of` name return further axes; see also
            `FUNCTIONS`. None without a module.
        is_shipped: whether it is one of the shipped studies.
    """

    path: Path
    title: str
    question: str
    text: str
    module_name: str
    module: ModuleType | None
    sweeps: tuple[SweepEntry, ...]
    questions: tuple[StudyQuestion, ...]
    is_shipped: bool

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

    def further_axes(self, name: str | None, *data: Any) -> Axes:
        """Axes from a function that `derive` (with the data) or `axes_of` (without) names.

        Raises:
            UserError: if the function fails or returns another type.
        """
        axes = [] if name is None else self.call(name, *data)
        if not isinstance(axes, list) or not all(
            isinstance(axis, dict) and all(isinstance(values, list) for values in axis.values())
            for axis in axes
        ):
            raise UserError(
                f"{self.module_name}: {name} must return a list of mappings from key to values"
            )
        return axes

    def call(self, name: str, *data: Any) -> Any:
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
            if self.is_shipped:
                raise
            raise UserError(f"{name}: {_place_and_reason(fault, self.module.__file__)}") from fault


def _shipped(name: str) -> Path:
    return shipped_folder("pipelines") / "studies" / f"{name}.yaml"


def find_study(name: str) -> Path:
    """The file of a study: a path to a YAML file, or the name of a shipped study.

    Raises:
        ConfigurationError: if there is no such study, or it is a plain sweep.
    """
    path = Path(name)
    if path.suffix == ".yaml" and path.exists():
        return path
    inside = _shipped(name)
    if path.name == name and inside.is_file():
        if is_study(inside):
            return inside
        raise ConfigurationError(
            f"{name}: is a sweep, not a study: run it by stixel sweep --from {name}"
        )
    listed = f" (studies: {', '.join(STUDIES)}, or {ALL})"
    hint = messages.suggestion(name, [*STUDIES, ALL]) or listed
    raise ConfigurationError(f"{messages.printable(name)}: there is no such study{hint}")


def read_study(path: Path, trusted: bool = False) -> StudyFile:
    """The study of a file, with valid designs of its sweeps.

    A file that is not shipped may name a module or functions of its own only if it is `trusted`.

    Raises:
        ConfigurationError: in one line that names the file and the entry.
    """
    content = read_mapping(path, ENTRIES)
    try:
        if "sweeps" not in content and not set(content) - set(SWEEP_ENTRIES):
            raise ConfigurationError(f"is a sweep, not a study: stixel sweep --from {_shown(path)}")
        given = {key: value for key, value in content.items() if value is not None}
        file = messages.validated(_Content, given, _shown(path), ENTRIES)
        module_name, questions = file.module, file.questions
        is_shipped = path in map(_shipped, STUDIES)
        origin = TYPED if is_shipped else Origin(str(path), trusted)
        sweeps = tuple(sweep_entry(name, entries, origin) for name, entries in file.sweeps.items())
        functions = [f for sweep in sweeps for f in (sweep.derive, sweep.axes_of) if f]
        if module_name:
            admit((f"{module_name}:{name}", origin) for name in (*FUNCTIONS, *functions))
        if sweeps[0].derive is not None:
            raise ConfigurationError(f"sweeps: {sweeps[0].name}: derive: no earlier sweep")
        for sweep in sweeps:
            sweep.design()
        names = [sweep.name for sweep in sweeps]
        asked = tuple(study_question(name, one, names) for name, one in questions.items())
        for place in PLACE.finditer(file.text):
            if place[1] not in questions:
                raise ConfigurationError(f"text: {messages.printable(place[0])}: is no question")
        module = None
        if module_name:
            module = _module(path.parent, module_name, origin)
        title, question = (" ".join(text.split()) for text in (file.title, file.question))
        study = StudyFile(
            path, title, question, file.text, module_name, module, sweeps, asked, is_shipped
        )
        for name in functions:
            study.function(name)
    except ConfigurationError as fault:
        where = _shown(path)
        text = str(fault)
        raise ConfigurationError(text if where in text else f"{where}: {text}") from None
    return study


def _module(folder: Path, name: str, origin: Origin) -> ModuleType:
    """The module of a study: a Python file in its folder, or an installed module."""
    if not name.endswith(".py"):
        try:
            return imported(name, origin)
        except (ImportError, ValueError, TypeError):
            raise ConfigurationError(f"module: no module {messages.printable(name)}") from None
    file = folder / name
    if not file.is_file():
        raise ConfigurationError(f"module: no file {messages.printable(name)} in {_shown(folder)}")
    try:
        return imported_file(file, f"stixel_study_{file.stem}", origin)
    except Exception as fault:
        reason = _place_and_reason(fault, str(file))
        raise ConfigurationError(f"module: cannot be imported: {reason}") from fault


def _shown(path: Path) -> str:
    return messages.printable(str(path), _LONGEST_PATH)


def _place_and_reason(fault: Exception, file: str) -> str:
    """Last line of the module's file that led to the fault, and the fault, in one line."""
    frames = traceback.extract_tb(fault.__traceback__)
    line = next((frame.lineno for frame in reversed(frames) if frame.filename == file), None)
    if isinstance(fault, SyntaxError) and fault.filename == file:
        line = fault.lineno
    place = _shown(Path(file)) + (f": line {line}" if line else "")
    return f"{place}: {messages.printable(f'{type(fault).__name__}: {fault}', 200)}"
