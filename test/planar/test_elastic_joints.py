"""Guides, slots, gears, cams and belts of elastic links: closed forms and other formulations."""

import numpy as np
import pytest
from builders import made, weightless
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import mechanism_sim as ms
from mechanism_sim.analysis.preview import preview
from mechanism_sim.errors import InputError
from mechanism_sim.messages import LinkageState, deserialize
from mechanism_sim.nodes.force_markers import ForceMarkers, shapes
from mechanism_sim.nodes.publications import linkage_states
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.studies.modes import modes

TURN = 2.0 * np.pi
L, EI, RHO = 1.0, 50.0, 1.0
"""Length [m], stiffness [N m^2] and mass per length [kg/m] of a beam."""

BEAM = {'youngs_modulus': 1e11, 'second_moment': EI / 1e11, 'area': 1e-4, 'density': RHO / 1e-4}
FAR = {'ground': {'points': {'far': [L, 0.0]}}}
GUIDED, PROPPED = 2.365020372431352, 3.926602312047919
"""Roots ``k L`` of clamped beams whose end slides across, or is pinned: tan kL = -+ tanh kL."""


def roots(machine):
    """``k L`` of the modes of a machine with one beam."""
    w = TURN * np.array([mode.frequency for mode in modes(machine)])
    return np.sqrt(w * L**2 * np.sqrt(RHO / EI))


def held(joint, **elastic):
    """A beam clamped to a hub that stands, with one more joint."""
    arm = {'ends': 'clamped', 'functions': 'polynomial', 'modes': 4, **BEAM, **elastic}
    return weightless(
        links={**FAR, 'arm': {'length': L, 'elastic': arm}},
        joints={'hub': {'revolute': ['ground', 'arm']}, 'j': joint},
        drive={'coordinate': 'arm', 'speed': 0.0},
    )


@pytest.mark.parametrize(
    ('joint', 'stretch', 'root'),
    [
        ({'prismatic': ['ground.far', 'arm.end'], 'axis': '90 deg'}, 1, GUIDED),
        pytest.param(
            {'prismatic': ['arm.end', 'ground.far'], 'axis': '90 deg'},
            1,
            GUIDED,
            marks=pytest.mark.slow,
        ),
        pytest.param({'slot': ['arm.end', 'ground.far']}, 0, PROPPED, marks=pytest.mark.slow),
        ({'slot': ['ground.far', 'arm']}, 0, PROPPED),
    ],
)
def test_guides_and_slots_hold_a_beam_as_supports_do(joint, stretch, root):
    """A block at the end, a guide fixed to the end section, a pin at the end, and in the beam."""
    assert roots(held(joint, stretch=stretch))[0] == pytest.approx(root, rel=1e-3)


@pytest.mark.parametrize(
    'joint',
    [
        {'mesh': ['small', 'large']},
        {'transmission': ['pinion', 'arm'], 'ratio': '-1/2'},
        {'belt': ['pinion', 'arm'], 'radii': [0.02, 0.04], 'stiffness': 1e12},
        {'mesh': ['small', 'large'], 'elasticity': {'stiffness': 1e12}},
    ],
)
def test_wheels_turn_with_the_cross_section_at_their_centre(joint):
    """A pinned beam with a hub of inertia J at its start: the pinion's, times the ratio squared.

    ``E I w''(0) = -J w^2 w'(0)``, and no force nor moment at the end.
    """
    J, arm = 1e-3, {**BEAM, 'functions': 'polynomial', 'modes': 5}
    machine = weightless(
        links={'ground': {'points': {'shaft': [-0.06, 0.0]}},
               'pinion': {'mass': 0.3, 'inertia': J / 4.0},
               'arm': {'length': L, 'elastic': arm}},
        joints={'a': {'revolute': ['ground.shaft', 'pinion']},
                'b': {'revolute': ['ground', 'arm']}, 'j': joint},
        gears={'small': {'at': 'pinion', 'module': 2e-3, 'teeth': 20},
               'large': {'at': 'arm', 'module': 2e-3, 'teeth': 40}},
    )  # fmt: skip

    def determinant(k):
        c, s, ch, sh = np.cos(k), np.sin(k), np.cosh(k), np.sinh(k)
        spin = J * k**2 / (RHO * L**3) * k
        return np.linalg.det([
            [1.0, 0.0, 1.0, 0.0], [-1.0, spin, 1.0, spin],
            [-c, -s, ch, sh], [s, -c, sh, ch],
        ])  # fmt: skip

    found = roots(machine)
    exact = brentq(determinant, 3.5, 3.925)  # without a hub 3.9266
    assert found[found > 1.0][0] == pytest.approx(exact, rel=2e-5)


