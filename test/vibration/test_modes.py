"""Modes and steady responses of scenes, against closed forms and against simulation."""

import json

import numpy as np
import pytest
from builders import made, weightless
from damping import damping_ratio, logarithmic_decrement
from excitations import relative_transmissibility
from masses import chain
from oscillator import Oscillator
from rotors import Rotor
from running import run, run_json
from two_masses import TwoMasses

import mechanism_sim as ms
from mechanism_sim.engine.observer import Instants
from mechanism_sim.errors import InputError
from mechanism_sim.report.vibrations import response_text
from mechanism_sim.scene.load import without_clearance
from mechanism_sim.scene.start import Start
from mechanism_sim.studies.floquet import repeated, station
from mechanism_sim.studies.harmonics import harmonics
from mechanism_sim.studies.modes import (
    about,
    along,
    campbell,
    critical_speeds,
    linearised,
    modes,
    natural_modes,
)
from mechanism_sim.studies.response import read_source, response

TURN = 2.0 * np.pi
EXACT = {'rel': 1e-10, 'abs': 1e-13}


def row(masses, stiffnesses, dampings, **more):
    """Masses in a row along x, the first one on a spring to the ground."""
    names = [f'm{k}' for k in range(len(masses))]
    ends = ['ground', *names]
    return weightless(
        links={n: {'mass': m} for n, m in zip(names, masses, strict=True)},
        joints={f'g_{n}': {'prismatic': ['ground', n]} for n in names},
        springs={
            f's{k}': {
                'between': [ends[k], ends[k + 1]],
                'stiffness': f'{x} N/m',
                'damping': f'{c} N s/m',
                'free_length': 1.0,
            }
            for k, (x, c) in enumerate(zip(stiffnesses, dampings, strict=True))
        },
        initial={'position': {n: f'{k + 1.05} m' for k, n in enumerate(names)}},
        **more,
    )


def amplitudes(machine, quantity, frequency, **source):
    found = response(machine, read_source(machine, **source), [quantity], np.array(frequency))
    return found.amplitudes[quantity]


@pytest.mark.parametrize('ratio', [0.0, 0.1, 1.0, 2.5])
def test_a_mass_on_a_spring_is_an_oscillator(ratio):
    o = Oscillator.of_ratio(12.0, ratio, 3.0)
    machine = row([3.0], [o.stiffness], [o.damping])
    (mode,) = modes(machine)
    assert TURN * mode.frequency == pytest.approx(12.0, **EXACT)
    assert mode.damping_ratio == pytest.approx(ratio, rel=1e-10, abs=1e-13)
    f = np.array([0.0, 1.0, 1.8, 7.0])
    found = amplitudes(machine, 'position.m0', f, force='m0', direction=0.0)
    assert found == pytest.approx(o.receptance(TURN * f), **EXACT)
    # the guide takes nothing of a force along it, and all of one across
    across = amplitudes(machine, 'reaction.g_m0.y', f, force='m0', direction=np.pi / 2)
    assert across == pytest.approx(-np.ones(4), **EXACT)


def test_random_rows_have_the_modes_of_their_matrices():
    rng = np.random.default_rng(24)
    for _ in range(12):
        n = int(rng.integers(1, 5))
        m, k = rng.uniform(0.1, 5.0, n), rng.uniform(10.0, 3e3, n)
        c = rng.uniform(0.0, 5.0, n) * rng.integers(0, 2)
        machine, known = row(m, k, c), chain(m, k, c)
        one = linearised(machine)
        for mine, other in zip(
            one.matrices, (known.mass, known.damping, known.stiffness), strict=True
        ):
            assert mine == pytest.approx(other, rel=1e-10, abs=1e-10 * np.abs(other).max())
        roots = known.damped_modes.roots
        expected = np.sort(np.abs(roots[roots.imag > 0.0]))
        assert [TURN * x.frequency for x in one.modes() if x.oscillates] == (
            pytest.approx(expected, rel=1e-10)
        )


def test_two_masses_have_their_closed_form():
    two = TwoMasses(18.0, 4.0, 2e4, 4e3, 30.0, 8.0)
    machine = row([two.m1, two.m2], [two.k1, two.k2], [two.c1, two.c2])
    f = np.array([0.5, 4.0, 6.5])
    expected = two.steady(TURN * f)
    for k in (0, 1):
        found = amplitudes(machine, f'position.m{k}', f, force='m1', direction=0.0)
        assert found == pytest.approx(expected[k], **EXACT)
    still = row([two.m1, two.m2], [two.k1, two.k2], [0.0, 0.0])
    found = modes(still)
    assert [TURN * m.frequency for m in found] == pytest.approx(two.natural_frequencies, **EXACT)
    ratios = [(m.shape['m1'] / m.shape['m0']).real for m in found]
    assert ratios == pytest.approx(two.mode_ratios, **EXACT)


def test_a_base_moves_the_mass_and_its_reaction():
    machine = ms.load_scene('mass_on_spring')
    o = Oscillator.of_coefficients(2.0, 4.0, 500.0)
    f = np.array([0.0, 1.0, 2.5, 8.0])
    moved = amplitudes(machine, 'position.mass', f, base='base')
    assert moved == pytest.approx(o.transmissibility(TURN * f), **EXACT)
    assert moved - 1.0 == pytest.approx(relative_transmissibility(o, TURN * f), **EXACT)


def test_an_unbalance_shakes_by_its_first_harmonic():
    machine = ms.load_scene('unbalanced_machine')
    w = 20.0 * np.pi
    o = Oscillator.of_coefficients(22.0, 100.0, 2e4)
    series = harmonics(machine, ['position.machine', 'acceleration.machine'], 3).series
    # the unbalance pushes upwards as m e w^2 sin(w t)
    expected = -1j * 2.0 * 5e-3 * w**2 * o.receptance(w)
    found = series['position.machine'].amplitudes
    assert found == pytest.approx([expected, 0.0, 0.0], rel=1e-10, abs=1e-15)
    assert series['acceleration.machine'].amplitudes[0] == pytest.approx(-(w**2) * expected)
    # as the simulation has it once the start has died away, at 2.27/s
    end = ms.simulate(machine, duration=10.0)
    t = np.linspace(9.8, 9.9, 21)
    seen = end.sample(t, 'position.machine')['position.machine'] - (0.2 - 22.0 * 9.81 / 2e4)
    assert seen == pytest.approx(series['position.machine'](t), rel=1e-7, abs=1e-12)


