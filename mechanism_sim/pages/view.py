"""The node of the live view: follows a running graph and shows it to browsers on this machine."""

from __future__ import annotations

import time
import webbrowser
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from mechanism_sim.errors import InputError, RunError, quoted
from mechanism_sim.messages import Impact, Motion, String
from mechanism_sim.nodes.described_node import DescribedNode
from mechanism_sim.nodes.middleware import (
    HistoryPolicy,
    MiddlewareError,
    Parameter,
    QoSProfile,
    ReentrantCallbackGroup,
    ReliabilityPolicy,
)
from mechanism_sim.nodes.qos import LATCHED
from mechanism_sim.pages.assets import contents_of
from mechanism_sim.pages.controls import Control, controls
from mechanism_sim.pages.live import Live
from mechanism_sim.pages.operator import PAUSED, PLAYING, Operator
from mechanism_sim.pages.server import PORT, Command, Mailbox, Server

MODULES = (
    'html', 'svg', 'stage', 'lens', 'player', 'stream', 'strip', 'sliders', 'keys', 'zoom', 'wire',
    'live',
)  # fmt: skip

#: No node waits for a page: messages to slow pages are dropped.
NEWEST = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=200, reliability=ReliabilityPolicy.BEST_EFFORT
)

_FRAMES, _LISTEN, _LOOK = 0.04, 0.02, 0.5  # [s] between batches, commands, looks at the run
_PATIENCE = 10.0  # [s] for the answer to a command, before the next is begun
_PACE = 1.0  # [s] over which the real-time factor is measured


def print_address(address: str) -> None:
    """Print the address of the page."""
    print(f'View: {address}', flush=True)


