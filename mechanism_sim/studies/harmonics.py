"""The vibration of a scene under its own excitation: rotating drives, loads over time.

Linear about the static equilibrium, as in `mechanism_sim.studies.response`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.enclosure import MotionSeries
from mechanism_sim.numerics.fourier import spectrum
from mechanism_sim.planar.steep_loads import SteepLoads
from mechanism_sim.results.quantities.motion import DERIVATIVES
from mechanism_sim.scene import Machine
from mechanism_sim.scene.plan import keeps_speed
from mechanism_sim.studies import frames
from mechanism_sim.studies.modes import (
    LinearMachine,
    derivatives,
    kept,
    linearised,
    steady_rates,
    turning,
)
from mechanism_sim.studies.response import (
    FrequencyResponse,
    HarmonicSource,
    differentiated,
    frame_units,
    units_of,
)
from mechanism_sim.vibration.periodic_forces import FourierSeries, SteadyVibration, known_harmonics

_TURNS = 1000  # largest number of turns of the first drive in a common period
_EXACT = 1e-12  # tolerance of a ratio of speeds as a fraction
_STEPS = 128  # steps per turn of the fastest drive for closing loops
_PLAIN = 32  # parts of a turn, in each of which forces are looked at 16 times
_SAMPLES = np.linspace(0.0, 1.0, 5)  # sampled positions in a part with an enclosed formula
_BEYOND = 1.1  # assumed range of coordinates in a part, over that of samples
_HALVINGS, _MOST = 40, 1 << 15
_BISECTIONS = 50  # number of bisections that locate an edge to rounding


@dataclass(frozen=True)
class Harmonics:
    """The steady vibration under periodic excitation: a rotating drive, loads over time."""

    period: float  #: [s]
    #: series by quantity, the mean counted from the equilibrium at rest
    series: dict[str, FourierSeries]
    units: dict[str, str]  #: units of the quantities


def harmonics(
    machine: Machine, quantities: Sequence[str], count: int, period: float | None = None
) -> Harmonics:
    """The steady vibration under the machine's own excitation, as a Fourier series.

    The excitation is what the equations leave open if the drives turn at the speed they start
    with, loads act at their times, and the independent coordinates stay at their equilibrium.
    Mass, damping and stiffness are those of the equilibrium, with gyroscopic terms and those of
    shafts at these speeds: exact where they do not change over the turn, as with rotors out of
    balance and slider-cranks on frames.

    Parameters
    ----------
    quantities : ``position.COORDINATE``, ``velocity.`` or ``acceleration.`` of coordinates that
        are not driven, of which this is the vibration alone; positions of all if empty
    count : number of harmonics
    period : [s]; a turn of the first drive that turns if not given
    """
    if count < 1:
        raise InputError(f'--harmonics {count}: expected 1 or more')
    for c in machine.plan.prescribed:
        if not keeps_speed(machine.plan, c):
            raise InputError(
                f'{machine.name}: {c} does not turn at a steady speed, so that nothing repeats '
                "itself: give its drive a 'speed'"
            )
    rates = np.array([machine.plan.held[c][1] for c in machine.plan.prescribed])
    known = frames.coordinates_of(machine)
    asked = [x for x in quantities if x.partition('.')[2] in known]
    if not quantities and not machine.torque_driven:
        asked = [f'position.{c}' for c in known]
    own = [x for x in quantities if x not in asked]
    found: dict[str, FourierSeries] = {}
    units: dict[str, str] = {}
    length = _period(machine, rates, period)
    if asked:
        found, units = _frame_harmonics(machine, asked, count, length)
    if asked and not own:
        return Harmonics(length, found, units)
    if not (machine.torque_driven or machine.has_contacts or machine.assembly.freedom):
        main, seen = machine.plan.main, (*own, 'acceleration.LINK')[0]
        raise InputError(
            f'{machine.name}: its drives prescribe the whole motion, so that nothing vibrates: '
            f"harmonics of it are measures, as cycle --measure '2*mean({seen}*cos(2*position."
            f"{main}))'"
        )
    one = linearised(machine, known=derivatives(machine, rigid=True))
    units |= _own_units(one, own)
    steady = _harmonics(one, machine.plan.prescribed, rates, length, count)
    for name in (x for x in units if x not in found):
        kind, _, rest = name.partition('.')
        k = one.derivatives.coordinates.index(rest)
        found[name] = steady.series(k, DERIVATIVES[kind])
    return Harmonics(length, found, units)


def _frame_harmonics(
    machine: Machine, quantities: Sequence[str], count: int, period: float
) -> tuple[dict[str, FourierSeries], dict[str, str]]:
    """Harmonics of frames on springs, and their units."""
    known = frames.coordinates_of(machine)
    units = frame_units(machine, quantities, known)
    places = {quantity: known[quantity.partition('.')[2]] for quantity in units}
    names = list(dict.fromkeys(name for name, _ in places.values()))
    series, found = frames.harmonics_of(machine, names, count, period), {}
    for quantity, (name, k) in places.items():
        found[quantity] = series[name].series(k, DERIVATIVES[quantity.partition('.')[0]])
    return found, units


def unbalance_response(
    machine: Machine, quantities: Sequence[str], speeds: Array
) -> FrequencyResponse:
    """The vibration at the frequency of rotation over steady speeds (N,) [rad/s] of the drive.

    Phases are those before cos(w t), where the drive is at its start at t = 0.

    Parameters
    ----------
    quantities : see `harmonics`
    speeds : all positive, or all negative for a drive that turns clockwise
    """
    main = turning(machine, '--speeds')
    one = linearised(machine, known=derivatives(machine, held=kept(machine), rigid=True))
    units = _own_units(one, quantities)
    driven = [*machine.plan.prescribed, *kept(machine)]
    w, senses = np.abs(np.asarray(speeds, float)), set(np.sign(speeds).tolist())
    if senses not in ({1.0}, {-1.0}):
        raise InputError(
            '--speeds: without rotation there is no vibration: begin above 0, or end below it for '
            'a drive that turns clockwise'
        )
    z = np.array([
        _harmonics(
            one, driven, np.array([x if c == main else 0.0 for c in driven]), 2.0 * np.pi / abs(x),
            1, 1,
        ).amplitudes[0]
        for x in speeds
    ])  # fmt: skip
    found = {}
    for name in units:
        kind, _, rest = name.partition('.')
        found[name] = differentiated(z[:, one.derivatives.coordinates.index(rest)], w, kind)
    sense = 'counterclockwise' if senses == {1.0} else 'clockwise'
    source = HarmonicSource(f'{sense} rotation of {main}', '')
    return FrequencyResponse(source, w / (2.0 * np.pi), found, units)


def _own_units(one: LinearMachine, quantities: Sequence[str]) -> dict[str, str]:
    """Units of quantities of coordinates; of the positions of the independent ones if empty."""
    units = units_of(one, quantities)
    for name in units:
        if name.partition('.')[0] not in DERIVATIVES:
            raise InputError(
                f"{one.machine.name}: '{name}': harmonics are available for coordinates only"
            )
    return units


def _harmonics(
    one: LinearMachine,
    drives: Sequence[str],
    rates: Array,
    length: float,
    count: int,
    more: int | None = None,
) -> SteadyVibration:
    """The vibration of all coordinates (n,) with a period [s].

    Parameters
    ----------
    rates : rates of the driven coordinates, in the order of `drives`
    more : harmonics of the forces, to tell what is left out; as many as that takes if not given
    """
    driven = [one.derivatives.coordinates.index(c) for c in drives]
    excitation = _Excitation(one, driven, rates, length)
    excitation.check_period()
    # what is rounding of the forces that balance at rest would look like a response
    rounding = 1e-13 * excitation.scale
    more = more or known_harmonics(count)
    found = spectrum(excitation, excitation.edges(more), more, np.full(len(one.B.T), rounding))
    found = found.without(rounding)
    quiet = found._replace(rest=np.where(found.rest > rounding, found.rest, 0.0))
    return _at_speed(one, driven, rates).system.under(quiet, length, count, one.B, rounding)


def _at_speed(one: LinearMachine, driven: list[int], rates: Array) -> LinearMachine:
    """Copy with its drives turning, if all that they carry can turn along with them."""
    main = one.derivatives.coordinates.index(one.machine.plan.main)
    if main not in driven:
        return one
    v = steady_rates(one.machine, float(rates[driven.index(main)]))
    v[driven] = rates
    linear = one.derivatives(one.at._replace(v=v))
    apart = np.abs(linear.J @ v).max(initial=0.0)
    carried = apart <= 1e-9 * np.abs(v).max(initial=0.0) * one.derivatives.scale.max()
    return replace(one, linear=linear) if carried else one


def _period(machine: Machine, rates: Array, period: float | None) -> float:
    """The period of the excitation [s]: as given, or a turn of the first drive that turns."""
    if period is not None:
        if not (period > 0.0 and math.isfinite(period)):
            raise InputError(f'--period {period:g} s: must be positive and finite')
        return period
    straight = machine.plan.ideal.displacements
    turning = {
        c: abs(float(rate))
        for c, rate in zip(machine.plan.prescribed, rates, strict=True)
        if rate and c not in straight
    }
    if not turning:
        raise InputError(
            f'{machine.name}: no drive turns at a speed: give the period of the excitation by '
            "--period, as '0.1 s'"
        )
    first, *others = turning
    found = 2.0 * math.pi / turning[first]
    turns = {c: turning[c] / turning[first] for c in others}
    parts = {c: Fraction(x).limit_denominator(_TURNS) for c, x in turns.items()}
    uneven = [c for c in others if parts[c].denominator > 1]
    if not uneven:
        return found
    c = uneven[0]
    common = math.lcm(*(x.denominator for x in parts.values()))
    exact = all(abs(turns[x] - parts[x]) <= _EXACT * turns[x] for x in others)
    raise InputError(
        f'{machine.name}: in a turn of {first}, {found:.9g} s, {c} makes {turns[c]:.9g} turns, '
        'so that this is not a period of both: '
        + (
            f"give --period '{common * found!r} s', in which all drives make whole turns"
            if exact
            else f'their speeds have no common period of up to {_TURNS} turns of {first}'
        )
    )


class _Excitation:
    """Forces (f, N) on the independent coordinates at times (N,) [s], beyond those at rest.

    They are what the equations leave open while the drives turn at their `rates`, the independent
    coordinates stay at the equilibrium, and the others follow them.

    Parameters
    ----------
    driven : indices of the coordinates that turn at `rates`
    length : length of the period [s]
    """

    def __init__(self, one: LinearMachine, driven: list[int], rates: Array, length: float) -> None:
        self._one, self._driven, self._rates, self._length = one, driven, rates, length
        names, held = one.derivatives.coordinates, [*driven, *one.independent]
        self._kinematics = one.machine.plan.kinematics([names[i] for i in held])
        self._held = np.concatenate([rates, np.zeros(len(one.independent))])
        self._others = [i for i in one.derivatives.free if i not in one.independent]
        pace = np.abs(rates).max(initial=0.0)
        self._turns = max(1.0, float(pace) * length / (2.0 * np.pi))
        self._mesh = self._followed() if self._others else None
        self.scale = float(
            np.abs(self(length * frames.LOOKS)).max()
            + np.abs(one.linear.K @ np.diag(one.at.q)).max(initial=0.0)
        )

    def _followed(self) -> Array:
        """Coordinates (n, m + 1) over the period, in steps that keep loops on their branch."""
        count = math.ceil(_STEPS * self._turns)
        found, q = [], self._one.at.q.copy()
        for time in self._length * np.arange(count + 1) / count:
            q = q.copy()
            q[self._driven] = self._one.at.q[self._driven] + self._rates * time
            moved, left = self._kinematics.positions(q[:, None])
            if left.any():
                raise InputError(
                    f'{self._one.machine.name}: the loops do not close over the turn of the drive '
                    'with the free coordinates at their equilibrium'
                )
            q = moved[:, 0]
            found.append(q)
        return np.array(found).T

    def _motion(self, t: Array) -> tuple[Array, Array, Array]:
        """Coordinates, rates and accelerations (n, N) at times, a period later as at its start."""
        q = np.repeat(self._one.at.q[:, None], len(t), axis=1)
        if self._mesh is not None:
            period, into = np.divmod(t, self._length)
            count = self._mesh.shape[1] - 1
            place = into * (count / self._length)
            k = np.minimum(place.astype(int), count - 1)
            q = self._mesh[:, k] + (self._mesh[:, k + 1] - self._mesh[:, k]) * (place - k)
            q += (self._mesh[:, -1:] - self._mesh[:, :1]) * period
        q[self._driven] = self._one.at.q[self._driven, None] + np.outer(self._rates, t)
        if self._mesh is not None:
            q, _ = self._kinematics.positions(q)
        speeds = np.repeat(self._held[:, None], len(t), axis=1)
        v = self._kinematics.rates(q, speeds)
        return q, v, self._kinematics.accelerations(q, v, np.zeros_like(speeds))

    def __call__(self, t: Array) -> Array:
        one, (q, v, a) = self._one, self._motion(t)
        F, J = one.derivatives.along(one.at, q, v, a, t)
        found = -F[one.independent]
        if self._others:
            follow = np.linalg.pinv(J[:, :, self._others]) @ J[:, :, one.independent]
            found = found + np.einsum('kij,ik->jk', follow, F[self._others])
        return np.asarray(found)

    def check_period(self) -> None:
        """Refuse a period after which the forces are not what they were, at several instants."""
        machine, t = self._one.machine, self._length * frames.LOOKS
        if np.abs(self(t + self._length) - self(t)).max() > 1e-9 * self.scale:
            raise InputError(
                f'{machine.name}: after {self._length:.6g} s the forces on the free coordinates '
                'are not what they were: the period is another, or a spring couples links to the '
                'drive that turn with it; take --torque or --base with --frequencies'
            )

    def edges(self, count: int) -> Array:
        """Instants between which the forces are smooth: where a part of them begins or ends.

        These are located to rounding. Formulas have none; they are enclosed, so that no pulse of
        one hides between the nodes.
        """
        parts = max(_PLAIN, math.ceil(_PLAIN * self._turns), 2 * count)
        edges = self._enclosed(self._length * np.arange(parts + 1) / parts)
        if not self._switches(edges[:1]).size:
            return edges
        found, low, high = [edges], edges[:-1], edges[1:]
        below, above = self._switches(low), self._switches(high)
        for _ in range(_BISECTIONS):
            apart = (below != above).any(axis=0)
            low, high, below, above = low[apart], high[apart], below[:, apart], above[:, apart]
            if not len(low):
                return np.unique(np.concatenate(found))
            middle = 0.5 * (low + high)
            at = self._switches(middle)
            low, high = np.append(low, middle), np.append(middle, high)
            below, above = np.append(below, at, axis=1), np.append(at, above, axis=1)
        apart = (below != above).any(axis=0)
        return np.unique(np.concatenate([*found, high[apart]]))

    def _enclosed(self, edges: Array) -> Array:
        """Ends of parts of the period, halved until samples tell what formulas do in each.

        In the middle and at the ends of a part formulas are sampled, and their enclosure over it
        says how far beyond these they may go: `mechanism_sim.numerics.enclosure`.
        """
        steep = self._one.derivatives.steep
        if steep is None or not steep.enclosure.count:
            return edges
        # a change of a load that adds up to less is rounding of its coefficients
        least = 1e-13 * self.scale * self._length
        scales = np.full(len(steep.inertia) + steep.enclosure.guards, least)
        found, begin, width = [edges], edges[:-1], np.diff(edges)
        for _ in range(_HALVINGS):
            hidden = self._hidden(steep, scales, begin, width)
            if not hidden.any() or sum(map(len, found)) > _MOST:
                break
            begin, width = begin[hidden], 0.5 * width[hidden]
            found.append(begin + width)
            begin, width = np.append(begin, begin + width), np.tile(width, 2)
        return np.unique(np.concatenate(found))

    def _hidden(
        self, steep: SteepLoads, scales: Array, begin: Array, width: Array
    ) -> NDArray[np.bool_]:
        """True if a formula may go beyond its samples in parts (N,) of the period."""
        t = begin[:, None] + width[:, None] * _SAMPLES
        q, v, _ = self._motion(t.ravel())
        rows = [(q, v)[d][i].reshape(t.shape) for d, i in steep.moving]
        moving = np.array([*rows, *([t] if steep.timed else [])])
        low, high = moving.min(axis=2), moving.max(axis=2)
        # what bends between five samples of a part goes hardly beyond them
        middle, radius = 0.5 * (low + high), 0.5 * _BEYOND * (high - low)
        symbols = self._switches(t[:, 2])
        kinds, kind = np.unique(symbols, axis=1, return_inverse=True)
        hidden = np.zeros(len(begin), bool)
        for n in range(kinds.shape[1]):
            own = np.flatnonzero(kind.ravel() == n)
            fixed = np.append(np.zeros(len(steep.outside)), steep.switched(kinds[:, n]))
            parameters = np.asarray(steep.parameters, float)
            motion = MotionSeries(np.zeros((len(moving), 1)), 1.0, fixed, parameters)
            parts = steep.enclosure(motion, scales, middle[:, own], radius[:, own])
            places = moving[:, own].reshape(len(moving), -1)
            seen = steep.enclosure(motion, scales, places, np.zeros_like(places)).middle
            seen = seen.reshape(len(seen), len(own), -1)
            with np.errstate(all='ignore'):  # what is not finite is not known
                over = np.maximum(
                    parts.middle + parts.radius - seen.max(axis=2),
                    seen.min(axis=2) - (parts.middle - parts.radius),
                )
                known = over <= 0.05 * np.ptp(seen, axis=2) + 0.01 * np.abs(seen).max(axis=2)
                known |= over * parts.weight * width[own] <= 1.0
            hidden[own] = ~known.all(axis=0)
        return hidden

    def _switches(self, t: Array) -> Array:
        """Values (k, N) of what switches parts of the forces on and off."""
        return self._one.derivatives.switches_along(self._one.at, *self._motion(t), t)
