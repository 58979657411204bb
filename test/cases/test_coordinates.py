"""Coordinates without riddles: tasks of people outside, with the right values found otherwise."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from builders import made
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.analysis.open_run import open_run
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.editor import background
from mechanism_sim.errors import InputError
from mechanism_sim.linkages.drive_range import placed_at
from mechanism_sim.results.cycle import at_position, cycle, instant
from mechanism_sim.scene import run_length
from mechanism_sim.scene.check import check

INPUTS = Path(__file__).parent / 'inputs'
TURN = 2.0 * math.pi


def scene_of(name, **changed):
    """Keys and values of an input, some of them changed."""
    return yaml.safe_load((INPUTS / f'{name}.yaml').read_text()) | changed


def alike(one, other):
    """True if links are where they are in another machine, by whole turns."""
    return np.abs(np.exp(1j * one.assembly.q) - np.exp(1j * other.assembly.q)).max() < 1e-9


def limits(machine):
    """Of the drive, as `check` tells them [rad, m]."""
    (found,) = check(machine).range.values()
    return np.array(found)


# --- machines that cannot turn round ------------------------------------------------------------

BRANCHES = {
    'as given': {'coupler': '-145.1 deg', 'output': '-124.5 deg'},
    'the other': {'coupler': '52.6 deg', 'output': '32.1 deg'},
}


def pose_of_double_rocker(angle):
    """Positions of B [m] and both of C, by two circles: the joints of the task (in cm)."""
    a, d = 0.01 * np.array([4.1, 3.75]), 0.01 * np.array([0.165, 1.322])
    b = a + 0.0455934776 * np.array([math.cos(angle), math.sin(angle)])
    line = d - b
    far = math.hypot(*line)
    r, s = 0.04347092937, 0.04386735688
    along = (far**2 + r**2 - s**2) / (2.0 * far)
    across = math.sqrt(r**2 - along**2)
    normal = np.array([-line[1], line[0]]) / far
    return b, d, [b + along * line / far + side * across * normal for side in (1.0, -1.0)]


@pytest.mark.parametrize('branch', BRANCHES)
def test_a_double_rocker_moves_between_its_limits_on_both_branches(branch):
    """PMKSWeb issue 91: -144.005 to 144.005 deg from the line of the ground joints."""
    machine = made(scene_of('double_rocker', guess=BRANCHES[branch]))
    ground = math.atan2(1.322 - 3.75, 0.165 - 4.1)
    from_line = np.degrees(limits(machine) - ground)
    reach, lengths = 0.04347092937 + 0.04386735688, (0.0455934776, math.hypot(0.03935, 0.02428))
    cosine = (lengths[0] ** 2 + lengths[1] ** 2 - reach**2) / (2.0 * lengths[0] * lengths[1])
    most = math.degrees(math.acos(cosine))
    assert most == pytest.approx(144.005, abs=5e-4)
    assert from_line == pytest.approx([-most, most], abs=1e-8)
    found = cycle(machine, samples=24)
    assert found['position.input'][[0, -1]] == pytest.approx(limits(machine), abs=1e-10)
    sides = set()
    for q, c in zip(found['position.input'], found['position.coupler'], strict=True):
        b, _, both = pose_of_double_rocker(q)
        end = b + 0.04347092937 * np.array([math.cos(c), math.sin(c)])
        off = [math.dist(end, x) for x in both]
        if max(off) > 1e-5:  # not at the limits, where they meet
            assert min(off) < 1e-11
            sides.add(int(np.argmin(off)))
    assert len(sides) == 1


def test_the_branches_of_a_double_rocker_differ():
    one, other = (made(scene_of('double_rocker', guess=g)) for g in BRANCHES.values())
    assert not np.allclose(np.exp(1j * one.assembly.q), np.exp(1j * other.assembly.q), atol=1e-3)


def test_a_six_bar_given_by_its_joints_moves_between_its_limits(tmp_path):
    """PMKSWeb issue 92: 67.2836 to 78.2542 deg; there it moves as its loops say."""
    file = str(INPUTS / 'six_bar.yaml')
    report = run_json('check', file)
    low, high = report['range']['ab']
    assert np.degrees([low, high]) == pytest.approx([67.2836, 78.2542], abs=1e-4)
    assert 'ab moves from 67.2836353 deg to 78.2541488 deg' in report['limits'][0]
    machine = ms.load_scene(file)
    # inside by 1e-9 rad all loops close, outside none does
    motion, q = machine.nominal.motion, machine.assembly.q
    for end, out in ((low, -1e-9), (high, 1e-9)):
        inside = placed_at(motion.kinematics, q, end - out)
        assert motion.kinematics.open_beyond_rounding(inside[:, None])[0] == 0.0
        inside[motion.driven[0]] = end + out
        assert motion.kinematics.positions(inside[:, None])[1][0] > 0.0
    found = run_json('cycle', file)
    seen = found['extremes']['position.ab']
    assert [seen[x]['value'] for x in ('least', 'greatest')] == pytest.approx(
        [low, high], abs=1e-10
    )
    assert found['unbounded'] == []
    picture = run_json('draw', file, '-o', str(tmp_path / 'six.svg'), '--positions', '3')
    assert Path(picture['file']).exists()


def test_limits_of_a_six_bar_agree_with_the_determinant_of_its_loops():
    """Zeros of the Jacobian's determinant of the sought angles, by bisection."""
    machine = ms.load_scene(str(INPUTS / 'six_bar.yaml'))
    ends = machine.nominal.drive_range
    kinematics = machine.nominal.motion.kinematics
    for at in (ends.at_low, ends.at_high):
        assert kinematics.independence(at[:, None])[0] < 1e-7
        assert kinematics.left_open(at[:, None])[0] < 1e-15


