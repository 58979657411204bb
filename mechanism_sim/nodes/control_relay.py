"""A machine as the hardware of ``ros2_control``, over topics of joint states."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

from mechanism_sim.errors import InputError
from mechanism_sim.export.urdf import controlled_urdf
from mechanism_sim.messages import (
    Clock,
    DiagnosticStatus,
    Float64,
    JointState,
    String,
    service_class,
)
from mechanism_sim.nodes.commands import PATIENCE, commanded_part
from mechanism_sim.nodes.described_node import DescribedNode, Diagnosis
from mechanism_sim.nodes.middleware import Future, Parameter
from mechanism_sim.nodes.qos import LATCHED, RESULTS
from mechanism_sim.nodes.scene_values import Content
from ros_interfaces.stamps import NANOSECONDS, nanoseconds, stamp_at

COMMANDS = 'hardware/joint_commands'
"""Topic of the commands of the hardware component."""


class ControlRelay(DescribedNode):
    """Hands ``joint_states`` to a hardware component of ``ros2_control``, and its commands back.

    The component is that of ``topic_based_hardware_interfaces``, which hears
    ``hardware/joint_states`` and publishes ``hardware/joint_commands`` (sensor_msgs/JointState);
    ``hardware/robot_description`` describes it. What is commanded of the driven joint goes to
    ``command/effort`` or ``command/velocity``, see `DriveCommands`.

    The controller manager runs on ``hardware/clock``. With ``command_period`` > 0 [s], that of
    `DriveCommands`, it is in lock step: the node shows one state, waits until the component has
    taken it, lets the clock come to its time, and waits for the command of this cycle (whose stamp
    is of a clock of the component's own). A state and the clock are topics of their own, which a
    reader may take in either order: so the node named `component` is asked a service in between,
    which it answers after the state. Until the
    first command that is not zero the state at the start is shown, over and over, and only the
    clock goes on, for controllers to be loaded: what they then see does not depend on how long
    that takes. The clock is ahead of the machine by this time.
    """

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('control_relay', parameters)
        period = self.declare(
            'command_period', 0.005, 'Interval of commands [s]; 0: as they come',
            (0.0, 1e3), read_only=True,
        )  # fmt: skip
        about = 'Node of the hardware component: its name in the description, in lower case'
        component = self.declare('component', 'machine', about, read_only=True)
        self._period = round(period * NANOSECONDS)
        machine = Content.declare(self).load()
        self._joint = machine.plan.main
        self._kind, _ = commanded_part(machine.drive.law)
        if self._kind == 'velocity' and not machine.drive.commands:
            raise InputError(
                f'{machine.name}: its drive takes no commands: give it a torque, or '
                "'drive.commands', with acceleration and fastest"
            )
        self._waiting: deque[Any] = deque()  # states that are not shown yet
        self._shown: Any = None  # the state that a command is to answer
        self._moving = False
        self._asked = 0  # [ns] of the clock with the state that is shown
        self._ahead = 0  # [ns] of the clock before the machine
        self._paired = self._heard = False  # whether each cycle was waited for; any command came
        self._latest = 0  # [ns] of the last state that came
        self._last = 0.0  # the last command
        self._command = self.create_publisher(Float64, f'command/{self._kind}', RESULTS)
        self._states = self.create_publisher(JointState, 'hardware/joint_states', RESULTS)
        self._clock_publisher = self.create_publisher(Clock, 'hardware/clock', RESULTS)
        self._read = service_class('rcl_interfaces/srv/GetParameters')
        self._barrier = self.create_client(self._read, f'{component}/get_parameters')
        commands = self.create_subscription(JointState, COMMANDS, self._take_command, RESULTS)
        topics = {'commands': commands.topic_name, 'states': self._states.topic_name}
        self._description = controlled_urdf(machine, component, self._joint, self._kind, topics)
        self._described = self.create_publisher(String, 'hardware/robot_description', LATCHED)
        self.create_subscription(JointState, 'joint_states', self._take_state, RESULTS)
        self._overdue = self.create_timer(PATIENCE, self._show_again)
        self.publish_diagnostics()

    def _take_state(self, state: Any) -> None:
        """Show a state when those before it are answered."""
        if self._description:  # now that it comes to life: a manager that has it expects its time
            self._described.publish(String(data=self._description))
            self._description = ''
        if not self._period:
            self._states.publish(state)
            self._clock_publisher.publish(Clock(clock=state.header.stamp))
            return
        at = nanoseconds(state.header.stamp)
        if at < self._latest:  # the machine was reset
            self._waiting.clear()
            self._ahead = self._asked + self._period - at
            self._moving = self._paired = False
            self._shown = None
        self._latest = at
        self._waiting.append(state)
        if self._shown is None:
            self._show_next()

    def _show_next(self) -> None:
        self._shown = self._waiting.popleft() if self._waiting else None
        if self._shown is not None:
            self._show()

    def _show(self) -> None:
        """Let the component take the state, and then the clock come to its time."""
        shown = self._shown
        self._overdue.reset()
        self._states.publish(shown)
        self._asked = at = nanoseconds(shown.header.stamp) + self._ahead

        def taken(_: Future | None = None) -> None:
            if shown is self._shown:
                self._clock_publisher.publish(Clock(clock=stamp_at(at)))

        if self._moving and self._barrier.service_is_ready():
            self._barrier.call_async(self._read.Request()).add_done_callback(taken)
        else:
            taken()

    def _show_again(self) -> None:
        """Nobody has answered: the controllers are not there yet, or something was lost."""
        if self._shown is None:
            return
        if self._moving:
            # Whoever sleeps on a clock wakes at another time only; back is no time to act upon.
            self._clock_publisher.publish(Clock(clock=stamp_at(self._asked - 1)))
            self.get_logger().warning(
                f'no command has come at {self._asked / NANOSECONDS:.9g} s of hardware/clock: the '
                'update rate of the controller manager must be that of joint_states and commands',
                throttle_duration_sec=10.0,
            )
        else:
            # If the last one was answered late, no command is under way any more.
            self._paired, self._heard = self._heard, False
            self._ahead += self._period
        self._show()

    def _take_command(self, message: Any) -> None:
        """Pass a command on if it answers the state that is shown."""
        # the component writes the names of all joints, and the values of those that take
        # commands, not a number without a controller
        values = getattr(message, self._kind)
        if len(values) == 1:
            found = values[0]
        else:
            found = dict(zip(message.name, values, strict=False)).get(self._joint, math.nan)
        value = float(found) if math.isfinite(found) else None
        if self._period:
            self._heard = True
            if self._shown is None or not self._paired:
                return  # of a cycle that was not waited for
            if not self._moving and not value:
                self._ahead += self._period
                self._show()
                return
            self._moving = True
        elif value is None:
            return
        if value is None:
            self.ignore(COMMANDS, f'no controller commands {self._joint}: the last command holds')
        else:
            self._last = value
        self._command.publish(Float64(data=self._last))
        if self._period:
            self._show_next()

    def diagnose(self) -> Diagnosis:
        """State of the lock step, and the lead of its clock over the machine."""
        waits = 'joint_states' if self._shown is None else 'a command that is not zero'
        goes = self._moving or not self._period
        message = 'running' if goes else f'waiting for {waits}'
        ahead = self._ahead / NANOSECONDS
        return Diagnosis(DiagnosticStatus.OK, message, {'clock ahead of the machine [s]': ahead})
