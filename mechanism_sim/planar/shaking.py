"""Force of a machine on its ground, from the momentum of its links.

By Newton's and Euler's laws for all links together the ground feels what is applied to them, less
what changes their momentum:

``F = sum (m g - m p'') + sum f``,  ``M = sum (p x (m g - m p'') - I theta'') + sum (r x f + t)``

Forces between links or between link and ground (bearings, contacts, springs, teeth, drives) need
not be known; in a step of the velocities the same sums give the impulse.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.symbolic import Term, add, mul, neg
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, Point
from mechanism_sim.planar.protocols import ForceElement, moment_of
from mechanism_sim.planar.switched_functions import Edges, SwitchedFunction
from mechanism_sim.planar.virtual_work import located


class ShakingForce:
    """Force and moment of a machine on its ground.

    Parameters
    ----------
    mechanism : its links
    applied : external loads on links, or on the ground

    Attributes
    ----------
    outside : names of inputs beside the motion: ``time``, ``COORDINATE.turns``
    flags : index of the flag in the rows, by the name of the switch
    edges : finder of the onset and end of loads along a motion; None without any
    """

    def __init__(self, mechanism: Mechanism, applied: Sequence[ForceElement] = ()) -> None:
        frames = Frames(mechanism.coordinates, Parameters())
        parts: list[list[Term]] = []
        for name, link, own, point, turning in _masses(mechanism):
            place = frames.position(point, f'links:{name}.cog')
            mass = frames.parameters(f'links:{name}.mass', own)
            force = []
            for axis, (jet, g) in enumerate(zip(place, mechanism.gravity, strict=True)):
                moved = [mul(slope, frames.a[c]) for c, slope in jet.gradient.items()]
                gravity = frames.parameters(f'gravity:{axis}', g)
                force.append(mul(mass, add(gravity, neg(add(*moved, jet.curvature)))))
            frame, spin = mechanism.frame(link)[0], None
            if frame != GROUND and turning:
                inertia = frames.parameters(f'links:{name}.inertia', turning)
                spin = neg(mul(inertia, frames.a[frame]))
            moment = moment_of((place[0].value, place[1].value), (force[0], force[1]))
            parts.append([*force, add(moment, spin)])
        for load in (load for element in applied for load in element.loads(frames)):
            x, y = located(load, frames, mechanism)
            moment = add(moment_of((x.value, y.value), load.force), load.moment)
            parts.append([*load.force, moment])
        self.outside = tuple(frames.outside)
        ends = np.cumsum([0, *(len(s.symbols) for s in frames.switches.values())])
        self.flags = dict(zip(frames.switches, ends.tolist(), strict=False))
        self.edges = Edges(frames) if frames.switches else None
        motion = [*frames.q.values(), *frames.v.values(), *frames.a.values()]
        terms = [add(*column) for column in zip(*parts, strict=True)]
        self._function = SwitchedFunction(frames, [terms], [*motion, *frames.outside.values()])

    def __call__(
        self, q: Array, v: Array, a: Array, outside: Array, rows: Array | None = None
    ) -> Array:
        """Force x, y [N] and moment about the origin [N m], (3, N).

        Parameters
        ----------
        q, v, a : (n, N) angles [rad] or displacements [m], rates, accelerations
        outside : (k, N) values of the inputs `outside`
        rows : values of the switches; by default those at these positions
        """
        return self._function(np.concatenate([q, v, a, outside]), rows)[0]

    def impulse(self, q: Array, step: Array, outside: Array) -> Array:
        """Impulse x, y [N s] and its moment about the origin [N m s], (3, N).

        Parameters
        ----------
        step : (n, N) steps of the velocities [rad/s, m/s]
        """
        rest = np.zeros_like(q)
        return self(q, rest, step, outside) - self(q, rest, rest, outside)


def _masses(mechanism: Mechanism) -> Iterator[tuple[str, str, float, Point, float]]:
    """Names, links, masses [kg], points, and moments of inertia [kg m^2] that turn with links.

    A rigid link has one mass, others have many.
    """
    for body in mechanism.bodies:
        own = body.extension
        if not (own and own.scattered):
            yield body.name, body.name, body.mass, mechanism.centre(body.name), body.inertia
            continue
        for k, (mass, point) in enumerate(mechanism.particles(body.name)):
            yield f'{body.name}@{k}', body.name, mass, point, 0.0 if k else own.spin_of(body)
