"""Contact of cam and follower over a turn: closed forms, differences, and laws with corners."""

import math

import numpy as np
import pytest
from running import run

import mechanism_sim as ms
from mechanism_sim.cli import main
from mechanism_sim.errors import InputError
from mechanism_sim.results.cycle import cycle
from mechanism_sim.scene.check import check
from mechanism_sim.studies.lift_off import lift_offs

LAW = 'joints.contact.law'
HALF = [
    {'from': '0 deg', 'to': '60 deg', 'rise': '4 mm', 'curve': 'half_harmonic'},
    {'from': '120 deg', 'to': '270 deg', 'rise': '-4 mm', 'curve': 'half_harmonic'},
]


def over_turn(name, overrides=()):
    machine = ms.load_scene(name, overrides)
    found = cycle(machine, samples=720)
    joint = next(j for j in machine.mechanism.joints if j.name == 'contact')
    return machine, joint, found


def test_a_flat_face_is_touched_off_its_axis_by_the_velocity_per_radian():
    """Contact offset dy/dphi = e cos(phi) of the eccentric; the circle is touched all round."""
    machine, joint, found = over_turn('eccentric_cam')
    e = joint.cam.law.eccentricity
    speed, angle = machine.drive.start[1], found['position.cam']
    offset = found['contact.contact.x'] - joint.centre[0]
    assert abs(offset) == pytest.approx(abs(e * np.cos(angle)), abs=1e-15)
    radius = joint.cam.base_radius + e
    assert abs(found['contact_speed.contact']) == pytest.approx(radius * abs(speed), rel=1e-12)
    assert found['pressure_angle.contact'] == pytest.approx(0.0, abs=1e-15)
    # the face moves up, the cam turns: sliding is height of the contact times the speed
    height = found['contact.contact.y'] - joint.centre[1]
    assert abs(found['sliding_speed.contact']) == pytest.approx(abs(speed * height), rel=1e-12)
    ends = found.extremes()['contact.contact.x']
    assert ends.greatest.value - joint.centre[0] == pytest.approx(e, rel=1e-14)


def test_the_pressure_angle_of_an_offset_roller():
    """tan(alpha) = (f - u')/(s0 + u), and its extreme is that of the law, not of the samples."""
    _, joint, found = over_turn('offset_roller_cam')
    law, follower = joint.cam.law, joint.cam.follower
    x = -found['position.cam']
    lowest = math.sqrt(22e-3**2 - 4e-3**2)
    tangent = (follower.offset - law(x, 1)) / (lowest + law(x))
    assert np.tan(found['pressure_angle.contact']) == pytest.approx(tangent, abs=1e-12)
    # u' = f - (s0 + u) tan(alpha) is stationary where u'' (s0 + u) = u' (u' - f)
    fine = np.linspace(math.radians(121), math.radians(269), 400_001)
    alpha = np.arctan((follower.offset - law(fine, 1)) / (lowest + law(fine)))
    best = found.extremes()['pressure_angle.contact'].greatest
    assert best.value == pytest.approx(alpha.max(), rel=1e-11)
    assert best.value > abs(found['pressure_angle.contact']).max()


@pytest.mark.parametrize(('sense', 'sign'), [('clockwise', -1), ('counterclockwise', 1)])
def test_angle_speed_and_torque_of_a_cam_count_in_its_sense(sense, sign):
    """Its drive, counterclockwise as all torques of links, is what balances the follower."""
    _, _, found = over_turn('offset_roller_cam', {'joints.contact.sense': sense})
    assert found['cam_speed.contact'] == pytest.approx(sign * found['velocity.cam'], rel=1e-12)
    torque = found['cam_torque.contact']
    assert np.ptp(torque) > 1e-3
    assert found['drive_torque'] == pytest.approx(-sign * torque, abs=1e-9 * np.ptp(torque))
    known = found.solution.catalogue
    told = [known[f'cam_{name}.contact'].words for name in ('angle', 'speed', 'torque')]
    assert all(text.endswith('positive in its sense') for text in told)


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', ['oscillating_roller', 'measured_cam', 'offset_roller_cam'])
def test_the_point_of_contact_is_on_roller_and_cam_and_moves_as_told(name):
    machine = ms.load_scene(name)
    found = cycle(machine, samples=360, duration=None if name != 'oscillating_roller' else 0.1)
    joint = next(j for j in machine.mechanism.joints if j.name == 'contact')
    h = 1e-6 * (found.t[-1] - found.t[0])
    t = found.t[5:-5:7]
    t = np.sort(np.concatenate([t - h, t, t + h]))
    seen = found.at(t)
    at = np.array([seen[f'contact.contact.{axis}'] for axis in 'xy'])
    # rotated back into the cam, the point moves along the profile at the speed told
    cam = seen[f'position.{joint.first}']
    c, s = np.cos(cam), np.sin(cam)
    x, y = at - np.array(joint.centre)[:, None]
    own = np.array([c * x + s * y, c * y - s * x]).reshape(2, -1, 3)
    moved = np.hypot(*(own[:, :, 2] - own[:, :, 0])) / (2 * h)
    told = abs(seen['contact_speed.contact']).reshape(-1, 3)[:, 1]
    assert moved == pytest.approx(told, rel=2e-5, abs=1e-6)
    points = cycle_points(machine, joint, found, t)
    assert np.hypot(*(at - points)) == pytest.approx(joint.cam.follower.roller, rel=1e-9)


