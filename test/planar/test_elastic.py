"""Elastic links: against closed forms of beams, and against other formulations."""

import numpy as np
import pytest
from builders import made, weightless, without_work
from references.make_spinning_beam import chain_tip, extrapolated
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import iv, jv

import mechanism_sim as ms
from benchmarks import flexible_slider_crank as simeon
from benchmarks.problems import elastic_slider_crank, spinning_beam
from benchmarks.problems.elastic_slider_crank import elongations, stretching
from mechanism_sim.errors import InputError
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.linearisation import Linearisation
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.results.cycle import cycle
from mechanism_sim.scene.check import check
from mechanism_sim.scene.start import Start
from mechanism_sim.studies.modes import linearised, modes, natural_modes
from mechanism_sim.studies.periodic import find_periodic

TURN = 2.0 * np.pi
L, EI, EA, RHO = 0.4, 12.0, 5e6, 0.3
"""Length [m], stiffnesses [N m^2], [N] and mass per length [kg/m] of a beam."""

SECTION = {'youngs_modulus': 1e11, 'second_moment': EI / 1e11, 'area': EA / 1e11,
           'density': RHO / (EA / 1e11)}  # fmt: skip
PINNED = np.pi * np.arange(1, 9)
CLAMPED = np.array([1.8751040687, 4.6940911330, 7.8547574382, 10.9955407349])
FREE = np.array([4.7300407449, 7.8532046241, 10.9956078380])
"""Roots ``k L`` of the frequency equations of uniform beams (e.g. [V] and any handbook)."""


def hertz(roots):
    return roots**2 * np.sqrt(EI / RHO) / L**2 / TURN


def arm(speed=0.0, gravity=(0.0, 0.0), loads=None, **elastic):
    """A beam clamped to a hub that turns steadily."""
    rotor = {'length': L, 'elastic': {**SECTION, 'ends': 'clamped', **elastic}}
    return weightless(
        links={'arm': rotor},
        joints={'hub': {'revolute': ['ground', 'arm']}},
        drive={'coordinate': 'arm', 'speed': speed},
        gravity=list(gravity),
        **({'loads': loads} if loads else {}),
    )


def column(thrust=0.0, load=None, masses=None, **elastic):
    """A beam between a held crank and a slider in line with it, under a force along it."""
    return weightless(
        links={
            'crank': {'length': 0.1, 'mass': 1.0, 'inertia': 0.01},
            'rod': {
                'length': L,
                'points': {'middle': [L / 2, 0.0]},
                'elastic': {**SECTION, **elastic},
            },
            'slider': {'mass': 0.2},
        },
        joints={
            'a': {'revolute': ['ground', 'crank']},
            'b': {'revolute': ['crank.end', 'rod']},
            'c': {'revolute': ['rod.end', 'slider']},
            'd': {'prismatic': ['ground', 'slider']},
        },
        loads={'thrust': load or {'force': [-thrust, 0.0], 'at': 'slider'}},
        masses=masses or {},
        drive={'coordinate': 'crank', 'speed': 0.0},
        guess={'slider': 0.1 + L},
    )


def frequencies(machine):
    return np.array([mode.frequency for mode in modes(machine)])


def test_natural_frequencies_of_pinned_and_clamped_beams():
    assert frequencies(column(modes=3)) == pytest.approx(hertz(PINNED[:3]), rel=1e-10)
    assert frequencies(arm(modes=4)) == pytest.approx(hertz(CLAMPED), rel=1e-9)


@pytest.mark.slow
def test_polynomials_have_frequencies_from_above():
    """And converge fast (Ritz)."""
    for machine, roots in ((column, PINNED), (arm, CLAMPED)):
        few, more = (
            frequencies(machine(functions='polynomial', modes=n))[:2] / hertz(roots[:2]) - 1.0
            for n in (3, 6)
        )
        assert (few > 0.0).all()
        assert (np.abs(more) < [1e-6, 1e-3]).all()
        assert (more < few).all()


def test_a_free_beam_vibrates_as_it_should():
    beam = Beam(L, EI, EA, RHO, 1e11, modes=6, functions='polynomial')
    body = Body('bar', RHO * L, RHO * L**3 / 12.0, (L / 2, 0.0), beam)
    found = Linearisation(Mechanism((body,), (), ()), [], [])
    at = found.point(np.zeros(9), np.zeros(9))
    linear = found(at)
    f = [roots.frequency for roots, _ in natural_modes(linear.M, linear.C, linear.K)]
    assert f[:3] == pytest.approx(np.zeros(3), abs=1e-3)
    assert np.array(f[3:5]) == pytest.approx(hertz(FREE[:2]), rel=5e-4)


def test_stretch_has_the_frequencies_of_a_rod():
    machine = arm(modes=1, stretch=4)
    speed = np.sqrt(EA / RHO)
    exact = (2.0 * np.arange(1, 3) - 1.0) / 4.0 * speed / L
    found = frequencies(machine)
    axial = [found[np.abs(found / f - 1.0).argmin()] for f in exact]
    assert np.array(axial) == pytest.approx(exact, rel=3e-3)


def test_polynomials_bend_under_an_end_load_as_statics_says():
    F = 3.0
    machine = arm(functions='polynomial', modes=2, loads={
        'end': {'force': [0.0, -F], 'at': 'arm.end'}
    })  # fmt: skip
    at = linearised(machine).at
    beam = machine.mechanism.having(Beam)['arm']
    q = at.q[1:]
    assert beam.deflection(L) @ q == pytest.approx(-F * L**3 / (3.0 * EI), rel=2e-3)
    x = np.linspace(0.0, L, 5)
    exact = -F * x**2 * (3.0 * L - x) / (6.0 * EI)
    assert q @ beam.deflection(x) == pytest.approx(exact, rel=2e-3, abs=1e-15)
    # what is left is the foreshortening's work, of third order
    small = arm(functions='polynomial', modes=2, loads={
        'end': {'force': [0.0, -F * 1e-3], 'at': 'arm.end'}
    })  # fmt: skip
    q = linearised(small).at.q[1:]
    assert beam.deflection(L) @ q == pytest.approx(-1e-3 * F * L**3 / (3.0 * EI), rel=1e-8)


