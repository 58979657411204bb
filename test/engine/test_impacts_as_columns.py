"""Impacts are kept as columns: what is read from them is what was entered, one by one."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.engine.events import Impact, Impacts
from mechanism_sim.engine.totals import Totals


@pytest.fixture(scope='module')
def rattling() -> ms.engine.Solution:
    """Two loose joints, of which both strike."""
    play = {'radial': 2e-4, 'restitution': 0.5}
    machine = ms.load_scene(
        'four_bar_clearance', {'start': 'centred', 'joints.crank_coupler.clearance': play}
    )
    return ms.simulate(machine, duration=0.1)


TOUCH = Impact(0.2, 'pin', 0.1, 1.0, 0.5, 2.0, -0.3, 0.7, 0.0, 0.0, False, 0.0, 1e-3, 900.0)
STRIKE = Impact(0.3, 'guide_left', -2.0, 0.2, 0.0, 0.1, 0.0, 0.01, 0.4, 0.8, True, 0.02)


def test_columns_hold_what_single_impacts_have(rattling) -> None:
    impacts = rattling.impacts
    listed = [*impacts]
    assert len(listed) == len(impacts) > 20
    assert {i.joint for i in listed} == {'coupler_rocker', 'crank_coupler'}
    assert impacts == listed
    assert listed == impacts
    assert (impacts[3], impacts[-1], impacts[2:5]) == (listed[3], listed[-1], listed[2:5])
    for field in Impact._fields:
        values = [getattr(i, field) for i in listed]
        if field != 'joint':
            assert impacts.column(field).tolist() == values
            assert type(values[0]) is (bool if field == 'ends_chatter' else float)
    impacts.column('t')[:] = 0.0  # is nobody else's, and keeps no other columns in memory
    assert impacts == listed
    assert impacts.column('t').base is None
    for wrong, said in (
        ('normal_impuls', "did you mean 'normal_impulse'"),
        ('joint', 'they have t,'),
    ):
        with pytest.raises(ms.InputError, match=said):
            impacts.column(wrong)
    with pytest.raises(IndexError):
        impacts[len(listed)]
    assert pickle.loads(pickle.dumps(impacts)) == listed
    own = impacts.of_joint('crank_coupler')
    assert own == [i for i in listed if i.joint == 'crank_coupler']
    assert not impacts.of_joint('elsewhere')


def test_lists_of_impacts_are_columns_too() -> None:
    known = Impacts.of([TOUCH, STRIKE])
    assert known == [TOUCH, STRIKE]
    assert known.sudden_loss.tolist() == [TOUCH.sudden_loss, STRIKE.sudden_loss] == [0.0, 0.01]
    assert known.exchange.tolist() == [[0.0, 0.0], [0.8, 0.01]]
    more = STRIKE._replace(joint='other')
    assert Impacts.joined([known, [], [more], known]) == [TOUCH, STRIKE, more, TOUCH, STRIKE]
    assert known + known[1:] == [STRIKE][:0] + known + [STRIKE] == [TOUCH, STRIKE, STRIKE]
    assert Impacts.joined([]) == Impacts() == []
    assert known != [STRIKE, TOUCH]


def test_sums_and_digests_do_not_depend_on_how_impacts_are_kept(rattling) -> None:
    """A list is entered impact by impact; so is each by itself."""
    listed, totals, single = [*rattling.impacts], Totals(), Totals()
    totals.add(listed, [])
    for impact in listed:
        single.add([impact], [])
    assert vars(totals) == vars(single)
    assert totals.normal_impulse == pytest.approx(np.sum([i.normal_impulse for i in listed]))
    digest = MotionDigest()
    digest.add(rattling.motion, [])
    names = (
        't', 'normal_angle', 'approach_speed', 'rebound_speed', 'normal_impulse',
        'tangential_impulse', 'energy_loss', 'drive_impulse',
    )  # fmt: skip
    for impact in listed:
        digest.add_impact(impact.joint, [getattr(impact, n) for n in names])
    assert digest.hexdigest() == rattling.digest()
    assert replace(rattling, impacts=listed).digest() == rattling.digest()
    table, again = (x.impact_table() for x in (rattling, replace(rattling, impacts=listed)))
    assert table.keys() == again.keys()
    assert all(np.array_equal(table[n], again[n]) for n in table)
