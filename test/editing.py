"""The editor as tests use it: its session without a browser, and a hand with a mouse in one."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from middleware_network import PATIENCE
from running import command

from mechanism_sim import process_exit
from mechanism_sim.editor.document import Document
from mechanism_sim.editor.session import Session


class Page:
    """Requests of a page, and the messages it receives."""

    def __init__(self, scene: str = '') -> None:
        self.heard: list[dict[str, Any]] = []
        self.session = Session(Document.open(scene) if scene else Document(), self.heard.append)

    @property
    def state(self) -> dict[str, Any]:
        return self.session.greeting[0]

    @property
    def text(self) -> str:
        return self.session.document.text

    @property
    def said(self) -> list[str]:
        return [m['text'] for m in self.heard if m['type'] == 'said']

    def ask(self, kind: str, **more: Any) -> None:
        self.session.handle({'type': kind, **more})

    def set(self, path: str, text: str) -> None:
        self.ask('set', path=path.split('.'), text=text)

    def at(self, key: str) -> tuple[float, float]:
        """Position of a handle [m]."""
        (handle,) = [h for h in self.state['handles'] if h['key'] == key]
        return handle['at'][0], handle['at'][1]

    def spot(self, rng: random.Random) -> tuple[float, float, str]:
        """Any place on the sheet, on anything or nothing."""
        left, low, right, high = self.state['stage']['bounds']
        on = [h['key'] for h in self.state['handles']]
        on += [f'{link}/' for link in self.state['stage']['links']]
        return rng.uniform(left, right), rng.uniform(low, high), rng.choice([*on, ''])

    def drop(self, key: str, x: float, y: float, step: float = 1e-3) -> None:
        self.ask('drop', handle=key, x=x, y=y, step=step)

    def draw(
        self,
        what: str,
        *ends: tuple[float, float, str],
        step: float = 1e-3,
        seen: int | None = None,
    ) -> None:
        """A part between places, each on a handle, a link (its name with a /) or nothing.

        Parameters
        ----------
        seen : number of the state that the page shows; None for the newest
        """
        number = self.state['number'] if seen is None else seen
        spots = [
            {'x': x, 'y': y, 'number': number,
             'handle': on if '/' not in on else '', 'link': on.strip('/')}
            for x, y, on in (ends[0], ends[-1])
        ]  # fmt: skip
        both = dict(zip(('from', 'to'), spots, strict=True))
        self.ask('draw', what=what, step=step, near=5.0 * step, **both)


DRAWN_FOUR_BAR = """\
title: A new machine
mechanism: linkage
links:
  ground: {points: {p1: [0 mm, 0 mm], p2: [200 mm, 0 mm]}}
  link_1: {length: 50 mm}
  link_2: {length: 192 mm, points: {p1: [96 mm, 0 mm]}}
  link_3: {length: 177 mm}
joints:
  ground_link_1: {revolute: [ground.p1, link_1]}
  link_1_link_2: {revolute: [link_1.end, link_2]}
  ground_link_3: {revolute: [ground.p2, link_3]}
  link_2_link_3: {revolute: [link_2.end, link_3.end]}
guess: {link_2: 38.7 deg, link_3: 106.4 deg}
drive: {coordinate: link_1, speed: 60 rpm, start_angle: 90 deg}
"""


class Hand:
    """A hand with a mouse at the page of an editor."""

    def __init__(self, tab: Any, address: str) -> None:
        self.tab, self.page, self.mouse, self.address = tab, tab.page, tab.page.mouse, address
        self.page.goto(address)
        self.until(lambda: self.data('number'))

    def data(self, name: str) -> str:
        """Value of the page's data attribute of a name."""
        return str(self.page.evaluate(f'document.documentElement.dataset.{name} ?? ""'))

    def until(self, condition: Callable[[], Any]) -> None:
        """Wait until something is so."""
        end = time.monotonic() + 2.0 * PATIENCE
        while not condition():
            assert time.monotonic() < end, self.tab.complaints
            self.page.wait_for_timeout(20)

    def after(self, act: Callable[[], Any]) -> None:
        """Do something, and wait for what comes of it."""
        before = self.data('number')
        act()
        self.until(lambda: self.data('number') != before)

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Position on the page of a place [m] of the sheet."""
        over = self.page.locator('#over')
        left, low, scale = map(float, over.get_attribute('data-view').split())
        box = over.bounding_box()
        return (
            box['x'] + 0.5 * box['width'] + (x - left) * scale,
            box['y'] + 0.5 * box['height'] - (y - low) * scale,
        )

    def tool(self, name: str) -> None:
        """Take a tool."""
        self.page.locator(f'[data-tool="{name}"]').first.click()

    def click(self, *at: float) -> None:
        """Click on a place."""
        self.after(lambda: self.mouse.click(*self.at(*at)))

    def drag(self, x: float, y: float, u: float, v: float, steps: int = 4) -> None:
        """Drag from one place to another."""

        def act() -> None:
            self.mouse.move(*self.at(x, y))
            self.mouse.down()
            self.mouse.move(*self.at(u, v), steps=steps)
            self.mouse.up()

        self.after(act)

    def shift(self, right: float, down: float) -> None:
        """Shift the sheet by so many pixels."""
        self.tool('move')
        x, y = self.at(0.0, 0.0)
        self.mouse.move(x + 5.0, y + 5.0)
        self.mouse.down()
        self.mouse.move(x + 5.0 + right, y + 5.0 + down, steps=3)
        self.mouse.up()

    def fill(self, path: str, text: str) -> None:
        """Fill in a field of the panel."""
        field = self.page.locator(f'[name="{path}"]')
        field.fill(text)
        self.after(lambda: field.press('Tab'))

    def save(self, name: str) -> None:
        """Save under a name."""
        self.page.locator('#file').fill(name)
        self.page.locator('#save').click()
        self.page.get_by_text(f'saved: {name}').wait_for()

    def ran(self) -> str:
        """Wait for the run of what is shown; its digest."""
        self.until(lambda: self.data('run') == self.data('number') and self.data('run'))
        return self.data('digest')

    @property
    def text(self) -> str:
        return str(self.page.locator('#text').input_value())


@contextmanager
def editing(*args: str) -> Iterator[str]:
    """An editor in a process of its own: its address."""
    process = process_exit.start(
        command('edit', *args, '--port', '0', '--json'), text=True, stdout=subprocess.PIPE
    )
    try:
        assert process.stdout is not None
        text = ''
        while '}' not in text:
            line = process.stdout.readline()
            assert line
            text += line
        yield json.loads(text)['address']
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
    finally:
        process.kill()
        process.wait()
