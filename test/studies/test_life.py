"""Lives of bearings by closed forms, and by smaller steps."""

import json
import math

import numpy as np
import pytest
import yaml
from running import run, run_json
from scipy.optimize import brentq

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.studies.life import (
    _ROUNDEST,
    PLACES,
    LifePlan,
    _smooth,
    room_for_pin,
    wear_in,
    worn_scene,
)

PIN, CLEARANCE, WIDTH, WEAR, MASS, GRAVITY = 8e-3, 0.1e-3, 10e-3, 1e-16, 2.0, 9.81
ANGLES = 2.0 * np.pi / PLACES * np.arange(PLACES)


def wheel(speed=2.0, cog=0.0, **wear):
    """A wheel that hangs on a fixed pin and turns: the load goes round in its bushing."""
    given = {'width': WIDTH, 'bushing': WEAR, **wear}
    return {
        'title': 'wheel', 'mechanism': 'linkage',
        'links': {'ground': {'points': {'pin': [0.0, 0.0]}},
                  'wheel': {'mass': MASS, 'inertia': 1e-3, 'cog': cog}},
        'joints': {'axle': {'revolute': ['ground.pin', 'wheel'], 'clearance': {
            'radial': CLEARANCE, 'pin_radius': PIN, 'restitution': 0.0, 'wear': given,
            'profile': {'harmonics': 8}}}},
        'drive': {'coordinate': 'wheel', 'speed': speed}, 'gravity': [0.0, -GRAVITY],
    }  # fmt: skip


@pytest.mark.slow
def test_a_bearing_that_wears_evenly_lasts_as_its_closed_form():
    """``dh/dn = k N (rp + c + h)/(w (rp + c))``: the way grows with the bushing."""
    until = 1.3 * CLEARANCE
    found = ms.life(wheel(), f'clearance > {until} m', cycles=1e12, revolutions=6, skip=1)
    R, rate = PIN + CLEARANCE, WEAR * MASS * GRAVITY / WIDTH
    expected = R / rate * math.log((PIN + until) / R)
    assert found.cycles == pytest.approx(expected, rel=2e-3)
    assert found.low <= expected * (1.0 + 2e-3)
    assert found.high >= expected * (1.0 - 2e-3)
    last = found.stages[-1]
    assert last.clearance[0] == pytest.approx(until, rel=1e-9)
    assert np.ptp(last.depths['axle'][0]) < 0.01 * (until - CLEARANCE)
    assert not last.depths['axle'][1].any()


@pytest.mark.slow
def test_the_end_of_a_life_is_written_as_other_conditions():
    """Either side first, with or without ``=``: those of ``--subject-to`` are."""
    until = 1.02 * CLEARANCE
    texts = f'clearance > {until} m', f'clearance >= {until} m', f'{until} m < clearance'
    how = {'cycles': 1e12, 'revolutions': 2, 'skip': 1}
    found = {ms.life(wheel(), text, **how).cycles for text in texts}
    assert len(found) == 1
    assert found.pop() > 0.0


@pytest.mark.slow
def test_halving_the_steps_changes_a_life_by_less_than_it_says(monkeypatch):
    """An unbalanced wheel, which wears on one side of its bushing."""
    scene, found = wheel(speed=12.0, cog='30 mm'), []
    for growth in (0.3, 0.15):
        monkeypatch.setattr('mechanism_sim.studies.life._GROWTH', growth)
        until = f'clearance > {1.6 * CLEARANCE} m'
        found.append(ms.life(scene, until, cycles=1e12, revolutions=12, skip=2))
    coarse, fine = found
    assert len(fine.stages) > len(coarse.stages)
    assert coarse.low < fine.cycles < coarse.high
    assert coarse.high - coarse.low < 0.1 * coarse.cycles
    assert np.ptp(fine.stages[-1].depths['axle'][0]) > 0.2 * CLEARANCE