def test_modes_bend_under_weight_as_statics_says():
    machine = arm(modes=4, gravity=(0.0, -9.81))
    beam = machine.mechanism.having(Beam)['arm']
    tip = beam.deflection(L) @ linearised(machine).at.q[1:]
    assert tip == pytest.approx(-RHO * 9.81 * L**4 / (8.0 * EI), rel=1e-4)


def test_a_mass_and_a_moment_act_where_they_are():
    lump = 0.07
    found = frequencies(column(masses={'boss': {'at': 'rod.middle', 'mass': lump}}, modes=1))
    softer = np.sqrt(1.0 / (1.0 + lump / (0.5 * RHO * L)))
    assert found[0] == pytest.approx(hertz(PINNED[0]) * softer, rel=1e-9)
    # a moment M at one end bends the middle by M L^2/(16 EI)
    moment = 1e-3
    machine = column(load={'torque': moment, 'at': 'rod'}, functions='polynomial', modes=2)
    middle = machine.mechanism.having(Beam)['rod'].deflection(L / 2)
    q = linearised(machine).at.q[3:]
    assert middle @ q == pytest.approx(moment * L**2 / (16.0 * EI), rel=1e-6)


def test_thrust_softens_a_beam_until_it_buckles():
    """Euler: ``w^2 = w0^2 (1 - P/P_cr)`` of the first mode, ``P_cr = pi^2 EI/L^2``."""
    critical = np.pi**2 * EI / L**2
    for share in (-2.0, 0.3, 0.9):
        found = frequencies(column(share * critical, modes=1))
        assert found[0] == pytest.approx(hertz(PINNED[0]) * np.sqrt(1.0 - share), rel=1e-9)
    stiff = frequencies(column(0.9 * critical, modes=1, foreshortening=False))
    assert stiff[0] == pytest.approx(hertz(PINNED[0]), rel=1e-9)


@pytest.mark.parametrize('share', [0.5, 0.999, 1.01, 1.5])
def test_a_column_that_is_hardly_bent_moves_as_euler_says(share):
    """``q = q0 cos(w0 sqrt(1 - P/P_cr) t)``, whose energies round less than the thrust's work."""
    bent, critical = 1e-9, np.pi**2 * EI / L**2
    machine = ms.load_scene(
        column(share * critical, modes=1), {'initial.position': {'rod.bend1': bent}}
    )
    w = TURN * hertz(PINNED[0]) * np.sqrt(complex(1.0 - share))
    run = ms.simulate(machine, duration=4.0 / max(abs(w), 50.0))
    t = np.linspace(0.0, run.duration, 50)
    q = run.sample(t, 'position.rod.bend1')['position.rod.bend1']
    assert q / bent == pytest.approx(np.cos(w * t).real, abs=1e-5 * np.cosh(abs(w.imag) * t[-1]))


@pytest.mark.parametrize(('spin', 'root'), [(1.0, 3.6816), (3.0, 4.7973), (10.0, 11.2023)])
def test_a_turning_beam_is_stiffened(spin, root):
    """Wright, Smith, Thresher and Wang (1982): out of the plane; in it less the spin's square."""
    unit = np.sqrt(EI / RHO) / L**2
    machine = arm(spin * unit, functions='polynomial', modes=6)
    found = TURN * frequencies_turning(machine)[0] / unit
    assert found == pytest.approx(np.sqrt(root**2 - spin**2), rel=1e-4)


def frequencies_turning(machine):
    speed = machine.drive.law.coefficients[1]
    derivatives = linearised(machine).derivatives
    n = len(derivatives.coordinates)
    v = np.zeros(n)
    v[0] = speed
    linear = derivatives(derivatives.point(np.zeros(n), v))
    free = derivatives.free
    M, C, K = (x[np.ix_(free, free)] for x in (linear.M, linear.C, linear.K))
    return [roots.frequency for roots, _ in natural_modes(M, C, K)]


def test_damping_is_what_is_asked_for():
    found = modes(column(modes=2, damping=0.03))
    assert [mode.damping_ratio for mode in found] == pytest.approx([0.03, 0.03])
    a, b = 4.0, 2e-5
    found = modes(column(modes=2, rayleigh={'mass': a, 'stiffness': b}))
    for mode in found:
        w = TURN * mode.frequency
        assert mode.damping_ratio == pytest.approx(0.5 * (a / w + b * w))


def tapered(*points, **elastic):
    """An arm of 0.4 m with sections at points."""
    section = {'section': {'points': list(points)}, 'density': 1e3, 'youngs_modulus': 1e11}
    rotor = {'length': L, 'elastic': {**section, 'ends': 'clamped', **elastic}}
    return weightless(
        links={'arm': rotor},
        joints={'hub': {'revolute': ['ground', 'arm']}},
        drive={'coordinate': 'arm', 'speed': 0.0},
        loads={'end': {'force': [0.0, -1e-3], 'at': 'arm.end'}},
    )


@pytest.mark.parametrize(
    ('order', 'section', 'moment_over_area'),
    [(1, {'width': 8e-3, 'height': 1e-2}, 1e-4 / 12), (2, {'diameter': 1e-2}, 1e-4 / 16)],
)
def test_wedges_and_cones_vibrate_as_kirchhoff_says(order, section, moment_over_area):
    """Clamped at the thick end, pointed: J_n(z) I_n+1(z) + I_n(z) J_n+1(z) = 0, w = z^2/4 unit.

    G. Kirchhoff, Berliner Monatsberichte 1879, 815-828.
    """

    def left(z):
        return jv(order, z) * iv(order + 1, z) + iv(order, z) * jv(order + 1, z)

    first = {1: 3.0, 2: 4.5}[order]
    roots = np.array([brentq(left, first + 3.1 * k, first + 3.1 * (k + 1)) for k in range(3)])
    pointed = {k: x if k == 'width' else 1e-13 for k, x in section.items()}
    machine = tapered([0.0, section], [L, pointed], modes=3)
    unit = np.sqrt(1e11 * moment_over_area / 1e3) / L**2 / TURN
    assert frequencies(machine) == pytest.approx(roots**2 / 4.0 * unit, rel=1e-8)


