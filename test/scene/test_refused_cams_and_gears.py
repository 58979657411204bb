"""Scenes of cams and gears as people get them wrong: one sentence each, that names the fault."""

import pytest

import mechanism_sim as ms
from mechanism_sim.cli import main
from mechanism_sim.errors import InputError
from mechanism_sim.scene.check import check

CAM, LAW = 'joints.contact', 'joints.contact.law'
LOOSE = {'radial': '0.1 mm', 'restitution': 0.5}


def law(*segments):
    """Segments (from, to [deg], rise, more keys)."""
    return {
        f'{LAW}.segments': [
            {'from': f'{a} deg', 'to': f'{b} deg', 'rise': rise, **dict(*more)}
            for a, b, rise, *more in segments
        ]
    }


def points(*given):
    return {LAW: {'points': [[f'{a} deg', f'{u} mm'] for a, u in given]}}


CAMS = [
    (law((0, 100, '8 mm'), (90, 180, '-8 mm')), 'from 0 to 100 deg overlaps the next one'),
    (law((180, 270, '8 mm'), (0, 90, '-8 mm')), 'segments stand in the order of their angles'),
    (law((90, 0, '8 mm'), (90, 180, '-8 mm')), 'no positive length; past a full turn .* 360 deg'),
    (law((0, 0, '8 mm'), (90, 180, '-8 mm')), 'from 0 to 0 deg has no length'),
    (law((0, 90, '8 mm'), (90, 180, '-7 mm')), r'does not return: its rises add up to 0\.001'),
    (law((0, 90, '8 deg'), (90, 180, '-8 deg')), 'rise is given in rad, but it is a displacement'),
    (law((0, 90, 8), (90, 180, -8)), 'undercut .* smaller lift than 8 m'),
    ({f'{LAW}.segments': [{'from': 0, 'to': 90, 'rise': 1}]}, 'without a unit are radians'),
    ({f'{LAW}.segments': [{'from': '0 mm', 'to': 1, 'rise': 1}]}, 'but it is an angle, in rad'),
    (law((0, 90, '8 mm', {'curve': 'cycloid'}), (90, 180, '-8 mm')), "mean 'cycloidal'"),
    (law((0, 90, '8 mm', {'curve': 'half_harmonic'}), (90, 180, '-8 mm')),
     r'at 90 deg the velocity jumps .* nonsmooth dynamics needs forces'),
    (law((0, 90, '8 mm', {'curve': 'spline'}), (90, 180, '-8 mm')), "needs 'points'"),
    (law((0, 90, '8 mm', {'curve': 'spline', 'points': [[0, 0], [0.7, 0.3], [0.5, 0.6], [1, 1]]}),
         (90, 180, '-8 mm')), 'the places of a spline increase'),
    ({f'{LAW}.segments': []}, "needs exactly one of 'segments', 'points', "),
    ({LAW: None}, "'law' is missing"),
    ({f'{LAW}.eccentric': '5 mm'}, 'needs exactly one of'),
    (points((0, 0), (180, 8)), 'needs 6 angles at least'),
    (points((0, 0), (90, 4), (80, 5), (180, 8), (200, 4), (300, 1)), 'measured angles increase'),
    (points(*((60 * k, k % 2) for k in range(8))), 'end before the turn is full'),
    ({f'{CAM}.base_radius': '0 mm'}, 'must be more than 0'),
    ({f'{CAM}.base_radius': '2 mm'}, 'undercut .* larger base_radius'),
    ({f'{CAM}.base_radius': '18 deg'}, "not a unit of 'm'"),
    ({f'{CAM}.base_radius': None}, "'base_radius' is missing"),
    ({f'{CAM}.base_radus': '18 mm'}, "did you mean 'base_radius'"),
    ({f'{CAM}.follower': 'mushroom'}, "allowed: 'knife', 'roller' or 'flat'"),
    ({f'{CAM}.follower': 'roller'}, "'roller' is missing: the radius"),
    ({f'{CAM}.roller': '5 mm'}, "write 'follower: roller' too"),
    ({f'{CAM}.lift_off.restitution': 1.5}, 'must be at most 1'),
    ({f'{CAM}.groove': {'clearance': '0.1 mm', 'restitution': 0.3}}, 'exclude each other'),
    ({f'{CAM}.lift_off': None, f'{CAM}.groove': {'clearance': 0}}, "needs 'follower: roller'"),
    ({f'{CAM}.clearance': LOOSE}, "write 'lift_off' or 'groove'"),
    ({f'{CAM}.side': 'left'}, 'no meaning for a flat follower that slides'),
    ({f'{CAM}.tilt': '90 deg'}, 'tilted by less than 90 deg'),
    ({f'{CAM}.follower': 'knife', 'links.valve.points.top': ['30 mm', 0]}, 'misses the base'),
    ({f'{CAM}.cam': ['valve.top', 'camshaft']}, "'side' is missing"),
    ({f'{CAM}.cam': ['camshaft', 'valve.tpo']}, "did you mean 'top'"),
    ({'joints.bearing.clearance': LOOSE}, 'the joint bearing of its cam cannot be loose'),
    ({'joints.bearing.law': {'eccentric': '5 mm'}}, 'no meaning in a revolute joint'),
    ({'links.valve.mass': None}, "'links.valve.mass' is missing"),
]  # fmt: skip