def test_a_slider_crank_shakes_its_frame_as_simulated():
    """All harmonics of its inertia forces; the moving masses do not depend on the crank angle."""
    machine = weightless(
        links={
            'frame': {'mass': 10.0},
            'crank': {'length': 0.05, 'mass': 0.5, 'inertia': 1e-3, 'cog': 0.01},
            'rod': {'length': 0.2, 'mass': 0.6, 'inertia': 3e-3, 'cog': 0.07},
            'piston': {'mass': 0.8, 'inertia': 1e-3},
        },
        joints={
            'ground_frame': {'prismatic': ['ground', 'frame']},
            'frame_crank': {'revolute': ['frame', 'crank']},
            'crank_rod': {'revolute': ['crank.end', 'rod']},
            'rod_piston': {'revolute': ['rod.end', 'piston']},
            'frame_piston': {'prismatic': ['frame', 'piston']},
        },
        springs={
            'mount': {'between': ['ground', 'frame'], 'stiffness': '8 N/mm',
                      'damping': '200 N s/m', 'free_length': 1.0},
        },
        drive={'coordinate': 'crank', 'speed': '20 rad/s', 'start_angle': '0 deg'},
        initial={'position': {'frame': '1 m'}},
        guess={'rod': '0 deg', 'piston': '0 deg'},
    )  # fmt: skip
    (mode,) = modes(machine)
    assert TURN * mode.frequency == pytest.approx(np.sqrt(8e3 / 11.9), **EXACT)
    series = harmonics(machine, ['position.frame'], 24).series['position.frame']
    t = np.linspace(3.0, 3.3, 31)  # the start has died away, at 8.4/s
    seen = ms.simulate(machine, duration=3.4).sample(t, 'position.frame')['position.frame'] - 1.0
    assert series(t) == pytest.approx(seen, abs=1e-9 * np.abs(seen).max() + 1e-13)


def test_an_absorber_rests_the_machine():
    series = harmonics(ms.load_scene('vibration_absorber'), [], 1).series
    two = TwoMasses(20.0, 4.0, 2e4, 4.0 * (10.0 * np.pi) ** 2, 20.0, 1.0)
    w = 10.0 * np.pi
    expected = two.steady(w, 2.0 * 4e-3 * w**2, 0.0)
    found = [series[f'position.{n}'].amplitudes[0] for n in ('machine', 'absorber')]
    assert found == pytest.approx(expected, **EXACT)


def test_a_load_over_time_has_harmonics():
    loads = {'push': {'at': 'm0', 'force': ['3 + sin(4*t)**3', 0]}}
    machine = row([2.0], [50.0], [4.0], loads=loads)
    series = harmonics(machine, [], 3, TURN / 4.0).series['position.m0']
    o = Oscillator.of_coefficients(2.0, 4.0, 50.0)
    w = np.array([4.0, 8.0, 12.0])
    force = np.array([-0.75j, 0.0, 0.25j])  # sin^3 = (3 sin - sin 3)/4
    assert series.amplitudes == pytest.approx(force * o.receptance(w), **EXACT)


def test_half_a_car_bounces_and_pitches():
    """The stiffness of level springs under the ends of a body, with their small shear at work."""
    machine = ms.load_scene('half_car')
    one = linearised(machine)
    M, C, K = one.matrices
    assert pytest.approx(np.diag([700.0, 1200.0]), **EXACT) == M
    y, pitch = one.at.q
    assert one.derivatives.coordinates == ('guide', 'body')
    assert abs(pitch) < 0.1
    # by the energy of the springs alone, differentiated by complex steps of first derivatives
    a, b, k = (1.3, -1.6), (1.3, -1.6), (22e3, 20e3)

    def moments(y, p):
        total = np.zeros(2, complex)
        for ground, x, stiff in zip(a, b, k, strict=True):
            dx, dy = x * np.cos(p) - ground, y + x * np.sin(p)
            length = np.sqrt(dx**2 + dy**2)
            pull = stiff * (length - 0.6) / length
            total += pull * np.array([dy, dx * -x * np.sin(p) + dy * x * np.cos(p)])
        return total

    h = 1e-30
    columns = [moments(y + 1j * h, pitch).imag / h, moments(y, pitch + 1j * h).imag / h]
    assert pytest.approx(np.transpose(columns), rel=1e-10) == K
    assert moments(y, pitch).real == pytest.approx([-700.0 * 9.81, 0.0], abs=1e-8)
    assert [m.frequency for m in one.modes()] == pytest.approx(
        [roots.frequency for roots, _ in natural_modes(M, C, K)]
    )


@pytest.mark.parametrize('damping', [0.0, 0.2])
def test_modes_of_the_same_frequency_are_told_apart_by_their_coordinates(damping):
    # a ring of three equal masses, and one beside it, whose damper may not be in proportion
    ring = np.diag([4.0, 4.0, 4.0, 9.0])
    ring[:3, :3] -= 1.0
    C = np.diag([0.1, 0.1, 0.1, damping])
    for M in (np.eye(4), 2.0 * np.eye(4)):
        found = natural_modes(M, C, M @ ring)
        shapes = [z / z[np.abs(z).argmax()] for _, z in found]
        expected = [(1, 1, 1, 0), (1, -0.5, -0.5, 0), (0, 1, -1, 0), (0, 0, 0, 1)]
        for z, e in zip(shapes, np.array(expected), strict=True):
            assert abs(z @ e) ** 2 == pytest.approx((z.conj() @ z).real * (e @ e))
        assert shapes[0] == pytest.approx(expected[0], abs=1e-9)


