"""Initial configuration: pins at the centre of their bushings, or pressed against them.

``centred``: the nominal mechanism, pins at the centre, in flight. ``seated``: each pin rests on
its bushing in the direction of the nominal force of the first-named on the second-named link;
nominal rates. Coordinates given in `initial` replace those, exactly; then all gaps count as open
at first.

Elastic links start straight, or, with ``initial.elastic: smooth``, bent as the forces there bend
them, without the vibration: so that the forces of the machine leave the elastic coordinates of
links at rest in their frames no acceleration; that place moves on with the machine. A motion that
begins there, with the rate of that place, is free of vibration but for about ``(W/w)^2`` of the
deflection, at the speed W of the machine and the frequency w of the first mode.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.clock import take_off_turns
from mechanism_sim.engine.observer import Instants
from mechanism_sim.engine.snapshot import State
from mechanism_sim.errors import InputError
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.configuration import converted
from mechanism_sim.planar.drive import TorqueLaw
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.mechanism import Revolute
from mechanism_sim.planar.protocols import EndGap, Gap, MotionBound
from mechanism_sim.planar.switched_functions import Edges
from mechanism_sim.scene.assembly import Assembly, closed_near, nearest_rates, opening
from mechanism_sim.scene.equations import EquationsOfMotion
from mechanism_sim.scene.nominal import Nominal
from mechanism_sim.scene.plan import ScenePlan
from mechanism_sim.scene.reading import Values

_SOFT = 1e-3
"""Weight of a pin's way from its seat, in clearances, against a size that ideal joints open."""
_ROUNDS = 30
_SEATED = 1e-16
_STEPS = 30
_SHIFT = 1e-6  # step of coordinates and of their change in a turn, over the size
_SOON = 1e-9  # time after the start, in turns of the drive or [s]
_MOMENT = 1e-4  # time before and after the start, in turns of the drive or [s]
_ROUNDING = 1e-12  # as a share of the machine's size
_SETTLED = 1e-11  # as a share of the machine's size


