"""Branches of periodic responses over a parameter, stable and unstable, through folds and flips.

Fixed points of the exact Poincare map are followed by pseudo-arclength: Newton's method on the map
and on the way along the tangent together (H. B. Keller, 1977; R. Seydel, Practical Bifurcation and
Stability Analysis, 2010, ch. 4). Where an impact comes or goes the motion grazes, and the map has
no derivative (A. B. Nordmark, J. Sound Vib. 145, 1991). Up to there the parameter is a smooth
function of the speed of that impact, or of the gap that is left; extrapolated to 0 it tells where.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import scipy

from mechanism_sim.arguments import public
from mechanism_sim.arrays import Array
from mechanism_sim.engine.events import Impact
from mechanism_sim.engine.snapshot import State
from mechanism_sim.errors import InputError, RunError, quoted
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.results.run import Piece
from mechanism_sim.scene import Machine
from mechanism_sim.scene.files import check_scene
from mechanism_sim.studies.bifurcation import APART, ONE, Bifurcation, measure
from mechanism_sim.studies.periodic import PoincareMap, without_turns
from mechanism_sim.studies.runs import Call, Row, Show, Workers

_RESIDUAL = 1e-10  # residual of a period: change of an angle, or of a rate over the crank's speed
_ROUNDING = 1e-12  # rounding of a state, in the same measure; a period makes it grow
_ROUNDS = 12
_FASTER = 0.2  # ratio of residuals that a step of Newton's method must reach with old derivatives
_FIRST, _LONGEST, _LEAST = 0.02, 0.1, 1e-6
"""First, longest and shortest step; the range of the parameter is 1."""
_BEYOND = 0.01  # share of the range beyond a grazing impact at which a continuation is sought
_TURNED = 0.9  # least cosine between the tangents of neighbours
_MOST = 400  # largest number of points of a branch, to each side
_MOST_BRANCHES = 50
_SEEN = 5  # number of points from which a grazing is extrapolated
_CLOSE = 0.1
"""Change of a multiplier's size from point to point, beside 1 and itself, without a grazing."""
_STEEP = 2e3
"""Largest multiplier near a grazing impact; beyond, rounding exceeds the impact's speed."""
_HALVED = 0.1
"""Share of the largest half-period change on a branch below which rounding decides a flip."""
_BENT = 0.1
"""Largest deviation of neighbours on a branch from a parabola, relative to their change."""
_STABLE = 1e-7  # margin by which the size of a multiplier must be below 1


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """A periodic response.

    Attributes
    ----------
    value : value of the parameter, in its SI unit
    points : (P, K) section, as of a `Response`
    multipliers : Floquet multipliers, the largest first
    impacts : number of impacts in a period
    returns : (period, 2 f) positions and rates once a turn, over their scales, as of a `Response`
    """

    value: float
    points: Array
    multipliers: tuple[complex, ...]
    impacts: int
    returns: Array

    @property
    def stable(self) -> bool:
        """True if small perturbations decay."""
        return all(abs(m) < 1.0 - _STABLE for m in self.multipliers)


class BranchEvent(NamedTuple):
    """Fold, loss of stability or end of a branch.

    Attributes
    ----------
    kind : ``fold``, ``flip``, ``torus``, ``grazing``, ``lost`` where Newton's method ends, or
        ``cut`` where a branch has all the points that it may have
    value : value of the parameter, in its SI unit
    joint : joint of a grazing impact
    """

    kind: str
    value: float
    joint: str = ''


@dataclass(frozen=True, eq=False)
class ResponseBranch:
    """Responses with a period of a number of turns, and events, in order along the branch."""

    period: int
    points: tuple[BranchPoint, ...]
    events: tuple[BranchEvent, ...]


