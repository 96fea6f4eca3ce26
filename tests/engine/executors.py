"""Executors by name; "serial" is this process."""

from stixel_cli.engine.parameters import LocalExecutor, ThreadsExecutor


def executors(workers=2):
    threads, local = ThreadsExecutor("threads", workers), LocalExecutor("local", workers, None)
    return {"serial": None, "local": local, "threads": threads}


EXECUTORS = executors()
