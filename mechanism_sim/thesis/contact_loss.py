"""Criteria of contact loss from the literature, by the forces of the ideal mechanism.

[SB] 3.5 collects them. All take F, the force of the pin on its bushing in the mechanism without
clearance, with magnitude R and direction gamma, over one turn of the crank. Four are given as [SB]
reports them; if it gives no number for a limit, the limit is this project's and an argument:

- `small_force`: R is small ([SB]'s second method);
- `polar_plot`: the plot of F passes through the origin (Wu and Earles 1972, [SB]'s [3]);
- `turn_over_least_force`: ``gamma'/R > 1 rad/(N s)`` at minima of R (Wu and Earles 1975, [4]);
- `unit_turn_over_force`: contact is lost when ``gamma'/R = 1 rad/(N s)`` (Grant and Fawcett 1977,
  [84]).

No clearance enters these. The last two compare a number that has a unit with 1: where inertia
rules, it falls as the machine runs faster. [SB] quotes Haines [83]: impacts at 0.32, none at 220.

Three more know the clearance c. They put a massless link of length c and direction eta between
bushing and pin ([3], [8]), which can only press ([8]). How they judge it is derived here. A pin
that stands off by Q = c n, n = u(eta), t = v(eta), displaces the free links by B Q; B inverts the
Jacobian J of the clearance vector. With the inertias I of the free links, to leading order in c,

    m (c eta'' t - c eta'^2 n) + H c eta' t = F - N n,   m = B^T I B,   H = 2 B^T I B' + B^T D B

by which free links of the rates w resist: D = -dQ/dw, from the generalised forces Q of dampers
and loads. The left side moves the pin against the bushing; the right side is what the contact
force N leaves of the force of the ideal mechanism. Across and along the link, a pendulum in the
field of F:

    m_tt c eta'' = F.t + m_tn c eta'^2 - H_tt c eta'
    N = F.n + m_nn c eta'^2 - m_nt c eta'' - H_nt c eta'

Left out are terms of the order m c w^2 beside F, with the speed w of the crank. The H term is
small too, but it works like a damping of either sign: in the course of a turn it changes the
swings of the link by a part of their own size that does not shrink with the clearance.

- `turning_link`: N if the link rotated with the force, eta = gamma. For a mass that is the same
  in all directions, without H, that is more than R: a loss needs a link that does *not* follow.
- `lagging_link`: the lag of a link that turns as the force does, ``R sin(lag) = m_tt c gamma'' -
  m_tn c gamma'^2 + H_tt c gamma'``. Where the sine would have to exceed 1, the link falls behind.
  Below that contact may be lost all the same, by swings that add up.
- `free_link`: the pendulum itself, integrated until N falls through zero. It has no friction; with
  little damping it depends on its start as the machine does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.linkages.four_bar import FourBar, FourBarLoop
from mechanism_sim.planar.inverse_dynamics import InverseDynamics
from mechanism_sim.report.sections import Section, text
from mechanism_sim.results.run import is_loss
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from mechanism_sim.scene.validation import validate_loose
from mechanism_sim.strict_json import plain
from mechanism_sim.thesis.force_cycle import (
    TURN,
    ForceCycle,
    length,
    resolve,
    root,
    tip,
    with_tips,
)

_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Prediction:
    """Prediction of one criterion for a turn of the crank."""

    criterion: str
    angles: tuple[float, ...]  #: crank angles of predicted losses of contact [rad], in [0, 2 pi)
    figure: float  #: value compared with the threshold
    unit: str  #: unit of both
    threshold: float
    predicts_loss: bool


@dataclass(frozen=True)
class ClearanceLink:
    """The clearance as a massless link between the centres of bushing and pin."""

    radial: float  #: clearance [m], the length of the link
    #: function of crank angles (N,): effective mass m [kg] of the pin's relative motion, and 2 B^T
    #: I dB/d(crank angle) [kg/rad], both (2, 2, N) in fixed axes
    inertia: Callable[[Array], tuple[Array, Array]]
    #: function of crank angles (N,): damping matrix B^T D B (2, 2, N) [N s/m]
    damping: Callable[[Array], Array] | None = None

    def felt(self, angle: Array, speed: float) -> tuple[Array, Array]:
        """Effective mass m [kg] at crank angles (N,), and H over the crank's speed [kg/rad]."""
        m, transport = self.inertia(angle)
        if self.damping is not None:
            transport = transport + self.damping(angle) / speed
        return m, transport

    @classmethod
    def four_bar(
        cls,
        radial: float,
        linkage: FourBar,
        coupler_inertia: float,
        rocker_inertia: float,
        resistance: Callable[[Array], Array] | None = None,
    ) -> ClearanceLink:
        """Clearance link between coupler and rocker of a four-bar with a prescribed crank.

        Parameters
        ----------
        coupler_inertia, rocker_inertia : about the crank pin and the frame's pivot [kg m^2]
        resistance : D (2, 2, N) [N m s] of coupler and rocker at crank angles (N,), if any
        """
        links = np.diag([coupler_inertia, rocker_inertia])

        def displacing(angle: Array) -> tuple[Array, Array]:
            """B and dJ/d(crank angle), (N, 2, 2)."""
            one = np.ones_like(angle)
            (_, th3, th4), (_, w3, w4), _ = linkage.motion(angle, one, 0.0 * one)
            l3, l4 = linkage.coupler, linkage.rocker
            jacobian = np.array(
                [[-l3 * np.sin(th3), l4 * np.sin(th4)], [l3 * np.cos(th3), -l4 * np.cos(th4)]]
            )
            change = np.array(
                [
                    [-l3 * np.cos(th3) * w3, l4 * np.cos(th4) * w4],
                    [-l3 * np.sin(th3) * w3, l4 * np.sin(th4) * w4],
                ]
            )
            return np.linalg.inv(jacobian.transpose(2, 0, 1)), change.transpose(2, 0, 1)

        def inertia(angle: Array) -> tuple[Array, Array]:
            B, dJ = displacing(angle)
            left = B.transpose(0, 2, 1) @ links
            m, transport = left @ B, -2.0 * left @ B @ dJ @ B
            return m.transpose(1, 2, 0), transport.transpose(1, 2, 0)

        if resistance is None:
            return cls(radial, inertia)

        def damping(angle: Array) -> Array:
            B, _ = displacing(angle)
            D = resistance(angle).transpose(2, 0, 1)
            return np.asarray((B.transpose(0, 2, 1) @ D @ B).transpose(1, 2, 0))

        return cls(radial, inertia, damping)


