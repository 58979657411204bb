"""Machines for other programs: read back there, they are the same."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from functools import cache

import numpy as np
import pytest
from builders import made

import mechanism_sim as ms
from mechanism_sim.catalogue import config_folder
from mechanism_sim.cli import main
from mechanism_sim.errors import InputError
from mechanism_sim.export import mjcf, sdf, urdf
from mechanism_sim.export.ideal import Ideal
from mechanism_sim.export.mjcf import to_mjcf
from mechanism_sim.export.sdf import to_sdf
from mechanism_sim.export.urdf import closing, to_urdf
from mechanism_sim.joints.slot.constraint import PinInSlot
from mechanism_sim.messages import TFMessage, deserialize
from mechanism_sim.nodes.publications import transforms
from mechanism_sim.planar.mechanism import Prismatic
from mechanism_sim.planar.points import GROUND

SCENES = ms.scene_names()


def numbers(text):
    return np.array([float(x) for x in text.split()])


def homogeneous(xyz, yaw=0.0):
    x, y, z = xyz
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]])


def frames_of_urdf(text, states):
    """Frames of all links in the world (4, 4), by walking the joints as the format says."""
    robot = ET.fromstring(text)
    joints = {j.find('child').get('link'): j for j in robot.iter('joint')}

    def place(joint):
        mimic = joint.find('mimic')
        if mimic is None:
            return states.get(joint.get('name'), 0.0)
        factor, offset = float(mimic.get('multiplier')), float(mimic.get('offset'))
        return factor * states[mimic.get('joint')] + offset

    def frame(link):
        if link not in joints:
            return np.eye(4)
        joint = joints[link]
        origin, kind = joint.find('origin'), joint.get('type')
        roll, pitch, yaw = numbers(origin.get('rpy'))
        assert roll == pitch == 0.0
        found = frame(joint.find('parent').get('link'))
        found = found @ homogeneous(numbers(origin.get('xyz')), yaw)
        if kind == 'fixed':
            return found
        axis = numbers(joint.find('axis').get('xyz'))
        if kind == 'prismatic':
            return found @ homogeneous(place(joint) * axis)
        assert (kind, *axis) == ('continuous', 0.0, 0.0, 1.0)
        return found @ homogeneous((0.0, 0.0, 0.0), place(joint))

    links = [link.get('name') for link in robot.iter('link')]
    assert len({*links}) == len(links) == len(joints) + 1, 'a tree with one root'
    return {link: frame(link) for link in links}


def machines():
    return ((name, machine(name)) for name in SCENES)


@cache
def machine(name):
    return ms.load_scene(name)


def posed(mechanism, q):
    """Frames (4, 4) of links at coordinates, of the ground, and of blocks in slots."""
    known = dict(zip(mechanism.coordinates, q, strict=True))
    angles = {b.name: mechanism.angle(b.name, known) for b in mechanism.bodies}
    frames = {
        link: homogeneous((*mechanism.locate(link, known), 0.0), angles[link]) for link in angles
    }
    frames[GROUND] = np.eye(4)
    for joint in mechanism.joints:
        if isinstance(joint, PinInSlot):
            pin = frames[joint.first] @ [*joint.on_first, 0.0, 1.0]
            frames[f'{joint.name}.block'] = homogeneous(pin[:3], angle_of(frames[joint.second]))
    return frames


def angle_of(frame):
    return np.arctan2(frame[1, 0], frame[0, 0])


def elsewhere(machine):
    """Coordinates of the ideal mechanism in which all loops are closed, not those of the start."""
    ideal, four_bar = machine.plan.ideal, machine.assembly.loop
    if four_bar:
        crank = machine.drive.start[0] + 0.3
        return np.array([crank, *four_bar.positions(np.array(crank))])
    kinematics, start = machine.plan.kinematics(list(machine.plan.laws)), machine.assembly.q
    for step in (0.1, -0.1, 0.02, -0.02):
        guess = start.copy()
        for c in machine.plan.laws:
            guess[ideal.coordinates.index(c)] += step * (
                ideal.size if c in ideal.displacements else 1
            )
        q, left = kinematics.positions(guess[:, None])
        if not left[0]:
            return q[:, 0]
    raise AssertionError(f'{machine.name} cannot move')


def inertias(text, tag):
    """Mass, centre and polar inertia by link, of a URDF or an SDF."""
    found = {}
    for link in ET.fromstring(text).iter('link'):
        inertial = link.find('inertial')
        if inertial is None:
            continue
        if tag == 'urdf':
            mass = inertial.find('mass').get('value')
            centre, inertia = (
                inertial.find('origin').get('xyz'),
                inertial.find('inertia').get('izz'),
            )
        else:
            mass, centre = inertial.find('mass').text, inertial.find('pose').text
            inertia = inertial.find('inertia/izz').text
        found[link.get('name')] = (float(mass), *numbers(centre)[:2], float(inertia))
    return found


def test_urdf_shows_links_where_tf_has_them():
    rng = np.random.default_rng(8)
    for name, machine in machines():
        mechanism = machine.mechanism
        q = rng.normal(size=(1, len(mechanism.coordinates)))
        states = dict(zip(mechanism.coordinates, q[0], strict=True))
        prefix = '' if rng.random() < 0.5 else 'left/'
        frames = frames_of_urdf(to_urdf(machine, prefix), states)
        (data,) = transforms(mechanism, prefix.__add__)(np.zeros(1), q)
        message = deserialize(data, TFMessage)
        for transform in message.transforms:
            at, turn = transform.transform.translation, transform.transform.rotation
            expected = homogeneous((at.x, at.y, 0.0), 2.0 * np.arctan2(turn.z, turn.w))
            assert np.array_equal(frames[transform.header.frame_id], np.eye(4))
            found = frames[transform.child_frame_id]
            assert np.abs(found - expected).max() < 1e-12, (name, transform.child_frame_id)


def test_urdf_moves_the_joints_that_joint_states_names():
    for name in ('whole_machine', 'loader', 'planetary'):
        scene = machine(name)
        joints = ET.fromstring(to_urdf(scene)).findall('joint')
        moved = {j.get('name') for j in joints if j.get('type') != 'fixed'}
        mimics = {j.get('name') for j in joints if j.find('mimic') is not None}
        assert moved - mimics == {*scene.physics.coordinates}
        # A controller that heeds limits must be able to move every joint.
        limits = [limit for joint in joints for limit in joint.findall('limit')]
        assert all(float(x.get(word)) > 1e6 for x in limits for word in ('effort', 'velocity'))


def test_urdf_lists_the_joints_that_close_loops():
    """Every joint of every machine is of the tree or in a comment, at the points of its links."""
    for name, scene in machines():
        mechanism = scene.mechanism
        tree = {joint.name for joint in mechanism.tree_joints.values()}
        said = {s.split(': ')[0]: s for s in closing(scene)}
        assert set(said) | tree == {joint.name for joint in mechanism.joints}, name
        assert not set(said) & tree, name
        assert {j for j, s in said.items() if 'loose' in s} == {*scene.plan.clearances} - tree
        urdf = to_urdf(scene)
        assert all(f'<!-- {sentence} -->' in urdf for sentence in said.values())
    said = closing(machine('four_bar_clearance'))
    assert said == [
        'coupler_rocker: a loose joint outside of the tree, '
        'between coupler at (0.309, 0.0) m and rocker at (0.312, 0.0) m'
    ]


def test_links_weigh_what_they_do_in_the_scene():
    for name, machine in machines():
        for tag, text in (('urdf', to_urdf(machine)), ('sdf', to_sdf(machine))):
            found = inertias(text, tag)
            for body in machine.plan.bodies:
                if body.mass and body.inertia:
                    assert found[body.name] == (body.mass, *body.cog, body.inertia), (name, tag)
                elif tag == 'urdf':
                    assert (body.name in found) == bool(body.mass)
                else:
                    assert min(found[body.name][0], found[body.name][3]) > 0.0


def test_joints_of_sdf_hold_wherever_the_mechanism_goes():
    for name, machine in machines():
        (model,) = ET.fromstring(to_sdf(machine)).iter('model')
        poses = {x.get('name'): numbers(x.find('pose').text) for x in model.findall('link')}
        start = {link: homogeneous(p[:3], p[5]) for link, p in poses.items()}
        now = posed(machine.plan.ideal, elsewhere(machine))
        assert start.keys() == now.keys()
        for joint in model.findall('joint'):
            parent, child = joint.find('parent').text, joint.find('child').text
            if parent == 'world':
                continue
            turned = {x: angle_of(now[x]) - angle_of(start[x]) for x in (parent, child)}
            if joint.get('type') == 'gearbox':
                if joint.get('name') in machine.plan.elastic:  # its teeth give way at the start
                    continue
                base = joint.find('gearbox_reference_body').text
                base = angle_of(now[base]) - angle_of(start[base])
                ratio = float(joint.find('gearbox_ratio').text)
                off = turned[child] - base + ratio * (turned[parent] - base)
                whole = 2.0 * np.pi * min(1.0, ratio)
                assert abs(np.remainder(off + 0.5 * whole, whole) - 0.5 * whole) < 1e-9, name
                continue
            anchor = homogeneous(numbers(joint.find('pose').text)[:3])
            on_parent = now[parent] @ np.linalg.inv(start[parent]) @ start[child] @ anchor
            apart = np.linalg.inv(now[child] @ anchor) @ on_parent
            if joint.get('type') == 'fixed':
                assert np.abs(apart - np.eye(4)).max() < 1e-9, (name, joint.get('name'))
                continue
            way = numbers(joint.find('axis/xyz').text)
            if joint.get('type') == 'prismatic':
                assert np.abs(apart[:3, :3] - np.eye(3)).max() < 1e-9, (name, joint.get('name'))
                assert np.abs(np.cross(apart[:3, 3], way)).max() < 1e-9, (
                    name,
                    joint.get('name'),
                )
            else:
                assert np.abs(apart[:3, 3]).max() < 1e-9, (name, joint.get('name'))


def along(joint, frames):
    """Displacement of a guide whose links lie so."""
    line, runner = frames[joint.first], frames[joint.second]
    at, there = line @ [*joint.on_first, 0.0, 1.0], runner @ [*joint.on_second, 0.0, 1.0]
    return line @ [np.cos(joint.axis), np.sin(joint.axis), 0.0, 0.0] @ (there - at)


def test_drake_moves_trees_of_sdf():
    """Its reader is that of Gazebo. It has neither loops nor gearboxes: they are taken off."""
    parsing = pytest.importorskip('pydrake.multibody.parsing')
    from pydrake.multibody.plant import MultibodyPlant  # noqa: PLC0415

    for name in ('four_bar_nominal', 'loader', 'planetary', 'quick_return', 'rotary_engine'):
        scene = machine(name)
        ideal = Ideal(scene)
        root = ET.fromstring(to_sdf(scene))
        (model,) = root.iter('model')
        closing = {joint.name for joint in ideal.closing}
        for joint in model.findall('joint'):
            if joint.get('type') == 'gearbox' or joint.get('name') in closing:
                model.remove(joint)
        plant = MultibodyPlant(0.0)
        parsing.Parser(plant).AddModelsFromString(ET.tostring(root, encoding='unicode'), 'sdf')
        plant.Finalize()
        assert plant.num_positions() == len(ideal.mechanism.bodies)
        start = {
            link: homogeneous((x, y, 0.0), turn) for link, (x, y, turn) in ideal.poses.items()
        }
        for frames in (start, posed(scene.plan.ideal, elsewhere(scene))):
            context = plant.CreateDefaultContext()
            for link, joint in ideal.mechanism.tree_joints.items():
                found = plant.GetJointByName(joint.name)
                if isinstance(joint, Prismatic):
                    found.set_translation(context, along(joint, frames) - along(joint, start))
                else:
                    parent = found.parent_body().name()
                    now, then = (angle_of(x[link]) - angle_of(x[parent]) for x in (frames, start))
                    found.set_angle(context, now - then)
            for link in ideal.mechanism.tree_joints:
                pose = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(link))
                assert np.abs(pose.GetAsMatrix4() - frames[link]).max() < 1e-12, (name, link)
        for body in scene.plan.bodies:
            assert plant.GetBodyByName(body.name).default_mass() == body.mass


def simulated(scene, factor, share=1.0, integrator='mjINT_RK4'):
    """MuJoCo's model and state after a share of the run, with so many of the file's time steps."""
    mujoco = pytest.importorskip('mujoco')
    model = mujoco.MjModel.from_xml_string(to_mjcf(scene))
    duration = share * (scene.scene.duration or scene.drive.period)
    steps = round(duration / (factor * model.opt.timestep))
    servos = model.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE
    servos &= model.actuator_gainprm[:, 0] > 1.0  # speeds are held as firmly as a step allows
    stiffer = steps * model.opt.timestep / duration
    model.actuator_gainprm[servos, 0] *= stiffer
    model.actuator_biasprm[servos, 2] *= stiffer
    model.opt.timestep = duration / steps
    model.opt.integrator = getattr(mujoco.mjtIntegrator, integrator)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, nstep=steps)
    mujoco.mj_forward(model, data)
    return data, duration


def off(scene, data, q):
    """Largest difference of a link's frame, places in sizes of the machine."""
    frames, size = posed(scene.plan.ideal, q), scene.plan.ideal.size
    largest = 0.0
    for body in scene.plan.bodies:
        found, frame = data.body(body.name), frames[body.name]
        largest = max(largest, *np.abs(found.xpos - frame[:3, 3]) / size)
        largest = max(largest, *np.abs(found.xmat.reshape(3, 3) - frame[:3, :3]).ravel())
    return largest


