"""Criteria of contact loss: fields with known answers, scaling laws, and the real machine."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from builders import made
from four_bars import RADIAL, SPEED, reference
from scipy.integrate import quad

import mechanism_sim as ms
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import InputError
from mechanism_sim.thesis.contact_loss import (
    ClearanceLink,
    contact_loss,
    follow,
    free_link,
    index_spans,
    lagging_link,
    losses,
    polar_plot,
    small_force,
    turn_over_least_force,
    turning_link,
    unit_turn_over_force,
)
from mechanism_sim.thesis.force_cycle import ForceCycle

TURN = 2.0 * np.pi
W = 30.0  # [rad/s] crank of the synthetic fields
KEYS = (
    'small', 'polar', 'turn over least', 'unit turn', 'turning link', 'lagging link', 'free link'
)  # fmt: skip


@cache
def thesis(speed=SPEED, gravity=True):
    """Machine, cycle and clearance link per radial clearance of the ideal thesis mechanism."""
    overrides = {'drive.speed': speed} | ({} if gravity else {'gravity': [0.0, 0.0]})
    machine = ms.load_scene('four_bar_nominal', overrides)
    speed = machine.scene.drive.speed.value
    cycle = ForceCycle.nominal(
        machine.nominal.four_bar, machine.nominal.inverse_dynamics, 'coupler_rocker', speed
    )
    inertias = [
        link.inertia + link.mass * link.cog**2
        for link in (machine.scene.links[name] for name in ('coupler', 'rocker'))
    ]
    return machine, cycle, lambda c: ClearanceLink.four_bar(c, machine.nominal.linkage, *inertias)


def field(x, y, speed=W):
    """A cycle with components x, y given as functions of the crank angle."""
    return ForceCycle.resolved(lambda a: np.array([x(a), y(a)]), speed)


def constant(R):
    """A cycle with one and the same force R [N] along x."""
    return field(lambda p: R + 0.0 * p, lambda p: 0.0 * p)


def ellipse(d=2.0, a=5.0, b=3.0, speed=W):
    """A force on an ellipse that passes the origin at distance d, at crank angle 0."""
    return field(lambda p: d + a - a * np.cos(p), lambda p: b * np.sin(p), speed)


def mass_point(radial, mass):
    """A pin with a mass [kg] of its own that is the same in all directions."""

    def inertia(angle):
        m = np.repeat(mass * np.eye(2)[:, :, None], np.size(angle), axis=2)
        return m, np.zeros_like(m)

    return ClearanceLink(radial, inertia)


def turned_plane(cycle, by):
    """Force cycle of the same machine seen from another frame."""
    R = np.array([[np.cos(by), -np.sin(by)], [np.sin(by), np.cos(by)]])
    return ForceCycle.resolved(lambda p: R @ cycle.curve(p, 0), cycle.speed)


def gap(a, b):
    """Distance of two angles [rad] on the circle."""
    return np.abs(np.angle(np.exp(1j * (np.asarray(a) - np.asarray(b)))))


# --- force fields with known answers ----------------------------------------------------------


@pytest.mark.sample(1)
@pytest.mark.parametrize('k', [1, 3])
def test_a_constant_force_that_rotates_has_one_index_and_no_instants(k):
    R = 12.0
    cycle = field(lambda p: R * np.cos(k * p), lambda p: R * np.sin(k * p))
    assert cycle.mean == pytest.approx(R, rel=1e-13)
    assert cycle.maximum[1] == pytest.approx(R, rel=1e-14)
    assert len(cycle.minima) == 1
    for found in (turn_over_least_force(cycle), unit_turn_over_force(cycle)):
        assert found.figure == pytest.approx(k * W / R, rel=1e-13)
        assert found.predicts_loss
    assert unit_turn_over_force(cycle).angles == ()
    assert not unit_turn_over_force(cycle, level=1.0001 * k * W / R).predicts_loss
    assert small_force(cycle).figure == pytest.approx(1.0)
    assert not polar_plot(cycle).predicts_loss
    link = mass_point(1e-3, 0.2)
    centripetal = 1e-3 * 0.2 * (k * W) ** 2
    assert turning_link(cycle, link).figure == pytest.approx(R + centripetal, rel=1e-12)
    assert lagging_link(cycle, link).figure < 1e-12
    # A link that is let go with the turn of the force keeps it.
    assert follow(cycle, link, rate=k * W).least_force == pytest.approx(R + centripetal, rel=1e-8)


def test_an_ellipse_near_the_origin_has_the_index_of_its_curvature():
    """At the vertex |F'| = b w and R = d, so that gamma'/R = b w/d^2."""
    d, a, b = 2.0, 5.0, 3.0
    cycle = ellipse(d, a, b)
    nearest = cycle.minima[0]
    assert len(cycle.minima) == 1
    assert gap(nearest.angle, 0.0) < 1e-14
    assert nearest.force == pytest.approx(d, rel=1e-14)
    assert nearest.index == pytest.approx(b * W / d**2, rel=1e-14)
    assert cycle.maximum == (pytest.approx(np.pi, abs=1e-14), pytest.approx(d + 2 * a, rel=1e-14))
    exact = quad(lambda p: np.hypot(d + a - a * np.cos(p), b * np.sin(p)), 0.0, np.pi)[0] / np.pi
    assert cycle.mean == pytest.approx(exact, rel=1e-12)
    assert turn_over_least_force(cycle).angles == (nearest.angle,)
    assert turn_over_least_force(cycle, 1.001 * nearest.index).angles == ()
    assert polar_plot(cycle).figure == pytest.approx(d / (d + 2 * a), rel=1e-14)
    assert polar_plot(cycle, 1.001 * d / (d + 2 * a)).angles == (nearest.angle,)


def test_instants_of_unit_index_are_roots_and_come_in_pairs():
    cycle = ellipse()
    level = 2.0
    spans = index_spans(cycle, level)
    assert spans
    edges = np.array(spans)
    np.testing.assert_allclose(cycle.index(edges.ravel()), level, rtol=1e-13)
    inside = edges[:, 0] + 0.5 * np.mod(edges[:, 1] - edges[:, 0], TURN)
    assert (cycle.index(inside) > level).all()
    # F(-p) mirrors F(p): so do begin and end.
    np.testing.assert_allclose(
        gap(np.sort(edges[:, 0]), -np.sort(edges[:, 1])[::-1]), 0, atol=1e-13
    )
    assert unit_turn_over_force(cycle, level).angles == tuple(sorted(edges[:, 0]))


def test_a_small_force_is_sensed_where_it_falls_below():
    cycle = ellipse()
    found = small_force(cycle, 0.5)
    assert found.predicts_loss
    assert len(found.angles) == 1
    at = cycle.magnitude(np.array([found.angles[0] - 1e-6, *found.angles, found.angles[0] + 1e-6]))
    assert at[0] > at[1] > at[2]
    assert at[1] == pytest.approx(0.5 * cycle.mean, rel=1e-13)
    assert small_force(cycle, 0.99 * found.figure).angles == ()


def test_a_straight_line_through_the_origin_is_met_by_all_four():
    cycle = field(lambda p: 4.0 * np.cos(p - 0.3), lambda p: 3.0 * np.cos(p - 0.3))
    passes = np.array([0.3 + 0.5 * np.pi, 0.3 + 1.5 * np.pi])
    np.testing.assert_allclose([m.angle for m in cycle.minima], passes, atol=1e-14)
    for found in (polar_plot(cycle), turn_over_least_force(cycle), unit_turn_over_force(cycle)):
        assert found.predicts_loss
        np.testing.assert_allclose(found.angles, passes, atol=1e-12)
    assert turn_over_least_force(cycle).figure > 1e12
    assert small_force(cycle).figure < 1e-15
    assert cycle.mean == pytest.approx(10.0 / np.pi, rel=1e-9)


def test_a_cusp_at_the_origin_is_no_passage():
    """F = (1 - cos p)(1 - cos p, sin p) comes to the origin and leaves it with zero slope."""
    cycle = field(lambda p: (1 - np.cos(p)) ** 2, lambda p: (1 - np.cos(p)) * np.sin(p))
    assert polar_plot(cycle).figure < 1e-12
    assert not polar_plot(cycle).predicts_loss


def test_a_peak_of_the_index_much_narrower_than_the_grid_is_found():
    d = 1e-6
    cycle = ellipse(d, 5.0, 3.0)
    found = unit_turn_over_force(cycle, 1e9)
    assert found.figure == pytest.approx(3.0 * W / d**2, rel=1e-8)
    ((begin, end),) = index_spans(cycle, 1e9)
    np.testing.assert_allclose(cycle.index(np.array([begin, end])), 1e9, rtol=1e-6)
    assert gap(begin, end) < 1e-3 < TURN / cycle.resolution


# --- the clearance link -----------------------------------------------------------------------


def pendulum(p2):
    """A link in a constant force, thrown off with m c p^2/R = p2: cycle, link, rate."""
    R, c, m = 5.0, 2e-4, 0.3
    return (
        constant(R),
        mass_point(c, m),
        np.sqrt(p2 * R / m / c),
    )


@pytest.mark.parametrize('p2', [2.5, 4.0, 4.9])
def test_a_thrown_pendulum_lets_go_where_energy_says(p2):
    """N = R cos x + m c x'^2 vanishes at cos x = (2 - m c p^2/R)/3."""
    cycle, link, rate = pendulum(p2)
    top = np.arccos((2.0 - p2) / 3.0)
    time = quad(lambda x: 1.0 / np.sqrt(1.0 - 2.0 * (1.0 - np.cos(x)) / p2), 0.0, top)[0] / rate
    run = follow(cycle, link, start=0.4, rate=rate)
    assert run.turned == pytest.approx(W * time, rel=1e-8)
    assert run.angle == pytest.approx(0.4 + W * time, rel=1e-8)


