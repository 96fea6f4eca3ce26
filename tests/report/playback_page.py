"""What the tests read and set on the page that plays a run back, in a browser."""

import re

import numpy as np
from playback_runs import SCANS

LAST = SCANS - 1


def frame(page):
    return int(page.locator("#scrub").input_value())


def drawn(page, name):
    """Corners (n, 2) m of a path on the map, as the browser has it."""
    text = page.locator(f"#{name}").get_attribute("d")
    return np.array(re.findall(r"[ML](\S+) ([^MLZ]+)", text), dtype=float)


def to(page, k):
    page.locator("#scrub").fill(str(k))
    assert frame(page) == k
