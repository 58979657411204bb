"""Planar impact with Coulomb friction: Newton's, Poisson's and Stronge's hypotheses.

An impact changes the rates of a contact to ``vn + Ann p + Ant q`` (normal, negative when closing)
and ``vt + Ant p + Att q`` (tangential). p >= 0 is the normal impulse, q the tangential one along
+t on the same body, and A [1/kg] is symmetric and positive definite.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.complementarity import (
    FrictionalProblem,
    Grip,
    Indices,
    determinant,
    largest,
    rates,
    solve_contacts,
    solve_frictional_lcp,
)
from mechanism_sim.numerics.kernels import kernel
from mechanism_sim.tolerances import TOLERANCES

_IMPACTS = TOLERANCES.impacts
_ROUNDING = TOLERANCES.rounding

NEWTON, POISSON, STRONGE = range(3)  # the hypotheses in arrays


class Hypothesis(Enum):
    """Hypothesis of restitution: of which quantities the coefficient e is a ratio.

    NEWTON: normal rates, ``vn+ = -e vn-``. POISSON: normal impulses of restitution and
    compression. STRONGE: works of the normal force in the two phases, ``-e^2``. They agree where
    the direction of slip never changes, without friction in particular.
    """

    NEWTON = 'newton'
    POISSON = 'poisson'
    STRONGE = 'stronge'

    @property
    def code(self) -> int:
        """Number of the hypothesis in arrays."""
        return list(Hypothesis).index(self)


class ContactImpulse(NamedTuple):
    """The impulses of one contact at one instant."""

    #: [N s]
    normal: float
    tangential: float
    slip: int  #: sign of the tangential rate afterwards, 0 if the contact sticks


class _Leg(NamedTuple):
    """A straight leg of the path of impulses, per unit of its parameter."""

    normal: float  # impulse
    tangential: float  # impulse
    rise: float  # of the normal rate
    slip: int
    length: float


class ContactCompliance(NamedTuple):
    """Rates of one contact per unit impulse [1/kg]: of normal n and tangent t, by n and by t.

    tn differs from nt only where friction in ideal joints takes part.
    """

    nn: float
    nt: float
    tn: float
    tt: float


@kernel
def impulses_of_one(
    A: ContactCompliance, vn: float, vt: float, e: float, mu: float, hypothesis: int
) -> tuple[float, float, int]:
    """The impact of a single contact, by Routh's method.

    The normal impulse grows from 0. While the contact slips, ``dq = -mu sign(vt) dp``. When vt
    reaches 0 (or is 0 from the start) it sticks, ``dq = -Ant/Att dp``, if ``|Ant| <= mu Att``, and
    else slips on with the sign of Ant, for good. So the path of (p, q) has at most two straight
    legs, and on the last of them vn rises; it ends where the hypothesis says. On the first leg vn
    may fall (``Ann < mu |Ant|``, the approach jams); it recovers on the second. A contact that
    does not close (vn >= 0) gets no impulse. (E. J. Routh, Dynamics of a System of Rigid Bodies,
    1905; J. B. Keller, J. Appl. Mech. 53, 1986; W. J. Stronge, Proc. R. Soc. A 431, 1990.)

    Smooth (mu = 0): ``p = -(1 + e) vn/Ann``, ``q = 0`` ([SB] 5.4-2 for the smooth case).

    Rough (mu = inf): the limit of a large mu. On the first leg q alone grows until vt = 0; the
    second leg sticks, and with Newton's hypothesis ends at ``vn+ = -e vn``, ``vt+ = 0`` ([SB]
    5.3.2). If the first leg alone would lift vn above ``-e vn``, where [SB] 5.4-3 has p < 0, then
    p = 0 and q lifts it just that far; some slip remains.

    Poisson's and Stronge's hypotheses never raise the energy, nor does Newton's for e = 0 or where
    the direction of slip never changes. Else Newton's may (Kane's paradox; T. R. Kane and D. A.
    Levinson, Dynamics, 1985). An impact that slips first and sticks in the end changes the energy
    by ``-((1 - e^2) Att vn^2 - 2 Ant vn vt + Ann vt^2)/(2 D)``, ``D = Ann Att - Ant^2``, which can
    be positive only if ``e^2 > D/(Ann Att)``. None that turned its slip was found to beat that.

    Parameters
    ----------
    vn, vt : rates before [m/s]
    e, mu : coefficients of restitution and friction, 0 smooth and `math.inf` rough ([SB] 5.3)

    Returns
    -------
    normal and tangential impulse, and sign of the slip afterwards; the first is NaN where no
    finite impulse ends the approach: A is singular and the contact is wedged
    """
    if vn >= 0.0:
        return 0.0, 0.0, _sign(vt)
    rebound = -e * vn
    if mu == 0.0:
        p = (1.0 + e) * -vn / A.nn
        return p, 0.0, _sign(vt + A.tn * p)
    slide = _slide(A, vt, mu)
    if slide.rise > 0.0 and vn + slide.rise * slide.length >= rebound:
        x = (1.0 + e) * -vn / slide.rise
        return slide.normal * x, slide.tangential * x, slide.slip
    last = _last(A, mu, slide)
    if last.rise <= 0.0:
        return math.nan, 0.0, 0
    turn = vn + slide.rise * slide.length  # normal rate where slip stops
    p, q = slide.normal * slide.length, slide.tangential * slide.length
    if hypothesis == NEWTON:
        more = (rebound - turn) / last.rise
    elif hypothesis == POISSON:
        if turn < 0.0:
            more = e * p - (1.0 + e) * turn / last.rise
        else:
            more = slide.normal * (rebound - turn) / slide.rise
    else:
        # `square` is that of the final normal rate; it grows with the work at twice the rise
        if turn < 0.0:
            square = e * e * (turn * turn - last.rise * p * (vn + turn))
        else:
            left = slide.normal * (rebound * rebound - turn * turn) / slide.rise
            square = turn * turn + last.rise * left
        more = (math.sqrt(square) - turn) / last.rise
    return p + more, q + last.tangential * more, last.slip


def jam(Ann: float, Ant: float, Att: float, vt: float, friction: float) -> ContactImpulse:
    """Impact without collision: the impact of a closed contact (vn = 0) that slips and jams.

    Where ``Ann - mu sign(vt) Ant < 0``, friction presses the bodies together faster than the
    normal force parts them, and no finite force is consistent (P. Painleve, 1895). The normal
    impulse grows until vt = 0, and then until vn is back at 0; there the contact sticks. This is
    `impulses_of_one` for e = 0 as vn rises to 0: there is no restitution, and energy never rises.
    A contact that does not jam gets no impulse.

    Parameters
    ----------
    Ann, Ant, Att : [1/kg]
    vt : rate before [m/s]
    friction : Coulomb's coefficient

    Raises
    ------
    ArithmeticError
        If no finite impulse ends the approach: A is singular and the contact is wedged.
    """
    A = ContactCompliance(Ann, Ant, Ant, Att)
    slide = _slide(A, vt, friction)
    if slide.slip == 0 or slide.rise >= 0.0:
        return ContactImpulse(0.0, 0.0, slide.slip)
    last = _last(A, friction, slide)
    if last.rise <= 0.0:
        raise ArithmeticError('a contact is wedged: no finite impulse ends its approach')
    more = -slide.rise * slide.length / last.rise
    return ContactImpulse(
        slide.normal * slide.length + more,
        slide.tangential * slide.length + last.tangential * more,
        last.slip,
    )


def shock(
    A: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike,
    friction: Sequence[float],
) -> list[ContactImpulse]:
    """Impact without collision of m contacts that no forces can keep while they slide on.

    For one contact that is `jam`. Several follow the limit of small steps: over a time h the
    impulses obey Coulomb's law with the slip at its end, and every normal rate ends at zero or
    above, ``w = A x + rate + h acceleration`` (J. J. Moreau, 1988; D. E. Stewart, Convergence of
    a time-stepping scheme for rigid-body dynamics and resolution of Painleve's problem, Arch.
    Ration. Mech. Anal. 145, 1998). If forces kept the slip, impulses would vanish with h; as none
    do, they tend to finite ones that stop or turn some slip. That is the compression phase of
    `simultaneous_impulses` at no approach speed: there is no restitution and energy never rises.

    Parameters
    ----------
    A : (2m, 2m) rates per unit impulse [1/kg], all normals first
    rate : (2m,) before [m/s]; normal ones are not negative
    acceleration : (2m,) without contact forces [m/s^2]
    friction : (m,) Coulomb's coefficients; infinite where it is known that the contact jams

    Raises
    ------
    ArithmeticError
        If no slip is left to be stopped, or A is singular and no finite impulses exist.
    """
    m = len(friction)
    matrix, before, pull = np.array(A), np.array(rate), np.array(acceleration)
    if m == 1:
        (Ann, Ant), (_, Att) = matrix.tolist()
        stopped = jam(Ann, Ant, Att, float(before[1]), _IMPACTS.firmer * friction[0])
        if not stopped.normal:
            raise ArithmeticError('a contact that does not jam cannot be freed by an impact')
        return [stopped]
    slip = np.abs(before[m:]).max()
    if not slip > 0.0:
        raise ArithmeticError('contacts that do not slide cannot be freed by an impact')
    h = _IMPACTS.instant * slip / np.abs(pull).max()
    firmer = [_IMPACTS.firmer * mu for mu in friction]
    rough, grips = solve_frictional_lcp(matrix, before + h * pull, firmer)
    # what each contact does is known now: the same without what happens within h
    columns, rows = [], []
    for i, grip in enumerate(grips):
        if grip is Grip.OPEN:
            continue
        sign = {Grip.FORWARD: 1.0, Grip.BACKWARD: -1.0}.get(grip, 0.0)
        column = np.zeros(2 * m)
        slides = (0.0, -sign) if friction[i] == math.inf else (1.0, -friction[i] * sign)
        column[[i, m + i]] = slides if sign else (1.0, 0.0)
        columns.append(column)
        rows.append(i)
        if grip is Grip.STICK and friction[i]:
            columns.append(np.eye(2 * m)[m + i])
            rows.append(m + i)
    basis = np.array(columns).reshape(-1, 2 * m).T
    start = np.linalg.lstsq(basis, rough, rcond=None)[0]
    off = -(before + matrix @ (basis @ start))[rows]
    impulses = basis @ (
        start + np.linalg.lstsq((matrix @ basis)[rows], off, rcond=_IMPACTS.shock_rank)[0]
    )
    impulses[:m] = np.maximum(impulses[:m], 0.0)
    if not np.abs(matrix @ impulses).max() > _IMPACTS.frees * slip:
        raise ArithmeticError('contacts that do not jam cannot be freed by an impact')
    return contact_impulses(matrix, before, impulses)


@kernel
def _slides(friction: Array, slip: Indices) -> tuple[Array, Indices]:
    """Impulses that m closed contacts may push with, and the rows that they keep at zero.

    Parameters
    ----------
    friction : (m,) Coulomb's coefficients
    slip : (m,) signs of the slips, 0 where a contact sticks

    Returns
    -------
    (2m, k) columns of impulses: a normal one with the friction of its slip for every contact, and
    a tangential one for every contact that sticks; and the k rows
    """
    m = k = len(friction)
    basis, rows = np.zeros((2 * m, 2 * m)), np.arange(2 * m)
    for i in range(m):
        basis[i, i] = 1.0
        if slip[i] != 0:
            basis[m + i, i] = -friction[i] * slip[i]
        elif friction[i] != 0.0:
            basis[m + i, k], rows[k] = 1.0, m + i
            k += 1
    return basis[:, :k].copy(), rows[:k]


@kernel
def jam_margin(A: Array, friction: Array, slip: Indices) -> float:
    """Determinant of the equations of closed contacts over that without friction of what slides.

    Where it is 0 or less, forces do not settle: the friction of sliding contacts jams them.
    """
    m, margin = len(friction), 1.0
    basis, rows = _slides(friction, slip)
    kept = np.empty((len(rows), len(rows)))
    for smooth in (False, True):
        if smooth:
            basis[m:, :m] = 0.0
        for i in range(len(rows)):
            for k in range(len(rows)):
                kept[i, k] = 0.0
                for r in range(2 * m):
                    kept[i, k] += A[rows[i], r] * basis[r, k]
        margin = margin / determinant(kept) if smooth else determinant(kept)
    return margin


def stop_slide(
    A: ArrayLike, rate: ArrayLike, friction: Sequence[float], slip: Sequence[int]
) -> list[ContactImpulse]:
    """Impact without collision of m closed contacts at the instant at which their sliding jams.

    There the equations of their forces become singular: impulses along the null vector change no
    rate that is kept at zero. They grow, by however small a force they were begun, until the first
    slip has stopped. (F. Genot and B. Brogliato, New results on Painleve paradoxes, Eur. J. Mech.
    A 18, 1999; A. Nordmark, P. L. Varkonyi, A. R. Champneys, Dynamics beyond dynamic jam, SIAM J.
    Appl. Dyn. Syst. 17, 2018, where a contact that is a little elastic ends likewise whether its
    force grew beyond bounds or not.) For one contact that is `jam`.

    Parameters
    ----------
    A : (2m, 2m) rates per unit impulse [1/kg], all normals first
    rate : (2m,) before [m/s]
    friction : (m,) Coulomb's coefficients
    slip : (m,) signs of the slips, 0 where a contact sticks

    Raises
    ------
    ArithmeticError
        If no such impulses are compressive, or none stop any slip.
    """
    m = len(friction)
    matrix, before = np.array(A, dtype=float), np.array(rate, dtype=float)
    basis, rows = _slides(np.array(friction, dtype=float), np.array(slip, dtype=np.int64))
    path = basis @ np.linalg.svd((matrix @ basis)[rows])[2][-1]
    normals = path[:m] * math.copysign(1.0, path[:m].sum())
    if normals.min() < -_IMPACTS.pull * normals.max():
        raise ArithmeticError('forces of both signs grow without limit')
    change = (matrix @ path)[m:] * math.copysign(1.0, path[:m].sum())
    stops = [
        (abs(before[m + i]) / -(slip[i] * change[i]), i)
        for i in range(m)
        if slip[i] * change[i] < -_IMPACTS.stops * np.abs(change).max()
    ]
    if not stops:
        raise ArithmeticError('contacts are wedged: no finite impulse stops their slip')
    first = min(stops)[1]
    pulls = np.zeros((2 * m, 1))
    pulls[m + first] = 1.0
    basis, rows = np.hstack([basis, pulls]), np.append(rows, m + first)
    impulses = (
        basis @ np.linalg.lstsq((matrix @ basis)[rows], -before[rows], rcond=_IMPACTS.jam_rank)[0]
    )
    return contact_impulses(matrix, before, impulses)


@kernel
def _slide(A: ContactCompliance, vt: float, mu: float) -> _Leg:
    """The first leg: slip as it was, until vt = 0; a rough contact needs no p for that."""
    slip = _sign(vt)
    p = 0.0 if mu == math.inf else 1.0
    q = -float(slip) if mu == math.inf else -mu * slip
    slowing = -slip * (A.tn * p + A.tt * q)
    length = abs(vt) / slowing if slowing > 0.0 else math.inf
    return _Leg(p, q, A.nn * p + A.nt * q, slip, length if slip else 0.0)


@kernel
def _last(A: ContactCompliance, mu: float, slide: _Leg) -> _Leg:
    """The second leg, without end: stick, or slip on with the sign of A.tn; no rise: wedged."""
    sticks = A.tn == 0.0 or abs(A.tn) <= mu * A.tt
    slip = 0 if sticks else _sign(A.tn)
    q = -mu * slip if slip else -A.tn / A.tt if A.tn else 0.0
    rise = A.nn + A.nt * q if slide.length < math.inf else 0.0
    return _Leg(1.0, q, rise, slip, math.inf)


@kernel
def _sign(x: float) -> int:
    return 1 if x > 0.0 else -1 if x < 0.0 else 0


@kernel
def simultaneous_impulses(
    A: Array, rate: Array, e: Array, friction: Array, hypothesis: Indices
) -> tuple[Array, bool]:
    """The impulses of m contacts that touch at one instant.

    Rows and columns are ordered all normals first, then all tangentials; the tangential rows of a
    frictionless contact may be 0.

    If all hypotheses are Newton's, in Moreau's form: ``p >= 0``, ``vn+ + e vn >= 0``,
    ``p (vn+ + e vn) = 0``, and Coulomb's law holds between p, q and vt+. (J. J. Moreau, Unilateral
    contact and dry friction in finite freedom dynamics, 1988.)

    If any is not, in two phases (C. Glocker and F. Pfeiffer, Nonlinear Dynamics 7, 1995).
    Compression is the above with e = 0 throughout and yields impulses pc. In expansion a contact
    gets at least ``e pc``, and more only to end with vn+ = 0. Coulomb's law holds in each phase;
    there is no tangential restitution. Stronge's hypothesis is defined for a single contact only
    and counts as Poisson's here. A contact under Newton's, among others, expands without a least
    impulse, so as to end with ``vn+ >= -e vn`` if it was closing.

    Both look at slip at the end of the impact or phase only, `impulses_of_one` all the way. For
    m = 1 they agree with it where the direction of slip does not change. A rough contact (mu =
    inf) that is pressed sticks; else it is the limit of a large mu, as in `impulses_of_one`.

    Energy never rises

    - in Moreau's form if e = 0 for all; or if nothing has friction and e is the same for all or no
      contact separates beforehand;
    - in two phases, Newton's contacts apart, if e is the same for all or nothing has friction.

    Else it may: with friction in Moreau's form as in `impulses_of_one`, and with friction and
    different e in two phases.

    Parameters
    ----------
    A : (2m, 2m) rates per unit impulse [1/kg], symmetric positive semidefinite
    rate : (2m,) before [m/s]
    e, friction, hypothesis : (m,)

    Returns
    -------
    impulses (2m,), and whether there are any to rounding. That there are none takes a singular A,
    with friction and e > 0 in Moreau's form: the bodies are wedged and cannot part at the rates
    that e asks for.
    """
    m = len(e)
    slip, least, b = np.zeros(m, dtype=np.int64), np.zeros(2 * m), rate.copy()
    newton = True
    for i in range(m):
        newton = newton and hypothesis[i] == NEWTON
    if newton:
        for i in range(m):
            b[i] *= 1.0 + e[i]
        x, _, found = solve_contacts(FrictionalProblem(A, b, friction, slip, least))
        return x, found
    x, _, found = solve_contacts(FrictionalProblem(A, b, friction, slip, least))
    if not found:
        return x, False
    b = rates(A, x, rate)
    for r in range(2 * m):
        size = abs(rate[r])
        for c in range(2 * m):
            size += abs(A[r, c]) * largest(x)
        if abs(b[r]) <= _ROUNDING.solved * size:
            b[r] = 0.0
    for i in range(m):
        if hypothesis[i] == NEWTON:
            b[i] += e[i] * min(rate[i], 0.0)
        else:
            least[i], least[m + i] = e[i] * x[i], e[i] * x[m + i]
    more, _, found = solve_contacts(FrictionalProblem(A, b, friction, slip, least))
    for r in range(2 * m):
        x[r] += more[r]
    return x, found


def contact_impulses(A: Array, before: Array, impulses: Array) -> list[ContactImpulse]:
    """Impulses (2m,) by contacts; a slip within rounding of zero is none."""
    m, after = len(before) // 2, before + A @ impulses
    size = np.abs(before) + np.abs(A).sum(axis=1) * np.abs(impulses).max()
    slips = np.where(np.abs(after) > _ROUNDING.solved * size, np.sign(after), 0.0)[m:]
    return [
        ContactImpulse(float(p), float(q), int(slip))
        for p, q, slip in zip(impulses[:m], impulses[m:], slips, strict=True)
    ]
