"""The linkages of the tests: a run of each, places of points, forces of free bodies.

Nothing here uses the engine's own equations: only coordinates, their rates and accelerations as
sampled, the data of the bodies, and what the scene file says of loads and springs.
"""

from __future__ import annotations

import numpy as np

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.planar.mechanism import PinInSlot, Prismatic, Revolute

TURN = 2.0 * np.pi
DURATIONS = {'loader': 0.7, 'andrews_squeezer': 0.03}  #: [s] where neither turns nor profile say


def cycle(name, n=721, overrides=()):
    """A scene over a turn, its profile or its duration: machine, instants, samples, solution."""
    machine = ms.load_scene(name, overrides)
    solution = ms.simulate(machine, duration=duration(machine))
    t = np.linspace(0.0, solution.duration, n)
    return machine, t, solution.sample(t), solution


def duration(machine):
    """How long a scene runs [s]."""
    last = max(law.valid_from for laws in machine.plan.laws.values() for law in laws)
    try:
        return last or DURATIONS.get(machine.name) or machine.time_of(1.0)
    except InputError:
        return 1.0


def place(machine, seen, link, at=(0.0, 0.0)):
    """A point of a link in the world as complex numbers (N,) [m]."""
    found = np.zeros(len(next(iter(seen.values()))), complex)
    for (frame, slide), d in machine.mechanism.point(link, at).items():
        turned = 1.0 if frame == 'ground' else np.exp(1j * seen[f'position.{frame}'])
        found += (1.0 if slide is None else seen[f'position.{slide}']) * turned * complex(*d)
    return found


def opened(machine, seen, joint):
    """How far a joint is open (N,) [m]; across its axis where it may slide."""
    gap = place(machine, seen, joint.first, joint.on_first)
    gap = gap - place(machine, seen, joint.second, joint.on_second)
    if isinstance(joint, Revolute):
        return np.abs(gap)
    return np.abs((gap * np.exp(-1j * way(machine, seen, joint))).imag)


def way(machine, seen, joint):
    """Direction in which a joint may slide [rad]."""
    link = joint.first if isinstance(joint, Prismatic) else joint.second
    return turning(machine, seen, link) + joint.axis


def moved(machine, seen, link, at):
    """Place, velocity and acceleration of a point as complex numbers (N,)."""
    x = v = a = 0.0
    for (frame, slide), d in machine.mechanism.point(link, at).items():
        th, w, alpha = (
            0.0 if frame == 'ground' else seen[f'{what}.{frame}']
            for what in ('position', 'velocity', 'acceleration')
        )
        s, s1, s2 = (
            float(k == 0) if slide is None else seen[f'{what}.{slide}']
            for k, what in enumerate(('position', 'velocity', 'acceleration'))
        )
        arm = complex(*d) * np.exp(1j * th)
        x, v = x + s * arm, v + (s1 + 1j * w * s) * arm
        a = a + (s2 + 2j * w * s1 + (1j * alpha - w**2) * s) * arm
    return x, v, a


def turning(machine, seen, link, what='position'):
    """Angle of a link [rad], or its rate or acceleration."""
    frame, offset = machine.mechanism.frame(link)
    offset = offset if what == 'position' else 0.0
    return offset + (0.0 if frame == 'ground' else seen[f'{what}.{frame}'])


def applied(machine, seen, t):
    """Loads and springs: link, place, force as a complex number [N], moment [N m]."""

    def find(reference):
        link, _, point = reference.partition('.')
        return link, machine.plan.points[link][point or 'start']

    coordinates = {c: seen[f'position.{c}'] for c in machine.mechanism.coordinates}
    coordinates |= {f'{c}_rate': seen[f'velocity.{c}'] for c in machine.mechanism.coordinates}
    found = []
    for load in machine.scene.loads.values():
        link, at = find(load.at)
        x, v, _ = moved(machine, seen, link, at)
        known = {'t': t, 'x': x.real, 'y': x.imag, 'vx': v.real, 'vy': v.imag, **coordinates}
        fx, fy, torque = (
            eval(part, vars(np), known) if isinstance(part, str) else part
            for part in (*load.force, load.torque)
        )
        on = 1.0
        if load.during:
            width = (load.during.end - load.during.begin) % TURN
            on = (coordinates[load.during.coordinate] - load.during.begin) % TURN < width
        turned = np.exp(1j * turning(machine, seen, link)) if load.frame == 'link' else 1.0
        found.append((link, x, on * turned * (fx + 1j * fy), on * torque))
    for spring in machine.scene.springs.values():
        (a, at_a), (b, at_b) = map(find, spring.between)
        k, c = spring.stiffness.value, spring.damping.value
        (xa, va, _), (xb, vb, _) = (moved(machine, seen, *end) for end in ((a, at_a), (b, at_b)))
        if (spring.stiffness.unit or spring.damping.unit).endswith('rad'):
            twist, rate = (
                turning(machine, seen, b, what) - turning(machine, seen, a, what)
                for what in ('position', 'velocity')
            )
            moment = k * (twist - (spring.free_angle or 0.0)) + c * rate
            found += [(a, xa, 0.0, moment), (b, xb, 0.0, -moment)]
            continue
        line = xb - xa
        length, along = np.abs(line), line / np.abs(line)
        pull = along * (
            k * (length - (spring.free_length or 0.0)) + c * (along.conj() * (vb - va)).real
        )
        found += [(a, xa, pull, 0.0), (b, xb, -pull, 0.0)]
    return found