@pytest.mark.parametrize(('roundest', 'within'), [(0.0, 2e-3), (_ROUNDEST, 0.02)])
def test_a_pin_under_a_steady_load_sinks_into_its_own_shape(roundest, within):
    """``dQ/dx = 1/(t + sin(2 t)/2)`` for x = k F s/(R w), as wide as it touches, to 2 t.

    The locus is that of a circle of radius c and its tangents from a tip, which is Q away: a
    point of a rigid pin, round of what a run is made with.
    """
    c, rate = CLEARANCE, np.zeros(PLACES)
    rate[40] = PLACES / (2.0 * math.pi)  # all of the load in one direction
    depths, Q, x = np.zeros(PLACES), CLEARANCE, 0.02 * CLEARANCE
    tip = roundest * c
    for _ in range(60):
        depths = room_for_pin(depths + x * rate, c, roundest)
    for _ in range(60 * 400):
        t = math.acos(min(1.0, (c - tip) / (max(Q, 1.0001 * c) - tip)))
        Q += x / 400 / (t + 0.5 * math.sin(2.0 * t))
    assert c + depths.max() == pytest.approx(Q, rel=within)
    near = np.cos(ANGLES - ANGLES[40]) > 0.9
    shape = tip + (c + depths.max() - tip) * np.cos(ANGLES - ANGLES[40])
    assert c + depths[near] == pytest.approx(shape[near], abs=2e-3 * c)


def test_what_a_pin_sinks_over_keeps_the_force():
    """The first harmonic of the depths, in which the force is."""
    sharp = 2.0 * CLEARANCE * np.exp(-(((ANGLES - 2.0) / 0.3) ** 2))
    found = room_for_pin(sharp, CLEARANCE)
    assert np.abs(found - sharp).max() > 0.1 * CLEARANCE
    first = np.exp(1j * ANGLES)
    assert found @ first == pytest.approx(sharp @ first, rel=1e-9)
    assert room_for_pin(found, CLEARANCE) == pytest.approx(found, abs=1e-9 * CLEARANCE)


SMALL = 0.05e-3


def hanging_arm(aside=0.0):
    """An arm of 5 kg on a shaft that turns without friction: its load stays in one place.

    That is opposite to the centre of mass, which is so far [rad] aside of the arm.
    """
    cog = [0.15 * math.cos(aside), 0.15 * math.sin(aside)]
    return {
        'title': 'arm', 'mechanism': 'linkage',
        'links': {'shaft': {'mass': 1.0, 'inertia': 1e-3},
                  'arm': {'length': 0.2, 'mass': 5.0, 'inertia': 0.02, 'cog': cog}},
        'joints': {'pivot': {'revolute': ['ground', 'shaft']},
                   'bush': {'revolute': ['shaft', 'arm'], 'clearance': {
                       'radial': SMALL, 'restitution': 0.3, 'pin_radius': '10 mm', 'friction': 0,
                       'wear': {'width': '20 mm', 'bushing': 1e-15}}}},
        'gravity': [0.0, -GRAVITY], 'drive': {'coordinate': 'shaft', 'speed': '300 1/min'},
        'guess': {'arm': '-90 deg'},
    }  # fmt: skip


def depth_of_rigid_pin(cycles):
    """Depth d [m] of the arm's bushing: ``(c + d) (t + sin(2 t)/2) - 2 c sin(t) = k W s/(R b)``.

    That is the integral of ``h cos(phi)``, by which the pressure of Archard's law bears the
    weight, over the arc where ``h = (c + d) cos(phi) - c`` is positive, ``cos(t) = c/(c + d)``.
    """
    worn = 1e-15 * 5.0 * GRAVITY * 2.0 * math.pi * 10e-3 * cycles / ((10e-3 + SMALL) * 20e-3)

    def beyond(d):
        t = math.acos(SMALL / (SMALL + d))
        return (SMALL + d) * (t + 0.5 * math.sin(2.0 * t)) - 2.0 * SMALL * math.sin(t) - worn

    return float(brentq(beyond, 1e-12, 1e-3))


