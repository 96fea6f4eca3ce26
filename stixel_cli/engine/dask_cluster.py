"""A scheduler of Dask and its workers on this machine, as a group of processes of their own."""

import json
import logging
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from contextlib import suppress
from threading import Thread
from typing import TYPE_CHECKING

from stixel_cli.engine.limits import ENVIRONMENT
from stixel_cli.engine.parameters import PROGRAM

if TYPE_CHECKING:
    from distributed import LocalCluster

SETTINGS = {
    "DASK_DISTRIBUTED__DEPLOY__LOST_WORKER_TIMEOUT": "1h",
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
}
"""Settings of Dask: time that a crashed worker has to restart; no samples of the running code.

After 15 s, the default, Dask gives the worker up. On a loaded machine no worker would be left, and
the run would wait forever.
"""


class Cluster:
    """A scheduler and its workers as a process group, which ends with the process that started it.

    Ctrl-C does not reach the group, and the group can be killed at any time, also during its start.
    """

    def __init__(self, workers: int):
        """Start the group; `address` waits until it is ready."""
        self._folder = tempfile.mkdtemp(prefix=f"{PROGRAM}-dask-")
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__, str(workers), self._folder],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, **ENVIRONMENT, **SETTINGS},
        )

    def address(self) -> str:
        """Wait for the workers; return the address of the scheduler.

        Raises:
            RuntimeError: the cluster could not be started.
        """
        line = self._process.stdout.readline()
        answer = json.loads(line) if line else {"error": "its process ended"}
        if "error" in answer:
            raise RuntimeError(answer["error"])
        return answer["address"]

    def close(self) -> None:
        """Kill the group, with all tasks that still run."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                pipe.close()
        shutil.rmtree(self._folder, ignore_errors=True)


def serve(workers: int, folder: str) -> None:
    """Start the scheduler and its workers, print the address, and wait to be ended."""
    Thread(target=_end_with_parent, args=(folder,), daemon=True).start()
    # The output of a stage must not mix with the answer, nor fill the pipe.
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    try:
        cluster = local_cluster(workers, local_directory=folder, env=ENVIRONMENT)
    except Exception as error:
        answer.write(json.dumps({"error": f"{type(error).__name__}: {error}"}) + "\n")
        return
    answer.write(json.dumps({"address": cluster.scheduler_address}) + "\n")
    answer.close()
    while True:
        signal.pause()


def local_cluster(workers: int, **options: object) -> "LocalCluster":
    """Start a scheduler and workers of one thread each, which accept connections of this machine.

    Dask does not retry a task that crashed its worker: the engine does.
    """
    from distributed import LocalCluster

    return LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
        memory_limit=0,
        scheduler_kwargs={"allowed_failures": 0},
        silence_logs=logging.CRITICAL,
        **options,
    )


def _end_with_parent(folder: str) -> None:
    """End the group when stdin is closed, which happens when the parent ends."""
    sys.stdin.buffer.read()
    shutil.rmtree(folder, ignore_errors=True)
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    serve(int(sys.argv[1]), sys.argv[2])
