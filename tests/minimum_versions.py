"""Print the lowest version of every dependency that pyproject.toml declares, as pip's requirements.

`make minimum` installs them.
"""

import re
import tomllib
from pathlib import Path

PYPROJECT = Path(__file__).parents[1] / "pyproject.toml"
REQUIREMENT = re.compile(r"(?P<name>[\w.-]+)>=(?P<lowest>[\w.]+)[^;]*(?P<marker>;.*)?")


def minimum_versions(pyproject: str) -> list[str]:
    """Lines `name==version`, with the requirement's marker, of all extras too; each name once.

    Those of the site are left out: no run imports them, and they want a newer markdown-it-py.
    """
    project = tomllib.loads(pyproject)["project"]
    extras = [own for name, own in project["optional-dependencies"].items() if name != "docs"]
    lines = set()
    for text in sum(extras, project["dependencies"]):
        found = REQUIREMENT.fullmatch(text)
        if not found:
            raise ValueError(f"pyproject.toml: {text} has no lowest version NAME>=VERSION")
        lines.add(f"{found['name']}=={found['lowest']}{found['marker'] or ''}")
    return sorted(lines)


if __name__ == "__main__":
    print("\n".join(minimum_versions(PYPROJECT.read_text(encoding="utf-8"))))
