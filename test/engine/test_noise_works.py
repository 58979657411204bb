"""Works that are nothing but the rounding of larger terms."""

from __future__ import annotations

import numpy as np

import mechanism_sim as ms
from mechanism_sim.engine import energy_terms

PARALLELOGRAM = {
    'title': 'Parallelogram',
    'mechanism': 'four_bar',
    'branch': 'open',
    'links': {
        name: {'length': length, 'cog': 0.5 * length, 'mass': 1.0, 'inertia': 1e-3}
        for name, length in (('crank', 0.1), ('coupler', 0.4), ('rocker', 0.1))
    }
    | {'ground': {'length': 0.4}},
    'drive': {'speed': '60 rpm'},
}


def counted_accounts(machine, monkeypatch):
    """Numbers of instants at which energies of a machine are asked for from now on."""
    seen, account = [], type(machine.physics).account

    def counted(physics, motion, segments, dt):
        found = account(physics, motion, segments, dt)
        seen.append(len(found.drive_power))
        return found

    monkeypatch.setattr(type(machine.physics), 'account', counted)
    return seen


def test_the_work_of_a_drive_that_does_none_is_found_by_few_nodes(monkeypatch):
    """Balanced and steady, it needs no torque: halving intervals would look for it for ever."""
    machine = ms.load_scene(PARALLELOGRAM)
    run = ms.simulate(machine, revolutions=1.0)
    seen = counted_accounts(machine, monkeypatch)
    k, share = np.arange(len(run.motion)), 0.7
    work = energy_terms.work_since_start(
        machine.physics, run.motion, k, share * run.motion.curve.duration
    )
    assert np.abs(work.drive).max() < 1e-12
    assert sum(seen) < 2 * 8 * len(k)


def test_works_where_steps_meet_are_found_by_few_nodes(monkeypatch):
    """There times round to either side of a step's start: what is before it is no work."""
    machine = ms.load_scene('four_bar_clearance')
    run = ms.simulate(machine, revolutions=2.0)
    k, dt = run.motion.curve.find(run.motion.curve.start)
    assert (dt < 0.0).any()
    seen = counted_accounts(machine, monkeypatch)
    work = energy_terms.work_since_start(machine.physics, run.motion, k, dt)
    assert np.abs(work.drive).max() < 1e-13
    assert sum(seen) <= 8 * len(k)
