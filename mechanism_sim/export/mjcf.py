"""MJCF of the ideal mechanism of a machine, for MuJoCo.

Links are bodies in a tree of hinges and slides; coordinates are those of a link relative to the
one that carries it. Connected points close the loops; gears are tendons: sums of
joint coordinates of constant length. All motion is in the plane z = 0.
"""

from __future__ import annotations

from functools import cached_property
from typing import TypeGuard
from xml.etree.ElementTree import SubElement

from mechanism_sim.export.ideal import (
    WORLD,
    Ideal,
    check_names,
    solids,
    time_step,
    way,
)
from mechanism_sim.export.markup import Element, comment, text, written
from mechanism_sim.linkages.forces import AppliedForce
from mechanism_sim.linkages.springs import Elongation, GuidedSpring, Spring, TorsionSpring
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.mechanism import Coupling, Prismatic, Revolute, Weld
from mechanism_sim.planar.points import GROUND, Vector2, rotate
from mechanism_sim.scene.drives import read_drives
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.plan import keeps_speed

#: flywheel of a drive of given speed, in inertias of the machine; and the share of a speed
#: error that its servo corrects in a step
FLYWHEEL, _GAIN = 1e6, 1.0


def to_mjcf(machine: Machine) -> str:
    """The text of an MJCF file of a machine without clearance.

    Bodies are named as links, joints and constraints as those of the scene; a hinge's coordinate
    is the angle of a link relative to its carrier, a slide's the displacement. Drives are
    actuators named after their coordinates: of prescribed ones with the speed as control, the
    others with an additional torque. The keyframe `start` has the rates at the start and the
    controls. Constraints are as stiff as MuJoCo allows, two time steps: their error
    decreases with the step. Omissions are in comments, see `left_out`.
    """
    check_names(machine)
    return written(_MjcfWriter(Ideal(machine)).root)


def left_out(machine: Machine) -> list[str]:
    """Properties of a machine that MJCF cannot express, in sentences."""
    ideal = Ideal(machine)
    found = [*ideal.left_out()]
    found += [
        f'{c}: its speed changes; the file has the one at the start'
        for c in machine.plan.prescribed
        if not keeps_speed(machine.plan, c)
    ]
    found += [f'{motor.coordinate}: left out: {motor.name}' for motor in machine.plan.motors]
    for element in machine.plan.elements(machine.plan.ideal):
        if isinstance(element, AppliedForce) and _constant(element) is None:
            found.append(f'{element.name}: left out: its force is not constant')
        elif not isinstance(element, AppliedForce) and not _is_linear(element, ideal):
            found.append(f'{element.name}: left out: MuJoCo has no force of this kind')
    return found + [f'{name}: this sensor is left out' for name in machine.scene.sensors]


