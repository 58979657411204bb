"""The loose four-bar of [SB] in flights and impacts, integrated in 80 bits.

Coupler and rocker by their moment equations about the crank pin and the rocker's bearing; the
pin's path in the bushing, and Newton's impact with friction, by hand. It starts with the pin in
the middle, and knows no contact that lasts: it ends before one does.
"""

from __future__ import annotations

from copy import copy
from functools import cache
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np

from test.routes.eighty_bits import newton_impulses

F = np.longdouble


class LooseFourBar(NamedTuple):
    """Lengths, distances of mass centres, masses and inertias about these, as [SB] Table 6.1."""

    ground: F = F('0.387')
    crank: F = F('0.064')
    coupler: F = F('0.309')
    rocker: F = F('0.312')
    coupler_cog: F = F('0.185')
    rocker_cog: F = F('0.134')
    coupler_mass: F = F('0.2439')
    rocker_mass: F = F('0.2334')
    coupler_inertia: F = F('0.00295')
    rocker_inertia: F = F('0.003176')
    speed: F = F('36.6519')
    gravity: F = F('9.8145')
    radial: F = F('0.000254')
    restitution: F = F('0.9')
    friction: F = F('0')
    pin_radius: F = F('0')

    def start(self) -> np.ndarray:
        """Angles and rates of coupler and rocker with the pin in the middle, crank at zero."""
        q = np.array([F('1.03174659'), F('2.12571182')])
        for _ in range(6):
            q = q - _solved(*self._arms(q), self._closing(F(0), q))
        v = -self.crank * self.speed * np.array([F(0), F(1)])
        return np.concatenate([q, _solved(*self._arms(q), v)])

    def _arms(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the pin's position in the bushing by both angles."""
        of_coupler = self.coupler * np.array([-np.sin(q[0]), np.cos(q[0])])
        return of_coupler, self.rocker * np.array([np.sin(q[1]), -np.cos(q[1])])

    def _closing(self, crank: F, q: np.ndarray) -> np.ndarray:
        """Pin from the middle of the bushing."""
        x = self.crank * np.cos(crank) + self.coupler * np.cos(q[0])
        y = self.crank * np.sin(crank) + self.coupler * np.sin(q[0])
        return np.array(
            [x - self.ground - self.rocker * np.cos(q[1]), y - self.rocker * np.sin(q[1])]
        )

    def _inertias(self) -> tuple[F, F]:
        return (
            self.coupler_inertia + self.coupler_mass * self.coupler_cog**2,
            self.rocker_inertia + self.rocker_mass * self.rocker_cog**2,
        )

    def blow(self, t: F, state: np.ndarray) -> tuple[np.ndarray, F, F]:
        """Rates after an impact, its normal and its tangential impulse."""
        q, w = state[:2], state[2:]
        Q = self._closing(self.speed * t, q)
        n = Q / np.sqrt(Q @ Q)
        along = np.array([-n[1], n[0]])
        arms = np.array(self._arms(q))
        pin = self.crank * self.speed * np.array([-np.sin(self.speed * t), np.cos(self.speed * t)])
        rows = np.array([-(arms @ n), arms @ along])
        rows[1] += [self.pin_radius, -(self.pin_radius + self.radial)]
        vn, vt = rows @ w + [-(pin @ n), pin @ along]
        response = rows / np.array(self._inertias())
        x = newton_impulses(response @ rows.T, [vn, vt], self.restitution, self.friction)
        return w + response.T @ x, x[0], x[1]

    def run(self, impacts: int, end: F) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Instants and normal impulses of the first impacts, and the state at a later time."""
        ta = copy(_integrator())
        ta.pars[:] = self[:-3]
        ta.state[:] = self.start()
        found = []
        while True:
            if ta.propagate_until(end)[0] == hy.taylor_outcome.time_limit:
                break
            assert len(found) < impacts, 'there are more impacts'
            rates, p, _ = self.blow(ta.time, np.array(ta.state))
            found.append((ta.time, p))
            ta.state[2:] = rates
        assert len(found) == impacts, f'there are {len(found)} impacts'
        return np.array([t for t, _ in found]), np.array([p for _, p in found]), np.array(ta.state)

    def slope(self, name: str, impacts: int, end: F, step: F) -> np.ndarray:
        """Derivatives of all that `run` gives by one number, by differences of sixth order."""
        value = getattr(self, name)
        total = F(0)
        for k, weight in enumerate((F(3) / 4, F(-3) / 20, F(1) / 60), start=1):
            ahead, back = (
                np.concatenate(self._replace(**{name: value * (1 + x * step)}).run(impacts, end))
                for x in (k, -k)
            )
            total = total + weight * (ahead - back)
        return total / (value * step)


@cache
def _integrator() -> Any:
    """Free flight until the pin touches, of the numbers that it depends on."""
    names = hy.make_vars('q3', 'q4', 'w3', 'w4')
    q3, q4, w3, w4 = names
    b = {name: hy.par[i] for i, name in enumerate(LooseFourBar._fields)}
    crank, lengths = b['speed'] * hy.time, (b['crank'], b['coupler'], b['rocker'])
    pull = b['coupler_mass'] * b['coupler_cog'], b['rocker_mass'] * b['rocker_cog']
    pushed = lengths[0] * b['speed'] ** 2.0 * hy.sin(crank - q3) - b['gravity'] * hy.cos(q3)
    a3 = pull[0] * pushed / (b['coupler_inertia'] + pull[0] * b['coupler_cog'])
    a4 = pull[1] * b['gravity'] * hy.cos(q4) / (b['rocker_inertia'] + pull[1] * b['rocker_cog'])
    of = list(zip(lengths, (crank, q3, q4), (1.0, 1.0, -1.0), strict=True))
    x = hy.sum([sign * length * hy.cos(angle) for length, angle, sign in of]) - b['ground']
    y = hy.sum([sign * length * hy.sin(angle) for length, angle, sign in of])
    gap = b['radial'] * b['radial'] - x * x - y * y
    event = hy.t_event(gap, direction=hy.event_direction.negative, fp_type=F)
    return hy.taylor_adaptive(
        list(zip(names, (w3, w4, a3, -a4), strict=True)),
        np.zeros(4, F),
        pars=np.zeros(len(b) - 3, F),
        t_events=[event],
        fp_type=F,
    )


def _solved(first: np.ndarray, second: np.ndarray, right: np.ndarray) -> np.ndarray:
    """x with ``first x0 + second x1 = right``."""
    det = first[0] * second[1] - first[1] * second[0]
    return np.array([
        (right[0] * second[1] - right[1] * second[0]) / det,
        (first[0] * right[1] - first[1] * right[0]) / det,
    ])  # fmt: skip