class _Orbit(NamedTuple):
    """A fixed point with its tangent, multipliers and motion."""

    state: State
    value: float
    tangent: Array  #: (2 f + 1,) tangent of state and value, over their scales
    multipliers: Any
    pieces: list[Piece]
    rows: Array  #: (r, r + 1) derivatives of the change in a period, along the basis and by value
    basis: Array  #: (w, r) basis of changes allowed by contacts, over the scales
    seat: Array  #: (w,) change per value that contacts require, over the scales

    @property
    def impacts(self) -> list[Impact]:
        return [i for piece in self.pieces for i in piece.impacts]


class _Shooting:
    """Fixed points of the map over a number of turns at any value, about a crank angle.

    Parameters
    ----------
    ahead : start of turns, beyond the angle at the start of the scene [turns]
    """

    def __init__(self, found: Bifurcation, period: int, ahead: float = 0.0) -> None:
        machine = found.machine
        self._name, self._content = machine.name, machine.scene.to_document()
        self.found, self.period, self.ahead = found, period, ahead
        self.span = found.parameter.high - found.parameter.low
        angle, speed = machine.drive.start
        angle += math.copysign(ahead * float(TWO_PI), speed)
        self._turned = {'drive.start_angle': angle} if ahead else {}
        self._last: tuple[float, Machine, PoincareMap] | None = None
        self.scale = self.at(found.parameter.low).scale

    def at(self, value: float) -> PoincareMap:
        """The map at a value of the parameter."""
        if self._last is None or self._last[0] != value:
            given = {self.found.parameter.path: value, **self._turned}
            machine = Machine(self._name, check_scene(self._name, self._content, given))
            self._last = value, machine, PoincareMap(machine)
        return self._last[2]

    def machine(self, value: float) -> Machine:
        """The machine at a value of the parameter."""
        self.at(value)
        assert self._last is not None  # noqa: S101 - it is that
        return self._last[1]

    def run(self, state: State, value: float, turns: float) -> tuple[list[Piece], State]:
        """The motion from a state, and the state after a number of turns."""
        section = self.at(value)
        return list(section.pieces(state, turns)), section.state

    def centred(self, state: State, value: float) -> tuple[_Shooting, State]:
        """Shooting from the middle of the longest time without impact, and the state there."""
        pieces, _ = self.run(state, value, self.period)
        times = sorted(i.t / self.machine(value).drive.period for x in pieces for i in x.impacts)
        if not times:
            return self, state
        times.append(times[0] + self.period)
        k = int(np.diff(times).argmax())
        middle = 0.5 * (times[k] + times[k + 1]) % self.period
        other = _Shooting(self.found, self.period, (self.ahead + middle) % 1.0)
        other.scale = self.scale
        return other, self.run(state, value, middle)[1]

    def solved(
        self, state: State, value: float, base: _Orbit | None = None, ahead: float = 0.0
    ) -> _Orbit | None:
        """Fixed point near a state, at a value, or at a distance along another's tangent.

        Newton's method keeps the derivatives of the other one while it converges fast enough.
        """
        rows, basis, before = (base.rows, base.basis, math.inf) if base else (None, None, 0.0)
        by, impacts_before = np.zeros(len(self.scale)), 0
        try:
            for _ in range(_ROUNDS):
                section = self.at(value)
                wide = section.scale / self.scale
                if base is None:
                    state, end, impacts_before = self._moved(state, value, by, impacts_before)
                else:
                    state = section.start(section.displace(state, by))
                    end = section.map(state, self.period)[0]
                if end.closed != state.closed:
                    return None
                off = wide * section.difference(state, end)
                size = float(np.abs(off / wide).max())
                grown = 1.0
                if rows is not None:  # without a change that contacts allow it has none
                    grown = float(np.linalg.svdvals(rows[:, :-1]).max(initial=0.0))
                if size <= max(_RESIDUAL, _ROUNDING * grown):
                    return self._orbit(state, value)
                if base is not None and size > before:  # a shorter step costs less
                    return None
                if rows is None or basis is None or size > _FASTER * before:
                    M, _ = section.growth(state, self.period)
                    basis, inner = self._allowed(section, state, M)
                    column = np.zeros((len(inner), 1))
                    if base:  # in the present basis
                        column = basis.T @ base.basis @ base.rows[:, -1:]
                    rows = np.column_stack([inner - np.eye(len(inner)), column])
                last, left = np.eye(rows.shape[1])[-1], 0.0
                if base is not None:
                    before = size
                    along = base.tangent[:-1] @ np.column_stack([basis, base.seat])
                    last = along + base.tangent[-1] * last
                    way = np.append(
                        wide * section.difference(base.state, state),
                        (value - base.value) / self.span,
                    )
                    left = ahead - float(base.tangent @ way)
                right = np.append(-basis.T @ off, left)
                step = np.linalg.lstsq(np.vstack([rows, last]), right)[0]
                if not (np.isfinite(step).all() and abs(step[-1]) < 1.0):
                    return None
                seat = step[-1] * base.seat if base else 0.0
                by, value = (basis @ step[:-1] + seat) / wide, value + self.span * float(step[-1])
        except (RunError, InputError):
            pass
        return None

    def _moved(
        self, state: State, value: float, by: Array, impacts_before: int
    ) -> tuple[State, State, int]:
        """State after a step, the state a period later, and the number of impacts until then.

        A part of the step is taken if all of it loses an impact. A slow one changes the period by
        the root of how far the state is beyond the grazing: half a step of Newton's method comes
        near where a whole one goes from one side to the other for ever.
        """
        section, found = self.at(value), []
        for share in (1.0, 0.5, 0.4):
            new = section.start(section.displace(state, share * by))
            end, count, _ = section.map(new, self.period)
            found.append((new, end, count))
            if count >= impacts_before:
                return found[-1]
        return found[0]

    def beyond(self, base: _Orbit, graze: float) -> _Orbit | None:
        """Fixed point with other impacts beyond a grazing impact, if there is one."""
        past = math.copysign(_BEYOND * self.span, graze - base.value)
        ahead = (graze + past - base.value) / (self.span * base.tangent[-1])
        by = ahead * base.tangent[:-1] * self.scale / self.at(base.value).scale
        return self.solved(self.at(base.value).displace(base.state, by), graze + past)

    def _orbit(self, state: State, value: float) -> _Orbit:
        """Tangent, multipliers and motion of a fixed point."""
        path = self.found.parameter.path
        section = PoincareMap(self.machine(value), [path])
        M, by, _ = section.sensitivity(state, self.period)
        wide = section.scale / self.scale
        basis, inner = self._allowed(section, state, M)
        seat = section.seated(state)[:, 0]
        by = self.span * wide * (by[:, 0] + M @ seat - seat)
        seat *= self.span * wide
        rows = np.column_stack([inner - np.eye(len(inner)), basis.T @ by])
        null = np.linalg.svd(rows)[2][-1]
        tangent = np.append(basis @ null[:-1] + null[-1] * seat, null[-1])
        tangent /= np.linalg.norm(tangent)
        pieces, _ = self.run(state, value, self.period)
        return _Orbit(state, value, tangent, np.linalg.eigvals(inner), pieces, rows, basis, seat)

    def _allowed(self, section: PoincareMap, state: State, M: Array) -> tuple[Array, Array]:
        """Basis (w, r) of changes that contacts allow, over the scales, and M along it."""
        wide = section.scale / self.scale
        basis = np.linalg.qr(wide[:, None] * section.directions(state))[0]
        return basis, basis.T @ (wide[:, None] * M / wide) @ basis

    def step(self, base: _Orbit, ahead: float) -> _Orbit | None:
        """Fixed point at a distance along the tangent of another."""
        section = self.at(base.value)
        by = ahead * base.tangent[:-1] * self.scale / section.scale
        value = base.value + ahead * self.span * float(base.tangent[-1])
        found = self.solved(section.displace(base.state, by), value, base, ahead)
        return found and found._replace(
            tangent=math.copysign(1.0, float(found.tangent @ base.tangent)) * found.tangent
        )

    def point(self, orbit: _Orbit) -> BranchPoint:
        """Section and stability of a fixed point."""
        plan, machine = self.found.plan, self.machine(orbit.value)
        if plan.joint:
            rows = [
                [getattr(i, n) for n in plan.of] for i in orbit.impacts if i.joint == plan.joint
            ]
        else:
            turns = np.arange(1, self.period + 1) - self.ahead
            rows = [_sampled(orbit.pieces, t * machine.drive.period, plan.of) for t in turns]
        multipliers = tuple(complex(m) for m in sorted(orbit.multipliers, key=abs, reverse=True))
        points = np.array(rows, dtype=float).reshape(-1, len(plan.of))
        names, scale, _ = measure(machine)
        places = (np.arange(1, self.period + 1) - self.ahead - APART) % self.period
        states = [_sampled(orbit.pieces, t * machine.drive.period, tuple(names)) for t in places]
        returns = np.array(states) / scale
        return BranchPoint(orbit.value, points, multipliers, len(orbit.impacts), returns)

    def halves(self, orbit: _Orbit) -> Array:
        """Change of the state (w,) in half of the period, over the scales; empty if it is odd.

        It vanishes where the branch returns to the flip of another of half its period.
        """
        if self.period % 2:
            return np.zeros(0)
        section = self.at(orbit.value)
        later = self.run(orbit.state, orbit.value, self.period / 2)[1]
        return np.asarray(section.scale / self.scale * section.difference(orbit.state, later))

    def gap_left(self, orbit: _Orbit, joint: str) -> float:
        """The least gap [m] of a joint within its flights, not at the impacts that end them."""
        name, k = f'gap.{joint}', self.machine(orbit.value).physics.clearances.index(joint)
        impacts_before = np.array([i.t for i in orbit.impacts if i.joint == joint])
        least = math.inf
        for piece in orbit.pieces:
            curve = piece.motion.curve
            t = (curve.start[:, None] + curve.duration[:, None] * np.arange(8.0) / 8.0).ravel()
            gap = piece.sample(t, name)[name]
            low = np.flatnonzero((gap[1:-1] < gap[:-2]) & (gap[1:-1] <= gap[2:])) + 1
            low = low[~piece.motion.closed[low // 8, k]]
            low = low[[not (np.abs(impacts_before - t[i]) < 1e-9 * curve.end).any() for i in low]]
            if len(low):
                i = min(low, key=lambda i: gap[i])
                found = scipy.optimize.minimize_scalar(
                    lambda x, piece=piece: float(piece.sample(x, name)[name][0]),
                    bounds=(t[i - 1], t[i + 1]), method='bounded',
                    options={'xatol': 1e-9 * curve.end},
                )  # fmt: skip
                least = min(least, float(found.fun))
        return least


def _sampled(pieces: list[Piece], t: float, names: tuple[str, ...]) -> list[float]:
    piece = next((p for p in pieces if t <= p.motion.curve.end), pieces[-1])
    found = piece.sample(min(t, float(piece.motion.curve.end)), *names)
    return [float(found[n][0]) for n in names]


# --- along a branch ------------------------------------------------------------------------------


def _strikes(orbit: _Orbit) -> dict[str, list[float]]:
    """Approach speeds of each joint's impacts [m/s], without those of a chatter cut off.

    Their number depends on the cut-off; they are the last ones, of decreasing speed.
    """
    found: dict[str, list[float]] = {}
    chatters: dict[str, float] = {}
    for impact in reversed(orbit.impacts):
        before = chatters.get(impact.joint, math.inf)
        if impact.ends_chatter or impact.approach_speed > before:
            chatters[impact.joint] = impact.approach_speed
        else:
            chatters.pop(impact.joint, None)
            found.setdefault(impact.joint, []).append(impact.approach_speed)
    return found


def _alike(a: _Orbit, b: _Orbit) -> bool:
    """True if no impact has been added or lost between neighbours.

    One that comes at a grazing makes a multiplier large; a chatter may begin an impact earlier
    without that.
    """
    counts = [Counter({joint: len(x) for joint, x in _strikes(o).items()}) for o in (a, b)]
    if counts[0] == counts[1]:
        return True
    one, other = (np.sort(np.abs(o.multipliers)) for o in (a, b))
    return one.shape == other.shape and bool((np.abs(one - other) <= _CLOSE * (1.0 + one)).all())


def _trace(
    shooting: _Shooting, start: _Orbit, sign: float
) -> tuple[list[BranchPoint], list[BranchEvent], tuple[_Shooting, _Orbit] | None]:
    """Points and events on one side of a fixed point, and a start beyond a grazing impact."""
    low, high = shooting.found.parameter.low, shooting.found.parameter.high
    orbits = [start._replace(tangent=sign * start.tangent)]
    points: list[BranchPoint] = []
    events: list[BranchEvent] = []
    ahead, eased = _FIRST, 0
    other: _Orbit | None = None  # beyond a grazing impact, from where it was seen last
    halves: dict[float, float] = {}
    while len(points) < _MOST:
        base, new = orbits[-1], shooting.step(orbits[-1], ahead)
        if new and (whole := shooting.halves(base)).size:
            if float(whole @ shooting.halves(new)) < 0.5 * float(whole @ whole) and ahead > _LEAST:
                ahead, eased = 0.5 * ahead, 3
                continue
            halves[base.value] = float(whole @ whole)
            if (flip := _where_halved(halves)) is not None:
                return points, [*events, BranchEvent('flip', flip)], None
        alike = new is not None and _alike(new, base)
        steep = float(np.abs(base.multipliers).max(initial=0.0)) > _STEEP
        turned = new is not None and float(new.tangent @ base.tangent) < _TURNED
        if new is None or not alike or turned or steep:
            other = other if new is None or alike else new
            if ahead > _LEAST and not steep:
                ahead, eased = 0.5 * ahead, 3
                continue
            event = _grazing(shooting, orbits)
            events.append(event or BranchEvent('lost', base.value))
            other = other or (shooting.beyond(base, event.value) if event else None)
            return points, events, (shooting, other) if other else None
        if not low <= new.value <= high:
            limit = low if new.value < low else high
            near = shooting.step(base, ahead * (limit - base.value) / (new.value - base.value))
            end = shooting.solved((near or new).state, limit)
            points += [shooting.point(end)] if end else []
            break
        events += _between(shooting, base, new, ahead)
        points.append(shooting.point(new))
        orbits, other = [*orbits[1 - _SEEN :], new], None
        ahead, eased = (ahead, eased - 1) if eased else (min(1.4 * ahead, _LONGEST), 0)
        before = shooting
        shooting, orbits = _recentred(shooting, orbits)
        if shooting is not before:  # half a period is seen from elsewhere
            halves.clear()
    else:
        events.append(BranchEvent('cut', orbits[-1].value))
    return points, events, None


def _where_halved(halves: Mapping[float, float]) -> float | None:
    """Value at which the change in half a period vanishes, if near, from its squares by value.

    Near the flip the value is linear in the square; beyond it the branch repeats itself.
    """
    values, squares = np.array([*halves.items()][-_SEEN:]).T
    if squares[-1] > _HALVED**2 * max(halves.values()) or not (np.diff(squares) < 0.0).all():
        return None
    flip = float(scipy.interpolate.BarycentricInterpolator(squares, values)(0.0))
    return flip if abs(flip - values[-1]) < abs(values[-1] - values[0]) else None


def _recentred(shooting: _Shooting, orbits: list[_Orbit]) -> tuple[_Shooting, list[_Orbit]]:
    """Shooting from another instant if an impact is near the start of turns."""
    last = orbits[-1]
    period = shooting.period * shooting.machine(last.value).drive.period
    off = min((min(i.t, period - i.t) for i in last.impacts), default=period)
    if off > 0.01 * period or abs(last.tangent[-1]) < 0.05:
        return shooting, orbits
    other, state = shooting.centred(last.state, last.value)
    found = other.solved(state, last.value)
    if found is None:
        return shooting, orbits
    sign = math.copysign(1.0, found.tangent[-1] * last.tangent[-1])
    return other, [found._replace(tangent=sign * found.tangent)]


def _tests(orbit: _Orbit) -> dict[str, float]:
    """Functions that are zero at folds, flips, and pairs of multipliers of size 1."""
    pairs = orbit.multipliers[orbit.multipliers.imag > 0.0]
    return {
        'fold': float(orbit.tangent[-1]),
        'flip': float(np.prod(1.0 + orbit.multipliers).real),
        'torus': float(np.abs(pairs).max()) - 1.0 if len(pairs) else math.nan,
    }


def _between(
    shooting: _Shooting, base: _Orbit, new: _Orbit, ahead: float
) -> Iterator[BranchEvent]:
    """Folds and changes of stability on the way from one fixed point to the next."""
    before, after = _tests(base), _tests(new)
    for kind in before:
        if not before[kind] * after[kind] < 0.0:
            continue
        found = {0.0: base, ahead: new}

        def test(s: float, kind: str = kind, found: dict[float, _Orbit] = found) -> float:
            if s not in found:
                orbit = shooting.step(base, s)
                if orbit is None:
                    raise RunError('lost')
                found[s] = orbit
            return _tests(found[s])[kind]

        try:
            s = scipy.optimize.brentq(test, 0.0, ahead, xtol=1e-9 * ahead, rtol=1e-12)
        except (RunError, ValueError):
            s = ahead
        yield BranchEvent(kind, found[s].value)


def _grazing(shooting: _Shooting, orbits: list[_Orbit]) -> BranchEvent | None:
    """Grazing soon behind these fixed points, if it ends the branch; else None."""
    values = np.array([orbit.value for orbit in orbits[-_SEEN:]])
    if len(values) < 3:
        return None
    joints = shooting.machine(values[-1]).physics.clearances
    found: list[tuple[float, float, str]] = []
    for joint in joints:
        speeds = [_strikes(o).get(joint) for o in orbits[-_SEEN:]]
        margins = [[shooting.gap_left(o, joint) for o in orbits[-_SEEN:]]]
        if all(speeds):
            margins.append([min(x) for x in speeds if x])
        for m in map(np.array, margins):
            if np.isfinite(m).all() and (np.diff(m) < 0.0).all() and m[-1] < 0.5 * m[0]:
                value = float(scipy.interpolate.BarycentricInterpolator(m, values)(0.0))
                found.append((abs(value - values[-1]), value, joint))
    if not found or min(found)[0] > 3.0 * abs(values[-1] - values[0]):
        return None
    _, value, joint = min(found)
    return BranchEvent('grazing', value, joint)


@public
def branches(
    found: Bifurcation, workers: int | Workers | None = 1, show: Show | None = None
) -> tuple[ResponseBranch, ...]:
    """Branches through all periodic responses that were found, within the range of the parameter.

    >>> import mechanism_sim as ms
    >>> found = ms.bifurcation('four_bar_clearance', {'drive.speed': ('479 rpm', '480 rpm', 2)},
    ...                        transient=30, keep=8)
    >>> {branch.period for branch in ms.branches(found)}
    {2}

    Parameters
    ----------
    workers : processes that follow a period each; a single one is this process
    show : function called with the number of finished periods
    """
    if not isinstance(found, Bifurcation):
        raise InputError(f'branches takes what bifurcation(scene, ...) found, got {quoted(found)}')
    bare = replace(found, machine=Machine(found.machine.name, found.machine.scene))
    periods = dict.fromkeys(r.period for r in found.responses if r.period and r.state)
    tasks = [Call(str(period), _followed, (bare, period)) for period in periods]
    with Workers.of(workers) as makers:
        rows = makers.do_all(tasks, show)
    return tuple(branch for row in rows for branch in row['branches'])


def _followed(found: Bifurcation, period: int) -> Row:
    """Branches of one period, each of them once."""
    made: list[ResponseBranch] = []
    for response in found.responses:
        if response.period != period or response.state is None:
            continue
        if _known(made, found, response.value, response.returns):
            continue
        shooting = _Shooting(found, period)
        shooting, state = shooting.centred(response.state, response.value)
        start = shooting.solved(state, response.value)
        left = [(shooting, start)] if start else []
        while left and len(made) < _MOST_BRANCHES:
            other, orbit = left.pop()
            if not _known(made, found, orbit.value, other.point(orbit).returns):
                branch, beyond = _branch(other, orbit)
                made.append(branch)
                left += beyond
    return {'branches': made}


def _branch(
    shooting: _Shooting, start: _Orbit
) -> tuple[ResponseBranch, list[tuple[_Shooting, _Orbit]]]:
    """The branch through a fixed point, and fixed points beyond its ends."""
    shooting, start = _weighed(shooting, start)
    first = shooting.point(start)
    (back, earlier, one), (on, later, other) = (
        _trace(shooting, start, sign) for sign in (-1.0, 1.0)
    )
    events = (*earlier[::-1], *later)
    branch = ResponseBranch(shooting.period, (*back[::-1], first, *on), events)
    return branch, [x for x in (one, other) if x]


def _weighed(shooting: _Shooting, start: _Orbit) -> tuple[_Shooting, _Orbit]:
    """Rescale states so that they change as much as the parameter over its range."""
    x, value = start.tangent[:-1], abs(start.tangent[-1])
    by = max(float(np.linalg.norm(x)) / max(value, 1e-3), 1e-6)
    shooting.scale = shooting.scale * by
    tangent = np.append(x / by, start.tangent[-1])
    rows = np.column_stack([start.rows[:, :-1], start.rows[:, -1:] / by])
    tangent /= np.linalg.norm(tangent)
    return shooting, start._replace(tangent=tangent, rows=rows, seat=start.seat / by)


def _known(made: list[ResponseBranch], found: Bifurcation, value: float, returns: Array) -> bool:
    """True if a branch passes through states (P, 2 f) at a value, from any turn on."""
    _, scale, period = measure(found.machine)
    turns = period / scale
    for there, step in (x for branch in made for x in _places(branch, value, turns)):
        near = ONE + _BENT * step.max(axis=0)
        if any((np.abs(way) <= near).all() for way in _ways(there, returns, turns)):
            return True
    return False


def _places(branch: ResponseBranch, value: float, turns: Array) -> Iterator[tuple[Array, Array]]:
    """States (P, 2 f) of a branch at a value, and their change between the neighbours.

    It is a parabola through three points along its way: at a fold, values turn.
    """
    states = [branch.points[0].returns]
    for point in branch.points[1:]:
        ways = _ways(states[-1], point.returns, turns)
        states.append(states[-1] + min(ways, key=lambda way: float(np.abs(way).max())))
    values = np.array([point.value for point in branch.points])
    x = np.column_stack([values, np.reshape(states, (len(values), -1))])
    size = np.maximum(np.ptp(x, axis=0), np.append(1e-300, np.full(x.shape[1] - 1, ONE)))
    steps = np.linalg.norm(np.diff(x, axis=0) / size, axis=1)
    along = np.append(0.0, np.cumsum(np.maximum(steps, _LEAST)))
    for k in range(len(values) - 1):
        first = max(min(k, len(values) - 3), 0)
        some = x[first : first + 3]
        if np.abs(value - some[:, 0]).min() > np.ptp(some[:, 0]):
            continue
        t = (along[first : first + 3] - along[k]) / (along[k + 1] - along[k])
        curve = np.linalg.solve(np.vander(t), some)
        roots = np.roots(curve[:, 0] - np.append(np.zeros(len(t) - 1), value))
        for root in roots[np.abs(roots - 0.5) <= 0.501].real:
            there = np.vander([root], len(t))[0] @ curve[:, 1:]
            yield there.reshape(states[0].shape), np.abs(states[k + 1] - states[k])


def _ways(a: Array, b: Array, turns: Array) -> Iterator[Array]:
    """Differences of the states of one period to another's, which begins at each of its turns."""
    for k in range(len(b)):
        yield without_turns(np.roll(b, k, axis=0) - a, turns)
