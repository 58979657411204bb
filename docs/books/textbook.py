"""Tables and formulas of textbooks that tests compare the package with; it needs none of them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.joints.cam.laws import Diagram, Law
from mechanism_sim.joints.cam.profiles import greatest
from mechanism_sim.joints.mesh.involute import ToothSystem
from mechanism_sim.linkages.four_bar import FourBar, SliderCrank

Array = NDArray[np.float64]

#: [V] table 5.1, by name: pressure angle in degrees, with "deep" for a dedendum of 1.35 modules
TOOTH_SYSTEMS = {
    **{f'full {a:g}': ToothSystem(math.radians(a)) for a in (20, 22.5, 25)},
    **{f'full {a:g} deep': ToothSystem(math.radians(a), 1.0, 1.35) for a in (20, 22.5, 25)},
    'stub 20': ToothSystem(math.radians(20), 0.8, 1.0),
}


def normalised(law: Diagram, angle: ArrayLike, order: int = 0) -> Array:
    """Displacement over the lift ([V] 4.21 to 4.26), or a derivative by the share of a segment.

    That is times a power of its span, over its rise, both negative in a return. For the
    four-spline, [V] 4.62 to 4.65 take half the angle.
    """
    u, x = law(angle, order), np.mod(angle, 2.0 * math.pi)
    if order == 0:
        return u / law.lift
    scale = np.zeros(np.shape(angle))
    for s in law.segments:
        span = (s.end - s.start) * (1 if s.rise > 0 else -1)
        if s.rise:
            scale = np.where((x >= s.start) & (x < s.end), span**order / abs(s.rise), scale)
    return u * scale


def smallest_flat_base_radius(law: Law, curvature_radius: float = 0.0, tilt: float = 0.0) -> float:
    """The smallest base radius [m] under a translating flat face, by the curvature of the profile.

    Parameters
    ----------
    curvature_radius : the least the profile may have [m]; at 0 it just has a cusp
    tilt : of the face [rad]
    """
    deepest = greatest(law, lambda x: -law(x) - law(x, 2))[1]
    return curvature_radius + math.cos(tilt) * deepest


def transmission_angle(linkage: FourBar, th2: Array) -> Array:
    """Angle between coupler and rocker [rad] at crank angles (N,); NaN where it cannot close."""
    ground, crank, coupler, rocker = linkage.lengths
    squared = ground**2 + crank**2 - 2.0 * ground * crank * np.cos(th2)
    cosine = (coupler**2 + rocker**2 - squared) / (2.0 * coupler * rocker)
    closed = np.abs(cosine) <= 1.0 + 1e-12
    return np.where(closed, np.arccos(np.clip(cosine, -1.0, 1.0)), np.nan)


def slider_position(linkage: SliderCrank, th2: ArrayLike) -> Array:
    """Position of a slider [m]; NaN where the rod does not reach its line."""
    across = linkage.offset - linkage.crank * np.sin(th2)
    with np.errstate(invalid='ignore'):
        return linkage.crank * np.cos(th2) + np.sqrt(linkage.rod**2 - across**2)


def slider_transmission_angle(linkage: SliderCrank, th2: ArrayLike) -> Array:
    """Angle between the rod and the normal of the slider's line [rad], 0 to pi."""
    with np.errstate(invalid='ignore'):
        return np.arccos((linkage.offset - linkage.crank * np.sin(th2)) / linkage.rod)
