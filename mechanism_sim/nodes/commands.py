"""Commands of speed, torque or force to the drive during a run."""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import replace
from typing import Any

from mechanism_sim.errors import InputError
from mechanism_sim.messages import Float64, type_name
from mechanism_sim.nodes.drive import Drive
from mechanism_sim.nodes.middleware import Parameter
from mechanism_sim.nodes.partners import SAY_AGAIN, SETTLE
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.planar.drive import DriveLaw

PATIENCE = 1.0
"""[s] of wall time after which a state that no command answers is shown again."""

_TYPE = type_name(Float64)
_LOOK = 0.5  # [s] polling interval for pending commands, long enough for a node to join


class DriveCommands:
    """Commands by topic and by parameter, which hold from the time `announced` of the law.

    A drive with torque, force or motor accepts ``effort`` [N m, N]: the constant part of its
    law, for a motor the torque at rest. A drive with a speed accepts ``velocity`` [rad/s] if its
    scene has ``drive.commands``, and reaches it by a ramp. Each is a topic, ``command/effort`` or
    ``command/velocity`` (std_msgs/Float64), and a parameter.

    With a parameter ``command_period`` [s] > 0 there is one command per period, and time does
    not advance without it: the first period follows the scene, later ones the command before.
    A controller that answers each state with one command then gets the same run every time. Time
    begins with a controller: a publisher of commands, or a command, as from a program that
    is not in the graph. Earlier commands hold from 0 on, and do not count among the n: a
    program outside the graph repeats its command until received. A controller is no partner: when
    one leaves, time waits for the command of another, with a log entry. One that joins while
    time waits gets the last joint states, see `Newcomers`. A command received before its
    period is queued: the order of commands decides, not their arrival.
    """

    def __init__(self, drive: Drive) -> None:
        self._drive, law = drive, drive.law
        self._period = drive.declare(
            'command_period', 0.0, 'Interval of commands [s]; 0: at any time',
            (0.0, 1e6), read_only=True,
        )  # fmt: skip
        self._taken = 0
        self._early: deque[float] = deque()
        self._since: float | None = None  # [s] wall time of the first detection of a controller
        self._begun = False
        self._held = 0.0, -1.0  # [s] wall time since which simulated time is held, and the latter
        self._name = ''
        commanded = drive.machine.drive.commands
        name, given = commanded_part(law)
        if isinstance(law, DriveLaw):
            limit = commanded.fastest if commanded else None
        else:
            limit = 1e12
        if limit is None:
            if self._period:
                raise InputError(
                    f"{drive.machine.name}: its drive takes no commands: give 'drive.commands', "
                    'with acceleration and fastest, or take command_period away'
                )
            return
        self._name, self._commanded, self._limit = name, given, limit
        about = f'Commanded {name} of the drive, SI'
        self._launched = self._present = drive.declare(name, given, about, (-limit, limit))
        drive.add_post_set_parameters_callback(self._follow)
        receive = drive.once_ready(self._receive)
        heard = drive.create_subscription(Float64, f'command/{name}', receive, RESULTS)
        self._topic = heard.topic_name
        if self._period:
            self._newcomers = Newcomers(drive, self._topic)
            drive.create_timer(_LOOK, self._watch)

    @property
    def horizon(self) -> float:
        """Time [s] up to which commands are present; 0 without a controller."""
        if not self._period:
            return math.inf
        if not self._begun:
            if self._since is None and self._published:
                self._since = time.monotonic()
            self._begun = self._since is not None and time.monotonic() > self._since + SETTLE
            if self._begun:
                self._newcomers.show()
        return (self._taken + 1) * self._period if self._begun else 0.0

    @property
    def _published(self) -> bool:
        """True if the graph shows publishers of commands."""
        return _TYPE in self._types

    @property
    def _types(self) -> set[str]:
        """Types of messages with which somebody publishes on the topic of commands."""
        return {p.topic_type for p in self._drive.get_publishers_info_by_topic(self._topic)}

    def begin(self) -> None:
        """Start of a run: with values at launch, or with another value of the scene."""
        self._taken = 0
        self._early.clear()
        _, given = commanded_part(self._drive.law)
        if self._name and given != self._commanded:
            self._launched = given if self._launched == self._commanded else self._launched
            self._commanded = given
        if self._name and self._present != self._launched:
            self._present = self._launched
            self._drive.set_parameters([Parameter(self._name, value=self._launched)])
        if self._name and self._launched != self._commanded:
            self._hold(self._launched)
        if self._period and (unequal := self._unequal):
            rates = self._drive.machine.scene.outputs.joint_states, 1.0 / self._period
            ends = 'gets ever later' if rates[0] > rates[1] else 'is waited for without end'
            self._drive.get_logger().warning(
                f'{unequal}: a controller that answers each state {ends}; make them equal, as by '
                f"--set 'outputs.joint_states={rates[1]:.12g} Hz'"
            )

    @property
    def _unequal(self) -> str:
        """Sentence on a difference between periods of joint states and commands; else empty."""
        rate = self._drive.machine.scene.outputs.joint_states
        if math.isclose(rate * self._period, 1.0):
            return ''
        return (
            f'joint_states come every {1.0 / rate:.9g} s, but one command is for '
            f'{self._period:.9g} s (command_period)'
        )

    def look(self) -> None:
        """Apply queued commands whose time has come."""
        while self._early and self._drive.announced >= self.horizon:
            self._taken += 1
            self._hold(self._early.popleft())

    def _watch(self) -> None:
        """Log a long wait for a command; publish the state for newcomers."""
        drive, (since, at) = self._drive, self._held
        new = self._newcomers.look()
        if not drive.due or drive.announced < self.horizon:
            self._held = 0.0, -1.0
        elif at != drive.announced:
            self._held = time.monotonic(), drive.announced
        elif not self._begun:
            others = ', '.join(sorted(self._types))
            wrong = f' of the type {_TYPE}, not {others}' if others else ''
            said = f'a publisher of {self._topic}{wrong}'
            drive.partners.say_waiting(said, since, f'controller{wrong}')
        else:
            nobody = '' if self._published else ', which nobody in the graph publishes'
            said = f'a command on {self._topic} since t = {at:.9g} s{nobody}'
            why = f'; {unequal}' if (unequal := self._unequal) else ''
            drive.partners.say_waiting(f'{said}{why}', since, 'command')
            if new and time.monotonic() > since + PATIENCE:
                self._newcomers.show()
                drive.promise(drive.announced)
                drive.get_logger().info(
                    f'a new controller: the last joint_states before t = {at:.9g} s are sent again'
                )

    def _follow(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == self._name and parameter.value != self._present:
                self._present = parameter.value
                self._drive.announce(self._name, self._present, self._drive.announced)
                self._command(float(parameter.value))

    def _receive(self, message: Any) -> None:
        if abs(message.data) <= self._limit:
            # Thus setting the parameter to its present value is a command again.
            self._present = float(message.data)
            self._command(self._present)
        else:
            reason = (
                f'{message.data:g} is no {self._name} from {-self._limit:g} to {self._limit:g}, SI'
            )
            self._drive.ignore(self._topic, reason)

    def _command(self, value: float) -> None:
        if self._period and self._begun:
            self._early.append(value)
            self.look()
            if len(self._early) > 1:
                self._drive.get_logger().warning(
                    f'{len(self._early)} commands on {self._topic} wait for their periods of '
                    f'{self._period:.9g} s (command_period): they come faster than one for each',
                    throttle_duration_sec=SAY_AGAIN,
                )
        else:
            self._since = self._since or time.monotonic()
            self._hold(value)

    def _hold(self, value: float) -> None:
        drive = self._drive
        law, at = drive.law, drive.announced
        if isinstance(law, DriveLaw):
            acceleration = drive.machine.drive.commands.acceleration  # type: ignore[union-attr]
            drive.take_over(law.towards(value, at, acceleration))
        else:
            _, *slopes = law.coefficients
            drive.take_over([replace(law, coefficients=(value, *slopes), valid_from=at)])


class Newcomers:
    """Controllers that joined after the last joint states, and wait for some.

    Controllers present at the last advance of time have received them, and compute a command:
    with a repetition they would command twice, and then be ahead of their states.

    Parameters
    ----------
    topic : topic of the commands
    """

    def __init__(self, drive: Drive, topic: str) -> None:
        self._drive, self._topic = drive, topic
        self._shown: set[Any] = set()  # endpoints with the last joint states
        self._present: set[Any] = set()  # endpoints at the last poll
        self._at = drive.run, drive.announced  # at the last poll

    def look(self) -> bool:
        """True if there are newcomers, and no endpoint has just joined."""
        at, before = (self._drive.run, self._drive.announced), self._present
        self._present = self._endpoints()
        if at != self._at:
            self._at, self._shown = at, before
        return self._present == before and not self._present <= self._shown

    def show(self) -> None:
        """Record that all present endpoints receive the joint states."""
        self._shown = self._present = self._endpoints()

    def _endpoints(self) -> set[Any]:
        """Publishers of commands, and subscriptions of their nodes to joint states."""
        drive = self._drive
        commands = drive.get_publishers_info_by_topic(self._topic)
        nodes = {(info.node_namespace, info.node_name) for info in commands}
        states = drive.get_subscriptions_info_by_topic('joint_states')
        hearing = [s for s in states if (s.node_namespace, s.node_name) in nodes]
        return {tuple(info.endpoint_gid) for info in [*commands, *hearing]}


def commanded_part(law: Any) -> tuple[str, float]:
    """The part of a law that is commanded, ``velocity`` or ``effort``, and its value [SI]."""
    if isinstance(law, DriveLaw):
        return 'velocity', law.coefficients[1] if law.degree else 0.0
    return 'effort', law.coefficients[0]