def test_real_roots_have_a_damping_ratio_where_two_share_a_shape():
    """An overdamped mass beside a gyroscopic pair; a damper that is not in proportion."""
    C = np.array([[0.1, 3.0, 0.0], [-3.0, 0.1, 0.0], [0.0, 0.0, 5.0]])
    found = natural_modes(np.eye(3), C, np.diag([1.0, 1.0, 4.0]))
    assert [roots.oscillates for roots, _ in found] == [True, False, True]
    overdamped, shape = found[1]  # s^2 + 5 s + 4
    assert overdamped == pytest.approx([-1.0, -4.0], **EXACT)
    assert (overdamped.frequency, overdamped.damping_ratio) == pytest.approx(
        (2.0 / TURN, 5.0 / (2.0 * 2.0)), **EXACT
    )
    assert overdamped.time_constants == pytest.approx((1.0, 0.25), **EXACT)
    assert np.abs(shape[:2]).max() < 1e-12
    M, C, K = np.eye(2), np.diag([9.0, 0.1]), np.array([[2.0, -1.0], [-1.0, 3.0]])
    found = natural_modes(M, C, K)
    expected = np.linalg.eigvals(np.block([[np.zeros((2, 2)), M], [-K, -C]]))
    alone = [roots for roots, _ in found if not roots.oscillates]
    assert sorted(x[0].real for x in alone) == pytest.approx(
        np.sort(expected[expected.imag == 0.0].real)
    )
    for roots in alone:
        assert (len(roots), roots.frequency, roots.damping_ratio) == (1, 0.0, None)
        assert roots.time_constants == pytest.approx([-1.0 / roots[0].real])


def test_what_is_not_damped_beside_what_grows_has_the_ratio_0_without_a_sign():
    """A beam under more than its critical load; the linear system is solved by its roots."""
    K = np.diag([-1.0, 4.0])
    ratios = [x.damping_ratio for x, _ in natural_modes(np.eye(2), np.zeros((2, 2)), K)]
    assert [str(x) for x in ratios] == ['None', 'None', '0.0']


def test_a_motion_that_only_grows_has_no_damping_ratio():
    """A mass on a spring that pushes it away: one root decays, one grows."""
    found = natural_modes(np.eye(1), np.array([[0.5]]), np.array([[-4.0]]))
    a, b = np.sort(np.roots([1.0, 0.5, -4.0]))
    assert [x.damping_ratio for x, _ in found] == [None, None]
    assert [x.time_constants for x, _ in found] == [
        pytest.approx((-1.0 / b,)), pytest.approx((-1.0 / a,))
    ]  # fmt: skip


def test_overdamped_modes_are_shown_by_their_time_constants():
    change = ['--set', 'springs.spring.damping=100 N s/m']
    (mode,) = run_json('modes', 'mass_on_spring', *change)['modes']
    s1, s2 = np.sort(np.roots([2.0, 100.0, 500.0]))[::-1]
    assert mode['damping_ratio'] == pytest.approx(100.0 / (2.0 * np.sqrt(500.0 * 2.0)))
    assert (mode['oscillates'], mode['damped_frequency']) == (False, 0.0)
    assert mode['time_constants'] == pytest.approx([-1.0 / s1, -1.0 / s2])
    text = run('modes', 'mass_on_spring', *change).stdout
    assert f'time constant [s]       {-1.0 / s1:.6g} and {-1.0 / s2:.6g}' in text


def test_free_shafts_have_a_rigid_body_mode():
    links = {n: {'mass': 1.0, 'inertia': x} for n, x in zip('abc', (1.0, 2.0, 3.0), strict=True)}
    machine = weightless(
        links=links,
        joints={f'j{n}': {'revolute': ['ground', n]} for n in 'abc'},
        springs={
            'ab': {'between': ['a', 'b'], 'stiffness': '50 N m/rad', 'damping': '0.3 N m s/rad'},
            'bc': {'between': ['b', 'c'], 'stiffness': '70 N m/rad'},
        },
    )
    found = modes(machine)
    known = chain([1.0, 2.0, 3.0], [0.0, 50.0, 70.0], [0.0, 0.3, 0.0])
    assert found[0].frequency == 0.0
    assert [z.real for z in found[0].shape.values()] == pytest.approx([1.0] * 3, abs=1e-6)
    roots = known.damped_modes.roots
    expected = np.sort(np.abs(roots[roots.imag > 1.0]))
    assert [TURN * m.frequency for m in found[1:]] == pytest.approx(expected, rel=1e-10)
    with pytest.raises(InputError, match='resonance without damping'):
        amplitudes(machine, 'position.a', [0.0, 1.0], torque='a')


def test_equal_modes_are_two():
    machine = weightless(
        links={'a': {'mass': 1.0}, 'b': {'mass': 1.0}},
        joints={f'ground_{n}': {'prismatic': ['ground', n]} for n in 'ab'},
        springs={
            n: {'between': ['ground', n], 'stiffness': '9 N/m', 'free_length': 1.0} for n in 'ab'
        },
        initial={'position': {'a': '1 m', 'b': '1 m'}},
    )
    assert [TURN * m.frequency for m in modes(machine)] == pytest.approx([3.0, 3.0], **EXACT)


def test_a_pendulum_swings_as_its_simulation_does():
    (mode,) = modes(ms.load_scene('pendulum'))
    assert TURN * mode.frequency == pytest.approx(np.sqrt(1.2 * 9.81 * 0.5 / 0.4), **EXACT)
    amplitude = 1e-4
    small = ms.load_scene('pendulum', {'initial.position.bar': f'{-np.pi / 2 + amplitude} rad'})
    t = np.linspace(0.0, 3.0, 31)
    seen = ms.simulate(small, duration=3.0).sample(t, 'position.bar')['position.bar'] + np.pi / 2
    assert seen == pytest.approx(amplitude * np.cos(TURN * mode.frequency * t), abs=1e-11)


def test_a_machine_with_loops_swings_as_its_simulation_does():
    catapult = ms.load_scene('catapult')
    (mode,) = modes(catapult)
    one = linearised(catapult)
    q = dict(zip(one.derivatives.coordinates, one.at.q, strict=True))
    amplitude = 1e-5
    small = ms.load_scene(
        'catapult', {'initial.position.arm': f'{q["arm"] + amplitude} rad',
                     'guess.link': f'{q["link"]} rad', 'guess.carriage': f'{q["carriage"]} m'}
    )  # fmt: skip
    t = np.linspace(0.0, 1.0, 21)
    seen = ms.simulate(small, duration=1.0).sample(t, 'position.arm', 'position.link')
    wave = amplitude * np.cos(TURN * mode.frequency * t)
    assert seen['position.arm'] - q['arm'] == pytest.approx(wave, abs=1e-8)
    assert seen['position.link'] - q['link'] == pytest.approx(
        mode.shape['link'].real * wave, abs=1e-8
    )