@dataclass(frozen=True)
class PinFollowing:
    """Contact of a free clearance link from its start to the first loss of contact."""

    turned: float | None  #: crank rotation until loss of contact [rad]; None without loss
    angle: float | None  #: crank angle at the loss [rad], in [0, 2 pi)
    least_force: float  #: smallest contact force until then [N]; 0 at the loss


def contact_loss(
    cycle: ForceCycle,
    link: ClearanceLink | None = None,
    *,
    start: float = 0.0,
    turns: float = 3.0,
) -> list[Prediction]:
    """All criteria that can be evaluated; those of the clearance link need `link`.

    Parameters
    ----------
    start, turns : initial crank angle [rad] and number of turns of the free link's integration
    """
    found = [
        small_force(cycle),
        polar_plot(cycle),
        turn_over_least_force(cycle),
        unit_turn_over_force(cycle),
    ]
    if link is not None:
        found += [
            turning_link(cycle, link),
            lagging_link(cycle, link),
            free_link(cycle, link, start=start, turns=turns),
        ]
    return found


def small_force(cycle: ForceCycle, fraction: float = 0.1) -> Prediction:
    """The force drops to the neighbourhood of zero ([SB] 3.5, second method).

    [SB] means the force in the following mode and gives no number. Here it is the ideal force,
    relative to its mean over time; the fraction is this project's. The angles are those where the
    force falls below it; the figure is the exact minimum.
    """
    level = fraction * cycle.mean
    spans = cycle.spans(lambda x: level - cycle.magnitude(x))
    figure = min(m.force for m in cycle.minima) / cycle.mean
    angles = tuple(begin for begin, _ in spans)
    return Prediction('small force', angles, figure, '1', fraction, figure < fraction)


def polar_plot(cycle: ForceCycle, nearness: float = 0.01) -> Prediction:
    """The polar plot of the force passes the origin with a finite slope (Wu and Earles 1972).

    A computed plot never meets the origin exactly: it passes if its distance, as a share of the
    largest force, is less than `nearness`, which is this project's. A cusp there, of a force that
    vanishes without a definite slope, does not count.
    """
    minima = np.array([m.angle for m in cycle.minima])
    distance = cycle.magnitude(minima) / cycle.maximum[1]
    slope = length(cycle.curve(minima, 1)) / cycle.maximum[1]
    passes = (distance < nearness) & (slope > 1e-9)
    angles = tuple(float(angle) for angle in minima[passes])
    figure = float(distance.min())
    return Prediction('polar plot through origin', angles, figure, '1', nearness, bool(angles))


