"""SDF of the ideal mechanism of a machine, for Gazebo and its kin.

All joints are written, loop-closing ones too, which not every engine supports. Gears
are joints of the type gearbox.
"""

from __future__ import annotations

from xml.etree.ElementTree import SubElement

from mechanism_sim.export.ideal import (
    WORLD,
    Ideal,
    Solid,
    check_names,
    solids,
    time_step,
    way,
)
from mechanism_sim.export.markup import Element, comment, text, written
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.mechanism import Joint, Prismatic, Weld
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.scene.drives import read_drives
from mechanism_sim.scene.machine import Machine

VERSION = '1.7'


def to_sdf(machine: Machine) -> str:
    """The text of an SDF file: a world with the scene's gravity and the machine at its start.

    Links and joints are named as those of the scene, a joint named as a link is has `_joint`
    added; `ground` is a link fixed to the world. The
    coordinates of joints count from the start. What is left out is in comments, see `left_out`.
    """
    check_names(machine)
    ideal = Ideal(machine)
    root = Element('sdf', version=VERSION)
    comment(root, machine.scene.title, *left_out(machine))
    world = SubElement(root, 'world', name=f'world_of_{machine.name}')
    physics = SubElement(world, 'physics', name='fine', type='ode')
    _leaves(physics, max_step_size=text(time_step(machine)), real_time_factor='1')
    _leaves(world, gravity=text(*machine.scene.gravity, 0.0))
    model = SubElement(world, 'model', name=machine.name)
    drawn = solids(machine)
    _link(model, ideal, Body(GROUND, 1.0, 1.0, (0.0, 0.0)), drawn)
    _joint(model, f'{WORLD}_{GROUND}', 'fixed', WORLD, GROUND, pose='0 0 0 0 0 0')
    for body in ideal.mechanism.bodies:
        _link(model, ideal, body, drawn)
    for link in ideal.mechanism.tree_joints:
        _lower_pair(model, ideal.mechanism.tree_joints[link], link)
    for joint in ideal.closing:
        _lower_pair(model, joint, joint.first if joint.second == GROUND else joint.second)
    for coupling in ideal.couplings:
        if not any(coupling.racks):
            # second = -ratio first, both angles relative to the carrier
            pair, (one, other) = coupling.joint, coupling.factors
            made = _joint(
                model, pair.name, 'gearbox', pair.first, pair.second,
                gearbox_ratio=text(one / other), gearbox_reference_body=coupling.carrier,
            )  # fmt: skip
            for axis in ('axis', 'axis2'):
                _leaves(SubElement(made, axis), xyz='0 0 1')
    return written(root)


def left_out(machine: Machine) -> list[str]:
    """Properties of a machine that SDF cannot express, in sentences."""
    ideal, plan = Ideal(machine), machine.plan
    found = [*ideal.left_out()]
    found += [
        f'{coupling.joint.name}: left out: a gearbox has no rack'
        for coupling in ideal.couplings
        if any(coupling.racks)
    ]
    found += [f'{element.name}: left out: forces are for plugins' for element in
              plan.elements(plan.ideal)]  # fmt: skip
    found += [f'{c}: its drive is left out: drives are for plugins' for c in read_drives(plan)]
    found += [f'{name}: this sensor is left out' for name in machine.scene.sensors]
    return [*found, 'all links start at rest']


def _link(model: Element, ideal: Ideal, body: Body, drawn: list[Solid]) -> None:
    """A link at its start pose."""
    x, y, angle = ideal.poses[body.name]
    link = SubElement(model, 'link', name=body.name)
    _leaves(link, pose=_pose((x, y), angle))
    inertial = SubElement(link, 'inertial')
    _leaves(inertial, pose=_pose(body.cog), mass=text(body.mass))
    half = text(0.5 * body.inertia)
    inertia = SubElement(inertial, 'inertia')
    _leaves(inertia, ixx=half, iyy=half, izz=text(body.inertia), ixy='0', ixz='0', iyz='0')
    for k, solid in enumerate(s for s in drawn if s.link == body.name):
        visual = SubElement(link, 'visual', name=f'{body.name}_{k}')
        _leaves(visual, pose=_pose(solid.at[:2], solid.turn, solid.at[2]))
        shape = SubElement(SubElement(visual, 'geometry'), solid.kind)
        if solid.kind == 'box':
            _leaves(shape, size=text(*solid.size))
        else:
            _leaves(shape, radius=text(solid.size[0]), length=text(solid.size[1]))
        material = SubElement(visual, 'material')
        _leaves(material, ambient=f'{solid.colour} 1', diffuse=f'{solid.colour} 1')


def _lower_pair(model: Element, joint: Joint, child: str) -> None:
    """A joint of the tree, in the frame of the link that it carries."""
    (_, at), (parent, _) = joint.across(child)
    kind = 'prismatic' if isinstance(joint, Prismatic) else 'revolute'
    if isinstance(joint, Weld):
        _joint(model, joint.name, 'fixed', parent, child, pose=_pose(at))
        return
    written_joint = _joint(model, joint.name, kind, parent, child, pose=_pose(at))
    along = (*way(joint, child), 0.0) if isinstance(joint, Prismatic) else (0.0, 0.0, 1.0)
    _leaves(SubElement(written_joint, 'axis'), xyz=text(*along))


def _joint(
    model: Element, name: str, kind: str, parent: str, child: str, **leaves: str
) -> Element:
    taken = {part.get('name') for part in model}
    while name in taken:  # unlike in scenes, a joint may not have the name of a link
        name += '_joint'
    joint = SubElement(model, 'joint', name=name, type=kind)
    _leaves(joint, parent=parent, child=child, **leaves)
    return joint


def _leaves(element: Element, **contents: str) -> None:
    """Elements that hold text, by name."""
    for name, content in contents.items():
        SubElement(element, name).text = content


def _pose(at: Vector2, angle: float = 0.0, z: float = 0.0) -> str:
    return text(*at, z, 0.0, 0.0, angle)