def test_reactions_are_those_of_the_equations_of_motion():
    """Forces at both ends of a small vibration, by the forward dynamics of the loaded machine."""
    f, small = 2.0, 1e-4
    shaken = ms.load_scene('catapult')
    one = linearised(shaken)
    names = [j.name for j in shaken.plan.joints]
    wanted = [f'reaction.{name}.{axis}' for name in names for axis in 'xy']
    places = [f'position.{c}' for c in one.derivatives.coordinates]
    source = read_source(shaken, force='arm.cup', direction=np.pi / 2)
    found = response(shaken, source, [*wanted, *places], np.array([f])).amplitudes
    z = np.array([found[name][0] for name in places])

    def forces(sign, phase):
        turn = small * sign * np.exp(1j * phase)
        content = shaken.scene.model_dump()
        content['loads'] = {'push': {'at': 'arm.cup', 'force': [0.0, turn.real]}}
        loaded = made(content, 'catapult')
        q, v = one.at.q + (z * turn).real, (1j * TURN * f * z * turn).real
        start = Start(loaded.plan, loaded.nominal, loaded.equations, 1.0)
        return start.joint_forces(q[:, None], v[:, None]).ravel()

    for phase in (0.0, np.pi / 2):
        change = (forces(1.0, phase) - forces(-1.0, phase)) / (2.0 * small)
        expected = [(found[name][0] * np.exp(1j * phase)).real for name in wanted]
        assert change == pytest.approx(expected, rel=1e-6, abs=1e-6)


def random_machine(rng, kind):
    """Two links under springs, dampers and weight: free, or the end of the second one guided."""

    def u(low, high):
        return float(rng.uniform(low, high))

    def link(length=None):
        mass = {'mass': u(0.2, 2.0), 'inertia': u(0.01, 0.1)}
        return mass if length is None else {**mass, 'length': length, 'cog': u(0.05, 0.3)}

    ground = {'w': [u(0.3, 0.8), u(-0.8, 0.3)], 'o': [u(0.6, 0.9), u(-0.1, 0.1)]}
    parts = {
        'links': {'ground': {'points': ground}, 'a': link(u(0.2, 0.6)), 'b': link(u(0.5, 0.9))},
        'joints': {'O': {'revolute': ['ground', 'a']}, 'A': {'revolute': ['a.end', 'b']}},
        'springs': {
            's': {'between': ['ground.w', 'b.end'], 'stiffness': f'{u(20, 300)} N/m',
                  'damping': f'{u(0, 3)} N s/m', 'free_length': u(0.1, 0.3)},
            't': {'between': ['a', 'b'], 'stiffness': f'{u(1, 8)} N m/rad',
                  'damping': f'{u(0, 0.4)} N m s/rad', 'free_angle': f'{u(-1, 1)} rad'},
        },
        'gravity': [u(-3.0, 3.0), -9.81],
        'guess': {'a': '-60 deg', 'b': '20 deg'},
    }  # fmt: skip
    if kind == 'four-bar':
        parts['links']['c'] = link(u(0.5, 0.8))
        parts['joints'] |= {'B': {'revolute': ['b.end', 'c.end']},
                            'C': {'revolute': ['ground.o', 'c']}}  # fmt: skip
        parts['guess']['c'] = '-80 deg'
    elif kind == 'slider-crank':
        parts['links']['c'] = link()
        guide = {'prismatic': ['ground', 'c'], 'axis': f'{u(-20, 20)} deg'}
        parts['joints'] |= {'B': {'revolute': ['b.end', 'c']}, 'C': guide}
        parts['guess']['c'] = 0.8
    elif kind == 'governed':
        parts['drive'] = {'coordinate': 'a', 'torque': {
            'constant': u(-1, 1), 'per_angle': -u(1, 9), 'per_speed': -u(0, 1)}}  # fmt: skip
        parts['loads'] = {'f': {'at': 'b.end', 'force': [f'1-{u(0, 2)}*vx', '3*sin(x)-vy*y']}}
    return weightless(**parts)


def accelerations(one, dz, dv):
    """Of the independent coordinates beside the equilibrium, by the forward dynamics."""
    machine, coordinates = one.machine, one.derivatives.coordinates
    kinematics = machine.plan.kinematics([coordinates[i] for i in one.independent])
    q = kinematics.positions((one.at.q + one.B @ dz)[:, None])[0]
    v = kinematics.rates(q, np.array(dv)[:, None])
    torques = []
    for c in machine.plan.powered:
        i, (k0, k1, k2) = coordinates.index(c), machine.plan.laws[c][0].coefficients
        torques.append(k0 + k1 * q[i] + k2 * v[i])
    none = np.zeros((0, 1))
    seen = machine.equations.ideal_observer.observe(
        Instants(q, v, none, np.zeros((0, 1), np.uint8), np.reshape(torques, (-1, 1)))
    )
    return seen.acceleration[one.independent, 0]


@pytest.mark.sample(2)
@pytest.mark.parametrize('kind', ['free', 'four-bar', 'slider-crank', 'governed'])
def test_random_machines_accelerate_as_their_matrices_say(kind):
    """By central differences over states that are compatible."""
    rng, h = np.random.default_rng(6), 1e-5
    for _ in range(3):
        one = linearised(random_machine(rng, kind))
        M, C, K = one.matrices
        still, moved = np.zeros(len(M)), h * np.eye(len(M))
        for matrix, states in (
            (K, [(x, still) for x in moved]),
            (C, [(still, x) for x in moved]),
        ):
            ahead, behind = (
                np.array([accelerations(one, sign * a, sign * b) for a, b in states])
                for sign in (1.0, -1.0)
            )
            expected = -np.linalg.solve(M, matrix)
            size = np.abs(expected).max() + 1e-3
            found = (ahead - behind).T / (2.0 * h)
            assert found == pytest.approx(expected, abs=1e-7 * size)


