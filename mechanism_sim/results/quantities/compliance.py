"""Deformation of elastic links, and what bearings of joints out of line carry."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.hybrid.physics import DynamicPhysics
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.planar.protocols import EndGap
from mechanism_sim.results.quantity import Quantity, Shown, View, vector
from mechanism_sim.scene import Machine


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
    yield Quantity(
        f'{name}.size', 'N m', words, joint, lambda view: np.hypot(*moment(view)), part='size'
    )
    if any(gap.thrust for _, gap in ends):

        def thrust(view: View) -> Array:
            each = [gap.thrust * view.observed.normal_force[k] for k, gap in ends]
            return np.asarray(np.sum(each, axis=0))

        words = f'axial force in {joint}'
        yield Quantity(f'axial_force.{joint}', 'N', words, joint, thrust)