def turn_over_least_force(cycle: ForceCycle, threshold: float = 1.0) -> Prediction:
    """Fast rotation of the force at its minima: gamma'/R_min > 1 rad/(N s).

    Wu and Earles 1975, as in [SB] 3.5. The angles are the minima of the force with such an index.
    """
    figure = max(m.index for m in cycle.minima)
    angles = tuple(m.angle for m in cycle.minima if m.index > threshold)
    return Prediction(
        'turn over least force', angles, figure, 'rad/(N s)', threshold, bool(angles)
    )


def unit_turn_over_force(cycle: ForceCycle, level: float = 1.0) -> Prediction:
    """Contact is lost at the instants when gamma'/R = 1 rad/(N s).

    Grant and Fawcett 1977, as in [SB] 3.5. The angles are those where the index rises through the
    level in the direction of a growing crank angle, or falls in that direction for a crank that
    turns backwards; in any case it rises in time. An index above it throughout predicts a loss
    without an instant.
    """
    spans = index_spans(cycle, level)
    forward = cycle.speed > 0.0
    angles = tuple(sorted(begin if forward else end for begin, end in spans))
    figure = max(cycle.largest(cycle.index)[1], *(m.index for m in cycle.minima))
    return Prediction('unit turn over force', angles, figure, 'rad/(N s)', level, figure > level)


def index_spans(cycle: ForceCycle, level: float = 1.0) -> list[tuple[float, float]]:
    """Spans of crank angle [rad] in which gamma'/R exceeds a level [rad/(N s)].

    A force that passes exactly through the origin without rotation makes an empty span.
    """
    scale = cycle.maximum[1] * float(length(cycle.rates(cycle.grid).first).max())

    def excess(angle: Array) -> Array:
        # Both sides times R^3, so that nothing is divided by a force that may vanish.
        rates = cycle.rates(angle)
        swept = np.abs(rates.swept)
        swept[swept < 64.0 * _EPS * scale] = 0.0
        return swept - level * rates.magnitude**3

    found = cycle.spans(excess)
    through = np.array([m.angle for m in cycle.minima if m.index > level])
    missed = through[excess(through) <= 0.0] if through.size else through
    return sorted([*found, *((float(x), float(x)) for x in missed)])


def turning_link(cycle: ForceCycle, link: ClearanceLink) -> Prediction:
    """Contact force of a clearance link that rotates with the force; losses where it is tensile.

    Derived here, see above: N = R + m_nn c gamma'^2 - m_nt c gamma'' - H_nt c gamma'.
    """

    def pull(angle: Array) -> Array:
        return -_turning(cycle, link, angle)[0]

    figure = -cycle.largest(pull)[1]
    angles = tuple(begin for begin, _ in cycle.spans(pull))
    return Prediction('link turning with force', angles, figure, 'N', 0.0, figure < 0.0)


def lagging_link(cycle: ForceCycle, link: ClearanceLink) -> Prediction:
    """Sine of the lag at which a clearance link would rotate with the force.

    Derived here, see above. The angles are those at which it rises above 1.
    """

    def sine(angle: Array) -> Array:
        _, across, force = _turning(cycle, link, angle)
        with np.errstate(divide='ignore'):
            return np.asarray(np.abs(across) / force)

    figure = cycle.largest(sine)[1]
    angles = tuple(begin for begin, _ in cycle.spans(lambda x: sine(x) - 1.0))
    return Prediction('sine of lag', angles, figure, '1', 1.0, figure > 1.0)


def free_link(
    cycle: ForceCycle, link: ClearanceLink, start: float = 0.0, turns: float = 3.0
) -> Prediction:
    """Free motion of the clearance link under the force until the contact force becomes tensile.

    Derived here, see above; for the start and the number of turns see `follow`.
    """
    run = follow(cycle, link, start, turns)
    angles = () if run.angle is None else (run.angle,)
    return Prediction('free link', angles, run.least_force, 'N', 0.0, run.angle is not None)