@pytest.mark.sample(1)
@pytest.mark.parametrize('p2', [0.1, 1.9])
def test_a_pendulum_thrown_less_keeps_contact_with_its_least_force_at_the_turning_point(p2):
    cycle, link, rate = pendulum(p2)
    run = follow(cycle, link, rate=rate)
    assert run.turned is None
    assert run.least_force == pytest.approx(5.0 * (1.0 - 0.5 * p2), rel=1e-7)


@pytest.mark.slow
def test_a_pendulum_thrown_over_the_top_stays_in_contact():
    cycle, link, rate = pendulum(5.2)
    run = follow(cycle, link, rate=rate)
    assert run.turned is None
    assert run.least_force == pytest.approx(0.2 * 5.0, rel=1e-6)


def test_a_lagging_link_with_an_isotropic_mass_compares_inertia_with_force():
    """On the ellipse gamma'' has a known maximum: it is checked by differences."""
    cycle, link = ellipse(), mass_point(1e-3, 0.2)
    p = np.linspace(-1.0, 1.0, 200001)
    f = cycle.curve(p, 0)
    gamma = np.unwrap(np.arctan2(f[1], f[0]))
    h = p[1] - p[0]
    second = (gamma[2:] - 2.0 * gamma[1:-1] + gamma[:-2]) / h**2 * W**2
    first = (gamma[2:] - gamma[:-2]) / (2.0 * h) * W
    R = np.hypot(*f)[1:-1]
    assert lagging_link(cycle, link).figure == pytest.approx(
        (2e-4 * np.abs(second) / R).max(), rel=1e-5
    )
    assert turning_link(cycle, link).figure == pytest.approx(
        min((R + 2e-4 * first**2).min(), cycle.maximum[1]), rel=1e-5
    )


