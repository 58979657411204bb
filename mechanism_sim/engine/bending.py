"""Elastic links that bend farther than the theory of small bends reaches.

Kinetic energy of a beam counts up to second order in its bends, see `planar.elastic`. What is left
out is of the order of their square: two files of `elastic_slider_crank` that hang its rod on
different joints differ by 17 times ``(deflection/length)^2`` of the bending, by 4 % where it bends
by a twentieth of its length. With four times that the mass matrix may be no such any more.
"""

from __future__ import annotations

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.tolerances import TOLERANCES

_MECHANISM = TOLERANCES.mechanism
_SECTIONS = 33
_PLACES = Nodes((0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0))
"""Places of a step at which bending is checked."""


class BendWatch:
    """Check of the bending of elastic links, at a few places of every step.

    Parameters
    ----------
    mechanism : whose links they are
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._beams = {
            link: (beam.length, mechanism.amplitudes(link)[: beam.modes], beam.deflection(places))
            for link, beam in mechanism.having(Beam).items()
            if isinstance(beam, Beam)
            for places in [np.linspace(0.0, beam.length, _SECTIONS)]
        }
        self._said: set[str] = set()

    def look(self, motion: Motion) -> list[str]:
        """A sentence for each link, once a run, that bends beyond the theory in a motion."""
        found = []
        for link in self._beams.keys() - self._said if len(motion) else ():
            curve = motion.curve
            q = curve.local(np.arange(len(curve)), _PLACES).T
            share = self._share(link, q)
            first = int(np.argmax(share > _MECHANISM.bends))
            if share[first] > _MECHANISM.bends:
                step, part = divmod(first, len(_PLACES))
                t = curve.start[step] + curve.duration[step] * _PLACES.fractions[part]
                self._said.add(link)
                error = f'{100 * _MECHANISM.bends_error:g} %'
                found.append(
                    f'{self._beyond(link, q[:, first])} at t = {t:.6g} s, beyond the theory of '
                    f'small bends, which is off by some {error} there, and more as the square '
                    'of the bending'
                )
        return sorted(found)

    def now(self, q: Array) -> str:
        """Words on coordinates (n,) in which links bend beyond the theory."""
        found = [
            f'{self._beyond(link, q)} beyond the theory of small bends'
            for link in self._beams
            if not self._share(link, q) <= _MECHANISM.bends
        ]
        return '; '.join(found)

    def _share(self, link: str, q: Array) -> Array:
        """Largest deflection (...,) of a link by its length, at coordinates (n, ...)."""
        length, own, shapes = self._beams[link]
        return np.asarray(np.abs(shapes.T @ q[own]).max(axis=0) / length)

    def _beyond(self, link: str, q: Array) -> str:
        """Describe the largest bending of a link and its position at coordinates (n,)."""
        length, own, shapes = self._beams[link]
        place = length * np.argmax(np.abs(shapes.T @ q[own])) / (_SECTIONS - 1)
        share = 100.0 * float(self._share(link, q))
        return f'link {link} bends by {share:.3g} % of its length, {place:.4g} m along it,'