def test_mjcf_is_the_mechanism_at_the_start_and_elsewhere():
    mujoco = pytest.importorskip('mujoco')
    for name, machine in machines():
        model = mujoco.MjModel.from_xml_string(to_mjcf(machine))
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        assert np.abs(data.efc_pos).max(initial=0.0) < 1e-12, name
        if not machine.plan.elastic:  # teeth that give way have started to
            assert np.abs(data.efc_vel).max(initial=0.0) < 1e-10 * max(
                1.0, machine.drive.fastest
            ), name
        for body in machine.plan.bodies:
            k = model.body(body.name).id
            if body.mass and body.inertia:
                assert model.body_mass[k] == body.mass
                assert model.body_ipos[k].tolist() == [*body.cog, 0.0]
                assert model.body_inertia[k].max() == body.inertia
        q = elsewhere(machine)
        frames = posed(machine.plan.ideal, q)
        for k in range(model.njnt):
            joint = Ideal(machine).mechanism.joint(model.joint(k).name)
            child = model.jnt_bodyid[k]
            link, parent = (model.body(x).name for x in (child, model.body_parentid[child]))
            if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_HINGE:
                frames.setdefault('world', np.eye(4))
                data.qpos[k] = angle_of(frames[link]) - angle_of(frames[parent])
            else:
                data.qpos[k] = along(joint, frames)
        mujoco.mj_forward(model, data)
        assert off(machine, data, q) < 1e-12, name
        loops = data.efc_pos[: sum(data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY)]
        gears = {c.joint.name for c in Ideal(machine).couplings}
        assert gears or np.abs(loops).max(initial=0.0) < 1e-9, name