def test_a_step_of_the_section_vibrates_as_two_beams_in_a_row():
    """Against the determinant of two uniform beams, with their moment and force at the step."""
    first, heights = 0.15, (1e-2, 6e-3)
    sizes = [{'width': 8e-3, 'height': h} for h in heights]
    found = frequencies(tapered([0.0, sizes[0]], [first, sizes[0]], [first, sizes[1]],
                                [L, sizes[1]], modes=3))  # fmt: skip

    def determinant(w):
        rows = np.zeros((8, 8))
        for i, (h, length) in enumerate(zip(heights, (first, L - first), strict=True)):
            EI, line = 1e11 * 8e-3 * h**3 / 12.0, 1e3 * 8e-3 * h
            k = (w**2 * line / EI) ** 0.25
            ends = []
            for x in (0.0, length):
                c, s, ch, sh = np.cos(k * x), np.sin(k * x), np.cosh(k * x), np.sinh(k * x)
                ends.append(np.array([
                    [c, s, ch, sh], k * np.array([-s, c, sh, ch]),
                    EI * k**2 * np.array([-c, -s, ch, sh]), EI * k**3 * np.array([s, -c, sh, ch]),
                ]))  # fmt: skip
            if i == 0:
                rows[:2, :4], rows[2:6, :4] = ends[0][:2], ends[1]
            else:
                rows[2:6, 4:], rows[6:, 4:] = -ends[0], ends[1][2:]
        return np.linalg.det(rows / np.abs(rows).max(axis=1, keepdims=True))

    for f in found:
        assert determinant(TURN * f * (1.0 - 1e-8)) * determinant(TURN * f * (1.0 + 1e-8)) < 0.0


def test_a_tapered_beam_bends_and_is_strained_as_statics_says():
    """Width from b to b/2: ``w'' = -F (L - x)/(E I (1 - x/2L))``, integrated by hand."""
    wide, narrow = ({'width': b, 'height': 1e-2} for b in (8e-3, 4e-3))
    machine = tapered([0.0, wide], [L, narrow], modes=5, functions='polynomial')
    beam, q = machine.mechanism.having(Beam)['arm'], linearised(machine).at.q[1:]
    EI, F = 1e11 * 8e-3 * 1e-6 / 12.0, 1e-3
    tip = -F * L**3 / EI * (2.0 * np.log(2.0) - 1.0)
    assert beam.deflection(L) @ q == pytest.approx(tip, rel=1e-6)
    assert beam.largest_stress(q[:, None]) == pytest.approx(F * L / EI * 1e11 * 5e-3, rel=1e-3)
    thin = tapered([0.0, {'width': 8e-3, 'height': 1e-2}], [L, {'width': 8e-3, 'height': 4e-3}])
    beam = thin.mechanism.having(Beam)['arm']
    assert beam.outer_fibre(0.5 * L) == pytest.approx(3.5e-3)
    q = np.array([[1e-3], [0.0]])
    x = np.linspace(0.0, L, 41)
    strained = np.abs(beam.strain(x, 1.0)[0] * 1e-3 * (5e-3 - 3e-3 * x / L)).max()
    assert beam.largest_stress(q) == pytest.approx(1e11 * strained)
    body = thin.mechanism.body('arm')  # a trapezium: area, centre and moment by hand
    assert body.mass == pytest.approx(1e3 * 8e-3 * 7e-3 * L)
    assert body.cog[0] == pytest.approx(L / 3.0 * (1e-2 + 2 * 4e-3) / (1e-2 + 4e-3))


def test_a_section_given_by_points_that_are_alike_is_that_section():
    plain = ms.load_scene('elastic_slider_crank')
    section = {'width': '8 mm', 'height': '8 mm'}
    points = [['0 mm', section], ['0.1 m', section], ['0.5 m', section]]
    same = ms.load_scene('elastic_slider_crank', {'links.rod.elastic.section': {'points': points}})
    assert same.mechanism.having(Beam) == plain.mechanism.having(Beam)


def test_a_mass_of_a_tapered_link_lies_as_its_area_does():
    points = [[0.0, {'diameter': 0.03}], [0.2, {'diameter': 0.01}], [0.3, {'diameter': 0.02}]]
    given = {'mass': 1.3, 'inertia': 0.02, 'cog': 0.12}
    more = {f'links.rod.{key}': x for key, x in given.items()}
    machine = ms.load_scene('elastic_slider_crank', {
        **more, 'links.rod.elastic.section': {'points': points},
    })  # fmt: skip
    body = machine.mechanism.body('rod')
    assert (body.mass, body.inertia, body.cog[0]) == pytest.approx((1.3, 0.02, 0.12))


# --- motion -------------------------------------------------------------------------------------


def solved(until, **how):
    """Places (7,) at a time [s], by DOP853 on Simeon's own matrices."""
    start, rate = simeon.closed_start(), simeon.rates(**how)
    return solve_ivp(rate, (0.0, until), start, 'DOP853', rtol=1e-12, atol=1e-16).y[:7, -1]


def places(machine, solution, t):
    """As those of `flexible_slider_crank`, (7, N)."""
    x = without_work(solution, t)
    names = 'crank', 'rod', 'slider', 'rod.bend1', 'rod.bend2', 'rod.stretch1', 'rod.stretch2'
    found = np.array([x[f'position.{name}'] for name in names])
    return np.concatenate([found[:5], elongations(machine) @ found[5:]])


