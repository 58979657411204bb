"""Impacts and wear of pins and bushings by direction on both parts, and per turn.

After [SB] 8.1, figures 8.11 (impulse directions on the bearing components, each as seen by an
observer who moves with its link) and 8.12 (dominant impacts of a cycle), and [SB] 7.3 for the sum
of impulses and I_n.

Archard's law: the volume worn off is in proportion to the integral of normal force times the way
slid (J. F. Archard, Contact and rubbing of flat surfaces, J. Appl. Phys. 24 (1953) 981). Where the
contact follows, the integrals run over the motion's polynomials; impacts come on top.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.analysis.record import Record, loose_bearing
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.planar.gaps import joint_of_gap
from mechanism_sim.planar.points import GROUND
from mechanism_sim.results.bearing_wear import shared, wear_sums
from mechanism_sim.results.turns import impact_means, impacts_by_turn

MARKED = 6  #: number of marked impacts, as in [SB] 8.11
_SECTORS = 72  # sectors of a circle, in maps of wear


@dataclass(frozen=True, eq=False)
class Rose:
    """The N impacts of a joint, in the order of time.

    The place that is struck lies, on the bushing as on the pin, in the direction from the
    bushing's centre to the pin's; the impulse pushes the bushing that way and the pin back.
    """

    joint: str
    #: names of the links with pin and bushing
    pin: str
    bushing: str
    time: Array  #: (N,) times [s]
    crank_angle: Array  #: angle of the main drive [rad] in [0, 2 pi)
    #: whole turns of the drive before the impact; angle zero begins a turn. 0 of a drive that
    #: slides, whose angle is not a number
    turn: NDArray[np.int64]
    #: [N s]
    normal_impulse: Array
    tangential_impulse: Array
    approach_speed: Array  #: [m/s]
    #: direction of the impact position, in the frame of the pin's and of the bushing's link [rad]
    #: in (-pi, pi]
    on_pin: Array
    on_bushing: Array
    in_world: Array  #: direction of the contact point in the world

    def __len__(self) -> int:
        return len(self.time)

    @property
    def largest(self) -> NDArray[np.intp]:
        """Indices of the six largest impulses, the largest first: Y1 to Y6 of [SB] 8.11."""
        return np.argsort(-self.normal_impulse, kind='stable')[:MARKED]


def impact_rose(record: Record, joint: str, skip: int = 0) -> Rose:
    """The impacts of a joint with a pin in a bushing: none of a pin that an oil film carries.

    Parameters
    ----------
    skip : whole turns at the start that are left out; the part of a turn before them, too
    """
    machine = record.machine
    spec = machine.plan.clearances.get(joint)
    if not (spec and spec.film):
        loose_bearing(record, joint)
    pin_joint = joint_of_gap(machine.mechanism, joint)
    begin = record.begin(skip)
    struck = record.piece.impacts.of_joint(joint)
    struck = struck.where(struck.column('t') >= begin)
    t, world = struck.column('t'), struck.column('normal_angle')
    on_pin, on_bushing = (
        _wrapped(world - _link_angles(record, link, t))
        for link in (pin_joint.first, pin_joint.second)
    )
    return Rose(
        joint,
        pin_joint.first,
        pin_joint.second,
        t,
        record.angle(t),
        np.floor(np.nan_to_num(record.turned(t)) + 1e-9).astype(np.int64),
        struck.column('normal_impulse'),
        struck.column('tangential_impulse'),
        struck.column('approach_speed'),
        on_pin,
        on_bushing,
        _wrapped(world),
    )


def _link_angles(record: Record, link: str, t: Array) -> Array:
    """Angle of a link at times (N,) of impacts [rad]; positions are continuous there."""
    frame, offset = record.machine.mechanism.frame(link)
    if frame == GROUND:
        return np.full(len(t), offset)
    i = record.machine.physics.coordinates.index(frame)
    return np.asarray(record.piece.motion.curve(t)[:, i] + offset)


def _wrapped(angle: Array) -> Array:
    return np.asarray(np.angle(np.exp(1j * angle)))


@dataclass(frozen=True, eq=False)
class ImpactCycles:
    """Impacts of a joint in each of K whole turns of the drive."""

    first: int  #: number of the first turn
    #: (K,) impacts and sum of their normal impulses [N s]
    count: NDArray[np.int64]
    impulse: Array
    #: (K, 3) indices into the rose of the largest impacts of each turn, the largest first; -1
    #: where there are fewer
    dominant: NDArray[np.intp]
    #: by name (``count``, ``impulse``, ``I_n``): the mean over turns, for I_n the sum of impulses
    #: over the number of impacts; half the width of its 95 % confidence interval; and the standard
    #: deviation from turn to turn. nan where there are too few
    means: dict[str, tuple[float, float, float]]

    @property
    def I_n(self) -> Array:
        """Impulse per impact (K,) [N s]; nan in turns without ([SB] 7.3)."""
        none = np.full(len(self.count), np.nan)
        np.divide(self.impulse, self.count, out=none, where=self.count > 0)
        return none


def impact_cycles(record: Record, rose: Rose, skip: int = 0) -> ImpactCycles:
    """The impacts of a rose turn by turn."""
    first, end = record.whole_turns(skip)
    row = rose.turn - first
    inside = (row >= 0) & (row < end - first)
    counts, sums = impacts_by_turn(row[inside], rose.normal_impulse[inside], end - first)
    count, impulse = counts[:, 0], sums[:, 0]
    dominant = np.full((end - first, 3), -1, dtype=np.intp)
    taken = np.zeros(end - first, dtype=np.intp)
    for k in np.argsort(-rose.normal_impulse, kind='stable'):
        if inside[k] and taken[row[k]] < 3:
            dominant[row[k], taken[row[k]]] = k
            taken[row[k]] += 1
    with_impacts = count > 0
    spreads = (count.astype(float), impulse, impulse[with_impacts] / count[with_impacts])
    means = {
        name: (m.mean, m.half_width, float(x.std(ddof=1)) if len(x) > 1 else float('nan'))
        for name, m, x in zip(
            ('count', 'impulse', 'I_n'), impact_means(spreads[0], impulse), spreads, strict=True
        )
    }
    return ImpactCycles(first, count, impulse, dominant, means)


@dataclass(frozen=True, eq=False)
class WearMap:
    """Sums over a run by direction in the frame of a link, at the middles of n sectors.

    What lies between two middles counts at both, by how near they are.
    """

    link: str  #: link of the frame
    edges: Array  #: (n + 1,) limits of the sectors [rad], from -pi to pi
    impulse: Array  #: (n,) normal impulses of impacts [N s]
    load: Array  #: (n,) integral of the normal force over time in following [N s]
    #: (n,) integral of normal force times slip speed: Archard's measure of wear [N m]
    load_way: Array
    work: Array  #: (n,) integral of friction force times slip speed: heat [J]

    @property
    def middles(self) -> Array:
        """Middles of the sectors (n,) [rad]."""
        return np.asarray(0.5 * (self.edges[1:] + self.edges[:-1]))


def wear_maps(
    record: Record, joint: str, pin_radius: float | None = None, skip: int = 0
) -> tuple[WearMap, WearMap]:
    """Wear of the bushing and of the pin of a joint.

    Normal force, slip and direction are those at 8 Gauss nodes of every step; the sums over all
    sectors are exact to the tolerance of the run, but for steps within which sliding without
    friction turns back, those of a sector to some 0.3 %, see `wear_sums`.

    Parameters
    ----------
    pin_radius : radius of the pin [m]; default: the scene's. Without friction it has no effect
        on the motion, but on the sliding distance
    skip : whole turns at the start that are left out

    Returns
    -------
    Of the bushing and of the pin.
    """
    loose_bearing(record, joint)
    spec = record.machine.plan.clearances[joint_of_gap(record.machine.mechanism, joint).name]
    radius = spec.journal if pin_radius is None else pin_radius
    if spec.friction and radius != spec.journal:
        raise InputError(
            f'{record.machine.name}: the pin of {joint} has friction and a radius of '
            f'{spec.journal:g} m in the scene; it cannot be taken to be {radius:g} m afterwards'
        )
    if radius < 0.0:
        raise InputError('a wear map needs a pin radius of at least 0')
    edges = np.linspace(-np.pi, np.pi, _SECTORS + 1)
    rose = impact_rose(record, joint, skip)
    times = np.array([record.begin(skip), np.inf])
    first = -np.pi + np.pi / _SECTORS
    followed = wear_sums(record.machine, record.piece, joint, _SECTORS, times, radius, first=first)
    maps = (
        WearMap(link, edges, shared(angle, rose.normal_impulse, _SECTORS, first), *own[:3, 0])
        for link, angle, own in zip(
            (rose.bushing, rose.pin), (rose.on_bushing, rose.on_pin), followed, strict=True
        )
    )
    bushing, pin = maps
    return bushing, pin
