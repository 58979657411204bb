"""The motion of an ideal linkage under prescribed drives, as polynomials like any other motion.

Positions are exact at every instant; for topics and sensors they are interpolated on pieces of a
sixteenth of a turn or less, where the motion is sharp.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import partial
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from mechanism_sim.arrays import Array, IndexArray
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.drive_laws import LawSchedule
from mechanism_sim.engine.events import Impacts, ModeChange
from mechanism_sim.engine.physics import Physics, each_instant, is_force_open, outside, rows
from mechanism_sim.engine.snapshot import Snapshot
from mechanism_sim.errors import RunError
from mechanism_sim.linkages.ideal import IdealMotion, Passage, with_limits
from mechanism_sim.linkages.known_pieces import KnownPieces, NextPiece
from mechanism_sim.linkages.piece_ends import (
    AHEAD,
    END,
    ENDED,
    NODES,
    LoadCuts,
    SmoothPiece,
    until_switch,
)
from mechanism_sim.numerics.polynomials import (
    TWO_PI,
    PiecewisePolynomial,
    Times,
    chebyshev_coefficients,
    fit_powers,
    shift_powers,
)
from mechanism_sim.planar.branch import SAMPLES
from mechanism_sim.planar.drive import DriveLaw, Law, LawSource
from mechanism_sim.planar.inverse_dynamics import Account, InverseDynamics, NoLimit, Observation
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.steep_loads import SteepLoads
from mechanism_sim.planar.switched_functions import Edges
from mechanism_sim.tolerances import TOLERANCES

_MECHANISM = TOLERANCES.mechanism

_EPS = float(np.finfo(float).eps)
_PIECES_PER_TURN = 16
_TAIL = 1e-13  # relative size of the last terms of a piece beyond which it is halved
_ROUNDED = 8.0
"""times what rounding leaves open in coordinates: smaller last terms are no more than that."""
_SHORTEST = 2.0**-20
_SHORT, _MOST_SHORT = 2.0**-14, 400  # so many pieces of such a share in a row lead nowhere
#: [s] of a piece: nodes grant each other some seconds, and pieces are handed on whole
_LONGEST = 0.1
_SLOW = 40.0  # parts of a usual piece of a slow drive, if they are longer than that
_SEARCHED = 33  # places in a piece where singular positions are looked for
_ROUNDS = 4  # in which they are found to rounding
_SECTIONS = 80  # into thirds, in which the least work of unknown loads is found to rounding
_LONG = 1e6  # [s] a drive that takes longer through a singular position is at rest
_BRIEF = 1e-12  # of a usual piece: signs within are those of rounding
_DENSE = 4  # ends of rows in a piece from which on the parts between them are found at once


class NominalRun:
    """Advances an ideal linkage piece by piece; the same surface as the event loop's.

    Parameters
    ----------
    ideal : ideal motion, n coordinates of which p are driven
    laws : laws of the driven coordinates
    first : configuration (n,) at the start, or near it
    size : size of the mechanism [m]
    edges : finder of the onset and end of loads
    slope : direction (n,) of the initial motion, if the first configuration is singular
    turns : whole turns (n,) of the first configuration, beside its angles
    steep : loads to be resolved by the nodes of pieces

    Attributes
    ----------
    steps, events : number of pieces, and 0
    timed : True if loads depend on time itself: then no piece of a slow drive is longer
    """

    events = 0

    def __init__(
        self,
        ideal: IdealMotion,
        laws: Sequence[DriveLaw],
        first: Array,
        size: float,
        edges: Edges | None = None,
        slope: Array | None = None,
        turns: Sequence[int] | None = None,
        steep: SteepLoads | None = None,
    ) -> None:
        self.steps = 0
        self._time = Fraction(0)
        self._ideal = ideal
        self._cuts = (
            LoadCuts(edges, steep, ideal.coordinates, ideal.driven) if edges or steep else None
        )
        self._drives, self.timed = LawSchedule(laws), True
        #: the laws about a time, which is another object where they change
        self._about: tuple[Fraction | None, list[tuple[int, tuple[float, ...]]]] = None, []
        self._scale = np.array(
            [size if i in ideal.sliding else 1.0 for i in range(len(ideal.coordinates))]
        )
        self._known = KnownPieces(ideal, self._scale, np.array(first, dtype=float))
        self._pieces: list[tuple[Fraction, float, NDArray[np.int64], Array]] = []
        self._turns = np.array(turns or [0] * len(first), dtype=np.int64)
        self._last = np.array(first, dtype=float)
        self._take_off_turns()
        self._slope = slope
        self._share = 0.5  # of the greatest length of a piece
        self._short = 0  # pieces in a row

    @property
    def time(self) -> float:
        """Time [s] up to which the motion is known: rounded, for after days it has few digits."""
        return float(self._time)

    def change_law(self, law: Law) -> None:
        """Announce a law, as `LawSchedule.announce`; ValueError for that of a torque, too."""
        if not isinstance(law, DriveLaw):
            raise ValueError('a torque needs equations of motion, not closed forms')
        self._drives.announce(law, self._time)

    def go_on_by(self, sources: Mapping[str, LawSource]) -> None:
        """Set sources of laws, by coordinate, for times without an announced law."""
        self._drives.go_on_by(sources)

    @property
    def _laws(self) -> list[DriveLaw]:
        """Laws of angles in force."""
        return [law for law in self._drives.laws if isinstance(law, DriveLaw)]

    def advance(self, until: float, final: bool = False, most: int | None = None) -> None:
        """Add every piece that ends not later than `until` [s]; with `final` up to `until`.

        A run has come to `until` when its rounded `time` has: what is left of a piece that ends
        there is shorter than any difference of times, and no piece of its own.
        """
        first = self.steps
        while most is None or self.steps - first < most:
            end = self._usual_end()
            rounded = float(end)  # fractions take long to compare
            coming = self._drives.coming
            change = coming[0].valid_from if coming else math.inf
            # what a rounding would leave before a change of the law is no piece of its own
            if change <= until and change <= rounded + END * (rounded - self.time):
                self._add(Fraction(change))
                if self._time == change:
                    self._drives.switch()
                    self._about = None, []
                continue
            if rounded > until or (rounded == until and end > until):
                if final and self.time < until:
                    self._add(Fraction(until))
                    continue
                return
            self._add(end)

    def motion(self, until: float) -> Motion:
        """The whole motion up to a time [s], for positions only."""
        self.advance(until, final=True)
        return self.drain()[0]

    def preview(self, until: float) -> Motion | None:
        """Motion up to `until` [s], from the part that `advance` to there has held back.

        None if it has come so far. To be called after `drain`.
        """
        if until <= self.time:
            return None
        here, steps = self.snapshot(), self.steps
        while self.time < until:
            changes = (Fraction(law.valid_from) for law in self._drives.coming)
            self._add(min([self._usual_end(), *changes]))
        while self._pieces[-1][0] >= until:  # several may have been added at once
            self._pieces.pop()
        start, *_ = self._pieces[-1]
        motion, *_ = self.drain()
        self.restore(here)
        self.steps = steps
        motion.curve.duration[-1] = float(until - start)
        return motion

    @property
    def _local(self) -> list[tuple[int, tuple[float, ...]]]:
        """Whole turns now, and the law in powers of the time from now on, of every drive."""
        if self._about[0] is not self._time:
            self._about = self._time, [law.about(self._time) for law in self._laws]
        return self._about[1]

    def _usual_end(self) -> Fraction:
        """End of the next piece unless something shortens it [s]."""
        return self._time + Fraction(self._share * self._width())

    def _width(self) -> float:
        """Time [s] in which the fastest drive goes through one usual piece, or a short while."""
        widths: list[float] = []
        for (_, local), i in zip(self._local, self._ideal.driven, strict=True):
            way = 2.0 * np.pi * self._scale[i] / _PIECES_PER_TURN
            widths += [(way / abs(c)) ** (1.0 / k) for k, c in enumerate(local) if k and c]
        width = min(widths, default=_LONGEST)
        longest = _LONGEST if self.timed else max(_LONGEST, width / _SLOW)
        steady = all(len(local) <= 2 for _, local in self._local)
        if not (steady and longest < width < math.inf):
            return min(width, longest)
        # in equal parts: a steady drive comes by the same places every turn
        return width / math.ceil(width / longest - END)

    def _add(self, end: Fraction) -> None:
        """A piece up to `end`, or less if that would not be exact."""
        h = whole = float(end - self._time)
        if h <= 0.0:
            return
        made = self._next(h, end)
        if made is None:
            return
        h, self._share = made.length, made.share
        self._slope = made.slope
        self._short = self._short + 1 if self._share < _SHORT else 0
        if self._short > _MOST_SHORT:
            raise RunError(
                f'the mechanism cannot be followed beyond t = {self.time:.6g} s: its constraints '
                'are nearly singular there'
            )
        # a piece for each of the parts that loads cut it into
        driven = self._ideal.driven
        for begin, stop in pairwise([0.0, *made.cuts, made.length]):
            start, turns, coefficients = self._time, self._turns.copy(), made.coefficients
            if begin:
                start += Fraction(begin)
                laws = [law.about(start) for law in self._laws]
                turns[driven] = [whole for whole, _ in laws]
                coefficients = shift_powers(coefficients, np.full(len(turns), begin))
                _with_laws(coefficients, laws, driven)
            self._pieces.append((start, stop - begin, turns, coefficients))
            self.steps += 1
        if made.smooth:
            self._share = min(1.0, 2.0 * self._share)
        self._time = end if h == whole else self._time + Fraction(h)
        self._last = made.coefficients @ h ** np.arange(len(NODES))
        self._take_off_turns()

    def _next(self, h: float, end: Fraction) -> NextPiece | None:
        """The piece of so many seconds, known or made; None if rows of tables are added."""
        (turns, local), *_ = self._local
        known, here = self._known, (self._last, self._about, self._share)
        place = known.place(self._last, local, h, self._share) if self._slope is None else None
        if not (place and place in known) and self._add_rows(end):
            return None
        if place is None:
            return self._cut(self._made(h))
        varied = self._cuts is not None and (self._cuts.varied or bool(known.pitches))
        if place not in known:
            self._last = known.start(place)
            angle = float(self._last[self._ideal.driven[0]])
            self._about = self._time, [(turns, (angle, local[1]))]
            try:
                made = self._made(h)
                made = made if varied else self._cut(made)
            except RunError:  # told of what is really there
                made = None
            known.enter(place, made)
            self._last, self._about, self._share = here
        self._turns[self._ideal.driven] = turns
        if (found := known.beside(place, local)) is None:
            return self._cut(self._made(h))
        found.coefficients[:, 0] += known.passed(self._last)
        return self._cut(found) if varied else found

    def _made(self, h: float) -> NextPiece:
        """The piece from here on, of so many seconds, or of fewer if that would not be exact."""
        edges, switched = self._ideal.edges, False
        while True:
            shortest = self._share < _SHORTEST
            try:
                if edges:
                    states = partial(self._states, edges)
                    before, _ = until_switch(edges, h, AHEAD * h, states, states)
                    h, switched = before, switched or before < h
                values, slope = self._followed(h * ENDED)
                values = values[:, :-1]
            except RunError:  # too far for Newton's method, or for the mechanism
                if shortest:
                    raise
            else:
                terms = np.abs(chebyshev_coefficients(values)).T / self._scale
                if shortest or _is_exact(self._ideal, values, terms, self._scale, slope):
                    break
            self._share *= 0.5
            h *= 0.5
        coefficients = _with_laws(fit_powers(values, h), self._local, self._ideal.driven)
        # terms decay geometrically: those in the middle foretell the last ones of twice the length
        smooth = 2.0 ** len(NODES) * float(terms[6:9].max()) ** 2 <= 0.1 * _TAIL
        return NextPiece(h, coefficients, slope, switched, self._share, smooth)

    def _cut(self, made: NextPiece) -> NextPiece:
        """A piece from here on, with the times at which loads cut it."""
        if self._cuts is None or made.length < _BRIEF * self._width():
            return made
        rates = [abs(local[1]) for _, local in self._local if len(local) > 1]

        near = partial(self._states, coefficients=made.coefficients)
        turns, fastest = self._turns.tolist(), max(rates, default=0.0)
        piece = SmoothPiece(made.coefficients, made.length, self.time, turns, fastest)
        return made._replace(cuts=self._cuts.within(piece, near, self._states))

    def _add_rows(self, end: Fraction) -> bool:
        """Add the pieces up to `end` if many short rows of tables follow each other there.

        Each is what `_add` would make of it, but for rounding, and does not depend on the others.
        False if there are few of them, or one needs more than that; some may be added then.
        """
        h = float(end - self._time)
        edges, driven = self._ideal.edges, self._ideal.driven
        if edges is None or self._cuts or self._slope is not None:
            return False
        if edges.rated or 'time' in edges.outside or {*edges.coordinates} - {*driven}:
            return False
        # where they are looked for does not depend on `end`: what ends earlier has the same pieces
        usual = self._share * self._width()
        ends = edges.row_ends(partial(self._states, edges), usual)
        if ends is None or len(ends) < _DENSE:
            return False
        shortest = AHEAD * usual
        inner = ends[(np.diff(ends, prepend=0.0) > shortest) & (ends < h - shortest)]
        cuts = np.concatenate([[0.0], inner, [h]])
        wide = np.diff(cuts)
        times = cuts[:-1, None] + wide[:, None] * ENDED
        places = self._driven(times.ravel())
        edges.check(places)
        q = self._ideal.follow_apart(self._last, places[driven])
        if q is None:
            return False
        values = q.reshape(len(q), *times.shape)[:, :, :-1].transpose(1, 0, 2)
        last = q.reshape(len(q), *times.shape)[:, :, -1].T
        terms = np.abs(chebyshev_coefficients(values)) / self._scale[:, None]
        size = _EPS * np.abs(values).max(axis=2) / self._scale
        bad = (terms[:, :, -2:] - _ROUNDED * size[:, :, None]).max(axis=(1, 2)) > _TAIL
        good = int(np.argmax(bad)) if bad.any() else len(bad)
        powers = fit_powers(values, 1.0) / wide[:, None, None] ** np.arange(len(NODES))
        begun = self._turns.copy()
        for k in range(good):
            coefficients = powers[k]
            coefficients[:, 0] -= TWO_PI * (self._turns - begun) * self._ideal.turning
            _with_laws(coefficients, self._local, driven)
            self._pieces.append((self._time, float(wide[k]), self._turns.copy(), coefficients))
            self.steps += 1
            whole = k == len(wide) - 1
            self._time = end if whole else self._time + Fraction(float(wide[k]))
            self._last = last[k] - TWO_PI * (self._turns - begun) * self._ideal.turning
            self._driven(np.zeros(0))
            self._take_off_turns()
        if good == len(bad):
            self._share, self._short = min(1.0, 2.0 * self._share), 0
        return good > 0

    def _take_off_turns(self) -> None:
        """Keep angles that follow within a turn; those of drives are known by their laws."""
        whole = np.where(self._ideal.turning, np.trunc(self._last / TWO_PI), 0.0)
        self._turns += whole.astype(np.int64)
        self._last -= TWO_PI * whole

    def _states(self, edges: Edges, times: Array, coefficients: Array | None = None) -> Array:
        """States for `edges` at times [s] from now, of coordinates that follow if need be.

        These are as closures have them, or by the coefficients (n, m) of a piece from now on.
        """
        follow = {*edges.coordinates} - {*self._ideal.driven}
        if coefficients is not None:
            q = np.asarray(polynomial.polyval(times, coefficients.T), float)
        else:
            q = self._followed(times)[0] if follow else self._driven(times)
        v = np.zeros_like(q)
        if edges.rated:
            laws = [[k * c for k, c in enumerate(law)][1:] or [0.0] for _, law in self._local]
            driven = np.array([polynomial.polyval(times, law) for law in laws])
            if follow:
                v = self._ideal.rates(q, driven)
            else:
                v[self._ideal.driven] = driven
        turns = dict(zip(self._ideal.coordinates, self._turns.tolist(), strict=True))
        known = [
            self.time + times
            if name == 'time'
            else np.full(len(times), turns[name.removesuffix('.turns')])
            for name in edges.outside
        ]
        return np.concatenate([q, v, *(x[None] for x in known)])

    def _followed(self, times: Array) -> tuple[Array, Array | None]:
        """The coordinates (n, N) at times [s] from now.

        Also the direction of the branch at the last of them, if need be.
        """
        q = self._driven(times)
        now = np.zeros((3, len(self._laws)))
        for row, (_, local) in enumerate(self._local):
            now[: len(local), row] = local[:3]
        now[2] *= 2.0
        driven = q[self._ideal.driven]
        return self._ideal.follow(self._last, times, driven, now, self._slope)

    def _driven(self, times: Array) -> Array:
        """Driven coordinates at times (N,), in rows (n, N) that are zero for the others."""
        q = np.zeros((len(self._last), len(times)))
        for (turns, local), i in zip(self._local, self._ideal.driven, strict=True):
            self._turns[i], self._last[i] = turns, local[0]
            q[i] = polynomial.polyval(times, local)
        return q

    def change_restitution(self, joint: str, restitution: float) -> None:
        """Raise a KeyError, as there are no impacts."""
        raise KeyError(joint)

    def snapshot(self) -> Snapshot:
        """Snapshot to go on from: `since` counts short pieces, `stabilisation` is their share."""
        turns = dict(zip(self._ideal.coordinates, self._turns.tolist(), strict=True))
        slope = () if self._slope is None else self._slope.tolist()
        return Snapshot(
            '', self._time, 0.0, turns, (*self._last.tolist(), *slope), (), self._short, (),
            (), (), (), self._share, math.inf, 0.0,
            tuple(self._drives.laws), tuple(self._drives.coming), -math.inf, (0, 0),
        )  # fmt: skip

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        self._time = snapshot.base + Fraction(snapshot.tau)
        self._drives.restore(snapshot.laws, snapshot.coming)
        n = len(self._last)
        self._last, slope = np.array(snapshot.state[:n]), np.array(snapshot.state[n:])
        self._slope, self._share = slope if slope.size else None, snapshot.stabilisation
        self._short = snapshot.since
        self._turns = np.array([snapshot.turns[c] for c in self._ideal.coordinates])
        self._pieces.clear()

    def drain(self) -> tuple[Motion, Impacts, list[ModeChange]]:
        """Motion since the last call; there are no events."""
        pieces, self._pieces = self._pieces, []
        count, n = len(pieces), len(self._last)
        start = np.array([float(p[0]) for p in pieces])
        # what rounding leaves out, in whole numbers: fractions would look for common divisors
        exact = [(*p[0].as_integer_ratio(), *float(p[0]).as_integer_ratio()) for p in pieces]
        low = [
            (above * unit - rounded * below) / (below * unit)
            for above, below, rounded, unit in exact
        ]
        curve = PiecewisePolynomial(
            start,
            np.array(low),
            np.array([p[1] for p in pieces]),
            np.array([p[2] for p in pieces], dtype=np.int64).reshape(count, n),
            np.array([p[3] for p in pieces]).reshape(count, n, len(NODES)),
        )
        none = np.zeros((count, 0))
        motion = Motion(curve, np.zeros((count, 0), np.uint8), none, np.zeros((count, 0, 3)))
        return motion, Impacts(), []


def _with_laws(
    coefficients: Array, laws: Sequence[tuple[int, tuple[float, ...]]], driven: Sequence[int]
) -> Array:
    """Coefficients (n, m) of which those of drives are as their laws have them."""
    for (_, local), i in zip(laws, driven, strict=True):
        coefficients[i] = 0.0
        coefficients[i, : len(local)] = local
    return coefficients


def _is_exact(
    ideal: IdealMotion, values: Array, terms: Array, scale: Array, slope: Array | None
) -> bool:
    """True if polynomials through values (n, m), of Chebyshev terms (m, n), are the motion."""
    # a displacement without bounds rounds by its size, a rack's after many turns
    size = _EPS * np.abs(values).max(axis=1) / scale
    tail = (terms[-2:] - _ROUNDED * size).max()
    if tail <= _TAIL:
        return True
    # beside a nearly singular position rounding is larger: no halving helps
    return bool(slope is None and tail <= _ROUNDED * ideal.rounding(values))


class NominalPhysics(Physics):
    """An ideal linkage: exact kinematics, and forces where masses are known.

    All directions of springs are accepted: a prescribed motion is known where their ends meet.
    """

    def __init__(
        self,
        ideal: IdealMotion,
        mechanism: Mechanism,
        forces: InverseDynamics | None,
        undetermined: Mapping[str, frozenset[str]] = MappingProxyType({}),
    ) -> None:
        super().__init__(mechanism, undetermined)
        self.driven = tuple(self.coordinates[i] for i in ideal.driven)
        self.has_forces = forces is not None
        self.unknowns = forces.unknowns.units if forces else {}
        self.frictions = forces.frictions if forces else {}
        self._ideal = ideal
        self._forces = forces

    def _observe(
        self,
        motion: Motion,
        segments: IndexArray,
        dt: Times,
        limited: bool = True,
    ) -> Observation:
        """Observed without whole turns; limits of forces in joints, which take time, on request.

        Angles that have turned often have lost digits which closures and forces need.
        """
        curve = motion.curve
        q, v, a, passage = self._motion(curve, segments, dt)
        if self._forces is not None:
            acting = rows(self._forces.edges, self.coordinates, curve, segments, dt)
            seen = self._forces(q, v, a, self._outside(curve, segments, dt), acting)
            self._check_formulas(seen, curve, segments, dt)
            if passage is None:
                return seen
            near = passage.index
            segment, since = each_instant(curve, segments, dt)
            segment, since = segment[near], since[near]
            known = self._outside(curve, segment, since)
            acting = None if acting is None else acting[:, near]
            required = self._forces.required(q[:, near], v[:, near], a[:, near], known, acting)

            def sampled(part: Passage, which: IndexArray, share: float) -> Observation:
                return self._sampled(part, curve, segment[which], since[which], share)

            return with_limits(seen, sampled if limited else None, required, passage)
        count = q.shape[1]
        none, unknown = np.zeros((0, count)), np.full(count, np.nan)
        return Observation(
            q, v, a, none, none, none, np.zeros(count), np.zeros((0, 2, count)), none, none,
            unknown, unknown, unknown,
        )  # fmt: skip

    def _motion(
        self, curve: PiecewisePolynomial, segments: IndexArray, dt: Times
    ) -> tuple[Array, Array, Array, Passage | None]:
        """Coordinates without whole turns, rates and accelerations, exact beside the fitted."""
        driven = self._ideal.driven
        fitted, *along = (curve.local(segments, dt, d).T for d in range(3))
        v, a = along
        closed_by = rows(self._ideal.edges, self.coordinates, curve, segments, dt)
        return self._ideal.motion(fitted, v[driven], a[driven], (v, a), closed_by)

    def moved(self, motion: Motion, segments: IndexArray, dt: Times) -> tuple[Array, Array]:
        """Coordinates without whole turns, and rates (n, N)."""
        return self._motion(motion.curve, segments, dt)[:2]

    def _outside(self, curve: PiecewisePolynomial, segments: IndexArray, dt: Times) -> Array:
        """Inputs that loads ask for beside the motion."""
        assert self._forces is not None  # noqa: S101 - nobody asks otherwise
        return outside(self._forces.outside, self.coordinates, curve, segments, dt)

    def _check_formulas(
        self,
        seen: Observation,
        curve: PiecewisePolynomial,
        segments: IndexArray,
        dt: Times,
    ) -> None:
        """Refuse loads that are not finite: forces alone are not at singular positions, either."""
        forces = self._forces
        if forces is None or not forces.formulas or np.isfinite(seen.drive_torque).all():
            return
        segment, since = each_instant(curve, segments, dt)
        bad = np.flatnonzero(~np.isfinite(seen.drive_torque).all(axis=0))
        known = self._outside(curve, segment[bad], since[bad])
        acting = rows(forces.edges, self.coordinates, curve, segment[bad], since[bad])
        motion = seen.position[:, bad], seen.velocity[:, bad], seen.acceleration[:, bad]
        with np.errstate(all='ignore'):
            supplied = forces.required(*motion, known, acting)
        moving = np.isfinite(np.concatenate(motion)).all(axis=0)
        bad = bad[moving & ~np.isfinite(supplied).all(axis=0)]
        if bad.size:
            t = float((curve.start[segment[bad]] + since[bad]).min())
            names = ', '.join(sorted(forces.formulas))
            raise RunError(
                f'a formula leaves its range at t = {t:.9g} s: its value is not finite; see '
                f'{names}'
            )

    def _sampled(
        self,
        passage: Passage,
        curve: PiecewisePolynomial,
        segments: IndexArray,
        dt: Array,
        share: float,
    ) -> Observation:
        """The machine (K S) at S instants around each of a passage, in a share of its width.

        Law of the drive and rows of switches are those of the instant itself on both sides. Where
        the drive nearly rests, it is the positions that differ, and not the times.
        """
        assert self._forces is not None  # noqa: S101 - nobody asks otherwise
        indices = self._ideal.driven
        still = share * passage.duration > _LONG
        beside = np.where(still, 0.0, share * passage.duration)[:, None] * SAMPLES
        times = dt[:, None] + beside
        law = [curve.local(segments, times, d).T[indices] for d in range(3)]
        driven = np.array(law).reshape(3, -1, *times.shape)
        if len(indices) == 1:
            now = np.array([curve.local(segments, dt, d).T[indices] for d in range(3)])[..., None]
            width = share * passage.branch.width[:, None]
            away = width * SAMPLES * np.where(passage.pace < 0.0, -1.0, 1.0)[:, None]
            still |= (np.abs(driven[0, 0] - now[0, 0] - away) > 0.5 * width).any(axis=1)
            driven[:, 0, still] = now[:, 0, still]
            driven[0, 0, still] += away[still]
            times[still] = dt[still, None]
        q, v, a = passage.states(beside, driven)
        acting = rows(self._forces.edges, self.coordinates, curve, segments, times)
        return self._forces(q, v, a, self._outside(curve, segments, times), acting)

    def no_limits(self, motion: Motion) -> list[NoLimit]:
        """Instants of unbounded forces: those at singular positions."""
        curve, count = motion.curve, len(motion)
        if self._forces is None or not count:
            return []
        segments = np.repeat(np.arange(count), _SEARCHED)
        dt = np.outer(curve.duration, np.linspace(0.0, 1.0, _SEARCHED)).ravel()
        found = self._without_work(motion)
        near = self._ideal.branches_meet(curve.local(segments, dt).T)
        if not near.any():
            return found
        segments, dt = segments[near], dt[near]
        for turn in range(_ROUNDS):
            _, _, _, passage = self._motion(curve, segments, dt)
            if passage is None:
                return found
            segments, dt, sure = segments[passage.index], dt[passage.index], passage.branch.found
            if turn == 0:
                # since when the drive has rested, at instants in order at which no branch is known
                still, since = segments[~sure], dt[~sure]
                places = curve.at(still, since)[:, self._ideal.driven[0]]
                first = np.flatnonzero(np.abs(np.diff(places, prepend=np.inf)) > 1e-9)
                begun = curve.start[still] + since
                for k in first:
                    found.append(NoLimit(float(begun[k]), float(places[k]), self.joints, True))
            with np.errstate(divide='ignore', invalid='ignore'):
                dt = dt + passage.root / passage.pace
            within = np.clip(dt, 0.0, curve.duration[segments])
            inside = sure & (np.abs(within - dt) <= END * curve.duration[segments])
            segments, dt = segments[inside], within[inside]
            if not dt.size:
                return found
        seen = self.observe(motion, segments, dt)
        for k in np.argsort(curve.start[segments] + dt):
            forces = zip(self.joints, seen.reaction[:, :, k], strict=True)
            joints = tuple(
                j
                for j, force in forces
                if np.isnan(force).any() and not is_force_open(self.undetermined, j)
            )
            t = float(curve.start[segments[k]] + dt[k])
            one = NoLimit(t, float(seen.position[self._ideal.driven[0], k]), joints)
            if joints and not any(one.is_at(other.t) for other in found):
                found.append(one)
        return sorted(found)

    def _without_work(self, motion: Motion) -> list[NoLimit]:
        """Instants at which unknown loads do no work, so that no size of them gives balance."""
        if not self.unknowns:
            return []
        curve, count = motion.curve, len(motion)
        shares = np.linspace(0.0, 1.0, _SEARCHED)
        places = np.repeat(np.arange(count), _SEARCHED), np.outer(curve.duration, shares).ravel()
        work = np.abs(self.work_of_unknowns(motion, *places)).reshape(count, _SEARCHED)
        idle = np.pad(work[:, :-1].ravel() <= _MECHANISM.no_work, 1)
        stays = (idle[1:-1] & (idle[2:] | idle[:-2])).reshape(count, -1)
        begins = np.nonzero(stays & ~idle[:-2].reshape(count, -1))
        near = np.pad(work, ((0, 0), (1, 1)), constant_values=np.inf)
        least = (near[:, 1:-1] <= near[:, :-2]) & (near[:, 1:-1] <= near[:, 2:])
        least[:, :-1] &= ~stays
        segments, k = np.nonzero(least)
        step = curve.duration[segments] / (_SEARCHED - 1)
        low, high = (np.clip(k + j, 0, _SEARCHED - 1) * step for j in (-1, 1))
        for _ in range(_SECTIONS):  # the least of the size between two neighbours
            one, two = low + (high - low) / 3.0, high - (high - low) / 3.0
            both = np.tile(segments, 2), np.concatenate([one, two])
            a, b = np.abs(self.work_of_unknowns(motion, *both)).reshape(2, -1)
            low, high = np.where(a <= b, low, one), np.where(a <= b, two, high)
        times, end = 0.5 * (low + high), curve.duration[segments]
        times = np.where(times < END * end, 0.0, np.where(times > (1.0 - END) * end, end, times))
        idle = np.abs(self.work_of_unknowns(motion, segments, times)) <= _MECHANISM.no_work
        found = self._idle(motion, begins[0], curve.duration[begins[0]] * shares[begins[1]], True)
        for single in self._idle(motion, segments[idle], times[idle], False):
            if not any(single.is_at(other.t) for other in found):
                found.append(single)
        return sorted(found)

    def _idle(self, motion: Motion, segments: IndexArray, dt: Array, rests: bool) -> list[NoLimit]:
        """Note on instants at which unknown loads do no work, or from which on."""
        if not dt.size:
            return []
        seen, t = self.observe(motion, segments, dt), motion.curve.start[segments] + dt
        return [
            NoLimit(
                float(t[i]),
                float(seen.position[self._ideal.driven[0], i]),
                tuple(
                    np.array(self.joints)[np.isnan(seen.reaction[:, :, i]).any(axis=1)].tolist()
                ),
                rests,
                tuple(np.array([*self.unknowns])[np.isnan(seen.load[:, i])].tolist()),
            )
            for i in range(len(t))
        ]

    def work_of_unknowns(self, motion: Motion, segments: IndexArray, dt: Array) -> Array:
        """Virtual power of the unknown loads (N,), see `planar.unknowns.Unknowns.work`."""
        assert self._forces is not None  # noqa: S101 - nobody asks otherwise
        curve = motion.curve
        q, v, a, _ = self._motion(curve, segments, dt)
        acting = rows(self._forces.edges, self.coordinates, curve, segments, dt)
        outside = self._outside(curve, segments, dt)
        return self._forces.work_of_unknowns(q, v, a, outside, acting)

    def account(self, motion: Motion, segments: IndexArray, dt: Times) -> Account:
        """Terms of the energy balance, and how far the interpolated loops are open."""
        limited = len(self.driven) > 1 or bool(self.unknowns)  # one drive's torque follows without
        seen = self._observe(motion, segments, dt, limited)
        left = self._ideal.left_open(motion.curve.local(segments, dt).T)
        lost, load = seen.friction_power, None
        if self._forces is not None and self.takes_power:
            load = None if self.steep else lost
            if self._forces.loses_more:
                q, v = seen.position, seen.velocity
                lost = lost - self._load_power(q, v, motion.curve, segments, dt)
            else:
                lost = np.zeros_like(lost)
        energies = seen.kinetic_energy, seen.potential_energy
        return Account(seen.normal_force, lost, seen.drive_power, *energies, left, load)

    @property
    def takes_power(self) -> bool:
        """True if springs, dampers or loads take any power."""
        return self._forces is not None and self._forces.takes_power

    @property
    def corners(self) -> bool:
        """True with joint friction: normal forces may change their side within a segment."""
        return self._forces is not None and self._forces.loses_more

    @property
    def steep(self) -> bool:
        """True if loads may be steep within a segment, or friction may jump."""
        forces = self._forces
        return forces is not None and (forces.loses_more or forces.steep is not None)

    def load_power(self, motion: Motion, segments: IndexArray, dt: Times) -> Array:
        """Power (N,) [W] that springs, dampers and loads take."""
        q, v, _, _ = self._motion(motion.curve, segments, dt)
        return self._load_power(q, v, motion.curve, segments, dt)

    def _load_power(
        self,
        q: Array,
        v: Array,
        curve: PiecewisePolynomial,
        segments: IndexArray,
        dt: Times,
    ) -> Array:
        """Power of loads, where coordinates and rates are known."""
        assert self._forces is not None  # noqa: S101 - nobody asks otherwise
        acting = rows(self._forces.edges, self.coordinates, curve, segments, dt)
        return self._forces.load_power(q, v, self._outside(curve, segments, dt), acting)
