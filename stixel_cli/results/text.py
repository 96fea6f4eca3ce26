"""Text of result folders and commands: JSON, YAML, lists of words."""

import json
from collections.abc import Sequence
from typing import Any

import yaml

_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def json_text(value: Any) -> str:
    """JSON with two spaces of indent and a newline at its end; NaN is refused."""
    return json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def yaml_text(content: Any) -> str:
    """YAML in the order of the keys."""
    return yaml.dump(content, Dumper=_DUMPER, sort_keys=False, allow_unicode=True)


def listed(parts: Sequence[object]) -> str:
    """a, b and c."""
    texts = [str(part) for part in parts]
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)