def test_without_coupling_a_link_that_turns_with_the_force_presses_more_than_the_force():
    for cycle in (ellipse(), thesis()[1]):
        for c in (1e-5, 1e-3):
            found = turning_link(cycle, mass_point(c, 0.1))
            assert found.figure > min(m.force for m in cycle.minima)


def test_a_coupled_mass_can_pull_a_turning_link_off():
    mass = np.array([[1.0, 0.9], [0.9, 1.0]])

    def inertia(angle):
        m = np.repeat(mass[:, :, None], np.size(angle), axis=2)
        return m, 0.0 * m

    found = turning_link(ellipse(0.3), ClearanceLink(1e-2, inertia))
    assert found.predicts_loss
    assert found.figure < 0.0
    assert found.angles


def test_inertia_of_the_four_bar_link_is_that_of_its_impacts():
    """The inverse of m is l3^2 v3 v3/IA3 + l4^2 v4 v4/IO4; the rates come from differences."""
    machine, _, link_of = thesis()
    p = np.linspace(0.0, TURN, 50)
    link = link_of(1e-4)
    m, transport = (x.transpose(2, 0, 1) for x in link.inertia(p))
    mobility = np.zeros_like(m)
    for name, angle in zip(
        ('coupler', 'rocker'), machine.nominal.linkage.positions(p), strict=True
    ):
        body = machine.scene.links[name]
        v = np.array([-np.sin(angle), np.cos(angle)]) * body.length
        mobility += np.einsum('in,jn->nij', v, v) / (body.inertia + body.mass * body.cog**2)
    np.testing.assert_allclose(m @ mobility, np.broadcast_to(np.eye(2), m.shape), atol=1e-13)
    h = 1e-5
    change = (link.inertia(p + h)[0] - link.inertia(p - h)[0]).transpose(2, 0, 1) / (2.0 * h)
    symmetric = 0.5 * (transport + transport.transpose(0, 2, 1))
    np.testing.assert_allclose(symmetric, change, atol=1e-9)
    # At crank angle 0 coupler and rocker turn at one rate, and what is fixed to them turns too.
    rigid = np.linalg.solve(m[0], 0.5 * transport[0]) * SPEED
    w3 = -7.262295975
    np.testing.assert_allclose(rigid, [[0.0, w3], [-w3, 0.0]], atol=1e-8)


