"""Derivatives through impacts against differences in 80 bits of equations of their own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import mechanism_sim as ms
from test.builders import PLAY
from test.routes.long_double import F, LooseFourBar

PATHS = {
    'radial': f'{PLAY}.radial',
    'restitution': f'{PLAY}.restitution',
    'friction': f'{PLAY}.friction',
    'speed': 'drive.speed',
    'coupler_mass': 'links.coupler.mass',
    'coupler': 'links.coupler.length',
    'rocker_inertia': 'links.rocker.inertia',
}
SMOOTH = LooseFourBar(restitution=F('0.9'))
ROUGH = LooseFourBar(restitution=F('0.8'), friction=F('0.2'), pin_radius=F('0.006'))
END = {'smooth': '0.02834', 'rough': '0.0179'}
"""[s] Between the 20th impact and the next."""


def _scene(known: LooseFourBar) -> ms.Machine:
    return ms.load_scene(
        'four_bar_clearance',
        {
            f'{PLAY}.restitution': float(known.restitution),
            f'{PLAY}.friction': float(known.friction),
            f'{PLAY}.pin_radius': float(known.pin_radius),
            'start': 'centred',
        },
    )


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ('kind', 'names'),
    [
        ('smooth', ['radial', 'coupler']),
        ('rough', ['friction', 'restitution']),
        pytest.param('smooth', list(PATHS), marks=pytest.mark.slow),
        pytest.param('rough', list(PATHS), marks=pytest.mark.slow),
    ],
)
def test_twenty_impacts_have_the_derivatives_of_80_bits(kind: str, names: list[str]) -> None:
    known = {'smooth': SMOOTH, 'rough': ROUGH}[kind]
    names = [n for n in names if getattr(known, n)]
    end = F(END[kind])
    run = ms.simulate(_scene(known), duration=float(end), derivatives=[PATHS[n] for n in names])
    assert len(run.impacts) == 20
    for name in names:
        wanted = known.slope(name, 20, end, F('1e-5')).astype(float)
        found = run.derivatives[PATHS[name]]
        final = found.final
        parts = (
            (found.impacts['t'], wanted[:20]),
            (found.impacts['normal_impulse'], wanted[20:40]),
            ([final[c]['position'] for c in ('coupler', 'rocker')], wanted[40:42]),
            ([final[c]['velocity'] for c in ('coupler', 'rocker')], wanted[42:]),
        )
        for own, other in parts:
            assert np.abs(own - other).max() < 1e-8 * np.abs(other).max(), name
        assert not found.limits


@pytest.mark.parametrize('off', [10.0, 1e-2, 1e-5])
def test_a_nearly_grazing_stop_has_the_derivative_of_the_energy(off: float) -> None:
    """A pendulum let go at -30 deg would turn back at -150 deg: the stop is a little before it."""
    stop = float(np.radians(-150.0 + off))
    stops = {'lower': stop, 'restitution': 0.5}
    machine = ms.load_scene('pendulum', {'joints.ground_bar.stops': stops})
    path = 'joints.ground_bar.stops.lower'
    run = ms.simulate(machine, duration=1.0, derivatives=[path])
    weight, inertia = 1.2 * 9.81 * 0.5, 0.1 + 1.2 * 0.5**2
    speed = np.sqrt(2.0 * weight * (np.sin(np.radians(-30.0)) - np.sin(stop)) / inertia)
    assert run.impacts[0].approach_speed == pytest.approx(speed, rel=1e-6)
    slope = run.derivatives[path].impacts['approach_speed'][0]
    assert slope == pytest.approx(-weight * np.cos(stop) / (inertia * speed), rel=1e-6)


def test_a_stop_that_is_only_touched_has_no_derivative() -> None:
    stops = {'lower': -150.0 * np.pi / 180.0, 'restitution': 0.5}
    machine = ms.load_scene('pendulum', {'joints.ground_bar.stops': stops})
    path = 'joints.ground_bar.stops.lower'
    run = ms.simulate(machine, duration=1.2, derivatives=[path])
    known = run.derivatives[path]
    if run.impacts:  # whether it is, rounding decides
        assert known.end is not None
        assert known.end.where == 'ground_bar_lower'
        assert known.end.t == pytest.approx(run.impacts[0].t)
        assert np.isnan(known.final['bar']['velocity'])


TWO = """
title: Two bars that strike their stops at one instant
mechanism: linkage
links:
  ground: {points: {other: [1 m, 0 m]}}
  a: {length: 1 m, cog: 500 mm, mass: 1.2 kg, inertia: 0.1 kg m^2}
  b: {length: 1 m, cog: 500 mm, mass: 1.2 kg, inertia: 0.1 kg m^2}
