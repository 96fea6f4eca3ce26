"""Pages opened in the system's Chromium, without a window: a fixture for any test module.

`tests/conftest.py` hands it to all. A test asks for `open_page` and is skipped, with the reason,
where there is no browser:

    def test_it(open_page, tmp_path):
        opened = open_page(tmp_path / "page.html", width=390, height=844, dark=True)
        opened.page.get_by_role("button", name="Play").click()
        assert opened.overflow() == 0
"""

import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")


@dataclass(frozen=True)
class OpenedPage:
    """A page that is open.

    Attributes:
        page: Playwright's own page.
        problems: what the console said as an error or a warning, what the scripts threw, and
            every request for anything but the page itself and what it holds; grows as they come.
    """

    page: Any
    problems: list[str] = field(default_factory=list)

    def settle(self) -> None:
        """Wait for two frames: observers of sizes, by which charts are drawn, have run by then."""
        frame = "requestAnimationFrame"
        self.page.evaluate(f"new Promise(done => {frame}(() => {frame}(done)))")

    def overflow(self) -> int:
        """By how many px the page is wider than the window; 0 if it fits."""
        root = "document.documentElement"
        return self.page.evaluate(f"{root}.scrollWidth - {root}.clientWidth")


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """One browser a session."""
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip(f"no browser is installed: none of {', '.join(NAMES)} is found")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as driver:
        options = ["--no-sandbox", "--disable-dev-shm-usage"]
        started = driver.chromium.launch(executable_path=program, args=options)
        try:
            yield started
        finally:
            started.close()


@pytest.fixture
def open_page(browser) -> Iterator[Callable[..., OpenedPage]]:
    """Function (file, width=1440, height=900, dark=False, touch=False, still=False) -> OpenedPage.

    `still` is a user's wish for little motion. At its end a test fails for the problems of a page.
    """
    all_opened = []

    def open_file(
        file: Path,
        width: int = 1440,
        height: int = 900,
        dark: bool = False,
        touch: bool = False,
        still: bool = False,
    ) -> OpenedPage:
        address = file.resolve().as_uri()
        page = browser.new_page(
            viewport={"width": width, "height": height},
            color_scheme="dark" if dark else "light",
            has_touch=touch,
            is_mobile=touch,
            reduced_motion="reduce" if still else "no-preference",
        )
        page.set_default_timeout(300_000)
        opened = OpenedPage(page)
        all_opened.append(opened)
        say = opened.problems.append

        def on_console(said):
            if said.type in ("error", "warning"):
                say(f"{said.type}: {said.text}")

        def on_request(asked):
            if asked.url.partition("#")[0] != address and not asked.url.startswith("data:"):
                say(f"request: {asked.url[:200]}")

        page.on("console", on_console)
        page.on("pageerror", lambda error: say(f"thrown: {error}"))
        page.on("request", on_request)
        page.goto(address)
        opened.settle()
        return opened

    yield open_file
    for opened in all_opened:
        opened.page.close()
    assert [problem for opened in all_opened for problem in opened.problems] == []
