"""What the runs of a sweep were made of, so that a later run of one can be compared with it."""

from stixel_cli.engine.store import Store
from stixel_cli.results import lineage
from stixel_cli.sweeps.folder import RUNS, SweepFolder
from stixel_cli.sweeps.graphs import PlannedRun


def remove_unused_code(folder: SweepFolder) -> None:
    """Take away what older runs of the sweep noted of code, where no run refers to it any more.

    What cannot be removed stays: it does no harm.
    """
    files = list((folder.path / lineage.CODE_FOLDER).glob("*.json"))
    if len(files) < 2:
        return
    used = {lineage.read_code_name(run) for run in (folder.path / RUNS).glob("[0-9]*")}
    folder.remove(f"{lineage.CODE_FOLDER}/{one.name}" for one in files if one.stem not in used)


class RunLineages:
    """The lineages of runs; what they say of the code is in the sweep's folder once.

    Four fifths of a lineage are digests of functions, and most runs reach the same.
    """

    def __init__(self, store: Store, folder: SweepFolder):
        self._store = store
        self._folder = folder
        self._digests: dict[str, str] = {}
        self._codes: dict[tuple[str, ...], str] = {}

    def text(self, planned: PlannedRun) -> str:
        """The file of a run that is complete; its code is in the sweep's folder afterwards.

        Raises:
            UserError: if the folder cannot be written.
            CacheError: if the store cannot be read.
        """
        graph = planned.graph
        keys = graph.ancestors(planned.targets)
        found = lineage.lineage_of(graph, keys, self._store, self._digests)
        reached = tuple(graph.of_stage(name)[0].identity.code.digest for name in found.stages)
        if reached not in self._codes:
            name, text = lineage.shared_code(found)
            self._folder.write_table(f"{lineage.CODE_FOLDER}/{name}.json", text)
            self._codes[reached] = name
        return lineage.run_lineage_text(found, self._codes[reached])