@dataclass(frozen=True)
class Start:
    """The parts of a machine from which its start follows."""

    plan: ScenePlan
    nominal: Nominal
    equations: EquationsOfMotion
    period: float  #: period of the drive [s]

    @property
    def turn(self) -> float:
        """A turn of the drive [s], at most a second."""
        return min(self.period, 1.0)

    def state(self) -> State:
        """Start of the equations of motion."""
        plan, observer = self.plan, self.equations.observer
        system = observer.system
        names = self.plan.loose.coordinates
        q, v = (dict(zip(names, x.tolist(), strict=True)) for x in self._placed())
        turns = dict.fromkeys(system.free, 0)
        for c in {*system.free}.difference(self.plan.loose.displacements):
            whole, q[c] = take_off_turns(q[c])
            turns[c] = whole + plan.turned.get(c, 0)
        seated = plan.scene.start == 'seated' and not plan.placed_outright
        outside = plan.outside_at_start(system.outside, turns=turns)
        values = observer.gaps.values(np.array([[q[c]] for c in system.coordinates]), outside)
        closed = []
        for gap, value in zip(system.gaps, values, strict=True):
            if isinstance(gap, MotionBound):  # contacts are resolved at the start of the run
                check_apart(gap, float(gap.distance(value)[0]), self.plan.loose.size)
                closed.append(False)
                continue
            self._check_inside(gap, value, seated)
            closed.append(seated and self._starts_closed(gap, value))
        return State(
            Fraction(0),
            tuple(turns[c] for c in system.free),
            tuple(q[c] for c in system.free),
            tuple(v[c] for c in system.free),
            tuple(closed),
            tuple(x.start / x.scale for x in system.states),
        )

    def _starts_closed(self, gap: Gap, value: Array) -> bool:
        """Pins are on their bushings but in oil, and what can only lift off is in contact."""
        spec, pin = self.plan.clearances[gap.joint], self.plan.loose.joint(gap.joint)
        end = gap if isinstance(gap, EndGap) else None
        if not isinstance(pin, Revolute) or spec.film or (end and end.thrust):
            return spec.radial == 0.0
        near = max(1e-9 * spec.radial, 1e-14 * self.plan.loose.size)
        return not end or float(gap.distance(value)[0]) <= near

    def _check_inside(self, gap: Gap, value: Array, seated: bool) -> None:
        """Refuse a start at which a pin is in its bushing's wall."""
        radial = self.plan.clearances[gap.joint].radial
        clearance = getattr(gap, 'play', radial)  # of stops along an axis their own
        distance = float(gap.distance(value)[0])
        rounding = _ROUNDING * self.plan.loose.size
        if distance >= -max(1e-6 * clearance, rounding) or (seated and gap.law):
            return
        into, place = f'{-distance:.6g} m into', 'initial.position puts'
        if not isinstance(self.plan.loose.joint(gap.joint), Revolute):
            raise InputError(f'{place} {gap.joint} {into} its wall')
        if isinstance(gap, EndGap) and gap.thrust:
            raise InputError(
                f'at the start the links of {gap.joint} are {into} each other at {gap.name}: give '
                "more axial play, or another 'initial.position'"
            )
        if isinstance(gap, EndGap):
            raise InputError(
                f'{place} the pin of {gap.joint} {into} its bushing, at the end {gap.name}'
            )
        raise InputError(
            f'{place} the pin of {gap.name} {clearance - distance:.6g} m from the centre of its '
            f'bushing; the radial clearance is {clearance:g} m'
        )

    # --- coordinates and rates ------------------------------------------------------------------

    def _placed(self) -> tuple[Array, Array]:
        """Values and rates (n,) of the coordinates."""
        plan, loose = self.plan, self.plan.loose
        start = self.nominal.assembly
        if plan.scene.initial.elastic == 'smooth':
            start = self._smooth()
        if not plan.clearances:
            return start.q, start.v
        given = tuple({c: x for c, x in part.items() if self._alike(c)} for part in plan.given[:2])
        for kind, whole, part in zip(('position', 'velocity'), plan.given[:2], given, strict=True):
            for link in (c for c in whole if c not in part):
                places = [c for c in loose.coordinates if c in (f'{link}.x', f'{link}.y')]
                own = ', '.join([f'{link}, an angle', *(f'{c}, a displacement' for c in places)])
                raise InputError(
                    f'initial.{kind}.{link} cannot be set: with its loose joints the machine is '
                    f'not carried by the guide of {link}; what can be given of it is {own}'
                )
        near, rates = converted(plan.ideal, loose, start.q, start.v)
        held = [c for c in loose.coordinates if c in plan.begins or c in plan.prescribed]
        q = self._places(start, near, held, given[0] | plan.floating[0])
        return q, self._rates(rates, q, held, given[1] | plan.floating[1])

    def _alike(self, c: str) -> bool:
        """True if a coordinate means the same with clearance as without."""
        both = self.plan.ideal, self.plan.loose
        slides = [m.tree_joints.get(c) if c in m.sliding else None for m in both]
        return slides[0] == slides[1]

    def _places(self, start: Assembly, near: Array, held: Sequence[str], given: Values) -> Array:
        """Coordinates of the mechanism with clearances: pins at rest, unless given otherwise.

        Where they do, ideal joints stay closed, and the pins are as little off their seats as can
        be, measured in their clearances.
        """
        loose, specs = self.plan.loose, self.plan.clearances
        names = loose.coordinates
        guess = np.array([given.get(c, x) for c, x in zip(names, near, strict=True)])
        fixed = [c for c in names if c in held or c in given]
        every = Kinematics(loose, closures(loose, loose.cut), fixed)
        targets = np.zeros(len(every.rows))

        pressed: dict[str, Array] = {}

        def aim(place: Values | None) -> None:
            for name, force in pressed.items():
                keys, joint = self.plan.scene.joints[name], loose.joint(name)
                rigid = {'contact': None} if self.plan.placed_outright else {}
                spec = specs[name].model_copy(update=rigid)
                rows = [i for i, row in enumerate(every.rows) if row == name]
                targets[rows] = keys.kind_keys.seat(spec, joint, loose, force, place)

        if self.plan.scene.start == 'seated' and self.equations.system.gaps:
            pressed = self._pressing(start.q[:, None], start.v[:, None])
            aim(None)
        if not given and not targets.any():
            return guess  # the loops of the ideal mechanism are closed
        try:
            closed = closed_near(every, guess, targets)
            for _ in range(_ROUNDS):  # directions may depend on link angles
                before = targets.copy()
                aim(dict(zip(names, closed.tolist(), strict=True)))
                if np.abs(targets - before).max(initial=0.0) <= _SEATED * loose.size:
                    break
                closed = closed_near(every, closed, targets)
            return closed
        except InputError as error:
            if not given:
                centred = "; or write 'start: centred'" if targets.any() else ''
                raise InputError(f'{error}{centred}') from error
        soft = np.array([row in specs for row in every.rows])
        spec = np.array([specs[row].radial if row in specs else 0.0 for row in every.rows])
        weight = np.where(soft, _SOFT * loose.size / np.where(spec, spec, loose.size), 1.0)
        for _ in range(_ROUNDS):
            off, J = every.closure(guess[:, None])
            left = weight * (off[0] - targets)
            step = np.linalg.lstsq(weight[:, None] * J[0][:, every.sought], -left, rcond=1e-12)[0]
            most = max(float(np.abs(step).max(initial=0)), 0.5)
            guess[every.sought] += step * min(1.0, 0.5 / most)
        firm = self.plan.loops(fixed)
        return closed_near(firm, guess, np.zeros(len(firm.rows)))

    def _rates(self, rates: Array, q: Array, held: Sequence[str], given: Values) -> Array:
        """Rates of the loose mechanism: those of the ideal one, and those given.

        Links keep turning as they would without clearance while ideal joints can stay closed so.
        """
        plan, loose = self.plan, self.plan.loose
        near = dict(zip(loose.coordinates, rates.tolist(), strict=True))
        kinematics = plan.loops(held)
        driven = {c: plan.held[c][1] for c in held if c not in plan.assumed[1]}
        driven |= {c: near[c] for c in loose.deformations}
        fixed = {**driven, **given}
        turning = {c: near[c] for c in loose.coordinates if c not in loose.displacements}
        for known in ({**turning, **fixed}, fixed):
            v = nearest_rates(kinematics, q, loose.coordinates, known, near)
            joint, speed = opening(kinematics, q, v)
            if speed <= 1e-9 * float(np.abs(v).max(initial=0.0)) * loose.size:
                return v
        if not given:
            return nearest_rates(kinematics, q, loose.coordinates, {**turning, **fixed}, near)
        said = ', '.join(f'{c} at {rate:g}' for c, rate in given.items())
        raise InputError(
            f'initial.velocity is not possible: with {said} the joint {joint}, which has no '
            f'clearance, would open at {speed:.4g} m/s; leave one of them out'
        )

    # --- where pins rest ------------------------------------------------------------------------

    def _pressing(self, q: Array, v: Array) -> dict[str, Array]:
        """Forces (2,) [N] by joint, of its first on its second link, that press it together.

        Parameters
        ----------
        q, v : (n, 1) of the ideal mechanism
        """
        plan, mechanism = self.plan, self.plan.loose
        found: dict[str, Array] = {}
        pressed = {
            name: isinstance(mechanism.joint(name), Revolute)
            for name, c in plan.clearances.items()
            if not c.film and (isinstance(mechanism.joint(name), Revolute) or not c.radial)
        }
        if not pressed:
            return found  # pins start in the middle of their slots
        names = [j.name for j in mechanism.joints]
        try:
            forces = dict(zip(names, self.joint_forces(q, v), strict=True))
        except ZeroDivisionError:  # no equation for some of them
            forces = dict.fromkeys(names, np.full(2, np.nan))
        for name, pin in pressed.items():
            force = forces[name]
            if not np.isfinite(force).all():
                if plan.placed_outright:
                    continue  # at the centre by default
                raise InputError(
                    f'start = seated, but without clearance the force in {name} is not '
                    "determined; write 'start: centred'"
                )
            if pin and not force.any():
                raise InputError(
                    f'start = seated, but no force presses the pin of {name} on its bushing; '
                    "write 'start: centred'"
                )
            found[name] = force
        return found

    def joint_forces(self, q: Array, v: Array) -> Array:
        """Forces in the joints of the ideal mechanism (j, 2) [N], first- on second-named link.

        At coordinates and rates (n, 1), with the accelerations and torques of the start.
        """
        plan, nominal = self.plan, self.nominal
        if plan.powered or nominal.assembly.freedom:
            none = np.zeros((len(plan.prescribed), 1))
            acting = self._acting(self.equations.ideal_observer.system.edges, q, v)
            return self._known(self._seen(q, v, none, 0.0, acting).reaction[:, :, 0])
        if nominal.assembly.loop is None and nominal.assembly.slope is not None:
            raise InputError(
                'start = seated, but the forces that press pins on bushings are not determined: '
                "the start is a singular position, such as a dead point; write 'start: centred', "
                'or start beside it'
            )
        motion = nominal.motion
        rates = np.array([plan.law_at(motion.coordinates[i])[1:] for i in motion.driven]).T
        _, _, a, _ = motion.motion(q, *rates[:, :, None])
        dynamics = nominal.inverse_dynamics
        outside = plan.outside_at_start(dynamics.outside)
        acting = self._acting(dynamics.edges, q, v)
        return self._known(dynamics(q, v, a, outside, acting).reaction[:, :, 0])

    def _acting(self, edges: Edges | None, q: Array, v: Array) -> Array | None:
        """The values (r, 1) of switches just after the start: what begins there acts already."""
        if edges is None:
            return None
        soon = _SOON * self.turn
        outside = self.plan.outside_at_start(edges.outside, soon)
        return edges.present(np.concatenate([q + soon * v, v, outside])[:, 0])

    def _known(self, forces: Array) -> Array:
        """Forces (j, 2), NaN where redundant constraints leave them open without clearance."""
        if self.nominal.assembly.dependent:
            found, forces = self.nominal.open_forces(self.nominal.assembly.q), forces.copy()
            open_ = [found.get(joint.name, frozenset()) for joint in self.plan.loose.joints]
            forces[[bool({'x', 'y'} & parts) for parts in open_]] = np.nan
        return forces

    def _seen(
        self, q: Array, v: Array, a: Array, t: float, acting: Array | None = None
    ) -> Observation:
        """The ideal machine under its first laws, a time [s] from the start.

        Parameters
        ----------
        q, v : coordinates and rates (n, N)
        a : accelerations (p, N) of the prescribed coordinates
        acting : values (r, N) of the switches, if not those at these places
        """
        plan, observer, count = self.plan, self.equations.ideal_observer, q.shape[1]
        torques, places = [], plan.ideal.coordinates
        for c in plan.powered:
            i, law = places.index(c), plan.laws[c][0]
            assert isinstance(law, TorqueLaw)  # noqa: S101 - it is powered
            constant, per_angle, per_speed = law.after(plan.turned.get(c, 0))
            torques.append(constant + per_angle * q[i] + per_speed * v[i])
        outside = np.repeat(plan.outside_at_start(observer.system.outside, t), count, axis=1)
        modes = np.zeros((0, count), np.uint8)
        given = np.reshape(torques, (-1, count))
        return observer.observe(Instants(q, v, a, modes, given, outside=outside, rows=acting))

    # --- elastic links --------------------------------------------------------------------------

    def _smooth(self) -> Assembly:
        """The machine without clearance at the start, elastic links bent by its forces."""
        start, ideal = self.nominal.assembly, self.plan.ideal
        names = ideal.deformations
        if given := [c for part in self.plan.given[:2] for c in part if c in names]:
            raise InputError(
                'initial.elastic = smooth determines how elastic links start, as does initial '
                f'for {given[0]}: leave one of them out'
            )
        if not names:
            return start
        m, moment = len(names), _MOMENT * self.turn
        shifts = _SHIFT * ideal.size * np.array([1.0] * m + [1.0 / self.turn] * m)
        x = np.zeros(2 * m)
        for _ in range(_STEPS):
            columns = x[:, None] + np.diag(shifts) @ np.eye(2 * m, 2 * m + 1, 1)
            found = self._left(columns, moment)
            slopes = (found[:, 1:] - found[:, :1]) / shifts
            step = np.linalg.lstsq(slopes, -found[:, 0])[0]
            x += step
            if not np.isfinite(x).all() or np.abs(x[:m]).max() > ideal.size:
                break
            if (np.abs(step) <= _SETTLED / _SHIFT * shifts).all():
                q, v = self._bent(x[:, None], 0.0)
                return start._replace(q=q[:, 0], v=v[:, 0])
        raise InputError(
            'initial.elastic = smooth: at the start the forces bend its elastic links without '
            'limit; start them straight'
        )

    def slow_deformations(self) -> dict[str, float]:
        """Deformations [m] by elastic coordinate that forces of the start hold without vibration.

        Each to first order, by itself: the deformation there plus ``a / w^2``, a its acceleration
        and w its natural angular frequency.
        """
        plan, ideal = self.plan, self.plan.ideal
        q, v = (x[:, None] for x in self._placed())
        a = np.array([[plan.law_at(c)[2]] for c in plan.prescribed]).reshape(-1, 1)
        seen = self._seen(q, v, a, 0.0).acceleration
        found = {}
        for link, beam in ideal.having(Beam).items():
            for name, w in beam.frequencies.items():
                i = ideal.coordinates.index(f'{link}.{name}')
                found[f'{link}.{name}'] = float(q[i, 0] + seen[i, 0] / w**2)
        return found

    def _left(self, x: Array, moment: float) -> Array:
        """Accelerations of elastic coordinates, and their rates: (2 m, N) for their values x."""
        plan, ideal = self.plan, self.plan.ideal
        elastic = [ideal.coordinates.index(c) for c in ideal.deformations]
        seen = []
        for t in (-moment, 0.0, moment):
            pushed = [np.full(x.shape[1], plan.law_at(c, t)[2]) for c in plan.prescribed]
            a = np.reshape(pushed, (-1, x.shape[1]))
            seen.append(self._seen(*self._bent(x, t), a, t).acceleration[elastic])
        before, now, after = seen
        return np.concatenate([now, (after - before) / (2.0 * moment)])

    def _bent(self, x: Array, t: float) -> tuple[Array, Array]:
        """Coordinates and rates (n, N) a time [s] after the start; x (2 m, N) of elastic ones."""
        plan, start = self.plan, self.nominal.assembly
        m, count = x.shape[0] // 2, x.shape[1]
        known: dict[str, tuple[Array, Array]] = {}
        for c, (q, v) in plan.held.items():
            place, rate = (q + t * v, v) if c not in plan.prescribed else plan.law_at(c, t)[:2]
            known[c] = np.full(count, place), np.full(count, rate)
        for k, c in enumerate(plan.ideal.deformations):
            known[c] = x[k] + t * x[m + k], x[m + k]
        order = [c for c in plan.ideal.coordinates if c in known]
        kinematics = plan.kinematics(order)
        guess = np.repeat((start.q + t * start.v)[:, None], count, axis=1)
        guess[kinematics.held] = [known[c][0] for c in order]
        places, _ = kinematics.positions(guess)
        return places, kinematics.rates(places, np.array([known[c][1] for c in order]))


def check_apart(gap: MotionBound, distance: float, size: float) -> None:
    """Refuse a start at which a distance [m] in a machine of a size [m] is negative."""
    if distance < -_ROUNDING * size:
        raise InputError(
            f"the start puts {gap.overlap}, by {-distance:.6g} m: give another 'initial', "
            f"'guess' or start of the drive, or change 'joints.{gap.joint}'"
        )
