"""Derivatives of every kind of machine against differences of its own runs.

Differences of runs in double precision know fewer digits than the derivatives: a disagreement
counts beyond 1e-8 of the largest, and beyond what extrapolation says that they may be off.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from test.builders import PLAY, ROUGH

TWO_LOOSE = {
    'joints.crank_coupler.clearance': {'radial': 2e-4, 'restitution': 0.6},
    f'{PLAY}.restitution': 0.6,
    'start': 'centred',
}
SOFT = {f'{PLAY}.contact': {'law': 'hunt_crossley', 'stiffness': 1e8}}
FILM = {f'{PLAY}.contact': {'law': 'film', 'viscosity': 0.05, 'width': 0.02, 'radius': 0.008}}
CASES: dict[str, tuple[str, dict[str, Any], float, list[str]]] = {
    'slides and sticks': ('four_bar_clearance', ROUGH, 0.03, [f'{PLAY}.friction', 'drive.speed']),
    'follows': ('four_bar_clearance', {}, 0.15, ['links.coupler.length', f'{PLAY}.radial']),
    'several loose joints': (
        'four_bar_clearance', TWO_LOOSE, 0.012,
        ['joints.crank_coupler.clearance.radial', 'links.rocker.mass'],
    ),
    'compliant': ('four_bar_clearance', SOFT, 0.185, ['links.coupler.mass', f'{PLAY}.radial']),
    'film': ('four_bar_clearance', FILM, 0.05, [f'{PLAY}.contact.viscosity', 'drive.speed']),
    'cam': ('oscillating_roller', {}, 0.3, ['links.arm.length', 'drive.motor.stall_torque']),
    'gears': ('gear_four_bar', {}, 0.1, ['links.rocker.mass', 'drive.speed']),
    'elastic link': ('elastic_slider_crank', {}, 0.02, ['links.rod.elastic.density']),
    'table of a load': ('slider_crank_engine', {}, 0.1, ['links.crank.length', 'drive.speed']),
    'motor': ('four_bar_governed', {}, 0.4, ['drive.torque.per_speed', 'links.coupler.length']),
    'ideal': ('four_bar_nominal', {}, 0.1, ['links.coupler.length', 'drive.speed']),
    'released': ('catapult', {}, 0.11, ['springs.main.free_length', 'links.arm.mass']),
    'first-order states': ('hydraulic_arm', {}, 0.5, ['states.pushing.start', 'links.arm.cog']),
}  # fmt: skip
QUICK = {'follows', 'ideal', 'motor'}
SLOW = pytest.mark.slow


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    'name', [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in CASES]
)
def test_derivatives_are_those_of_runs(name: str) -> None:
    scene, overrides, end, paths = CASES[name]
    machine = ms.load_scene(scene, overrides)
    run = ms.simulate(machine, duration=end, derivatives=paths)
    times, names = np.array([0.4, 0.8, 1.0]) * end, machine.physics.coordinates
    columns = [f'{kind}.{c}' for kind in ('position', 'velocity') for c in names]

    def seen(other: ms.Solution) -> np.ndarray:
        found = other.sample(times, *columns)
        return np.array([found[c] for c in columns])

    for path in paths:
        known = run.derivatives[path]
        assert not any(limit.ends for limit in known.limits)
        content = machine.scene.to_document()

        def at(x: float, path: str = path, content: Any = content) -> np.ndarray:
            other = ms.load_scene(machine, {path: _text(content, path, _at(content, path) + x)})
            return seen(ms.simulate(other, duration=end))

        wanted, error = _extrapolated(at, 2e-4 * abs(_at(content, path)))
        own = known.sample(times, *columns)
        off = np.abs(np.array([own[c] for c in columns]) - wanted)
        for kind in (slice(0, len(names)), slice(len(names), None)):  # rates are larger
            size = np.abs(wanted[kind]).max()
            assert off[kind].max() <= max(1e-8 * size, 8.0 * error[kind].max()), (path, kind)
            assert error[kind].max() <= 1e-5 * size or size < 1e-12


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('scene', 'overrides', 'path', 'digits'),
    [
        ('four_bar_clearance', {}, 'links.rocker.length', 1e-6),
        ('watched_compressor', {}, 'links.rod.length', 3e-6),
        ('four_bar_misaligned', {}, 'links.coupler.length', 1e-5),
        ('four_bar_clearance', FILM, 'links.coupler.length', 1e-5),
        pytest.param('four_bar_clearance', {}, 'links.ground.length', 3e-5, marks=SLOW),
        pytest.param('toggle_press', {}, 'links.lower.length', 1e-4, marks=SLOW),
    ],
)
def test_forces_in_closed_bearings_have_the_derivatives_of_runs(scene, overrides, path, digits):
    # under the motion as it was, a length that is changed opens the bearing, or closes it more:
    # steps of it that are not small beside the clearance gave forces fifty times too large
    machine = ms.load_scene(scene, overrides)
    first = next((i.t for i in ms.simulate(machine, duration=0.02).impacts), 0.02)
    end, content = 0.9 * first, machine.scene.to_document()
    run = ms.simulate(machine, duration=end, derivatives=[path])
    times, joint = np.array([0.2, 0.5, 0.9]) * end, next(iter(machine.plan.clearances), '')
    beside = 'energy.drive_work', 'reaction.coupler_rocker.x', f'normal_force.{joint}'
    asked = 'drive_torque', *beside, f'gap.{joint}'
    names = [n for n in asked if n in run.catalogue]

    def at(x: float) -> np.ndarray:
        other = ms.load_scene(machine, {path: _text(content, path, _at(content, path) + x)})
        found = ms.simulate(other, duration=end).sample(times, *names)
        return np.array([found[n] for n in names])

    wanted, error = _extrapolated(at, 2e-4 * abs(_at(content, path)))
    found = run.derivatives[path].sample(times, *names)
    own = np.array([found[n] for n in names])
    size = np.abs(wanted).max(axis=1)
    off = np.abs(own - wanted).max(axis=1)
    for n, x, bound in zip(names, off, digits * size + 8.0 * error.max(axis=1), strict=True):
        assert x <= (1e-7 if n.startswith('gap') else bound), n  # a closed gap stays closed


def _at(content: Any, path: str) -> float:
    for part in path.split('.'):
        content = content[part]
    return float(content[0] if isinstance(content, tuple) else content)


def _text(content: Any, path: str, value: float) -> Any:
    for part in path.split('.'):
        content = content[part]
    return f'{value!r} {content[1]}' if isinstance(content, tuple) else value


def _extrapolated(f: Any, h: float, levels: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Derivative by differences of halved steps (C. J. F. Ridders, 1982), and its error."""
    rows: list[list[np.ndarray]] = []
    for i in range(levels):
        rows.append([(f(h) - f(-h)) / (2.0 * h)])
        for j in range(i):
            rows[i].append((4.0 ** (j + 1) * rows[i][j] - rows[i - 1][j]) / (4.0 ** (j + 1) - 1.0))
        h /= 2.0
    best = rows[-1][-1], np.full_like(rows[-1][-1], np.inf)
    for i in range(1, levels):
        for j in range(1, i + 1):
            error = np.maximum(
                np.abs(rows[i][j] - rows[i][j - 1]), np.abs(rows[i][j] - rows[i - 1][j - 1])
            )
            better = error < best[1]
            best = np.where(better, rows[i][j], best[0]), np.where(better, error, best[1])
    return best


