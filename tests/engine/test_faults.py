"""What goes wrong: nothing is lost, nothing wrong is taken for right, and one clear message."""

import importlib
import os
import signal
import subprocess
import sys
import threading
import time
import traceback
from concurrent.futures import wait
from pathlib import Path
from textwrap import dedent

import pytest
from executors import EXECUTORS

from stixel_cli.engine import pools, scheduler
from stixel_cli.engine.entries import collect, entries
from stixel_cli.engine.errors import CacheError, StageFailure, WorkerDied
from stixel_cli.engine.execute import execute
from stixel_cli.engine.store import VALUE, Store


def test_a_stage_that_raises(project):
    project.add_line("gather", "raise ValueError('no such thing')")
    with pytest.raises(StageFailure, match=r"^gather: ValueError: no such thing\n") as caught:
        project.run(executor="local")
    failure = caught.value
    assert (failure.stage, failure.label) == ("gather", "gather")
    assert isinstance(failure.cause, ValueError) and failure.__cause__ is failure.cause
    assert "in gather" in failure.traceback_text and "run_node" not in failure.traceback_text
    assert failure.traceback_text in failure.__notes__, "Python shows where it happened"
    assert "gather.py, line " in failure.place
    assert failure.place.endswith("; raise ValueError('no such thing')`")
    project.calls()
    project.edit("gather", "; raise ValueError('no such thing')", "")
    project.run()
    # What was finished is kept: only the stage itself, and pictures not begun by then.
    assert set(project.calls()) <= {"gather", "grid 2", "grid 9", "show 2", "show 9"}


@pytest.mark.parametrize("executor", ["local", "serial"])
def test_a_printed_traceback_has_the_frames_of_the_stage_once(project, executor):
    project.edit("helpers", "    return FACTOR * values", "    return values.alphaa")
    with pytest.raises(StageFailure) as caught:
        project.run(executor=executor, targets=["double"])
    assert caught.value.place.endswith("helpers.py, line 7: `return values.alphaa`")
    assert "".join(traceback.format_exception(caught.value)).count("in scale\n") == 1


def test_an_error_that_cannot_travel_arrives_as_text(project):
    project.add_line("gather", "raise type('Own', (Exception,), {})('of its own')")
    with pytest.raises(StageFailure, match="Own: of its own"):
        project.run(executor="local")


def test_a_result_that_cannot_be_stored_is_the_stages_failure(project):
    project.edit("show", "return doubled.first, grid, frame", "return lambda: 1")
    with pytest.raises(StageFailure, match=r"^show\[\d\]: .*pickle"):
        project.run()


KILL = "import os; os.kill(os.getpid(), 9)"


def test_a_stage_that_always_kills_its_worker(project, notes):
    project.add_line("gather", KILL)
    with pytest.raises(StageFailure, match=r"gather: WorkerDied: .*twice") as caught:
        project.run(executor="local", progress=notes)
    assert isinstance(caught.value.cause, WorkerDied)
    assert len(notes.notes) == 2 and "gather" in notes.notes[1]
    assert project.calls().count("gather") == 2
    project.edit("gather", KILL, "pass")
    project.run()
    assert "numbers" not in project.calls()


def test_a_worker_that_is_killed_once_costs_nothing_but_time(project, notes):
    marker = project.folder / "killed"
    once = f"import os, pathlib; p = pathlib.Path({str(marker)!r}); "
    project.add_line("gather", f"{once}p.exists() or (p.touch(), os.kill(os.getpid(), 9))")
    graph = project.graph()
    project.run(graph, executor="local", progress=notes)
    assert all(project.store.verify(node.key) for node in graph.nodes.values())
    assert len(notes.notes) == 1 and notes.notes[0].startswith("a worker crashed")
    assert project.calls().count("double 0") == 1, "what was in the store is not recomputed"


def damage(project, graph, name, position=0, cut=False):
    path = project.store.entry(graph.of_stage(name)[position].key) / VALUE
    content = path.read_bytes()
    other = content[:-3] + bytes([content[-3] ^ 4]) + content[-2:]
    path.write_bytes(content[:-5] if cut else other)


@pytest.mark.parametrize("executor", ["serial", "local"])
def test_a_damaged_input_is_made_again(project, executor, notes):
    graph = project.graph()
    project.run(graph)
    expected = project.store.load(graph.of_stage("show")[0].key)
    project.calls()
    # `show` is damaged and needs `double`, which is found damaged only then.
    damage(project, graph, "show")
    damage(project, graph, "double")
    execution = project.run(graph, executor=executor, progress=notes)
    assert set(project.calls()) == {"double 0", "show 2"}
    (note,) = notes.notes
    said = "cached result of double[0:4] is unusable (its content has changed)"
    assert note == f"{said}; recomputing it"
    computed = {one["name"]: one["nodes_computed"] for one in execution.stage_records()}
    assert computed["double"] == 1
    assert project.store.load(graph.of_stage("show")[0].key) == expected


