"""A headless browser for tests: what a page shows, asks of the network, and complains about."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

PROGRAMS = 'chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable'
OPTIONS = (
    '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
    '--disable-background-networking', '--disable-component-update', '--disable-sync',
)  # fmt: skip

EVIDENCE = 'MECHANISM_SIM_EVIDENCE'
"""Environment variable: the folder where screenshots are kept; none, and they go with the test."""


def program() -> str | None:
    """The browser of this machine, if it has one."""
    return next((found for name in PROGRAMS if (found := shutil.which(name))), None)


class Tab:
    """A page in a browser.

    Attributes
    ----------
    page : Playwright's
    complaints : errors and warnings of its console, and exceptions nobody caught
    requests : addresses it asked for, data: and blob: left out
    """

    def __init__(self, page: Any, folder: Path) -> None:
        self.page, self._folder = page, folder
        self.complaints: list[str] = []
        self.requests: list[str] = []
        page.on('console', self._listen)
        page.on('pageerror', lambda error: self.complaints.append(str(error)))
        page.on('request', self._note)

    def _listen(self, message: Any) -> None:
        if message.type in ('error', 'warning'):
            self.complaints.append(f'{message.type}: {message.text}')

    def _note(self, request: Any) -> None:
        if not request.url.startswith(('data:', 'blob:')):
            self.requests.append(request.url)

    def shoot(self, name: str, **more: Any) -> Path:
        """A screenshot, kept as evidence."""
        folder = Path(os.environ.get(EVIDENCE) or self._folder)
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / f'{name}.png'
        self.page.screenshot(path=file, **more)
        return file


@contextmanager
def browsing() -> Iterator[Any]:
    """A headless browser; None where none is installed."""
    found = program()
    if found is None:
        yield None
        return
    from playwright.sync_api import sync_playwright  # noqa: PLC0415

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=list(OPTIONS))
        yield browser
        browser.close()


def open_page(tab: Tab, file: Path) -> None:
    """Open a report, and wait until its charts can be drawn."""
    tab.page.goto(file.as_uri())
    tab.page.wait_for_selector('html[data-ready="1"]', state='attached')


Box = tuple[float, float, float, float]


def boxes(page: Any, selector: str) -> list[Box]:
    """Of the elements that are seen: left, top, right, bottom [px]."""
    found: list[Box] = page.locator(selector).evaluate_all(
        """all => all.map(x => x.getBoundingClientRect()).filter(b => b.width && b.height)
            .map(b => [b.left, b.top, b.right, b.bottom])"""
    )
    return found


def overlapping(rectangles: list[Box]) -> list[tuple[Box, Box]]:
    """Pairs of boxes of which one covers a part of the other."""
    return [
        (a, b)
        for i, a in enumerate(rectangles)
        for b in rectangles[:i]
        if min(a[2], b[2]) - max(a[0], b[0]) > 0.5 and min(a[3], b[3]) - max(a[1], b[1]) > 0.5
    ]
