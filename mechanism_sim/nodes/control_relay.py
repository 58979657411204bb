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
    """Relay of ``joint_states`` to a hardware component of ``ros2_control``, and of its commands.

    The component is that of ``topic_based_hardware_interfaces``, which subscribes to
    ``hardware/joint_states`` and publishes ``hardware/joint_commands`` (sensor_msgs/JointState);
    ``hardware/robot_description`` describes it. Commands of the driven joint go to
    ``command/effort`` or ``command/velocity``, see `DriveCommands`.

    The controller manager runs on ``hardware/clock``. With ``command_period`` > 0 [s], that of
    `DriveCommands`, it is in lock step: the node publishes a state, waits until the component has
    taken it, advances the clock to its time, and waits for the command of this cycle (whose stamp
    is of a clock of the component's own). A state and the clock are topics of their own, which a
    reader may take in either order: so a service of the node `component` is called in between,
    which it answers after the state. Until the
    first nonzero command the state at the start is published repeatedly, and only the
    clock advances, for controllers to be loaded: the states that they receive do not depend on
    the time that takes. The clock is ahead of the machine by this time.
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
        self._joint, own = machine.plan.main, list(machine.physics.coordinates)
        self._kind, _ = commanded_part(machine.drive.law)
        if self._kind == 'velocity' and not machine.drive.commands:
            raise InputError(
                f'{machine.name}: its drive takes no commands: give it a torque, or '
                "'drive.commands', with acceleration and fastest"
            )
        self._waiting: deque[Any] = deque()  # states not yet published
        self._shown: Any = None  # the state to be answered by a command
        self._moving = False
        self._asked = 0  # [ns] of the clock with the published state
        self._ahead = 0  # [ns] lead of the clock over the machine
        self._paired = self._heard = False  # lock step kept in each cycle; any command received
        self._latest = 0  # [ns] of the last received state
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

        def take(state: Any) -> None:
            # Others in ROS publish on this topic, too, with times of another clock.
            if list(state.name) == own:
                self._take_state(state)
            else:
                self.ignore('joint_states', 'it is not of the joints of this machine')

        heard = self.create_subscription(JointState, 'joint_states', take, RESULTS)
        self.refuse_echo(heard, self._states)
        self._overdue = self.create_timer(PATIENCE, self._show_again)
        self.publish_diagnostics()

    def _take_state(self, state: Any) -> None:
        """Publish a state once all earlier ones are answered."""
        if self._description:  # with the first state: a manager then expects the clock
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
        """Publish the state for the component, and then its time on the clock."""
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
        """Publish again if unanswered: controllers are not loaded yet, or a message was lost."""
        if self._shown is None:
            return
        if self._moving:
            # Sleepers on a clock wake at a new time only; an earlier time has no effect.
            self._clock_publisher.publish(Clock(clock=stamp_at(self._asked - 1)))
            self.get_logger().warning(
                f'no command has come at {self._asked / NANOSECONDS:.9g} s of hardware/clock: the '
                'update rate of the controller manager must be that of joint_states and commands',
                throttle_duration_sec=10.0,
            )
        else:
            # After a late answer to the last one, no command is pending.
            self._paired, self._heard = self._heard, False
            self._ahead += self._period
        self._show()

    def _take_command(self, message: Any) -> None:
        """Pass a command on if it answers the published state."""
        # the component writes the names of all joints, and values of those with
        # commands: nan without a controller
        names, values = message.name, getattr(message, self._kind)
        if len(values) == 1 != len(names):
            found = values[0]
        else:
            found = dict(zip(names, values, strict=False)).get(self._joint, math.nan)
        value = float(found) if math.isfinite(found) else None
        if self._period:
            self._heard = True
            if self._shown is None or not self._paired:
                return  # of a cycle without lock step
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
