"""Oil films that give way to walls: forces, energy, limits, and what a scene may say."""

from __future__ import annotations

from dataclasses import replace

import heyoka as hy
import numpy as np
import pytest
from builders import PLAY
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial.legendre import leggauss
from short_bearing import motions, pressure, squeeze

import mechanism_sim as ms
from mechanism_sim.engine.contact.film import JournalMotion, ShortBearing
from mechanism_sim.errors import InputError

OIL = {'law': 'film', 'viscosity': 0.03, 'width': 0.02, 'radius': 0.01}
TURN = 2.0 * np.pi / 36.6519

FULL = ShortBearing(viscosity=0.02, width=8e-3, radius=10e-3, clearance=30e-6, full=True)
HALF = ShortBearing(viscosity=0.02, width=8e-3, radius=10e-3, clearance=30e-6)


def compiled(bearing):
    v = hy.make_vars('x', 'y', 'vx', 'vy', 'journal', 'bushing', 'share')
    motion = JournalMotion(*v)
    return hy.cfunc([*bearing.force(motion), *bearing.moments(motion)], vars=v, opt_level=0)


SUPPLIES = 1e3, 3e5, 2e7
"""Pressures [Pa] of which hardly any, some and nearly all suctions are less."""
SUPPLIED = {supply: compiled(replace(HALF, supply=supply)) for supply in (1e-6, *SUPPLIES, 1e15)}
FILMS = {'full': compiled(FULL), 'half': compiled(HALF), 'supplied': SUPPLIED[3e5]}


def four_bar(contact, radial=1e-4, **play):
    keys = {f'{PLAY}.contact': OIL | contact, f'{PLAY}.radial': radial}
    return ms.load_scene('four_bar_clearance', keys | {f'{PLAY}.{k}': v for k, v in play.items()})


@given(motions())
def test_a_full_film_is_the_integral_of_all_its_pressure(motion):
    """By quadrature round the bearing: the film pulls where it pushed on the other side."""
    nodes, weights = leggauss(400)
    theta, around = np.pi * (1.0 + nodes)[:, None], np.pi * weights[:, None]
    z, along = (0.5 * FULL.width * x for x in leggauss(6))
    p, _ = pressure(motion, theta, z, FULL)
    F = -FULL.radius * np.sum(around * along * p * np.exp(1j * theta))
    fx, fy = FILMS['full']([*motion, 1.0])[:2]
    assert abs(fx + 1j * fy - F) <= 1e-9 * abs(F) + 1e-12


@given(motions(), st.sampled_from(SUPPLIES))
def test_a_supplied_film_is_the_integral_of_the_pressure_above_cavitation(motion, supply):
    """By quadrature over the bearing; what makes the force smooth changes less than this."""
    theta = np.arange(1000)[:, None] * (2.0 * np.pi / 1000)
    z, along = (0.5 * HALF.width * x for x in leggauss(40))
    p = np.maximum(supply + pressure(motion, theta, z, HALF)[0], 0.0)
    F = -HALF.radius * np.sum(along * p * np.exp(1j * theta)) * (2.0 * np.pi / 1000)
    fx, fy, *_ = SUPPLIED[supply]([*motion, 1.0])
    whole = abs(complex(*FILMS['full']([*motion, 1.0])[:2]))
    assert abs(fx + 1j * fy - F) <= 8e-3 * whole + 1e-9


@given(motions())
def test_supplies_lead_from_the_ruptured_film_to_the_whole_one(motion):
    half, full = (FILMS[kind]([*motion, 1.0]) for kind in ('half', 'full'))
    for wanted, supply in ((half, 1e-6), (full, 1e15)):
        size = np.abs(full[:2]).max()
        np.testing.assert_allclose(
            SUPPLIED[supply]([*motion, 1.0])[:2], wanted[:2], 1e-9, 1e-9 * size
        )


@given(motions(), st.floats(0.05, 1.0), st.sampled_from(('full', 'half', 'supplied')))
def test_a_film_takes_energy_also_between_walls_that_gave_way(motion, share, kind):
    """Power of forces and moments on both bodies, whatever the thickness that counts."""
    fx, fy, *moments = FILMS[kind]([*motion, share])
    power = fx * motion[2] + fy * motion[3] + moments[0] * motion[4] + moments[1] * motion[5]
    V = squeeze(motion)
    assert power <= 1e-12 * (abs(fx + 1j * fy) * abs(V) + abs(moments[0] * motion[4]))
    if abs(V) > 1e-9 and abs(motion[4] - motion[5]) > 1e-6:
        assert power < 0.0
    # one on the other: forces in one line but for the couple of both moments
    x, y = motion[:2]
    assert moments[0] + moments[1] == pytest.approx(-(x * fy - y * fx), rel=1e-9, abs=1e-15)


def test_the_force_goes_on_where_walls_begin_to_carry():
    """At both ends of each touch, from both sides; between them the solid takes a share."""
    solution = ms.simulate(four_bar({'roughness': 9e-5, 'stiffness': 1e10}), revolutions=0.5)
    assert [m.joint for m in solution.modes][1:]  # it touches and leaves
    for change in solution.modes[1:]:
        around = solution.sample(change.t + np.array([-1e-11, 1e-11]))
        force = np.array([around[f'reaction.coupler_rocker.{axis}'] for axis in 'xy'])
        assert np.hypot(*np.diff(force, axis=1)) == pytest.approx(0.0, abs=1e-5)
    assert abs(solution.energy.residual) < 1e-10


