"""Forces between teeth in closed form ([V] 5.5, 5.8): the second route to those of scenes."""

from __future__ import annotations

import math

from mechanism_sim.joints.bevel.constraint import pitch_angles
from mechanism_sim.joints.worm.constraint import GearedForces, ToothForce


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