@pytest.mark.slow
def test_the_flexible_slider_crank_moves_by_its_own_matrices():
    """Simeon's discretisation, written out by hand and integrated by another method."""
    machine = stretching()
    found = places(machine, ms.simulate(machine, duration=0.001), np.array([0.001]))[:, 0]
    exact = solved(0.001)
    assert found[:5] == pytest.approx(exact[:5], rel=1e-10)
    assert found[5:] == pytest.approx(exact[5:], rel=1e-7)


def test_the_flexible_slider_crank_ends_where_the_test_set_says():
    """Up to what the test set's mass along the rod, 15 times too large, changes."""
    machine = stretching()
    solution = ms.simulate(machine, duration=simeon.END)
    found = places(machine, solution, np.array([simeon.END]))[:, 0]
    assert found[1:3] == pytest.approx(simeon.PUBLISHED[1:3], rel=5e-7)
    assert found[3:5] == pytest.approx(simeon.PUBLISHED[3:5], rel=3e-4)
    assert found[5:] == pytest.approx(simeon.PUBLISHED[5:], rel=0.01)


@pytest.mark.slow
def test_the_published_values_have_the_wrong_mass_along_the_rod():
    published = solved(simeon.END, inertia=simeon.J2_PUBLISHED, along=1.0)
    assert published[1:5] == pytest.approx(simeon.PUBLISHED[1:5], rel=1e-6)
    assert published[5:] == pytest.approx(simeon.PUBLISHED[5:], rel=5e-6)
    machine = stretching()
    solution = ms.simulate(machine, duration=simeon.END)
    exact = solved(simeon.END, inertia=simeon.J2_PUBLISHED)
    found = places(machine, solution, np.array([simeon.END]))[:, 0]
    assert found[:5] == pytest.approx(exact[:5], rel=1e-6)
    assert np.abs(exact[5:] / simeon.PUBLISHED[5:] - 1.0).min() > 5e-3


def spun_up(**elastic):
    """Kane's beam of 10 m, from rest to 6 rad/s in 15 s (J. Guidance 10 (1987) 139-151)."""
    beam = {'youngs_modulus': 7e10, 'area': 4e-4, 'second_moment': 2e-7, 'density': 3000.0}
    return weightless(
        links={'arm': {'length': 10.0, 'elastic': {**beam, 'ends': 'clamped', **elastic}}},
        joints={'hub': {'revolute': ['ground', 'arm']}},
        drive={'coordinate': 'arm', 'profile': {
            'points': [[0.0, 0.0], [15.0, 6.0]], 'ramp': 'smooth'
        }},
    )  # fmt: skip


def bent_by_spin(speed, acceleration, cells=400):
    """Tip deflection [m] of Kane's beam at rest in its frame, by finite differences.

    ``EI w'''' - (T w')' - r W^2 w = -r W' x`` with the tension ``T = r W^2 (L^2 - x^2)/2``; w and
    w' vanish at the hub, w'' and w''' at the tip.
    """
    stiffness, r, length = 1.4e4, 1.2, 10.0
    h = length / cells
    x = np.linspace(0.0, length, cells + 1)
    # energy of curvatures at the nodes, of slopes between them
    slopes = (np.eye(cells, cells + 1, 1) - np.eye(cells, cells + 1)) / h
    curved = np.zeros((cells, cells + 1))
    curved[0, 1] = 2.0 / h**2  # the hub keeps its slope
    for i in range(1, cells):
        curved[i, i - 1 : i + 2] = np.array([1.0, -2.0, 1.0]) / h**2
    weights = np.full(cells, h)
    weights[0] *= 0.5
    middle = 0.5 * (x[1:] + x[:-1])
    tension = 0.5 * r * speed**2 * (length**2 - middle**2)
    mass = np.full(cells + 1, h)
    mass[[0, -1]] *= 0.5
    K = stiffness * curved.T @ (weights[:, None] * curved)
    K += slopes.T @ ((h * tension)[:, None] * slopes) - np.diag(r * mass * speed**2)
    w = np.zeros(cells + 1)
    w[1:] = np.linalg.solve(K[1:, 1:], (-r * acceleration * x * mass)[1:])
    return w[-1]


def test_a_beam_that_spins_up_is_stiffened():
    """Kane, Ryan and Banerjee: with linear theory it would bend without bounds."""
    machine = spun_up(modes=3)
    solution = ms.simulate(machine, duration=30.0)
    t = np.linspace(3.0, 15.0, 25)
    x, beam = without_work(solution, t), machine.mechanism.having(Beam)['arm']
    tip = beam.deflection(10.0) @ np.array([x[f'position.arm.bend{i}'] for i in (1, 2, 3)])
    speeds, pushes = x['velocity.arm'], x['acceleration.arm']
    still = [bent_by_spin(w, a) for w, a in zip(speeds, pushes, strict=True)]
    # it lags behind and swings a little: what is at rest in the frame is no solution
    assert tip == pytest.approx(still, abs=0.035)
    assert tip.min() == pytest.approx(min(still), rel=0.07)
    # once the hub turns evenly, it swings about its straight shape, a little
    end = without_work(solution, np.linspace(20.0, 30.0, 400))
    rest = beam.deflection(10.0) @ np.array([end[f'position.arm.bend{i}'] for i in (1, 2, 3)])
    assert np.abs(rest).max() < 0.05
    linear = ms.simulate(spun_up(modes=3, foreshortening=False), duration=20.0)
    assert abs(linear.sample(20.0, 'position.arm.bend1')['position.arm.bend1'][0]) > 10.0


@pytest.mark.slow
def test_a_beam_that_spins_up_moves_as_a_chain_of_rigid_segments():
    """Segments with springs between them: no beam, no modes, no foreshortening."""
    machine = spun_up(modes=4)
    t = np.array([5.0, 8.0, 11.0, 14.0])
    x, beam = (
        without_work(ms.simulate(machine, duration=15.0), t),
        machine.mechanism.having(Beam)['arm'],
    )
    tip = beam.deflection(10.0) @ np.array([x[f'position.arm.bend{i}'] for i in (1, 2, 3, 4)])
    limit = extrapolated((10, 14), [chain_tip(n, t) for n in (10, 14)])
    assert tip == pytest.approx(limit, abs=2e-3)