SOFT, BACK = 'joints.mesh.elasticity', 'joints.mesh.backlash'
TEN = {'gears.wheel.internal': True, 'gears.pinion.teeth': 60}
GEARS = [
    ('gear_pair', {'gears.pinion.teeth': 9},
     r'separates before .* undercut up to a profile shift'),
    ('gear_pair', {'gears.wheel.teeth': 40.5}, 'must be a whole number'),
    ('gear_pair', {'gears.wheel.teeth': 'many'}, 'must be a whole number'),
    ('gear_pair', {'gears.wheel.module': '2 deg'}, "not a unit of 'm'"),
    ('gear_pair', {'gears.wheel.pressure_angle': '14.5 deg'}, 'do not mesh: their pressure'),
    ('gear_pair', {'gears.pinion.addendum': '2 mm'}, 'where a plain number belongs'),
    ('gear_pair', {**TEN, 'links.ground.points.wheel': [0.02, 0]}, 'internal wheel has more'),
    ('gear_pair', {'links.ground.points.wheel': ['70 mm', 0], BACK: {'restitution': 0.5}},
     r'separates before .* the distance of the centres is 0\.06 m'),
    ('gear_pair', {BACK: {'width': '5 mm', 'restitution': 0.5}}, 'as much as a tooth is thick'),
    ('gear_pair', {BACK: '0.1 mm'}, 'keys with values: write {width: 0.1 mm}; allowed'),
    ('valve_train', {'joints.contact.law': [{'from': '0 deg', 'to': '90 deg', 'rise': '8 mm'}]},
     r'keys with values: write \{segments: \[\.\.\.\]\}; allowed'),
    ('valve_train', {'joints.contact.law': [{'cycloidal': [0, 90]}]},
     'keys with values, not a list of them; allowed here: segments'),
    ('gear_pair', {SOFT: {'stiffness': '1e8 N m/rad'}}, "not a unit of 'N/m'"),
    ('gear_pair', {SOFT: {'stiffness': 1e8, 'variation': 'contact'}}, "must be 'contact_ratio'"),
    ('gear_pair', {'joints.mesh.error': {'amplitude': '5 mm'}}, 'half the thickness of a tooth'),
    ('gear_pair', {'joints.mesh.mesh': ['pinion', 'pinion']}, 'are fixed to one link'),
    ('gear_pair', {'gears.spare': {'at': 'whel', 'teeth': 50, 'module': 0.002}}, "mean 'wheel'"),
    ('gear_pair', {'gears.spare': {'at': 'wheel', 'teeth': 9, 'module': 0.002, 'shift': 1.5}},
     'spare: the gear'),
    ('planetary', {'gears.ring.teeth': 70}, r'jam: .* without backlash it is 0\.046 m'),
    ('planetary', {'joints.extra': {'transmission': ['sun', 'carrier'], 'ratio': '1/3'}},
     'cannot move: with its loops closed by .*extra.* hold sun fast'),
    ('planetary', {'drives': {'carrier': {'speed': '30 rpm'}}}, '1 too many'),
    ('differential', {'joints.final.ratio': 0.3333333333333}, 'ratio of whole numbers'),
    ('differential', {'joints.differential.carrier': 'carier'}, r'^differential: joints\.diff'),
    ('differential', {'joints.final.transmission': ['left', 'left']}, 'ties the link left to it'),
    ('rack_and_pinion', {'gears.rack.module': '3 mm'}, 'modules are 2 mm and 3 mm'),
    ('rack_and_pinion', {'joints.mesh': {'transmission': ['pinion', 'rack'], 'ratio': 2}},
     'rack slides on ground, but pinion does not'),
]  # fmt: skip


@pytest.mark.parametrize(
    ('scene', 'changes', 'said'), [*(('valve_train', *case) for case in CAMS), *GEARS]
)
def test_wrong_scenes_are_refused_in_one_sentence(scene, changes, said):
    with pytest.raises(InputError, match=said) as caught:
        check(ms.load_scene(scene, changes))
    text = str(caught.value)
    assert '\n' not in text
    assert not any(word in text for word in ('Input should', 'np.', 'None', 'Error', '`'))


@pytest.mark.parametrize('change', ['joints.contact.base_radius=0 mm', 'joints.contact.law=null'])
def test_the_command_ends_with_2_and_no_traceback(change, capsys):
    with pytest.raises(SystemExit) as ended:
        main(['check', 'valve_train', '--set', change])
    assert ended.value.code == 2
    err = capsys.readouterr().err
    assert err.startswith('mechanism-sim: ')
    assert 'Traceback' not in err
