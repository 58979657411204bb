"""Oil films that are squeezed out: thickness over time, steps to come, what is said of them."""

from __future__ import annotations

import math
import re
import warnings
from itertools import islice
from typing import Any

import numpy as np
import pytest
from builders import made

import mechanism_sim as ms
from mechanism_sim.engine import thin_films
from mechanism_sim.engine.thin_films import steps_of_squeeze
from mechanism_sim.errors import RunError, RunWarning

pytestmark = pytest.mark.optimised  # most of it are ten thousands of steps

VISCOSITY, WIDTH, RADIUS, CLEARANCE, WEIGHT = 0.03, 0.02, 0.01, 1e-4, 9.81
OIL = {'law': 'film', 'viscosity': VISCOSITY, 'width': WIDTH, 'radius': RADIUS}


def journal(drive: Any = None, links: Any = None, joints: Any = None, **oil: Any) -> ms.Machine:
    """A journal of 1 kg in oil, which does not turn unless it is told to."""
    play = {'radial': CLEARANCE, 'restitution': 0.0, 'contact': OIL | oil}
    return made({
        'links': {'rotor': {'mass': 1.0, 'inertia': 1e-4}} | (links or {}),
        'joints': {'b': {'revolute': ['ground', 'rotor'], 'clearance': play}} | (joints or {}),
        'drive': {'coordinate': 'rotor'} | (drive or {'speed': 0.0}),
        'gravity': [0.0, -WEIGHT],
    })  # fmt: skip


def eccentricity(sample: Any) -> Any:
    return np.hypot(sample['position.rotor.x'], sample['position.rotor.y']) / CLEARANCE


@pytest.fixture
def eager(monkeypatch):
    """Lower the number of steps to come at which advice is given, to ten thousand."""
    monkeypatch.setattr(thin_films, '_FILMS', thin_films._FILMS._replace(many=1e4))


def begun(machine: ms.Machine, pieces: int, **length: Any) -> ms.Stream:
    """A run after some pieces of its length."""
    run = ms.stream(machine, **length)
    for _ in islice(run, pieces):
        pass
    return run


@pytest.mark.parametrize('wall', [{}, {'roughness': 1e-5}])
def test_a_whole_film_is_squeezed_out_as_in_closed_form(wall):
    """``D v`` is the rate of ``c S eps/s^3``: with the momentum that is the impulse of the load.

    Until walls touch: from then on they carry.
    """
    run = ms.simulate(journal(cavitation='none', **wall), duration=0.5)
    t = np.linspace(0.01, 0.5, 40)
    sample = run.sample(t)
    eps, v = eccentricity(sample), -sample['velocity.rotor.y']
    size = math.pi * VISCOSITY * RADIUS * (WIDTH / CLEARANCE) ** 3
    oil = size * CLEARANCE * eps / (1.0 - eps * eps) ** 1.5
    assert oil + v == pytest.approx(WEIGHT * t, rel=1e-9)
    assert 0.8 < eps[-1] < 0.9


@pytest.mark.slow
def test_the_steps_of_a_squeeze_are_foretold():
    run = ms.simulate(journal(), duration=0.8)
    ends = run.motion.curve.start + run.motion.curve.duration
    t = np.array([0.5, 0.6])
    count = np.searchsorted(ends, t)
    h = CLEARANCE * (1.0 - eccentricity(run.sample(t)))
    growth = (h[1] ** -1.5 - h[0] ** -1.5) / (t[1] - t[0])
    step = float(np.diff(ends)[count[1]])
    coming = steps_of_squeeze(h[1], growth, step, 0.2, 0.0)
    assert len(ends) - count[1] == pytest.approx(coming, rel=0.1)
    thin = h[1] - 1e-6  # where walls touch, it is over
    touch = t[1] + (thin**-1.5 - h[1] ** -1.5) / growth
    assert steps_of_squeeze(h[1], growth, step, 100.0, thin) == pytest.approx(
        np.searchsorted(ends, touch) - count[1], rel=0.1
    )
    assert steps_of_squeeze(h[1], growth, step, 100.0, h[1]) == 0.0


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('drive', 'oil'),
    [
        ({}, {}), ({}, {'viscosity': 1e-3}), ({}, {'cavitation': 'none'}),
        ({}, {'roughness': 1e-7}), ({'profile': {'points': [[0.0, 10.0], [0.1, 0.0]]}}, {}),
    ],
)  # fmt: skip
def test_a_film_that_is_squeezed_out_for_hours_ends_the_run(drive, oil):
    """After two looks: they would be 1e9 to 1e13."""
    run = ms.stream(journal(drive, **oil), duration=120.0)
    with pytest.raises(RunError) as said:
        run.finish()
    text = str(said.value)
    assert text.startswith('the oil film of b is ')
    assert 'um thick at t = ' in text
    assert 'the machine stands still' in text
    above = ' above 0.1 um' if 'roughness' in oil else ''
    assert f'give contact.roughness{above}, at which its walls touch' in text
    assert run.engine.steps < 20_000