@pytest.mark.slow
def test_peers_answer_the_problems_of_elastic_links():
    """SciPy on Simeon's matrices; where it is installed, Exudyn on the beams themselves."""
    assert elastic_slider_crank.error(elastic_slider_crank.ours(1e-12)()().answer) < 1e-12
    assert spinning_beam.error(spinning_beam.ours(6)()().answer) < 4e-4
    for problem, largest in ((elastic_slider_crank.PROBLEM, 5e-5), (spinning_beam.PROBLEM, 3e-3)):
        for method in problem.methods[1:]:
            if not method.missing():
                outcome = method.prepare(method.settings[-1])()()
                assert problem.error(outcome.answer) < largest, method.name


def test_energy_is_balanced():
    machine = ms.load_scene('elastic_slider_crank', {
        'drive': {'coordinate': 'crank', 'speed': '150 rad/s', 'torque': {'constant': '8 N m'}},
        'gravity': ['0 m/s^2', '-9.81 m/s^2'],
        'links.rod.elastic.damping': 0.01, 'links.rod.elastic.stretch': 1,
    })  # fmt: skip
    solution = ms.simulate(machine, duration=0.05)
    energy = solution.energy
    assert energy.dissipated > 1e-3
    assert abs(energy.residual) < 1e-9 * energy.initial


def loose_four_bar(**more):
    return ms.load_scene('four_bar_clearance', {
        'links.coupler.elastic': {'section': {'width': '8 mm', 'height': '12 mm'},
                                  'material': 'steel'},
        'links.rocker.elastic': {'section': {'width': '8 mm', 'height': '12 mm'},
                                 'material': 'steel'},
        **more,
    })  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize('friction', [pytest.param(0.0, marks=pytest.mark.slow), 0.1])
def test_energy_is_balanced_through_impacts(friction):
    clearance = 'joints.coupler_rocker.clearance'
    more = {f'{clearance}.friction': friction, f'{clearance}.hypothesis': 'stronge'}
    if friction:
        more[f'{clearance}.pin_radius'] = '5 mm'
    solution = ms.simulate(loose_four_bar(**more), revolutions=0.99)
    energy = solution.energy
    assert len(solution.impacts) > 3
    assert abs(energy.residual) < 1e-9 * energy.initial
    assert solution.max_penetration < 1e-12


def test_a_mass_alone_lies_evenly_along_the_link():
    machine = ms.load_scene('elastic_slider_crank', {'links.rod.mass': '0.2 kg'})
    for body in (machine.mechanism.body('rod'), machine.rigid.mechanism.body('rod')):
        assert (body.mass, body.inertia, *body.cog) == pytest.approx(
            (0.2, 0.2 * 0.3**2 / 12.0, 0.15, 0.0)
        )
    assert not machine.rigid.mechanism.having(Beam)


@pytest.mark.slow
def test_a_stiff_link_moves_as_a_rigid_one():
    """Mass, centre of gravity and inertia are those of the rigid link; 1/E^2 is what bends it."""
    rigid = ms.simulate(ms.load_scene('four_bar_nominal'), revolutions=0.3)
    t = np.linspace(0.0, rigid.duration, 50)
    exact = rigid.sample(t, 'position.rocker')['position.rocker']
    off = []
    for modulus in (2e11, 2e12):
        machine = ms.load_scene('four_bar_nominal', {
            'links.coupler.elastic': {'section': {'diameter': '6 mm'}, 'youngs_modulus': modulus,
                                      'modes': 2},
        })  # fmt: skip
        body = machine.mechanism.body('coupler')
        assert (body.mass, body.inertia, body.cog[0]) == pytest.approx((0.2439, 2.950e-3, 0.185))
        x = ms.simulate(machine, revolutions=0.3).sample(t, 'position.rocker')
        off.append(np.abs(x['position.rocker'] - exact).max())
    assert off[1] < 0.02 * off[0]
    assert off[1] < 1e-6


def test_modes_make_a_joint_lighter_for_impacts():
    """Effective mass ``1/(J M^-1 J^T)`` in the loose joint: less with every mode, E apart."""
    masses = []
    for count in (0, 1, 2, 3):
        more = {'links.coupler.elastic.modes': count, 'links.rocker.elastic.modes': count}
        machine = loose_four_bar(**more) if count else ms.load_scene('four_bar_clearance')
        mass = effective_mass(machine)
        masses.append(mass)
    assert (np.diff(masses) < 0.0).all()
    stiff = {f'links.{x}.elastic.youngs_modulus': '2000 GPa' for x in ('coupler', 'rocker')}
    assert effective_mass(loose_four_bar(**stiff)) == pytest.approx(masses[2], rel=1e-12)


def effective_mass(machine):
    """Across the coupler, the crank held."""
    m = machine.mechanism
    assert m.cut == ('coupler_rocker',)
    q = machine.assembly.q
    step, n = 1e-6, len(q)
    eq = Equations(m)
    entries = [x for row in eq.M for x in row]
    M = SwitchedFunction(eq.frames, [entries], [*eq.frames.q.values()])(q[:, None])[0]
    M = M.reshape(n, n)[1:, 1:]
    joint, shifts = m.joint('coupler_rocker'), np.zeros((n, n))
    np.fill_diagonal(shifts, step)
    moved = q[:, None] + np.concatenate([shifts, -shifts], axis=1)
    ends = joint.points
    apart = np.subtract(*(m.locate_all(link, moved, at) for link, at in ends))
    J = (apart[:, :n] - apart[:, n:]) / (2.0 * step)
    across = np.array([-np.sin(q[1]), np.cos(q[1])]) @ J[:, 1:]
    return 1.0 / (across @ np.linalg.solve(M, across))