def rotating():
    """A mass on two springs across each other in a frame that turns."""
    spring = {'stiffness': '400 N/m', 'free_length': 1.0}
    return weightless(
        links={
            'frame': {'mass': 1.0, 'inertia': 1.0},
            'a': {'mass': 1e-12, 'inertia': 0.0},
            'b': {'mass': 1.0, 'inertia': 0.0},
        },
        joints={
            'O': {'revolute': ['ground', 'frame']},
            'along': {'prismatic': ['frame', 'a']},
            'across': {'prismatic': ['a', 'b'], 'axis': '90 deg'},
        },
        springs={
            'along': {'between': ['frame', 'a'], **spring},
            'across': {'between': ['a', 'b'], **spring},
        },
        drive={'coordinate': 'frame', 'speed': '10 rad/s'},
        initial={'position': {'a': '1 m', 'b': '1 m'}},
    )


def test_an_isotropic_rotor_whirls_forwards_and_backwards():
    """Seen from the frame that turns at w, both whirls at wn come at |wn - w| and wn + w."""
    machine = rotating()
    for at in campbell(machine, np.array([1.0, 5.0, 15.0])):
        found = [TURN * m.frequency for m in at.modes]
        assert found == pytest.approx([20.0 - at.speed, 20.0 + at.speed], rel=1e-8)


def test_critical_speeds_of_unequal_supports():
    machine = ms.load_scene('rotor_on_supports')
    stations = campbell(machine, np.linspace(10.0, 100.0, 4))
    found = critical_speeds(machine, stations)
    assert [x.speed for x in found] == pytest.approx([50.0, 70.0], **EXACT)


def test_a_rotor_whirls_on_its_orbit():
    rotor = Rotor(10.0, 1e-3, (25e3, 49e3), (50.0, 60.0))
    for speed in (30.0, 60.0, 90.0):  # below, between and above its critical speeds
        turning = ms.load_scene('rotor_on_supports', {'drive.speed': f'{speed} rad/s'})
        series = harmonics(turning, [], 1).series
        x, y = (series[f'position.disk.{axis}'].amplitudes[0] for axis in 'xy')
        orbit = rotor.whirl(speed)
        assert [x, y] == pytest.approx([orbit.x, orbit.y], **EXACT)
    undamped = [TURN * m.frequency for m in modes(turning)]
    assert undamped == pytest.approx([x.natural_frequency for x in rotor.directions], **EXACT)


def test_a_mass_let_go_decays_by_its_decrement():
    machine = ms.load_scene('mass_on_spring')
    (mode,) = modes(machine)
    period = 1.0 / mode.damped_frequency
    t = np.arange(4) * period
    seen = ms.simulate(machine, duration=2.0).sample(t, 'position.mass')['position.mass']
    heights = -(seen - (0.3 - 2.0 * 9.81 / 500.0))
    assert damping_ratio(logarithmic_decrement(heights)) == pytest.approx(mode.damping_ratio)


TORSION = {'drive.torque': {'constant': 5.0, 'per_speed': -0.1}, 'drive.speed': 40.0}


def test_a_motor_keeps_a_torsional_shaft_turning():
    """The modes of the free shaft, one of which settles with the slope of the motor."""
    machine = ms.load_scene('torsional_shaft', TORSION)
    found = about(machine)
    assert found.speed == pytest.approx(50.0, **EXACT)
    M = np.diag([0.02, 0.05, 0.03])
    C = np.array([[0.3, -0.2, 0.0], [-0.2, 0.3, -0.1], [0.0, -0.1, 0.1]])
    K = np.array([[800.0, -800.0, 0.0], [-800.0, 1300.0, -500.0], [0.0, -500.0, 500.0]])
    slow, fast = -np.linalg.solve(M, K), -np.linalg.solve(M, C)
    roots = np.linalg.eigvals(np.block([[np.zeros((3, 3)), np.eye(3)], [slow, fast]]))
    expected = sorted(abs(r) for r in roots if r.imag >= 0.0 and abs(r) > 1e-6)
    seen = [m.roots.size for m in found.modes if m.roots.size]
    assert seen == pytest.approx(expected, rel=1e-9)
    # a shaft without stiffness to the ground, and how its speed settles: neither oscillates
    rigid, settling, *others = found.modes
    assert (rigid.frequency, rigid.damping_ratio, rigid.time_constants) == (0.0, None, ())
    (slow,) = (r.real for r in roots if not r.imag and r.real < -1e-6)
    assert (settling.frequency, settling.damping_ratio) == (0.0, None)
    assert settling.time_constants == pytest.approx([-1.0 / slow], rel=1e-9)
    assert all(m.oscillates and m.damping_ratio < 1.0 for m in others)
    # the same by the motion of a turn, but for whole turns of the shaft
    roots = [m.roots[0] for m in found.modes if m.roots.size]
    seen = [m.roots[0] for m in repeated(machine).modes]
    least = [r.real + 1j * abs(np.remainder(r.imag + 25.0, 50.0) - 25.0) for r in roots]
    assert sorted(seen, key=abs) == pytest.approx(sorted(least, key=abs), rel=1e-6)


@pytest.mark.slow
def test_a_four_bar_that_a_torque_turns_settles_as_liouville_says():
    """The volume of a turn in angle and momentum shrinks by exp(-integral c/J dt)."""
    c = 0.01
    torque = {'constant': 0.2, 'per_speed': -c}
    machine = ms.load_scene('four_bar_nominal', {
        'drive': {'coordinate': 'crank', 'torque': torque, 'speed': 20.0}})  # fmt: skip
    found = station(machine, turning=True)
    (mode,) = found.modes
    assert (mode.damping_ratio, mode.oscillates, found.faded) == (None, False, 0)
    period = TURN / found.speed
    t = np.linspace(12.0 - period, 12.0, 500)
    seen = ms.simulate(machine, duration=12.0).sample(t, 'energy.kinetic', 'velocity.crank')
    inertia = 2.0 * seen['energy.kinetic'] / seen['velocity.crank'] ** 2
    rate = np.trapezoid(c / inertia, t) / period
    assert mode.time_constants == pytest.approx([1.0 / rate], rel=1e-6)
    drive = {'coordinate': 'crank', 'torque': torque, 'speed': 20.0}
    loads = {'push': {'at': 'rocker', 'torque': '0.01*sin(3*t)'}}
    pushed = ms.load_scene('four_bar_nominal', {'drive': drive, 'loads': loads})
    with pytest.raises(InputError, match='loads or other drives depend on time'):
        station(pushed, turning=True)