LOADED = """
title: Two bars with everything that pulls
mechanism: linkage
links:
  ground: {points: {hook: [-100 mm, 250 mm]}}
  upper: {length: 200 mm, cog: 90 mm, mass: 0.4 kg, inertia: 1500 kg mm^2,
          points: {side: [60 mm, 20 mm]}}
  lower: {length: 150 mm, cog: [70 mm, 10 mm], mass: 0.3 kg, inertia: 600 kg mm^2}
  wheel: {length: 100 mm, cog: [20 mm, 5 mm], mass: 0.2 kg, inertia: 300 kg mm^2}
joints:
  shoulder: {revolute: [ground, upper]}
  elbow: {revolute: [lower, upper.end]}
  shaft: {transmission: [upper, wheel], ratio: -2/3}
gravity: [0 m/s^2, -9.81 m/s^2]
initial: {position: {upper: -30 deg, lower: 20 deg}, velocity: {upper: 2 rad/s}}
springs:
  coil: {between: [upper, lower], stiffness: 0.4 N m/rad, damping: 0.003 N m s/rad,
         free_angle: 50 deg}
  string: {between: [ground.hook, lower.end], stiffness: 30 N/m, damping: 0.2 N s/m,
           free_length: 100 mm}
loads:
  wind: {at: lower.end, force: [1.5 N, 0.5 N], torque: 0.02 N m}
  jet: {at: upper.side, force: [0.7 N, -1.1 N], frame: link}
duration: 0.5 s
"""

