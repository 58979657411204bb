"""Equations of motion against Newton and Euler, link by link, in Cartesian coordinates.

The second route knows nothing of trees, relative coordinates or Jacobians: every link has two
coordinates of its centre and an angle, every joint two unknown force components, and all
accelerations and forces come from one dense linear system.
"""

from __future__ import annotations

import heyoka as hy
import numpy as np
import pytest
from absolute import cross, turned
from four_bars import SPEED, loose, reference
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf

from mechanism_sim.engine.contact.problem import ContactArrays, problem_of
from mechanism_sim.engine.observer import Instants, Observer
from mechanism_sim.engine.system import System
from mechanism_sim.joints.revolute.bearing import BearingClearance
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.numerics.symbolic import dense
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.closures import Closure
from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.frames import Frames, Jet, Parameters
from mechanism_sim.planar.inverse_dynamics import InverseDynamics, power
from mechanism_sim.planar.mechanism import Mechanism, Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.reactions import energies

RNG = np.random.default_rng(11)


class Newton:
    """Accelerations and forces of a mechanism at one state by a dense Newton-Euler solve.

    Parameters
    ----------
    given : prescribed angular accelerations by link; their drive torques are unknowns
    closed : cut joints that are ideal (they hold both components)
    pressed : cut joints whose pin slides on its bushing, with radial clearance
    """

    def __init__(self, mechanism, q, v, given=None, closed=(), pressed=None):
        given, pressed = given or {}, pressed or {}
        self.mechanism = mechanism
        self.names = [b.name for b in mechanism.bodies]
        self.q, self.v = dict(zip(self.names, q)), dict(zip(self.names, v))  # noqa: B905
        self.origin = self._origins()
        joints = [j for j in mechanism.joints if j.name not in mechanism.cut or j.name in closed]
        n = len(self.names)
        count = 3 * n + 2 * len(joints) + len(pressed) + len(given)
        A, b = np.zeros((count, count)), np.zeros(count)
        row = 0
        for i, body in enumerate(mechanism.bodies):
            A[row, 3 * i] = A[row + 1, 3 * i + 1] = body.mass
            A[row + 2, 3 * i + 2] = body.inertia
            b[row : row + 2] = body.mass * np.array(mechanism.gravity)
            row += 3
        column = 3 * n
        for j in joints:  # unknown: force of first on second
            for axis in range(2):
                force = np.eye(2)[axis]
                for name, sign, at in ((j.second, 1, j.on_second), (j.first, -1, j.on_first)):
                    self._apply(A, column, name, at, -sign * force)
                A[row, :] += self._acceleration_row(j.first, j.on_first, axis, count)
                A[row, :] -= self._acceleration_row(j.second, j.on_second, axis, count)
                b[row] = self._centripetal(j.second, j.on_second)[axis]
                b[row] -= self._centripetal(j.first, j.on_first)[axis]
                row, column = row + 1, column + 1
        for name, clearance in pressed.items():
            j = mechanism.joint(name)
            Q = self.point(j.first, j.on_first) - self.point(j.second, j.on_second)
            rate = self.velocity(j.first, j.on_first) - self.velocity(j.second, j.on_second)
            n_, t_ = Q / np.hypot(*Q), turned(np.pi / 2, Q / np.hypot(*Q))
            # the pin presses the bushing outwards: n on the second link, where they touch
            self._apply_at(A, column, j.second, self.point(j.first, j.on_first), -n_)
            self._apply_at(A, column, j.first, self.point(j.first, j.on_first), n_)
            for axis in range(2):  # n.Q'' + (Q'.t)^2/c = 0
                A[row, :] += n_[axis] * (
                    self._acceleration_row(j.first, j.on_first, axis, count)
                    - self._acceleration_row(j.second, j.on_second, axis, count)
                )
            apart = self._centripetal(j.first, j.on_first) - self._centripetal(
                j.second, j.on_second
            )
            b[row] = -n_ @ apart - (rate @ t_) ** 2 / clearance
            row, column = row + 1, column + 1
        for name, a in given.items():
            i = self.names.index(name)
            A[3 * i + 2, column] = -1.0
            A[row, 3 * i + 2], b[row] = 1.0, a
            row, column = row + 1, column + 1
        x = np.linalg.solve(A, b)
        self.a = x[2 : 3 * n : 3]
        end = 3 * n + 2 * len(joints)
        self.force = {
            j.name: f for j, f in zip(joints, x[3 * n : end].reshape(-1, 2), strict=True)
        }
        self.normal = x[end : end + len(pressed)]
        self.torque = x[end + len(pressed) :]

    def _origins(self):
        """World position of every link's frame, by walking over the joints."""
        origin = {GROUND: np.zeros(2)}
        self.q[GROUND] = self.v[GROUND] = 0.0
        while len(origin) <= len(self.names):
            for j in self.mechanism.joints:
                if j.name in self.mechanism.cut:
                    continue
                for here, there, at, on in (
                    (j.first, j.second, j.on_first, j.on_second),
                    (j.second, j.first, j.on_second, j.on_first),
                ):
                    if here in origin and there not in origin:
                        place = origin[here] + turned(self.q[here], at)
                        origin[there] = place - turned(self.q[there], on)
        # velocities of the frames' origins likewise
        self.origin_rate = {GROUND: np.zeros(2)}
        self.origin = origin
        while len(self.origin_rate) <= len(self.names):
            for j in self.mechanism.joints:
                if j.name in self.mechanism.cut:
                    continue
                for here, there, at, on in (
                    (j.first, j.second, j.on_first, j.on_second),
                    (j.second, j.first, j.on_second, j.on_first),
                ):
                    if here in self.origin_rate and there not in self.origin_rate:
                        spin_here = self.v[here] * turned(self.q[here] + np.pi / 2, at)
                        spin_there = self.v[there] * turned(self.q[there] + np.pi / 2, on)
                        self.origin_rate[there] = self.origin_rate[here] + spin_here - spin_there
        return origin

    def body(self, name):
        return self.mechanism.bodies[self.names.index(name)]

    def point(self, name, at):
        return self.origin[name] + turned(self.q[name], at)

    def velocity(self, name, at):
        return self.origin_rate[name] + self.v[name] * turned(self.q[name] + np.pi / 2, at)

    def _arm(self, name, at):
        cog = (0.0, 0.0) if name == GROUND else self.body(name).cog
        return turned(self.q[name], np.subtract(at, cog))

    def _apply(self, A, column, name, at, force):
        if name != GROUND:
            i = 3 * self.names.index(name)
            A[i : i + 2, column] += force
            A[i + 2, column] += cross(self._arm(name, at), force)

    def _apply_at(self, A, column, name, place, force):
        if name != GROUND:
            i = 3 * self.names.index(name)
            A[i : i + 2, column] += force
            A[i + 2, column] += cross(place - self.point(name, self.body(name).cog), force)

    def _acceleration_row(self, name, at, axis, count):
        row = np.zeros(count)
        if name != GROUND:
            i = 3 * self.names.index(name)
            row[i + axis] = 1.0
            row[i + 2] = turned(np.pi / 2, self._arm(name, at))[axis]
        return row

    def _centripetal(self, name, at):
        return -(self.v[name] ** 2) * self._arm(name, at)

    def energy(self):
        kinetic = potential = 0.0
        for b in self.mechanism.bodies:
            speed = self.velocity(b.name, b.cog)
            kinetic += 0.5 * b.mass * speed @ speed + 0.5 * b.inertia * self.v[b.name] ** 2
            potential -= b.mass * np.array(self.mechanism.gravity) @ self.point(b.name, b.cog)
        return kinetic, potential