def slider(crank, rod, offset=0.0, **keys):
    """Keys of a slider-crank whose crank is driven."""
    return {
        'links': {
            'ground': {'points': {'rail': [0, f'{offset} m']}},
            'crank': {'length': f'{crank} m'},
            'rod': {'length': f'{rod} m'},
            'block': {},
        },
        'joints': {
            'a': {'revolute': ['ground', 'crank']},
            'b': {'revolute': ['crank.end', 'rod']},
            'c': {'revolute': ['rod.end', 'block']},
            's': {'prismatic': ['ground.rail', 'block'], 'axis': '0 deg'},
        },
        'drive': {'coordinate': 'crank', 'speed': '1 rad/s', 'start_angle': '20 deg'},
        'guess': {'rod': '-20 deg', 'block': f'{crank + rod} m'},
        **keys,
    }


@pytest.mark.parametrize(
    ('crank', 'rod', 'offset'), [(0.5, 0.3, 0.0), (0.4, 0.3, 0.1), (1, 0.9, 0.2)]
)
def test_a_crank_longer_than_its_rod_turns_to_where_the_rod_is_upright(crank, rod, offset):
    """The far end reaches the line of the block: crank sin(q) between offset -+ rod."""
    machine = made(slider(crank, rod, offset))
    low, above = math.asin((offset - rod) / crank), (offset + rod) / crank
    high = math.asin(above) if above < 1.0 else math.pi - low  # over the top, if it can
    assert limits(machine) == pytest.approx([low, high], abs=1e-12)


def test_a_driven_slider_has_limits_as_a_crank_has():
    """The block of a slider-crank goes from rod - crank to rod + crank; no duration is needed."""
    drive = {'coordinate': 'block', 'speed': '-20 mm/s', 'start_position': '0.6 m'}
    machine = made(slider(0.2, 0.5, drive=drive, guess={'crank': '50 deg', 'rod': '-20 deg'}))
    assert limits(machine) == pytest.approx([0.3, 0.7], abs=1e-13)
    found = cycle(machine, samples=10)
    assert found['position.block'][[0, -1]] == pytest.approx([0.7, 0.3], abs=1e-12)
    at = at_position(machine, 0.45, found)
    crank = math.acos((0.45**2 + 0.2**2 - 0.5**2) / (2 * 0.45 * 0.2))
    assert at['position.crank'] == pytest.approx(crank, abs=1e-12)


