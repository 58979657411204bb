"""Topics for viewers such as RViz and Foxglove."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mechanism_sim.analysis.preview import preview
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.export.stage import Swaying
from mechanism_sim.messages import Impact, MarkerArray
from mechanism_sim.nodes.following import MotionFollower, Schedule
from mechanism_sim.nodes.force_markers import ForceMarkers, shapes
from mechanism_sim.nodes.middleware import Parameter
from mechanism_sim.nodes.qos import LATCHED, RESULTS
from mechanism_sim.nodes.simulation_node import SimulationNode

_SCALES = {
    'force_scale': 'Length of arrows per force [m/N]; 0: the largest fits half the machine',
    'clearance_magnification': 'Magnification of clearances; 0: chosen so that they are visible',
}
"""Parameters that choose sizes, and what they are about."""


class Display(SimulationNode):
    """Node that publishes ``markers`` and ``force_markers``.

    Parameters of the node, besides those of every node: ``force_scale`` [m/N], length of arrows
    per force, 0: the largest of the first cycle fits half the machine;
    ``clearance_magnification``, 0: so that clearances are well visible.
    """

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('display', parameters)
        self._sizes = [self.declare(x, 0.0, about, read_only=True) for x, about in _SCALES.items()]
        self._prefix = self.value('frame_prefix')
        self._shapes = self.create_publisher(MarkerArray, 'markers', LATCHED)
        self._forces = self.create_publisher(MarkerArray, 'force_markers', RESULTS)
        self._impacts = 0
        self._take_machine()
        impacts = self.create_subscription(
            Impact, 'impacts', self.once_ready(self._take_impact), RESULTS
        )
        self._topic = impacts.topic_name
        _Following(self, self._take, self._rest, self._start_over)
        self.join()

    def _take_machine(self) -> None:
        self._preview = preview(self.machine, self.duration)
        self._picture = ForceMarkers(self._preview, self._prefix, *self._sizes)

    def _start_over(self) -> None:
        if self._preview.machine is not self.machine:
            self._take_machine()
        self.on_ready()

    def _rest(self) -> None:
        # All received: the next one is of another run, and may come before its motion.
        self._impacts = 0

    def on_ready(self) -> None:
        """Show the machine, once all partners are present."""
        self._schedule = Schedule(self.machine.scene.outputs.markers)
        self._swaying = Swaying(self.machine)
        self.send(self._shapes, shapes(self._preview.skeleton, self._prefix))

    def has_all_impacts(self) -> bool:
        """True if all announced impacts have been received."""
        announced = (
            dict(zip(p.topics, p.counts, strict=True)).get(self._topic, 0)
            for p in self.partners.reports.values()
            if p.run == self.run
        )
        return self._impacts >= sum(map(int, announced))

    def _take_impact(self, message: Any) -> None:
        flash = self._picture.flash(message)
        if flash is None:
            self.ignore(self._topic, f'the machine has no joint {message.joint!r} with clearance')
            return
        self._impacts += 1
        self.send(self._forces, flash)
        self.after_report()

    def _take(self, motion: Motion) -> None:
        t = self._schedule.due(motion.curve.end)
        sway = self._swaying.take(motion)
        if not t.size or self._picture.empty:
            return
        k, dt = motion.curve.find(t)
        seen = self.machine.physics.observe(motion, k, dt)
        for message in self._picture.at(t, seen, motion.modes[k].T, sway(t)):
            self.send(self._forces, message)


class _Following(MotionFollower):
    """Follower that also waits for all impacts, which have a topic of their own."""

    _node: Display

    def look(self) -> None:
        """End if all motion and all impacts have been received."""
        if self._node.has_all_impacts():
            super().look()
