"""Force of a machine on its ground, from the momentum of its links.

By Newton's and Euler's laws for all links together the ground feels what is applied to them, less
what changes their momentum:

``F = sum (m g - m p'') + sum f``,  ``M = sum (p x (m g - m p'') - I theta'') + sum (r x f + t)``

A disk that spins with W about an axis with slopes s has the moment of momentum ``I W (1 - s^2/2)``
about z: where it tilts, ``I W s . s'`` is added to M.

Forces between links or between link and ground (bearings, contacts, springs, teeth, drives) need
not be known; in a step of the velocities the same sums give the impulse.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.symbolic import Term, add
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, Point
from mechanism_sim.planar.protocols import ForceElement, moment_of
from mechanism_sim.planar.switched_functions import Edges, SwitchedFunction
from mechanism_sim.planar.unknowns import UnknownLoad, Unknowns
from mechanism_sim.planar.virtual_work import located


class ShakingForce:
    """Force and moment of a machine on its ground.

    Parameters
    ----------
    mechanism : its links
    applied : external loads on links, or on the ground
    unknowns : u loads of that kind whose sizes follow from the motion

    Attributes
    ----------
    outside : names of inputs beside the motion: ``time``, ``COORDINATE.turns``
    unknown : True if there are loads whose sizes must be known
    flags : index of the flag in the rows, by the name of the switch
    edges : finder of the onset and end of loads along a motion; None without any
    """

    def __init__(
        self,
        mechanism: Mechanism,
        applied: Sequence[ForceElement] = (),
        unknowns: Sequence[UnknownLoad] = (),
    ) -> None:
        self._mechanism, self._masses = mechanism, list(_masses(mechanism))
        row = mechanism.coordinates.index
        self._tilting_spins = [
            (inertia, row(body.name), [row(f'{body.name}.{slope}') for slope in slopes])
            for body in mechanism.bodies
            if body.extension
            for slopes, inertia in body.extension.tilting_spins.items()
        ]
        frames = Frames(mechanism.coordinates, Parameters())
        given = Unknowns(mechanism, frames, unknowns, {}, [])
        acting = [load for element in applied for load in element.loads(frames)]
        parts: list[list[Term]] = []
        for load in (*acting, *given.acting):
            x, y = located(load, frames, mechanism)
            moment = add(moment_of((x.value, y.value), load.force), load.moment)
            parts.append([*load.force, moment])
        self.outside, self.unknown = tuple(frames.outside), bool(unknowns)
        ends = np.cumsum([0, *(len(s.symbols) for s in frames.switches.values())])
        self.flags = dict(zip(frames.switches, ends.tolist(), strict=False))
        self.edges = Edges(frames) if frames.switches else None
        self._loads: SwitchedFunction | None = None
        if parts:
            terms = [add(*x) for x in zip(*parts, strict=True)]
            known = [*frames.q.values(), *frames.v.values(), *frames.outside.values()]
            self._loads = SwitchedFunction(frames, [terms], [*known, *given.sizes])

    def __call__(
        self,
        motion: tuple[Array, Array, Array],
        outside: Array,
        rows: Array | None = None,
        sizes: Array | None = None,
        static: bool = False,
    ) -> Array:
        """Force x, y [N] and moment about the origin [N m], (3, N).

        Parameters
        ----------
        motion : (n, N) each: angles [rad] or displacements [m], rates, accelerations
        outside : (k, N) values of the inputs `outside`
        rows : values of the switches; by default those at these positions
        sizes : (u, N) of the unknown loads [N, N m]
        static : True if to leave out what changes the momentum
        """
        q, v, _ = motion
        total = np.zeros((3, q.shape[1]))
        if self._loads:
            more = [sizes] if sizes is not None and self.unknown else []
            total += self._loads(np.concatenate([q, v, outside, *more]), rows)[0]
        return self._with_bodies(total, motion, static)

    def impulse(self, q: Array, step: Array) -> Array:
        """Impulse x, y [N s] and its moment about the origin [N m s], (3, N): of no loads.

        Parameters
        ----------
        step : (n, N) of the velocities [rad/s, m/s]
        """
        rest, none = np.zeros_like(q), np.zeros((3, q.shape[1]))
        stepped = self._with_bodies(none.copy(), (q, rest, step))
        return stepped - self._with_bodies(none, (q, rest, rest))

    def _with_bodies(
        self, total: Array, motion: tuple[Array, Array, Array], static: bool = False
    ) -> Array:
        """Add weights, less what changes the momentum, to a total (3, N)."""
        (q, v, a), tree = motion, self._mechanism
        for mass, point, inertia, row in self._masses:
            (x, y), _, moved = tree.trace(point, q, v, a)
            gained = np.zeros_like(moved) if static else moved
            fx, fy = mass * (np.array(tree.gravity)[:, None] - gained)
            total += fx, fy, x * fy - y * fx
            if inertia and not static:
                total[2] -= inertia * a[row]
        for inertia, row, slopes in [] if static else self._tilting_spins:
            total[2] += inertia * v[row] * (q[slopes] * v[slopes]).sum(axis=0)
        return total


def _masses(mechanism: Mechanism) -> Iterator[tuple[float, Point, float, int]]:
    """Masses [kg], their points, moments of inertia [kg m^2], and the coordinates that turn these.

    A rigid link has one mass, others have many.
    """
    for body in mechanism.bodies:
        own, frame = body.extension, mechanism.frame(body.name)[0]
        row = -1 if frame == GROUND else mechanism.coordinates.index(frame)
        inertia = own.spin_of(body) if own else body.inertia
        for k, (mass, point) in enumerate(mechanism.particles(body.name)):
            yield mass, point, 0.0 if k or row < 0 else inertia, row
