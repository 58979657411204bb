"""Motion of coordinates and points; deformation of links, tilt of joints; forces on the frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from mechanism_sim.arguments import listed
from mechanism_sim.arrays import Array
from mechanism_sim.engine.physics import DynamicPhysics
from mechanism_sim.errors import check_known
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import LinkPoint, Point
from mechanism_sim.planar.protocols import EndGap
from mechanism_sim.results.quantity import Quantity, Shown, View, direction, magnitude, vector
from mechanism_sim.scene import Machine
from mechanism_sim.scene.frame_forces import whole_machine
from mechanism_sim.tolerances import TOLERANCES
from mechanism_sim.vibration.shaken_frame import WholeMachine

_SOLVED = TOLERANCES.rounding.solved

RATES = {'position': '', 'velocity': '/s', 'acceleration': '/s^2'}
"""Kinds of quantities of a motion, with what they add to the unit."""
DERIVATIVES = {kind: order for order, kind in enumerate(RATES)}
"""Orders of derivative of a position, by quantity."""

_WORDS = {
    'rad': ('angle', 'angular velocity', 'angular acceleration'),
    'm': ('displacement', 'velocity', 'acceleration'),
}
"""Names of a coordinate and of its rates, by its unit."""


def tracks(
    mechanism: Mechanism, places: Sequence[LinkPoint | Point], derivatives: int = 0
) -> Callable[[View], Array]:
    """Positions of points, and so many derivatives: (P, 1 + derivatives, 2, N)."""

    def track(view: View) -> Array:
        trajectory = view.trajectory(derivatives)
        return np.array([mechanism.trace(place, *trajectory) for place in places])

    return track


def of_coordinates(machine: Machine) -> Iterator[Quantity]:
    """``position.COORDINATE``, ``velocity.``, ``acceleration.`` of all coordinates."""
    physics = machine.physics
    for k, (kind, per) in enumerate(RATES.items()):
        for i, coordinate in enumerate(physics.coordinates):
            unit = 'm' if coordinate in physics.displacements else 'rad'
            words = f'{_WORDS[unit][k]} of {coordinate}'
            yield Quantity(f'{kind}.{coordinate}', unit + per, words, coordinate, _row(k, i))


def _row(derivative: int, i: int) -> Callable[[View], Array]:
    if derivative:
        return lambda view: view.trajectory(derivative)[derivative][i]
    return lambda view: view.position[i]


def _named_points(machine: Machine) -> dict[str, LinkPoint]:
    """The points that have a name, ``LINK.POINT``; of moving links the ``cog`` too."""
    cogs = {f'{b.name}.cog': (b.name, b.cog) for b in machine.mechanism.bodies}
    return cogs | {
        f'{link}.{name}': (link, at)
        for link, points in machine.plan.points.items()
        for name, at in points.items()
    }


def choose_points(machine: Machine, names: str | Iterable[str]) -> dict[str, LinkPoint]:
    """The points of these names, in this order."""
    known, names = _named_points(machine), listed(names, 'points')
    for name in names:
        wrong = f"{machine.name} has no point '{name}'"
        check_known(name, known, wrong, 'a point is LINK.POINT:')
    return {name: known[name] for name in names}


def of_points(machine: Machine) -> Iterator[Quantity]:
    """``position.LINK.POINT.x`` and so on of all named points, in the world."""
    for name, place in _named_points(machine).items():
        yield from _rates(name, name, _track(machine.mechanism, place), Shown.ASKED)


def _track(mechanism: Mechanism, place: LinkPoint) -> Callable[[View, int], Array]:
    """One point (1 + derivatives, 2, N)."""
    return lambda view, derivatives: tracks(mechanism, [place], derivatives)(view)[0]


def of_mass_centre(machine: Machine) -> Iterator[Quantity]:
    """``position.mass_centre.x`` and so on of all moving links together."""
    bodies = machine.mechanism.bodies
    masses = np.array([body.mass for body in bodies])
    if not machine.physics.has_forces or not masses.any():
        return
    centres = [machine.mechanism.centre(body.name) for body in bodies]

    def centre(view: View, derivatives: int) -> Array:
        track = tracks(machine.mechanism, centres, derivatives)
        return np.asarray(np.tensordot(masses, track(view), 1) / masses.sum())

    yield from _rates('mass_centre', 'the mass centre', centre, Shown.CYCLE)


def _rates(
    name: str, words: str, track: Callable[[View, int], Array], shown: Shown
) -> Iterator[Quantity]:
    """Position, velocity and acceleration of a point: `track` gives (1 + derivatives, 2, N)."""

    def rates(view: View, most: int) -> Array:
        return view.once(('track', name, most), lambda: track(view, most))

    def rate(k: int) -> Callable[[View], Array]:
        return lambda view: rates(view, 2 if view.is_observed else max(k, 1))[k]

    for k, (kind, per) in enumerate(RATES.items()):
        yield from vector(f'{kind}.{name}', f'm{per}', f'{kind} of {words}', name, rate(k), shown)


def of_elastic_links(machine: Machine) -> Iterator[Quantity]:
    """``deflection.LINK`` in the middle, and ``stress.LINK``, the largest at the outer fibres."""
    for link, beam in machine.mechanism.having(Beam).items():
        yield from _of_beam(link, beam, machine.mechanism.amplitudes(link))


def _of_beam(link: str, beam: Beam, own: list[int]) -> Iterator[Quantity]:
    yield Quantity(
        f'deflection.{link}', 'm', f'deflection of {link} in the middle', link,
        lambda view: beam.sag(view.observed.position[own]),
    )  # fmt: skip
    if beam.fibre is not None:
        yield Quantity(
            f'stress.{link}', 'Pa', f'largest stress in {link}', link,
            lambda view: beam.largest_stress(view.observed.position[own]),
        )  # fmt: skip


def of_points_of_elastic_links(machine: Machine) -> Iterator[Quantity]:
    """``deflection.LINK.POINT`` across the link, ``stress.LINK.POINT`` of its left fibre.

    Stress is positive where the fibre is drawn.
    """
    for link, beam in machine.mechanism.having(Beam).items():
        own = machine.mechanism.amplitudes(link)
        for point in machine.scene.links[link].points:
            x = min(max(machine.plan.points[link][point][0], 0.0), beam.length)
            yield from _at_point(f'{link}.{point}', link, beam, own, x)


def _at_point(name: str, link: str, beam: Beam, own: list[int], x: float) -> Iterator[Quantity]:
    def deflection(view: View) -> Array:
        return np.asarray(beam.deflection(x) @ view.observed.local[own][: beam.modes])

    def stress(view: View) -> Array:
        strain = beam.strain(x, float(beam.outer_fibre(x))) @ view.observed.local[own]
        return np.asarray(beam.youngs_modulus * strain)

    yield Quantity(
        f'deflection.{name}', 'm', f'deflection at {name}', link, deflection, Shown.PARTS
    )
    if beam.fibre is not None:
        yield Quantity(f'stress.{name}', 'Pa', f'stress at {name}', link, stress, Shown.PARTS)


def of_tilting_joints(machine: Machine) -> Iterator[Quantity]:
    """Moments out of the plane and axial forces in bearings that are out of line.

    ``bearing_moment.JOINT.x``, ``.y``, ``.size`` [N m]: on the second link, about the middle;
    ``axial_force.JOINT`` [N] on it, towards the reader, if there are stops along the axis.
    """
    physics = machine.physics
    if not isinstance(physics, DynamicPhysics):
        return
    for joint in physics.tilting:
        gaps = enumerate(physics.system.gaps)
        ends = [(k, gap) for k, gap in gaps if isinstance(gap, EndGap) and gap.joint == joint]
        yield from _of_tilting_joint(joint, ends)


def _of_tilting_joint(joint: str, ends: list[tuple[int, EndGap]]) -> Iterator[Quantity]:
    def moment(view: View) -> Array:
        o = view.observed
        each = [gap.moment(o.local, o.normal_force[k], o.friction_force[k]) for k, gap in ends]
        return np.asarray(np.sum(each, axis=0))

    name, words = f'bearing_moment.{joint}', f'moment out of the plane in {joint}'
    yield from vector(name, 'N m', words, joint, moment)
    yield magnitude(name, 'N m', words, joint, moment, Shown.RUN)
    if any(gap.thrust for _, gap in ends):

        def thrust(view: View) -> Array:
            each = [gap.thrust * view.observed.normal_force[k] for k, gap in ends]
            return np.asarray(np.sum(each, axis=0))

        words = f'axial force in {joint}'
        yield Quantity(f'axial_force.{joint}', 'N', words, joint, thrust)


def of_frame(machine: Machine) -> Iterator[Quantity]:
    """``shaking_force.x``, ``.y``, ``.size``, ``.direction``; ``shaking_moment`` at the origin."""
    if not machine.physics.has_forces:
        return
    shaking = _Shaking(machine)

    def rows(view: View) -> Array:
        return view.once('shaking', lambda: shaking(view))

    def force(view: View) -> Array:
        return rows(view)[:2]

    name, words = 'shaking_force', 'shaking force on the frame'
    yield from vector(name, 'N', words, '', force, Shown.CYCLE)
    yield magnitude(name, 'N', words, '', force, Shown.CYCLE)
    yield direction(name, words, '', force, Shown.ASKED)
    yield Quantity(
        'shaking_moment', 'N m', 'shaking moment on the frame about the origin', '',
        lambda view: rows(view)[2], Shown.CYCLE,
    )  # fmt: skip


class _Shaking:
    """Force and moment about the origin of a machine on its frame; compiled when asked for."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._forces: WholeMachine | None = None

    def __call__(self, view: View) -> Array:
        """Force x, y [N] and moment [N m], (3, N)."""
        self._forces = self._forces or whole_machine(self._machine)
        found, o = view.on_frame(self._forces), view.observed
        # what forces leave of each other by rounding is nothing: a machine is balanced
        length = self._machine.mechanism.size
        size = np.abs(o.reaction).sum(axis=(0, 1)) + np.abs(found[:2]).sum(axis=0)
        size = _SOLVED * (size + o.kinetic_energy / length)
        found[np.abs(found) <= np.array([size, size, size * length])] = 0.0
        return found