def branching_tree(gravity=(1.7, -9.2)):
    """Five links: a chain with a branch, nothing on the axes, joints named both ways round."""
    r = RNG.uniform
    bodies = tuple(
        Body(n, r(0.2, 2.0), r(1e-3, 1e-2), (r(-0.1, 0.2), r(-0.1, 0.1))) for n in 'abcde'
    )

    def joint(first, second):
        at = [(r(-0.2, 0.3), r(-0.1, 0.1)) for _ in range(2)]
        return Revolute(f'{first}{second}', first, second, *at)

    joints = (joint(GROUND, 'a'), joint('a', 'b'), joint('c', 'b'), joint('a', 'd'),
              joint('e', 'd'))  # fmt: skip
    return Mechanism(bodies, joints, (), gravity)


def skew_four_bar(gravity=(3.0, -7.0)):
    """The thesis' four-bar with centres of gravity off the link axes."""
    bodies = (
        Body('crank', 0.6095, 2.645e-3, (0.009, 0.004)),
        Body('coupler', 0.2439, 2.950e-3, (0.185, -0.021)),
        Body('rocker', 0.2334, 3.176e-3, (0.134, 0.033)),
    )
    o = (0.0, 0.0)
    joints = (
        Revolute('ground_crank', GROUND, 'crank', o, o),
        Revolute('crank_coupler', 'crank', 'coupler', (0.064, 0.0), o),
        Revolute('coupler_rocker', 'coupler', 'rocker', (0.309, 0.0), (0.312, 0.0)),
        Revolute('rocker_ground', 'rocker', GROUND, o, (0.387, 0.0)),
    )
    return Mechanism(bodies, joints, ('coupler_rocker',), gravity)


