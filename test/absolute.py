"""Newton and Euler for every body, all reactions unknown: the second route to forces.

Coordinates are x, y of the mass centre and the angle of every body; joints are constraints on
them, drives too. ``[M, -J^T; J, 0] [a; lambda] = [F; gamma]`` is solved densely. Nothing here
knows of trees, of absolute link angles as coordinates, or of symbols; derivatives along the motion
are complex steps.
"""

import numpy as np

from mechanism_sim.planar.mechanism import GROUND, Geneva, PinInSlot, Prismatic, SlottedRack

STEP = 1e-30


def turned(angle, v):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1]])


def across(v):
    return np.array([-v[1], v[0]])


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


class Absolute:
    """The bodies of a plan; `driven` are coordinates with a prescribed motion."""

    def __init__(self, plan, mechanism, driven):
        self.plan, self.mechanism, self.driven = plan, mechanism, driven
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
        """Where the link's frame is, and the three columns of its pose."""
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
            if (across(u) @ (a - np.array(j.centre)) < 0.0).real:
                row = u @ (Jb - Ja) + (across(u) @ (b - a)) * self.spin(x, j.second)
                return [row], [(u, cross(a - b, u))]
            return [u @ Jb], [(u, 0.0)]
        D = Jb - Ja
        return [D[0], D[1]], [(np.array([1.0, 0.0]), 0.0), (np.array([0.0, 1.0]), 0.0)]

    def drive_row(self, x, coordinate):
        """How a driven coordinate changes with the poses."""
        if coordinate not in self.mechanism.displacements:
            return self.spin(x, coordinate)
        j = self.mechanism.tree_joints[coordinate]
        a, Ja = self.point(x, j.first, j.on_first)
        b, Jb = self.point(x, j.second, j.on_second)
        u = turned(self.link(x, j.first)[1], (np.cos(j.axis), np.sin(j.axis)))
        return u @ (Jb - Ja) + (across(u) @ (b - a)) * self.spin(x, j.first)

    def jacobian(self, x):
        rows = [row for j in self.plan.joints for row in self.joint_rows(x, j)[0]]
        return np.array([*rows, *(self.drive_row(x, c) for c in self.driven)])

    def applied(self, x, v, t, loads):
        """Generalised forces of gravity, and of loads (link, point, force, torque)."""
        Q = np.zeros(len(x))
        for i, body in enumerate(self.plan.bodies):
            Q[3 * i : 3 * i + 2] += body.mass * np.array(self.plan.gravity)
        for link, at, force, torque in loads(self, x, v, t):
            Q += force @ self.point(x, link, at)[1] + torque * self.spin(x, link)
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
        right = np.concatenate([self.applied(x, rates, t, loads), gamma])
        found = np.linalg.solve(A / scale[:, None], right / scale)
        reactions, k = {}, n
        for j in self.plan.joints:
            total = np.zeros(3)
            for force, moment in self.joint_rows(x, j)[1]:
                total += found[k] * np.array([*force, moment])
                k += 1
            reactions[j.name] = total
        return found[:n], reactions, found[k:]
