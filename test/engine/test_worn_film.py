"""Oil films between walls that are worn: forces by quadrature, energy, limits."""

from __future__ import annotations

import heyoka as hy
import numpy as np
import pytest
from builders import PLAY

import mechanism_sim as ms
from mechanism_sim.engine.contact.film import FilmShape, JournalMotion, ShortBearing
from mechanism_sim.errors import InputError
from mechanism_sim.joints.revolute.worn import LOOKS, FilmProfile, worn_shape

C, ROUGHNESS, DEGREE = 30e-6, 3e-6, 8
PLACES = 2.0 * np.pi / LOOKS * np.arange(LOOKS)
OIL = {'viscosity': 0.02, 'width': 8e-3, 'radius': 10e-3, 'clearance': C}
KINDS = {'half': {}, 'full': {'full': True}, 'some': {'supply': 3e5}, 'much': {'supply': 2e7}}


def groove(angle, size=2e-6):
    """Depths of a shallow groove [m]: four harmonics."""
    return size * (0.5 + 0.5 * np.cos(PLACES - angle)) ** 4


def depth(given, angle):
    """At any angles."""
    return np.interp(angle % (2.0 * np.pi), PLACES, given, period=2.0 * np.pi)


def profile(bushing, pin):
    shape = worn_shape(C - ROUGHNESS, 10e-3, (bushing.tobytes(), pin.tobytes()), DEGREE)
    return FilmProfile.of(shape, (bushing, pin), C, ROUGHNESS, DEGREE)


WORN = profile(groove(0.4), np.zeros(LOOKS))


@pytest.fixture(scope='module', params=KINDS)
def film(request):
    """Force, moments and power of a film in a worn bushing, seen from it, and its kind."""
    v = hy.make_vars('x', 'y', 'vx', 'vy', 'journal', 'bushing')
    parts = [[hy.expression(x) for x in part] for part in WORN.along()]
    shape = FilmShape(*parts, hy.expression(WORN.steepest), WORN.blur)
    bearing, motion = ShortBearing(**OIL, **KINDS[request.param]), JournalMotion(*v, shape=shape)
    return hy.cfunc(
        [*bearing.force(motion), *bearing.moments(motion)], vars=v, opt_level=0
    ), bearing


def cut_pressure(motion, bearing, theta, z):
    """From the film's thickness over time, by differences: p [Pa], h [m], source [m/s]."""
    x, y, vx, vy, journal, bushing = motion

    def thickness(t, angle):
        Q = (x + vx * t) * np.cos(angle) + (y + vy * t) * np.sin(angle)
        return C + depth(groove(0.4), angle - bushing * t) - Q

    dt, turn = 1e-6, PLACES[1]
    by_time = (thickness(dt, theta) - thickness(-dt, theta)) / (2.0 * dt)
    by_angle = (thickness(0.0, theta + turn) - thickness(0.0, theta - turn)) / (2.0 * turn)
    h, source = thickness(0.0, theta), by_time + 0.5 * (journal + bushing) * by_angle
    p = bearing.supply - 6.0 * bearing.viscosity * source / h**3 * (
        0.25 * bearing.width**2 - z * z
    )
    return p if bearing.full else np.maximum(p, 0.0), h, source


def motions(count=12):
    """Near the wall and far from it, of walls that both turn."""
    random = np.random.default_rng(5)
    for _ in range(count):
        e, at, way = C * random.uniform(0.2, 0.88), *random.uniform(0.0, 6.3, 2)
        v = 10.0 ** random.uniform(-4.0, -2.5)
        spins = random.uniform(-200.0, 200.0, 2)
        yield np.array([e * np.cos(at), e * np.sin(at), v * np.cos(way), v * np.sin(way), *spins])


def test_a_worn_film_is_the_integral_of_its_pressure(film):
    """Reynolds' equation for the thickness as it changes; moments by power and equilibrium."""
    function, bearing = film
    step = 2.0 * np.pi / 2000
    theta = step * np.arange(2000)[:, None]
    nodes, weights = np.polynomial.legendre.leggauss(24)
    z, area = 0.5 * bearing.width * nodes, 0.5 * bearing.width * bearing.radius * weights * step
    near = 1e-4 if bearing.full else 0.015
    for motion in motions():
        x, y, vx, vy, journal, bushing = motion
        p, h, source = cut_pressure(motion, bearing, theta, z)
        fx, fy, on_journal, on_bushing = function(motion)
        off = complex(fx, fy) + np.sum(area * p * np.exp(1j * theta))
        assert abs(off) <= near * np.sum(area * np.abs(p - bearing.supply))
        assert on_journal + on_bushing == pytest.approx(y * fx - x * fy, rel=1e-9, abs=1e-15)
        petroff = bearing.viscosity * bearing.width * bearing.radius**3 * 2.0 * np.pi
        lost = petroff * (journal - bushing) ** 2 * float((1.0 / h).mean())
        pressed = -float(np.sum(area * p * source))
        power = fx * vx + fy * vy + on_journal * journal + on_bushing * bushing
        assert power == pytest.approx(-lost - pressed, rel=near)


