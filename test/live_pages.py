"""The page of the live view with a run that is acted, and what such pages are sent."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from middleware_network import eventually

import mechanism_sim as ms
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.messages.events import describe
from mechanism_sim.messages.segments import pack
from mechanism_sim.pages.assets import contents_of
from mechanism_sim.pages.controls import controls
from mechanism_sim.pages.live import Live
from mechanism_sim.pages.server import Command, Mailbox, Server
from mechanism_sim.pages.view import MODULES

ARRAYS = {'f8': np.float64, 'f4': np.float32, 'u1': np.uint8, 'i1': np.int8, 'i2': np.int16}
"""Those that pages read (player.js)."""


def data(tab: Any, name: str) -> str:
    """Value of the page's data attribute of a name."""
    return str(tab.page.evaluate(f'document.documentElement.dataset.{name} ?? ""'))


def unpacked(packed: dict[str, str]) -> Any:
    """An array as the page reads it."""
    array = np.frombuffer(base64.b64decode(packed['bdata']), ARRAYS[packed['dtype']])
    shape = packed.get('shape')
    return array.reshape([int(n) for n in shape.split(',')]) if shape else array


def motion_messages(machine: Any, ends: list[float], run: int = 0) -> list[Any]:
    """Motion messages of a run up to these times [s]."""
    going, found = machine.start(), []
    names = machine.physics.coordinates, machine.physics.clearances
    for end in ends:
        going.advance(end)
        motion, *_ = going.drain()
        assert isinstance(motion, Motion)
        found.append(pack(motion, *names, end, run))
    return found


class Acted:
    """The page of a machine whose run is acted here: what it asks for is kept, not done."""

    def __init__(self, tab: Any, scene: str, *ends: float) -> None:
        self.machine = ms.load_scene(scene)
        self.live, self.asked = Live(describe(self.machine)), Mailbox()
        self.controls = controls(self.machine)
        for message in motion_messages(self.machine, list(ends)):
            self.live.take(message)
        self.batch = self.live.batch()
        self.server = Server(
            contents_of('live', MODULES), 0, lambda: [self.stage(), self.batch], self.asked.put
        )
        self.tab, self.page = tab, tab.page
        tab.page.goto(self.server.address)
        assert eventually(lambda: data(tab, 'time'))

    def stage(self) -> dict[str, Any]:
        found = [control.to_json() for control in self.controls.values()]
        return {'type': 'stage', 'stage': self.live.stage.to_json(), 'controls': found}

    def tell(self, playing: bool = True, **values: float) -> None:
        """The state of the run, as the view tells it twice a second."""
        known = {path: control.value for path, control in self.controls.items()} | values
        state = {'time': 0.0, 'run': 0, 'factor': 0.1, 'operable': True, 'impacts': 0}
        self.server.send({'type': 'state', 'playing': playing, 'values': known, **state})
        wanted = '1' if playing else ''
        assert eventually(lambda: data(self.tab, 'playing') == wanted)
        self.page.wait_for_timeout(100)

    def command(self) -> Command:
        """Next command that the page asks for."""
        found: list[Command] = []
        assert eventually(lambda: found.append(self.asked.take()) or found[-1])
        return found[-1]