GUIDED = """
title: A ram in a bore of a sledge, with springs along both guides
mechanism: linkage
links:
  sledge: {mass: 2 kg, inertia: 0.01 kg m^2, cog: [10 mm, 5 mm]}
  ram: {mass: 0.5 kg, inertia: 0.001 kg m^2}
joints:
  rail: {prismatic: [ground, sledge], axis: 30 deg}
  bore: {prismatic: [ram, sledge], axis: 70 deg}
gravity: [0 m/s^2, -9.81 m/s^2]
initial: {position: {sledge: 40 mm, ram: -30 mm}, velocity: {sledge: 0.2 m/s, ram: -0.1 m/s}}
springs:
  buffer: {coordinate: sledge, stiffness: 300 N/m, damping: 2 N s/m, free_length: 25 mm}
  second: {coordinate: sledge, stiffness: 100 N/m, free_length: -10 mm}
  return: {coordinate: ram, stiffness: 200 N/m, damping: 1 N s/m, free_length: -50 mm}
duration: 0.5 s
"""


@pytest.mark.parametrize(
    ('name', 'share', 'error'),
    [
        ('andrews_squeezer', 0.5, 3e-6),  # a torque and a spring
        ('catapult', 1.0, 1e-7),
        ('four_bar_nominal', 1.0, 1e-7),
        ('quick_return', 0.5, 1e-4),  # a light block in a slot
        ('double_rocker_tracing', 0.3, 1e-6),  # a drive of a link that hangs on another
        ('rotary_engine', 0.5, 1e-7),  # a guide on a moving link
        ('planetary', 0.5, 1e-9),
        ('loaded', 1.0, 1e-7),
        ('guided', 1.0, 1e-7),
    ],
)
def test_mujoco_moves_as_we_do_the_finer_the_nearer(name, share, error, tmp_path):
    if text := {'loaded': LOADED, 'guided': GUIDED}.get(name):
        (tmp_path / f'{name}.yaml').write_text(text)
        name = str(tmp_path / f'{name}.yaml')
    scene = ms.load_scene(name)
    errors = []
    for factor in (4.0, 2.0):
        data, duration = simulated(scene, factor, share)
        q = ms.simulate(scene, duration=duration).view(np.array([duration])).observed.position
        errors.append(off(scene, data, q[:, 0]))
    assert errors[1] < error
    assert errors[1] < 0.3 * errors[0] or errors[0] < 1e-10