def test_modes_along_the_turn():
    """A pendulum whose suspension a crank moves round a circle, held where it is."""
    machine = weightless(
        links={
            'crank': {'length': 0.1, 'mass': 1.0, 'inertia': 0.1},
            'bar': {'mass': 1.0, 'inertia': 0.2, 'cog': 0.5},
        },
        joints={'O': {'revolute': ['ground', 'crank']}, 'A': {'revolute': ['crank.end', 'bar']}},
        gravity=[0.0, -9.81],
        drive={'coordinate': 'crank', 'speed': '10 rad/s'},
        initial={'position': {'bar': '-80 deg'}},
    )
    stations = along(machine, 5)
    assert [s.position['crank'] for s in stations] == pytest.approx(TURN * np.arange(5) / 5)
    expected = np.sqrt(9.81 * 0.5 / (0.2 + 0.25))
    assert [TURN * s.modes[0].frequency for s in stations] == pytest.approx([expected] * 5)


def test_frames_on_springs_have_their_modes():
    machine = ms.load_scene('four_bar_on_frame')
    expected = machine.frame('frame').frequencies
    assert [m.frequency for m in modes(machine)] == pytest.approx(expected, rel=2e-3)


def test_a_frame_answers_to_a_force_as_an_oscillator():
    content = ms.load_scene('four_bar_on_frame').scene.model_dump(exclude_unset=True)
    mount = {'at': [0.1, 0.2], 'stiffness': [4e4, 9e4], 'damping': [30.0, 0.0]}
    content['oscillators'] = {'frame': {'mass': 10.0, 'cog': [0.1, 0.2], 'mounts': {'one': mount}}}
    machine = weightless(**{k: v for k, v in content.items() if k not in ('title', 'mechanism')})
    f = np.array([0.0, 3.0, 10.0, 40.0])
    for name, k, c, angle in (('x', 4e4, 30.0, 0.0), ('y', 9e4, 0.0, 0.5 * np.pi)):
        source = read_source(machine, force='frame.one', direction=angle)
        asked = [f'position.frame.{name}', f'acceleration.frame.{name}']
        found = response(machine, source, asked, f).amplitudes
        expected = Oscillator.of_coefficients(10.0, c, k).receptance(TURN * f)
        assert found[asked[0]] == pytest.approx(expected, **EXACT)
        assert found[asked[1]] == pytest.approx(-((TURN * f) ** 2) * expected, **EXACT)
    with pytest.raises(InputError, match='resonance of the frame'):
        response(machine, source, [], np.array([np.sqrt(9e4 / 10.0) / TURN]))
    with pytest.raises(InputError, match="without 'inertia' it cannot turn"):
        read_source(machine, torque='frame')
    with pytest.raises(InputError, match='did you mean'):
        read_source(machine, force='frame.on', direction=0.0)


@pytest.mark.parametrize('joints', [None, ['ground_crank', 'rocker_ground']])
def test_a_machine_shakes_its_frame_as_simulated(joints):
    """The vibration of a turn, once the transient of the start has died out."""
    damped = [3e3, 3e3]
    overrides = {f'oscillators.frame.mounts.{x}.damping': damped for x in ('left', 'right')}
    loose = ms.load_scene('four_bar_on_frame', overrides | {'oscillators.frame.joints': joints})
    found = harmonics(loose, [], 25).series
    ideal = without_clearance(loose)
    t = 6.0 * loose.drive.period + loose.drive.period * np.arange(20) / 20
    motion = ms.simulate(ideal, duration=7.0 * loose.drive.period).motion
    seen = ideal.oscillator('frame').take(motion)(t).position
    for k, name in enumerate(('x', 'y', 'angle')):
        series = found[f'position.frame.{name}']
        size = np.abs(series.amplitudes[0])
        assert seen[k] == pytest.approx(series(t), abs=1e-9 * size)


def test_what_cannot_be_is_refused():
    with pytest.raises(InputError, match='nothing can vibrate'):
        modes(ms.load_scene('four_bar_nominal'))
    said = 'teeth with backlash and belts without pretension as rigid even where they are elastic'
    with pytest.raises(InputError, match=said):
        modes(ms.load_scene('mesh_stiffness'))
    with pytest.raises(InputError, match='with its drive held nothing else moves'):
        along(ms.load_scene('four_bar_governed'), 2)
    hastening = ms.load_scene('torsional_shaft', {'drive.torque': {'constant': 5.0}})
    with pytest.raises(InputError, match='no equilibrium'):
        modes(hastening)
    hanging = made({
        'links': {'mass': {'mass': 2.0}}, 'gravity': [0.0, -9.81],
        'joints': {'guide': {'prismatic': ['ground', 'mass'], 'axis': '90 deg', 'stops': {
            'lower': 0.0, 'contact': {'law': 'hertz', 'stiffness': 1e3, 'exponent': 1.0}}}},
    })  # fmt: skip
    with pytest.raises(InputError, match=r'contacts \(guide\) do not here: put a spring there'):
        modes(hanging)
    with pytest.raises(InputError, match='repeats itself'):
        station(hastening)
    with pytest.raises(InputError, match='links without mass'):
        modes(ms.load_scene('four_bar_crossed'))
    machine = ms.load_scene('mass_on_spring')
    for wrong, message in (
        ({}, 'give one of'),
        ({'base': 'mass'}, 'not a coordinate that a drive prescribes'),
        ({'force': 'mass'}, 'belong together'),
        ({'torque': 'ground'}, 'ground does not move'),
        ({'torque': 'mas'}, "no link 'mas'; did you mean 'mass'"),
    ):
        with pytest.raises(InputError, match=message):
            read_source(machine, **wrong)
    absorber = ms.load_scene('vibration_absorber')
    with pytest.raises(InputError, match='torque motor moves nothing'):
        amplitudes(absorber, 'position.machine', [1.0], torque='motor')
    with pytest.raises(InputError, match='a spring whose ends meet has no direction'):
        modes(weightless(
            links={'a': {'mass': 1.0}}, joints={'g': {'prismatic': ['ground', 'a']}},
            springs={'s': {'between': ['ground', 'a'], 'stiffness': '9 N/m', 'free_length': 0.1}},
        ))  # fmt: skip
    source = read_source(machine, base='base')
    for name in ('speed.mass', 'position.mas', 'reaction.ground_mass', 'reaction.g.x'):
        with pytest.raises(InputError, match=r'mass_on_spring: .*(allowed|expected|coordinates)'):
            response(machine, source, [name], np.array([1.0]))
    with pytest.raises(InputError, match='no drive turns'):
        harmonics(machine, [], 2)
    with pytest.raises(InputError, match='not what they were'):
        harmonics(ms.load_scene('torsional_shaft'), [], 2)


