"""A scheduler of Dask and its workers, as a group of processes that ends with who started it.

Ctrl-C does not reach the group, and it can be killed at any moment, while it starts as well.
"""

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

from stixel_cli.engine.one_thread import ENVIRONMENT


class Cluster:
    """Worker processes on this machine, and the scheduler's address."""

    def __init__(self, workers: int):
        """Begin to start them; they are there when `address` is."""
        self._folder = tempfile.mkdtemp(prefix="stixel-dask-")
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__, str(workers), self._folder],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, **ENVIRONMENT},
        )

    def address(self) -> str:
        """Wait for the workers; the scheduler's address.

        Raises:
            RuntimeError: it could not be started.
        """
        line = self._process.stdout.readline()
        answer = json.loads(line) if line else {"error": "its process ended"}
        if "error" in answer:
            raise RuntimeError(answer["error"])
        return answer["address"]

    def close(self) -> None:
        """Kill them: what they run is not wanted any more."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                pipe.close()
        shutil.rmtree(self._folder, ignore_errors=True)


def serve(workers: int, folder: str) -> None:
    """Start scheduler and workers, print the address, and wait for the end."""
    Thread(target=_end_with_parent, args=(folder,), daemon=True).start()
    # What a stage prints must not stand in the way of the answer, nor fill a pipe.
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    try:
        from distributed import LocalCluster

        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            memory_limit=0,
            scheduler_kwargs={"allowed_failures": 0},
            local_directory=folder,
            env=ENVIRONMENT,
            silence_logs=logging.CRITICAL,
        )
    except Exception as error:
        answer.write(json.dumps({"error": f"{type(error).__name__}: {error}"}) + "\n")
        return
    answer.write(json.dumps({"address": cluster.scheduler_address}) + "\n")
    answer.close()
    while True:
        signal.pause()


def _end_with_parent(folder: str) -> None:
    """End the group when the other end of stdin is closed, as it is when that process dies."""
    sys.stdin.buffer.read()
    shutil.rmtree(folder, ignore_errors=True)
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    serve(int(sys.argv[1]), sys.argv[2])
