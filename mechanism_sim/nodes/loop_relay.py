"""States of all joints of a closed-loop machine, from those of its driving joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mechanism_sim.errors import InputError, RunError
from mechanism_sim.export.urdf import drivers_urdf, to_urdf
from mechanism_sim.linkages.drive_range import drive_range
from mechanism_sim.linkages.tracking import Tracker
from mechanism_sim.messages import DiagnosticStatus, JointState, String, TFMessage, float64_array
from mechanism_sim.nodes import publications
from mechanism_sim.nodes.described_node import DescribedNode, Diagnosis
from mechanism_sim.nodes.middleware import Parameter, publish_all
from mechanism_sim.nodes.qos import LATCHED, RESULTS
from mechanism_sim.nodes.scene_values import Content
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.scene.load import without_clearance
from ros_interfaces.stamps import nanoseconds

_DRIVERS = 'driver_states'  # topic on which the driving joints are told (sensor_msgs/JointState)


class LoopRelay(DescribedNode):
    """Relay that answers ``driver_states`` by ``joint_states`` of a closed-loop machine.

    Driving positions come from a slider of ``joint_state_publisher_gui``, a controller or an
    encoder: positions [rad, m] by names of coordinates in ``drive`` or ``drives`` of the
    scene, and optionally rates. Each message is answered by one with the states of all
    coordinates, of the machine without clearance, closed to rounding, with the same stamp; rates
    are included if given. ``/tf`` then has the frames of links, if ``publish_tf``.

    ``robot_description`` is the machine as URDF, ``driver_description`` its driving joints only,
    with their limits, for a panel with one slider each.
    """

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('loop_relay', parameters)
        self.declare_frames()
        moves = self.declare('publish_tf', True, 'Publish the frames of the links', read_only=True)
        self._answered, self._refused = 0, ''
        machine = without_clearance(Content.declare(self).load())
        plan, at = machine.plan, machine.assembly
        self._driven = list(plan.laws)
        if at.freedom + len(plan.prescribed) != len(self._driven):
            raise InputError(
                f'{machine.name}: {len(self._driven)} coordinates are driven, and '
                f'{at.freedom + len(plan.prescribed)} motions are free: give each free motion a '
                "drive of its own in 'drives'"
            )
        kinematics = plan.kinematics(self._driven)
        self._tracker = Tracker(kinematics, at.q, at.slope)
        self._names = list(kinematics.coordinates)
        self._limits = dict[str, tuple[float, float]]()
        if len(self._driven) == 1:  # with several drives the range of each depends on the others
            reach = TWO_PI * float(kinematics.scale[kinematics.held[0]])
            found = drive_range(kinematics, at.q, reach)
            self._limits = {self._driven[0]: (found.low, found.high)} if found.limited else {}
        self._states = self.create_publisher(JointState, 'joint_states', RESULTS)
        self._frames = publications.transforms(plan.ideal, self.frame) if moves else None
        self._tf = self.create_publisher(TFMessage, '/tf', RESULTS) if moves else None
        for topic, text in (
            ('robot_description', to_urdf(machine, self.frame(''))),
            ('driver_description', drivers_urdf(machine, self._driven, self._limits)),
        ):
            self.create_publisher(String, topic, LATCHED).publish(String(data=text))
        heard = self.create_subscription(JointState, _DRIVERS, self._take, RESULTS)
        self.refuse_echo(heard, self._states)
        self.publish_diagnostics()

    def _take(self, message: Any) -> None:
        """Answer the states of driving joints with those of all joints."""
        places = dict(zip(message.name, message.position, strict=False))
        if missing := [name for name in self._driven if name not in places]:
            self.ignore(_DRIVERS, f'it has no position of {", ".join(missing)}')
            return
        told = [places[name] for name in self._driven]
        try:
            if not np.isfinite(told).all():
                raise RunError('a position is not finite')
            for joint, x in zip(self._driven, told, strict=True):
                low, high = self._limits.get(joint, (-np.inf, np.inf))
                if not low <= x <= high:
                    raise RunError(
                        f'{joint} = {x:.9g} is beyond its limits, {low:.9g} to {high:.9g} [rad, m]'
                    )
            q = self._tracker.to(told)
        except RunError as error:
            self._refused = str(error)
            self.ignore(_DRIVERS, self._refused)
            return
        rates = dict(zip(message.name, message.velocity, strict=False))
        known = [rates[name] for name in self._driven if name in rates]
        told_rates = len(known) == len(told) and np.isfinite(known).all()
        velocity = self._tracker.rates(known) if told_rates else np.zeros(0)
        answer = JointState(
            name=self._names, position=float64_array(q), velocity=float64_array(velocity)
        )
        told_at = message.header.stamp
        stamp = told_at if told_at.sec or told_at.nanosec else self.get_clock().now().to_msg()
        answer.header.stamp = stamp
        self._states.publish(answer)
        if self._frames and self._tf:
            at = np.array([nanoseconds(stamp)])
            publish_all(self._tf, self._frames(at, q[None]))
        self._answered, self._refused = self._answered + 1, ''

    def diagnose(self) -> Diagnosis:
        """Diagnosis: number of answered states, and the refusal of the last one."""
        level = DiagnosticStatus.WARN if self._refused else DiagnosticStatus.OK
        message = self._refused or ('running' if self._answered else f'waiting for {_DRIVERS}')
        return Diagnosis(level, message, {'states answered': self._answered})
