"""Compliant contact laws and the oil film, each against a second route."""

from __future__ import annotations

from dataclasses import replace

import heyoka as hy
import mpmath as mp
import numpy as np
import pytest
from compliant_impacts import impact_depth, impact_duration, true_restitution
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial.legendre import leggauss
from scipy.integrate import dblquad, quad, solve_ivp
from scipy.optimize import brentq
from scipy.sparse import diags_array, eye_array, kron
from scipy.sparse.linalg import spsolve
from short_bearing import OIL, angles, motions, pressure, spins, squeeze

from mechanism_sim.engine.contact.compliant import (
    Flores,
    Hertz,
    HuntCrossley,
    LankaraniNikravesh,
    Material,
    socket_stiffness,
)
from mechanism_sim.engine.contact.film import JournalMotion, ShortBearing

K, MASS, SPEED = 3e9, 0.134, 0.7
STEEL = Material(207e9, 0.3)
DAMPED = HuntCrossley, LankaraniNikravesh, Flores
NOMINAL = 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95


# --- normal force -----------------------------------------------------------------------------


def impact(law, mass=MASS, speed=SPEED):
    """A free impact integrated by DOP853: time, [depth, rate, loss] at the deepest and the end."""

    def flow(_, y):
        depth, rate = max(y[0], 0.0), y[1]
        N = law.normal_force(depth, rate, speed)
        return rate, -N / mass, (N - law.stiffness * depth**law.exponent) * rate

    def leaves(_, y):
        return y[0]

    def deepest(_, y):
        return y[1]

    leaves.terminal = True
    leaves.direction = deepest.direction = -1
    d = impact_depth(law, mass, speed)
    run = solve_ivp(
        flow,
        (0.0, 200.0 * d / speed),
        [0.0, speed, 0.0],
        'DOP853',
        events=[leaves, deepest],
        rtol=1e-12,
        atol=1e-12 * np.array([d, speed, mass * speed**2]),
    )
    return run.t_events[0][0], run.y_events[1][0], run.y_events[0][0]


@pytest.mark.parametrize('exponent', [1.0, 1.5, 2.2])
def test_duration_and_depth_of_an_impact_without_damping(exponent):
    law = Hertz(K, exponent)
    duration, deepest, end = impact(law)
    assert duration == pytest.approx(impact_duration(law, MASS, SPEED), rel=1e-9)
    assert deepest[0] == pytest.approx(impact_depth(law, MASS, SPEED), rel=1e-9)
    assert end[1] == pytest.approx(-SPEED, rel=1e-9)


def test_duration_after_hertz():
    law = Hertz(K)
    depth = impact_depth(law, MASS, SPEED)
    assert depth == pytest.approx((5 * MASS * SPEED**2 / (4 * K)) ** 0.4, rel=1e-14)
    assert impact_duration(law, MASS, SPEED) == pytest.approx(2.94328 * depth / SPEED, rel=2e-6)


@pytest.mark.parametrize('e', NOMINAL)
@pytest.mark.parametrize('kind', DAMPED)
def test_depth_rebound_and_energy_of_an_impact_with_damping(kind, e):
    law = kind(K, e)
    _, deepest, end = impact(law)
    energy = 0.5 * MASS * SPEED**2
    rebound = true_restitution(law)
    assert deepest[0] == pytest.approx(impact_depth(law, MASS, SPEED), rel=1e-8)
    assert deepest[2] + law.elastic_energy(deepest[0]) == pytest.approx(energy, rel=1e-8)
    assert -end[1] / SPEED == pytest.approx(rebound, rel=1e-7)
    assert end[2] == pytest.approx(energy * (1.0 - rebound**2), rel=1e-8)


@pytest.mark.parametrize(
    ('kind', 'rebounds'),
    [
        (HuntCrossley, [0.516, 0.581, 0.663, 0.768, 0.833, 0.909, 0.952]),
        (LankaraniNikravesh, [0.665, 0.684, 0.725, 0.796, 0.847, 0.913, 0.954]),
        (Flores, [0.069, 0.256, 0.470, 0.683, 0.789, 0.894, 0.947]),
    ],
)
def test_true_restitution_for_nominal_0p1_to_0p95(kind, rebounds):
    assert [round(true_restitution(kind(K, e)), 3) for e in NOMINAL] == rebounds