def test_runs_are_refused_with_both_limits_and_those_within_are_not():
    machine = made(scene_of('six_bar'))
    with pytest.raises(InputError, match=r'ab moves from 67\.2836353 deg to 78\.2541488 deg'):
        run_length(machine, None, None)
    with pytest.raises(InputError, match=r'from 67\.2836353 deg to 78\.2541488 deg'):
        ms.simulate(machine)
    assert ms.simulate(machine, duration=0.08).duration == 0.08
    rocker = made(scene_of('double_rocker'))
    with pytest.raises(InputError, match=r'input moves from -292\.32\d+ deg to -4\.319\d+ deg'):
        run_length(rocker, None, None)
    with pytest.raises(InputError, match=r'ab moves from 67\.2836353 deg'):
        made(scene_of('six_bar', duration='1 s'))


def test_pictures_of_a_machine_between_limits():
    machine = made(scene_of('double_rocker'))
    found, t = instant(machine, math.radians(-100.0), still=True)
    assert math.degrees(
        found.at(np.array([t]), ['position.input']).popitem()[1][0]
    ) == pytest.approx(-100.0)
    found, t = instant(machine, math.radians(-100.0))
    assert math.degrees(
        found.at(np.array([t]), ['position.input']).popitem()[1][0]
    ) == pytest.approx(-100.0)
    with pytest.raises(InputError, match='input cannot be at 31'):
        instant(machine, math.radians(31.0), still=True)


def test_a_cycle_of_a_crank_that_cannot_turn_round_is_as_long_as_the_scene_says():
    """A turn of it ended in NaN; drawings of it, and of what slides, have the drive's position."""
    lengths = {'ground': 0.1, 'crank': 0.18, 'coupler': 0.28, 'rocker': 0.19}
    machine = ms.load_scene({
        'mechanism': 'four_bar', 'duration': '6 s',
        'links': {name: {'length': x} for name, x in lengths.items()},
        'drive': {'speed': '10 deg/s', 'start_angle': '45 deg'},
    })  # fmt: skip
    found = cycle(machine, samples=10)
    assert np.degrees(found['position.crank'][[0, -1]]) == pytest.approx([45.0, 105.0], abs=1e-9)
    for still in (True, False):
        found, t = instant(machine, '60 deg', still=still)
        at = found.at(np.array([t]), ['position.crank']).popitem()[1][0]
        assert math.degrees(at) == pytest.approx(60.0, abs=1e-9)
    assert instant(machine, '45 deg')[1] == 0.0
    assert instant(machine, '105 deg')[1] == pytest.approx(6.0, abs=1e-9)
    with pytest.raises(InputError, match=r'crank goes from 45 to 105 deg in 6 s'):
        instant(machine, '10 deg')
    found, t = instant(ms.load_scene('loader'), '0.8 m')
    at = found.at(np.array([t]), ['position.lift_rod']).popitem()[1][0]
    assert at == pytest.approx(0.8, abs=1e-12)


def test_a_drawing_of_a_drive_that_swings_is_that_of_its_first_time_at_an_angle():
    drive = {'coordinate': 'crank', 'position': '90 deg + 30 deg*sin(2*t)'}
    machine = ms.load_scene('windshield_wiper', {'drive': drive})
    _, t = instant(machine, '105 deg', duration=4.0)
    assert t == pytest.approx(math.asin(0.5) / 2.0, abs=1e-9)
    for angle, share in (('120 deg', 0.25), ('60 deg', 0.75)):  # between two samples
        _, t = instant(machine, angle, duration=4.0)
        assert t == pytest.approx(math.pi * share, abs=1e-6)


@pytest.mark.slow
def test_a_machine_with_clearance_between_limits_is_checked_drawn_and_run_within_them():
    """The limits are those of its links without clearance; a run beyond them is refused."""
    scene = scene_of('double_rocker')
    for name in ('input', 'coupler', 'output'):
        scene['links'][name] |= {'mass': '1 kg', 'inertia': '1e-4 kg m^2'}
    plain = limits(made(scene))
    scene['joints']['b']['clearance'] = {'radial': '0.1 mm', 'restitution': 0.5}
    machine = made(scene)
    assert limits(machine) == pytest.approx(plain, abs=1e-12)
    said, *_ = check(machine).limits
    assert "without clearance: a run that is to stay between them needs a 'duration'" in said
    found, t = instant(machine, math.radians(-100.0), still=True)
    angle = found.at(np.array([t]), ['position.input']).popitem()[1][0]
    assert math.degrees(angle) == pytest.approx(-100.0)
    assert ms.simulate(machine, duration=0.02).duration == 0.02
    with pytest.raises(InputError, match=r'input moves from -292\.32\d+ deg to -4\.319\d+ deg'):
        ms.simulate(machine)