class ViewNode(DescribedNode):
    """Node that shows the running machine and forwards requests; no node waits for this one.

    Parameters of the node: ``port`` of the web server, 0 for any that is free; ``open``, to open
    a browser.

    Parameters
    ----------
    opened : callback with the address of the page
    starting : True while a machine to be shown is started
    """

    def __init__(
        self,
        parameters: Sequence[Parameter] = (),
        opened: Callable[[str], None] = print_address,
        starting: bool = False,
    ) -> None:
        super().__init__('view', parameters)
        port = self.declare('port', PORT, 'Of the web server on this machine; 0: any', None, True)
        browse = self.declare('open', False, 'Open a browser', read_only=True)
        self._live: Live | None = None
        self._controls: dict[str, Control] = {}
        self._waiting = {'type': 'waiting', 'starting': starting}
        self._greeting: list[dict[str, Any]] = [self._waiting]
        self._asked = Mailbox()
        self._busy_since: float | None = None
        self._state: int | None = None
        self._paused_here = self._rests = self._said_paused = False
        self._seen: list[tuple[float, float]] = []
        self._operator = Operator(self)
        self.create_subscription(String, 'scene', self._meet, LATCHED)
        motion = self.create_subscription(Motion, 'motion', self._move, NEWEST)
        self.create_subscription(Impact, 'impacts', self._receive_impact, NEWEST)
        self._topic = motion.topic_name
        self.server = Server(
            contents_of('live', MODULES),
            None if port == PORT else port,
            lambda: self._greeting,
            self._asked.put,
        )
        apart = ReentrantCallbackGroup()  # a pending request blocks nothing else
        self.create_timer(_FRAMES, self._show)
        self.create_timer(_LISTEN, self._obey, callback_group=apart)
        self.create_timer(_LOOK, self._look, callback_group=apart)
        opened(self.server.address)
        if browse:
            webbrowser.open(self.server.address)

    # --- received -------------------------------------------------------------------------------

    def _meet(self, message: Any) -> None:
        if self._live and self._live.text == message.data:
            return
        try:
            self._live = Live(message.data)
        except (InputError, RunError) as error:
            self._send_message(f'the running machine cannot be shown: {error}', 'error')
            return
        found, before = controls(self._live.machine), self._controls
        for path, control in found.items():
            old = before.get(path)
            if old and old.unit == control.unit and old.low <= control.value <= old.high:
                found[path] = replace(control, low=old.low, high=old.high, step=old.step)
        self._controls = found
        self._seen.clear()
        self._greet()

    def _greet(self) -> None:
        """Send all pages, open or to be opened, what is to be shown."""
        if self._live:
            found = [control.to_json() for control in self._controls.values()]
            message: dict[str, Any] = {
                'type': 'stage',
                'stage': self._live.stage.to_json(),
                'controls': found,
            }
        else:
            message = self._waiting
        self._greeting = [message]
        self.server.send(message)

    def _move(self, message: Any) -> None:
        if self._live:
            self._live.take(message)

    def _receive_impact(self, message: Any) -> None:
        if self._live:
            self._live.add_impact(message)

    # --- what is shown ------------------------------------------------------------------------

    def _show(self) -> None:
        if self._live is None or not self.server.pages:
            return
        if batch := self._live.batch():
            self.server.send(batch, may_drop=True)
            self._greeting = [self._greeting[0], batch]

    async def _look(self) -> None:
        """See how the run is, and what its parameters are now."""
        if not self.get_publishers_info_by_topic(self._topic):
            if self._live:
                self._live, self._state = None, None
                self._waiting = {'type': 'waiting', 'starting': False}
                self._greet()
            return
        live, now = self._live, time.monotonic()
        if live is None:
            return
        if live.missed:
            self._send_message(
                f'{live.missed:.3g} s of the motion were not received: the view continues at '
                f'{live.time:.6g} s'
            )
            live.missed = 0.0
        rests = live.swaying is None and bool(live.machine.scene.oscillators)
        if rests and not self._rests:
            self._send_message(
                'frames on springs are shown at rest: their motion depends on the whole run '
                'since its start, which was not received'
            )
        self._rests = rests
        self._state = await self._operator.state()
        if live.unknown and self._state not in (None, PLAYING):
            if not await self._operator.begun():
                live.show_start()
            elif not self._said_paused:
                self._said_paused = True
                self._send_message('the run is paused: it is shown from its next step on')
        for owner in {control.owner for control in self._controls.values() if control.parameter}:
            await self._update(owner)
        self._seen = [s for s in self._seen if s[0] > now - _PACE and s[1] <= live.time]
        self._seen.append((now, live.time))
        begun, before = self._seen[0]
        self.server.send(
            {
                'type': 'state',
                'time': live.time,
                'run': live.run,
                'playing': self._state == PLAYING,
                'operable': self._state is not None,
                'factor': (live.time - before) / (now - begun) if now > begun else None,
                'impacts': live.impacts,
                'values': {path: control.value for path, control in self._controls.items()},
            }
        )

    async def _update(self, owner: str) -> None:
        """Ask a node for the values of its parameters that have a control."""
        asked = {c.parameter: p for p, c in self._controls.items() if c.owner == owner
                 and c.parameter}  # fmt: skip
        found = await self._operator.values(owner, [*asked])
        for path, value in zip(asked.values(), found, strict=False):
            if path in self._controls:
                self._controls[path] = self._controls[path].at(float(value))

    def _send_message(self, text: str, level: str = 'warning', path: str = '') -> None:
        """Send a message to all pages; `path`: of the value that is not set."""
        self.server.send({'type': 'message', 'text': text, 'level': level, 'path': path})

    # --- requests -------------------------------------------------------------------------------

    async def _obey(self) -> None:
        """Carry out the requests of a page, one after the other."""
        now = time.monotonic()
        if self._busy_since is not None and now < self._busy_since + _PATIENCE:
            return
        command = self._asked.take()
        if command is None:
            return
        self._busy_since = now
        try:
            reason = await self._do(command)
        except MiddlewareError as error:
            reason = str(error)
        finally:
            self._busy_since = None
        if reason:
            self._send_message(reason, path=command.path)

    async def _do(self, command: Command) -> str:
        kind, operator = command.type, self._operator
        if kind == 'play':
            self._paused_here = False
            return await operator.go(PLAYING)
        if kind == 'pause':
            self._paused_here = True
            return await operator.go(PAUSED)
        if kind == 'step':
            return await operator.step(1)
        if kind == 'reset':
            return await operator.reset()
        return await self._set(command.path, command.value)

    async def _set(self, path: str, value: float) -> str:
        control, operator = self._controls.get(path), self._operator
        if control is None:
            return f'{quoted(path)} cannot be set'
        if not control.low <= value <= control.high:
            return f'{control.label}: {value:g} is outside {control.low:g} to {control.high:g}'
        if control.effect == 'now':
            if reason := await operator.set_now(control, value):
                return reason
            self._controls[control.path] = replace(control, value=value)
            # The next run has it, too.
            return await operator.set_next(control, value) if control.in_scene else ''
        if reason := await operator.set_next(control, value) or await operator.reset():
            return reason
        return '' if self._paused_here else await operator.go(PLAYING)

    def destroy_node(self) -> None:
        """Close the page."""
        self.server.close()
        super().destroy_node()