def test_what_the_laws_say_of_their_flaws():
    assert true_restitution(Hertz(K)) == 1.0
    assert true_restitution(HuntCrossley(K, 0.0)) == pytest.approx(0.488, abs=5e-4)
    assert true_restitution(LankaraniNikravesh(K, 0.0)) == pytest.approx(0.663, abs=5e-4)
    assert true_restitution(Flores(K, 1e-3)) == pytest.approx(5e-3 / 8, rel=2e-3)
    short = [e - true_restitution(Flores(K, e)) for e in np.linspace(0.01, 0.99, 99)]
    assert 0.0 < min(short) < max(short) < 0.05
    for kind, missing in zip(DAMPED, (0.0, 0.0, 1 / 15), strict=True):
        lost = 1.0 - true_restitution(kind(K, 1.0 - 1e-5))
        assert lost == pytest.approx(1e-5 * (1.0 + missing), rel=1e-4)


@given(st.floats(0.0, 100.0))
def test_rebound_from_lamberts_function(a):
    """``y = 1 - a e`` solves ``y exp(-y) = (1 + a) exp(-(1 + a))`` on the branch below 1."""

    class Law(Hertz):
        damping = a

    with mp.workdps(40):
        x = 1 + mp.mpf(a)
        e = float((1 + mp.lambertw(-x * mp.exp(-x)).real) / a) if a > 1e-9 else 1.0 - 2 * a / 3
    assert true_restitution(Law(K)) == pytest.approx(e, rel=1e-13)


@pytest.mark.parametrize('n', [1.0, 1.5, 3.0])
@pytest.mark.parametrize('e', [0.2, 0.9])
def test_damping_of_lankarani_and_nikravesh_loses_right_along_the_undamped_motion(n, e):
    """Closing and opening at ``v0 sqrt(1 - x^(n+1))``; energies in ``K d^(n+1)``."""
    once = quad(lambda x: x**n * np.sqrt(1.0 - x ** (n + 1.0)), 0.0, 1.0)[0]
    law = LankaraniNikravesh(1.0, e, n)
    assert 2.0 * law.damping * once == pytest.approx((1.0 - e * e) / (n + 1.0), rel=1e-9)


@pytest.mark.parametrize('e', [0.2, 0.9])
def test_damping_of_flores_loses_right_along_the_ellipse(e):
    once = quad(lambda x: x**1.5 * np.sqrt(1.0 - x * x), 0.0, 1.0)[0]
    assert once == pytest.approx(0.25, rel=2e-3)
    a = Flores(1.0, e).damping
    kinetic = 0.4 + a * 0.25
    assert a * 0.25 * (1.0 + e) == pytest.approx((1.0 - e * e) * kinetic, rel=1e-14)


@given(st.sampled_from(DAMPED), st.floats(0.01, 1.0), st.floats(0.0, 1.0))
def test_an_impact_never_pulls_but_a_contact_torn_apart_does(kind, e, part):
    law = kind(K, e)
    rebound = -part * true_restitution(law) * SPEED
    assert law.normal_force(1e-5, rebound, SPEED) >= 0.0
    if law.damping > 0.0:
        assert law.normal_force(1e-5, -1.01 * SPEED / law.damping, SPEED) < 0.0


@pytest.mark.parametrize('kind', DAMPED)
def test_the_laws_compile_with_their_parameters_left_open(kind):
    """One integrator for all stiffnesses and restitutions, against the closed form."""
    depth, rate = hy.make_vars('depth', 'rate')
    law = kind(hy.par[0], hy.par[1])
    start = 1e-15
    flow = hy.taylor_adaptive(
        [(depth, rate), (rate, -law.normal_force(depth, rate, SPEED) / MASS)],
        [start, SPEED],
        pars=[K, 1.0],
        opt_level=0,
        t_events=[hy.t_event(depth - 0.5 * start, direction=hy.event_direction.negative)],
    )
    for e in NOMINAL:
        flow.time, flow.state[:], flow.pars[:] = 0.0, [start, SPEED], [K, e]
        flow.reset_cooldowns()
        flow.propagate_until(1.0)
        assert flow.state[0] < start
        assert -flow.state[1] / SPEED == pytest.approx(true_restitution(kind(K, e)), rel=1e-12)