def cycle_points(machine, joint, found, t):
    """The roller's centre."""
    return places_of(machine, joint.second, joint.on_second, found, t)


def places_of(machine, link, at, found, t):
    motion = found.solution.motion
    q = motion.curve(t).T
    places = dict(zip(machine.mechanism.coordinates, q, strict=True))
    return np.array(
        [
            machine.mechanism.locate(link, {c: float(x[i]) for c, x in places.items()}, at)
            for i in range(len(t))
        ]
    ).T


def test_a_law_whose_velocity_jumps_runs_as_kinematics(tmp_path):
    """[V] A.5 as printed: a quarter of a cosine, whose greatest velocity is at its end."""
    machine = ms.load_scene('offset_roller_cam', {f'{LAW}.segments': HALF})
    assert machine.level.value == 'kinematic'
    found = cycle(machine)
    lift, span, speed = 4e-3, math.radians(60), 10.0
    velocity = found.extremes()['velocity.follower'].greatest
    assert velocity.value == pytest.approx(lift * math.pi / 2 / span * speed, rel=1e-12)
    assert math.degrees(velocity.drive) % 360 == pytest.approx(300, abs=1e-9)
    t = math.radians(25) / speed
    assert found.at(np.array([t]))['velocity.follower'][0] == pytest.approx(
        lift * math.pi / 2 / span * speed * math.sin(math.pi / 2 * 25 / 60), rel=1e-12
    )
    report = check(machine)
    assert any('velocity jumps' in n and 'no limit' in n for n in report.notes)
    assert any('cut away' in n for n in report.notes)
    segments = ', '.join('{' + ', '.join(f'{k}: {v}' for k, v in s.items()) + '}' for s in HALF)
    given = ['offset_roller_cam', '--set', f'{LAW}.segments=[{segments}]']
    table = tmp_path / 'cam.csv'
    assert 'at 60 deg the velocity jumps' in run('cycle', *given).stdout
    run('draw', given[0], '--profile', 'contact', *given[1:], '--table', str(table))
    units = ' [rad]', ' [m]', ' [m/rad]', ' [m/rad^2]', ' [m/rad^3]', ' [rad]', *[' [m]'] * 2
    head = [x.partition(' ') for x in table.read_text().splitlines()[0].split(',')]
    assert [f' {unit}' for *_, unit in head] == [*units, *[' [m/rad]'] * 2]
    rows = np.genfromtxt(table, delimiter=',', names=[name for name, *_ in head], skip_header=1)
    at = np.isclose(rows['cam'], span, rtol=0.0, atol=1e-15)  # both sides of the corner
    assert sorted(rows['velocity'][at]) == pytest.approx([0.0, 6e-3], abs=1e-9)  # per radian
    assert (rows['cam'][0], rows['displacement'][0]) == (0.0, 0.0)
    run('draw', *given, '-o', str(tmp_path / 'cam.svg'))


def test_a_law_whose_velocity_jumps_is_refused_where_forces_are_needed(capsys):
    with pytest.raises(InputError, match=r'at 60 deg the velocity jumps.* dynamics needs forces'):
        ms.load_scene(
            'offset_roller_cam',
            {f'{LAW}.segments': HALF, 'joints.contact.lift_off': {'restitution': 0.5}},
        )
    machine = ms.load_scene('offset_roller_cam', {f'{LAW}.segments': HALF})
    with pytest.raises(InputError, match='no finite force'):
        lift_offs(machine)
    with pytest.raises(SystemExit) as left:
        main(['draw', 'gear_pair', '--profile', 'mesh', '--table', 'x.csv'])
    assert left.value.code == 2
    assert 'for cams, and mesh has none' in capsys.readouterr().err


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', ['oscillating_roller', 'offset_roller_cam', 'sliding_cam'])
def test_a_roller_spins_as_it_rolls_on_its_cam(name):
    """Cam and roller have one tangential velocity where they touch; differences of places."""
    machine = ms.load_scene(name)
    found = cycle(machine, samples=360)
    joint = next(j for j in machine.mechanism.joints if hasattr(j, 'cam'))
    h = 1e-5 * (found.t[-1] - found.t[0])
    t = found.t[5:-5:7]
    t = np.sort(np.concatenate([t - h, t, t + h]))
    seen = found.at(t)
    at = np.array([seen[f'contact.{joint.name}.{axis}'] for axis in 'xy'])[:, 1::3]

    def velocity(link, point, more):
        """Of the material point at the contact; ``more`` beside the turning of the link."""
        place = places_of(machine, link, point, found, t)
        moved, arm = (place[:, 2::3] - place[:, ::3]) / (2 * h), at - place[:, 1::3]
        slides = link in machine.mechanism.displacements
        spin = more + (0.0 if slides else seen[f'velocity.{link}'][1::3])
        return moved + spin * np.array([-arm[1], arm[0]]), arm

    spin = seen[f'roller_speed.{joint.name}'][1::3]
    of_roller, arm = velocity(joint.second, joint.on_second, spin)
    of_cam, _ = velocity(joint.first, (0.0, 0.0), 0.0)
    slip = arm[0] * (of_roller - of_cam)[1] - arm[1] * (of_roller - of_cam)[0]
    touching = np.abs(np.hypot(*arm) - joint.cam.follower.roller) < 1e-11
    assert touching.mean() > 0.4  # that of the sliding cam lifts off
    fastest = np.abs(of_cam).max()
    assert np.abs(slip / np.hypot(*arm))[touching].max() < 1e-5 * fastest
    assert np.ptp(spin) > 1.0