def test_a_roller_is_where_the_arm_of_its_follower_bends_it():
    """On a cam that stands, an arm is held at its pivot and its end: a beam on two supports."""
    arm = {**BEAM, 'ends': 'clamped', 'functions': 'polynomial', 'modes': 3}
    machine = ms.load_scene('oscillating_roller', {
        'links.arm': {'length': '80 mm', 'elastic': arm}, 'springs': None,
        'joints.contact.lift_off': None, 'gravity': [0.0, 0.0],
        'drive': {'coordinate': 'cam', 'speed': 0.0},
    })  # fmt: skip
    w = TURN * modes(machine)[0].frequency
    assert w == pytest.approx((np.pi / 0.08) ** 2 * np.sqrt(EI / RHO), rel=5e-3)


def test_directions_turn_with_cross_sections_as_points_beside_the_axis_do():
    mechanism = held({'slot': ['ground.far', 'arm']}, modes=2).mechanism
    q, at = np.array([[0.3], [0.1], [0.05]]), (0.4, 0.0)
    across = mechanism.trace(mechanism.direction('arm', 0.5 * np.pi, at), q)[0]
    beside = mechanism.locate_all('arm', q, (0.4, 1.0)) - mechanism.locate_all('arm', q, at)
    assert across == pytest.approx(beside, rel=1e-12)
    assert (
        np.abs(across - mechanism.trace(mechanism.direction('arm', 0.5 * np.pi), q)[0]).max()
        > 0.01
    )
    along = mechanism.trace(mechanism.direction('arm', 0.0, at), q)[0]
    assert along[:, 0] == pytest.approx([across[1, 0], -across[0, 0]])


# --- along a bent rail --------------------------------------------------------------------------


def crossing(joint, start=0.2, duration=0.2, **elastic):
    """A block or a pin that runs along a beam on two supports, under its weight."""
    beam = {**BEAM, 'second_moment': 0.1 * EI / 1e11, 'foreshortening': False, **elastic}
    machine = weightless(
        links={**FAR, 'beam': {'length': L, 'elastic': beam},
               'bead': {'mass': 3.0, 'inertia': 0.01}, 'foot': {'mass': 0.1, 'inertia': 1e-4}},
        joints={'a': {'revolute': ['ground', 'beam']}, 'b': {'revolute': ['beam.end', 'foot']},
                'c': {'prismatic': ['ground.far', 'foot']}, 'rail': joint},
        gravity=[0.0, -9.81],
        initial={'position': {'bead.x': start}, 'velocity': {'bead.x': 2.0}},
    )  # fmt: skip
    return machine, ms.simulate(machine, duration=duration)


def moving_mass(beam, until, start=0.2, m=3.0, J=0.0):
    """Place of the mass [m] and amplitudes [m] at a time: Lagrange's equations by DOP853.

    The mass is at ``(x, w(x))``, its inertia turns by ``atan w'(x)``.
    """
    g, n = -9.81, beam.modes
    s, weights = np.polynomial.legendre.leggauss(40)
    s, weights = 0.5 * L * (s + 1.0), 0.5 * L * weights
    shapes, bends = beam.deflection(s), beam.deflection(s, 2)
    M, K = RHO * (shapes * weights) @ shapes.T, 0.1 * EI * (bends * weights) @ bends.T

    def rates(_, y):
        x, q, v, dq = y[0], y[1 : n + 1], y[n + 1], y[n + 2 :]
        f, f1, f2, f3 = (beam.deflection(x, d) for d in range(4))
        p, c = f1 @ q, f2 @ q
        down, turn = np.array([p, *f]), np.array([c, *f1])
        falls = 2.0 * v * (f1 @ dq) + v**2 * c
        bent = 2.0 * v * (f2 @ dq) + v**2 * (f3 @ q)
        slope = turn @ [v, *dq]
        less = 1.0 / (1.0 + p * p)
        A = m * np.outer(down, down) + J * less**2 * np.outer(turn, turn)
        A[0, 0] += m
        A[1:, 1:] += M
        F = m * (g - falls) * down - J * less * turn * (less * bent - 2 * p * less**2 * slope**2)
        F[1:] += g * RHO * shapes @ weights - K @ q
        return np.array([v, *dq, *np.linalg.solve(A, F)])

    y = np.array([start, *np.zeros(n), 2.0, *np.zeros(n)])
    return solve_ivp(rates, (0.0, until), y, 'DOP853', rtol=1e-12, atol=1e-14).y[: n + 1, -1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ('joint', 'J', 'functions'),
    [
        ({'prismatic': ['beam', 'bead']}, 1e-2, 'polynomial'),
        pytest.param({'slot': ['bead', 'beam']}, 0.0, 'modal', marks=pytest.mark.slow),
    ],
)
def test_a_mass_that_crosses_a_beam_moves_as_galerkin_says(joint, J, functions):
    machine, solution = crossing(joint, functions=functions)
    x, names = solution.sample(0.2), ('bead.x', 'beam.bend1', 'beam.bend2')
    found = [x[f'position.{name}'][0] for name in names]
    exact = moving_mass(machine.mechanism.having(Beam)['beam'], 0.2, J=J)
    assert found == pytest.approx(exact, rel=1e-9)
    assert abs(solution.energy.residual) < 1e-12 * solution.energy.initial
    assert found[1] < -1e-2
    beam, q = machine.mechanism.having(Beam)['beam'], exact[1:]
    assert x['position.bead.y'][0] == pytest.approx(q @ beam.deflection(exact[0]))
    if J:
        turned = np.arctan(q @ beam.deflection(exact[0], 1))
        assert x['position.bead'][0] == pytest.approx(turned, rel=1e-9)


