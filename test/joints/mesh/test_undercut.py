"""Undercut: teeth cut out of a blank by a rack, and the profile shifts that end it."""

import math
import re

import numpy as np
import pytest
from textbook import TOOTH_SYSTEMS

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.joints.mesh.involute import Gear, rounded_up
from mechanism_sim.joints.mesh.pair import Pair, path_with_rack
from mechanism_sim.scene.check import check

M = 2e-3


def cut_away(gear, radii, steps=2001):
    """Mask of points of the flank that the rack, rolled past, covers: no fillet formula."""
    m, system, r = gear.module, gear.system, gear.pitch_radius
    phi, slope = system.pressure_angle, math.tan(system.pressure_angle)
    rounding = (system.dedendum - system.addendum) * m / (1.0 - math.sin(phi))
    from_space = math.pi / gear.teeth - np.array([gear.half_angle(x) for x in radii])
    roll = np.linspace(-1.0, 1.0, steps)[:, None] * 3.0 * m
    turned = from_space + roll / r
    x, y = radii * np.sin(turned) - roll, radii * np.cos(turned) - r - gear.shift * m
    side = math.pi * m / 4 - np.abs(x)
    body = (np.abs(y) < system.addendum * m) & (side + y * slope > 1e-12)
    centre = math.pi * m / 4 - system.addendum * m * slope - rounding * math.cos(phi)
    below = y + system.dedendum * m - rounding
    corner = np.hypot(np.abs(x) - centre, below) < rounding - 1e-12
    return (body | corner).any(axis=0)


@pytest.mark.sample(8)
@pytest.mark.parametrize('system', TOOTH_SYSTEMS.values(), ids=TOOTH_SYSTEMS)
@pytest.mark.parametrize(('below', 'shift'), [(3, 0.0), (8, 0.1), (5, -0.2)])
def test_the_involute_begins_where_the_rack_stops_to_cut(system, below, shift):
    teeth = math.ceil(2 * system.addendum / math.sin(system.pressure_angle) ** 2) - below
    gear = Gear(teeth, M, system, shift)
    assert gear.undercut
    depth = gear.form_radius - gear.base_radius
    radii = gear.base_radius + depth * np.linspace(0.0, 2.0, 201)[1:]
    gone = cut_away(gear, radii)
    assert radii[gone].max() == pytest.approx(gear.form_radius, abs=0.02 * depth)
    assert not cut_away(gear, np.linspace(radii[-1], gear.tip_radius, 101)).any()
    drawn = np.hypot(*gear.flank(41).T)
    assert (np.diff(drawn) > 0).all()
    assert drawn[[0, -1]] == pytest.approx([gear.root_radius, gear.tip_radius])


@pytest.mark.parametrize('teeth', [8, 9, 12, 14, 17])
def test_the_least_shift_leaves_the_whole_involute(teeth):
    least = Gear(teeth, M).least_shift
    cured, short = Gear(teeth, M, shift=rounded_up(least)), Gear(teeth, M, shift=least - 0.01)
    radii = np.linspace(cured.base_radius, cured.base_radius * 1.001, 201)[1:]
    assert not cut_away(cured, radii).any()
    assert not cured.undercut
    assert cured.form_radius == cured.base_radius
    assert short.undercut
    # continuous: where nothing more than rounding is cut
    barely = Gear(teeth, M, shift=least - 1e-9)
    assert barely.form_radius == pytest.approx(barely.base_radius, rel=1e-12)


def test_what_undercut_leaves_of_the_path_of_contact():
    """Contact begins where the pinion's involute does, not where the wheel's tips would reach."""
    pair = Pair(Gear(12, M), Gear(48, M))
    reach = pair.pinion.base_radius * math.tan(pair.pressure_angle)
    assert pair.path.start == pytest.approx(pair.pinion.tangent(pair.pinion.form_radius) - reach)
    cured = Pair(Gear(12, M, shift=0.2982), Gear(48, M, shift=-0.2982))
    assert cured.centre_distance == pytest.approx(pair.centre_distance, rel=1e-15)
    assert cured.contact_ratio > pair.contact_ratio + 0.2
    assert path_with_rack(Gear(12, M)).start == pytest.approx(pair.path.start)


def advised(note):
    """The shifts that a note proposes, and the centre distance if it is another one."""
    own, mate = re.search(r'shifts of (\S+) for it and (\S+) for', note).groups()
    where = re.search(r'a centre distance of (\S+) m', note)
    return float(own), float(mate), where and float(where[1])


@pytest.mark.parametrize('count', [15, pytest.param(50, marks=pytest.mark.slow)])
def test_the_proposed_shifts_cure_random_pairs(count):
    """Today's cure, a shift of one gear alone, jams: the teeth it widens have no room."""
    random, seen = np.random.default_rng(24), {'same': 0, 'other': 0}
    for _ in range(count):
        helix = random.choice([0.0, random.uniform(5, 30)])
        one = int(random.integers(9, 17) * math.cos(math.radians(helix)) ** 3)
        two = int(random.integers(max(12, one), 60))
        module = 2e-3 / math.cos(math.radians(helix))
        gear = {'helix_angle': f'{helix} deg'}
        values = {
            'gears.pinion': {'at': 'pinion', 'teeth': one, 'module': '2 mm', **gear},
            'gears.wheel': {'at': 'wheel', 'teeth': two, 'module': '2 mm', **gear},
            'links.ground.points.wheel': [module * (one + two) / 2, 0.0],
        }
        try:
            notes = check(ms.load_scene('gear_pair', values)).notes
        except InputError as error:
            assert 'undercut' in str(error)  # noqa: PT017 - too little is left
            continue
        note = next(n for n in notes if 'pinion is undercut' in n)
        own, mate, distance = advised(note)
        seen['other' if distance else 'same'] += 1
        values['gears.pinion']['shift'] = own
        if not distance:
            with pytest.raises(InputError, match='jam'):
                ms.load_scene('gear_pair', values)
        values['gears.wheel']['shift'] = mate
        if distance:
            values['links.ground.points.wheel'] = [distance, 0.0]
        notes = check(ms.load_scene('gear_pair', values)).notes
        assert not any('undercut' in n for n in notes)
    assert min(seen.values()) >= count // 15