class _MjcfWriter:
    """Writer of a file."""

    def __init__(self, ideal: Ideal) -> None:
        self._ideal, self._m = ideal, ideal.mechanism
        self._drawn = solids(ideal.machine)
        self._rates: list[float] = []
        self._controls: list[float] = []
        self._joints: dict[str, Element] = {}
        self._step = time_step(ideal.machine)
        self.root = Element('mujoco', model=ideal.machine.name)
        comment(self.root, ideal.machine.scene.title, *left_out(ideal.machine))
        SubElement(self.root, 'compiler', angle='radian', inertiafromgeom='false')
        options = SubElement(
            self.root, 'option', timestep=text(self._step), gravity=text(*self._m.gravity, 0.0),
            integrator='RK4', tolerance='1e-12', iterations='200',
        )  # fmt: skip
        SubElement(options, 'flag', contact='disable')
        SubElement(SubElement(self.root, 'default'), 'equality', solref='1e-9 1',
                   solimp='0.9999 0.9999 1 0.5 1')  # fmt: skip
        world = SubElement(self.root, 'worldbody')
        self._sites(world, GROUND)
        self._geometry(world, GROUND)
        self._bodies(world, GROUND)
        self._tendons = Element('tendon')
        self._equality = Element('equality')
        self._actuators = Element('actuator')
        for joint in ideal.closing:
            self._connect(joint)
        for coupling in ideal.couplings:
            self._couple(coupling)
        for element in self._elements:
            if isinstance(element, GuidedSpring):
                self._pulling(element, {element.joint: 1.0}, element.free_length)
            elif isinstance(element, Spring):
                self._spring(element)
            elif isinstance(element, TorsionSpring):
                self._torsion(element)
        for c in read_drives(ideal.machine.plan):
            self._drive(c)
        for element in self._elements:
            if isinstance(element, AppliedForce) and (wrench := _constant(element)):
                self._force(element, wrench)
        for section in (self._tendons, self._equality, self._actuators):
            if len(section):
                self.root.append(section)
        key = SubElement(SubElement(self.root, 'keyframe'), 'key', name='start',
                         qvel=text(*self._rates))  # fmt: skip
        if self._controls:
            key.set('ctrl', text(*self._controls))

    @cached_property
    def _elements(self) -> list[Elongation | AppliedForce]:
        machine = self._ideal.machine
        found = machine.plan.elements(machine.plan.ideal)
        return [e for e in found if isinstance(e, AppliedForce) or _is_linear(e, self._ideal)]

    def _bodies(self, parent: Element, link: str) -> None:
        """Elements of a link, depth first, as MuJoCo numbers joints."""
        for body in self._m.bodies:
            floats = body.name in self._m.floating
            if link != (GROUND if floats else self._m.parent(body.name)):
                continue
            (x0, y0, turn), (x, y, angle) = self._ideal.poses[link], self._ideal.poses[body.name]
            at = rotate((x - x0, y - y0), -turn)
            child = SubElement(parent, 'body', name=body.name, pos=text(*at, 0.0),
                               euler=text(0.0, 0.0, angle - turn))  # fmt: skip
            inertia = text(0.5 * body.inertia, 0.5 * body.inertia, body.inertia)
            SubElement(child, 'inertial', pos=text(*body.cog, 0.0), mass=text(body.mass),
                       diaginertia=inertia)  # fmt: skip
            if floats:
                self._floating(child, body.name, body.cog)
            else:
                self._joint(child, body.name)
            self._sites(child, body.name)
            self._geometry(child, body.name)
            self._bodies(child, body.name)

    def _joint(self, body: Element, link: str) -> None:
        """Write the joint that carries a link."""
        j, parent = self._m.tree_joints[link], self._m.parent(link)
        if isinstance(j, Weld):
            return
        axis = (0.0, 0.0, 1.0)
        if isinstance(j, Prismatic):
            kind, (place, rate) = 'slide', self._ideal.guided(j)
            axis = (*way(j, link), 0.0)
        else:
            kind, (place, rate) = 'hinge', self._ideal.turned(link, parent)
        self._joints[j.name] = SubElement(
            body, 'joint', name=j.name, type=kind, pos=text(*j.on(link), 0.0),
            axis=text(*axis), ref=text(place),
        )  # fmt: skip
        self._rates.append(rate)

    def _floating(self, body: Element, link: str, cog: Vector2) -> None:
        """Displacements of the centre of gravity, and the angle."""
        turn = self._ideal.poses[link][2]
        place, rates = self._ideal.point(link, cog)
        for k, name in enumerate('xy'):
            axis = rotate(((1.0, 0.0), (0.0, 1.0))[k], -turn)
            SubElement(body, 'joint', name=f'{link}.{name}', type='slide',
                       axis=text(*axis, 0.0), ref=text(place[k]))  # fmt: skip
        self._joints[link] = SubElement(
            body, 'joint', name=link, type='hinge', axis='0 0 1', pos=text(*cog, 0.0),
            ref=text(turn),
        )  # fmt: skip
        self._rates += [*rates.tolist(), float(self._ideal.rates[link][2])]

    def _sites(self, body: Element, link: str) -> None:
        """Write the sites of a link at which springs and loads act."""
        if link == GROUND:
            SubElement(body, 'site', name=GROUND)
        for element in self._elements:
            if isinstance(element, Spring) and not isinstance(element, GuidedSpring):
                for end, (owner, at) in (('first', element.first), ('second', element.second)):
                    if owner == link:
                        SubElement(body, 'site', name=f'{element.name}.{end}', pos=text(*at, 0.0))
            elif isinstance(element, AppliedForce) and _constant(element):
                owner, at = element.point
                if owner == link:
                    SubElement(body, 'site', name=element.name, pos=text(*at, 0.0))

    def _geometry(self, body: Element, link: str) -> None:
        """Write the visual geometry of a link, without collisions."""
        for solid in self._drawn:
            if solid.link == link:
                # MuJoCo has a radius, and half lengths
                if solid.kind == 'cylinder':
                    size = text(solid.size[0], 0.5 * solid.size[1])
                else:
                    size = text(*(0.5 * x for x in solid.size))
                SubElement(body, 'geom', type=solid.kind, size=size,
                           pos=text(*solid.at), euler=text(0.0, 0.0, solid.turn),
                           rgba=f'{solid.colour} 1', contype='0', conaffinity='0')  # fmt: skip

    def _connect(self, joint: Revolute) -> None:
        one, other, at = joint.first, joint.second, joint.on_first
        if one == GROUND:
            one, other, at = other, one, joint.on_second
        SubElement(self._equality, 'connect', name=joint.name, body1=one, anchor=text(*at, 0.0),
                   body2=WORLD if other == GROUND else other)  # fmt: skip

    def _couple(self, coupling: Coupling) -> None:
        """A sum of coordinates that keeps its value at the start."""
        pair = coupling.joint
        terms: dict[str, float] = {}
        sides = zip((pair.first, pair.second), coupling.factors, coupling.racks, strict=True)
        for link, factor, guide in sides:
            joints = [guide.name] if guide else self._hinges(link)
            less = [] if guide else self._hinges(coupling.carrier)
            for names, sign in ((joints, factor), (less, -factor)):
                for name in names:
                    terms[name] = terms.get(name, 0.0) + sign
        self._sum(pair.name, terms)
        SubElement(self._equality, 'tendon', name=pair.name, tendon1=pair.name)

    def _sum(self, name: str, terms: dict[str, float], **more: str) -> Element:
        """A tendon whose length is a sum of joint coordinates."""
        tendon = SubElement(self._tendons, 'fixed', {'name': name, **more})
        for joint, factor in terms.items():
            if factor:
                SubElement(tendon, 'joint', joint=joint, coef=text(factor))
        return tendon

    def _hinges(self, link: str) -> list[str]:
        """Hinges with coordinates that add up to a link's angle, apart from angles of guides."""
        found: list[str] = []
        while link != GROUND:
            if link in self._m.floating:
                return [*found, link]
            joint = self._m.tree_joints[link]
            if isinstance(joint, Revolute):
                found.append(joint.name)
            link = self._m.parent(link)
        return found

    def _beyond(self, link: str) -> float:
        """A link's angle minus the coordinates of its hinges [rad]."""
        fixed = 0.0
        while link != GROUND and link not in self._m.floating:
            parent = self._m.parent(link)
            if isinstance(self._m.tree_joints[link], Prismatic | Weld):
                fixed += self._ideal.turned(link, parent)[0]
            link = parent
        return fixed

    def _drive(self, coordinate: str) -> None:
        """An actuator between a link and the ground, or along the link's guide."""
        machine = self._ideal.machine
        law, ideal = machine.plan.laws[coordinate][0], machine.plan.ideal
        straight, offset = coordinate in ideal.displacements, 0.0
        if straight:
            hinges = [ideal.tree_joints[coordinate].name]
        else:
            hinges, offset = self._hinges(coordinate), self._beyond(coordinate)
        actuator = SubElement(self._actuators, 'general', name=coordinate)
        if len(hinges) > 1:
            driven = self._sum(f'{coordinate}.angle', dict.fromkeys(hinges, 1.0))
            actuator.set('tendon', f'{coordinate}.angle')
        else:
            driven = self._joints[hinges[0]]
            actuator.set('joint', hinges[0])
        if isinstance(law, DriveLaw):
            # total mass [kg], or its inertia at a distance of the machine's size [kg m^2]
            mass = sum(body.mass for body in self._m.bodies)
            if straight:
                load = mass
            else:
                load = mass * self._m.size**2 + sum(body.inertia for body in self._m.bodies)
            flywheel = FLYWHEEL * load
            driven.set('armature', text(flywheel))
            actuator.tag = 'velocity'
            actuator.set('kv', text(_GAIN * flywheel / self._step))
            self._controls.append(machine.plan.held[coordinate][1])
            return
        constant, per_angle, per_speed = law.coefficients
        actuator.set('biastype', 'affine')
        actuator.set('biasprm', text(constant + per_angle * offset, per_angle, per_speed))
        self._controls.append(0.0)

    def _spring(self, spring: Spring) -> None:
        stiffness, damping = spring.law.numbers or (0.0, 0.0)
        tendon = SubElement(
            self._tendons, 'spatial', name=spring.name, stiffness=text(stiffness),
            springlength=text(spring.free_length), damping=text(damping),
        )  # fmt: skip
        for end in ('first', 'second'):
            SubElement(tendon, 'site', site=f'{spring.name}.{end}')

    def _torsion(self, spring: TorsionSpring) -> None:
        terms: dict[str, float] = dict.fromkeys(self._hinges(spring.second), 1.0)
        for name in self._hinges(spring.first):
            terms[name] = terms.get(name, 0.0) - 1.0
        fixed = self._beyond(spring.second) - self._beyond(spring.first)
        self._pulling(spring, terms, spring.free_angle - fixed)

    def _pulling(self, spring: Elongation, terms: dict[str, float], free: float) -> None:
        """A spring and a damper of a sum of joint coordinates, with its force-free value."""
        stiffness, damping = spring.law.numbers or (0.0, 0.0)
        self._sum(
            spring.name, terms, stiffness=text(stiffness), springlength=text(free),
            damping=text(damping),
        )  # fmt: skip

    def _force(self, load: AppliedForce, wrench: tuple[float, float, float]) -> None:
        """A constant force, in axes of the ground or of its link."""
        x, y, torque = wrench
        actuator = SubElement(
            self._actuators, 'general', name=load.name, site=load.name,
            gear=text(x, y, 0.0, 0.0, 0.0, torque), biastype='affine', biasprm='1 0 0',
        )  # fmt: skip
        if not load.turns:
            actuator.set('refsite', GROUND)
        self._controls.append(0.0)


def _is_linear(element: object, ideal: Ideal) -> TypeGuard[Elongation]:
    """True for linear springs and dampers, between points or links or along a guide."""
    if not isinstance(element, Spring | TorsionSpring):
        return False
    if isinstance(element, GuidedSpring) and element.joint in ideal.mechanism.cut:
        return False
    return element.law.numbers is not None


def _constant(load: AppliedForce) -> tuple[float, float, float] | None:
    """Force [N] and torque [N m] of a constant load; None for other loads."""
    x, y, torque = *load.force, load.torque
    if load.during or isinstance(x, str) or isinstance(y, str) or isinstance(torque, str):
        return None
    return x, y, torque