def test_the_editor_shows_a_machine_between_limits():
    class Link:
        """One end of a pipe."""

        sent: list = []  # noqa: RUF012 - of this test alone

        def poll(self):
            return False

        def send(self, message):
            self.sent.append(message)

    content = scene_of('six_bar')
    background._work(background.Job(1, 'six_bar', content), Link())
    kinds = [kind for _, kind, _ in Link.sent]
    assert kinds[0] == 'checked'
    assert kinds[-1] == 'run'
    assert json.loads(Link.sent[0][2])['range']


def test_forces_between_limits_have_extremes_but_where_they_grow_beyond_all_bounds():
    """A weight on the rocker presses the driven link without limit at its limits, as a toggle."""
    masses = {
        x: {'mass': '1 kg', 'inertia': '1e-4 kg m^2', 'cog': '2 cm'}
        for x in ('input', 'coupler', 'output')
    }
    scene = scene_of('double_rocker', gravity=[0, '-9.81 m/s^2'])
    for name, more in masses.items():
        scene['links'][name] |= more
    found = cycle(made(scene), samples=36)
    assert 'drive_torque' in found.unbounded
    assert not {'position.output', 'velocity.output', 'acceleration.output'} & found.unbounded
    # work of the drive is that of weights and inertia, limits or not
    energy = found['energy.kinetic'] + found['energy.potential']
    work = found['energy.drive_work']
    assert work - work[0] == pytest.approx(energy - energy[0], abs=1e-7 * np.abs(energy).max())


# --- redundant constraints that agree -----------------------------------------------------------

OPEN = [
    'reaction.a', 'reaction.m', 'reaction.s', 'reaction.sb.y', 'reaction.t.x',
    'reaction.carriage_guide', 'reaction.cg.x',
]  # fmt: skip
"""Of the scissor lift: its self-stress presses the carriage on its guide, and that on the bars."""


def force_of_lift(x, raised, v=0.05):
    """Virtual work: h = sqrt(1 - x^2); all that is `raised` [kg] rises by h, the bars by half."""
    h = math.sqrt(1.0 - x * x)
    slope, bend = -x / h, -(v**2) / h**3
    own = raised * (9.81 + bend) * slope + 2.0 * 4.0 * (9.81 + 0.5 * bend) * 0.5 * slope
    turned = 2.0 * 0.333 * (-x * v**2 / h**3) * (-1.0 / h)  # th = acos(x)
    return own + turned


def without_the_guide(scene):
    """The lift with its carriage as a point mass on the table: nothing is redundant."""
    mass = scene['links'].pop('carriage')['mass']
    for joint in ('carriage_guide', 'cg'):
        scene['joints'].pop(joint)
    scene['guess'].pop('carriage')
    return scene | {'masses': {'carriage': {'at': 'table.l', 'mass': mass}}}


@pytest.mark.parametrize(
    ('carriage', 'forces'), [(1.0, (-339.699, -191.205)), (0.0, (-326.635, -183.851))]
)
def test_the_force_of_a_scissor_lift_with_a_guide_too_many(carriage, forces):
    """Exudyn issue 39, at 0.8 and 0.6 m of the shoe.

    As the file has it, with a carriage of 1 kg, 22 kg rise by h and the bars' 8 kg by h/2: without
    the small inertia that is -(22 + 4) 9.81 x/h = -340.08 and -191.30 N. The values that the list
    of cases prints, -326.635 and -183.851 N, are those of a carriage without mass: 21 kg.
    """
    scene = scene_of('scissor_lift_redundant')
    scene['links']['carriage']['mass'] = carriage
    machine = made(scene)
    found = cycle(machine, samples=4)
    for x in (0.8, 0.6):
        at = at_position(machine, x, found)
        assert at['drive_torque'] == pytest.approx(force_of_lift(x, 21.0 + carriage), abs=1e-10)
    assert found['drive_torque'][[0, -1]] == pytest.approx(forces, abs=1e-3)


