"""A study's file: YAML with title, question, sweeps, questions, and the text of the answer.

`module`, which it may leave out, is a Python file next to the study's own (`report.py`), or the
dotted name of an installed module. Only `stixel study` imports it.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, Literal

from annotated_types import MinLen
from pydantic import BeforeValidator, StringConstraints

from stixel_cli.border.files import read_yaml
from stixel_cli.border.origins import TYPED, Origin, admit, imported, imported_file
from stixel_cli.config import messages
from stixel_cli.config.folders import STUDIES, shipped_folder
from stixel_cli.config.texts import value_text
from stixel_cli.errors import ConfigurationError, UserError, printable_path
from stixel_cli.evaluation.metric_table import MAIN
from stixel_cli.parameters import parameters
from stixel_cli.sweeps.design import MOST_ENTRIES, SWEEP_ENTRIES, Design, design_of

NAME = "^[A-Za-z][A-Za-z0-9_]{0,59}$"
"""Of a sweep or a question: it is in names of folders and files, and in messages."""
PLACE = re.compile(r"\{([A-Za-z_][A-Za-z0-9_]*)\}")
"""A question's name in a study's text."""


def _texts(given: Any) -> Any:
    given = [given] if isinstance(given, str) else given
    return tuple(given) if isinstance(given, list) else given


def _values(given: Any) -> tuple[str, ...]:
    return tuple(map(str, given if isinstance(given, list) else [given]))


Texts = Annotated[tuple[str, ...], BeforeValidator(_texts)]
"""A text, or a list of texts."""


@parameters
class StudyQuestion:
    """A question of a study's file.

    Attributes:
        heading, note: of its section.
        sweeps: whose runs are asked.
        where: column to the values, as texts, that the runs have there.
        by: columns; there is an answer for each combination of their values.
        compare, within, over, better, reference: as in `answers.runs.Runs.question`.
        metrics: the main one first.
    """

    name: Annotated[str, StringConstraints(pattern=NAME)]
    heading: str
    sweeps: Texts
    note: str = ""
    where: dict[str, Annotated[tuple[str, ...], BeforeValidator(_values)]] = field(
        default_factory=dict
    )
    by: Texts = ()
    compare: Texts = ("tracker",)
    within: Texts | None = None
    over: Texts | None = None
    metrics: Texts = MAIN
    better: Literal["more", "less", "one"] | None = None
    reference: Annotated[str, BeforeValidator(str)] | None = None


def study_question(name: Any, entries: Any, sweeps: Sequence[str]) -> StudyQuestion:
    """A question of a file; ConfigurationError in one line that names it and the entry."""
    where = f"questions: {messages.printable(str(name))}"
    if not isinstance(entries, dict):
        raise ConfigurationError(f"{where}: must have entries, as KEY: VALUE")
    given = {key: value for key, value in entries.items() if value is not None}
    default = {"heading": str(name).replace("_", " ").capitalize(), "sweeps": [*sweeps]}
    entries = {**default, **given, "name": name}
    question = messages.validated(StudyQuestion, entries, where)
    for one in (one for one in question.sweeps if one not in sweeps):
        raise ConfigurationError(f"{where}: sweeps: there is no sweep {messages.printable(one)}")
    return replace(question, note=" ".join(question.note.split()))


Axes = Sequence[Mapping[str, list]]
"""Further axes of a sweep: each maps one key, or several zipped ones, to values."""


@parameters
class _Entries:
    """The entries of a sweep that a sweep's own file does not have.

    Attributes:
        results: stages whose results the report reads in addition to the scores.
        derive: name of the module's function that returns further axes, from the data of the
            earlier sweeps; or None.
        axes_of: name of the module's function that returns further axes when the study is
            planned, such as those of the user's data; or None.
        variants: name to key to value; the first has all keys, the others those that differ.
    """

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


@dataclass(frozen=True, kw_only=True)
class SweepEntry(_Entries):
    """A sweep of the file, whose variants all have the same keys.

    Attributes:
        content: entries as in a sweep's file.
        origin: of all that the file names.
    """

    content: Mapping[str, Any]
    origin: Origin

    def variant_of(self, setting: Mapping[str, str]) -> str:
        """Name of the variant that a run has; "" without any."""
        for name, values in self.variants.items():
            if all(setting.get(key) == value_text(value) for key, value in values.items()):
                return name
        return ""

    def design(self, further: Axes = ()) -> Design:
        """The design of the runs, with further axes.

        ConfigurationError in one line that names the sweep and the entry.
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
    return SweepEntry(**vars(own) | {"variants": variants}, content=content, origin=origin)


ALL = "all"
FUNCTIONS = ("columns", "material")
"""Functions of a module that add to the report, if it has them."""
_Text = Annotated[str, StringConstraints(pattern=r"\S")]


@parameters
class StudyEntries:
    """The entries of a study's file."""

    title: _Text
    question: _Text
    text: _Text
    sweeps: Annotated[dict[str, Any], MinLen(1)]
    questions: dict[str, Any] = field(default_factory=dict)
    module: str = ""


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

        ConfigurationError if the module has no function of that name.
        """
        function = getattr(self.module, name, None)
        if not callable(function):
            module, shown = messages.printable(self.module_name), messages.printable(name)
            where = printable_path(self.path)
            raise ConfigurationError(f"{where}: {module} has no function {shown}")
        return function

    def further_axes(self, name: str | None, *data: Any) -> Axes:
        """Axes from a function that `derive` (with the data) or `axes_of` (without) names.

        UserError if the function fails or returns another type.
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

        UserError if the function of a study outside the package fails; the line names the module's
        file and line.
        """
        function = self.function(name)
        try:
            return function(*data)
        except UserError:
            raise
        except Exception as fault:
            if self.is_shipped:
                raise
            text = messages.named_fault(fault, self.module.__file__)
            raise UserError(f"{name}: {text}") from fault


def read_study(path: Path, trusted: bool = False) -> StudyFile:
    """The study of a file, with valid designs of its sweeps.

    A file that is not shipped may name a module or functions of its own only if it is `trusted`.
    ConfigurationError in one line that names the file and the entry.
    """
    content, where = read_yaml(path, MOST_ENTRIES), printable_path(path)
    try:
        if "sweeps" not in content and not set(content) - set(SWEEP_ENTRIES):
            raise ConfigurationError(f"is a sweep, not a study: stixel sweep --from {where}")
        given = {key: value for key, value in content.items() if value is not None}
        file = messages.validated(StudyEntries, given, where)
        module_name, questions = file.module, file.questions
        shipped = shipped_folder("pipelines") / "studies"
        is_shipped = path in [shipped / f"{name}.yaml" for name in STUDIES]
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
        module = _module(path.parent, module_name, origin) if module_name else None
        title, question = (" ".join(text.split()) for text in (file.title, file.question))
        study = StudyFile(
            path, title, question, file.text, module_name, module, sweeps, asked, is_shipped
        )
        for name in functions:
            study.function(name)
    except ConfigurationError as fault:
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
        where = printable_path(folder)
        raise ConfigurationError(f"module: no file {messages.printable(name)} in {where}")
    try:
        return imported_file(file, f"stixel_study_{file.stem}", origin)
    except Exception as fault:
        reason = messages.named_fault(fault, str(file))
        raise ConfigurationError(f"module: {name} cannot be imported: {reason}") from fault
