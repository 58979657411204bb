"""Derivatives of a run by numbers of its scene: of quantities, impacts and measures.

Of a machine whose equations are integrated, the derivatives of its motion are exact (room
`derivatives`). A quantity, or a measure, is a function of motion and machine: it is taken along
the derivatives of both by differences of sixth order, at steps so small beside clearances and
speeds that what is left is near 1e-11. The ideal motion of a kinematic machine has no memory:
there the machines with other values are run themselves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.polynomial import polynomial

from mechanism_sim.arrays import Array
from mechanism_sim.derivatives.flow import DerivativeLimit, Flow, Flows
from mechanism_sim.derivatives.influences import NUMBERS, influences
from mechanism_sim.derivatives.numeric_keys import WEIGHTS, NumericKey, numeric_keys
from mechanism_sim.engine.audit import work_in
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.energy_terms import EnergyTerms
from mechanism_sim.engine.snapshot import Snapshot
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.polynomials import PiecewisePolynomial, shift_powers
from mechanism_sim.numerics.quadrature import parts_of
from mechanism_sim.planar.protocols import OilFilm
from mechanism_sim.results.measures import Measurement
from mechanism_sim.results.quantities.motion import DERIVATIVES
from mechanism_sim.results.quantity import Shown
from mechanism_sim.results.run import IMPACT_UNITS, Piece, Runner, seconds_of
from mechanism_sim.scene import Machine
from mechanism_sim.tables import Table

_SMALL = 2e-3  # displacement of a motion for differences, as share of clearances and speeds

_DEPTH = 0.05  # approximate depth of compliant contacts as a share of a clearance

_NEAR = 5e-3
"""Largest opening of gaps, as share of a clearance, where a machine is changed under its motion.
Forces there change as if a pin had left its bushing, thousands of times as much as in a run: the
errors of differences of sixth order and of rounding are then of equal size."""

_LOOKED = 64  # instants at which gaps are looked at

_AROUND = tuple(
    (sign * k, sign * weight)
    for k, weight in ((1.0, 0.75), (2.0, -0.15), (3.0, 1.0 / 60.0))
    for sign in (1.0, -1.0)
)
"""Nodes and weights of differences of sixth order."""


_Taken = Callable[[Piece], Array]


class RunDerivative:
    """Derivatives of a run by one number of its scene, in SI units.

    Attributes
    ----------
    path, value : path and value of the number
    limits : instants across which derivatives do not exist, or have another meaning
    """

    def __init__(self, key: NumericKey, piece: Piece, limits: Sequence[DerivativeLimit]) -> None:
        self.path, self.value, self.limits = key.path, key.value, tuple(limits)
        self._key, self._piece = key, piece

    def __repr__(self) -> str:
        ends = f', up to {end.t:.6g} s' if (end := self.end) else ''
        return f'<Derivatives by {self.path} = {self.value:g}{ends}>'

    @property
    def end(self) -> DerivativeLimit | None:
        """The limit beyond which there are no derivatives, if there is one."""
        return next((limit for limit in self.limits if limit.ends), None)

    @property
    def final(self) -> dict[str, dict[str, float]]:
        """``position`` and ``velocity`` by coordinate at the end of the run, at fixed time."""
        end = self._piece.motion.curve.end
        names = self._piece.physics.coordinates
        columns = [f'{kind}.{c}' for c in names for kind in ('position', 'velocity')]
        found = self.sample(end, *columns)
        return {
            c: {kind: float(found[f'{kind}.{c}'][0]) for kind in ('position', 'velocity')}
            for c in names
        }

    def sample(self, t: Array | float, *names: str) -> Table:
        """Derivatives of quantities at fixed times `t` [s], by the names of `Piece.sample`.

        NaN beyond a limit that ends them.
        """
        known = self._piece.catalogue
        chosen = known.choose(names) if names else known.shown(Shown.RUN)
        chosen = [n for n in chosen if n != 't']
        times = seconds_of(t)

        def taken(piece: Piece) -> Array:
            found = known.table(chosen, piece.view(times))
            return np.array([found[n] for n in chosen], dtype=float)

        units = {n: known[n].unit for n in chosen}
        # sums over the motion so far count its events as they move
        summed = any(known[n].cumulative for n in chosen)
        slopes = self._slopes(taken, times)
        for k, n in enumerate(chosen):
            kind, _, of = n.partition('.')
            if kind in DERIVATIVES and of in self._piece.physics.coordinates:
                slopes[k] = self._motion(of, DERIVATIVES[kind], times, slopes[k])
        if summed:
            of_sums, own = self._of_whole(taken), [known[n].cumulative for n in chosen]
            slopes[own] = of_sums[own]
        return Table({'t': times, **dict(zip(chosen, slopes, strict=True))}, units)

    @property
    def impacts(self) -> Table:
        """Derivatives of the fields of every impact, each as its instant moves."""
        raise NotImplementedError

    def measures(
        self, *texts: str, window: tuple[float, float] = (0.0, math.inf)
    ) -> dict[str, float]:
        """Derivatives of measures by name; those of the scene without any texts.

        Parameters
        ----------
        window : default window [s] of figures
        """
        machine = self._piece.machine
        asked = list(texts) or dict(machine.scene.measures)
        names: list[str] = []

        def taken(piece: Piece) -> Array:
            measurement = Measurement(piece.machine, asked, *window)
            measurement.add(piece)
            found = measurement.found(silent=True)
            names[:] = [m.name for m in found]
            return np.array([m.value for m in found])

        slopes = self._of_whole(taken)
        return dict(zip(names, slopes.tolist(), strict=True))

    def of(self, taken: _Taken, seen: _Taken | None = None) -> Array:
        """Derivatives of numbers that depend on the whole motion, to some 1e-6 of them.

        For works and other sums over the motion use `sample` and `measures`.

        Parameters
        ----------
        taken : function that returns the numbers of a run
        seen : cheaper function, equal for two machines only if `taken` is, too
        """
        raise NotImplementedError

    def _slopes(self, taken: _Taken, t: Array) -> Array:
        """Derivatives of `taken` at times (N,): (..., N)."""
        raise NotImplementedError

    def _of_whole(self, taken: _Taken) -> Array:
        """Derivatives of what is taken of the whole motion."""
        raise NotImplementedError

    def _motion(self, coordinate: str, order: int, t: Array, found: Array) -> Array:
        """Derivatives (N,) of a coordinate or its rate, where more accurate than `found`."""
        return found


class _Integrated(RunDerivative):
    """Derivatives along a motion whose equations were integrated."""

    def __init__(
        self, key: NumericKey, piece: Piece, flow: Flow, torques: Array, column: int
    ) -> None:
        begun = [flow.begun[column]] if column in flow.begun else []
        super().__init__(key, piece, [*begun, *flow.limits])
        self._torques = torques[..., column]
        self._coefficients = flow.coefficients[..., column]
        self._states, self._shift = flow.states[..., column], flow.shift[:, column]
        self._approach, self._logged = flow.approach[..., column], flow.impacts[..., column]

    def _motion(self, coordinate: str, order: int, t: Array, found: Array) -> Array:
        """Straight from the variational equations."""
        curve, i = self._piece.motion.curve, self._piece.physics.coordinates.index(coordinate)
        k, since = curve.find(t)
        slopes = polynomial.polyder(self._coefficients[k, i].T, order, axis=0)
        return np.asarray(polynomial.polyval(since, slopes, tensor=False))

    @property
    def impacts(self) -> Table:
        """Derivatives of the fields of every impact, each as its instant moves."""
        columns = dict(zip(NUMBERS, self._logged.T, strict=True))
        return Table({'joint': self._piece.impacts.names} | columns, IMPACT_UNITS)

    @cached_property
    def _growth(self) -> Array:
        """Magnitude (m,) of the derivatives of every segment beside clearances and speeds."""
        piece, curve = self._piece, self._piece.motion.curve
        machine, mechanism = piece.machine, piece.machine.mechanism
        size, speed = mechanism.size, np.abs(curve.coefficients[:, :, 1]).max()
        plays = [c.radial for c in machine.plan.clearances.values() if c.radial]
        straight = np.array([c in mechanism.displacements for c in piece.physics.coordinates])
        soft = machine.equations.system.compliant
        least = min([*plays, size]) * (_DEPTH if soft else 1.0)
        powers = curve.duration[:, None, None] ** np.arange(self._coefficients.shape[2])
        moved = np.abs(self._coefficients * powers).max(axis=2)
        faster = np.abs(self._coefficients[:, :, 1])
        far = (moved * np.where(straight, 1.0, size)).max(axis=1) / least
        fast = faster.max(axis=1) / max(speed, 1e-300)
        return np.asarray(np.maximum(np.maximum(far, fast), 1e-300))

    @cached_property
    def _beside(self) -> tuple[float, Sequence[tuple[float, Machine]]]:
        """Step of the number, weights of the machines beside, and these machines."""
        opened, key = self._opened, self._key
        if opened <= _NEAR:
            return key.step, [*zip(WEIGHTS, key.beside, strict=True)]
        step = key.step / 3.0 * min(1.0, 3.0 * _NEAR / opened)  # no farther than `beside`
        return step, [(weight, key.at(key.value + k * step)) for k, weight in _AROUND]

    @property
    def _opened(self) -> float:
        """Share of its clearance by which a gap opens if the number changes by its step.

        For an oil film, the relative growth of its thickness.
        """
        piece, curve, beside = self._piece, self._piece.motion.curve, self._key.beside[0]
        system, clearances = piece.machine.equations.system, piece.machine.plan.clearances
        every = np.linspace(0.0, len(curve) - 1.0, min(len(curve), _LOOKED)).astype(int)
        middle = 0.5 * curve.duration[every]
        known, opened = piece.catalogue, [0.0]
        played = {f'gap.{g.name}': clearances[g.joint].radial for g in system.gaps
                  if g.joint in clearances}  # fmt: skip
        if names := [n for n, radial in played.items() if radial and n in known]:
            t = curve.start[every] + middle
            some, other = (
                known.table(names, x.view(t)) for x in (piece, _with_machine(piece, beside))
            )
            opened += [float(np.nanmax(np.abs(other[n] - some[n])) / played[n]) for n in names]
        places = curve.local(every, middle)[:, :, None]
        elements = zip(system.elements, beside.equations.system.elements, strict=True)
        for film, changed in elements:
            if isinstance(film, OilFilm) and isinstance(changed, OilFilm):
                h = [(film.thickness(q), changed.thickness(q)) for q in places]
                opened += [abs(b - a) / a for a, b in h if a > 0.0]
        return max(opened)

    @property
    def _step(self) -> float:
        """Step of displacements of the whole motion with its events."""
        step = _SMALL / float(self._growth.max())
        shortest = np.diff(self._shift) / self._piece.motion.curve.duration[:-1]
        return min(step, 0.1 / max(float(np.abs(shortest).max(initial=0.0)), 1e-300))

    def _partial(self, taken: _Taken) -> Array:
        """Partial derivatives by the machine alone, at an unchanged motion."""
        piece, found = self._piece, np.zeros(())
        base, (step, beside) = taken(piece), self._beside
        for weight, machine in beside:
            found = found + weight * (taken(_with_machine(piece, machine)) - base)
        return np.asarray(found / step)

    def _slopes(self, taken: _Taken, t: Array) -> Array:
        """Derivatives of `taken` at times (N,), each on its own segment."""
        segments, _ = self._piece.motion.curve.find(t)
        step = _SMALL / self._growth
        base, found = taken(self._piece), np.zeros(())
        for offset, weight in _AROUND:
            moved = self._displaced(offset * step, shifted=False)
            found = found + weight * (taken(moved) - base)
        along = found / step[segments]
        return np.asarray(along + self._partial(taken))

    def _of_whole(self, taken: _Taken) -> Array:
        """Derivatives of what is taken of the whole motion, with the shifts of its events."""
        if self.end:
            return np.full_like(taken(self._piece), np.nan)
        step = self._step
        base, found = taken(self._rebalanced(self._piece)), np.zeros(())
        for offset, weight in _AROUND:
            scale = np.full(len(self._shift), offset * step)
            moved = self._rebalanced(self._displaced(scale, shifted=True))
            found = found + weight * (taken(moved) - base)
        return np.asarray(found / step) + self._partial(lambda x: taken(self._rebalanced(x)))

    def of(self, taken: _Taken, seen: _Taken | None = None) -> Array:
        """Central differences along the derivatives of the motion, and of the machine."""
        if self.end:
            return np.full_like(taken(self._piece), np.nan)
        step = self._step
        some, other = (
            taken(self._displaced(np.full(len(self._shift), x), shifted=True))
            for x in (step, -step)
        )
        along = np.asarray((some - other) / (2.0 * step))
        more, less = (_with_machine(self._piece, m) for m in self._key.beside[:2])
        if seen and np.array_equal(seen(more), seen(less)):
            return along
        return along + self._partial(taken)

    def _rebalanced(self, piece: Piece) -> Piece:
        """The piece with works of its own motion."""
        if not piece.physics.has_forces:
            return piece
        work, _ = work_in(piece.physics, piece.motion, parts_of(piece.motion.curve))
        return replace(piece, balance=EnergyTerms(work, piece.impacts))

    def _displaced(self, scale: Array, shifted: bool) -> Piece:
        """The piece moved along its derivatives by `scale` (m,), with or without its events."""
        piece, motion, curve = self._piece, self._piece.motion, self._piece.motion.curve
        own, moved = curve.coefficients, np.nan_to_num(self._coefficients)
        powers = _sum(own, scale[:, None, None] * moved)
        states = motion.states
        if states.size:
            states = _sum(states, scale[:, None, None] * np.nan_to_num(self._states))
        start, duration, impacts = curve.start, curve.duration, piece.impacts
        if shifted:
            by = scale * self._shift
            n, s = powers.shape[1], states.shape[1] if states.size else 0
            powers = _shifted(powers, np.repeat(by, n))
            states = _shifted(states, np.repeat(by, s)) if s else states
            start = start + by
            duration = duration + np.append(np.diff(by), -by[-1])
            known = np.where(np.isfinite(self._logged), self._logged, 0.0)
            for name, column in zip(NUMBERS, known.T, strict=True):
                impacts = impacts.with_column(name, impacts.column(name) + scale[0] * column)
        else:
            powers[~np.isfinite(self._coefficients).all(axis=(1, 2))] = np.nan
        path = PiecewisePolynomial(start, curve.start_low, duration, curve.turns, powers)
        approach = motion.approach + scale[:, None] * np.nan_to_num(self._approach)
        torques = motion.torques + scale[:, None, None] * self._torques
        moved_motion = Motion(path, motion.modes, approach, torques, motion.acting, states)
        return replace(_plain(piece), motion=moved_motion, impacts=impacts)


class _Ideal(RunDerivative):
    """Derivatives of a motion that follows from its drives: of runs with other values."""

    @property
    def impacts(self) -> Table:
        """Impacts: none."""
        return Table({name: np.zeros(0) for name in ('joint', *NUMBERS)}, IMPACT_UNITS)

    @cached_property
    def _others(self) -> list[Piece]:
        end = self._piece.motion.curve.end
        return [Piece.joined([*Runner(machine).to(end)]) for machine in self._key.beside]

    def of(self, taken: _Taken, seen: _Taken | None = None) -> Array:
        """Derivatives by runs with other values."""
        return self._of_whole(taken)

    def _slopes(self, taken: _Taken, t: Array) -> Array:
        return self._of_whole(taken)

    def _of_whole(self, taken: _Taken) -> Array:
        base, found = taken(self._piece), np.zeros(())
        for weight, piece in zip(WEIGHTS, self._others, strict=True):
            found = found + weight * (taken(piece) - base)
        return np.asarray(found / self._key.step)


def _plain(piece: Piece) -> Piece:
    """A run, or a piece of one, as a `Piece`."""
    return Piece(piece.machine, piece.motion, piece.balance, piece.impacts, piece.modes)


def _with_machine(piece: Piece, machine: Machine) -> Piece:
    """The motion of a piece, with another machine."""
    return replace(_plain(piece), machine=machine)


def _sum(some: Array, others: Array) -> Array:
    """Sum of coefficients (m, n, d) of polynomials."""
    count = max(some.shape[2], others.shape[2])
    wide = [np.pad(x, ((0, 0), (0, 0), (0, count - x.shape[2]))) for x in (some, others)]
    return np.asarray(wide[0] + wide[1])


def _shifted(powers: Array, by: Array) -> Array:
    """Polynomials (m, n, d) in powers of the time since `by` (m n,) later."""
    return shift_powers(powers.reshape(-1, powers.shape[2]), by).reshape(powers.shape)


class AskedDerivatives:
    """Requested derivatives of a run, checked to exist before it starts.

    Parameters
    ----------
    paths : dotted paths of numbers of the scene
    end : end of the run [s]
    """

    def __init__(
        self, machine: Machine, paths: str | Sequence[str], end: float, resume: Snapshot | None
    ) -> None:
        if resume is not None:
            raise InputError(
                f'{machine.name}: a run that continues a snapshot has no derivatives: run it '
                'from its start'
            )
        self._machine, self._end = machine, end
        self._keys = numeric_keys(machine, paths)
        self._influence = influences(machine, self._keys, end) if machine.level.dynamic else None

    def along(self, piece: Piece) -> dict[str, RunDerivative]:
        """Derivatives of the whole motion of the run, by path."""
        if self._influence is None:
            return {key.path: _Ideal(key, piece, ()) for key in self._keys}
        flows = Flows(self._machine, self._influence, self._end, self._keys)
        flow, torques = flows.along(piece.motion, piece.impacts), flows.torques(piece.motion)
        return {
            key.path: _Integrated(key, piece, flow, torques, k) for k, key in enumerate(self._keys)
        }