def test_a_smooth_start_leaves_hardly_any_vibration():
    """Against Simeon's start on the smooth motion, and against the straight start."""
    linear = {'links.rod.elastic.stretch': 2, 'links.rod.elastic.foreshortening': False}
    machine = ms.load_scene('elastic_slider_crank', linear)
    state = machine.initial_state()
    v = dict(zip(machine.equations.system.free, state.v, strict=True))
    q = dict(zip(machine.equations.system.free, state.q, strict=True))
    # he goes a step further: (150/1277)^2 of the deflection is left
    assert v['rod.bend1'] == pytest.approx(simeon.START[10], rel=5e-3)
    assert v['rod.bend2'] == pytest.approx(simeon.START[11], rel=5e-3)
    stretched = elongations(machine) @ [q['rod.stretch1'], q['rod.stretch2']]
    assert stretched == pytest.approx(simeon.START[5:7], rel=0.01)
    t, swings = np.linspace(0.0, 0.04, 400), []
    for start in ('straight', 'smooth'):
        machine = ms.load_scene('elastic_slider_crank', {'initial.elastic': start})
        x = ms.simulate(machine, duration=0.04).sample(t, 'acceleration.rod.bend1')[
            'acceleration.rod.bend1'
        ]
        swings.append(np.abs(np.diff(x, 2)).max())
    assert swings[1] < 0.35 * swings[0]


@pytest.mark.slow
def test_a_smooth_start_of_a_loose_machine_hangs_bent():
    """At rest under its weight: what the statics of both links bend, with the pin on its seat."""
    machine = ms.load_scene('four_bar_elastic', {'drive.speed': '0 rad/s', 'solver.rtol': 1e-9})
    solution = ms.simulate(machine, duration=0.02)
    x = without_work(solution, np.linspace(0.0, 0.02, 50))
    for link in ('coupler', 'rocker'):
        bent = x[f'deflection.{link}']
        assert np.abs(bent).min() > 1e-8
        assert np.ptp(bent) < 2e-3 * np.abs(bent).max()


def test_a_smooth_start_takes_no_other():
    machine = ms.load_scene('elastic_slider_crank', {
        'initial': {'elastic': 'smooth', 'position': {'rod.bend1': '1 mm'}},
    })  # fmt: skip
    with pytest.raises(InputError, match='leave one of them out'):
        machine.initial_state()


def test_a_gauge_reads_the_strain_of_its_fibre():
    machine = ms.load_scene('elastic_slider_crank', {
        'sensors.gauge': {'kind': 'strain_gauge', 'link': 'rod', 'at': ['100 mm', '-3 mm'],
                          'sample_rate': '5 kHz'},
    })  # fmt: skip
    solution = ms.simulate(machine, duration=0.01)
    channel = machine.channel('gauge')
    channel.take(solution.motion)
    read = np.concatenate([block.samples for block in channel.blocks(final=True)])
    x = without_work(solution, np.arange(len(read)) / 5000.0)
    # w'' of sines by hand; the left side is drawn out where the rod bends to the right
    bent = sum(
        -((i * np.pi / 0.3) ** 2) * np.sin(i * np.pi / 3.0) * x[f'position.rod.bend{i}']
        for i in (1, 2)
    )
    assert read == pytest.approx(0.003 * bent, rel=1e-9, abs=1e-15)
    middle = x['position.rod.bend1']
    assert x['deflection.rod'] == pytest.approx(middle)
    assert (x['stress.rod'] >= 2e11 * 0.004 * (np.pi / 0.3) ** 2 * np.abs(middle) * 0.999).all()


def test_points_of_a_link_have_their_deflection_and_stress():
    machine = ms.load_scene('elastic_slider_crank', {
        'links.rod.points': {'quarter': ['75 mm', '0 mm']}
    })  # fmt: skip
    found = cycle(machine, samples=16)
    first, second = found['position.rod.bend1'], found['position.rod.bend2']
    w = np.sqrt(0.5) * first + second
    bend = (np.pi / 0.3) ** 2 * (np.sqrt(0.5) * first + 4.0 * second)
    assert found['deflection.rod.quarter'] == pytest.approx(w)
    assert found['stress.rod.quarter'] == pytest.approx(2e11 * 0.004 * bend)
    assert (found['stress.rod'] >= np.abs(found['stress.rod.quarter']) * 0.999).all()


def test_the_mass_centre_moves_by_the_forces_of_the_frame():
    """Newton's law of the whole machine, whose rod is bent."""
    machine = ms.load_scene('elastic_slider_crank')
    found = cycle(machine, samples=16)
    mass = sum(body.mass for body in machine.mechanism.bodies)
    for axis in 'xy':
        pull = mass * found[f'acceleration.mass_centre.{axis}']
        shaking = found[f'shaking_force.{axis}']
        # kinetic energy is of second order, and so are the forces of closures
        assert shaking == pytest.approx(-pull, abs=1e-4 * np.abs(pull).max())


def test_it_does_not_matter_at_which_end_a_link_begins():
    """The same machine with the rod's frame at its other end: other coordinates, same motion."""

    def end(start, far, guess):
        section = {'width': 8e-3, 'height': 8e-3}
        rod = {'length': 0.3, 'elastic': {'section': section, 'material': 'steel', 'modes': 3}}
        machine = weightless(
            links={
                'crank': {'length': 0.15, 'mass': 0.3, 'inertia': 1e-3},
                'rod': rod,
                'slider': {'mass': 0.1},
            },
            joints={
                'a': {'revolute': ['ground', 'crank']},
                'b': {'revolute': ['crank.end', start]},
                'c': {'revolute': [far, 'slider']},
                'd': {'prismatic': ['ground', 'slider']},
            },
            drive={'coordinate': 'crank', 'speed': 100.0},
            guess={'rod': guess, 'slider': 0.45},
        )
        return ms.simulate(machine, duration=0.02).sample(np.array([0.02]))

    one, other = end('rod', 'rod.end', 0.0), end('rod.end', 'rod', np.pi)
    for name in ('position.slider', 'drive_torque', 'reaction.c.y', 'stress.rod'):
        assert one[name] == pytest.approx(other[name], rel=1e-9)
    assert one['deflection.rod'] == pytest.approx(-other['deflection.rod'], rel=1e-9)


