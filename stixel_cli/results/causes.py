"""Why a stage has other keys than it had: versions, files, settings or code that changed since."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from stixel_cli.engine.graph import Graph, Node
from stixel_cli.results.lineage import Lineage, StageLineage, settings_digest

MOST_CAUSES = 8
ALTERED = "its settings are not those of the run: was config.yaml altered?"


@dataclass(frozen=True)
class OtherStage:
    """The first stage, in the order of the data, that is made of something else than it was.

    Attributes:
        stage: its name.
        known: whether the old run had such a stage.
        causes: why, as far as it can be told; one line each.
    """

    stage: str
    known: bool
    causes: tuple[str, ...]


def first_other_stage(
    old: Lineage, new: Lineage, graph: Graph, settings: str = ALTERED
) -> OtherStage | None:
    """The first stage of `new` whose keys are not those of `old`; None if all are the same.

    `graph` is the new one; `settings` is what to say where settings differ.
    """
    for name, stage in new.stages.items():
        before = old.stages.get(name)
        if before is None:
            return OtherStage(name, False, ())
        if before.keys != stage.keys:
            node = graph.of_stage(name)[0]
            return OtherStage(name, True, tuple(_causes(before, stage, old.code, node, settings)))
    return None


def _causes(
    before: StageLineage,
    after: StageLineage,
    code: Mapping[str, str] | None,
    node: Node,
    settings: str,
) -> Iterator[str]:
    """Why a stage that takes the same inputs has another key."""
    for package, version in after.versions.items():
        then = before.versions.get(package)
        if then != version:
            yield f"{package} {then or 'none'} → {version or 'none'}"
    for path, content in (after.files or {}).items():
        then = (before.files or {}).get(path)
        if then is not None and then != content:
            yield f"the content of {path} is not what it was"
    if before.settings != _settings_with_files(node, before):
        files = ", ".join(after.files or {}) if before.files is None else ""
        yield f"{settings[:-1]}, or {files}?" if files else settings
    if code is None:
        yield "which code changed is not known: the folder does not say"
        return
    changes = _code_changes(code, node.identity.code.modules)
    yield from changes[:MOST_CAUSES]
    if len(changes) > MOST_CAUSES:
        yield f"and {len(changes) - MOST_CAUSES} more modules"


def _settings_with_files(node: Node, before: StageLineage) -> str:
    """What the digest of the settings is now, were the files what they were."""
    then = before.files or {}
    paths = [str(path) for path in node.stage.files]
    if set(paths) != set(then):
        return settings_digest(node.identity.content)
    return settings_digest(node.identity.content, [then[path] for path in paths])


def _code_changes(old: Mapping[str, str], reached: Mapping[str, str]) -> list[str]:
    """Which modules, of those that a stage reaches, were edited or are new."""
    return [
        f"{module} {'was edited' if module in old else 'is new'}"
        for module, digest in sorted(reached.items())
        if old.get(module) != digest
    ]