joints:
  pa: {revolute: [ground, a], stops: {lower: -140 deg, restitution: 0.5}}
  pb: {revolute: [ground.other, b], stops: {lower: -140 deg, restitution: 0.5}}
gravity: [0 m/s^2, -9.81 m/s^2]
initial: {position: {a: -30 deg, b: -30 deg}}
duration: 1 s
"""


def test_impacts_at_one_instant_that_do_not_feel_each_other_have_their_own_derivatives() -> None:
    paths = ['links.b.cog', 'joints.pa.stops.lower']
    run = ms.simulate(TWO, duration=1.0, derivatives=paths)
    alone = {'a': run.derivatives[paths[1]], 'b': run.derivatives[paths[0]]}
    assert run.impacts[0].t == run.impacts[1].t
    for own, other in ('ab', 'ba'):
        assert not alone[own].limits
        assert alone[own].final[other] == {'position': 0.0, 'velocity': 0.0}
    # the same bar alone, whose only impact is that one
    text = TWO.replace('initial: {position: {a: -30 deg, ', 'initial: {position: {')
    single = ms.load_scene(
        text.replace('  a: {l', '  c: {l').replace('[ground, a]', '[ground, c]')
    )
    by_itself = ms.simulate(single, duration=1.0, derivatives=['links.b.cog'])
    final = by_itself.derivatives['links.b.cog'].final['b']
    assert alone['b'].final['b'] == pytest.approx(final, rel=1e-9)


@pytest.mark.slow
def test_impacts_at_one_instant_whose_order_matters_end_the_derivatives() -> None:
    joined = TWO.replace(
        '  pb:', '  ac: {revolute: [a.end, c]}\n  cb: {revolute: [c.end, b.end]}\n  pb:'
    )
    joined = joined.replace(
        '  b: {l', '  c: {length: 1 m, mass: 0.5 kg, inertia: 0.05, cog: 0.5}\n  b: {l'
    )
    run = ms.simulate(joined, duration=1.0, derivatives=['joints.pa.stops.lower'])
    end = run.derivatives['joints.pa.stops.lower'].end
    assert end is not None
    assert end.t == pytest.approx(run.impacts[0].t)
    assert 'order changes' in end.text


@pytest.mark.slow
@pytest.mark.parametrize('more', [{}, {'friction': 0.2, 'pin_radius': '6 mm'}])
def test_impacts_while_ideal_joints_rub_have_the_derivatives_of_runs(more: dict[str, Any]) -> None:
    clearance = {'radial': 1e-4, 'restitution': 0.6} | more
    loose = {'revolute': ['rod.end', 'piston'], 'clearance': clearance}
    machine = ms.load_scene('rubbing_compressor', {'joints.rod_piston': loose})
    end = 0.02711
    path, value, h = 'drive.speed', 20.0 * np.pi, 2e-3
    run = ms.simulate(machine, duration=end, derivatives=[path])
    names = [f'{kind}.{c}' for kind in ('position', 'velocity') for c in ('rod', 'piston')]

    def seen(speed: float) -> np.ndarray:
        other = ms.load_scene(machine, {path: f'{speed!r} rad/s'})
        found = ms.simulate(other, duration=end).sample(end, *names)
        return np.array([found[n][0] for n in names])

    first, second = ((seen(value + x) - seen(value - x)) / (2.0 * x) for x in (h, 0.5 * h))
    own = run.derivatives[path].sample(end, *names)
    off = np.array([own[n][0] for n in names]) - (4.0 * second - first) / 3.0
    assert (np.abs(off) < 1e-7 * np.abs(second).max()).all()
    assert more or len(run.impacts) >= 5


def test_compliant_contacts_that_end_a_rounding_late_have_derivatives() -> None:
    """The force of a Hunt and Crossley contact has no value beyond depth zero."""
    soft = {f'{PLAY}.contact': {'law': 'hunt_crossley', 'stiffness': 1e8}}
    machine = ms.load_scene(
        'four_bar_clearance', soft | {f'{PLAY}.restitution': 0.9, 'start': 'centred'}
    )
    run = ms.simulate(machine, duration=0.02, derivatives=['links.coupler.mass'])
    assert len(run.impacts) == 4
    assert run.derivatives['links.coupler.mass'].end is None


def test_a_thousand_turns_from_ten_thousand_away_keep_all_digits() -> None:
    """A flywheel behind a motor goes by ``w + (w0 - w) exp(-c t/J)``, w its last speed."""
    T, inertia, torque, loss, speed = 70.0, 0.02, 2.0, 0.02, 10.0
    scene = f"""