@pytest.mark.slow
def test_a_rigid_pin_sinks_under_a_constant_load_as_its_closed_form():
    """Every depth, and the life, within what is said of them, which is little."""
    until = 12e-6
    found = ms.life(hanging_arm(), f'depth > {until} m', revolutions=2, skip=3)
    for stage in found.stages[1:]:
        d, doubt = depth_of_rigid_pin(stage.cycles), float((stage.error + stage.scatter)[0])
        assert stage.depths['bush'][0].max() == pytest.approx(d, abs=doubt)
        assert doubt < 5e-4 * SMALL
    assert found.stages[-1].depths['bush'][0].argmax() == PLACES // 2
    cycles = brentq(lambda n: depth_of_rigid_pin(n) - until, 1e3, 1e7)
    assert found.cycles == pytest.approx(cycles, rel=1e-3)
    assert found.low < cycles < found.high
    assert ms.load_scene(found.scene(found.stages[-1])).scene.joints['bush'].clearance.profile


@pytest.mark.sample(2)
@pytest.mark.parametrize('aside', [0.0, 0.024])
@pytest.mark.parametrize('depth', [0.0, 3.4e-6])
def test_wear_bears_the_load_where_it_points(aside, depth):
    """Its first harmonic is ``k W s/(R b)`` opposite to the weight, in a groove, too."""
    machine, plan = ms.load_scene(hanging_arm(aside)), LifePlan(revolutions=1, skip=6)
    groove = np.maximum((SMALL + depth) * np.cos(ANGLES - math.pi - aside) - SMALL, 0.0)
    rounded = room_for_pin(groove, SMALL, _ROUNDEST)
    depths = {'bush': np.array([rounded, 0.0 * groove])}
    content = worn_scene(machine.scene.to_document(), depths)
    bushing = np.array(wear_in('arm', content, ('bush',), plan, [])['depths']['bush'][0])
    first = bushing @ np.exp(1j * ANGLES) * ANGLES[1]
    worn = 1e-15 * 5.0 * GRAVITY * 2.0 * math.pi * 10e-3 / ((10e-3 + SMALL) * 20e-3)
    assert first * np.exp(-1j * (math.pi + aside)) == pytest.approx(worn, rel=5e-4)


def test_turns_that_scatter_are_smoothed_and_others_are_not():
    """A force in one place stays there; of scattered ones the volume and the force are kept."""
    one = np.zeros((8, PLACES))
    one[:, 40] = 1.0
    mean, error = _smooth(one, 16)
    assert mean == pytest.approx(one[0], abs=1e-12)
    assert error == pytest.approx(0.0, abs=1e-12)
    chances = np.exp(-(((ANGLES - 2.0) / 0.5) ** 2))
    many = np.random.default_rng(5).poisson(3.0 * chances, (8, PLACES)).astype(float)
    mean, error = _smooth(many, 16)
    assert np.abs(mean - 3.0 * chances).max() < 0.5 < np.abs(many.mean(axis=0) - mean).max()
    assert mean.sum() == pytest.approx(many.sum() / 8.0)
    first = np.exp(1j * ANGLES)
    assert mean @ first == pytest.approx(many.mean(axis=0) @ first, rel=3e-3)
    assert mean.min() >= 0.0 < error.max()


@pytest.mark.slow
def test_a_journal_goes_on_with_another_limit(tmp_path):
    """As afresh, with the runs of the same depths from the journal: here that of the new one."""
    table = tmp_path / 'life.csv'
    how = {'cycles': 1e12, 'revolutions': 2, 'skip': 0}
    journal, afresh = tmp_path / 'life.csv.journal', {}
    for limit, tolerance in ((1.01, 0.02), (1.1, 0.02), (1.1, 0.01), (1.01, 0.02)):
        given = {**how, 'tolerance': tolerance}
        lines = len(journal.read_text().splitlines()) - 1 if journal.exists() else 0
        found = ms.life(wheel(), f'clearance > {limit * CLEARANCE} m', table=table, **given)
        if (limit, tolerance) not in afresh:
            afresh[limit, tolerance] = ms.life(
                wheel(), f'clearance > {limit * CLEARANCE} m', **given
            )
        fresh = afresh[limit, tolerance]
        assert (found.cycles, found.low, found.high) == (fresh.cycles, fresh.low, fresh.high)
        assert {n: x.tolist() for n, x in found.table().items()} == {
            n: x.tolist() for n, x in fresh.table().items()
        }
        made = len(journal.read_text().splitlines()) - 1 - lines
        assert made < found.runs or not lines
    assert made == 0