def evaluate(terms, equations, q, v):
    symbols = [*equations.frames.q.values(), *equations.frames.v.values()]
    function = hy.cfunc([dense(t) for t in terms], vars=symbols, opt_level=0)
    pars = equations.parameters.values[: function.nparams]
    return function(np.array([*q, *v]), pars=np.array(pars))


@pytest.mark.parametrize('trial', range(5))
def test_a_free_tree_accelerates_as_newton_and_euler_say(trial):
    direction = 2.0 * np.pi * trial / 5.0
    m = branching_tree((9.81 * np.cos(direction), 9.81 * np.sin(direction)))
    q, v = RNG.uniform(-3, 3, 5), RNG.uniform(-20, 20, 5)
    eq = Equations(m)
    out = evaluate([*(x for row in eq.M for x in row), *eq.bias], eq, q, v)
    M, bias = out[:25].reshape(5, 5), out[25:]
    np.testing.assert_array_equal(M, M.T)
    a = np.linalg.solve(M, -bias)
    np.testing.assert_allclose(a, Newton(m, q, v).a, rtol=1e-9, atol=1e-9)


def test_energies_are_sums_over_the_links():
    m = branching_tree()
    q, v = RNG.uniform(-3, 3, 5), RNG.uniform(-20, 20, 5)
    eq = Equations(m)
    symbolic = energies(eq)
    np.testing.assert_allclose(evaluate(symbolic, eq, q, v), Newton(m, q, v).energy(), rtol=1e-13)


@pytest.mark.parametrize('acceleration', [0.0, 340.0])
def test_reactions_and_torque_of_the_ideal_four_bar(acceleration):
    m = skew_four_bar()
    linkage = FourBar(0.387, 0.064, 0.309, 0.312)
    th2 = np.linspace(0.1, 6.0, 7)
    q, v, a = linkage.motion(th2, SPEED, acceleration)
    forces = InverseDynamics(m, [Closure('coupler_rocker', m)], ['crank'])(q, v, a)
    for k in range(len(th2)):
        newton = Newton(
            m, q[:, k], v[:, k], given={'crank': acceleration}, closed=['coupler_rocker']
        )
        np.testing.assert_allclose(newton.a, a[:, k], rtol=1e-10)
        for i, joint in enumerate(m.joints):
            np.testing.assert_allclose(
                forces.reaction[i, :, k], newton.force[joint.name], rtol=1e-10, atol=1e-10
            )
        np.testing.assert_allclose(forces.drive_torque[:, k], newton.torque, rtol=1e-10)
        energy = forces.kinetic_energy[k], forces.potential_energy[k]
        np.testing.assert_allclose(energy, newton.energy(), rtol=1e-12)


