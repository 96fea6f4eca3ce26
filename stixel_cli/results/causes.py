"""Find why the keys of a stage changed: versions, files, settings or code."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from stixel_cli.engine.graph import Graph, Node
from stixel_cli.results.lineage import Lineage, StageLineage, settings_digest

MOST_CAUSES = 8
ALTERED = "its settings differ from those of the run: was config.yaml altered?"


@dataclass(frozen=True)
class ChangedStage:
    """The first stage, in the order of the data, whose keys changed.

    Attributes:
        stage: its name.
        known: whether the old run had this stage.
        causes: the known causes, one line each.
    """

    stage: str
    known: bool
    causes: tuple[str, ...]


def first_changed_stage(
    old: Lineage, new: Lineage, graph: Graph, settings: str = ALTERED
) -> ChangedStage | None:
    """The first stage of `new` whose keys differ from those of `old`; None if all are equal.

    `graph` is the graph of `new`; `settings` is the message for different settings.
    """
    for name, stage in new.stages.items():
        before = old.stages.get(name)
        if before is None:
            return ChangedStage(name, False, ())
        if before.keys != stage.keys:
            node = graph.of_stage(name)[0]
            return ChangedStage(name, True, tuple(_causes(before, stage, old.code, node, settings)))
    return None


def _causes(
    before: StageLineage,
    after: StageLineage,
    code: Mapping[str, str] | None,
    node: Node,
    settings: str,
) -> Iterator[str]:
    """Causes why a stage with the same inputs has another key."""
    for package, version in after.versions.items():
        then = before.versions.get(package)
        if then != version:
            yield f"{package} {then or 'missing'} → {version or 'missing'}"
    for path, content in (after.files or {}).items():
        then = (before.files or {}).get(path)
        if then is not None and then != content:
            yield f"the content of {path} changed"
    if before.settings != _settings_with_files(node, before):
        files = ", ".join(after.files or {}) if before.files is None else ""
        yield f"{settings[:-1]}, or {files}?" if files else settings
    if code is None:
        yield "unknown code changes: the folder does not record its code"
        return
    changes = _code_changes(code, node.identity.code.modules)
    yield from changes[:MOST_CAUSES]
    if len(changes) > MOST_CAUSES:
        yield f"and {len(changes) - MOST_CAUSES} more modules"


def _settings_with_files(node: Node, before: StageLineage) -> str:
    """The digest of the current settings with the old content of the files."""
    then = before.files or {}
    paths = [str(path) for path in node.stage.files]
    if set(paths) != set(then):
        return settings_digest(node.identity.content)
    return settings_digest(node.identity.content, [then[path] for path in paths])


def _code_changes(old: Mapping[str, str], reached: Mapping[str, str]) -> list[str]:
    """The reached modules of a stage that were edited or are new."""
    return [
        f"{module} {'was edited' if module in old else 'is new'}"
        for module, digest in sorted(reached.items())
        if old.get(module) != digest
    ]
