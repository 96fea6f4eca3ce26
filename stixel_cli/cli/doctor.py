"""`stixel doctor`: check this machine."""

from stixel_cli.cli.cache import local_store
from stixel_cli.cli.errors import tell
from stixel_cli.cli.options import Json
from stixel_cli.cli.terminal import print_json, print_table, say


def doctor(json: Json = False) -> int:
    """Check whether this machine can run experiments.

    It checks versions, cores, threads, renderers, cache and disk. The exit code is 0 if the default
    experiment can run here, otherwise 1.
    """
    from stixel_cli.machine.health import examine

    if not json:
        tell("checking; each renderer draws a picture, which takes some seconds …")
    checks = examine(local_store())
    failing = [check for check in checks if check.status == "fails"]
    if json:
        print_json({"ok": not failing, "checks": [vars(check) for check in checks]})
    else:
        print_table(
            ("check", "", "found"), [(check.name, check.status, check.text) for check in checks]
        )
        faults = [f"{check.name} fails: {check.text}" for check in failing]
        say(*(faults or ["the default experiment can run here"]))
    return 1 if failing else 0