@pytest.mark.slow
def test_smooth_motion_converges_over_the_number_of_modes():
    t, bent = np.linspace(0.01, 0.02, 50), []
    for count in (1, 3, 5, 7):
        more = {'links.rod.elastic.modes': count, 'links.rod.elastic.damping': 0.02,
                }  # fmt: skip
        solution = ms.simulate(ms.load_scene('elastic_slider_crank', more), duration=0.02)
        bent.append(solution.sample(t, 'deflection.rod')['deflection.rod'])
    off = [np.abs(x - bent[-1]).max() for x in bent[:-1]]
    assert off[0] < 0.01 * np.abs(bent[-1]).max()
    assert off[0] > 5.0 * off[1] > 10.0 * off[2]


@pytest.mark.slow
def test_elastic_links_soften_impacts():
    """S. Dubowsky and T. N. Gardner, J. Eng. Ind. 97 (1975) 652-661: the more they bend."""
    loose = {'radial': '0.25 mm', 'restitution': 0.5,
             'contact': {'law': 'lankarani_nikravesh', 'stiffness': 5e9}}  # fmt: skip
    forces, sharpness = [], []
    for moment in (None, 1e-8, 1e-10):
        more = {'drive.speed': '600 rpm', 'joints.coupler_rocker.clearance': loose}
        for link in ('coupler', 'rocker') if moment else ():
            more[f'links.{link}.elastic'] = {
                'second_moment': moment, 'area': '160 mm^2', 'material': 'steel', 'modes': 3
            }  # fmt: skip
        solution = ms.simulate(ms.load_scene('four_bar_clearance', more), revolutions=4)
        peak, speed = np.array([(i.peak_force, i.approach_speed) for i in solution.impacts]).T
        forces.append(peak.max())
        hard = speed > 0.02
        sharpness.append(np.mean(peak[hard] / speed[hard] ** 1.2))  # Hertz: of a given mass
    assert forces[0] > 1.2 * forces[1] > 1.2**2 * forces[2]
    assert (np.diff(sharpness) < 0.0).all()


# --- refusals -----------------------------------------------------------------------------------

ELASTIC = 'links.rod.elastic'


@pytest.mark.parametrize(
    ('more', 'words'),
    [
        ({f'{ELASTIC}.section': None}, ["needs either 'section', or 'area' and 'second_moment'"]),
        ({f'{ELASTIC}.section': {'width': '8 mm'}}, ["'width' and 'height', or 'diameter'"]),
        ({f'{ELASTIC}.section': {'points': [[0.0, {'diameter': 0.01}], [0.3, {'width': 0.01}]]}},
         [f'{ELASTIC}.section.points.1', "'width' and 'height', or 'diameter', or 'area'"]),
        ({f'{ELASTIC}.section': {'points': [[0.0, {'diameter': 0.01}], [0.3, {
            'width': 0.01, 'height': 0.01}]]}}, ['given by different sizes']),
        ({f'{ELASTIC}.section': {'points': [[0.1, {'diameter': 0.01}], [0.0, {
            'diameter': 0.02}]]}}, ['with x out of order']),
        ({f'{ELASTIC}.youngs_modulus': None}, ["needs 'material' or 'youngs_modulus'"]),
        ({f'{ELASTIC}.density': None}, ["needs 'material' or 'density', or the link a mass"]),
        ({f'{ELASTIC}.material': 'steal'}, ["did you mean 'steel'?"]),
        ({f'{ELASTIC}.modes': 0}, [f'{ELASTIC}.modes', 'at least 1']),
        ({f'{ELASTIC}.ends': 'free'}, ["'pinned' or 'clamped'"]),
        ({f'{ELASTIC}.damping': 1.0}, ['less than 1']),
        ({f'{ELASTIC}.outer_fibre': '4 mm'}, ['which its section defines already']),
        ({'links.rod.length': None, 'links.rod.points': {'end': ['0.3 m', '0 m']}},
         ["links.rod: 'length' is missing"]),
        ({'links.rod.inertia': '1 g m^2'}, ["links.rod.inertia: 'mass' is missing"]),
        ({'links.rod.mass': '0.2 kg', 'links.rod.inertia': '1 kg m^2'},
         ['fit no beam with masses at its ends']),
        ({'links.rod.mass': '0.2 kg', 'links.rod.cog': '0.1 m'}, ["'inertia' is missing"]),
        ({'links.crank.elastic': {'material': 'steel', 'section': {'diameter': '9 mm'}}},
         ['links.crank.elastic.ends must be clamped']),
        ({'sensors.gauge.link': 'crank'}, ["the link 'crank' is rigid", 'those are: rod']),
        ({'sensors.gauge.at': '0.4 m'}, ['is not on the rod', 'from 0 to 0.3 m']),
        ({'sensors.gauge.at': ['0.1 m', '5 mm']}, ['outer fibres are 0.004 m']),
        ({'initial.position': {'rod.bend3': '1 mm'}}, ["there is no coordinate 'rod.bend3'"]),
        ({'initial.elastic': 'bent'}, ["'straight' or 'smooth'"]),
    ],
)  # fmt: skip
def test_what_no_beam_can_be_is_refused(more, words):
    with pytest.raises(InputError) as error:
        ms.load_scene('elastic_slider_crank', more)
    for text in words:
        assert text in str(error.value)
    assert '\n' not in str(error.value)


def test_check_tells_frequencies_and_which_treatment_does():
    def note(**more):
        overrides = {key.replace('__', '.'): value for key, value in more.items()}
        machine = ms.load_scene('elastic_slider_crank', overrides)
        return next(x for x in check(machine).notes if x.startswith('elastic rod'))

    assert 'bend1 203.191 Hz, bend2 812.764 Hz' in note()
    assert 'needs its modes' in note()
    assert 'one mode is sufficient' in note(drive__speed='30 rad/s')
    assert 'a rigid link is sufficient' in note(drive__speed='3 rad/s')
    loose = {'radial': '0.1 mm', 'restitution': 0.5}
    assert 'impulses converge' in note(joints__rod_slider__clearance=loose)


