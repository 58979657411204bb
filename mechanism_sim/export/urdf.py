"""URDF for viewers of ROS, which show a machine by its topic `joint_states`.

URDF has trees only, and joints with relative coordinates; the coordinates of a mechanism
are absolute angles of links, and displacements. So between a link and the one it carries
there is a non-rotating frame: its joint mimics the negative angle of the carrying link. The
carried link's joint then has the absolute angle. Loops close because the coordinates of all
links come from their solution.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import SubElement

from mechanism_sim.export.ideal import WORLD, Solid, check_names, frame_of, solids, way
from mechanism_sim.export.markup import Element, comment, text, written
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.mechanism import HigherPair, Mechanism, Prismatic, Revolute, Weld
from mechanism_sim.planar.points import GROUND, Vector2, rotate
from mechanism_sim.planar.rotor import Rotor
from mechanism_sim.scene.drives import read_drives
from mechanism_sim.scene.machine import Machine

_FREE = '1e12'  # [N, m/s] limits of joints without any: with 0 no controller could move them


def to_urdf(machine: Machine, prefix: str = '') -> str:
    """The text of a URDF file of a machine, for `robot_state_publisher`.

    Links are named as the frames on `/tf`, in the world `world`; movable joints as the coordinates
    in `joint_states`. Frames between them have names with a dot. Links without mass have no
    inertia; that of the others about the axes in the plane is that of a flat disc, since a planar
    machine has none.

    Parameters
    ----------
    prefix : prefix of all frame names, as `frame_prefix` of the nodes
    """
    check_names(machine)
    mechanism = machine.mechanism
    robot = Element('robot', name=machine.name)
    comment(robot, machine.scene.title, *left_out(machine), *closing(machine))
    drawn = solids(machine)
    _link(robot, prefix + WORLD, None, drawn)
    tree = _Tree(robot, mechanism, prefix)
    for body in mechanism.bodies:
        _link(robot, prefix + body.name, body, drawn)
        if body.name in mechanism.floating:
            # two displacements of the centre of gravity, and the angle
            tree.shifted(body.name, GROUND, (0.0, 0.0))
            tree.turning(body.name, f'{body.name}.y', (0.0, 0.0), body.cog)
        else:
            tree.carry(body.name)
    _loops(robot, mechanism, prefix)
    # the coordinates at the start, for readers of `state` only
    state = SubElement(robot, 'state', model=machine.name)
    state.set('time_from_start', '0')
    for name, value in zip(machine.plan.ideal.coordinates, machine.assembly.q, strict=True):
        SubElement(state, 'joint_state', joint=name, position=text(float(value)))
    return written(robot)


def drivers_urdf(
    machine: Machine, driven: Sequence[str], limits: Mapping[str, tuple[float, float]]
) -> str:
    """The text of a URDF file with a joint for each driving coordinate only.

    For panels with a slider for every joint of a description: in a closed machine, all others
    follow.

    Parameters
    ----------
    limits : range of coordinates [rad, m]; coordinates without one are unlimited
    """
    return written(_axes(machine, driven, limits))


def controlled_urdf(
    machine: Machine, component: str, commanded: str, kind: str, topics: Mapping[str, str]
) -> str:
    """The text of a URDF file for ``ros2_control``: each coordinate a joint of its own.

    The hardware is that of the package ``joint_state_topic_hardware_interface``: the joint
    `commanded` takes a command of a `kind`, all have states.

    Parameters
    ----------
    topics : topics of the component: ``states`` and ``commands``
    """
    robot = _axes(machine, machine.plan.ideal.coordinates, {})
    control = SubElement(robot, 'ros2_control', name=component, type='system')
    hardware = SubElement(control, 'hardware')
    plugin = SubElement(hardware, 'plugin')
    plugin.text = 'joint_state_topic_hardware_interface/JointStateTopicSystem'
    # Else commands close to the state would be suppressed: each step needs one.
    given = {f'joint_{x}_topic': topic for x, topic in topics.items()}
    for name, value in {**given, 'trigger_joint_command_threshold': '-1'}.items():
        SubElement(hardware, 'param', name=name).text = value
    for name in machine.plan.ideal.coordinates:
        joint = SubElement(control, 'joint', name=name)
        if name == commanded:
            SubElement(joint, 'command_interface', name=kind)
        for state in ('position', 'velocity', 'effort'):
            SubElement(joint, 'state_interface', name=state)
    return written(robot)


def _axes(
    machine: Machine, names: Sequence[str], limits: Mapping[str, tuple[float, float]]
) -> Element:
    """A joint for each of some coordinates, from the world to a link of its own."""
    robot = Element('robot', name=machine.name)
    SubElement(robot, 'link', name=WORLD)
    for name in names:
        straight = name in machine.plan.ideal.displacements
        low, high = limits.get(name, (-math.inf, math.inf))
        bounded = math.isfinite(low) or math.isfinite(high) or straight
        kind = 'prismatic' if straight else 'revolute' if bounded else 'continuous'
        joint = SubElement(robot, 'joint', name=name, type=kind)
        SubElement(joint, 'parent', link=WORLD)
        SubElement(joint, 'child', link=name)
        SubElement(joint, 'axis', xyz='1 0 0' if straight else '0 0 1')
        if bounded:
            far = machine.plan.ideal.reach if straight else math.pi
            ends = {'lower': text(max(low, -far)), 'upper': text(min(high, far))}
            SubElement(joint, 'limit', ends, effort=_FREE, velocity=_FREE)
        SubElement(robot, 'link', name=name)
    return robot


def left_out(machine: Machine) -> list[str]:
    """Properties of a machine that URDF cannot show, in sentences."""
    tilted = [
        f'{link}: it does not tilt here'
        for link, rotor in machine.mechanism.having(Rotor).items()
        if rotor.angles
    ]
    circles = [
        f'{joint.name}: its profile is drawn as a circle'
        for joint in machine.plan.joints
        if isinstance(joint, HigherPair) and joint.discs() and not joint.coupling
    ]
    plan, scene = machine.plan, machine.scene
    forces = ['gravity'] * any(scene.gravity) + [e.name for e in plan.elements(plan.ideal)]
    forces += [f'the drive of {c}' for c in read_drives(plan)]
    loose = [f'the clearance of {joint}' for joint in plan.clearances]
    stops = [f'the stops of {joint.name}' for joint in plan.joints if joint.name in plan.touching]
    frictions = [f'the friction of {friction.name}' for friction in plan.frictions(plan.ideal)]
    rest = [*loose, *stops, *frictions, *forces, *(f'the sensor {name}' for name in scene.sensors)]
    shows = [f'left out, for URDF has links and joints: {", ".join(rest)}'] if rest else []
    return tilted + circles + shows


def closing(machine: Machine) -> list[str]:
    """The joints outside the tree, in sentences: the motion closes these loops."""
    loose, tree = machine.plan.clearances, machine.mechanism.tree_joints.values()
    found = []
    for joint in machine.mechanism.joints:
        if joint in tree:
            continue
        ends = [(joint.first, ''), (joint.second, '')]
        if isinstance(joint, Revolute | Prismatic):
            places = joint.on_first, joint.on_second
            ends = [
                (link, f' at ({text(*at).replace(" ", ", ")}) m')
                for (link, _), at in zip(ends, places, strict=True)
            ]
        kind = 'a loose joint' if joint.name in loose else 'a joint'
        sides = ' and '.join(f'{link}{place}' for link, place in ends)
        found.append(f'{joint.name}: {kind} outside of the tree, between {sides}')
    return found


def _loops(robot: Element, mechanism: Mechanism, prefix: str) -> None:
    """Loop-closing joints in the form of URDF+ (M. Chignoli et al., arXiv 2411.19753).

    Readers without loops ignore them.
    """
    tree = mechanism.tree_joints.values()
    sides = 'predecessor', 'successor'
    for joint in (j for j in mechanism.joints if j not in tree):
        kind, axis = 'continuous', (0.0, 0.0, 1.0)
        if isinstance(joint, Prismatic):
            kind, axis = 'prismatic', (*way(joint, joint.second), 0.0)
        elif isinstance(joint, HigherPair) and joint.line:
            kind, axis = 'slot', (*rotate((1.0, 0.0), joint.line.axis), 0.0)
        elif isinstance(joint, HigherPair):
            if (gears := joint.coupling) and not any(gears.racks):
                coupling, (one, other) = (
                    SubElement(robot, 'coupling', name=joint.name),
                    gears.factors,
                )
                for side, link in zip(
                    (*sides, 'reference'), (joint.first, joint.second, gears.carrier), strict=True
                ):
                    SubElement(coupling, side, link=frame_of(link, prefix))
                SubElement(coupling, 'ratio', value=text(-one / other))
            continue
        loop = SubElement(robot, 'loop', name=joint.name, type=kind)
        for side, (link, at) in zip(sides, joint.points, strict=True):
            _origin(SubElement(loop, side, link=frame_of(link, prefix)), (*at, 0.0), 0.0)
        SubElement(loop, 'axis', xyz=text(*axis))


class _Tree:
    """Writer of the joints that carry links."""

    def __init__(self, robot: Element, mechanism: Mechanism, prefix: str) -> None:
        self._robot, self._mechanism, self._prefix = robot, mechanism, prefix
        self._far = mechanism.reach * (len(mechanism.bodies) + 1)

    def carry(self, link: str) -> None:
        """Write the joint that carries a link, and frames before and behind it."""
        m = self._mechanism
        j = m.tree_joints[link]
        ahead = j.first == link  # the joint is reversed: its first link is the carried one
        (_, here), (parent, there) = j.across(link)
        if isinstance(j, Prismatic):
            turn, child = -j.angle if ahead else j.angle, self._before(link, here)
            self._joint(link, 'prismatic', parent, child, there, turn, way(j, link))
            return
        if isinstance(j, Weld):
            turn = -j.angle if ahead else j.angle
            self._joint(f'{link}.weld', 'fixed', parent, self._before(link, here), there, turn)
            return
        if link in m.having(Rotor):
            self.shifted(link, parent, there)
            self.turning(link, f'{link}.y', (0.0, 0.0), here)
            return
        frame, offset = m.frame(parent)
        if frame == GROUND:
            self.turning(link, parent, there, here, -offset)
            return
        upright = self._frame(f'{link}.carrier')
        carrier = self._joint(upright, 'continuous', parent, f'{link}.carrier', there)
        SubElement(carrier, 'mimic', joint=frame, multiplier='-1', offset=text(-offset))
        self.turning(link, f'{link}.carrier', (0.0, 0.0), here)

    def shifted(self, link: str, parent: str, there: Vector2) -> None:
        """Write two displacements of a link from a point of its parent."""
        x, y = (self._frame(f'{link}.{axis}') for axis in 'xy')
        self._joint(x, 'prismatic', parent, f'{link}.x', there, along=(1.0, 0.0))
        self._joint(y, 'prismatic', f'{link}.x', f'{link}.y', along=(0.0, 1.0))

    def turning(
        self, link: str, parent: str, there: Vector2, here: Vector2, turn: float = 0.0
    ) -> None:
        self._joint(link, 'continuous', parent, self._before(link, here), there, turn)

    def _before(self, link: str, here: Vector2) -> str:
        """Child frame of a joint at `here` of a link: the link's frame, or one at the joint."""
        if here == (0.0, 0.0):
            return link
        hub = f'{link}.joint'
        self._frame(hub)
        self._joint(f'{link}.fixed', 'fixed', hub, link, (-here[0], -here[1]))
        return hub

    def _frame(self, name: str) -> str:
        SubElement(self._robot, 'link', name=self._prefix + name)
        return name

    def _joint(
        self,
        name: str,
        kind: str,
        parent: str,
        child: str,
        at: Vector2 = (0.0, 0.0),
        turn: float = 0.0,
        along: Vector2 = (0.0, 0.0),
    ) -> Element:
        """Write a joint; a prismatic one moves its child `along` a direction."""
        joint = SubElement(self._robot, 'joint', name=name, type=kind)
        parent = self._prefix + (WORLD if parent == GROUND else parent)
        SubElement(joint, 'parent', link=parent)
        SubElement(joint, 'child', link=self._prefix + child)
        _origin(joint, (*at, 0.0), turn)
        if kind == 'prismatic':
            SubElement(joint, 'axis', xyz=text(*along, 0.0))
            # The format requires limits, which the motion has not: a controller that respects them
            # must be able to move the joint.
            far = text(self._far)
            SubElement(joint, 'limit', lower=f'-{far}', upper=far, effort=_FREE, velocity=_FREE)
        elif kind == 'continuous':
            SubElement(joint, 'axis', xyz='0 0 1')
        return joint