def test_numbers_arrays_and_expressions_give_the_same_force():
    rng = np.random.default_rng(7)
    depth, rate, approach = rng.uniform(0.1, 1.0, (3, 20)) * [[1e-5], [1.0], [2.0]]
    x = hy.make_vars('depth', 'rate', 'approach')
    for law in (Hertz(K), *(kind(K, 0.6) for kind in DAMPED)):
        compiled = hy.cfunc([law.normal_force(*x), law.elastic_energy(x[0])], vars=x, opt_level=0)
        N, energy = compiled(np.array([depth, rate, approach]))
        assert law.normal_force(depth, rate, approach) == pytest.approx(N, rel=1e-14)
        assert law.elastic_energy(depth) == pytest.approx(energy, rel=1e-14)
        one = law.normal_force(depth[3], rate[3], approach[3])
        assert one == pytest.approx(N[3], rel=1e-14)


# --- stiffness --------------------------------------------------------------------------------


def test_stiffness_from_boussinesqs_half_space():
    """The semi-ellipsoid of pressure must flatten a paraboloid; what it pushes in is the depth.

    Boussinesq: ``u(r) = 1/(pi E)`` times the integral of p over the patch by 1/distance, here in
    polar coordinates about r, where the distance drops out.
    """
    pin, bushing, Rp, c = STEEL, Material(110e9, 0.34), 5e-3, 0.25e-3
    E = 1.0 / ((1 - pin.poisson**2) / pin.young + (1 - bushing.poisson**2) / bushing.young)
    curvature = 1.0 / Rp - 1.0 / (Rp + c)
    a = 3e-4

    def pressure(r, s, phi):
        return np.sqrt(max(0.0, 1.0 - r * r - s * s - 2.0 * r * s * np.cos(phi)))

    def sunk(r):
        def edge(phi):
            return -r * np.cos(phi) + np.sqrt(1.0 - (r * np.sin(phi)) ** 2)

        return (
            2.0
            * a
            / (np.pi * E)
            * dblquad(lambda s, phi: pressure(r, s, phi), 0, np.pi, 0, edge)[0]
        )

    centre = sunk(0.0)
    peak = 0.5 * curvature * (0.5 * a) ** 2 / (centre - sunk(0.5))
    assert peak * (centre - sunk(0.9)) == pytest.approx(0.5 * curvature * (0.9 * a) ** 2, 1e-6)
    force = 2.0 * np.pi * a * a * peak * quad(lambda s: pressure(0.0, s, 0.0) * s, 0.0, 1.0)[0]
    expected = force / (peak * centre) ** 1.5
    assert socket_stiffness(Rp, c, pin, bushing) == pytest.approx(expected, rel=1e-6)


def test_stiffness_as_the_literature_prints_it():
    Rp, c = 4e-3, 1e-4
    Rb = Rp + c
    s = (1.0 - STEEL.poisson**2) / (np.pi * STEEL.young)
    printed = 4.0 / (3.0 * np.pi * (s + s)) * np.sqrt(Rp * Rb / (Rb - Rp))
    assert socket_stiffness(Rp, c, STEEL, STEEL) == pytest.approx(printed, rel=1e-12)


# --- oil film ---------------------------------------------------------------------------------

SCALE = OIL.viscosity * OIL.radius * (OIL.width / OIL.clearance) ** 3


def compiled_film(bearing):
    v = hy.make_vars('x', 'y', 'vx', 'vy', 'journal', 'bushing')
    motion = JournalMotion(*v)
    return hy.cfunc([*bearing.force(motion), *bearing.moments(motion)], vars=v, opt_level=0)


FILM = compiled_film(OIL)


AROUND, ALONG = leggauss(400), leggauss(6)


def loaded_film(motion):
    """Nodes and weights over the film that carries: theta (400, 1), z (6,), weights (400, 6)."""
    theta = np.angle(squeeze(motion)) + 0.5 * np.pi * AROUND[0]
    z = 0.5 * OIL.width * ALONG[0]
    return theta[:, None], z, 0.25 * np.pi * OIL.width * np.outer(AROUND[1], ALONG[1])


