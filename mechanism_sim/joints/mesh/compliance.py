"""Elastic teeth: mesh stiffness, which changes with the number of pairs of teeth in contact.

Seen along the line of action a mesh is a spring and a damper. With the way x by which a flank is
pressed in and the phase u of the teeth,

    k(u) = k0 (1 + sum_j a_j cos(j u))

where u = 0 is the middle of the part with most pairs of teeth in contact. The force follows from
the potential k(u) x^2/2: beside k x along the line of action there is the couple -k'(u) x^2/2
between first gear and carrier, without which a turning gear would gain energy from nothing.

Elastic flanks are switched force elements, not contacts: their stiffness depends on the angle, and
they may drive loose rigid bearings, of which a scene has one kind only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.joints.mesh.pair import Path

HARMONICS = 5
"""Number of harmonics of the contact ratio, unless given."""


@dataclass(frozen=True)
class Elasticity:
    """Stiffness and damping of a mesh along the line of action."""

    stiffness: float  #: k0 [N/m], the mean
    damping: float = 0.0  #: [N s/m]
    variation: tuple[float, ...] = ()  #: harmonics a_1, a_2, ... relative to k0
    tooth: float = 0.0  #: [rad] N a of the first gear with a tooth on the line of centres
    lead: float = 0.0  #: [rad] phase u of the first flank with that tooth there

    def __post_init__(self) -> None:
        least = min(
            1.0 + sum(a * math.cos(j * u) for j, a in enumerate(self.variation, 1))
            for u in (math.pi * k / 180.0 for k in range(181))
        )
        if least <= 0.0:
            raise InputError('the stiffness of the teeth becomes negative: vary it less')

    def energy_slope(self, turned: Array, offset: Array, play: float) -> Array:
        """Derivative of the potential by the phase of the first, ``k'(u) x^2/2`` (N,) [J/rad].

        Parameters
        ----------
        turned : N a of the first gear (N,) [rad]
        offset : h of its flank with the transmission error (N,) [m]
        play : backlash to either side [m]
        """
        found = np.zeros_like(offset)
        for sign in (1.0, -1.0):
            u, pressed = (
                turned + sign * self.lead - self.tooth,
                np.maximum(sign * offset - play, 0.0),
            )
            for j, a in enumerate(self.variation, 1):
                found -= 0.5 * self.stiffness * j * a * np.sin(j * u) * pressed**2
        return found


def touching(path: Path, base_pitch: float, harmonics: int = HARMONICS) -> tuple[float, ...]:
    """Variation a_1, a_2, ... of a stiffness in proportion to the pairs of teeth in contact.

    Their number changes between two integers: a rectangular wave. Its Fourier series is smoothed
    by Lanczos' sigma factors, so that it does not overshoot.
    """
    ratio = (path.end - path.start) / base_pitch
    share = ratio - math.floor(ratio)
    found = []
    for j in range(1, harmonics + 1):
        x = math.pi * j / (harmonics + 1)
        found.append(2.0 / (math.pi * j) * math.sin(math.pi * j * share) / ratio * math.sin(x) / x)
    return tuple(found)


def middle(path: Path, base_pitch: float) -> float:
    """Phase [rad] of a contact from the pitch point, in the middle of the most pairs."""
    pairs = math.floor((path.end - path.start) / base_pitch)
    place = 0.5 * (path.start + path.end + pairs * base_pitch)
    return 2.0 * math.pi * place / base_pitch