@pytest.mark.parametrize('name', ['four_bar_nominal', 'scotch_yoke', 'slider_crank'])
def test_mujoco_needs_our_drive_torque(name):
    """With Euler's method: the stages of Runge and Kutta's need forces of their own."""
    scene, errors = ms.load_scene(name), []
    for factor in (2.0, 1.0, 0.5):
        data, duration = simulated(scene, factor, 0.8, 'mjINT_EULER')
        t = np.linspace(0.0, duration, 9)
        torque = (
            ms.simulate(scene, duration=duration).sample(t, 'drive_torque')['drive_torque'].ravel()
        )
        errors.append(abs(data.actuator('crank').force.item() - torque[-1]) / np.abs(torque).max())
    assert errors[2] < 0.005
    assert errors[2] < 0.6 * errors[1] < 0.4 * errors[0]


def test_names_that_other_programs_do_not_have(tmp_path):
    text = (config_folder() / 'pendulum.yaml').read_text()
    (tmp_path / 'twice.yaml').write_text(text.replace('ground_bar:', 'bar:'))
    sdf = ET.fromstring(to_sdf(ms.load_scene(str(tmp_path / 'twice.yaml'))))
    assert [joint.get('name') for joint in sdf.iter('joint')] == ['world_ground', 'bar_joint']
    (tmp_path / 'world.yaml').write_text(re.sub(r'\bbar\b', 'world', text))
    for to in (to_urdf, to_mjcf, to_sdf):
        with pytest.raises(InputError, match='rename it'):
            to(ms.load_scene(str(tmp_path / 'world.yaml')))