# --- refinement, invariance, scaling ----------------------------------------------------------


def test_extreme_forces_of_the_thesis_mechanism_to_all_digits():
    ref = reference('nominal')
    cycle = thesis()[1]
    least = min(cycle.minima, key=lambda m: m.force)
    assert least.force == pytest.approx(ref['smallest_bearing_force']['force'], rel=1e-13)
    assert np.degrees(least.angle) == pytest.approx(
        ref['smallest_bearing_force']['crank_angle'], rel=1e-12
    )
    angle, force = cycle.maximum
    assert force == pytest.approx(ref['largest_bearing_force']['force'], rel=1e-14)
    assert np.degrees(angle) == pytest.approx(
        ref['largest_bearing_force']['crank_angle'], rel=1e-12
    )


def flat(predictions):
    """Figures and angles of predictions in a row."""
    return np.array([x for p in predictions for x in (p.figure, *p.angles)])


@pytest.mark.slow
@pytest.mark.sample(1)
@pytest.mark.parametrize('resolution', [97, 360, 1111, 5000])
def test_figures_and_instants_do_not_depend_on_the_grid(resolution):
    _, cycle, link_of = thesis()
    first, again = (
        contact_loss(replace(cycle, resolution=n), link_of(2.54e-4), turns=1.1)
        for n in (cycle.resolution, resolution)
    )
    np.testing.assert_allclose(flat(first), flat(again), rtol=1e-11, atol=1e-12)