@pytest.mark.slow
def test_what_a_redundant_guide_leaves_open_is_named_and_the_rest_given(tmp_path):
    file = tmp_path / 'lift.yaml'
    file.write_text(yaml.safe_dump(scene_of('scissor_lift_redundant'), sort_keys=False))
    solved, turned = run_json('solve', str(file)), run_json('cycle', str(file), '--at', '0.7 m')
    assert solved['undetermined'] == turned['undetermined'] == OPEN
    assert any(', '.join(OPEN) in note for note in run_json('check', str(file))['notes'])
    known = {name.partition('.')[2] for name in turned['at'] if name.startswith('reaction.')}
    assert {'carriage_guide.moment', 't.y', 'cg.y', 'sb.x', 'ts.size'} <= known
    assert not {'a.x', 'm.size', 's.y', 't.x', 't.size', 'carriage_guide.x'} & known
    assert None not in turned['at'].values()
    # and what is given is that of the lift without the guide
    plain = made(without_the_guide(scene_of('scissor_lift_redundant')))
    expected = at_position(plain, 0.7, cycle(plain, samples=4))
    for name in ('reaction.ts.y', 'reaction.tb.y', 'reaction.sb.x', 'drive_torque'):
        assert turned['at'][name] == pytest.approx(expected[name], abs=1e-9), name
    with pytest.raises(
        InputError, match=r"'reaction\.t\.x': not determined, for 1 of the closure"
    ):
        cycle(made(scene_of('scissor_lift_redundant')), samples=4)['reaction.t.x']


def test_a_redundant_guide_does_not_change_a_motion_by_forces():
    """Equations of motion keep the rows that are independent; the audit looks at the others."""
    fall = {
        'drive': {
            'coordinate': 'shoe',
            'force': {'constant': '-300 N'},
            'start_position': '0.8 m',
        },
        'duration': '0.3 s',
    }
    one = ms.simulate(made(scene_of('scissor_lift_redundant', **fall)))
    other = ms.simulate(made(without_the_guide(scene_of('scissor_lift_redundant', **fall))))
    t = np.linspace(0.0, 0.3, 31)
    a, b = one.sample(t), other.sample(t)
    for name in ('position.shoe', 'velocity.bar1', 'acceleration.shoe', 'reaction.ts.y'):
        assert np.abs(a[name] - b[name]).max() < 1e-10 * np.abs(b[name]).max(), name
    assert one.max_closure_error < 1e-14


def guided_block(**more):
    """A block on two guides alike, driven by a crank through a rod."""
    return {
        'links': {
            'ground': {'points': {'rail': [0, 0], 'other': ['0 m', '0.1 m']}},
            'crank': {
                'length': '0.1 m',
                'mass': '1 kg',
                'inertia': '1e-3 kg m^2',
                'cog': '0.05 m',
            },
            'rod': {'length': '0.3 m', 'mass': '1 kg', 'inertia': '8e-3 kg m^2', 'cog': '0.15 m'},
            'block': {
                'points': {'top': ['0 m', '0.1 m']},
                'mass': '2 kg',
                'inertia': '1e-3 kg m^2',
            },
        },
        'joints': {
            'a': {'revolute': ['ground', 'crank']},
            'b': {'revolute': ['crank.end', 'rod']},
            'c': {'revolute': ['rod.end', 'block']},
            'low': {'prismatic': ['ground.rail', 'block'], 'axis': '0 deg'},
            'high': {'prismatic': ['ground.other', 'block.top'], 'axis': '0 deg'},
        },
        'drive': {'coordinate': 'crank', 'speed': '20 rad/s', 'start_angle': '30 deg'},
        'guess': {'rod': '-10 deg', 'block': '0.38 m'},
        'gravity': [0, '-9.81 m/s^2'],
        **more,
    }