def test_export_says_what_is_left_out(tmp_path, capsys):
    for kind, lost in (
        ('mjcf', 'cam: left out'),
        ('sdf', 'springs.spring: left out'),
        ('urdf', 'circle'),
    ):
        file = tmp_path / f'machine.{kind}'
        with pytest.raises(SystemExit) as left:
            main(('export', 'whole_machine', '--format', kind, '-o', str(file)))
        assert left.value.code == 0
        told = capsys.readouterr()
        assert lost in told.err
        assert told.out.strip() == str(file)
        assert all(line.partition(': ')[2] in file.read_text() for line in told.err.splitlines())


@pytest.mark.parametrize(
    ('args', 'says'),
    [
        (('--format', 'sdf', '-o', 'no/such/folder.sdf'), 'cannot be written'),
        (
            ('--format', 'mjcf', '--frame-prefix', 'left/'),
            '--frame-prefix needs --format urdf, foxglove or rviz',
        ),
        (('--format', 'urdf', '--set', 'links.crank.length=-1 m'), 'links.crank.length'),
    ],
)
def test_exports_that_cannot_be_are_refused(args, says, capsys):
    with pytest.raises(SystemExit) as left:
        main(('export', 'four_bar_nominal', *args))
    assert left.value.code == 2
    told = capsys.readouterr().err
    assert says in told.splitlines()[-1]


def test_what_no_format_has_is_said():
    """Gravity, springs, loads and sensors went without a word."""
    machine = ms.load_scene('rubbing_compressor', {
        'joints.rod_piston': {
            'revolute': ['rod.end', 'piston'],
            'clearance': {'radial': '0.1 mm', 'restitution': 0.5},
        },
        'sensors': {'pick_up': {
        'link': 'rod', 'at': '10 mm', 'axis': 'across', 'sample_rate': '10 kHz'}}})  # fmt: skip
    (said,) = [x for x in urdf.left_out(machine) if x.startswith('left out, for URDF')]
    frictions = [
        f'the friction of {friction.name}'
        for friction in machine.plan.frictions(machine.plan.ideal)
    ]
    named = (
        'gravity',
        'the clearance of rod_piston',
        *frictions,
        *(e.name for e in machine.plan.elements(machine.plan.ideal)),
        'pick_up',
    )
    assert all(name in said for name in named)
    for others in (mjcf.left_out, sdf.left_out):
        assert 'pick_up: this sensor is left out' in others(machine)


@pytest.mark.parametrize('drive', [None, {'speed': 0.0}, {'speed': 2.0}, {'torque': 0.0}])
def test_every_format_has_the_drives_that_the_scene_gives_and_no_other(drive):
    """Also one that holds a link at rest, of which a law alone does not tell."""
    machine = made({
        'links': {'arm': {'length': 0.3, 'cog': 0.1, 'mass': 1.0, 'inertia': 0.01}},
        'joints': {'pivot': {'revolute': ['ground', 'arm']}}, 'duration': 1.0,
        **({'drive': {'coordinate': 'arm', **drive}} if drive else {}),
    })  # fmt: skip
    told = drive is not None
    assert any('the drive of arm' in x for x in urdf.left_out(machine)) == told
    assert any(x.startswith('arm: its drive is left out') for x in sdf.left_out(machine)) == told
    actuator = ET.fromstring(to_mjcf(machine)).find('actuator')
    assert (actuator is not None and len(actuator) > 0) == told