def test_measures_have_the_derivatives_of_runs() -> None:
    texts = ['largest(reaction.coupler_rocker)', 'mean(velocity.rocker)', 'integral(drive_power)']
    run = ms.simulate('four_bar_clearance', duration=0.17, derivatives=['links.coupler.mass'])
    found = ms.measure('four_bar_clearance', run, *texts)

    def measured(x: float) -> np.ndarray:
        other = ms.load_scene('four_bar_clearance', {'links.coupler.mass': 0.2439 + x})
        return np.array(
            [m.value for m in ms.measure(other, ms.simulate(other, duration=0.17), *texts)]
        )

    wanted, error = _extrapolated(measured, 1e-4)
    own = np.array([m.derivatives['links.coupler.mass'] for m in found])
    assert (np.abs(own - wanted) <= np.maximum(1e-7 * np.abs(wanted), 8.0 * error)).all()


def test_energies_count_impacts_as_they_move() -> None:
    run = ms.simulate('four_bar_clearance', duration=0.19, derivatives=['drive.speed'])
    names = 'energy.drive_work', 'energy.dissipated', 'energy.kinetic', 'energy.potential'
    slopes = run.derivatives['drive.speed'].sample(0.188, *names)
    begun = run.derivatives['drive.speed'].sample(0.0, *names)
    work, lost, kinetic, potential = (float(slopes[n][0] - begun[n][0]) for n in names)
    assert work - lost == pytest.approx(kinetic + potential, rel=1e-7)


