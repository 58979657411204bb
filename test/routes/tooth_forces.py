"""Forces between teeth in closed form ([V] 5.5, 5.8): the second route to those of scenes."""

from __future__ import annotations

import math
from typing import NamedTuple

from mechanism_sim.joints.bevel.constraint import pitch_angles
from mechanism_sim.joints.worm.constraint import WormPair


class ToothForce(NamedTuple):
    """Force on the teeth of one gear [N]."""

    tangential: float
    radial: float
    axial: float

    @property
    def total(self) -> float:
        """Its size [N]; without friction it is the normal force."""
        return math.hypot(*self)


class GearedForces(NamedTuple):
    """Forces and power that one gear passes on to another."""

    driver: ToothForce
    driven: ToothForce
    ratio: float  #: speed of the driver over that of the driven gear, without sign
    efficiency: float  #: power out over power in
    torque: float  #: torque that the driven gear gives [N m]


def helical(
    torque: float,
    radius: float,
    pressure_angle: float,
    helix_angle: float,
    ratio: float,
    efficiency: float = 1.0,
) -> GearedForces:
    """Helical gears on parallel shafts, [V] eqs. 5.32 to 5.36; with helix angle 0 spur gears.

    Parameters
    ----------
    torque : of the driver [N m]
    radius : pitch radius of the driver [m]
    pressure_angle : in the plane normal to the teeth, phi_n [rad]
    helix_angle : psi [rad]
    ratio : N3/N2
    efficiency : lowers the torque of the driven gear; friction at the pitch point vanishes, so
        the forces there do not show it
    """
    tangential = torque / radius
    force = ToothForce(
        tangential,
        tangential * math.tan(pressure_angle) / math.cos(helix_angle),
        tangential * math.tan(abs(helix_angle)),
    )
    return GearedForces(force, force, ratio, efficiency, efficiency * torque * ratio)


def spur(
    torque: float, radius: float, pressure_angle: float, ratio: float, efficiency: float = 1.0
) -> GearedForces:
    """Spur gears, [V] eqs. 5.8, 5.9, 5.11; parameters as in `helical`."""
    return helical(torque, radius, pressure_angle, 0.0, ratio, efficiency)


def bevel(
    torque: float,
    radius: float,
    pressure_angle: float,
    ratio: float,
    shaft_angle: float = math.pi / 2,
    efficiency: float = 1.0,
) -> GearedForces:
    """Straight-tooth bevel gears, [V] eqs. 5.38 to 5.42.

    `radius` is the driver's pitch radius [m] at the middle of the teeth; the rest as in
    `helical`. Axial forces point away from the apex.
    """
    tangential = torque / radius
    across = tangential * math.tan(pressure_angle)
    driver, driven = (
        ToothForce(tangential, across * math.cos(angle), across * math.sin(angle))
        for angle in pitch_angles(ratio, shaft_angle)
    )
    return GearedForces(driver, driven, ratio, efficiency, efficiency * torque * ratio)


def worm(
    pair: WormPair, torque: float, friction: float = 0.0, *, wheel_drives: bool = False
) -> GearedForces:
    """A worm and its wheel, [V] 5.8.4, by the normal force and friction along the thread.

    The worm's axial force is the wheel's tangential one and the other way round.
    """
    mu = -friction if wheel_drives else friction
    press = math.cos(pair.pressure_angle)
    c, s = math.cos(pair.lead_angle), math.sin(pair.lead_angle)
    around, along = press * s + mu * c, press * c - mu * s
    radii = pair.diameter / 2.0, pair.wheel_diameter / 2.0
    normal = torque / (along * radii[1] if wheel_drives else around * radii[0])
    radial = normal * math.sin(pair.pressure_angle)
    on_worm = ToothForce(normal * around, radial, normal * along)
    on_wheel = ToothForce(on_worm.axial, radial, on_worm.tangential)
    driver, driven = (on_wheel, on_worm) if wheel_drives else (on_worm, on_wheel)
    speeds = pair.teeth / pair.threads
    speeds = 1.0 / speeds if wheel_drives else speeds
    given = driven.tangential * radii[0 if wheel_drives else 1]
    return GearedForces(driver, driven, speeds, given / (torque * speeds), given)