def test_a_crank_that_runs_backwards_meets_the_instants_from_the_other_side():
    forth, back = (unit_turn_over_force(ellipse(speed=w), 2.0) for w in (W, -W))
    assert forth.figure == pytest.approx(back.figure, rel=1e-12)
    # The ellipse is its own mirror image.
    np.testing.assert_allclose(gap(forth.angles, -np.array(back.angles)[::-1]), 0.0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.sample(1)
@pytest.mark.parametrize('by', [0.5 * np.pi, 1.0, -2.5])
def test_predictions_do_not_depend_on_the_frame(by):
    _, cycle, link_of = thesis()
    link = link_of(2.54e-4)
    R = np.array([[np.cos(by), -np.sin(by)], [np.sin(by), np.cos(by)]])
    turned = ClearanceLink(
        link.radial,
        lambda p: tuple(np.einsum('ij,jkn,lk->iln', R, x, R) for x in link.inertia(p)),
    )
    here = flat(contact_loss(cycle, link, turns=1.1))
    there = flat(contact_loss(turned_plane(cycle, by), turned, turns=1.1))
    np.testing.assert_allclose(there, here, rtol=1e-9)


def figures(cycle, link):
    return dict(zip(KEYS, (p.figure for p in contact_loss(cycle, link, turns=0.1)), strict=True))


@pytest.mark.slow
def test_a_force_times_a_factor_divides_the_index_by_it():
    k = 3.7
    _, cycle, link_of = thesis()
    strong = replace(cycle, curve=lambda p, d: k * cycle.curve(p, d))
    one, more = figures(cycle, link_of(1e-4)), figures(strong, link_of(1e-4))
    assert more['small'] == pytest.approx(one['small'], rel=1e-11)
    assert more['polar'] == pytest.approx(one['polar'], rel=1e-11)
    for key in ('turn over least', 'unit turn', 'lagging link'):
        assert more[key] == pytest.approx(one[key] / k, rel=1e-11), key


def test_the_same_force_met_faster_multiplies_index_and_lag():
    """The index goes with the speed, the lag with its square."""
    k = 1.9
    _, cycle, link_of = thesis()
    fast = ForceCycle.resolved(lambda p: cycle.curve(p, 0), k * SPEED)
    one, more = figures(cycle, link_of(1e-4)), figures(fast, link_of(1e-4))
    for key in ('turn over least', 'unit turn'):
        assert more[key] == pytest.approx(k * one[key], rel=1e-9), key
    assert more['lagging link'] == pytest.approx(k * k * one['lagging link'], rel=1e-9)


@pytest.mark.slow
def test_where_inertia_rules_speed_lowers_the_index_and_leaves_the_lag():
    """Forces go with the square of the speed: the index falls like 1/speed, the lag stays."""
    k = 2.0
    (_, slow, link_of), (_, fast, _) = thesis(gravity=False), thesis(k * SPEED, gravity=False)
    one, more = figures(slow, link_of(1e-4)), figures(fast, link_of(1e-4))
    for key in ('turn over least', 'unit turn'):
        assert more[key] == pytest.approx(one[key] / k, rel=1e-9), key
    for key in ('small', 'polar', 'lagging link'):
        assert more[key] == pytest.approx(one[key], rel=1e-9), key
    runs = [follow(cycle, link_of(1e-4), turns=1.0) for cycle in (slow, fast)]
    assert runs[0].turned == pytest.approx(runs[1].turned, rel=1e-7)


def test_the_lag_goes_with_the_clearance():
    _, cycle, link_of = thesis()
    lags = [lagging_link(cycle, link_of(c)).figure for c in (1e-5, 1e-4)]
    assert lags[1] == pytest.approx(10.0 * lags[0], rel=1e-10)


# --- beside what really happens ---------------------------------------------------------------

#: Speed [rpm], radial clearance [m]; which criteria predict a loss (order of KEYS); first loss of
#: a seated start in three turns: turns until then, crank angle [deg], and the distance [deg] from
#: there to the nearest instant of Grant and Fawcett; None where contact is kept.
REALITY = [
    (150.0, 2.54e-4, '..ii..i', 1.99122, 356.84, 52.4),
    (250.0, 2.54e-4, '..ii.ii', 1.20725, 74.61, 124.4),
    (300.0, 2.54e-4, '..ii.ii', 1.21596, 77.74, 37.5),
    (350.0, 2.54e-4, '..ii.ii', 1.03582, 12.90, 31.0),
    (450.0, 2.54e-4, 'i.ii.ii', 0.94392, 339.81, 22.0),
    (350.0, 2.54e-5, '..ii.ii', 1.90153, 324.55, 9.9),
    (150.0, 1.016e-4, '..ii...', None, None, None),
    (150.0, 2.54e-5, '..ii...', None, None, None),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ('rpm', 'radial', 'predicted', 'turns', 'degrees', 'away'),
    [
        row if k == 3 else pytest.param(*row, marks=pytest.mark.slow)
        for k, row in enumerate(REALITY)
    ],
)
def test_criteria_beside_the_machine(rpm, radial, predicted, turns, degrees, away):
    speed = f'{rpm} rpm'
    _, cycle, link_of = thesis(speed)
    found = contact_loss(cycle, link_of(radial))
    assert ''.join('i' if p.predicts_loss else '.' for p in found) == predicted

    overrides = {'drive.speed': speed, RADIAL: radial}
    machine = ms.load_scene('four_bar_clearance', overrides)
    solution = ms.simulate(machine, revolutions=3)
    lost = [
        change.t / machine.drive.period
        for change in solution.modes
        if change.mode is Mode.FREE_FLIGHT
    ]
    if turns is None:
        assert not lost
        return
    assert lost[0] == pytest.approx(turns, abs=1e-5)
    assert 360.0 * (lost[0] % 1.0) == pytest.approx(degrees, abs=0.01)
    instants = np.array(found[KEYS.index('unit turn')].angles)
    assert np.degrees(gap(instants, TURN * lost[0]).min()) == pytest.approx(away, abs=0.05)
    # The pendulum alone tells when: its equations are those of the machine for small clearance.
    assert gap(found[-1].angles[0], TURN * lost[0]) < np.radians(0.6)


@pytest.mark.parametrize(
    ('rpm', 'radial', 'within'),
    [
        pytest.param(150, 2.54e-4, 3e-4, marks=pytest.mark.slow),
        (350, 2.54e-4, 2e-4),
        pytest.param(350, 2.54e-5, 2e-4, marks=pytest.mark.slow),
    ],
)
def test_the_pendulum_lets_go_in_the_same_turn_as_the_machine(rpm, radial, within):
    """Without the changing inertia of the links (H) it would not, at any clearance."""
    speed = f'{rpm} rpm'
    _, cycle, link_of = thesis(speed)
    machine = ms.load_scene('four_bar_clearance', {'drive.speed': speed, RADIAL: radial})
    solution = ms.simulate(machine, revolutions=2)
    lost = next(c.t for c in solution.modes if c.mode is Mode.FREE_FLIGHT) / machine.drive.period
    link = link_of(radial)
    assert follow(cycle, link, turns=2.0).turned / TURN == pytest.approx(lost, abs=within)
    if lost > 1.5:
        plain = ClearanceLink(radial, lambda p: (link.inertia(p)[0], 0.0 * link.inertia(p)[1]))
        assert follow(cycle, plain, turns=2.0).turned is None


@pytest.mark.slow
def test_a_free_link_depends_on_where_it_starts():
    _, cycle, link_of = thesis('350 rpm')
    runs = {start: free_link(cycle, link_of(2.54e-4), start=start) for start in (0.0, 2.0, 4.0)}
    assert all(run.predicts_loss for run in runs.values())
    assert len({round(run.angles[0], 3) for run in runs.values()}) == 3


TURNED_MASSES = {'links.coupler.cog': ['185 mm', '60 mm'], 'links.rocker.cog': ['134 mm', '70 mm']}


def load(**keys):
    return {'loads.l': {'at': 'rocker', **keys}}


@pytest.mark.parametrize(
    ('overrides', 'turns', 'within'),
    [
        pytest.param(TURNED_MASSES, 1.0, 1e-3, id='centres of gravity off the axes'),
        pytest.param(load(torque='-0.03*rocker_rate'), 1.3, 4e-4, id='linear damper'),
        pytest.param(
            load(torque='-0.001*rocker_rate**3'), 2.0, 5e-4, id='cubic', marks=pytest.mark.slow
        ),
    ],
)
def test_masses_off_the_axes_and_dampers_are_those_of_the_machine(overrides, turns, within):
    (found,) = losses(ms.load_scene('four_bar_clearance', overrides), turns)
    link = found.predictions[-1]
    assert link.criterion == 'free link'
    assert gap(link.angles[0], TURN * found.turns[0]) < TURN * within


@pytest.mark.slow
def test_a_damper_that_keeps_contact_is_known_to_the_pendulum():
    damped = ms.load_scene('four_bar_clearance', load(torque='-0.05*rocker_rate'))
    (found,) = losses(damped, 1.5)
    assert not found.turns
    assert not found.predictions[-1].predicts_loss
    assert found.predictions[-1].figure > 0.0


WRITTEN_OUT = """
links:
  lever: {length: 312 mm, cog: 134 mm, mass: 0.2334 kg, inertia: 3176 kg mm^2}
  ground: {points: {pivot: [387 mm, 0 mm]}}
  bar: {length: 309 mm, cog: 185 mm, mass: 0.2439 kg, inertia: 2950 kg mm^2}
  crank: {length: 64 mm, cog: 9 mm, mass: 0.6095 kg, inertia: 2645 kg mm^2}
joints:
  d: {revolute: [ground.pivot, lever]}
  c: {revolute: [lever.end, bar.end], clearance: {radial: 0.254 mm, restitution: 0.5}}
  b: {revolute: [bar, crank.end]}
  a: {revolute: [ground, crank]}
guess: {bar: 60 deg, lever: 110 deg}
gravity: [0 m/s^2, -9.8145 m/s^2]
drive: {speed: 36.6519 rad/s}
start: seated
loads: {l: {at: lever, torque: -0.01*lever_rate}}
"""


@pytest.mark.slow
def test_a_four_bar_has_its_criteria_in_whatever_order_it_is_written():
    """Links with other names, coordinates, joints and ends of joints in another order."""
    (short,) = losses(ms.load_scene('four_bar_clearance', load(torque='-0.01*rocker_rate')), 0.1)
    (written,) = losses(made(WRITTEN_OUT), 0.1)
    assert [p.criterion for p in written.predictions] == [p.criterion for p in short.predictions]
    np.testing.assert_allclose(flat(written.predictions), flat(short.predictions), rtol=1e-9)


# --- refusals ---------------------------------------------------------------------------------


STEPS = 'is not a smooth function of the crank angle that repeats with every turn; of loads.l'


@pytest.mark.parametrize(
    ('overrides', 'says'),
    [
        (load(torque='0.5*sin(31*t)'), 'those of loads.l do not: they depend on time'),
        (
            {'states.p': {'rate': '1-p', 'start': 0.0}} | load(torque='0.1*p'),
            'they depend on states',
        ),
        (load(torque='0.5*sin(0.8458*crank)'), STEPS),
        (load(torque='-0.2*sign(rocker_rate)'), STEPS),
        (
            load(torque='1 N m', during={'coordinate': 'crank', 'from': '30 deg', 'to': '1 rad'}),
            STEPS,
        ),
        ({'links.crank.length': '280 mm'}, 'need a crank that makes full turns'),
    ],
)
def test_forces_that_are_no_function_of_the_crank_angle_end_with_one_sentence(overrides, says):
    with pytest.raises(InputError, match=f'^four_bar_clearance: criteria .*{says}'):
        losses(ms.load_scene('four_bar_clearance', overrides), 0.1)


@pytest.mark.parametrize(
    ('make', 'says'),
    [
        (lambda: field(lambda p: np.abs(np.sin(p - 1.0)), np.cos), 'smooth'),
        (lambda: field(lambda p: p, np.cos), 'smooth'),
        (lambda: field(lambda p: np.nan * p, np.cos), 'finite'),
        (lambda: field(np.sin, np.cos, 0.0), 'must turn'),
        (lambda: small_force(constant(0.0)), 'no force'),
        (
            lambda: follow(field(np.sin, np.sin), mass_point(1e-3, 1.0)),
            'direction at 0 rad',
        ),
    ],
)
def test_what_cannot_be_judged_is_refused(make, says):
    with pytest.raises(ValueError, match=says):
        make()