def free_bodies(machine, seen, t):
    """Forces of joints (N, j) as complex numbers, moments of guides (N, g), efforts of drives.

    Three equations a body; forces, moments and the efforts (N, d) of prescribed drives are
    unknown. Where a motion is free there are more equations than unknowns, and all must hold.
    """
    mechanism, n = machine.mechanism, len(t)
    links, joints = [body.name for body in mechanism.bodies], mechanism.joints
    guides = [j for j in joints if isinstance(j, Prismatic)]
    efforts = list(machine.plan.prescribed)
    first_guide, first_effort = 2 * len(joints), 2 * len(joints) + len(guides)
    rows = 3 * len(links) + sum(not isinstance(j, Revolute) for j in joints)
    A, b = np.zeros((n, rows, first_effort + len(efforts))), np.zeros((n, rows))
    cogs = {}
    for i, body in enumerate(mechanism.bodies):
        cogs[body.name], _, a = moved(machine, seen, body.name, body.cog)
        force = body.mass * (a - complex(*mechanism.gravity))
        b[:, 3 * i], b[:, 3 * i + 1] = force.real, force.imag
        b[:, 3 * i + 2] = body.inertia * turning(machine, seen, body.name, 'acceleration')

    def load(target, link, x, force, torque):
        """Add a force and a torque on a link to three rows."""
        if link in links:
            i, arm = links.index(link), x - cogs[link]
            target[:, 3 * i] += np.real(force)
            target[:, 3 * i + 1] += np.imag(force)
            target[:, 3 * i + 2] += (np.conj(arm) * force).imag + torque

    def drive(target, c, effort):
        """Add what a drive does on its coordinate."""
        if c not in mechanism.displacements:
            load(target, c, cogs[c], 0j, effort)
            return
        j = mechanism.tree_joints[c]
        x, push = place(machine, seen, c, j.on_second), np.exp(1j * way(machine, seen, j)) * effort
        load(target, j.second, x, push, 0.0)
        load(target, j.first, x, -push, 0.0)

    for given in applied(machine, seen, t):
        load(b, *given[:2], *(-x for x in given[2:]))
    for c in machine.plan.powered:
        constant, per_position, per_speed = machine.plan.laws[c][0].coefficients
        position, speed = seen[f'position.{c}'], seen[f'velocity.{c}']
        drive(b, c, -(constant + per_position * position + per_speed * speed))
    row = 3 * len(links)
    for k, j in enumerate(joints):
        end = (j.first, j.on_first) if isinstance(j, PinInSlot) else (j.second, j.on_second)
        x = place(machine, seen, *end)
        for link, sign in ((j.first, -1.0), (j.second, 1.0)):
            load(A[:, :, 2 * k], link, x, sign, 0.0)
            load(A[:, :, 2 * k + 1], link, x, sign * 1j, 0.0)
            if j in guides:
                load(A[:, :, first_guide + guides.index(j)], link, x, 0j, sign)
        if not isinstance(j, Revolute):
            along = way(machine, seen, j)
            A[:, row, 2 * k], A[:, row, 2 * k + 1] = np.cos(along), np.sin(along)
            row += 1
    for k, c in enumerate(efforts):
        drive(A[:, :, first_effort + k], c, 1.0)
    found = (np.linalg.pinv(A) @ b[:, :, None])[:, :, 0]
    left = (A @ found[:, :, None])[:, :, 0] - b
    assert np.abs(left).max() <= 1e-9 * np.abs(b).max()
    forces = found[:, 0:first_guide:2] + 1j * found[:, 1:first_guide:2]
    return forces, found[:, first_guide:first_effort], found[:, first_effort:]