def test_two_guides_of_one_block_share_a_force_that_is_given_for_neither():
    """Any share holds; torque and pins are those of one guide."""
    both = made(guided_block())
    one = guided_block()
    one['joints'].pop('high')
    a, b = cycle(both, samples=36), cycle(made(one), samples=36)
    assert both.nominal.undetermined_names == ['reaction.low', 'reaction.high']
    assert not any(name.startswith(('reaction.low', 'reaction.high')) for name in a.names)
    for name in ('drive_torque', 'reaction.c.size', 'shaking_force.y', 'shaking_moment'):
        assert a[name] == pytest.approx(b[name], abs=1e-9), name
    assert a.mean_power == pytest.approx(b.mean_power, abs=1e-9)


def test_two_guides_and_a_loose_pin():
    """The block strikes as with one guide: redundant rows change no bit of what is struck."""
    loose = guided_block(duration='50 ms', start='centred')
    loose['joints']['c']['clearance'] = {'radial': '0.1 mm', 'restitution': 0.5}
    one = guided_block(duration='50 ms', start='centred')
    one['joints']['c']['clearance'] = {'radial': '0.1 mm', 'restitution': 0.5}
    one['joints'].pop('high')
    a, b = (ms.simulate(made(x)) for x in (loose, one))
    assert len(a.impacts) == len(b.impacts) > 1
    assert [i.t for i in a.impacts][:2] == pytest.approx([i.t for i in b.impacts][:2], rel=1e-9)


def test_guides_that_do_not_agree_are_refused():
    """The carriage's guide leans by a degree: then the table cannot rise."""
    scene = scene_of('scissor_lift_redundant')
    scene['joints']['carriage_guide']['axis'] = '89 deg'
    scene['links']['ground']['points']['wall'] = [-0.6 * math.tan(math.radians(1.0)), 0]
    with pytest.raises(InputError) as refused:
        made(scene)
    assert str(refused.value).count('\n') == 0
    block = guided_block()
    block['links']['ground']['points']['other'] = ['0 m', '0.101 m']
    with pytest.raises(InputError, match='cannot be assembled'):
        made(block)


MISTAKES = {
    'friction in a joint whose force is open': (
        {'joints.low.friction': {'coefficient': 0.1, 'length': '20 mm'}},
        r'joints\.low\.friction follows from its force, but 2 of the closure equations follow',
    ),
    'a load cell in it': (
        {'sensors': {'cell': {'kind': 'load_cell', 'joint': 'low', 'sample_rate': '1 kHz'}}},
        r'sensors\.cell\.joint = low: 2 of the closure equations follow',
    ),
}


@pytest.mark.parametrize('mistake', MISTAKES)
def test_what_needs_a_force_that_is_open_is_refused(mistake):
    change, said = MISTAKES[mistake]
    with pytest.raises(InputError, match=said):
        made(guided_block(), **change)


# --- places and rates of points, in either unit -------------------------------------------------


PLACES = {
    'ab.end': (-2.72, 0.91), 'bcd.end': (1.58, 0.43), 'bcd.D': (-0.24, 4.01),
    'de.end': (5.08, 5.31), 'gcf.F': (8.14, 3.35),
}  # fmt: skip
"""Joints B to F of PMKSWeb issue 92 [cm], by the points of the scene that are there."""


@pytest.mark.parametrize('points', [('bcd.end', 'de.end'), ('gcf.F', 'bcd.D'), ('de.end',)])
def test_a_branch_is_told_by_where_joints_are(points):
    """As the task has it, in place of angles that somebody had to work out."""
    rough = made(scene_of('six_bar'))
    guess = {point: [f'{x} cm' for x in PLACES[point]] for point in points}
    machine = made(scene_of('six_bar', guess=guess))
    assert alike(machine, rough)
    q = dict(zip(machine.plan.ideal.coordinates, machine.assembly.q, strict=True))
    for point, place in PLACES.items():
        link, at = machine.plan.find('', point)
        found = 100.0 * np.array(machine.plan.ideal.locate(link, q, at))
        assert found == pytest.approx(place, abs=1e-9)


