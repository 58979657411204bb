"""Quantities of machines: each stands once, with unit and words, and all that asks accepts it."""

from __future__ import annotations

from typing import get_type_hints

import numpy as np
import pytest
import yaml
from bags import write_bag
from builders import made, simulated

import mechanism_sim as ms
from mechanism_sim.analysis.record import read_record
from mechanism_sim.errors import InputError
from mechanism_sim.joints.cam.reading import CamReading
from mechanism_sim.joints.geneva.constraint import GenevaReading
from mechanism_sim.joints.mesh.reading import GearReading
from mechanism_sim.messages.units import units
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.report.lines import plot
from mechanism_sim.results.catalogue import SOURCES, catalogue
from mechanism_sim.results.measures import Measurement
from mechanism_sim.results.quantity import Shown
from mechanism_sim.scene.files import find_scene
from mechanism_sim.units import read_common

SHORT = 0.01  # [s]


@pytest.fixture(scope='module')
def runs():
    return {}


def run_of(runs, name):
    if name not in runs:
        machine = ms.load_scene(name)
        runs[name] = ms.simulate(machine, duration=min(machine.drive.period, SHORT))
    return runs[name]


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', ms.scene_names())
def test_every_quantity_has_a_unit_and_words_and_a_value_at_each_instant(runs, name):
    solution = run_of(runs, name)
    known = solution.catalogue
    t = np.linspace(0.0, solution.duration, 5)
    found = solution.sample(t, *known)
    assert list(found) == list(known)
    for quantity in known.values():
        assert quantity.words
        assert not quantity.unit or read_common('1', quantity.unit) == (1.0, quantity.unit)
        assert found[quantity.name].shape == (5,), quantity.name
        assert not np.isnan(found[quantity.name]).all(), quantity.name
        assert found.units[quantity.name] == quantity.unit


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', ms.scene_names())
def test_one_source_tells_a_quantity(runs, name):
    """But for the gap of a pair, which its reading has in its message, too."""
    machine = run_of(runs, name).machine
    told = [quantity.name for source in SOURCES for quantity in source(machine)]
    pairs = {f'gap.{j.name}' for j in machine.mechanism.joints if isinstance(j, HigherPair)}
    assert {n for n in told if told.count(n) > 1} <= pairs


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', ms.scene_names())
def test_a_joint_whose_moment_is_not_listed_transmits_none(runs, name):
    solution = run_of(runs, name)
    if solution.physics.has_forces:
        moments = solution.view(np.linspace(0.0, solution.duration, 40)).observed.reaction_moment
        for joint, moment in zip(solution.physics.joints, moments, strict=True):
            listed = f'reaction.{joint}.moment' in solution.catalogue
            assert listed or not np.nan_to_num(moment).any(), joint


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', ms.scene_names())
def test_measures_and_cycles_take_every_quantity(runs, name):
    solution = run_of(runs, name)
    machine, known = solution.machine, solution.catalogue
    asked = [f'mean({quantity})' for quantity in known if quantity != 't']
    units = Measurement(machine, asked).units()
    assert list(units.values()) == [q.unit for q in known.values() if q.name != 't']
    cycle = ms.cycle(machine, samples=4, duration=solution.duration)
    for quantity in known:
        assert cycle[quantity].shape == cycle.t.shape


@pytest.mark.parametrize('name', ['four_bar_clearance', 'offset_roller_cam', 'gear_rattle'])
def test_a_bag_tells_the_same_to_the_last_bit(tmp_path, name):
    solution = ms.simulate(ms.load_scene(name), duration=0.02)
    record = read_record(write_bag(tmp_path / 'run.mcap', simulated(name, duration=0.02)))
    t = np.linspace(0.0, 0.02, 50)
    names = [n for n, q in solution.catalogue.items() if not q.cumulative]
    assert names == [n for n, q in record.piece.catalogue.items() if not q.cumulative]
    given, read = solution.sample(t, *names), record.piece.sample(t, *names)
    for quantity in names:
        assert np.array_equal(given[quantity], read[quantity], equal_nan=True), quantity


def test_vectors_and_groups_are_asked_for_by_their_names():
    solution = ms.simulate(ms.load_scene('four_bar_clearance'), duration=0.01)
    known, t = solution.catalogue, np.array([0.005])
    assert known.find('reaction.coupler_rocker').name == 'reaction.coupler_rocker.size'
    size = solution.sample(t, 'reaction.coupler_rocker.size')['reaction.coupler_rocker.size']
    x, y = solution.sample(t, 'reaction.coupler_rocker.x', 'reaction.coupler_rocker.y').values()
    assert size == pytest.approx(np.hypot(x, y), rel=1e-15)
    assert all(n.startswith('position.') for n in solution.sample(t, 'position'))
    assert 'position.coupler.cog.x' in known
    assert 'position.coupler.cog.x' not in solution.sample(t, 'position')
    assert set(known.shown(Shown.RUN)) == set(solution.sample(t))