@pytest.mark.slow
def test_what_runs_off_a_beam_goes_straight_on():
    """And back onto another one: the direction of the rail does not jump at its end."""
    machine, solution = crossing({'slot': ['bead', 'beam']}, start=0.8)
    x = solution.sample(
        0.2, 'position.bead.x', 'position.beam.bend1', 'position.beam.bend2', 'position.bead.y'
    )
    amplitudes = [x['position.beam.bend1'][0], x['position.beam.bend2'][0]]
    slope = amplitudes @ machine.mechanism.having(Beam)['beam'].deflection(L, 1)
    place = x['position.bead.x'][0]
    assert place > 1.1
    assert x['position.bead.y'][0] == pytest.approx(slope * (place - L), rel=1e-12)
    assert abs(solution.energy.residual) < 1e-12 * solution.energy.initial


@pytest.mark.slow
def test_a_rail_beside_the_axis_is_parallel_to_it():
    """Its point nearest to the block is at that distance from the bent axis."""
    high = {'prismatic': ['beam.rail', 'bead']}
    beam = {**BEAM, 'foreshortening': False}
    machine = weightless(
        links={**FAR, 'beam': {'length': L, 'points': {'rail': [0.0, 0.05]}, 'elastic': beam},
               'bead': {'mass': 0.3, 'inertia': 1e-3}, 'foot': {'mass': 0.1, 'inertia': 1e-4}},
        joints={'a': {'revolute': ['ground', 'beam']}, 'b': {'revolute': ['beam.end', 'foot']},
                'c': {'prismatic': ['ground.far', 'foot']}, 'rail': high},
        gravity=[0.0, -9.81],
        initial={'position': {'bead.x': 0.2}, 'velocity': {'bead.x': 2.0}},
    )  # fmt: skip
    solution = ms.simulate(machine, duration=0.1)
    x, bent = solution.sample(0.1), machine.mechanism.having(Beam)['beam']
    q = np.array([x['position.beam.bend1'][0], x['position.beam.bend2'][0]])
    s = np.linspace(0.0, L, 20001)
    apart = np.hypot(x['position.bead.x'] - s, x['position.bead.y'] - q @ bent.deflection(s))
    deflection = np.abs(q @ bent.deflection(s)).max()
    assert deflection > 1e-4
    assert apart.min() == pytest.approx(0.05, abs=10.0 * deflection**2 * 0.05)
    assert abs(solution.energy.residual) < 1e-12 * solution.energy.initial


def quick_return(play=None, **arm):
    """A crank's pin in a slot of an arm."""
    arm = {'length': 0.5, **(arm or {'mass': 0.5, 'inertia': 0.5**3 / 12.0, 'cog': 0.25})}
    return weightless(
        links={'ground': {'points': {'shaft': [0.0, 0.25]}},
               'crank': {'length': 0.1, 'mass': 0.3, 'inertia': 1e-3}, 'arm': arm},
        joints={'a': {'revolute': ['ground.shaft', 'crank']}, 'b': {'revolute': ['ground', 'arm']},
                's': {'slot': ['crank.end', 'arm'], **({'clearance': play} if play else {})}},
        drive={'coordinate': 'crank', 'speed': 20.0}, guess={'arm': '70 deg'},
    )  # fmt: skip


@pytest.mark.slow
def test_a_stiff_rail_moves_as_a_rigid_one():
    t = np.linspace(0.0, 0.2, 50)
    mass = {'mass': 0.5, 'inertia': 0.5 * 0.5**2 / 12.0, 'cog': 0.25}
    exact = ms.simulate(quick_return(**mass), duration=0.2).sample(t, 'position.arm')[
        'position.arm'
    ]
    off = []
    for modulus in (1e13, 1e14):
        elastic = {**BEAM, 'youngs_modulus': modulus}
        x = ms.simulate(quick_return(elastic=elastic), duration=0.2).sample(t, 'position.arm')
        off.append(np.abs(x['position.arm'] - exact).max())
    assert off[1] < 0.15 * off[0] < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize('friction', [0.0, 0.1])
