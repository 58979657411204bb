"""Impact noise: the sound of bodies that change their velocity when they strike each other.

A rigid body that is suddenly accelerated pushes the air in front of it and pulls what is behind.
This *acceleration noise* is modelled as in L. L. Koss and R. J. Alfredson, Transient sound
radiated by spheres undergoing an elastic collision, J. Sound Vib. 27 (1973): two spheres, each a
dipole whose acceleration is half a sine, as long as a Hertzian contact lasts. Here a sphere has
the mass with which its link resists the impact. That bodies ring afterwards is not part of it:
links are rigid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.events import Impact
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.planar.gaps import is_stop, joint_of_gap
from mechanism_sim.planar.mechanism import Joint, Mechanism, Revolute
from mechanism_sim.planar.points import GROUND

_HEARING = 20e-6  #: [Pa] to which sound pressure levels refer
_FAINT = 1e-7  # of its start, to which a click is followed
_STILL = 1e-9  # of a change of velocity: what is less is rounding


@dataclass(frozen=True)
class Air:
    """Air at 20 degrees Celsius and 101.325 kPa, in which the sound travels."""

    density: float = 1.204  #: [kg/m^3]
    speed: float = 343.2  #: [m/s] of sound


@dataclass(frozen=True)
class SoundMaterial:
    """Steel, of which both spheres are."""

    density: float = 7850.0  #: [kg/m^3]
    modulus: float = 206e9  #: [Pa] of elasticity
    poisson: float = 0.3


@dataclass(frozen=True)
class Listener:
    """Position of the listener relative to the impacting joint, in the plane of the machine."""

    distance: float = 1.0  #: [m]
    direction: float = 0.0  #: [rad] from the x axis

    def __post_init__(self) -> None:
        if not (0.0 < self.distance < math.inf and math.isfinite(self.direction)):
            raise InputError(
                f'the listener must be away from the machine, not {self.distance:g} m'
            )


AIR, STEEL = Air(), SoundMaterial()


def sphere_modes(radius: Array, distance: Array) -> tuple[Array, Array]:
    """Pressure straight ahead of an accelerated sphere, as modes of its impulse response.

    The wave equation outside of a rigid sphere of radius a that moves to and fro along its axis
    has a dipole as its solution. With the condition that air moves with the surface,

    ``p / acceleration = rho a^3 / r^2 cos(angle) (1 + s r / c) / ((s a / c)^2 + 2 s a / c + 2)``

    after the delay ``(r - a) / c``, r being the distance from the centre: exact near and far.

    Parameters
    ----------
    radius, distance : (N,) [m]

    Returns
    -------
    poles (N, 2) [1/s] and residues (N, 2) [Pa / (m/s^2) / s], of angle 0
    """
    corner = AIR.speed / radius
    poles = corner[:, None] * np.array([-1.0 + 1.0j, -1.0 - 1.0j])
    numerator = 1.0 + poles * (distance / AIR.speed)[:, None]
    gain = AIR.density * radius**3 / distance**2 * corner**2
    residues = gain[:, None] * numerator / (poles - poles[:, ::-1])
    return poles, residues


def half_sine_response(poles: Array, residues: Array, duration: float, t: Array) -> Array:
    """Response of ``sum_k residues_k / (s - poles_k)`` to half a sine of unit area.

    Parameters
    ----------
    poles, residues : (k,), conjugate pairs complete
    duration : [s] of the pulse
    t : (N,) [s] since its start

    Returns
    -------
    (N,), zero before the start
    """
    w = math.pi / duration
    weights = 0.5 * w * residues * w / (poles**2 + w**2)
    since = np.maximum(t, 0.0)[:, None]
    after = since - duration
    free = np.exp(poles * since)
    driven = np.cos(w * since) + poles / w * np.sin(w * since)
    again = np.exp(poles * np.maximum(after, 0.0))
    response = np.where(after > 0.0, free + again, free - driven) @ weights
    return np.where(t > 0.0, response.real, 0.0)


def contact_time(mass: float, radius: float, speed: float) -> float:
    """Duration of a Hertzian impact of steel [s].

    From ``mass x'' = -4/3 E sqrt(radius) x^(3/2)``, E being the modulus of two equal materials.

    Parameters
    ----------
    mass, radius : [kg], [m] reduced: ``1 / (1/m1 + 1/m2)``
    speed : [m/s] of approach
    """
    modulus = STEEL.modulus / (2.0 * (1.0 - STEEL.poisson**2))
    deepest = (15.0 * mass * speed**2 / (16.0 * modulus * math.sqrt(radius))) ** 0.4
    return float(0.8 * scipy.special.beta(0.4, 0.5) * deepest / speed)


class Strike(NamedTuple):
    """An impact as two bodies that change their velocities along its normal.

    The first one is thrown back along the normal, the second forward.
    """

    t: float  #: [s]
    normal_angle: float  #: [rad] from the first to the second body
    approach_speed: float  #: [m/s]
    reduced_mass: float  #: [kg] that takes part in the contact
    jump: tuple[float, float]  #: [m/s]
    mass: tuple[float, float]  #: [kg] of what moves the air


def strikes(mechanism: Mechanism, motion: Motion, impacts: Sequence[Impact]) -> list[Strike]:
    """Bodies that move in every impact, and how heavy they are.

    The jumps are read from the motion, of the joint's point on each link along the normal. Where
    that is not the point of contact, as between gears, a link that does not turn still tells its
    own; if neither does, and at the first instant, each is taken to do half of the change of
    relative velocity. The impulse over its jump is the mass with which a link resists;
    beyond the mass of the link itself it is due to what holds the link, and moves no air.
    """
    found = []
    for impact in impacts:
        change = impact.approach_speed + impact.rebound_speed
        if not (impact.normal_impulse > 0.0 and impact.approach_speed > 0.0):
            continue
        joint = joint_of_gap(mechanism, impact.joint)
        if is_stop(joint, impact.joint):
            continue  # spheres that strike along the axes are not heard in the plane
        part = _part(mechanism, joint, motion.curve, impact)
        jump = change * part, change * (1.0 - part)
        links = joint.first, joint.second
        weights = (math.inf if x == GROUND else mechanism.body(x).mass for x in links)
        resisting = (impact.normal_impulse / v if v else 0.0 for v in jump)
        mass = tuple(min(a, b) for a, b in zip(resisting, weights, strict=True))
        found.append(
            Strike(
                impact.t,
                impact.normal_angle,
                impact.approach_speed,
                impact.normal_impulse / change,
                jump,
                (mass[0], mass[1]),
            )
        )
    return found


def _part(mechanism: Mechanism, joint: Joint, curve: PiecewisePolynomial, impact: Impact) -> float:
    """Share of the first link in the change of relative velocity, 0 to 1."""
    if GROUND in (joint.first, joint.second):
        return float(joint.second == GROUND)
    after = int(curve.begun_by([impact.t])[0])
    if not 0 < after < len(curve):
        return 0.5
    segments, dt = np.array([after - 1, after]), np.array([curve.duration[after - 1], 0.0])
    q, v = (x.T for x in curve.locals(segments, dt, (0, 1)))
    normal = np.array([math.cos(impact.normal_angle), math.sin(impact.normal_angle)])
    change = impact.approach_speed + impact.rebound_speed
    parts = []
    for link, at in joint.points:
        frame = mechanism.frame(link)[0]
        spin = 0.0 if frame == GROUND else np.diff(v[mechanism.coordinates.index(frame)])[0]
        jump = np.diff(mechanism.trace((link, at), q, v)[1].T @ normal)[0]
        known = isinstance(joint, Revolute) or abs(spin) * mechanism.size < _STILL * change
        part = min(abs(float(jump)) / change, 1.0)
        parts.append((part if part > _STILL else 0.0) if known else None)
    first, second = parts
    if first is not None:
        return first
    return 0.5 if second is None else 1.0 - second


def pressure(
    train: Sequence[Strike],
    rate: float,
    end: float,
    listener: Listener,
    pulse: float | None = None,
) -> Array:
    """Sound pressure of a train of impacts [Pa], at the multiples of ``1 / rate``.

    The two spheres touch at the joint on the line of impact. They are thrown apart: far away their
    sounds all but cancel, and only the way between their centres leaves a rest.

    Parameters
    ----------
    rate : [Hz]
    end : [s] up to which samples are wanted
    pulse : [s] duration of all impacts; without it each lasts as long as a Hertzian contact
    """
    if pulse is not None and not pulse > 0.0:
        raise InputError(f'a pulse must last longer than {pulse:g} s')
    samples = np.zeros(int(end * rate) + 1)
    for strike in train:
        moved = np.array(strike.mass) > 0.0
        radius = np.cbrt(0.75 * np.array(strike.mass)[moved] / (math.pi * STEEL.density))
        reduced = float(1.0 / np.sum(1.0 / radius))
        lasting = pulse or contact_time(strike.reduced_mass, reduced, strike.approach_speed)
        turn = strike.normal_angle - listener.direction
        way = np.array([-1.0, 1.0])[moved]
        ahead = listener.distance * math.cos(turn) * way - radius
        distance = np.hypot(ahead, listener.distance * math.sin(turn))
        if distance.min() <= radius.max():
            raise InputError(
                f'the listener is too near, at {listener.distance:g} m: a body that strikes has a '
                f'radius of {radius.max():.3g} m'
            )
        strength = np.array(strike.jump)[moved] * ahead / distance
        modes = sphere_modes(radius, distance)
        for k, (poles, residues) in enumerate(zip(*modes, strict=True)):
            begins = strike.t + (distance[k] - radius[k]) / AIR.speed
            lasts = lasting + math.log(_FAINT) / poles[0].real
            n = np.arange(
                int(begins * rate) + 1, min(int((begins + lasts) * rate) + 2, len(samples))
            )
            samples[n] += strength[k] * half_sine_response(
                poles, residues, lasting, n / rate - begins
            )
    return samples


def level(p: float) -> float:
    """Sound pressure level [dB] of a pressure [Pa]."""
    return 20.0 * math.log10(p / _HEARING)
