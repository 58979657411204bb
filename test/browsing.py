"""A headless browser for tests: what a page shows, asks of the network, and complains about."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from websockets.sync.client import connect

PROGRAMS = 'chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable'
OPTIONS = (
    '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
    '--disable-background-networking', '--disable-component-update', '--disable-sync',
)  # fmt: skip

EVIDENCE = 'MECHANISM_SIM_EVIDENCE'
"""Environment variable: the folder where screenshots are kept; none, and they go with the test."""

PAGE_TIMEOUT = 180.0
"""[s] Longest wait for a page, on a machine that is busy with much else."""


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
        page.set_default_timeout(1e3 * PAGE_TIMEOUT)
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
        file = _evidence(self._folder, name)
        self.page.screenshot(path=file, **more)
        return file


def _evidence(folder: Path, name: str) -> Path:
    """Path of a screenshot."""
    folder = Path(os.environ.get(EVIDENCE) or folder)
    folder.mkdir(parents=True, exist_ok=True)
    return folder / f'{name}.png'


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


def violations(page: Any) -> list[tuple[str, Any, str]]:
    """Violations that axe-core finds on a page opened without its policy."""
    axe = pytest.importorskip('axe_playwright_python', reason='pip install axe-playwright-python')
    page.evaluate(Path(axe.__file__).with_name('axe.min.js').read_text(encoding='utf-8'))
    found = page.evaluate('axe.run({ iframes: false, preload: false })')['violations']
    return [(v['id'], v['nodes'][0]['target'], v['nodes'][0]['failureSummary']) for v in found]


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


def firefox() -> str | None:
    """The Firefox of this machine, if it has one."""
    return next((x for name in ('firefox-esr', 'firefox') if (x := shutil.which(name))), None)


class Firefox:
    """A headless Firefox with one page, by WebDriver BiDi (W3C); Playwright needs one of its own.

    Attributes
    ----------
    complaints, requests : as of `Tab`
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._asked = folder, 0
        self.complaints: list[str] = []
        self.requests: list[str] = []

    def __enter__(self) -> Firefox:
        command = [str(firefox()), '--headless', '--no-remote', '--profile', str(self._folder)]
        self._process = subprocess.Popen(
            [*command, '--remote-debugging-port', '0', 'about:blank'],
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        lines = iter(self._process.stderr or ())
        said = next(line for line in lines if 'WebDriver BiDi listening on' in line)
        self._socket = connect(f'{said.split()[-1]}/session', max_size=None)
        self._call('session.new', capabilities={})
        self._call('session.subscribe', events=['log.entryAdded', 'network.beforeRequestSent'])
        self._page = self._call('browsingContext.create', type='tab')['context']
        self.resize(1440, 900)
        return self

    def resize(self, width: int, height: int) -> None:
        """Make the page so large [px]."""
        size = {'width': width, 'height': height}
        self._call('browsingContext.setViewport', context=self._page, viewport=size)

    @property
    def tab(self) -> Any:
        """Page with the interface of a tab of Chromium, as far as `test_view.Acted` needs it."""
        page = SimpleNamespace(
            goto=self.goto,
            evaluate=lambda text: self.evaluate(f'JSON.stringify({text})'),
            wait_for_timeout=lambda ms: time.sleep(1e-3 * ms),
        )
        return SimpleNamespace(page=page)

    def __exit__(self, *_: object) -> None:
        self._socket.close()
        self._process.terminate()
        self._process.communicate()

    def goto(self, address: str) -> None:
        """Open a page, and wait until all of it is there."""
        self._call('browsingContext.navigate', context=self._page, url=address, wait='complete')
        self.evaluate("""new Promise(done => {
            const look = () => (!document.body.matches('.report')
                || document.documentElement.dataset.ready ? done() : setTimeout(look, 20));
            look();
        })""")

    def evaluate(self, expression: str) -> Any:
        """The value of an expression, whose text is JSON if it is a text."""
        told = self._call('script.evaluate', expression=expression, awaitPromise=True,
                          target={'context': self._page})['result']  # fmt: skip
        value = told.get('value')
        return json.loads(value) if told['type'] == 'string' else value

    def drag(self, places: list[tuple[float, float]]) -> None:
        """Press the mouse at the first of some places [px], and let go at the last."""
        moves = [
            {'type': 'pointerMove', 'x': round(x), 'y': round(y), 'duration': 16}
            for x, y in places
        ]
        down, up = ({'type': f'pointer{way}', 'button': 0} for way in ('Down', 'Up'))
        mouse = {'type': 'pointer', 'id': 'mouse', 'actions': [moves[0], down, *moves[1:], up]}
        self._call('input.performActions', context=self._page, actions=[mouse])

    def shoot(self, name: str) -> Path:
        """A screenshot, kept as evidence."""
        file = _evidence(self._folder, name)
        shot = self._call('browsingContext.captureScreenshot', context=self._page)
        file.write_bytes(base64.b64decode(shot['data']))
        return file

    def _call(self, method: str, **parameters: Any) -> Any:
        self._asked += 1
        told = {'id': self._asked, 'method': method, 'params': parameters}
        self._socket.send(json.dumps(told))
        while True:
            heard = json.loads(self._socket.recv(60.0))
            if heard.get('id') == self._asked:
                assert heard['type'] == 'success', heard
                return heard['result']
            self._note(heard['method'], heard['params'])

    def _note(self, event: str, told: Any) -> None:
        if event == 'log.entryAdded' and told['level'] in ('error', 'warn'):
            self.complaints.append(str(told['text']))
        elif event == 'network.beforeRequestSent':
            self.requests.append(told['request']['url'])


def time_of(page):
    return float(page.evaluate('document.documentElement.dataset.time'))


def scrub(page, share):
    page.locator('#scrub').evaluate(
        "(range, share) => { range.value = share; range.dispatchEvent(new Event('input')); }",
        share,
    )
    return time_of(page)
