"""JSON as the result folders and the commands' `--json` have it."""

import json
from typing import Any


def json_text(value: Any) -> str:
    """JSON with two spaces of indent and a newline at its end; NaN is refused."""
    return json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