def _link(robot: Element, name: str, body: Body | None, drawn: list[Solid]) -> None:
    """Write a link with its mass and visible shape; the ground has no body."""
    link = SubElement(robot, 'link', name=name)
    if body is not None and body.mass:
        inertial = SubElement(link, 'inertial')
        _origin(inertial, (*body.cog, 0.0), 0.0)
        SubElement(inertial, 'mass', value=text(body.mass))
        flat, polar = text(0.5 * body.inertia), text(body.inertia)
        SubElement(inertial, 'inertia', ixx=flat, iyy=flat, izz=polar, ixy='0', ixz='0', iyz='0')
    owner = GROUND if body is None else body.name
    for solid in (s for s in drawn if s.link == owner):
        visual = SubElement(link, 'visual')
        _origin(visual, solid.at, solid.turn)
        geometry = SubElement(visual, 'geometry')
        if solid.kind == 'box':
            SubElement(geometry, 'box', size=text(*solid.size))
        else:
            radius, length = (text(x) for x in solid.size)
            SubElement(geometry, 'cylinder', radius=radius, length=length)
        material = SubElement(visual, 'material', name=f'colour of {name}')
        SubElement(material, 'color', rgba=f'{solid.colour} 1')


def _origin(parent: Element, xyz: tuple[float, ...], yaw: float) -> None:
    SubElement(parent, 'origin', xyz=text(*xyz), rpy=f'0 0 {text(yaw)}')