def follow(
    cycle: ForceCycle,
    link: ClearanceLink,
    start: float = 0.0,
    turns: float = 3.0,
    rate: float | None = None,
) -> PinFollowing:
    """Integrate the direction of a clearance link under compression, until detachment.

    It starts in the direction of the force, as in [SB] 3.4 and scenes with ``start: seated``.

    Parameters
    ----------
    start : crank angle [rad]
    turns : largest number of crank turns
    rate : initial rate of the link [rad/s]; default: that of free links at their ideal rates,
        -t.(J B') n
    """
    here = np.array([start])
    speed = cycle.speed
    way = math.copysign(1.0, speed)
    force = cycle.curve(here, 0)[:, 0]
    if not math.hypot(*force) > _EPS * cycle.maximum[1]:
        raise InputError(f'no force gives the clearance link a direction at {start:.9g} rad')
    eta = math.atan2(force[1], force[0])
    m, transport = (x[:, :, 0] for x in link.inertia(here))
    if rate is None:
        n, t = np.array([math.cos(eta), math.sin(eta)]), np.array([-math.sin(eta), math.cos(eta)])
        rate = float(-t @ np.linalg.solve(m, 0.5 * speed * transport @ n))
    inertia = resolve(
        lambda x: np.concatenate([part.reshape(4, -1) for part in link.felt(x, speed)]),
        'the inertia of the clearance link',
    )

    def swing(turned: Array, y: Array) -> tuple[Array, Array]:
        """Contact force (N,) [N], and derivatives of direction and rate by the crank rotation."""
        angle = start + way * turned
        m11, m12, _, m22, h11, h12, h21, h22 = inertia(angle)
        fx, fy = cycle.curve(angle, 0)
        w = cycle.speed
        nx, ny, c = np.cos(y[0]), np.sin(y[0]), link.radial
        mnx, mny, mtx, mty = (
            m11 * nx + m12 * ny, m12 * nx + m22 * ny, m12 * nx - m11 * ny, m22 * nx - m12 * ny
        )  # fmt: skip
        fx = fx + c * y[1] * (y[1] * mnx - w * (h12 * nx - h11 * ny))
        fy = fy + c * y[1] * (y[1] * mny - w * (h22 * nx - h21 * ny))
        turn = (fy * nx - fx * ny) / (c * (mty * nx - mtx * ny))
        contact = (fx - c * turn * mtx) * nx + (fy - c * turn * mty) * ny
        return contact, np.array([y[1], turn]) / np.abs(w)

    state = np.array([eta, rate])
    least = float(swing(np.zeros(1), state[:, None])[0][0])
    if least <= 0.0:
        return PinFollowing(0.0, start % TURN, least)
    # The initial state of an aligned link at rest does not show its frequency.
    period = abs(speed) * math.sqrt(link.radial * float(np.trace(m)) / math.hypot(*force))
    solver = scipy.integrate.DOP853(
        lambda x, y: swing(np.array([x]), y[:, None])[1][:, 0], 0.0, state, TURN * turns,
        rtol=1e-10, atol=1e-10 * np.array([1.0, abs(speed)]),
        first_step=min(0.1 * period, TURN * turns),
    )  # fmt: skip
    while solver.status == 'running':
        solver.step()
        path = solver.dense_output()

        def pull(x: Array, path: Callable[[Array], Array] = path) -> Array:
            return -swing(x, path(x))[0]

        x, values = with_tips(pull, np.linspace(solver.t_old, solver.t, 7), closed=False)
        lost = np.flatnonzero(values > 0.0)
        if lost.size:
            turned = root(pull, x[lost[0] - 1], x[lost[0]])
            return PinFollowing(turned, (start + way * turned) % TURN, 0.0)
        if -values.max() < least:
            i = int(values.argmax())
            highest = tip(pull, x[max(i - 1, 0)], x[min(i + 1, len(x) - 1)])[1]
            least = -max(highest, float(values[i]))
    if solver.status == 'failed':
        raise RunError(f'the clearance link could not be followed to {solver.t:.9g} rad')
    return PinFollowing(None, None, least)


def _turning(cycle: ForceCycle, link: ClearanceLink, angle: Array) -> tuple[Array, Array, Array]:
    """Contact force, transverse force and force R (N,) [N] of a link rotating with the force."""
    rates = cycle.rates(angle)
    rate, turn = rates.turn()
    force = rates.magnitude
    m, transport = link.felt(angle, cycle.speed)
    H = cycle.speed * transport
    with np.errstate(invalid='ignore'):
        n = rates.force / force
        t = np.array([-n[1], n[0]])
        push = np.einsum('ijk,jk->ik', m, turn * t - rate**2 * n)
        push += np.einsum('ijk,jk->ik', H, rate * t)
        contact = force - link.radial * (n * push).sum(axis=0)
        across = link.radial * (t * push).sum(axis=0)
    some = force > 0.0
    return np.where(some, contact, 0.0), np.where(some, across, np.inf), force


@dataclass(frozen=True)
class Losses:
    """Predicted and simulated losses of contact in a clearance joint."""

    joint: str
    #: predictions by the criteria of [SB] 3.5 and by the clearance link
    predictions: tuple[Prediction, ...]
    turns: tuple[float, ...]  #: turns of the crank from the start to each loss of contact


