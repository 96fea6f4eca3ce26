"""Executors by name; "serial" is this process."""

from stixel_cli.engine.parameters import LocalExecutor, ThreadsExecutor


def executors(workers=2):
    return {
        "serial": None,
        "local": LocalExecutor("local", workers, None),
        "threads": ThreadsExecutor("threads", workers),
    }


EXECUTORS = executors()