def test_a_damaged_input_of_a_lazy_sequence_is_made_again_if_it_can_be_set_aside(
    project, notes, monkeypatch
):
    graph = project.graph()
    project.run(graph)
    project.calls()
    damage(project, graph, "gather")
    damage(project, graph, "double", 1)
    damage(project, graph, "running", 2, cut=True)
    project.run(graph, progress=notes)
    assert set(project.calls()) == {"double 4", "running 8", "gather"}
    project.run(graph)
    damage(project, graph, "double")
    monkeypatch.setattr(Path, "rename", lambda *args: (_ for _ in ()).throw(OSError("no")))
    graph = project.graph(seed=2)
    with pytest.raises(CacheError, match=r"double\[0:4\] in .* cannot be replaced"):
        project.run(graph, progress=notes)


def test_a_cache_that_cannot_be_written_is_said_before_anything_runs(project):
    (project.folder / "file").write_text("")
    project.store = Store(project.folder / "file" / "cache")
    with pytest.raises(CacheError, match="cannot write in the cache"):
        project.run()
    assert project.calls() == []


def test_code_that_was_imported_before_an_edit_is_not_taken_for_the_edited(project):
    """As in a notebook: the old module is still loaded."""
    project.forget()
    importlib.import_module(f"{project.name}.helpers")
    project.edit("helpers", "FACTOR = 3.0", "FACTOR = 4.0")
    # Clocks of file systems are coarse.
    os.utime(project.package / "helpers.py", (time.time() + 1.0,) * 2)
    graph = project.graph()
    for executor in ("serial", "threads"):
        with pytest.raises(Exception, match=r"double:double was edited"):
            execute(graph, ["gather"], project.store, EXECUTORS[executor])
        assert "double[0:4]" not in project.contents(graph)
    # Worker processes import what is there now.
    execute(graph, ["gather"], project.store, EXECUTORS["local"])
    assert project.store.load(graph.of_stage("double")[0].key).values.tolist() == [0, 8, 16, 24]


def test_code_that_is_edited_on_the_way_is_not_stored_under_the_old_key(project):
    graph = project.graph()
    project.edit("helpers", "FACTOR = 3.0", "FACTOR = 4.0")
    with pytest.raises(Exception, match=r"double:double was edited"):
        project.run(graph, executor="local")
    assert not any(project.store.has(node.key) for node in graph.of_stage("double"))
    # A comment does not matter.
    graph = project.graph()
    project.edit("helpers", "# a comment", "# another comment")
    project.run(graph, executor="local")


SCRIPT = """
    import signal
    import sys
    from pathlib import Path
    from stixel_cli.engine.execute import execute
    from stixel_cli.engine.graph import GraphBuilder
    from stixel_cli.engine.parameters import LocalExecutor, ThreadsExecutor
    from stixel_cli.engine.progress import Progress
    from stixel_cli.engine.keys import Stage
    from stixel_cli.engine.store import Store

    sys.path.insert(0, {folder!r})
    # Where the tests run in the background of a shell, Ctrl-C is ignored from the start.
    signal.signal(signal.SIGINT, signal.default_int_handler)

    class Planned(Progress):
        def begin(self, nodes, cached):
            print("planned", flush=True)

    stage = Stage("wait", "{name}.waiting:wait", "map", {{}}, {{"folder": {folder!r}}})
    try:
        graph = GraphBuilder().build([stage], 2, 1)
        execute(graph, ["wait"], Store({cache!r}), executor={executor!r}, progress=Planned())
    except KeyboardInterrupt:
        print("interrupted")
    """

WAITING = """
    import time
    from pathlib import Path

    def wait(folder, frames):
        with open(Path(folder) / "calls", "a") as file:
            file.write(f"wait {frames.start}\\n")
        for _ in range(60000):
            if (Path(folder) / "go").exists():
                return frames.start
            time.sleep(0.01)
        raise TimeoutError
    """


def start(project, executor):
    """Another process that runs two waiting nodes; it has planned when this returns."""
    if not (project.package / "waiting.py").exists():
        project.write("waiting", WAITING)
    places = {"folder": str(project.folder), "cache": str(project.store.folder)}
    script = dedent(SCRIPT).format(**places, name=project.name, executor=EXECUTORS[executor])
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    command = [sys.executable, "-c", script]
    process = subprocess.Popen(command, start_new_session=True, **pipes)
    assert process.stdout.readline() == "planned\n"
    return process