def losses(machine: Machine, revolutions: float = 3.0) -> list[Losses]:
    """Predicted and simulated losses for every clearance joint.

    The criteria of the clearance link exist for the joint between coupler and rocker only.
    """
    validate_loose(machine, 'criteria need')
    angle, speed = machine.drive.start
    predictions = _predicted(machine, angle, speed, revolutions)
    solution = simulate(machine, revolutions=revolutions)
    found = []
    for joint, predicted in predictions.items():
        turns = [
            m.t * abs(speed) / (2.0 * math.pi)
            for m in solution.modes
            if m.joint == joint and is_loss(m)
        ]
        found.append(Losses(joint, tuple(predicted), tuple(turns)))
    return found


def _predicted(
    machine: Machine, angle: float, speed: float, revolutions: float
) -> dict[str, list[Prediction]]:
    """Predictions by clearance joint of a four-bar, from a crank angle [rad], at a speed."""
    loop, dynamics = machine.nominal.four_bar, machine.nominal.inverse_dynamics
    acting = ', '.join(e.name for e in dynamics.elements)
    beside = {'time' if x == 'time' else 'states' for x in dynamics.outside if '.turns' not in x}
    if beside:
        raise InputError(
            f'{machine.name}: criteria need forces that follow from the crank angle, which those '
            f'of {acting} do not: they depend on {" and ".join(sorted(beside))}; leave them out, '
            f'or give them by {loop.links[0]}'
        )
    if np.isnan(loop.linkage.positions(np.array([0.0, math.pi]))).any():
        raise InputError(f'{machine.name}: criteria need a crank that makes full turns')
    between = {j.name: {j.first, j.second} for j in dynamics.mechanism.joints}
    predictions = {}
    try:
        for joint, clearance in machine.plan.clearances.items():
            cycle = ForceCycle.nominal(loop, dynamics, joint, speed)
            link = None
            if between[joint] == {*loop.links[1:]}:
                link = _clearance_link(clearance.radial, loop, dynamics, speed)
            predictions[joint] = contact_loss(cycle, link, start=angle, turns=revolutions)
    except InputError as error:
        advice = f'; of {acting} leave out, or smooth, what steps, has corners or counts turns'
        raise InputError(
            f'{machine.name}: criteria cannot be judged, for {error}{advice if acting else ""}'
        ) from error
    return predictions


def _clearance_link(
    radial: float, loop: FourBarLoop, dynamics: InverseDynamics, speed: float
) -> ClearanceLink:
    """Clearance link between coupler and rocker of an ideal four-bar, at a crank speed [rad/s]."""
    bodies = [dynamics.mechanism.body(link) for link in loop.links[1:]]
    about = [b.inertia + b.mass * (b.cog[0] ** 2 + b.cog[1] ** 2) for b in bodies]
    coordinates = dynamics.mechanism.coordinates
    order = [loop.links.index(c) for c in coordinates]
    free = np.array([coordinates.index(link) for link in loop.links[1:]])

    def resistance(angle: Array) -> Array:
        q, v, _ = loop.motion(angle, np.full_like(angle, speed), np.zeros_like(angle))
        return np.asarray(dynamics.damping(q[order], v[order])[free[:, None], free])

    return ClearanceLink.four_bar(
        radial, loop.linkage, about[0], about[1], resistance if dynamics.elements else None
    )


def render(found: Sequence[Losses]) -> str:
    """Predicted and simulated losses as text."""
    return text(_section(joint) for joint in found)


def _section(found: Losses) -> Section:
    rows = []
    for p in found.predictions:
        at = ', '.join(f'{math.degrees(a):.1f}' for a in p.angles[:6])
        unit = p.unit if p.unit != '1' else ''
        verdict = 'loss' if p.predicts_loss else 'no loss'
        where = f'at {at} deg' if at else ''
        rows.append((p.criterion, verdict, f'{p.figure:.4g}', unit, f'{p.threshold:g}', where))
    really = ', '.join(f'{t:.6g}' for t in found.turns[:8])
    more = f' and {len(found.turns) - 8} more' if len(found.turns) > 8 else ''
    return Section(
        f'{found.joint}: predictions for the ideal mechanism',
        table=[('criterion', '', 'figure', '', 'limit', ''), *rows],
        notes=[f'really lost at {really or "no time"}{more} revolutions'],
        left=(0, 1, 3, 5),
    )


def to_json(found: Sequence[Losses]) -> list[dict[str, object]]:
    """Predictions as JSON."""
    return [
        {
            'joint': joint.joint,
            'predictions': plain(joint.predictions),
            'lost_at_revolutions': list(joint.turns),
        }
        for joint in found
    ]