@pytest.mark.parametrize(
    ('scene', 'path', 'words'),
    [
        ('four_bar_clearance', 'drive.sped', "did you mean 'drive.speed'"),
        ('four_bar_clearance', 'branch', 'is not a number of the scene'),
        ('four_bar_clearance', f'{PLAY}.friction', 'values beside it are refused'),
        (
            'four_bar_clearance',
            'solver.rtol',
            'is not a number of the scene that its motion depends',
        ),
        ('four_bar_clearance', 'initial.velocity.roker', "mean 'initial.velocity.rocker'"),
        ('four_bar_clearance', 'initial.position.rocker', 'puts the pin of coupler_rocker'),
        ('four_bar_clearance', 'links.coupler', "several values.*as 'links.coupler.length'"),
        ('pendulum', 'gravity', "holds several values: give the path of a number, as 'gravity.0'"),
        ('gear_pair', 'gears.pinion.teeth', 'is a whole number'),
        ('punch', 'loads.work.force', 'is no number'),  # but a formula
        ('gear_pair', 'gears.pinion.module', 'pinion and wheel do not mesh'),
    ],
)
def test_paths_without_a_derivative_are_refused(scene: str, path: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        ms.simulate(scene, duration=0.01, derivatives=[path])


def test_numbers_of_lists_have_derivatives() -> None:
    """Of a pendulum let go: its angle goes by ``-m g s cos(q) t^2/(2 I)``."""
    paths = ['gravity.y', 'gravity.1']
    run = ms.simulate('pendulum', duration=0.01, derivatives=paths)
    slope, same = (run.derivatives[path].final['bar']['position'] for path in paths)
    assert slope == same
    inertia = 0.1 + 1.2 * 0.5**2
    wanted = 1.2 * 0.5 * np.cos(np.radians(-30.0)) / inertia * 0.5 * 0.01**2
    assert slope == pytest.approx(wanted, rel=1e-3)


def test_a_start_angle_that_no_scene_gives_is_a_key() -> None:
    """Of an ideal machine at a constant speed it is as good as a time: ``dx/da = v/w``."""
    path, t = 'drive.start_angle', np.linspace(0.0, 0.01, 5)
    run = ms.simulate('slider_crank', duration=0.01, derivatives=[path])
    slope = run.derivatives[path].sample(t, 'position.piston')['position.piston']
    v = run.sample(t, 'velocity.piston', 'velocity.crank')
    wanted = v['velocity.piston'] / v['velocity.crank']
    assert np.abs(slope - wanted).max() < 1e-9 * np.abs(wanted).max()


def test_a_push_on_a_closed_contact_ends_in_a_chatter_as_short_as_it_is_small() -> None:
    """Its derivative is that of a plastic blow, whatever the restitution."""
    path = 'initial.velocity.rocker'
    run = ms.simulate('four_bar_clearance', duration=0.1, derivatives=[path, 'drive.speed'])
    known = run.derivatives[path]
    assert [(x.t, x.where, x.ends) for x in known.limits] == [(0.0, 'coupler_rocker', False)]
    assert not run.derivatives['drive.speed'].limits
    start = run.sample(0.0, 'velocity.rocker')['velocity.rocker'][0]
    names = ['velocity.coupler', 'velocity.rocker']
    own = np.array([known.sample(0.1, n)[n][0] for n in names])
    for push in (1e-5, -1e-5):
        other = ms.simulate(
            ms.load_scene('four_bar_clearance', {path: start + push}), duration=0.1
        )
        assert other.impacts
        moved = [(other.sample(0.1, n)[n][0] - run.sample(0.1, n)[n][0]) / push for n in names]
        assert np.abs(own - moved).max() < 1e-5 * np.abs(own).max()


def test_a_chatter_that_is_ended_is_named_with_its_instant_and_joint() -> None:
    run = ms.simulate('four_bar_clearance', duration=0.19, derivatives=['drive.speed'])
    limits = run.derivatives['drive.speed'].limits
    ended = [i for i in run.impacts if i.ends_chatter]
    assert [(x.t, x.where) for x in limits] == [(i.t, i.joint) for i in ended]
    assert not any(x.ends for x in limits)