def wait_for_calls(project, count):
    deadline = time.monotonic() + 300.0
    while time.monotonic() < deadline:
        if project.calls_file.exists() and project.calls_file.read_text().count("\n") >= count:
            return
        time.sleep(0.01)
    raise TimeoutError


def test_processes_that_want_the_same_compute_it_once(project):
    processes = [start(project, executor) for executor in ("local", "serial")]
    (project.folder / "go").touch()
    for process in processes:
        output, errors = process.communicate(timeout=600)
        assert (process.returncode, output, errors) == (0, "", "")
    assert project.calls() == ["wait 0", "wait 1"]
    assert list((project.store.folder / "locks").iterdir()) == []


def test_a_closed_pool_leaves_no_thread():
    """One that deletes a semaphore while this process ends makes the tracker report a leak."""
    before = set(threading.enumerate())
    for _ in range(5):
        pool = pools.ProcessPool(1)
        assert pool.submit(abs, -1).result() == 1
        pool.close()
        assert set(threading.enumerate()) <= before


def test_kill_9_of_a_process_with_workers(project):
    process = start(project, "local")
    wait_for_calls(project, 2)
    process.kill()
    # Its workers hold the locks while they live; they end or store, and neither misleads.
    (project.folder / "go").touch()
    process.communicate(timeout=600)
    process = start(project, "local")
    assert process.communicate(timeout=600) == ("", "")
    assert len(entries(project.store, values=True)) == 2
    assert collect(project.store, max_size=10**9).in_use == 0
    assert list((project.store.folder / "leases").iterdir()) == []


@pytest.mark.parametrize("executor", ["local", "threads", "serial"])
def test_ctrl_c_ends_it_and_its_workers(project, executor):
    process = start(project, executor)
    wait_for_calls(project, 1 if executor == "serial" else 2)
    os.killpg(process.pid, signal.SIGINT)
    # The stage would wait for ten minutes.
    output, errors = process.communicate(timeout=600)
    assert (output, errors) == ("interrupted\n", "")
    assert not any(path.name == VALUE for path in project.store.folder.rglob("*"))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("executor", ["local", "threads"])
def test_ctrl_c_in_the_midst_of_waiting_ends_it_at_the_next_look(
    project, monkeypatch, executor, number
):
    """An exception in there would leave a future's lock held, and the pool's end wait for it."""
    seen = []

    def interrupted(*arguments, **options):
        signal.raise_signal(number)
        seen.append("went on")
        return wait(*arguments, **options)

    monkeypatch.setattr(scheduler, "wait", interrupted)
    # Where the tests run in the background of a shell, Ctrl-C is ignored from the start.
    before = signal.signal(number, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            project.run(executor=executor)
        assert signal.getsignal(number) is signal.default_int_handler
    finally:
        signal.signal(number, before)
    assert seen == ["went on"]


def test_ctrl_c_does_not_reach_workers_that_are_being_started():
    """They would die of it with a traceback, while they import what would have it ignored."""
    # In a process of its own: the first pool of one starts more than its workers.
    script = """
        import signal
        from stixel_cli.engine.pools import ProcessPool
        pool = ProcessPool(1)
        assert signal.SIGINT in pool.submit(signal.pthread_sigmask, signal.SIG_BLOCK, ()).result()
        pool.close()
        assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
        """
    subprocess.run([sys.executable, "-c", dedent(script)], check=True, timeout=600)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_worker_is_a_copy_of_a_process_with_one_thread(threads):
    """A lock that another thread has would stay locked in a copy."""
    script = f"""
        import os, signal, threading
        from stixel_cli.engine import pools
        pools.MARK = "set by the parent"
        end = threading.Event()
        for _ in range({threads} - 1):
            threading.Thread(target=end.wait).start()
        pool = pools.ProcessPool(1, may_fork=True)
        code = "hasattr(__import__('sys').modules.get('stixel_cli.engine.pools'), 'MARK')"
        assert pool.submit(eval, code).result() == ({threads} == 1)
        assert signal.SIGINT in pool.submit(signal.pthread_sigmask, signal.SIG_BLOCK, ()).result()
        assert pool.submit(signal.getsignal, signal.SIGTERM).result() == signal.SIG_DFL
        assert pool.submit(os.getppid).result() == os.getpid()
        pool.close()
        end.set()
        """
    environment = os.environ | pools.ENVIRONMENT
    subprocess.run([sys.executable, "-c", dedent(script)], env=environment, check=True, timeout=600)