def test_energy_is_balanced_in_a_loose_slot_of_an_elastic_link(friction):
    rough = {'friction': friction, 'pin_radius': 5e-3, 'hypothesis': 'stronge'}
    play = {'radial': 1e-4, 'restitution': 0.5, **(rough if friction else {})}
    solution = ms.simulate(quick_return(play, elastic=BEAM), duration=0.1)
    assert len(solution.impacts) > 20
    assert abs(solution.energy.residual) < 1e-9 * solution.energy.dissipated


def test_what_turns_a_link_turns_its_cross_section():
    """Work of a torsion spring and of a torque at the start of a pinned beam."""
    machine = weightless(
        links={'arm': {'length': L, 'elastic': BEAM}},
        joints={'b': {'revolute': ['ground', 'arm']}},
        springs={'s': {'between': ['ground', 'arm'], 'stiffness': '30 N m/rad',
                       'damping': '0.1 N m s/rad'}},
        loads={'motor': {'at': 'arm', 'torque': '3*cos(5*t)'}},
    )  # fmt: skip
    energy = ms.simulate(machine, duration=0.3).energy
    assert energy.dissipated != 0.0
    assert abs(energy.residual) < 1e-12 * abs(energy.dissipated)


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'joints.s.friction': {'coefficient': 0.1}}, ['joints.s.friction', "in a 'clearance'"]),
        ({'joints.s': {'prismatic': ['arm', 'crank.end']},
          'drive': {'coordinate': 'crank', 'speed': '1 m/s'}}, ['cannot push crank along']),
        ({'joints.s': {'transmission': ['arm', 'wheel'], 'ratio': 2, 'carrier': 'crank'},
          'links.crank.elastic': BEAM}, ['this transmission needs the whole of crank']),
    ],
)  # fmt: skip
def test_what_an_elastic_link_cannot_bear_is_refused(change, words):
    whole = {
        'title': 's', 'mechanism': 'linkage',
        'links': {'ground': {'points': {'shaft': [0.0, 0.25]}}, 'wheel': {'mass': 1.0},
                  'crank': {'length': 0.1, 'mass': 0.3}, 'arm': {'length': 0.5, 'elastic': BEAM}},
        'joints': {'a': {'revolute': ['ground.shaft', 'crank']},
                   'b': {'revolute': ['ground', 'arm']}, 'w': {'revolute': ['ground', 'wheel']},
                   's': {'slot': ['crank.end', 'arm']}},
        'drive': {'coordinate': 'crank', 'speed': 20.0},
    }  # fmt: skip
    for path, value in change.items():
        *ways, last = path.split('.')
        at = whole
        for key in ways:
            at = at[key]
        at[last] = value
    with pytest.raises(InputError) as error:
        made(whole, 's')
    for text in words:
        assert text in str(error.value)
    assert '\n' not in str(error.value)


# --- what nodes show ----------------------------------------------------------------------------


def test_messages_show_elastic_links_bent():
    """Markers as figures have them, deflection and stress beside them in LinkageState."""
    machine = ms.load_scene('elastic_slider_crank')
    seen = preview(machine, 0.01)
    fixed = shapes(seen.skeleton, '').markers
    assert {m.header.frame_id for m in fixed} == {'world', 'crank', 'slider'}
    samples = seen.found.solution.view(np.array([0.005]))
    picture = ForceMarkers(seen)
    (array,) = picture.at(samples.t, samples.observed, samples.modes)
    lines = [m for m in array.markers if m.header.frame_id == 'rod']
    assert lines
    points = np.array([[p.x, p.y] for m in lines if m.ns == 'links' for p in m.points])
    bending = seen.skeleton.bendings['rod']
    q = samples.observed.position[machine.mechanism.amplitudes('rod')][:, 0]
    shown = bending.magnified * bending.beam.deflection(0.15) @ q
    middle = points[np.abs(points[:, 0] - 0.15) < 0.01, 1]
    assert abs(shown) > 0.002
    assert 0.5 * (middle.min() + middle.max()) == pytest.approx(shown, abs=2e-3)
    (data,) = linkage_states(machine, 'world')(samples)
    state = deserialize(data, LinkageState)
    assert state.elastic_links == ['rod']
    strained = seen.found.solution.sample(0.005, 'deflection.rod', 'stress.rod')
    assert state.deflections[0] == strained['deflection.rod'][0]
    assert state.stresses[0] == strained['stress.rod'][0] > 0.0