@pytest.fixture(scope='module')
def skew():
    m = skew_four_bar()
    gap = BearingClearance('coupler_rocker', m, 2.54e-4, restitution=0.5)
    return m, System(m, [gap], ['crank'], 2)


def states(radius, sliding=False):
    """States with the pin at distance `radius` from the bushing centre, rates near nominal.

    With `sliding`, the rocker's rate is such that the pin keeps this distance.
    """
    linkage = FourBar(0.387, 0.064, 0.309, 0.312)
    for th2, eta in ((0.3, 0.1), (1.9, 2.0), (3.3, -1.1), (5.2, 4.0)):
        Q = radius * np.array([np.cos(eta), np.sin(eta)])
        x, y = 0.387 - 0.064 * np.cos(th2) + Q[0], -0.064 * np.sin(th2) + Q[1]
        th3, th4 = linkage.close(np.array(x), np.array(y))
        v = linkage.rates(np.array(th2), SPEED, th3, th4)
        w3, w4 = v[0] + 0.3, v[1] - 0.2
        if sliding:
            n = np.exp(1j * eta)
            pin = 1j * (0.064 * SPEED * np.exp(1j * th2) + 0.309 * w3 * np.exp(1j * th3))
            w4 = (n.conj() * pin).real / (n.conj() * 1j * 0.312 * np.exp(1j * th4)).real
        yield np.array([th2, th3, th4]), np.array([SPEED, w3, w4])


@pytest.mark.parametrize('closed', [False, True], ids=['flight', 'following'])
def test_accelerations_forces_and_torque_of_the_loose_four_bar(skew, closed):
    m, system = skew
    for q, v in states(2.54e-4 if closed else 1e-4, sliding=closed):
        a2 = 90.0
        seen = Observer(system).observe(
            Instants(q[:, None], v[:, None], np.array([[a2]]), np.array([[1 + closed]]))
        )
        pressed = {'coupler_rocker': 2.54e-4} if closed else {}
        newton = Newton(m, q, v, given={'crank': a2}, pressed=pressed)
        np.testing.assert_allclose(seen.acceleration[:, 0], newton.a, rtol=1e-9)
        np.testing.assert_allclose(seen.drive_torque[:, 0], newton.torque, rtol=1e-9)
        for i, joint in enumerate(m.joints):
            if joint.name in newton.force:
                np.testing.assert_allclose(
                    seen.reaction[i, :, 0], newton.force[joint.name], rtol=1e-8, atol=1e-9
                )
        if closed:
            np.testing.assert_allclose(seen.normal_force[0], newton.normal, rtol=1e-8)
            Q = newton.point('coupler', (0.309, 0.0)) - newton.point('rocker', (0.312, 0.0))
            np.testing.assert_allclose(
                seen.reaction[2, :, 0], newton.normal[0] * Q / np.hypot(*Q), rtol=1e-8
            )
        else:
            assert seen.normal_force[0, 0] == 0.0
            assert np.abs(seen.reaction[2]).max() == 0.0
        energy = seen.kinetic_energy[0], seen.potential_energy[0]
        np.testing.assert_allclose(energy, newton.energy(), rtol=1e-12)


