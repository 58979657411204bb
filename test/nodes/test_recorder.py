"""The recorder, beside a partner that is acted here."""

from __future__ import annotations

import pytest
from middleware_network import eventually

from mechanism_sim.errors import RunError
from mechanism_sim.messages import Progress, uint64_array
from mechanism_sim.nodes import recorder as recording
from mechanism_sim.nodes.middleware import Node, Parameter, SingleThreadedExecutor
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.recorder import Recorder
from mechanism_sim.recording.reader import read_bag


@pytest.mark.parametrize('before', [0, 40])
@pytest.mark.usefixtures('network')
def test_a_recorder_that_came_late_says_so(before, tmp_path, monkeypatch, capfd):
    """What is missing then was not lost on the way: a report before the first is missing, too."""
    monkeypatch.setattr(recording, 'LOSS_TIMEOUT', -1.0)
    bag = tmp_path / 'late.mcap'
    given = {'scene': 'four_bar_clearance', 'file': str(bag), 'partners': 'linkage'}
    partner, executor = Node('linkage'), SingleThreadedExecutor()
    partner.create_subscription(Progress, 'progress', lambda _: None, RESULTS)
    publisher = partner.create_publisher(Progress, 'progress', RESULTS)
    recorder = Recorder([Parameter(key, value=value) for key, value in given.items()])
    for node in (partner, recorder):
        executor.add_node(node)

    def spin_until(condition):
        assert eventually(lambda: executor.spin_once(timeout_sec=0.01) or condition())

    def report(number, **more):
        counts = uint64_array([5, before + number])
        names = ['/impacts', '/progress']
        publisher.publish(Progress(node='linkage', topics=names, counts=counts, **more))

    try:
        spin_until(lambda: recorder.ready)
        report(1, time=0.9)
        spin_until(lambda: recorder.partners.reports)
        report(2, time=1.0, finished=True)
        with pytest.raises(RunError, match='5 messages of /impacts were announced, not') as ended:
            spin_until(lambda: False)
    finally:
        for node in (recorder, partner):
            executor.remove_node(node)
            node.destroy_node()
    assert str(ended.value).endswith('; it came when the run had begun') == bool(before)
    assert ('begun already' in capfd.readouterr().err) == bool(before)
    assert read_bag(bag).topics['/progress'].count == 2
