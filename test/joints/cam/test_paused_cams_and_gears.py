"""Pauses do not change a bit of machines whose laws are tables."""

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.engine.snapshot import Snapshot

PAUSES = {'valve_train': 100, 'gear_rattle': 20, 'whole_machine': 8}
SPANS = {'valve_train': 0.04, 'gear_rattle': 0.2, 'whole_machine': 0.1}  # [s]


def bits(parts):
    """Everything of a motion in pieces (motion, impacts, changes of mode) as bytes."""
    curves = [motion.curve for motion, _, _ in parts]
    numbers = [
        np.concatenate([getattr(c, name) for c in curves]).tobytes()
        for name in ('start', 'start_low', 'duration', 'turns', 'coefficients')
    ]
    return numbers, [i for _, impacts, _ in parts for i in impacts]


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', [
    pytest.param(name, marks=[pytest.mark.slow] if name == 'whole_machine' else [])
    for name in PAUSES
])  # fmt: skip
def test_pauses_do_not_change_one_bit(name, tmp_path):
    """Each time from a file, at odd times; among them rows of tables that have just begun."""
    machine = ms.load_scene(name)
    end = SPANS[name]
    whole = machine.start()
    whole.advance(end)
    parts, run = [], machine.start()
    for k in range(PAUSES[name]):
        run.advance(end * (k + 0.37) / PAUSES[name])
        parts.append(run.drain())
        file = tmp_path / f'{k}.json'
        machine.snapshot(run).save(file)
        if k % 20 == 0:
            machine = ms.load_scene(name)
        run = machine.resume(Snapshot.load(file))
    run.advance(end)
    parts.append(run.drain())
    assert bits(parts) == bits([whole.drain()])
