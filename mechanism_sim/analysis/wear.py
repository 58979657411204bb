"""Wear of a bearing, by direction on bushing and pin: impulses, sliding work, load times way.

Archard's law: the volume worn off is in proportion to the integral of normal force times the way
slid (J. F. Archard, Contact and rubbing of flat surfaces, J. Appl. Phys. 24 (1953) 981). Where the
contact follows, the integrals run over the motion's polynomials; impacts come on top.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechanism_sim.analysis.record import Record, loose_bearing
from mechanism_sim.analysis.roses import impact_rose
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.planar.play import joint_of_gap
from mechanism_sim.results.bearing_wear import binned, wear_sums


@dataclass(frozen=True, eq=False)
class WearMap:
    """Sums over a run by direction in the frame of a link, in n sectors.

    Attributes
    ----------
    link : whose frame it is
    edges : (n + 1,) of the sectors [rad], from -pi to pi
    impulse : (n,) normal impulses of impacts [N s]
    load : (n,) integral of the normal force over time in following [N s]
    load_way : (n,) integral of normal force times slip speed: Archard's measure of wear [N m]
    work : (n,) integral of friction force times slip speed: heat [J]
    """

    link: str
    edges: Array
    impulse: Array
    load: Array
    load_way: Array
    work: Array

    @property
    def middles(self) -> Array:
        """Of the sectors (n,) [rad]."""
        return np.asarray(0.5 * (self.edges[1:] + self.edges[:-1]))


def wear_maps(
    record: Record,
    joint: str,
    sectors: int = 72,
    pin_radius: float | None = None,
    skip: int = 0,
) -> tuple[WearMap, WearMap]:
    """Wear of the bushing and of the pin of a joint.

    Normal force, slip and direction are those at 8 Gauss nodes of every step; the sums over all
    sectors are exact to the tolerance of the run, but for steps within which sliding without
    friction turns back, and each node counts in the sector where it lies.

    Parameters
    ----------
    sectors : into which the circle is divided
    pin_radius : [m]; that of the scene unless told. Of a pin without friction it does not change
        the motion, but it does how far surfaces slide
    skip : whole turns at the start that are left out

    Returns
    -------
    Of the bushing and of the pin.
    """
    loose_bearing(record, joint)
    play = record.machine.plan.clearances[joint_of_gap(record.machine.mechanism, joint).name]
    radius = play.pin_radius if pin_radius is None else pin_radius
    if play.friction and radius != play.pin_radius:
        raise InputError(
            f'{record.machine.name}: the pin of {joint} has friction and a radius of '
            f'{play.pin_radius:g} m in the scene; it cannot be taken to be {radius:g} m afterwards'
        )
    if sectors < 1 or radius < 0.0:
        raise InputError(
            'a wear map needs at least one sector, and a pin radius that is not negative'
        )
    edges = np.linspace(-np.pi, np.pi, sectors + 1)
    rose = impact_rose(record, joint, skip)
    times = np.array([record.begin(skip), np.inf])
    followed = wear_sums(record.machine, record.piece, joint, sectors, times, radius)
    maps = (
        WearMap(link, edges, binned(angle, rose.normal_impulse, sectors), *own[:3, 0])
        for link, angle, own in zip(
            (rose.bushing, rose.pin), (rose.on_bushing, rose.on_pin), followed, strict=True
        )
    )
    bushing, pin = maps
    return bushing, pin