title: A flywheel behind a motor
mechanism: linkage
links:
  wheel: {{length: 100 mm, cog: 0 mm, mass: 1 kg, inertia: {inertia} kg m^2}}
joints:
  shaft: {{revolute: [ground, wheel]}}
gravity: [0, 0]
drive:
  coordinate: wheel
  start_angle: {1e4 * 2.0 * np.pi!r} rad
  speed: {speed} rad/s
  torque: {{constant: {torque} N m, per_speed: {-loss} N m s/rad}}
duration: 1 s
"""
    paths = ['drive.torque.constant', 'drive.speed', 'drive.torque.per_speed']
    run = ms.simulate(scene, duration=T, derivatives=paths)
    turned = run.sample(T, 'position.wheel')['position.wheel'][0] / (2.0 * np.pi)
    assert turned > 11000.0
    rate, last = loss / inertia, torque / loss
    decay = np.exp(-rate * T)
    shares = (1.0 - decay) / rate, 1.0 - decay  # of the speed at the start, and what it loses
    slow, pace = speed - last, T * decay / loss - shares[0] / loss
    wanted = [
        [(T - shares[0]) / loss, shares[1] / loss],
        [shares[0], decay],
        [
            last / loss * (T - shares[0]) - slow * pace,
            last / loss * shares[1] + slow * T / inertia * decay,
        ],
    ]
    for path, (angle, velocity) in zip(paths, wanted, strict=True):
        final = run.derivatives[path].final['wheel']
        assert final['position'] == pytest.approx(angle, rel=1e-10)
        assert final['velocity'] == pytest.approx(velocity, rel=1e-10, abs=1e-20)


def test_loads_a_thousandth_of_a_turn_wide_have_derivatives() -> None:
    """A flywheel that a narrow load brakes once a turn, from edge to edge of the load."""
    width, inertia, load, start, end = F(np.pi * 1e-3), F('0.02'), 10, F(62831.85), F(10)
    edge = float(np.cos(width))
    scene = f"""
title: A flywheel with a narrow load
mechanism: linkage
links:
  wheel: {{length: 100 mm, cog: 0 mm, mass: 1 kg, inertia: 0.02 kg m^2}}
joints:
  shaft: {{revolute: [ground, wheel]}}
gravity: [0, 0]
drive: {{coordinate: wheel, start_angle: 62831.85 rad, speed: 20, torque: {{constant: 0.05}}}}
loads:
  punch: {{at: wheel, torque: "-10*(1 + sign(cos(wheel - 1) - {edge!r}))/2"}}
duration: 1 s
"""
    paths = ['drive.torque.constant', 'drive.speed']
    run = ms.simulate(scene, duration=float(end), derivatives=paths)
    half, turn = np.arccos(F(edge)), 8 * np.arctan(F(1))

    def last(torque: Any, speed: Any) -> np.ndarray:
        q, t, first = start, F(0), np.floor((start - 1) / turn)
        v, ends = (
            speed,
            [1 + (first + n // 2) * turn + half * (2 * (n % 2) - 1) for n in range(400)],
        )
        for n, place in enumerate(ends):
            if place <= q:
                continue
            a = (torque - load * (n % 2)) / inertia
            later = np.sqrt(v * v + 2 * a * (place - q))
            dt = (later - v) / a
            if t + dt >= end:
                dt = end - t
                return np.array([q + v * dt + a * dt * dt / 2, v + a * dt])
            q, t, v = place, t + dt, later
        raise AssertionError

    base = [F(0.05), F(20)]
    for k, path in enumerate(paths):
        h = np.array([F('1e-6') * x * (i == k) for i, x in enumerate(base)])
        wanted = (last(*(base + h)) - last(*(base - h))) / (2 * h[k])
        final = run.derivatives[path].final['wheel']
        found = [final['position'], final['velocity']]
        assert found == pytest.approx(wanted.astype(float).tolist(), rel=1e-10)