@pytest.mark.parametrize('name', ['teeth', 'shaking', 'poses', 'bearing loads'])
def test_a_joint_may_be_called_as_what_views_share(name):
    content = yaml.safe_load(find_scene('helical_shafts').read_text(encoding='utf-8'))
    content['joints'] = {
        (name.replace(' ', '_') if joint == 'mesh' else joint): keys
        for joint, keys in content['joints'].items()
    }
    plain, named = ms.load_scene('helical_shafts'), made(content)
    one, two = (ms.simulate(m, duration=0.005) for m in (plain, named))
    for a, b in zip(one.sample(0.003, *one.catalogue).values(),
                    two.sample(0.003, *two.catalogue).values(), strict=True):  # fmt: skip
        assert np.array_equal(a, b, equal_nan=True)


def test_static_forces_have_no_energy_of_the_motion():
    cycle = ms.cycle(ms.load_scene('four_bar_nominal'), samples=4, static=True)
    assert 'energy.drive_work' not in cycle.table()
    for name in ('energy.kinetic', 'energy.drive_work', 'energy.dissipated'):
        with pytest.raises(InputError, match='which static forces leave out'):
            cycle[name]
    assert cycle['reaction.coupler_rocker.size'].shape == (5,)


def test_an_unknown_name_is_refused_with_the_nearest():
    known = catalogue(ms.load_scene('four_bar_clearance'))
    with pytest.raises(InputError, match=r"no quantity 'reaction.coupler_rockr'; did you mean"):
        known.find('reaction.coupler_rockr')
    with pytest.raises(InputError, match='the drive is not a motor'):
        known.find('motor.torque')
    for name, said in {
        'energy': "'energy' stands for several quantities, one is needed: energy.kinetic, energ",
        'crank': "'crank'; did you mean 'position.crank' or 'velocity.crank' or 'acceleration",
        'crank_rate': r"'crank_rate'; did you mean 'velocity.crank'\?",
        'omega.crank': "did you mean 'position.crank' or 'velocity.crank' or",
        'kinetic': r"'kinetic'; did you mean 'energy.kinetic'\?",
        'torque': r"'torque'; did you mean 'drive_torque'\?",
        'x': "no quantity 'x'; quantities begin",
    }.items():
        with pytest.raises(InputError, match=said):
            known.find(name)
    lengths = {'ground': 7.0, 'crank': 2.0, 'coupler': 9.0, 'rocker': 6.0}
    kinematic = catalogue(made({
        'mechanism': 'four_bar', 'links': {x: {'length': y} for x, y in lengths.items()},
        'drive': {'speed': 10.0},
    }))  # fmt: skip
    with pytest.raises(InputError, match='of forces: masses are missing, or forces have no limit'):
        kinematic.find('reaction.coupler_rocker')


def test_points_move_as_their_links_do():
    """Velocity and acceleration of a point are differences of its position."""
    solution = ms.simulate(ms.load_scene('four_bar_nominal'), duration=0.05)
    h = 1e-6
    t = np.linspace(0.01, 0.04, 7)
    position, velocity = (
        lambda at, kind=kind: solution.sample(at, f'{kind}.coupler.cog.x')[f'{kind}.coupler.cog.x']
        for kind in ('position', 'velocity')
    )
    assert (position(t + h) - position(t - h)) / (2.0 * h) == pytest.approx(velocity(t), rel=1e-7)
    change = (velocity(t + h) - velocity(t - h)) / (2.0 * h)
    name = 'acceleration.coupler.cog.x'
    assert change == pytest.approx(solution.sample(t, name)[name], rel=1e-6)


def test_a_plot_knows_what_a_cycle_prints():
    solution = ms.simulate(ms.load_scene('four_bar_nominal'))
    for name in ('reaction.coupler_rocker.size', 'drive_power', 'shaking_force.size'):
        assert len(plot(solution, name).axes[0].lines) >= 1


@pytest.mark.parametrize(
    ('reading', 'message'),
    [(CamReading, 'CamState'), (GearReading, 'GearState'), (GenevaReading, 'GenevaState')],
)
def test_fields_of_messages_have_the_units_of_their_quantities(reading, message):
    in_messages = units(f'mechanism_sim/msg/{message}')
    for field, hint in get_type_hints(reading, include_extras=True).items():
        for told in getattr(hint, '__metadata__', ()):
            assert {*in_messages.get(field, ())} <= {*told.units}, field
            assert bool(in_messages.get(field)) == bool(told.units[0]), field
