"""Oil films that become so thin that steps are too short for a run to finish.

A film of thickness h damps its journal by ``D`` in proportion to ``h^(-5/2)``. Explicit steps
last some ``9 m/D``, with the mass m that the journal moves. Where a machine stands still, its load
W squeezes the film out by ``D dh/dt = -W``, so that ``x = h^(-3/2)`` grows evenly: without end,
and with it the number of steps,

    N = integral of dt/step,  step ~ x^(-5/3):  N = 3/8 x/(x' step) ((x_end/x)^(8/3) - 1)
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.clock import horner
from mechanism_sim.engine.drive_laws import DriveLaws
from mechanism_sim.engine.present_state import PresentState
from mechanism_sim.errors import RunError
from mechanism_sim.planar.protocols import ForceElement, OilFilm
from mechanism_sim.planar.reactions import energies
from mechanism_sim.tolerances import TOLERANCES

_FILMS = TOLERANCES.films


class _Seen(NamedTuple):
    """Thickness of all films at a time."""

    steps: int
    t: float  #: time [s]
    h: Array  #: thicknesses [m]


def steps_of_squeeze(h: float, growth: float, step: float, left: float, wall: float) -> float:
    """Number of steps in which a steady load squeezes a film out.

    Parameters
    ----------
    h : [m] thickness now
    growth : [1/(m^(3/2) s)] rate of ``h^(-3/2)``
    step : [s] present length of a step
    left : [s] remaining time
    wall : [m] thickness at which walls touch; 0 without
    """
    x = h**-1.5
    ends = min(x + growth * left, wall**-1.5 if wall else math.inf)
    many: float = 0.375 * x / (growth * step) * max(0.0, (ends / x) ** (8.0 / 3.0) - 1.0)
    return many


def _growth(before: float, after: float, during: float) -> float:
    """Rate of ``h^(-3/2)`` [1/(m^(3/2) s)]."""
    rate: float = (after**-1.5 - before**-1.5) / during
    return rate


def film_gone(elements: Iterable[ForceElement], q: Array, t: float) -> RunError | None:
    """The error of an integration that broke down at a time [s] as a film has no thickness left.

    Parameters
    ----------
    q : all coordinates (n, 1)
    """
    for film in elements:
        if isinstance(film, OilFilm) and not (h := film.thickness(q)) > _FILMS.molecules:
            return RunError(
                f'at t = {t:.9g} s the oil film of {film.name} is {1e6 * h:.3g} um thick, and no '
                'force of oil is known there: start nearer to the middle, or give '
                'contact.roughness, at which its walls touch'
            )
    return None


class FilmWatch:
    """Prediction of the remaining steps, and of a film that makes them short.

    Parameters
    ----------
    present, laws : state and laws of the same run
    """

    def __init__(self, present: PresentState, laws: DriveLaws) -> None:
        self._present, self._laws = present, laws
        self._system = system = present.system
        self._films = [e for e in system.elements if isinstance(e, OilFilm)]
        self._seen: list[_Seen] = []  # the last three
        self._said = False

    def look(self, steps: int, end: float, final: bool) -> str:
        """Describe a film that makes the rest of a run too long, once a run; else empty.

        Parameters
        ----------
        steps : since the start
        end : [s] of the run, as far as that is known
        final : True if it ends there, under the laws that are known now

        Raises
        ------
        RunError
            If the machine stands still, and its film is squeezed out in more steps than anyone
            waits for.
        """
        if self._seen and 0 <= steps - self._seen[-1].steps < _FILMS.look:
            return ''
        place, t = self._place(), self._present.time
        now = _Seen(steps, t, np.array([film.thickness(place) for film in self._films]))
        if self._seen and steps < self._seen[-1].steps:  # a run that began anew
            self._seen = []
        seen = self._seen = [*self._seen[-2:], now]
        if len(seen) < 3 or not t > seen[1].t > seen[0].t:
            return ''
        step = (t - seen[1].t) / (steps - seen[1].steps)
        coming = self._steps_of_squeeze(step, end) if self._rests(end) else {}
        most = max(coming.values(), default=(end - t) / step)
        if most < _FILMS.many or (self._said and most < _FILMS.endless):
            return ''
        left = end - t
        rate, k = self._ruling() if self._films else (0.0, None)
        if k is None or rate * step < _FILMS.rules:
            if self._said:
                return ''
            self._said = True
            return (
                f'at t = {t:.6g} s steps last {step:.2g} s: the {left:.4g} s left take some '
                f'{most:.0e} of them'
            )
        film, h = self._films[k], float(now.h[k])
        most = coming.get(k, left / step)
        about = f'the oil film of {film.name} is {1e6 * h:.3g} um thick at t = {t:.6g} s'
        if final and k in coming and most > _FILMS.endless:
            raise RunError(
                f'{about}, and the machine stands still: a load squeezes the film out in steps '
                f'that get ever shorter, {step:.2g} s now, of which the {left:.4g} s left '
                f'would take some {most:.0e}; {_advice(film, h)}'
            )
        if self._said:
            return ''
        self._said = True
        return (
            f'{about}, and damps so fast that steps last {step:.2g} s: the {left:.4g} s left take '
            f'some {most:.0e} of them; {_advice(film, h)}'
        )

    def _place(self) -> Array:
        """All coordinates now (n, 1)."""
        present, system = self._present, self._system
        q = dict(zip(system.free, present.state, strict=False))
        tau = present.integrator.time
        laws = zip(system.prescribed, present.base.laws, strict=False)
        q |= {c: horner(law, tau) for c, law in laws}
        return np.array([[q[c]] for c in system.coordinates])

    def _now(self) -> Array:
        """Argument of functions of the system: state, parameters and time."""
        present = self._present
        return np.array([*present.state, *present.pars, present.integrator.time])

    def _rests(self, end: float) -> bool:
        """True if until `end` all drives rest and no load depends on time or on a state."""
        present, system = self._present, self._system
        held = not any(any(law[1:]) for law in present.base.laws)
        lasts = self._laws.next_change >= present.base.local(end)
        return held and lasts and not system.states and 'time' not in system.outside

    def _steps_of_squeeze(self, step: float, end: float) -> dict[int, float]:
        """Steps still to come, of the films that are squeezed out while all else rests.

        Accelerations count, too: a link that swings stands still where it turns back.
        """
        (_, t0, h0), (_, t1, h1), (_, t2, h2) = self._seen
        present, f = self._present, len(self._system.free)
        a = self._system.functions.accelerations(self._now())[:f]
        sizes = np.where(self._system.angular, self._system.mechanism.size, 1.0)
        fastest = float((sizes * (np.abs(present.v) + (t2 - t0) * np.abs(a))).max(initial=0.0))
        found = {}
        for k, film in enumerate(self._films):
            if not min(h0[k], h1[k], h2[k]) > 0.0:
                continue
            before, growth = _growth(h0[k], h1[k], t1 - t0), _growth(h1[k], h2[k], t2 - t1)
            even = abs(growth - before) < _FILMS.even * growth
            if even and fastest < _FILMS.standstill * (h1[k] - h2[k]) / (t2 - t1):
                found[k] = steps_of_squeeze(h2[k], growth, step, end - t2, film.roughness)
            elif fastest * (end - t2) < h2[k]:  # thinner than it would ever become by itself
                found[k] = (end - t2) / step
        return found

    def _ruling(self) -> tuple[float, int | None]:
        """Fastest rate [1/s] at which speeds decay now, and the film that makes it, if one does.

        Along the speeds u of that decay a force element takes ``u D u`` of the ``rate u M u``
        that all of them take. Powers are differences to both sides: a ruptured film pushes one
        way only.
        """
        system, small = self._system, _FILMS.nudge
        f = len(system.free)
        now = self._now()

        def both(speeds: Array, function: hy.cfunc_dbl) -> tuple[Array, Array, Array]:
            nudges = np.zeros((len(now), 2 * speeds.shape[1] + 1))
            nudges[f : 2 * f, 1:] = small * np.hstack([speeds, -speeds])
            values = function(np.ascontiguousarray(now[:, None] + nudges))
            middle = values.shape[1] // 2 + 1
            return values[:, :1], values[:, 1:middle], values[:, middle:]

        _, ahead, back = both(np.eye(f), system.functions.accelerations)
        matrix = (ahead[:f] - back[:f]) / (2.0 * small)
        if not np.isfinite(matrix).all():
            return 0.0, None
        values, vectors = np.linalg.eig(matrix)
        k = int(np.argmin(values.real))
        speeds = vectors[:, k].real[:, None]
        middle, ahead, back = both(speeds, self._powers)
        curved = (ahead + back - 2.0 * middle)[:, 0] / small**2
        rate, inertia, taken = -float(values.real[k]), curved[0], 0.5 * curved[1:]
        most = int(np.argmax(taken))
        if not taken[most] > _FILMS.share * rate * inertia:
            return rate, None
        element = system.elements[most]
        return rate, self._films.index(element) if isinstance(element, OilFilm) else None

    @cached_property
    def _powers(self) -> hy.cfunc_dbl:
        """Kinetic energy, then the powers that force elements take."""
        equations, run = self._system.equations, self._system.run
        elements: Sequence[hy.expression] = [
            element.power_lost(equations.frames) for element in self._system.elements
        ]
        return run.compile_now(run.acted([energies(equations)[0], *elements]))


def _advice(film: OilFilm, h: float) -> str:
    """Advice on longer steps, for a film that is h [m] thick."""
    if h > _FILMS.centred * film.clearance:
        return 'its damping goes with viscosity and (width/radial)^3'
    above = f' above {1e6 * film.roughness:g} um' if film.roughness else ''
    return (
        f'give contact.roughness{above}, at which its walls touch (with {1e6 * h:.3g} um they '
        'would by now), or a shorter duration'
    )
