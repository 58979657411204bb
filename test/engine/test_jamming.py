"""Loose joints that a drive forces past a change point."""

from __future__ import annotations

from typing import Any

import pytest
from builders import made

import mechanism_sim as ms
from mechanism_sim.engine.jamming import JamWatch

PARALLELOGRAM = 300, 100, 300, 100
EQUAL = 300, 100, 200, 200  # longest and shortest link are as long as the two others


def loose(lengths: tuple[int, ...], joint: str = 'coupler_rocker', **more: Any) -> ms.Machine:
    """A four-bar of these lengths [mm] whose crank turns at 30 rad/s, with one loose joint."""
    masses = {'crank': 0.6, 'coupler': 0.24, 'rocker': 0.23}
    links = {
        name: {'length': f'{length} mm'}
        | ({'cog': '50 mm', 'mass': masses[name], 'inertia': 3e-3} if name in masses else {})
        for name, length in zip(('ground', *masses), lengths, strict=True)
    }
    return made({
        'mechanism': 'four_bar', 'branch': 'open', 'links': links, 'start': 'seated',
        'joints': {joint: {'clearance': {'radial': '0.254 mm', 'restitution': 0.5} | more}},
        'gravity': [0, -9.81], 'drive': {'speed': 30.0, 'start_angle': '60 deg'},
    })  # fmt: skip


@pytest.mark.parametrize(
    ('lengths', 'joint'),
    [
        (PARALLELOGRAM, 'coupler_rocker'), (PARALLELOGRAM, 'crank_coupler'),
        (PARALLELOGRAM, 'rocker_ground'), (EQUAL, 'coupler_rocker'),
    ],
)  # fmt: skip
def test_a_joint_that_jams_ends_the_run(lengths, joint):
    """Within a turn and some ten thousand steps, where it took millions of them a turn."""
    run = ms.stream(loose(lengths, joint), revolutions=20)
    with pytest.raises(ms.RunError) as said:
        run.finish()
    assert str(said.value).startswith(f'{joint} jams: at t = ')
    assert 'crank at' in str(said.value)
    assert run.stats.steps < 400_000


@pytest.mark.parametrize(
    'more', [{'friction': 0.1}, {'contact': {'law': 'hunt_crossley', 'stiffness': 1e8}}]
)
def test_friction_or_soft_contact_let_it_pass(more):
    run = ms.stream(loose(PARALLELOGRAM, **more), revolutions=3).finish()
    assert run.stats.steps < 20_000


def test_steps_of_steady_chatter_are_no_jam(monkeypatch):
    """The thesis' machine with its hardest settings is far from what counts as short steps."""
    looked = []
    monkeypatch.setattr(JamWatch, 'add', lambda self, motion, *_: looked.append((self, motion)))
    ms.stream('thesis_complete', revolutions=0.2).finish()
    mean = sum(m.curve.duration.sum() for _, m in looked) / sum(len(m) for _, m in looked)
    assert mean > 2e-3 * looked[0][0]._longest