@pytest.mark.slow
@pytest.mark.usefixtures('eager')
def test_with_the_roughness_that_is_advised_the_run_comes_to_its_end():
    """Walls touch within the steps that are taken anyway, and carry the journal."""
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        run = ms.simulate(journal(roughness=13e-6), duration=120.0)
    assert eccentricity(run.sample(120.0)) == pytest.approx(1.0 - 13e-6 / CLEARANCE, rel=1e-9)
    assert run.stats.steps < 50_000


@pytest.mark.slow
@pytest.mark.usefixtures('eager')
def test_a_run_that_takes_long_says_so_once():
    """It stands still, but its steps can be waited for."""
    with pytest.warns(RunWarning) as said:
        ms.simulate(journal(), duration=0.8)
    (warning,) = said
    text = str(warning.message)
    assert text.startswith('made: the oil film of b is ')
    assert text.endswith('or a shorter duration')
    with pytest.warns(RunWarning, match='the oil film of b is'):
        begun(journal({'speed': 1.0}), 4, duration=10.0)


@pytest.mark.slow
@pytest.mark.usefixtures('eager')
def test_a_film_that_is_stiff_in_the_middle_is_told_so():
    with pytest.warns(RunWarning, match=r'goes with viscosity and \(width/radial\)\^3'):
        begun(journal({'speed': 300.0}, viscosity=1.0), 4, duration=10.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('drive', 'links', 'joints'),
    [
        # a drive that stands still for a while
        ({'profile': {'points': [[0.0, 10.0], [0.1, 0.0], [5.0, 0.0], [6.0, 10.0]]}}, {}, {}),
        # a drive that turns
        ({'speed': 0.01}, {}, {}),
        # something swings beside
        (
            {},
            {'bob': {'mass': 1e-3, 'cog': 0.1, 'inertia': 1e-6}},
            {'hinge': {'revolute': ['ground', 'bob']}},
        ),
    ],
)
@pytest.mark.filterwarnings('ignore::mechanism_sim.errors.RunWarning')
def test_a_machine_that_does_not_stand_still_for_ever_is_not_ended(drive, links, joints):
    """Though steps of its film would be as many, of which it has taken more than those above."""
    run = begun(journal(drive, links, joints), 8, duration=1e5)
    assert run.duration > 0.9
    assert run.engine.steps > 60_000


def left_by(warning):
    """Steps that a sentence foretells."""
    return float(re.search(r'take some (\S+) of them', str(warning.message)).group(1))


@pytest.mark.slow
@pytest.mark.usefixtures('eager')
def test_short_steps_that_another_makes_are_not_those_of_the_film():
    """A damper beside a film that hardly does anything."""
    play = {'radial': CLEARANCE, 'contact': OIL | {'viscosity': 1e-6}}
    damper = {
        'between': ['ground.anchor', 'rotor'], 'stiffness': '1 N/m', 'damping': '1e5 N s/m',
    }  # fmt: skip
    machine = made({
        'links': {
            'ground': {'points': {'anchor': [0.0, 0.1]}}, 'rotor': {'mass': 1.0, 'inertia': 1e-4},
        },
        'joints': {'b': {'revolute': ['ground', 'rotor'], 'clearance': play}},
        'drive': {'coordinate': 'rotor', 'speed': 10.0}, 'springs': {'damper': damper},
        'gravity': [0.0, 0.0],
    })  # fmt: skip
    with pytest.warns(RunWarning) as said:
        run = begun(machine, 6, duration=10.0)
    assert run.duration < 2e-4 * run.engine.steps
    (warning,) = said
    assert 'film' not in str(warning.message)
    assert left_by(warning) == pytest.approx(10.0 / run.duration * run.engine.steps, rel=0.2)


@pytest.mark.slow
@pytest.mark.usefixtures('eager')
def test_a_run_of_many_short_steps_without_a_film_says_so_once():
    """A shaft of two discs that vibrates, over a duration that its steps take long to come to."""
    with pytest.warns(RunWarning) as said:
        run = begun(ms.load_scene('torsional_shaft'), 6, duration=1e4)
    (warning,) = said
    assert left_by(warning) == pytest.approx(1e4 / run.duration * run.engine.steps, rel=0.2)


@pytest.mark.parametrize(('off', 'thick'), [(100.0, '0'), (101.0, '-1')])
def test_a_journal_beyond_its_film_is_named(off, thick):
    machine = journal()
    content = machine.scene.model_dump(mode='json', exclude_unset=True)
    content['initial'] = {'position': {'rotor.y': f'-{off} um'}}
    with pytest.raises(RunError, match=f'the oil film of b is {thick} um thick, and no force'):
        ms.simulate(made(content), duration=0.1)