@pytest.mark.parametrize('start', ['straight', 'smooth'])
@pytest.mark.parametrize(('load', 'words'), [(5.0, 'one mode is'), (1e-3, 'a rigid link is')])
def test_check_counts_loads_in_the_treatment_of_an_elastic_link(start, load, words):
    """A cantilever at rest under a force at its tip bends by ``F L^3/(3 E I)``."""
    length, stiffness = 0.5, 200e9 * 0.02 * 0.005**3 / 12.0
    section = {'width': '20 mm', 'height': '5 mm'}
    machine = made({
        'links': {'beam': {
            'length': f'{length} m',
            'elastic': {'section': section, 'material': 'steel', 'youngs_modulus': '200 GPa',
                        'modes': 3, 'ends': 'clamped'},
        }},
        'joints': {'O': {'revolute': ['ground', 'beam']}}, 'gravity': [0, 0],
        'drive': {'coordinate': 'beam', 'speed': '1e-4 rad/s'}, 'initial': {'elastic': start},
        'loads': {'tip': {'at': 'beam.end', 'force': ['0 N', f'{load} N']}},
    })  # fmt: skip
    bent = load * length**3 / (3.0 * stiffness)
    beam = machine.mechanism.having(Beam)['beam']
    begin = Start(machine.plan, machine.nominal, machine.equations, machine.drive.period)
    held = [begin.slow_deformations()[f'beam.{name}'] for name in beam.names]
    # three modes have all but 1 % of the tip's deflection; that it is not small is left out
    assert beam.deflection(length) @ held == pytest.approx(bent, rel=0.01)
    note = next(x for x in check(machine).notes if x.startswith('elastic beam'))
    assert words in note
    assert f'by about {bent / length:.1g} of its size' in note


@pytest.mark.slow
def test_the_periodic_response_of_an_elastic_machine():
    """Without damping disturbances neither grow nor die: multipliers of size 1.

    With it the state found is that to which the machine comes by itself.
    """
    free = find_periodic(ms.load_scene('elastic_slider_crank'), transient=1)
    assert free.residual < 1e-12
    assert np.abs(free.multipliers[:4]) == pytest.approx(1.0, abs=1e-6)
    assert np.abs(np.imag(free.multipliers[:4])).min() > 0.1
    damped = ms.load_scene('elastic_slider_crank', {'links.rod.elastic.damping': 0.05})
    found = find_periodic(damped, transient=1)
    assert found.stable
    run = damped.start()
    run.advance(20 * damped.drive.period, final=True)
    assert run.state.q[-2:] == pytest.approx(found.state.q[-2:], abs=1e-12)


def test_instruments_turn_with_the_cross_section():
    """By differences of what cameras would see: two points of the section and the point itself."""
    machine = ms.load_scene('elastic_slider_crank', {'sensors': {
        'feel': {'link': 'rod', 'at': 0.075, 'axis': 'along', 'sample_rate': 2000.0},
        'spin': {'kind': 'gyroscope', 'link': 'rod', 'at': 0.075, 'sample_rate': 2000.0},
    }})  # fmt: skip
    solution = ms.simulate(machine, duration=0.02)
    read = {}
    for name in ('feel', 'spin'):
        channel = machine.channel(name)
        channel.take(solution.motion)
        read[name] = np.concatenate([block.samples for block in channel.blocks(final=True)])
    t, h, mechanism = np.arange(4, len(read['feel']) - 4) / 2000.0, 1e-5, machine.mechanism

    def seen(at, t):
        return mechanism.locate_all('rod', solution.view(t).observed.position, at)

    def turned(t):
        across = seen((0.075, 1e-3), t) - seen((0.075, -1e-3), t)
        return np.arctan2(-across[0], across[1])

    rate = (turned(t + h) - turned(t - h)) / (2.0 * h)
    assert read['spin'][4:-4] == pytest.approx(rate, abs=2e-4 * np.abs(rate).max())
    pull = (
        seen((0.075, 0.0), t + h) - 2.0 * seen((0.075, 0.0), t) + seen((0.075, 0.0), t - h)
    ) / h**2
    along = pull[0] * np.cos(turned(t)) + pull[1] * np.sin(turned(t))
    assert read['feel'][4:-4] == pytest.approx(along, abs=1e-3 * np.abs(along).max())


@pytest.mark.slow
def test_the_link_on_which_a_rod_hangs_changes_its_bending_by_the_square_of_its_size():
    """Orders of joints differ by the truncation of kinetic energy only, which is of that order."""
    joints = {
        'crank_rod': {'revolute': ['crank.end', 'rod']},
        'rod_slider': {'revolute': ['rod.end', 'slider']},
    }
    t, share = np.linspace(0.0, 0.05, 251), []
    for stiffer in (4.0, 16.0):
        bent = []
        for names in (('crank_rod', 'rod_slider'), ('rod_slider', 'crank_rod')):
            machine = ms.load_scene('elastic_slider_crank', {
                'joints': {
                    'ground_crank': {'revolute': ['ground', 'crank']},
                    **{name: joints[name] for name in names},
                    'ground_slider': {'prismatic': ['ground', 'slider']},
                },
                'links.rod.elastic.youngs_modulus': stiffer * 200e9,
                'initial.elastic': 'straight',
            })  # fmt: skip
            bent.append(ms.simulate(machine, duration=0.05).sample(t, 'position.rod.bend1'))
        one, other = (found['position.rod.bend1'] for found in bent)
        size = np.abs(one).max() / machine.scene.links['rod'].length
        share.append(np.abs(one - other).max() / np.abs(one).max() / size**2)
    assert share[0] == pytest.approx(17.0, rel=0.1)
    assert share[1] == pytest.approx(share[0], rel=0.15)  # the differences fall to a sixteenth