@pytest.mark.slow
def test_the_command_goes_on_from_its_journal_and_writes_scenes(tmp_path):
    """A second time nothing is run; a scene of a stage begins where the life stood."""
    file, scenes = tmp_path / 'wheel.yaml', tmp_path / 'stages'
    file.write_text(yaml.safe_dump(wheel()))
    args = (
        'life', str(file), '--until', 'clearance > 0.11 mm', '--cycles', '1e12',
        '--revolutions', '4', '--skip', '1', '-o', str(tmp_path / 'life.csv'),
        '--scenes', str(scenes), '--bags', str(tmp_path / 'bags'),
    )  # fmt: skip
    first, journal = run_json(*args), (tmp_path / 'life.csv.journal').read_text()
    assert first['cycles'] is not None
    assert first['low'] <= first['cycles'] <= first['high']
    stages = first['wear']['axle']
    assert stages[-1]['clearance'] == pytest.approx(0.11e-3)
    assert run_json(*args) == first
    assert (tmp_path / 'life.csv.journal').read_text() == journal
    assert len([*scenes.iterdir()]) == len([*(tmp_path / 'bags').iterdir()]) == len(stages)
    worn = ms.load_scene(scenes / f'stage_{len(stages) - 1:02d}.yaml')
    assert worn.scene.joints['axle'].clearance.profile.bushing is not None
    said = run(*args[:3], 'depth.axle > 5 um', *args[4:10]).stdout
    assert 'depth.axle > 5 um after' in said


@pytest.mark.slow
def test_several_bearings_wear_at_once():
    """Each as the run has it that they share; then with the shapes of all of them."""
    bearing = {
        'radial': CLEARANCE, 'restitution': 0.5, 'pin_radius': 6e-3, 'profile': {'harmonics': 8},
        'wear': {'width': WIDTH, 'bushing': '1e-6 mm^3/(N m)', 'pin': '3e-7 mm^3/(N m)'},
    }  # fmt: skip
    joints = 'coupler_rocker', 'crank_coupler'
    machine = ms.load_scene(
        'four_bar_clearance', overrides={f'joints.{j}.clearance': bearing for j in joints}
    )
    content, plan = machine.scene.to_document(), LifePlan(revolutions=2, skip=1)
    both = wear_in(machine.name, content, joints, plan, [])
    for joint in joints:
        alone = wear_in(machine.name, content, (joint,), plan, [])
        assert both['depths'][joint] == alone['depths'][joint]
        assert np.array(both['depths'][joint]).max(axis=1).min() > 0.0
    found = ms.life(machine, 'clearance > 0.102 mm', revolutions=2, skip=1)
    last = found.stages[-1]
    assert found.cycles > 0.0
    assert (last.clearance > CLEARANCE).all()
    assert last.clearance.max() == pytest.approx(0.102e-3, rel=1e-3)


@pytest.mark.parametrize(
    ('scene', 'until', 'said'),
    [
        (wheel(), 'clearance = 1 mm', "write a figure and its limit, as 'clearance > 0.5 mm'"),
        (
            wheel(),
            'clearance.axel > 1 mm',
            "'axel' is not a bearing that wears; did you mean 'axle'?",
        ),
        (wheel(), 'clearance > 1 kg', 'the limit 1 kg'),
        (wheel(law='friction_work'), 'clearance > 1 mm', "needs 'friction'"),
        ('four_bar_clearance', 'clearance > 1 mm', 'no bearing wears'),
        ('slider_crank', 'clearance > 1 mm', 'no bearing wears'),
    ],
)
def test_what_has_no_life_is_refused(scene, until, said):
    """In one sentence."""
    with pytest.raises(InputError) as error:
        ms.life(scene, until)
    assert said in str(error.value)


@pytest.mark.slow
def test_json_of_a_life_that_is_not_over(tmp_path):
    """No cycles, and how many are over at least."""
    file = tmp_path / 'wheel.yaml'
    file.write_text(yaml.safe_dump(wheel()))
    found = json.loads(
        run('life', str(file), '--cycles', '1e6', '--revolutions', '2', '--skip', '0',
            '--json').stdout
    )  # fmt: skip
    assert found['cycles'] is None
    assert found['low'] == 1e6
    assert found['wear']['axle'][-1]['cycles'] == 1e6
