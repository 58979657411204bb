"""Newton and Euler for every body, all reactions unknown: the second route to forces.

Coordinates are x, y of the mass centre and the angle of every body; joints are constraints on
them, drives too. ``[M, -J^T; J, 0] [a; lambda] = [F; gamma]`` is solved densely. Nothing here
knows of trees, of absolute link angles as coordinates, or of symbols; derivatives along the motion
are complex steps.
"""

import math

import numpy as np
from numpy.polynomial import Chebyshev

from mechanism_sim.joints.arc_slot.constraint import PinInArc
from mechanism_sim.joints.cam.constraint import CamPair
from mechanism_sim.joints.geneva.constraint import Geneva
from mechanism_sim.joints.mesh.constraint import GearMesh
from mechanism_sim.joints.rack.constraint import SlottedRack
from mechanism_sim.joints.slot.constraint import PinInSlot
from mechanism_sim.joints.transmission.constraint import Transmission
from mechanism_sim.planar.mechanism import Prismatic, Weld
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.schema import Scene

STEP = 1e-30


def turned(angle, v):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1]])


def across(v):
    return np.array([-v[1], v[0]])


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


class Absolute:
    """The bodies of a plan; `driven` are coordinates with a prescribed motion.

    `joints` are those of the plan that are kept closed, by default all.
    """

    def __init__(self, plan, mechanism, driven, joints=None):
        self.plan, self.mechanism, self.driven = plan, mechanism, driven
        self.joints = plan.joints if joints is None else joints
        self.names = [b.name for b in plan.bodies]
        self.bodies = {b.name: b for b in plan.bodies}

    def poses(self, q):
        """Place and angle of every body's mass centre, from coordinates that may be complex."""
        known = dict(zip(self.mechanism.coordinates, q, strict=True))
        found = []
        for body in self.plan.bodies:
            place = np.zeros(2, dtype=np.asarray(q).dtype)
            for (frame, slide), d in self.mechanism.point(body.name, body.cog).items():
                angle = 0.0 if frame == GROUND else known[frame]
                place = place + (1.0 if slide is None else known[slide]) * turned(angle, d)
            frame, offset = self.mechanism.frame(body.name)
            found += [*place, offset + (0.0 if frame == GROUND else known[frame])]
        return np.array(found)

    def link(self, x, name):
        """Position of the link's frame, its angle, and the first of three columns of its pose."""
        if name == GROUND:
            return np.zeros(2), 0.0, None
        i = 3 * self.names.index(name)
        angle = x[i + 2]
        return x[i : i + 2] - turned(angle, self.bodies[name].cog), angle, i

    def point(self, x, name, at):
        """A point of a link and its Jacobian (2, n)."""
        origin, angle, i = self.link(x, name)
        J = np.zeros((2, len(x)), dtype=x.dtype)
        place = origin + turned(angle, at)
        if i is not None:
            J[0, i] = J[1, i + 1] = 1.0
            J[:, i + 2] = across(place - x[i : i + 2])
        return place, J

    def spin(self, x, name):
        J = np.zeros(len(x), dtype=x.dtype)
        if name != GROUND:
            J[3 * self.names.index(name) + 2] = 1.0
        return J

    def joint_rows(self, x, j):
        """Jacobian rows of a joint, and what a multiplier of each does: (force, moment).

        The moment is about the joint's point on the second link; multipliers push on the second.
        """
        a, Ja = self.point(x, j.first, j.on_first)
        b, Jb = self.point(x, j.second, j.on_second)
        first, second = self.link(x, j.first)[1], self.link(x, j.second)[1]
        turn = self.spin(x, j.second) - self.spin(x, j.first)
        if isinstance(j, Prismatic):
            n = across(turned(first, (np.cos(j.axis), np.sin(j.axis))))
            slide = n @ (Jb - Ja) + (across(n) @ (b - a)) * self.spin(x, j.first)
            return [slide, turn], [(n, 0.0), (np.zeros(2), 1.0)]
        if isinstance(j, PinInSlot):
            n = across(turned(second, (np.cos(j.axis), np.sin(j.axis))))
            row = n @ (Jb - Ja) + (across(n) @ (b - a)) * self.spin(x, j.second)
            return [row], [(n, cross(a - b, n))]
        if isinstance(j, PinInArc):
            n = (a - b) / np.sqrt((a - b) @ (a - b))
            return [n @ (Jb - Ja)], [(n, 0.0)]
        if isinstance(j, Geneva):
            z = a - b
            r = np.sqrt(z @ z)
            if (r < j.entry).real:
                n = -across(z) / r  # the slot passes through pin and wheel's centre
                return [n @ (Jb - Ja) - r * self.spin(x, j.second)], [(n, cross(z, n))]
            u = np.array([np.cos(j.towards), np.sin(j.towards)])
            return [self.spin(x, j.second)], [(across(u) / j.distance, 1.0)]
        if isinstance(j, SlottedRack):
            u = np.array([np.cos(j.axis), np.sin(j.axis)])
            pin, slot = (across(u) @ (p - np.array(j.centre)) for p in (a, b))
            if (pin * slot > 0.0).real:  # on the side of the rack
                row = u @ (Jb - Ja) + (across(u) @ (b - a)) * self.spin(x, j.second)
                return [row], [(u, cross(a - b, u))]
            return [u @ Jb], [(u, 0.0)]
        if isinstance(j, GearMesh):
            place, n, _ = self.pitch_point(x, j)
            t = across(n)
            row = t @ (self.carried(x, j.second, place) - self.carried(x, j.first, place))
            return [row], [(t, cross(place - b, t))]
        if isinstance(j, CamPair):
            place, n = self.touching(x, j)
            row = n @ (self.carried(x, j.second, place) - self.carried(x, j.first, place))
            return [row], [(n, cross(place - b, n))]
        if isinstance(j, Transmission):
            p, c = float(j.ratio), self.spin(x, j.carrier)
            row = self.spin(x, j.second) - c - p * (self.spin(x, j.first) - c)
            return [row], [(np.zeros(2), 1.0)]
        D = Jb - Ja
        if isinstance(j, Weld):
            pushes = (np.array([1.0, 0.0]), 0.0), (np.array([0.0, 1.0]), 0.0), (np.zeros(2), 1.0)
            return [D[0], D[1], turn], [*pushes]
        return [D[0], D[1]], [(np.array([1.0, 0.0]), 0.0), (np.array([0.0, 1.0]), 0.0)]

    def carried(self, x, name, place):
        """Jacobian (2, n) of the point of a link that is at a place just now."""
        J = np.zeros((2, len(x)), dtype=x.dtype)
        if name != GROUND:
            i = 3 * self.names.index(name)
            J[0, i] = J[1, i + 1] = 1.0
            J[:, i + 2] = across(place - x[i : i + 2])
        return J

    def touching(self, x, j):
        """Contact of the drawn profile of a cam with the follower, and the normal there.

        The curve drawn for the piece of the law around the present angle is differentiated as a
        Chebyshev series; along a complex step it goes on linearly.
        """
        origin, turn, _ = self.link(x, j.first)
        breaks = j.cam.law.breaks
        if j.cam.law.reciprocating:
            angle = self.slide(x, self.mechanism.tree_joints[j.first])[0]
            at = angle.real
        else:
            angle = j.sense * turn + j.phase
            at = breaks[0] + (angle.real - breaks[0]) % (2.0 * np.pi)
        reach = 0.008 * (breaks[-1] - breaks[0])
        k = np.searchsorted(breaks[1:-1], at, 'right')
        inset = 1e-9 * (breaks[k + 1] - breaks[k])
        near = (
            max(breaks[k] + inset, at - reach),
            min(breaks[k + 1] - inset, at + reach),
        )
        curve = [
            Chebyshev.interpolate(
                lambda t, i=i: j.profile(j.cam.at(t).profile)[i], 16, domain=near
            )
            for i in (0, 1)
        ]
        c, c1, c2 = (np.array([p.deriv(d)(at) if d else p(at) for p in curve]) for d in range(3))
        step = angle - angle.real
        place, along = c + step * c1, c1 + step * c2
        # the profile is drawn against the sense of the cam
        n = -j.sense * across(along) / np.sqrt(along @ along)
        return origin + turned(turn, place), turned(turn, n)

    def pitch_point(self, x, j):
        """Pitch point of gears, the line of centres, and the tangent of their angle.

        The pitch point divides the centre distance as the numbers of teeth, inside or outside;
        the normal of the flanks is tangent to the base circle.
        """
        a, b = self.point(x, j.first, j.on_first)[0], self.point(x, j.second, j.on_second)[0]
        base = j.base_pitch * abs(j.waves[0]) / (2.0 * np.pi)
        if j.guide is not None:
            way = turned(self.link(x, j.guide.first)[1] + j.guide.axis, (1.0, 0.0))
            n = across(way) * np.sign((across(way) @ (b - a)).real)
            radius = n @ (b - a)  # without play
        else:
            n = (b - a) / np.sqrt((b - a) @ (b - a))
            radius = n @ (b - a) * j.waves[0] / sum(j.waves)
        return a + radius * n, n, np.sqrt(radius**2 - base**2) / base

    def parting(self, x, j, force):
        """Separating force on the second along the centres, of flanks with a tangential force.

        It presses an external gear towards its axis, an internal one away from it.
        """
        place, n, slope = self.pitch_point(x, j)
        from_first = np.sign(n @ (place - self.point(x, j.first, j.on_first)[0]))
        return place, abs(force) * slope * np.sign(j.waves[0]) * from_first * n

    def drive_row(self, x, coordinate):
        """Derivatives of a driven coordinate with respect to the poses."""
        if coordinate not in self.mechanism.displacements:
            return self.spin(x, coordinate)
        return self.slide(x, self.mechanism.tree_joints[coordinate])[1]

    def slide(self, x, j):
        """The displacement along a prismatic joint, and how it changes with the poses."""
        a, Ja = self.point(x, j.first, j.on_first)
        b, Jb = self.point(x, j.second, j.on_second)
        u = turned(self.link(x, j.first)[1], (np.cos(j.axis), np.sin(j.axis)))
        return u @ (b - a), u @ (Jb - Ja) + (across(u) @ (b - a)) * self.spin(x, j.first)

    def jacobian(self, x):
        rows = [row for j in self.joints for row in self.joint_rows(x, j)[0]]
        return np.array([*rows, *(self.drive_row(x, c) for c in self.driven)])

    def applied(self, x, v, t, loads):
        """Generalised forces of gravity, and of loads (link, point, force, torque)."""
        Q = np.zeros(len(x))
        for i, body in enumerate(self.plan.bodies):
            Q[3 * i : 3 * i + 2] += body.mass * np.array(self.plan.scene.gravity)
        for link, at, force, torque in loads(self, x, v, t):
            Q = Q + force @ self.point(x, link, at)[1] + torque * self.spin(x, link)
        return Q

    def solve(self, q, v, drive_accelerations, t, loads):
        """Accelerations of the poses, reactions {joint: (Fx, Fy, M)}, drive forces."""
        shifted = self.poses(np.asarray(q) + 1j * STEP * np.asarray(v))
        x, rates = shifted.real, shifted.imag / STEP
        J = self.jacobian(x)
        gamma = -(self.jacobian(shifted).imag / STEP) @ rates
        gamma[len(gamma) - len(self.driven) :] += drive_accelerations
        masses = np.ravel([(b.mass, b.mass, b.inertia) for b in self.plan.bodies])
        n, r = len(x), len(J)
        A = np.zeros((n + r, n + r))
        A[:n, :n], A[:n, n:], A[n:, :n] = np.diag(masses), -J.T, J
        scale = np.abs(A).max(axis=1)
        self.condition = np.linalg.cond(A / scale[:, None])
        right = np.concatenate([self.applied(x, rates, t, loads), gamma])
        found = np.linalg.solve(A / scale[:, None], right / scale)
        reactions, k = {}, n
        apart = {}
        for j in self.joints:
            if isinstance(j, GearMesh):
                place, force = apart[j.name] = self.parting(x, j, found[k])
                pushed = self.carried(x, j.second, place) - self.carried(x, j.first, place)
                right[:n] += force @ pushed
            k += len(self.joint_rows(x, j)[0])
        found, k = np.linalg.solve(A / scale[:, None], right / scale), n
        for j in self.joints:
            total = np.zeros(3)
            if j.name in apart:
                place, force = apart[j.name]
                arm = place - self.point(x, j.second, j.on_second)[0]
                total += [*force, cross(arm, force)]
            for force, moment in self.joint_rows(x, j)[1]:
                total += found[k] * np.array([*force, moment])
                k += 1
            reactions[j.name] = total
        return found[:n], reactions, found[k:]


