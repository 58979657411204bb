"""The sound of impacts, against the wave equation, quadrature and Hertz' equation of motion."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from running import run
from scipy.integrate import quad, solve_ivp
from scipy.io import wavfile
from scipy.special import spherical_jn, spherical_yn

import mechanism_sim as ms
from mechanism_sim.cli import main
from mechanism_sim.sensing.sound import (
    AIR,
    STEEL,
    Listener,
    Strike,
    contact_time,
    half_sine_response,
    level,
    pressure,
    sphere_modes,
    strikes,
)
from mechanism_sim.studies.plan import Extent
from mechanism_sim.studies.row import SweepTask
from mechanism_sim.studies.runs import compute


def command(*options):
    """Exit code of a command in this process."""
    with pytest.raises(SystemExit) as left:
        main(options)
    return left.value.code


def outgoing(x, derivative=False):
    """Spherical Hankel function of order 1 that travels outwards with ``exp(i w t)``."""
    return spherical_jn(1, x, derivative) - 1j * spherical_yn(1, x, derivative)


@pytest.mark.parametrize('radius', [1e-3, 0.02, 0.3])
@pytest.mark.parametrize('away', [1.01, 3.0, 1000.0])
def test_a_sphere_radiates_as_the_wave_equation_says(radius, away):
    """``p = C h1(k r) cos``; on the surface ``rho acceleration = -dp/dr``."""
    r = away * radius
    (poles,), (residues,) = sphere_modes(np.array([radius]), np.array([r]))
    for f in np.geomspace(1.0, 1e5, 12):
        s = 2j * np.pi * f
        k = 2.0 * np.pi * f / AIR.speed
        ours = np.sum(residues / (s - poles)) * np.exp(-s * (r - radius) / AIR.speed)
        exact = -AIR.density / (k * outgoing(k * radius, True)) * outgoing(k * r)
        assert abs(ours - exact) < 1e-9 * abs(exact)


def test_a_pulse_is_a_convolution_with_half_a_sine():
    (poles,), (residues,) = sphere_modes(np.array([0.02]), np.array([0.5]))
    duration, t = 1e-4, np.array([-1e-5, 0.0, 2e-5, 9.9e-5, 1e-4, 1.3e-4, 4e-4])
    found = half_sine_response(poles, residues, duration, t)
    for time, value in zip(t, found, strict=True):
        wanted, _ = quad(
            lambda x, time=time: (
                (residues * np.exp(poles * (time - x))).sum().real
                * 0.5 * math.pi / duration * math.sin(math.pi * x / duration)
            ),
            0.0, min(max(time, 0.0), duration), epsabs=1e-12, epsrel=1e-12,
        )  # fmt: skip
        assert value == pytest.approx(wanted, rel=1e-10, abs=1e-9 * abs(found).max())


def test_contact_lasts_as_long_as_hertz_says():
    mass, radius, speed = 0.1, 0.008, 0.3
    k = 4.0 / 3.0 * STEEL.modulus / (2.0 * (1.0 - STEEL.poisson**2)) * math.sqrt(radius)
    parted = lambda _, x: x[0] if x[1] < 0.0 else 1.0  # noqa: E731
    parted.terminal = True
    scale = contact_time(mass, radius, speed)
    found = solve_ivp(
        lambda _, x: [x[1], -k * max(x[0], 0.0) ** 1.5 / mass], (0.0, 2.0 * scale), [0.0, speed],
        events=parted, rtol=1e-10, atol=1e-14, max_step=scale / 200.0,
    )  # fmt: skip
    assert scale == pytest.approx(found.t_events[0][0], rel=1e-6)


@pytest.mark.parametrize('angle', [0.0, 0.7, 2.5])
@pytest.mark.parametrize('mass', [(0.4, 0.2), (0.4, 0.0)])
def test_the_impulse_of_pressure_is_that_of_the_flow_around_the_bodies(angle, mass):
    """Bernoulli: its integral is rho times the dipole potentials that remain in the end."""
    jump, listener, rate = (0.3, 0.6), Listener(0.8, 0.2), 1e6
    strike = Strike(0.01, angle, 0.5, 0.13, jump, mass)
    p = pressure([strike], rate, 0.03, listener)
    ear = listener.distance * np.array([math.cos(0.2), math.sin(0.2)])
    normal, wanted = np.array([math.cos(angle), math.sin(angle)]), 0.0
    largest = 0.0
    for sign, v, m in zip((-1.0, 1.0), jump, mass, strict=True):
        a = (0.75 * m / (math.pi * STEEL.density)) ** (1.0 / 3.0)
        away = ear - sign * a * normal
        r = np.linalg.norm(away)
        term = AIR.density * v * a**3 / (2.0 * r**2) * (away @ (sign * normal)) / r
        wanted, largest = wanted + term, max(largest, abs(term))
    assert p.sum() / rate == pytest.approx(wanted, abs=1e-5 * largest)
    first = np.flatnonzero(p)[0] / rate
    assert first == pytest.approx(0.01 + (listener.distance - 0.03) / AIR.speed, abs=1.5e-4)


def test_links_take_their_parts_in_an_impact():
    """The rocker turns about its pivot: ``jump = impulse L^2 sin^2 / I`` along the normal."""
    machine = ms.load_scene('four_bar_clearance', {'start': 'centred'})
    solution = ms.simulate(machine, revolutions=1)
    train = strikes(machine.mechanism, solution.motion, solution.impacts)
    rocker = machine.scene.links['rocker']
    inertia = rocker.inertia + rocker.mass * rocker.cog**2
    assert len(train) == len(solution.impacts) > 10
    for strike, impact in zip(train, solution.impacts, strict=True):
        lever = rocker.length * math.sin(
            impact.normal_angle
            - solution.sample(impact.t, 'position.rocker')['position.rocker'][0]
        )
        assert strike.jump[1] == pytest.approx(
            impact.normal_impulse * lever**2 / inertia, rel=1e-6, abs=1e-9
        )
        assert sum(strike.jump) == pytest.approx(impact.approach_speed + impact.rebound_speed)
        assert all(
            m <= machine.scene.links[n].mass
            for m, n in zip(strike.mass, ('coupler', 'rocker'), strict=True)
        )


def test_what_a_drive_holds_is_silent():
    machine = ms.load_scene('valve_train')
    solution = ms.simulate(machine, duration=0.1)
    train = strikes(machine.mechanism, solution.motion, solution.impacts)
    later = [s for s in train if s.t > 0.0]
    assert later
    assert {s.mass[0] for s in later} == {0.0}
    assert {round(s.mass[1], 9) for s in later} == {machine.scene.links['valve'].mass}


def test_a_recorded_turn_sounds_like_its_scene(tmp_path, capsys):
    scene = ms.load_scene('four_bar_clearance', {'start': 'centred'})
    bag, args = tmp_path / 'bag.mcap', [scene.name, '--set', 'start=centred', '--revolutions', '1']
    compute(SweepTask('', scene.name, scene.scene, Extent(1, None, 0), bag))
    files = tmp_path / 'bag.wav', tmp_path / 'live.wav'
    told = []
    for source, file in zip(([str(bag)], args), files, strict=True):
        assert command('animate', *source, '-o', str(file), '--json') == 0
        told.append(json.loads(capsys.readouterr().out) | {'file': ''})
    assert told[0] == told[1]
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.network
@pytest.mark.slow
def test_a_bag_sounds_like_its_scene(tmp_path, capsys):
    scene = ['four_bar_clearance', '--revolutions', '2']
    bag, live = tmp_path / 'bag.mcap', tmp_path / 'live.wav'
    done = run('run', *scene, '--record', str(bag))
    assert done.returncode == 0, done.stderr

    def sound(*options):
        assert command('animate', *options, '--json') == 0
        return json.loads(capsys.readouterr().out)

    heard = sound(str(bag), '-o', str(tmp_path / 'bag.wav'))
    said = sound(*scene, '-o', str(live))
    assert heard | {'file': ''} == said | {'file': ''}
    assert (tmp_path / 'bag.wav').read_bytes() == live.read_bytes()
    rate, samples = wavfile.read(live)
    assert (rate, samples.dtype, np.abs(samples).max()) == (44100, np.int16, 32767)
    assert said['peak_level'] == pytest.approx(level(said['peak']))
    slow = sound(*scene, '--realtime-factor', '0.25', '-o', str(live))
    period = ms.load_scene(scene[0]).drive.period
    assert slow['duration'] - 0.1 == pytest.approx(8.0 * period, abs=1e-3)
    assert slow['peak'] == pytest.approx(said['peak'], rel=0.1)


@pytest.mark.parametrize(
    ('options', 'said'),
    [
        (['four_bar_nominal'], 'there is no sound: the run has no impacts'),
        (['four_bar_clearance', '-o', 'no/x.wav'], "there is no directory 'no'"),
        (['four_bar_clearance', '--distance', '1'], 'is not a quantity with a unit'),
        (['four_bar_clearance', '--distance', '0 m'], 'must be away from the machine'),
        (['four_bar_clearance', '--distance', '1 mm', '--revolutions', '2'], 'too near'),
        (['four_bar_clearance', '--pulse', '0 s'], 'must last longer than 0 s'),
        (
            ['four_bar_clearance', '--realtime-factor', '0'],
            '--realtime-factor 0: must be more than 0',
        ),
        (['missing.mcap'], 'does not exist'),
        (['x.mcap', '--revolutions', '1'], 'played as it was recorded'),
    ],
)
def test_wrong_requests_are_answered_by_a_sentence(options, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    ending = [] if '-o' in options else ['-o', 'x.wav']
    assert command('animate', *options, *ending) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.strip().count('\n') == 0