def test_gap_and_mode_free_terms_of_the_engine_at_a_contact(skew):
    """Compliance, response and free acceleration of the gap, from impulses on separate links."""
    m, system = skew
    for q, v in states(2.54e-4):
        index, pars = system.parameters.laws[0], system.parameters.values.copy()
        pars[index] = [q[0], v[0], 45.0]
        out = system.functions.contact_function(np.array([*q[1:], *v[1:], *pars, 0.0]))
        terms = problem_of(ContactArrays(out, system.contact_layout, np.zeros((2, 1)), None, None))
        newton = Newton(m, q, v, given={'crank': 90.0})
        Q = newton.point('coupler', (0.309, 0.0)) - newton.point('rocker', (0.312, 0.0))
        rate = newton.velocity('coupler', (0.309, 0.0)) - newton.velocity('rocker', (0.312, 0.0))
        n = Q / np.hypot(*Q)
        assert terms.normal_angle[0] == pytest.approx(np.arctan2(Q[1], Q[0]), abs=1e-9)
        assert terms.rate[0] == pytest.approx(-n @ rate, rel=1e-9)
        assert abs(terms.value[0]) < 1e-15
        # [SB] 5.1: about the crank pin and about the rocker's pivot
        IA3 = m.bodies[1].inertia + 0.2439 * (0.185**2 + 0.021**2)
        IO4 = m.bodies[2].inertia + 0.2334 * (0.134**2 + 0.033**2)
        k3 = 0.309 * n @ turned(q[1] + np.pi / 2, (1.0, 0.0))
        k4 = 0.312 * n @ turned(q[2] + np.pi / 2, (1.0, 0.0))
        assert terms.compliance[0][0] == pytest.approx(k3**2 / IA3 + k4**2 / IO4, rel=1e-9)
        np.testing.assert_allclose(terms.response[0], [-k3 / IA3, k4 / IO4], rtol=1e-9)
        acceleration = newton.a[1] * k3 - newton.a[2] * k4
        crank = 90.0 * turned(q[0], (0, 1)) - v[0] ** 2 * turned(q[0], (1, 0))
        bend = (
            0.064 * n @ crank
            - 0.309 * v[1] ** 2 * n @ turned(q[1], (1, 0))
            + 0.312 * v[2] ** 2 * n @ turned(q[2], (1, 0))
        )
        sliding = rate @ turned(np.pi / 2, n)
        expected = -(acceleration + bend) - sliding**2 / 2.54e-4
        # the engine's gap is (c^2 - Q.Q)/2c: it also counts the square of the normal rate
        expected -= (n @ rate) ** 2 / 2.54e-4
        assert terms.free_acceleration[0] == pytest.approx(expected, rel=1e-8)


def test_drive_impulse_at_an_impact_is_the_change_of_angular_momentum(skew):
    """About the crank's pivot: pin A takes the momentum that the coupler's centre gains."""
    m, system = skew
    for q, v in states(2.54e-4):
        pars = system.parameters.values.copy()
        pars[system.parameters.laws[0]] = [q[0], v[0], 0.0]
        out = system.functions.contact_function(np.array([*q[1:], *v[1:], *pars, 0.0]))
        terms = problem_of(ContactArrays(out, system.contact_layout, np.zeros((2, 1)), None, None))
        p = 0.03
        dv3 = terms.response[0][0] * p
        newton = Newton(m, q, v, given={'crank': 0.0})
        Q = newton.point('coupler', (0.309, 0.0)) - newton.point('rocker', (0.312, 0.0))
        n = Q / np.hypot(*Q)
        pin = newton.point('coupler', (0.0, 0.0))
        gained = 0.2439 * dv3 * turned(q[1] + np.pi / 2, m.bodies[1].cog)
        on_coupler_at_a = gained + p * n  # the bushing gives -p n
        expected = cross(pin, on_coupler_at_a)
        assert terms.drive_response[0][0] * p == pytest.approx(expected, rel=1e-8)


def test_textbook_equations_of_the_thesis_in_flight_and_in_following():
    """physics.md: moments of the coupler about A and of the rocker about O4."""
    machine = loose()
    c = 2.54e-4
    IA3, IO4 = 2.950e-3 + 0.2439 * 0.185**2, 3.176e-3 + 0.2334 * 0.134**2
    for closed in (False, True):
        for q, v in states(c if closed else 0.4 * c):
            th2, th3, th4 = q
            seen = machine.equations.observer.observe(
                Instants(q[:, None], v[:, None], np.zeros((1, 1)), np.array([[1 + closed]]))
            )
            F = -seen.reaction[2, :, 0]  # of the bushing on the pin
            v3, v4 = turned(th3, (0, 1)), turned(th4, (0, 1))
            a3 = (
                0.2439 * 0.185 * (0.064 * SPEED**2 * np.sin(th2 - th3) - 9.8145 * np.cos(th3))
                + 0.309 * v3 @ F
            ) / IA3
            a4 = (-0.2334 * 0.134 * 9.8145 * np.cos(th4) - 0.312 * v4 @ F) / IO4
            np.testing.assert_allclose(seen.acceleration[1:, 0], [a3, a4], rtol=1e-9)