def loads_of(scene):
    """The loads of a scene at an instant, from its text: link, point, force, torque."""

    def at(absolute, x, v, t):
        if not isinstance(scene, Scene):
            return
        plan = absolute.plan

        def find(reference):
            link, _, point = reference.partition('.')
            return link, plan.points[link][point or 'start']

        def moving(link, point):
            place, J = absolute.point(x, link, point)
            return place, J @ v

        angles = {n: x[3 * i + 2] for i, n in enumerate(absolute.names)}
        rates = {n: v[3 * i + 2] for i, n in enumerate(absolute.names)}
        for s in scene.springs.values():
            (a, pa), (b, pb) = (find(p) for p in s.between)
            if (s.stiffness.unit or s.damping.unit).endswith('rad'):
                twist = angles.get(b, 0.0) - angles.get(a, 0.0) - (s.free_angle or 0.0)
                rate = rates.get(b, 0.0) - rates.get(a, 0.0)
                moment = s.stiffness.value * twist + s.damping.value * rate
                yield a, (0.0, 0.0), np.zeros(2), moment
                yield b, (0.0, 0.0), np.zeros(2), -moment
                continue
            (xa, va), (xb, vb) = moving(a, pa), moving(b, pb)
            line = xb - xa
            length = math.hypot(*line)
            unit = line / length
            stretch = length - (s.free_length or 0.0)
            pull = s.stiffness.value * stretch + s.damping.value * (unit @ (vb - va))
            yield a, pa, pull * unit, 0.0
            yield b, pb, -pull * unit, 0.0
        for load in scene.loads.values():
            link, point = find(load.at)
            if load.during:
                angle = angles[load.during.coordinate] - load.during.begin.value
                width = (load.during.end.value - load.during.begin.value) % (2.0 * math.pi)
                if angle % (2.0 * math.pi) > width:
                    continue
            place, rate = moving(link, point)
            known = {'t': t, 'x': place[0], 'y': place[1], 'vx': rate[0], 'vy': rate[1]}
            known |= {'sin': math.sin, 'cos': math.cos, 'exp': math.exp, 'pi': math.pi}
            known |= {'sqrt': math.sqrt, 'tanh': math.tanh, 'abs': abs, 'tan': math.tan}
            for c in plan.ideal.coordinates:
                known[c], known[f'{c}_rate'] = angles[c], rates[c]
            for c in plan.ideal.sliding:
                slid, row = absolute.slide(x, plan.ideal.tree_joints[c])
                known[c], known[f'{c}_rate'] = slid, row @ v

            def value(part, known=known):
                return eval(part, {}, known) if isinstance(part, str) else part

            force = np.array([value(part) for part in load.force], dtype=float)
            if load.frame == 'link' and link != GROUND:
                force = turned(angles[link], force)
            yield link, point, force, float(value(load.torque))

    return at