def test_the_other_branch_is_told_by_a_point_too():
    rough = made(scene_of('double_rocker', guess=BRANCHES['the other']))
    _, _, (one, other) = pose_of_double_rocker(math.radians(-128.785414))
    given = made(scene_of('double_rocker'))
    q = dict(zip(given.plan.ideal.coordinates, given.assembly.q, strict=True))
    end = np.array(given.plan.ideal.locate('coupler', q, given.plan.points['coupler']['end']))
    far = max((one, other), key=lambda c: math.dist(c, end))
    machine = made(scene_of('double_rocker', guess={'coupler.end': far.round(3).tolist()}))
    assert alike(machine, rough)


def test_a_block_is_told_along_its_guide_whatever_its_coordinate_is():
    """The coordinate of the top shoe is an angle, for its guide closes a loop."""
    guess = {'table.l': [0, 0.6], 'topshoe': '0.8 m', 'carriage': '600 mm', 'bar1': '30 deg'}
    machine = made(scene_of('scissor_lift_redundant', guess=guess))
    told = check(machine).start
    assert told['bar1'].value == pytest.approx(math.asin(0.6), abs=1e-12)
    assert str(told['bar1']) == 'angle of bar1, 36.8698976 deg, 0.0833333 rad/s'
    assert str(told['carriage']).startswith(
        'displacement of carriage along carriage_guide, 600 mm'
    )
    assert str(told['topshoe']) == 'angle of topshoe, 0 deg, at rest'


def arms(**initial):
    """Two links that hang on each other, free to move."""
    link = {'length': '1 m', 'mass': 1.0, 'inertia': 0.1, 'cog': '0.5 m'}
    return {
        'links': {'a': dict(link), 'b': dict(link)},
        'joints': {'p': {'revolute': ['ground', 'a']}, 'q': {'revolute': ['a.end', 'b']}},
        'gravity': [0, '-9.81 m/s^2'],
        'guess': {'a': '0 deg', 'b': '-80 deg'},
        'duration': '0.1 s',
        'initial': initial,
    }


def test_place_and_rate_of_a_point_start_a_free_machine():
    """By the law of cosines, and by velocities of two arms at a right angle."""
    initial = {'position': {'b.end': ['1 m', '-1 m']}, 'velocity': {'b.end': ['2 m/s', '0.5 m/s']}}
    machine = made(arms(**initial))
    assert machine.assembly.q == pytest.approx([0.0, -0.5 * math.pi], abs=1e-12)
    # a moves b.end by (0, 1), b by (1, 0)
    assert machine.assembly.v == pytest.approx([0.5, 2.0], abs=1e-12)
    by_hand = {'position': {'a': 0.0, 'b': '-90 deg'}, 'velocity': {'a': 0.5, 'b': 2.0}}
    a, b = (ms.simulate(made(arms(**x))) for x in (initial, by_hand))
    assert a.sample([0.1], 'position.b')['position.b'] == pytest.approx(
        b.sample([0.1], 'position.b')['position.b'], abs=1e-11
    )
    told = check(machine).start['b']
    assert (told.value, told.rate) == pytest.approx((-0.5 * math.pi, 2.0))


def test_a_slider_crank_starts_by_its_pin():
    """A point sets the drive's start and the speed of a machine that a torque moves."""
    scene = slider(0.1, 0.3)
    for name in ('crank', 'rod', 'block'):
        scene['links'][name] |= {'mass': 1.0, 'inertia': 1e-3}
    scene |= {'drive': {'coordinate': 'crank', 'torque': {}}, 'duration': '10 ms', 'guess': {}}
    angle = math.radians(40.0)
    pin = [0.1 * math.cos(angle), 0.1 * math.sin(angle)]
    speed = [-12.0 * pin[1], 12.0 * pin[0]]
    scene['initial'] = {'position': {'crank.end': pin}, 'velocity': {'rod': speed}}
    scene['guess'] = {'rod.end': ['0.35 m', '0 m']}
    told = check(made(scene)).start
    assert (told['crank'].value, told['crank'].rate) == pytest.approx((angle, 12.0), abs=1e-12)
    x = 0.1 * math.cos(angle) + math.sqrt(0.09 - pin[1] ** 2)
    assert told['block'].value == pytest.approx(x, abs=1e-12)
    scene['initial'] = {'position': {'crank.end': pin}, 'velocity': {'block': '-1 m/s'}}
    assert check(made(scene)).start['block'].rate == pytest.approx(-1.0, abs=1e-12)


