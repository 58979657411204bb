"""Wear of bearings in oil, where their walls carry, by equilibrium of film and wall."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.pages import families
from mechanism_sim.report.life import chart, render, to_json
from mechanism_sim.studies.life import LifePlan, wear_in

PIN, CLEARANCE, ROUGHNESS, WIDTH = 8e-3, 0.1e-3, 10e-6, 10e-3
VISCOSITY, WEAR, WEIGHT, FRICTION = 0.05, 1e-16, 2.0 * 9.81, 0.2
AROUND = 2.0 * np.pi / 20000 * np.arange(20000)
FULL_SPEED = 40.0


def wheel(speed, friction=0.0, profile=(), **wear):
    """A wheel that hangs on a fixed pin in oil and turns."""
    return {
        'title': 'wheel', 'mechanism': 'linkage',
        'links': {'ground': {'points': {'pin': [0.0, 0.0]}},
                  'wheel': {'mass': 2.0, 'inertia': 1e-3, 'cog': 0.0}},
        'joints': {'axle': {'revolute': ['ground.pin', 'wheel'], 'clearance': {
            'radial': CLEARANCE, 'restitution': 0.0, 'friction': friction, 'wear': wear,
            'contact': {'law': 'film', 'viscosity': VISCOSITY, 'width': WIDTH, 'radius': PIN,
                        'roughness': ROUGHNESS},
            **({'profile': profile} if profile else {})}}},
        'drive': {'coordinate': 'wheel', 'speed': speed}, 'gravity': [0.0, -9.81],
    }  # fmt: skip


def film(Q, speed, depth, slope=0.0):
    """Force [N] on a pin that rests at Q while the wheel turns, and thickness (m,) [m].

    Depth and slope (m,) [m] are what is worn off, by the angle, and the slope of the pin's.
    """
    n = np.exp(1j * AROUND)
    h = CLEARANCE + depth - (Q * n.conj()).real
    v = (-0.5j * speed * Q * n.conj()).real - 0.5 * speed * slope
    p = VISCOSITY * WIDTH**3 * np.maximum(v, 0.0) / h**3
    return -PIN * np.sum(p * n) * AROUND[1], h


def wall_force(speed, depth=0.0, friction=0.0):
    """N [N] for which film and wall carry the weight, of a bearing evenly worn; 0 lifted off."""
    e = CLEARANCE - ROUGHNESS + depth
    F, _ = film(e, speed, depth)

    def beyond(N):
        return abs(F - N * (1.0 - 1j * friction)) - WEIGHT

    return float(brentq(beyond, 0.0, 2.0 * WEIGHT, xtol=1e-13)) if beyond(0.0) < 0.0 else 0.0


@pytest.mark.parametrize(
    ('speed', 'friction', 'law'),
    [
        (2.0, 0.0, 'archard'),
        pytest.param(10.0, 0.0, 'archard', marks=pytest.mark.slow),
        pytest.param(10.0, FRICTION, 'friction_work', marks=pytest.mark.slow),
    ],
)
def test_walls_wear_by_what_the_oil_leaves_to_them(speed, friction, law):
    """``k N s/(2 pi R w)`` in a turn: all round the bushing, on the pin where it is pressed."""
    scene = wheel(speed, friction, bushing=WEAR, pin=0.5 * WEAR, law=law)
    plan = LifePlan(revolutions=2, skip=1)
    row = wear_in('wheel', scene, ('axle',), plan, [])
    bushing, pin = np.array(row['depths']['axle'])
    N, way = wall_force(speed, friction=friction), 2.0 * np.pi * (PIN + CLEARANCE - ROUGHNESS)
    assert 0.3 * WEIGHT < N < 0.95 * WEIGHT
    worn = WEAR * N * way * (friction if law == 'friction_work' else 1.0)
    volumes = [x.mean() * 2.0 * np.pi * r * WIDTH
               for x, r in ((bushing, PIN + CLEARANCE), (pin, PIN))]  # fmt: skip
    assert volumes == pytest.approx([worn, 0.5 * worn], rel=1e-4)
    assert np.ptp(bushing) < 0.01 * bushing.mean()
    assert pin.max() > 3.0 * pin.mean()


@pytest.mark.slow
def test_a_film_that_carries_all_leaves_nothing_to_wear(monkeypatch):
    """Exactly nothing, above the speed of lift-off; a page runs its machine once then."""
    assert wall_force(0.5 * FULL_SPEED) > 0.0 == wall_force(FULL_SPEED)
    scene = wheel(FULL_SPEED, bushing=WEAR, pin=WEAR)
    found = ms.life(scene, 'clearance > 0.2 mm', revolutions=1, skip=1)
    assert np.isnan(found.cycles)
    assert [stage.cycles for stage in found.stages] == [0.0, 1e7]
    assert not any(stage.depths['axle'].any() for stage in found.stages)
    assert 'no wall of a bearing slides under a force' in render(found)
    assert to_json(found)['note'].endswith('nothing wears')
    assert len(chart(found, 'oil').panels) == 1
    run = Mock(wraps=ms.simulate)
    monkeypatch.setattr(families, 'simulate', run)
    assert families.life_page(found)
    assert run.call_count == 1
    figures = dict.fromkeys(found.stages[0].figures, -0.0)
    stage = replace(found.stages[0], depths={'axle': -np.zeros((2, 180))}, figures=figures)
    assert '-0' not in render(replace(found, stages=(stage,))).split()


@pytest.mark.slow
@pytest.mark.parametrize('speed', [2.0, 10.0])
def test_a_bushing_that_wears_evenly_in_oil_lasts_as_its_equation(speed):
    """``dh/dn = k N(h) (rp + c + h)/(w (rp + c))``, N(h) of film and wall."""
    until = 1.2 * CLEARANCE
    scene = wheel(speed, profile={'harmonics': 8}, bushing=WEAR)
    found = ms.life(scene, f'clearance > {until} m', cycles=1e12, revolutions=4, skip=3)
    R = PIN + CLEARANCE

    def cycles(h):
        return R * WIDTH / (WEAR * wall_force(speed, h) * (R - ROUGHNESS + h))

    expected = quad(cycles, 0.0, until - CLEARANCE)[0]
    assert found.cycles == pytest.approx(expected, rel=6e-3)  # the film: of a half at most 1.5 %
    last = found.stages[-1]
    assert np.ptp(last.depths['axle'][0]) < 0.01 * (until - CLEARANCE)


@pytest.mark.slow
def test_halving_steps_changes_a_life_in_oil_by_less_than_it_says(monkeypatch):
    """A pin that wears where it is pressed; its worn scene is one that runs as its stage."""
    scene, found = wheel(4.0, profile={'harmonics': 8}, pin=WEAR), []
    for growth in (0.1, 0.05):
        monkeypatch.setattr('mechanism_sim.studies.life._GROWTH', growth)
        monkeypatch.setattr('mechanism_sim.studies.life._FIRST', 0.5 * growth)
        until = f'clearance > {1.15 * CLEARANCE} m'
        found.append(ms.life(scene, until, cycles=1e12, revolutions=1, skip=1))
    coarse, fine = found
    assert len(fine.stages) > len(coarse.stages)
    assert coarse.low < fine.cycles < coarse.high
    assert coarse.high - coarse.low < 0.1 * coarse.cycles
    stage = fine.stages[-2]
    machine = ms.load_scene(fine.scene(stage))
    solution = ms.simulate(machine, revolutions=2.0)
    assert abs(solution.energy.residual) < 1e-12
    t = machine.drive.period * np.linspace(1.0, 2.0, 400)
    force = solution.sample(t)['normal_force.axle']
    (largest,) = stage.figures.values()
    assert force.max() == pytest.approx(largest, rel=1e-3)
    pin = stage.depths['axle'][1]
    assert pin.max() > 0.1 * CLEARANCE > 20.0 * pin.min()


@pytest.mark.slow
def test_a_worn_pin_is_carried_by_film_and_wall_together():
    """A groove below, off the load; the film between by quadrature of its thickness."""
    speed, at = 8.0, np.radians(-60.0)

    def worn(angle):
        return 6e-6 * (0.5 + 0.5 * np.cos(angle - at)) ** 4

    points = [[float(a), float(worn(a)) + 1e-20] for a in 2.0 * np.pi / 90 * np.arange(90)]
    profile = {'pin': {'points': points}, 'harmonics': 8}
    machine = ms.load_scene(wheel(speed, profile=profile))
    solution = ms.simulate(machine, revolutions=1.0)
    assert abs(solution.energy.residual) < 1e-12
    now = solution.sample(np.array([solution.duration]))
    Q = -complex(now['position.wheel.x'][0], now['position.wheel.y'][0])
    slope = (worn(AROUND + 1e-4) - worn(AROUND - 1e-4)) / 2e-4
    F, h = film(Q, speed, worn(AROUND), slope)
    N = now['normal_force.axle'][0]
    assert abs(F + 1j * WEIGHT) == pytest.approx(N, abs=0.015 * abs(F))
    assert h.min() == pytest.approx(ROUGHNESS, rel=0.1)
    assert abs(F) > 0.3 * WEIGHT


@pytest.mark.parametrize(
    ('contact', 'wear', 'text'),
    [
        ({'roughness': None}, {}, "has wear and a film alone: give 'contact.roughness'"),
        ({}, {'width': WIDTH}, 'with a film it is contact.width; leave it out'),
        ({}, {'law': 'friction_work'}, "needs 'friction'"),
    ],
)
def test_what_cannot_wear_in_oil_is_refused(contact, wear, text):
    scene = wheel(2.0, bushing=WEAR, **wear)
    scene['joints']['axle']['clearance']['contact'] |= contact
    with pytest.raises(InputError) as error:
        ms.life(scene, 'clearance > 0.2 mm')
    assert text in str(error.value)