def differences(machine, solution, t):
    """Differences of reactions and drive forces of a run from the second route, at times t.

    What a loose joint transmits is taken from the run, as a load on both links.

    Returns
    -------
    relative to the largest force (N,), and the condition (N,) of the equations of the second route
    """
    plan, mechanism = machine.plan, machine.mechanism
    kept = [j for j in plan.joints if j.name not in machine.plan.clearances]
    absolute = Absolute(plan, mechanism, plan.prescribed, kept)
    seen = solution.view(t).observed
    driven = [mechanism.coordinates.index(c) for c in plan.prescribed]
    drives = np.abs(seen.drive_torque).max(initial=0.0) / max(mechanism.size, 1.0)
    largest = max(np.abs(seen.reaction).max(), drives, 1e-3)
    text = loads_of(machine.scene)
    off, conditions = np.zeros(len(t)), np.zeros(len(t))
    for k, time in enumerate(t):
        wrenches = {
            j.name: np.array([*seen.reaction[i, :, k], seen.reaction_moment[i, k]])
            for i, j in enumerate(plan.joints)
        }
        torques = dict(zip(plan.powered, seen.drive_torque[len(driven) :, k], strict=True))

        def loads(a, x, v, t, torques=torques, wrenches=wrenches):
            yield from text(a, x, v, t)
            for c, torque in torques.items():
                row = a.drive_row(x, c)
                # a drive's force as a generalised one: through unit loads on every body
                for n, body in enumerate(a.plan.bodies):
                    part = torque * row[3 * n : 3 * n + 3]
                    yield body.name, body.cog, part[:2], part[2]
            for j in plan.joints:
                if j.name in machine.plan.clearances:
                    *force, moment = wrenches[j.name]
                    force = np.array(force)
                    pin, bushing = (
                        a.point(x, j.first, j.on_first),
                        a.point(x, j.second, j.on_second),
                    )
                    yield j.second, j.on_second, force, moment
                    yield j.first, j.on_first, -force, cross(pin[0] - bushing[0], force) - moment

        state = seen.position[:, k], seen.velocity[:, k], seen.acceleration[driven, k]
        _, reactions, drives = absolute.solve(*state, time, loads)
        size = [1.0, 1.0, mechanism.size]
        for j in kept:
            apart = np.abs((wrenches[j.name] - reactions[j.name]) / size)
            off[k] = max(off[k], apart.max())
        apart = np.abs(drives - seen.drive_torque[: len(driven), k]) / max(mechanism.size, 1.0)
        off[k] = max(off[k], apart.max(initial=0.0))
        conditions[k] = absolute.condition
    return off / largest, conditions