def test_scenes_with_points_are_written_and_read_back():
    machine = made(arms(position={'b.end': ['1 m', '-1 m']}, velocity={'b.end': ['2 m/s', 0]}))
    document = machine.scene.to_document()
    again = made(document)
    assert again.scene == machine.scene
    assert again.assembly.v == pytest.approx(machine.assembly.v)


WRONG = {
    'a point as one number': (
        {'initial.position': {'b.end': '2 m'}},
        r'end is a point of b: give its position, as b\.end',
    ),
    'a point that cannot be there': (
        {'initial.position': {'b.end': ['2 m', '-1 m']}},
        r'b\.end cannot be \[2 m, -1 m\]: the nearest .* 0\.21\d+ m off',
    ),
    'a length for a link that turns': (
        {'guess': {'a': '0.5 m'}}, r'guess\.a is given in m, but it is an angle: a slides in no',
    ),
    'no such point': ({'guess': {'b.tip': [1, 0]}}, r"the link b has no point 'tip'"),
    'a point of the ground': ({'guess': {'ground': [1, 0]}}, r'ground: the ground does not'),
    'three numbers': ({'guess': {'b.end': [1, 0, 0]}}, r'the two of a point: write \[x, y\]'),
    'a rate in another unit': (
        {'initial.velocity': {'b.end': ['1 rad/s', 0]}}, r"which is not a unit of 'm/s'",
    ),
    'more rates than can be': (
        {
            'initial.velocity': {'a': '1 rad/s', 'b': '1 rad/s', 'b.end': ['9 m/s', 0]},
            'initial.position': {'a': '0 deg', 'b': '-90 deg'},
        },
        r'b\.end cannot be \[9 m/s, 0 m/s\]: with the drives .* \[1 m/s, 1 m/s\]',
    ),
}  # fmt: skip


@pytest.mark.parametrize('mistake', WRONG)
def test_what_cannot_start_so_is_answered_by_one_sentence(mistake):
    change, said = WRONG[mistake]
    with pytest.raises(InputError, match=said) as refused:
        made(arms(), **change)
    assert '\n' not in str(refused.value)


def test_an_angle_for_a_block_is_answered():
    scene = scene_of('scissor_lift_redundant')
    scene['guess']['carriage'] = '90 deg'
    with pytest.raises(
        InputError, match='carriage slides along carriage_guide, which determines its angle'
    ):
        made(scene)


# --- as nodes, bags, and long -------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.network
def test_a_redundant_machine_runs_as_nodes_to_the_bit(tmp_path):
    scene, bag = tmp_path / 'lift.yaml', tmp_path / 'lift.mcap'
    pull = {'coordinate': 'shoe', 'force': {'constant': '-300 N'}, 'start_position': '0.8 m'}
    content = scene_of('scissor_lift_redundant', drive=pull, duration='0.5 s')
    content['guess'] = {'table.l': [0, 0.6], 'topshoe': '0.8 m'}
    scene.write_text(yaml.safe_dump(content, sort_keys=False))
    done = run('run', str(scene), '--record', str(bag))
    assert done.returncode == 0, done.stderr
    alone = ms.simulate(ms.load_scene(str(scene)))
    assert analyze(bag).digest == alone.digest()
    again = open_run(bag)
    names = 'position.shoe', 'reaction.ts.y', 'reaction.t.y'
    t = np.linspace(0.0, 0.5, 11)
    one, two = (x.sample(t, *names) for x in (alone, again.piece))
    assert all(np.array_equal(one[name], two[name]) for name in one)


@pytest.mark.slow
def test_a_redundant_machine_goes_on_for_ten_thousand_turns():
    """A crank that turns freely: rows left out keep vanishing, and no energy is lost."""
    free = {'coordinate': 'crank', 'torque': {}, 'speed': '20 rad/s', 'start_angle': '30 deg'}
    machine = made(guided_block(drive=free))
    run = ms.stream(machine, duration=10_000 * 2.0 * math.pi / 20.0).finish()
    assert run.max_closure_error < 1e-12
    assert abs(run.energy.residual) < 1e-9 * run.energy.exchanged