def test_either_wall_may_be_the_one_that_is_seen():
    """The rounder one's harmonics follow the other's turn: at its angle they are the same."""
    one = profile(groove(0.4), groove(1.0, 1e-6))
    other = profile(groove(1.0, 1e-6), groove(0.4))
    assert (one.place, other.place) == (1, 0)
    assert one.own == pytest.approx(other.own, abs=1e-15)
    assert one.other == pytest.approx(other.other, abs=1e-15)
    assert len(WORN.other) == 0
    assert WORN.along()[0] == pytest.approx(depth(groove(0.4), np.linspace(
        0.0, 2.0 * np.pi, WORN.count, endpoint=False)), abs=1e-11)  # fmt: skip


def points(size, at=0.0):
    """A profile as a scene gives it."""
    return {'points': [
        [f'{k} deg', size * (1.001 + np.cos(np.radians(k) - at))] for k in range(0, 360, 20)
    ]}  # fmt: skip


def four_bar(contact=(), **worn):
    keys = {'law': 'film', 'viscosity': 1e-4, 'width': 0.02, 'radius': 0.01, 'roughness': 1e-5}
    return ms.load_scene('four_bar_clearance', {
        f'{PLAY}.contact': keys | dict(contact), f'{PLAY}.radial': 1e-4, f'{PLAY}.friction': 0.1,
        f'{PLAY}.profile': {'harmonics': 8} | worn,
    })  # fmt: skip


def test_a_worn_film_knows_where_it_is_thinnest():
    """``min(c + b - Q.n)`` over all directions n, near the wall, where that matters."""
    size, roughness = 6e-6, 1e-5
    machine = four_bar(bushing=points(size, 0.3))
    mechanism = machine.mechanism
    film = next(e for e in machine.equations.system.elements if e.name == 'coupler_rocker')
    q = np.array([machine.initial_state().q]).T
    q = np.insert(q, mechanism.coordinates.index('crank'), 0.0, axis=0)
    n = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 20_000))
    q[mechanism.coordinates.index('rocker')] += 8.5e-5 / 0.312
    x, y = mechanism.trace(mechanism.separation('coupler_rocker'), q)[0][:, 0]
    assert 0.8e-4 < np.hypot(x, y) < 0.9e-4
    own = np.angle(n) - float(q[mechanism.coordinates.index('rocker'), 0])
    thickness = 1e-4 + size * (1.001 + np.cos(own - 0.3)) - (np.conj(x + 1j * y) * n).real
    assert film.thickness(q) == pytest.approx(thickness.min(), abs=2e-8)
    assert film.roughness == pytest.approx(roughness, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('contact', 'worn'),
    [
        ({'cavitation': 'none'}, 'bushing'),
        ({}, 'both'),
        ({'stiffness': 1e10}, 'both'),
        ({'supply_pressure': 5e3}, 'pin'),
    ],
)
def test_energy_is_that_of_the_drive_between_worn_walls(contact, worn):
    """Film, wall and friction together, each with moments on both."""
    given = {
        k: points(s, 0.3) for k, s in (('bushing', 6e-6), ('pin', 3e-6)) if worn in (k, 'both')
    }
    solution = ms.simulate(four_bar(contact, **given), revolutions=0.3)
    assert {m.mode.name for m in solution.modes} > {'FREE_FLIGHT'}
    assert abs(solution.energy.residual) < 1e-11
    assert solution.energy.dissipated > 1e-3


@pytest.mark.slow
def test_force_goes_on_where_soft_worn_walls_begin_to_carry():
    """From both sides of each touch."""
    machine = four_bar({'stiffness': 1e10}, bushing=points(6e-6))
    solution = ms.simulate(machine, revolutions=0.3)
    assert [m.joint for m in solution.modes][1:]
    for change in solution.modes[1:]:
        around = solution.sample(change.t + np.array([-1e-11, 1e-11]))
        force = np.array([around[f'reaction.coupler_rocker.{axis}'] for axis in 'xy'])
        assert np.hypot(*np.diff(force, axis=1)) == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize(
    ('contact', 'text'),
    [
        ({'roughness': None}, "has profile and a film alone: give 'contact.roughness'"),
        ({'roughness': 2e-4}, 'must be less than radial'),
        ({'roughness': 1e-7}, 'more harmonics follow its grooves better'),
    ],
)
def test_worn_films_that_cannot_be_are_refused(contact, text):
    sharp = {'points': [[f'{k} deg', 4e-5 * np.exp(-(((k - 90) / 12) ** 2)) + 1e-12]
                        for k in range(0, 360, 5)]}  # fmt: skip
    with pytest.raises(InputError) as error:
        four_bar(contact, bushing=sharp)
    assert text in str(error.value)