def test_states_of_the_reference_give_its_accelerations_forces_and_torques():
    ref = reference('four_bar_seated_e05')['states']
    closed = np.array([mode == 'following' for mode in ref['mode']])
    q = np.array([SPEED * ref['t'], ref['th3'], ref['th4']])
    v = np.array([np.full(len(closed), SPEED), ref['w3'], ref['w4']])
    seen = loose().equations.observer.observe(
        Instants(q, v, np.zeros((1, len(closed))), 1 + closed[None])
    )
    assert np.abs(seen.acceleration[1] - ref['a3']).max() < 3e-9
    assert np.abs(seen.acceleration[2] - ref['a4']).max() < 3e-9
    assert np.abs(seen.normal_force[0] - ref['normal_force']).max() < 3e-11
    assert np.abs(seen.drive_torque[0] - ref['torque']).max() < 3e-12
    assert 0.0 < closed.mean() < 1.0


@given(
    st.lists(st.floats(-3, 3), min_size=3, max_size=3),
    st.lists(st.floats(-50, 50), min_size=3, max_size=3),
)
@settings(max_examples=20)
def test_derivatives_of_the_gap_against_multiprecision_differences(q, v):
    """Value, gradient, rate and curvature of (c^2 - Q.Q)/2c along q + v t."""
    m = skew_four_bar()
    eq = Equations(m, [BearingClearance('coupler_rocker', m, 2.54e-4, restitution=0.5)])
    jet = eq.gap_jets[0]
    terms = [jet.value, *jet.row(eq.coordinates), jet.rate, jet.curvature]
    got = evaluate(terms, eq, q, v)
    with mp.workdps(50):
        c, L = mpf(2.54e-4), [mpf(x) for x in (0.064, 0.309, 0.312, 0.387)]

        def gap(*angles):
            x = L[0] * mp.cos(angles[0]) + L[1] * mp.cos(angles[1])
            x -= L[3] + L[2] * mp.cos(angles[2])
            y = L[0] * mp.sin(angles[0]) + L[1] * mp.sin(angles[1]) - L[2] * mp.sin(angles[2])
            return (c * c - x * x - y * y) / (2 * c)

        def along(t):
            return gap(*(mpf(x) + mpf(w) * t for x, w in zip(q, v, strict=True)))

        place = tuple(map(mpf, q))
        exact = [gap(*place)]
        exact += [mp.diff(gap, place, tuple(int(i == k) for i in range(3))) for k in range(3)]
        exact += [mp.diff(along, 0), mp.diff(along, 0, 2)]
        exact = [float(x) for x in exact]
    scales = np.array([1e3, 1e3, 1e3, 1e3, 1e5, 1e7])
    assert (np.abs(got - exact) < 1e-11 * scales).all()


def test_jets_of_sums_products_and_quotients_against_differences():
    parameters = Parameters()
    frames = Frames(('p', 'r'), parameters)
    x, y = frames.position(
        {('p', None): (0.3, 0.1), ('r', None): (-0.2, 0.7), (GROUND, None): (0.5, -0.4)}, 'point'
    )
    jets = [x * y, x - y, -(x * x), (x + 2.0) * 3.0, y / 4.0, x.half_square() * y - 1.5]

    def numbers(q):
        p, r = (complex(np.exp(1j * a)) for a in q)
        z = p * (0.3 + 0.1j) + r * (-0.2 + 0.7j) + 0.5 - 0.4j
        a, b = z.real, z.imag
        return np.array([a * b, a - b, -a * a, (a + 2) * 3, b / 4, 0.5 * a * a * b - 1.5])

    q, v, h = np.array([0.7, -1.9]), np.array([3.0, -2.0]), 1e-4
    terms = [
        f for j in jets for f in (j.value, j.gradient['p'], j.gradient['r'], j.rate, j.curvature)
    ]
    symbols = [*frames.q.values(), *frames.v.values()]
    function = hy.cfunc([dense(t) for t in terms], vars=symbols, opt_level=0)
    got = function(np.array([*q, *v]), pars=np.array(parameters.values)).reshape(-1, 5)
    by = [
        numbers(q),
        *((numbers(q + h * d) - numbers(q - h * d)) / (2 * h) for d in np.eye(2)),
        (numbers(q + h * v) - numbers(q - h * v)) / (2 * h),
        (numbers(q + h * v) - 2 * numbers(q) + numbers(q - h * v)) / h**2,
    ]
    np.testing.assert_allclose(got, np.array(by).T, atol=2e-6)