@pytest.mark.slow
def test_hardly_any_oil_is_a_dry_bearing_of_less_play():
    dry = ms.simulate(ms.load_scene(
        'four_bar_clearance', {f'{PLAY}.radial': 1e-5, 'start': 'centred'}
    ), revolutions=0.25)  # fmt: skip
    oiled = ms.simulate(four_bar({'roughness': 9e-5, 'viscosity': 1e-9}), revolutions=0.25)
    assert len(oiled.impacts) == len(dry.impacts) > 3
    for a, b in zip(oiled.impacts, dry.impacts, strict=True):
        assert a.t == pytest.approx(b.t, rel=1e-4)
    t = np.linspace(0.0, 0.25, 40) * TURN
    for c in ('coupler', 'rocker'):
        key = f'position.{c}'
        assert oiled.sample(t, key)[key] == pytest.approx(dry.sample(t, key)[key], abs=1e-8)


@pytest.mark.slow
def test_walls_that_are_never_reached_are_none():
    floating, walled = (
        ms.simulate(four_bar(x), revolutions=0.3).sample(0.3 * TURN)
        for x in ({}, {'roughness': 1e-6})
    )
    assert walled['position.rocker'] == pytest.approx(floating['position.rocker'], abs=1e-12)


@pytest.mark.parametrize(
    'more',
    [
        {},
        pytest.param({'stiffness': 1e10}, marks=pytest.mark.slow),
        pytest.param({'cavitation': 'none'}, marks=pytest.mark.slow),
        pytest.param({'supply_pressure': 5e3}, marks=pytest.mark.slow),
    ],
)
def test_energy_is_that_of_the_drive_while_it_rubs(more):
    """Film, wall and friction together; the pi film has a corner where the slip turns."""
    machine = four_bar({'roughness': 9e-5, 'viscosity': 1e-4} | more, friction=0.1)
    solution = ms.simulate(machine, revolutions=0.6)
    assert {m.mode.name for m in solution.modes} > {'FREE_FLIGHT'}
    assert abs(solution.energy.residual) < 1e-10
    assert solution.energy.dissipated > 1e-4


@pytest.mark.slow
def test_oil_beside_a_dry_bearing_and_elastic_links():
    """The film turns with the cross-sections of links: its moments do work on bending."""
    machine = ms.load_scene('four_bar_elastic', {
        'joints.rocker_ground.clearance': {'radial': 1e-4, 'restitution': 0.5, 'contact': OIL},
    })  # fmt: skip
    solution = ms.simulate(machine, revolutions=0.4)
    assert {i.joint for i in solution.impacts} <= {'coupler_rocker'}
    assert abs(solution.energy.residual) < 1e-10


@pytest.mark.parametrize(
    ('contact', 'play', 'text'),
    [
        ({'roughness': 1e-4}, {}, 'must be less than radial'),
        ({}, {'friction': 0.1}, "give 'contact.roughness'"),
        ({'stiffness': 1e9}, {}, "give 'contact.roughness'"),
        ({'roughness': 1e-6}, {'pin_radius': 0.01, 'friction': 0.1}, 'it is contact.radius'),
        (
            {'cavitation_pressure': 2e5, 'supply_pressure': 1e5},
            {},
            'is less than cavitation_pressure',
        ),
        (
            {'cavitation': 'none', 'supply_pressure': 1e5},
            {},
            'whatever the pressure of its supply',
        ),
        (
            {'law': 'hertz', 'stiffness': 1e9, 'supply_pressure': 1e5},
            {},
            'applies to the law film only',
        ),
    ],
)
def test_what_makes_no_sense_is_refused(contact, play, text):
    with pytest.raises(InputError, match=text):
        four_bar(contact, **play)


def test_roughness_is_of_oil_and_walls_are_alike():
    with pytest.raises(InputError, match='applies to the law film only'):
        ms.load_scene('four_bar_clearance', {
            f'{PLAY}.contact': {'law': 'hertz', 'stiffness': 1e9, 'roughness': 1e-6}
        })  # fmt: skip
    with pytest.raises(InputError, match=r"no 'contact.stiffness', but another"):
        ms.load_scene('four_bar_clearance', {
            f'{PLAY}.contact': {'law': 'hertz', 'stiffness': 1e9},
            'joints.crank_coupler.clearance': {
                'radial': 1e-4, 'restitution': 0.5, 'contact': OIL | {'roughness': 1e-6},
            },
        })  # fmt: skip


def test_walls_that_never_touch_need_no_restitution():
    """A rotor in a film, as a person of the trade writes it: nothing rebounds."""
    play = {
        'radial': 60e-6,
        'contact': {**OIL, 'viscosity': 0.02, 'width': 0.025, 'radius': 0.025},
    }
    scene = {
        'title': 'Rotor in oil',
        'mechanism': 'linkage',
        'links': {'rotor': {'mass': 20.0, 'inertia': 0.1}},
        'joints': {'b': {'revolute': ['ground', 'rotor'], 'clearance': play}},
        'drive': {'coordinate': 'rotor', 'speed': '3000 rpm'},
    }
    assert ms.load_scene(scene).plan.clearances['b'].wall == ''
    play['contact']['roughness'] = 2e-6
    with pytest.raises(InputError, match=r'restitution. is missing'):
        ms.load_scene(scene)
