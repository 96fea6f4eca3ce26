"""`stixel doctor`: what this machine has of what experiments need."""

import sys

from stixel_cli.cli.terminal import print_table
from stixel_cli.config.compose import compose
from stixel_cli.engine.store import open_store
from stixel_cli.experiment.health import examine
from stixel_cli.results.text import json_text


def doctor_command(json: bool) -> int:
    """Print what works here and what does not: 0 if the default experiment can run, else 1."""
    checks = examine(open_store(compose().configuration.cache))
    failing = [check for check in checks if check.status == "fails"]
    if json:
        sys.stdout.write(json_text({"ok": not failing, "checks": [vars(one) for one in checks]}))
    else:
        print_table(("what", "", "found"), [(one.name, one.status, one.text) for one in checks])
        sys.stdout.write(
            "".join(f"{one.name} fails: {one.text}\n" for one in failing)
            or "the default experiment can run here\n"
        )
    return 1 if failing else 0