@given(motions())
def test_film_force_is_the_integral_of_the_pressure(motion):
    theta, z, weights = loaded_film(motion)
    p, _ = pressure(motion, theta, z)
    assert p.min() >= 0.0
    F = -OIL.radius * np.sum(weights * p * np.exp(1j * theta))
    fx, fy = FILM(motion)[:2]
    assert abs(fx + 1j * fy - F) <= 1e-10 * abs(F)


@given(motions())
def test_film_moments_are_the_integrals_of_the_shear(motion):
    """Shear of the film's own velocity profile; the circle of Couette flow is full."""
    theta, z, weights = loaded_film(motion)
    step = 1e-4
    h = pressure(motion, theta, z)[1]
    ahead, behind = (pressure(motion, theta + d, z)[0] for d in (step, -step))
    slope = (ahead - behind) / (2.0 * step)
    pressed = -0.5 * OIL.radius * np.sum(weights * slope * h)
    ring = np.arange(2000) * (2.0 * np.pi / 2000)
    drag = OIL.viscosity * OIL.width * OIL.radius**3 * (motion[4] - motion[5])
    drag *= np.sum(1.0 / pressure(motion, ring, 0.0)[1]) * (2.0 * np.pi / 2000)
    _, _, on_journal, on_bushing = FILM(motion)
    size = abs(squeeze(motion)) * SCALE * OIL.clearance * 1e-7 + abs(drag) * 1e-9
    assert on_journal == pytest.approx(pressed - drag, rel=1e-5, abs=size)
    assert on_bushing == pytest.approx(pressed + drag, rel=1e-5, abs=size)


@given(motions())
def test_the_film_only_loses_and_keeps_angular_momentum(motion):
    x, y, vx, vy, journal, bushing = motion
    fx, fy, on_journal, on_bushing = FILM(motion)
    power = [fx * vx, fy * vy, on_journal * journal, on_bushing * bushing]
    assert sum(power) <= 1e-12 * np.abs(power).sum()
    moments = [x * fy, -y * fx, on_journal, on_bushing]
    assert abs(sum(moments)) <= 1e-12 * np.abs(moments).sum()


@given(motions(), angles, spins)
def test_the_film_does_not_know_the_axes(motion, turn, spin):
    """Turned axes; mirrored ones; and axes that spin, seen from which all spins are less."""
    x, y, vx, vy, journal, bushing = motion
    fx, fy, *moments = FILM(motion)
    size = 1e-11 * np.hypot(fx, fy)
    c, s = np.cos(turn), np.sin(turn)
    turned = [c * x - s * y, s * x + c * y, c * vx - s * vy, s * vx + c * vy, journal, bushing]
    gx, gy, *same = FILM(np.array(turned))
    assert (gx, gy) == pytest.approx((c * fx - s * fy, s * fx + c * fy), abs=size)
    assert same == pytest.approx(moments, rel=1e-9, abs=1e-12)
    mirrored = FILM(np.array([x, -y, vx, -vy, -journal, -bushing]))
    assert list(mirrored[:2]) == pytest.approx([fx, -fy], abs=size)
    spun = FILM(np.array([x, y, vx + spin * y, vy - spin * x, journal - spin, bushing - spin]))
    rounding = (
        1e-13 * SCALE * abs(spin) * OIL.clearance / (1.0 - np.hypot(x, y) / OIL.clearance) ** 3
    )
    assert list(spun[:2]) == pytest.approx([fx, fy], abs=size + rounding)