@pytest.mark.parametrize('turns', [0, 20])
def test_a_belt_of_taut_strands_is_a_spring(turns):
    """M = diag(J1, J2), K = 2 k r r^T with r = (r1, -r2), wherever the pulleys stand."""
    belt = {'belt': ['motor', 'fan'], 'radii': [0.04, 0.1], 'stiffness': '50 N/mm',
            'damping': '20 N s/m', 'pretension': '500 N'}  # fmt: skip
    scene = {
        'links': {
            'ground': {'points': {'fan': [0.4, 0.1]}},
            'motor': {'mass': 2.0, 'inertia': 0.003},
            'fan': {'mass': 6.0, 'inertia': 0.08},
        },
        'joints': {
            'motor_shaft': {'revolute': ['ground', 'motor']},
            'fan_shaft': {'revolute': ['ground.fan', 'fan']},
            'belt': belt,
        },
    }
    places = {'motor': f'{360 * turns} deg', 'fan': f'{144 * turns} deg'}
    rigid, spring = modes(weightless(**scene, initial={'position': places}))
    over = 0.04**2 / 0.003 + 0.1**2 / 0.08
    assert rigid.frequency == 0.0
    assert spring.frequency == pytest.approx(np.sqrt(1e5 * over) / TURN, **EXACT)
    assert spring.damping_ratio == pytest.approx(20.0 * np.sqrt(over / 1e5), **EXACT)
    # about a pulley that is held, as resonance finds it
    held = weightless(**scene, drive={'coordinate': 'motor', 'speed': 0.0})
    w = 2.0 * np.pi * np.array([15.0, 17.0])
    found = response(held, read_source(held, base='motor'), ['position.fan'], w / TURN)
    pull = 1e5 + 40j * w
    expected = 0.004 * pull / (0.01 * pull - 0.08 * w**2)
    assert found.amplitudes['position.fan'] == pytest.approx(expected, **EXACT)
    (driven,) = campbell(held, np.array([30.0]))
    assert driven.modes[0].frequency == pytest.approx(np.sqrt(1e3 / 0.08) / TURN, **EXACT)
    scene['links']['fan'] |= {'cog': 0.1}  # which gravity moves to and fro
    scene |= {'drive': {'coordinate': 'motor', 'speed': 0.0, 'start_angle': 1.0}}
    with pytest.raises(InputError, match='move against each other'):
        campbell(made(scene | {'gravity': [0.0, -9.81]}), np.array([30.0]))


def test_a_spring_beside_a_rigid_joint_holds_nothing():
    """An elastic belt beside a rigid one: the rounding of what cancels is no stiffness."""
    rigid = {'belt': ['motor', 'fan'], 'radii': [0.04, 0.1]}
    (mode,) = modes(weightless(
        links={
            'ground': {'points': {'fan': [0.4, 0.1]}},
            'motor': {'mass': 2.0, 'inertia': 0.003},
            'fan': {'mass': 6.0, 'inertia': 0.08},
        },
        joints={
            'motor_shaft': {'revolute': ['ground', 'motor']},
            'fan_shaft': {'revolute': ['ground.fan', 'fan']},
            'belt': rigid | {'stiffness': '50 N/mm', 'pretension': '500 N'},
            'chain': rigid,
        },
    ))  # fmt: skip
    assert mode.frequency == 0.0


@pytest.mark.parametrize('variation', [None, 'contact_ratio'])
def test_elastic_teeth_without_backlash_are_a_spring(variation):
    """A pair that is free has the mode sqrt(k (rb1^2/J1 + rb2^2/J2)), a held pinion leaves one."""
    teeth = {'stiffness': '2e8 N/m', 'damping': '500 N s/m'}
    if variation:
        teeth['variation'] = variation
    changes = {'joints.mesh.elasticity': teeth, 'joints.mesh.backlash': None,
               'joints.mesh.error': None, 'loads': {}}  # fmt: skip
    held = ms.load_scene('mesh_stiffness', changes)
    free = ms.load_scene('mesh_stiffness', {**changes, 'drive': {'coordinate': 'pinion',
                                                                 'torque': 0.0}})  # fmt: skip
    (one,), (rigid, both) = modes(held), modes(free)
    rb1, rb2 = np.cos(np.radians(20.0)) * np.array([0.02, 0.04])
    parts = rb1**2 / 1e-4, rb2**2 / 1.5e-3
    assert rigid.frequency == 0.0
    assert both.frequency / one.frequency == pytest.approx(np.sqrt(sum(parts) / parts[1]), **EXACT)
    # that of the teeth where the machine starts, as its damping ratio tells
    k = (500.0 * np.sqrt(parts[1]) / (2.0 * one.damping_ratio)) ** 2
    assert one.frequency == pytest.approx(np.sqrt(k * parts[1]) / TURN, **EXACT)
    assert k == pytest.approx(2e8, rel=0.5 if variation else 1e-10)


def test_a_disk_on_a_turning_shaft_has_the_drag_of_its_speed():
    """c = d + 2 b w of a drag b w^2, for the disk turns as fast as its shaft is driven."""
    k, inertia = 500.0, 0.02
    scene = {
        'links': {
            'motor': {'mass': 1.0, 'inertia': 0.01},
            'disk': {'mass': 1.0, 'inertia': inertia},
        },
        'joints': {x: {'revolute': ['ground', x]} for x in ('motor', 'disk')},
        'springs': {'shaft': {'between': ['motor', 'disk'], 'stiffness': '500 N m/rad',
                              'damping': '0.05 N m s/rad'}},
        'loads': {'drag': {'at': 'disk', 'torque': '-0.002*disk_rate*abs(disk_rate)'}},
        'drive': {'coordinate': 'motor', 'speed': '100 rad/s'},
    }  # fmt: skip
    speeds = np.array([-50.0, 100.0])
    for there, w in zip(campbell(weightless(**scene), speeds), np.abs(speeds), strict=True):
        (mode,) = there.modes
        assert mode.frequency == pytest.approx(np.sqrt(k / inertia) / TURN, **EXACT)
        ratio = (0.05 + 0.004 * w) / (2.0 * np.sqrt(k * inertia))
        assert mode.damping_ratio == pytest.approx(ratio, **EXACT)