def test_a_number_lifted_to_a_jet_does_not_move():
    frames = Frames(('p',), Parameters())
    x, _ = frames.position({('p', None): (1.0, 0.0)}, 'x')
    assert isinstance(x * 2.0, Jet)
    assert (x - x.value).gradient.keys() == {'p'}


def test_power_of_the_drive_is_the_rate_of_energy_in_both_modes(skew):
    """E(t) along q + v t + a t^2/2 by central differences, with the accelerations of each mode."""
    _, system = skew
    h, a2 = 1e-6, np.array([[90.0]])
    for closed in (0.0, 1.0):
        for q, v in states(2.54e-4 if closed else 1e-4, sliding=bool(closed)):
            flag = np.array([[1 + int(closed)]])
            now = Observer(system).observe(Instants(q[:, None], v[:, None], a2, flag))
            a = now.acceleration[:, 0]
            total = []
            for t in (-h, h):
                moved = q + v * t + 0.5 * a * t * t, v + a * t
                seen = Observer(system).observe(
                    Instants(moved[0][:, None], moved[1][:, None], a2, flag)
                )
                total.append(seen.kinetic_energy[0] + seen.potential_energy[0])
            rate = (total[1] - total[0]) / (2 * h)
            assert rate == pytest.approx(now.drive_power[0], rel=1e-6, abs=1e-6)
            assert now.drive_power[0] == pytest.approx(now.drive_torque[0, 0] * v[0], rel=1e-14)


def test_projection_brings_a_closed_gap_to_zero_by_an_impulse_along_the_normal(skew):
    m, system = skew
    for q, v in states(2.5399e-4):
        pars = system.parameters.values.copy()
        pars[system.parameters.laws[0]] = [q[0], v[0], 45.0]
        pars[system.parameters.closed] = 1.0
        x = system.functions.projection(np.array([*q[1:], *v[1:], *pars, 0.0]))
        p, w = np.array([q[0], *x[:2]]), np.array([v[0], *x[2:]])
        newton = Newton(m, p, w)
        Q = newton.point('coupler', (0.309, 0.0)) - newton.point('rocker', (0.312, 0.0))
        rate = newton.velocity('coupler', (0.309, 0.0)) - newton.velocity('rocker', (0.312, 0.0))
        n = Q / np.hypot(*Q)
        assert abs(np.hypot(*Q) - 2.54e-4) < 1e-10  # one Newton step from 1e-8
        assert abs(n @ rate) < 1e-6
        # the impulse that did it acts along n: sliding momentum is what it was
        jump = w[1:] - v[1:]
        assert np.abs(jump).max() > 0.05
        k3 = 0.309 * n @ turned(p[1], (0, 1))
        k4 = 0.312 * n @ turned(p[2], (0, 1))
        IA3 = 2.950e-3 + 0.2439 * (0.185**2 + 0.021**2)
        IO4 = 3.176e-3 + 0.2334 * (0.134**2 + 0.033**2)
        assert jump[0] * IA3 / -k3 == pytest.approx(jump[1] * IO4 / k4, rel=1e-3)


def test_a_drive_at_rest_takes_no_power_whatever_its_torque() -> None:
    torque, speed = np.array([[np.inf, np.nan, 2.0]]), np.array([[0.0, 0.0, 3.0]])
    with np.errstate(all='raise'):
        assert power(torque, speed).tolist() == [0.0, 0.0, 6.0]