def reynolds(bearing, motion, turns=120, rows=24):
    """Midplane pressure of the full film by finite differences of Reynolds' own equation [Pa]."""
    Q, rate = motion[0] + 1j * motion[1], motion[2] + 1j * motion[3]
    mean = 0.5 * (motion[4] + motion[5])
    step, dz, dt = 2.0 * np.pi / turns, bearing.width / rows, 1e-7

    def thickness(theta, t=0.0):
        return bearing.clearance - (np.conj(Q + rate * t) * np.exp(1j * theta)).real

    theta = np.arange(turns) * step
    wedge = mean * (thickness(theta + 1e-5) - thickness(theta - 1e-5)) / 2e-5
    rise = (thickness(theta, dt) - thickness(theta, -dt)) / (2.0 * dt)
    east, west = thickness(theta + step / 2) ** 3, thickness(theta - step / 2) ** 3
    around = (
        diags_array(
            [-east - west, east[:-1], west[1:], west[:1], east[-1:]],
            offsets=[0, 1, -1, turns - 1, 1 - turns],
        )
        / (bearing.radius * step) ** 2
    )
    inner = rows - 1
    along = diags_array([1.0, -2.0, 1.0], offsets=[-1, 0, 1], shape=(inner, inner)) / dz**2
    A = kron(around, eye_array(inner)) + kron(diags_array(thickness(theta) ** 3), along)
    b = np.repeat(12.0 * bearing.viscosity * (wedge + rise), inner)
    return theta, spsolve(A.tocsc(), b).reshape(turns, inner)[:, rows // 2 - 1]


def test_the_pressure_solves_reynolds_equation_as_the_width_goes_to_zero():
    """Sign, spin of both surfaces, and squeeze; the error falls with the square of the width."""
    c = OIL.clearance
    motion = np.array([0.3 * c, 0.4 * c, 8e-3, -3e-3, 250.0, -70.0])
    errors = []
    for width in (2e-3, 1e-3):
        bearing = ShortBearing(OIL.viscosity, width, OIL.radius, c)
        theta, p = reynolds(bearing, motion)
        short, _ = pressure(motion, theta, 0.0, bearing)
        errors.append(np.abs(p - short).max() / np.abs(short).max())
    assert errors[0] < 0.02
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize(('journal', 'bushing'), [(200.0, 0.0), (0.0, 200.0), (-350.0, 120.0)])
@pytest.mark.parametrize('e', [0.01, 0.3, 0.6, 0.9, 0.99])
def test_steady_load_and_attitude_after_ocvirk(journal, bushing, e):
    """``S (L/D)^2 = (1 - e^2)^2/(pi e sqrt(pi^2 (1 - e^2) + 16 e^2))``, S for the summed spin."""
    at = 0.7
    x, y = e * OIL.clearance * np.cos(at), e * OIL.clearance * np.sin(at)
    fx, fy, *_ = FILM(np.array([x, y, 0.0, 0.0, journal, bushing]))
    W = np.hypot(fx, fy)
    D, spin = 2.0 * OIL.radius, abs(journal + bushing)
    S = (
        OIL.viscosity
        * spin
        / (2.0 * np.pi)
        * OIL.width
        * D
        / W
        * (OIL.radius / OIL.clearance) ** 2
    )
    root = np.sqrt(np.pi**2 * (1.0 - e * e) + 16.0 * e * e)
    expected = (1.0 - e * e) ** 2 / (np.pi * e * root)
    assert S * (OIL.width / D) ** 2 == pytest.approx(expected, rel=1e-12)
    # the load is opposite to the force; the journal stands ahead of it by the attitude angle
    ahead = at - np.arctan2(-fy, -fx)
    tangent = np.pi * np.sqrt(1.0 - e * e) / (4.0 * e)
    assert np.tan(ahead) == pytest.approx(np.copysign(tangent, journal + bushing), rel=1e-11)


@pytest.mark.parametrize('e', [-0.999, -0.9, -0.5, 0.0, 0.5, 0.9, 0.999])
def test_pure_squeeze(e):
    """``(1 + 2 e^2) arccos(-e)/(1 - e^2)^(5/2) + 3 e/(1 - e^2)^2``, e < 0 off the wall."""
    V = 3e-3
    fx, fy, *_ = FILM(np.array([e * OIL.clearance, 0.0, V, 0.0, 0.0, 0.0]))
    with mp.workdps(40):
        x = mp.mpf(e * OIL.clearance) / mp.mpf(OIL.clearance)
        s = mp.sqrt(1 - x * x)
        shape = float((1 + 2 * x * x) * mp.acos(-x) / s**5 + 3 * x / s**4)
    assert fx == pytest.approx(-SCALE * V * shape, rel=1e-12)
    assert abs(fy) <= 1e-15 * abs(fx)


@pytest.mark.sample(3)
@pytest.mark.parametrize('gap', [1.0, 1e-2, 1e-4, 1e-8])
@pytest.mark.parametrize('towards', [0.0, 0.6, 1.57, 1.6, 3.0, np.pi])
def test_the_film_is_exact_from_the_centre_to_the_wall(gap, towards):
    """Against the integrals in 30 digits; V at this angle from the line of centres."""
    FILM_OF_ONE = compiled_film(ShortBearing(1.0, 1.0, 1.0, 1.0))
    e, u = 1.0 - gap, complex(np.cos(towards), np.sin(towards))
    fx, fy, *_ = FILM_OF_ONE(np.array([e, 0.0, u.real, u.imag, 0.0, 0.0]))
    with mp.workdps(30):
        ux, uy = mp.mpf(u.real), mp.mpf(u.imag)
        axis = mp.atan2(uy, ux)
        near = [k * 10**j * mp.sqrt(gap) for j in range(-2, 5) for k in (-1, 1)]
        low, high = axis - mp.pi / 2, axis + mp.pi / 2
        ends = sorted({low, high, *(t for t in (mp.mpf(0), *near) if low < t < high)})

        def integral(f):
            def pressed(t):
                h = 1 - e * mp.cos(t)
                return (ux * mp.cos(t) + uy * mp.sin(t)) * f(t) / h**3

            return -mp.quad(pressed, ends)

        gx, gy = integral(mp.cos), integral(mp.sin)
        error = float(mp.hypot(fx - gx, fy - gy) / mp.hypot(gx, gy))
    assert error < 1e-14 + 1e-16 / gap


def test_the_film_at_rest_carries_nothing():
    for place in ([0.0, 0.0], [1e-5, -1e-5]):
        fx, fy, *_ = FILM(np.array([*place, 0.0, 0.0, 50.0, -50.0]))
        assert fx == 0.0
        assert fy == 0.0


def test_the_film_compiles_with_its_parameters_left_open():
    motion = np.array([1e-5, 2e-5, 1e-3, 3e-3, 100.0, -20.0])
    filled = compiled_film(ShortBearing(*(hy.par[i] for i in range(4))))
    pars = [OIL.viscosity, OIL.width, OIL.radius, OIL.clearance]
    assert filled(motion, pars=pars) == pytest.approx(FILM(motion), rel=1e-14)


def test_what_a_film_does_in_one_motion_is_made_once():
    """Force, moments and loss share it, and so do machines of one kind."""
    first, again = (JournalMotion(*hy.make_vars('x', 'y', 'vx', 'vy', 'a', 'b')) for _ in '12')
    for film in (OIL, replace(OIL, full=True), replace(OIL, supply=1e5)):
        assert film.force(first) is film.force(again)
        assert film.moments(first) is film.moments(again)
        assert film.force(first) is not film.force(first._replace(share=0.5))
    assert OIL.force(first) is not replace(OIL, full=True).force(first)


def test_a_loaded_journal_spirals_from_rest_at_the_centre_to_ocvirks_point():
    names = hy.make_vars('x', 'y', 'vx', 'vy')
    x, y, vx, vy = names
    mass, load, spin = 2.0, 60.0, 150.0
    fx, fy = OIL.force(JournalMotion(x, y, vx, vy, hy.par[0], hy.expression(0.0)))
    flow = hy.taylor_adaptive(
        [(x, vx), (y, vy), (vx, fx / mass), (vy, (fy - load) / mass)],
        [0.0] * 4,
        pars=[spin],
        opt_level=0,  # its optimisation takes a hundred times as long as the run
    )
    flow.propagate_until(0.3)

    def carried(e):
        root = np.sqrt(np.pi**2 * (1.0 - e * e) + 16.0 * e * e)
        return SCALE * OIL.clearance * spin / 4.0 * e * root / (1.0 - e * e) ** 2

    e = brentq(lambda e: carried(e) - load, 0.0, 0.999)
    ahead = np.arctan2(np.pi * np.sqrt(1.0 - e * e), 4.0 * e)
    rest = e * OIL.clearance * np.exp(1j * (ahead - np.pi / 2))
    assert abs(flow.state[0] + 1j * flow.state[1] - rest) < 1e-9 * OIL.clearance