@pytest.mark.parametrize('g', [0.0, 10.0])
def test_modes_that_change_over_the_turn_are_told(g, recwarn):
    """A pendulum that hangs from a turning arm: ``w^2 = (R W^2 + g)/l`` below, - g above."""
    machine = made({
        'gravity': [0.0, -g],
        'links': {'arm': {'mass': 1.0, 'inertia': 1.0, 'points': {'end': [0.2, 0.0]}},
                  'bob': {'mass': 1.0, 'inertia': 1e-3, 'cog': 0.3}},
        'joints': {'axle': {'revolute': ['ground', 'arm']},
                   'pin': {'revolute': ['arm.end', 'bob']}},
        'drive': {'coordinate': 'arm', 'speed': 10.0, 'start_angle': -0.5 * np.pi},
        'initial': {'position': {'bob': -0.5 * np.pi}},
    })  # fmt: skip
    (there,) = campbell(machine, np.array([20.0]))
    w = np.sqrt(0.3 * (0.2 * 20.0**2 + g) / (0.3**2 + 1e-3))
    assert there.modes[0].frequency == pytest.approx(w / TURN, **EXACT)
    response(machine, read_source(machine, torque='bob'), [], np.array([1.0]), 20.0)
    told = [str(one.message) for one in recwarn if 'CHANGE over the turn' in str(one.message)]
    assert len(told) == 2 * bool(g)
    assert all('of arm, frequencies by ' in one and '% at 20 rad/s' in one for one in told)


def test_whether_modes_change_is_asked_at_both_ends_of_the_speeds(monkeypatch):
    """Two further linearisations a speed tripled the time of a diagram; warned it is once."""
    machine, seen = ms.load_scene('rotor_on_supports'), []

    def counted(*args, **known):
        seen.append(known['speed'])
        return linearised(*args, **known)

    monkeypatch.setattr('mechanism_sim.studies.modes.linearised', counted)
    assert len(campbell(machine, np.linspace(0.0, 600.0, 13))) == 13
    assert sorted(set(seen), key=seen.count)[-2:] == [50.0, 600.0]
    assert len(seen) == 13 + 4


def test_belts_are_ideal_under_harmonics():
    """A rotor out of balance shakes its machine alike with a belt to its motor or without."""
    plain = ms.load_scene('unbalanced_machine')
    belted = ms.load_scene('unbalanced_machine', {
        'links.machine': {'mass': '19 kg', 'points': {'side': [0.3, 0.0]}},
        'links.motor': {'mass': '1 kg', 'inertia': '0.001 kg m^2'},
        'joints.machine_motor': {'revolute': ['machine.side', 'motor']},
        'joints.belt': {'belt': ['motor', 'rotor'], 'carrier': 'machine', 'radii': [0.05, 0.05],
                        'stiffness': '100 N/mm', 'pretension': '1 kN'},
        'drive.coordinate': 'motor',
    })  # fmt: skip
    one, other = (harmonics(m, ['position.machine'], 1).series for m in (plain, belted))
    shaken = one['position.machine'].amplitudes
    assert abs(shaken[0]) > 5e-4
    assert other['position.machine'].amplitudes == pytest.approx(shaken, **EXACT)


def test_whole_turns_of_a_start_are_known():
    """A torsion spring or a load that knows turns holds a link a hundred turns on, too."""
    free = {'links': {'wheel': {'mass': 2.0, 'inertia': 0.003}},
            'joints': {'shaft': {'revolute': ['ground', 'wheel']}},
            'initial': {'position': {'wheel': '36000 deg'}}}  # fmt: skip
    hold = {'loads': {'hold': {'at': 'wheel', 'torque': '300*(200*pi - wheel)'}}}
    spring = {'springs': {'hold': {
        'between': ['ground', 'wheel'], 'stiffness': '300 N m/rad', 'free_angle': '36000 deg',
    }}}  # fmt: skip
    for held in (hold, spring):
        (mode,) = modes(weightless(**free, **held))
        assert mode.frequency == pytest.approx(np.sqrt(300.0 / 0.003) / TURN, rel=1e-9)


def test_the_commands(tmp_path):
    done = run('modes', 'torsional_shaft', '--json', '-o', str(tmp_path / 'modes.png'))
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)['modes']
    known = chain([0.05, 0.03], [800.0, 500.0], [0.2, 0.1]).damped_modes.roots
    expected = np.sort(np.abs(known[known.imag > 0.0])) / TURN
    assert [m['frequency'] for m in found] == pytest.approx(expected, **EXACT)
    done = run('response', 'vibration_absorber', 'position.machine', '--torque', 'motor',
               '--frequencies', '1:2:3')  # fmt: skip
    assert done.returncode == 2
    assert 'write for example' in done.stderr
    assert (tmp_path / 'modes.png').stat().st_size > 1000


@pytest.mark.sample(3)
@pytest.mark.parametrize(('ratio', 'count', 'told'), [
    (0.0, 201, True), (1e-4, 201, True), (0.02, 201, False), (2e-4, 40001, False),
])  # fmt: skip
def test_a_peak_that_depends_on_the_steps_of_frequencies_is_told(ratio, count, told):
    o = Oscillator.of_ratio(12.0, ratio, 3.0)
    machine = row([3.0], [o.stiffness], [o.damping])
    source, quantities = read_source(machine, force='m0', direction=0.0), ['position.m0']
    found = [response(machine, source, quantities, np.linspace(1.0, 3.0, n))
             for n in (count, count + 77)]  # fmt: skip
    highest = [np.abs(x.amplitudes['position.m0']).max() for x in found]
    assert (abs(highest[1] / highest[0] - 1.0) > 0.05) == told
    assert [bool(x.unresolved) for x in found] == [told] * 2
    assert ('are narrower than the steps' in response_text(found[0])) == told
    if told:
        (peak,) = found[0].unresolved['position.m0']
        assert peak == pytest.approx(12.0 / TURN, abs=2.0 / (count - 1))
