"""Nodes that follow the motion of another, which is acted here."""

from __future__ import annotations

import pytest
from builders import simulated
from middleware_network import eventually

from mechanism_sim.analysis.record import Record
from mechanism_sim.messages import Header, Motion, Progress, SensorBlock, stamp, uint64_array
from mechanism_sim.messages.segments import pack, row_names
from mechanism_sim.nodes.middleware import Node, Parameter, SingleThreadedExecutor
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.sensors import Sensors

SCENE = 'four_bar_clearance'


@pytest.mark.parametrize('report_first', [True, False])
@pytest.mark.usefixtures('network')
def test_a_follower_that_is_started_in_a_third_run_follows_it_and_the_next(report_first):
    """It said and did nothing for all runs after the second."""
    run = simulated(SCENE, duration=0.05)
    names = row_names(run.machine), run.machine.physics.clearances
    whole = len(Record(run.machine, run.piece, {}).signal('rocker_accelerometer').longest)
    partner, executor, reports, blocks = Node('linkage'), SingleThreadedExecutor(), [], []
    partner.create_subscription(Progress, 'progress', reports.append, RESULTS)
    partner.create_subscription(
        SensorBlock, 'accelerometer/rocker_accelerometer', blocks.append, RESULTS
    )
    motion = partner.create_publisher(Motion, 'motion', RESULTS)
    progress = partner.create_publisher(Progress, 'progress', RESULTS)
    given = {'scene': SCENE, 'duration': 0.05, 'partners': 'linkage'}
    sensors = Sensors([Parameter(key, value=value) for key, value in given.items()])
    for node in (partner, sensors):
        executor.add_node(node)

    def report(number, t, **more):
        counts = {'topics': ['/motion'], 'counts': uint64_array([1])}
        header = Header(stamp=stamp(t))
        progress.publish(
            Progress(node='linkage', run=number, time=t, header=header, **counts, **more)
        )

    def samples():
        return sum(len(block.samples) for block in blocks)

    def finished(number):
        return [r for r in reports if (r.node, r.run, r.finished) == ('sensors', number, True)]

    try:
        assert eventually(lambda: executor.spin_once(timeout_sec=0.01) or sensors.ready)
        for number, last in ((2, False), (3, True)):
            if report_first:
                report(number, 0.0)
            motion.publish(pack(run.piece.motion, *names, run.end, number))
            report(number, run.end, finished=True, again=not last)
            assert eventually(lambda n=number: executor.spin_once(timeout_sec=0.01) or finished(n))
            assert eventually(lambda: executor.spin_once(timeout_sec=0.01) or samples() == whole)
            assert (blocks[0].time, sensors.run) == (0.0, number)
            blocks.clear()
        assert sensors.done
    finally:
        for node in (sensors, partner):
            executor.remove_node(node)
            node.destroy_node()
