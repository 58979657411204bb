"""A speed controller for the crank, as a node of ROS 2 without mechanism_sim.

``python docs/speed_controller.py`` reads ``joint_states`` and answers each with a torque on
``command/effort``: a PI controller with limits and anti-windup. Parameters: ``link``, ``speed``
[rad/s], ``kp`` [N m s/rad], ``ki`` [N m/rad], ``limit`` [N m].
"""

from __future__ import annotations

from typing import Any

try:
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.node import Node
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64
except ImportError:  # without ROS the same over Zenoh
    import zenoh_rclpy as rclpy
    from mechanism_sim.messages import Float64, JointState
    from zenoh_rclpy import ExternalShutdownException, Node


class SpeedController(Node):
    """Holds the speed of a link."""

    def __init__(self) -> None:
        super().__init__('speed_controller')
        for name, default in (
            ('link', 'crank'), ('speed', 36.65), ('kp', 1.0), ('ki', 10.0), ('limit', 20.0),
        ):  # fmt: skip
            self.declare_parameter(name, default)
        self._integral = 0.0  # [N m]
        self._last: float | None = None  # [s]
        self.create_subscription(JointState, 'joint_states', self._answer, 10)
        self._effort = self.create_publisher(Float64, 'command/effort', 10)
        self.create_timer(0.5, lambda: None)  # rclpy may miss SIGTERM in a wait without end

    def _answer(self, state: Any) -> None:
        link, speed, kp, ki, limit = (
            self.get_parameter(name).value for name in ('link', 'speed', 'kp', 'ki', 'limit')
        )
        now = state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec
        error = speed - state.velocity[list(state.name).index(link)]
        if self._last is not None and now < self._last:  # the machine was reset
            self._integral, self._last = 0.0, None
        step = 0.0 if self._last is None else now - self._last
        asked = kp * error + self._integral + ki * error * step
        effort = min(max(asked, -limit), limit)
        if effort == asked:  # else the integral would wind up
            self._integral += ki * error * step
        self._last = now
        self._effort.publish(Float64(data=effort))


def main() -> None:
    """Run until the process is asked to end."""
    rclpy.init()
    node = SpeedController()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
