"""Natural frequencies, damping ratios and mode shapes of a scene: at rest, over angle or speed.

The equations are linearised by exact derivatives (`mechanism_sim.planar.linearisation`) about the
static equilibrium near the start. Joints with clearance count as ideal, prescribed drives as held;
belts with pretension and elastic teeth without backlash are springs.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy

from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.errors import InputError, RunWarning
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.drive import TorqueLaw
from mechanism_sim.planar.linearisation import Excitation, Linear, Linearisation, Point, reduced
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.rotor import Rotor
from mechanism_sim.scene import Machine
from mechanism_sim.scene.drives import read_drives
from mechanism_sim.studies.frames import PARTS, Vibrating
from mechanism_sim.vibration.systems import ROUNDING, LinearSystem, state_matrix

#: of damped roots, against the largest, below which one is that of a rigid-body mode: a double
#: root that is zero splits by the square root of rounding
_RIGID = 1e-7
#: relative difference of roots, or of sizes, up to which they count as the same
_EQUAL = 1e-8
#: least singular value of shapes of equal roots; below it they are parallel, the root defective
_PARALLEL = 1e-3
#: imaginary part of a root, against its size, up to which it is real: a double root splits so far
_REAL = 1e-7
#: of a speed: what a frequency may be off the rotation's at a crossing, and not at a jump
_MEETS = 1e-9
_NONE = 1e300  # [Hz] of a mode that is not there
_HALVINGS = 12  # of an interval with a change of oscillating modes
_STEADY = 1e-6  # share of a frequency: smaller changes over a turn are steady
#: 1 - cos^2 of the angle between two shapes up to which they are one
_ONE_SHAPE = 1e-12


class Roots(tuple[complex, ...]):
    """The roots s [1/s] of a free motion ``shape e^(s t)``: two that share a shape, or a real one.

    Two are conjugate (an oscillation), or real and of one sign (an overdamped mode). Where damping
    is not in proportion, each real root has a shape of its own: it belongs to no second one.
    """

    __slots__ = ()

    @classmethod
    def of(cls, root: complex) -> Roots:
        """A root and its conjugate, a double root if they differ by rounding; alone if real."""
        if not root.imag:
            return cls((root,))
        if abs(root.imag) <= _REAL * abs(root):
            return cls((complex(root.real), complex(root.real)))
        return cls((root, root.conjugate()))

    @property
    def oscillates(self) -> bool:
        """True if the motion oscillates."""
        return bool(self[0].imag)

    @property
    def size(self) -> float:
        """Geometric mean of the roots' absolute values [1/s]."""
        return float(np.sqrt(abs(self[0]) * abs(self[-1])))

    @property
    def frequency(self) -> float:
        """Natural frequency ``sqrt(s1 s2)/2 pi`` [Hz]; 0 of a root alone, which has none."""
        return self.size / (2.0 * np.pi) if len(self) == 2 else 0.0

    @property
    def damping_ratio(self) -> float | None:
        """``-(s1 + s2)/(2 sqrt(s1 s2))``: above 1 if overdamped; None of a root alone."""
        if len(self) == 1:
            return None
        return float(0.0 - (self[0] + self[1]).real / (2.0 * self.size))  # not -0

    @property
    def time_constants(self) -> tuple[float, ...]:
        """Time constants of a motion without oscillation [s]: ``-1/s``, negative if it grows.

        Empty for an oscillation, and for a rigid-body mode, whose root is zero.
        """
        if self.oscillates:
            return ()
        return tuple(-1.0 / s.real for s in sorted(self, key=abs) if s)


@dataclass(frozen=True)
class NormalMode:
    """A free motion in which all coordinates keep their proportions and phases."""

    roots: Roots  #: roots of its growth or decay, from which all figures follow
    #: complex amplitude [rad, m] of each coordinate that is not driven, the largest one 1; angles
    #: are compared with displacements over the size of the mechanism
    shape: dict[str, complex]
    #: how round the axes of rotors go, from -1, a circle against their rotation, over 0, to and
    #: fro, to 1, a circle with it; None if no rotor turns, or no axis moves
    whirl: float | None = None

    @property
    def oscillates(self) -> bool:
        """True if it oscillates."""
        return self.roots.oscillates

    @property
    def frequency(self) -> float:
        """Natural frequency [Hz]; 0 for a rigid-body mode and a real root alone."""
        return self.roots.frequency

    @property
    def damping_ratio(self) -> float | None:
        """Above 1 if overdamped, negative if it grows; None without a natural frequency."""
        return self.roots.damping_ratio

    @property
    def damped_frequency(self) -> float:
        """Frequency of the free vibration [Hz]; 0 where it does not oscillate."""
        return abs(self.roots[0].imag) / (2.0 * np.pi)

    @property
    def time_constants(self) -> tuple[float, ...]:
        """Time constants of decay to 1/e without oscillation [s]; see `Roots.time_constants`."""
        return self.roots.time_constants


class CriticalSpeed(NamedTuple):
    """A speed of rotation that is the natural frequency of a mode that oscillates."""

    speed: float  #: [rad/s]
    whirl: float | None  #: whirl of its mode
    damping_ratio: float  #: damping ratio of its mode; a large one shows no resonance


class Station(NamedTuple):
    """The modes at one place of the drive and one speed."""

    position: dict[str, float]  #: coordinates of the point of linearisation [rad, m]
    speed: float  #: speed of the drive [rad/s, m/s]
    modes: list[NormalMode]
    faded: int = 0  #: number of further modes that decay within a turn, too fast to resolve

    @property
    def oscillating(self) -> list[NormalMode]:
        """The modes that oscillate, the slowest first."""
        return [mode for mode in self.modes if mode.oscillates]


@dataclass(frozen=True)
class LinearMachine:
    """A scene linearised about one point: ``M z'' + C z' + K z = B^T f``."""

    machine: Machine
    derivatives: Linearisation  #: derivatives of its equations of motion
    at: Point  #: the point
    linear: Linear  #: the equations of all coordinates there
    B: Array  #: (n, f) how all coordinates move with the f independent ones
    independent: list[int]  #: their indices

    @property
    def matrices(self) -> tuple[Array, Array, Array]:
        """Mass, damping and stiffness (f, f) of the independent coordinates."""
        M, C, K = (reduced(x, self.B) for x in (self.linear.M, self.linear.C, self.linear.K))
        return M, C, K

    @property
    def system(self) -> Vibrating:
        """The independent coordinates by themselves."""
        advice = "leave the frequency out, or give a spring 'damping'"
        return Vibrating(*self.matrices, self.machine.name, '', advice)

    def modes(self) -> list[NormalMode]:
        """The slowest first."""
        M, C, K = self.matrices
        names = self.derivatives.coordinates
        size = np.sqrt(np.abs(np.diag(M)))
        light = size == 0.0
        if light.any() or np.linalg.eigvalsh(M / np.outer(size, size)).min() < 1e-13:
            weak = names[self.independent[int(size.argmin())]]
            raise InputError(
                f'{self.machine.name}: there is no mass that moves with {weak}: give its link '
                "'mass' and 'inertia'"
            )
        free = self.derivatives.free
        B, scale = self.B[free], self.derivatives.scale[free]
        found = []
        for roots, z in natural_modes(M, C, K):
            shape = _shape([names[i] for i in free], B @ z, scale)
            found.append(NormalMode(roots, shape, self._whirl(shape)))
        return found

    def _whirl(self, shape: Mapping[str, complex]) -> float | None:
        """Area that rotors' axes go round, with their rotation, over the largest of their size."""
        area = size = 0.0
        for link, rotor in self.machine.plan.ideal.having(Rotor).items():
            spin = self.at.v[self.derivatives.coordinates.index(link)]
            lengths = [shape[f'{link}.{c}'] for c in rotor.names if c not in rotor.angles]
            for x, y in zip(lengths[::2], lengths[1::2], strict=True):
                area -= 2.0 * (x.conjugate() * y).imag * np.sign(spin)
                size += (abs(x) ** 2 + abs(y) ** 2) * abs(np.sign(spin))
        return area / size if size else None


def natural_modes(M: Array, C: Array, K: Array) -> list[tuple[Roots, ComplexArray]]:
    """Roots and shapes (f,) of ``M z'' + C z' + K z = 0``, the slowest first.

    Proportional damping gives one mode for each coordinate, overdamped ones too. Any other, or
    where a rigid-body mode is damped, gives one for each pair of conjugate roots and each pair of
    real roots that share a shape, and one for each other real root.
    """
    scale = 1.0 / np.sqrt(np.diag(M))
    M, C, K = (scale[:, None] * x * scale for x in (M, C, K))
    symmetric = np.abs(K - K.T).max() <= 1e-10 * np.abs(K).max()
    tidy = (K + K.T) / 2.0 if symmetric else K
    least = np.linalg.eigvalsh((K + K.T) / 2.0)[0]
    if symmetric and np.abs(C - C.T).max() <= 1e-10 * np.abs(C).max() and (
        least >= -ROUNDING * len(K) * np.abs(K).max()
    ):  # fmt: skip
        lifted = tidy + max(0.0, -float(least)) * np.eye(len(K))
        try:
            found = LinearSystem((M + M.T) / 2.0, (C + C.T) / 2.0, lifted).modes
        except InputError:  # a negative eigenvalue by rounding
            found = None
        if found is not None and found.decay_rates is not None:
            w, a = found.frequencies, found.decay_rates
            w = np.where(w <= np.sqrt(ROUNDING) * w.max(initial=0.0), 0.0, w)
            drifts = (w == 0.0) & (a > ROUNDING * np.maximum(w, a).max(initial=0.0))
            if not drifts.any():
                shapes = _along_axes(a + 1j * w, found.shapes.astype(complex), M)
                pairs = map(_pair, w.tolist(), a.tolist())
                return list(zip(pairs, (scale[:, None] * shapes).T, strict=True))
    roots, vectors = scipy.linalg.eig(state_matrix(M, C, tidy))
    roots[np.abs(roots) <= _RIGID * np.abs(roots).max()] = 0.0
    kept = roots.imag >= 0.0
    zeros = np.flatnonzero(roots == 0.0)
    kept[zeros[len(zeros) // 2 + len(zeros) % 2 :]] = False  # two for each rigid-body mode
    order = sorted(np.flatnonzero(kept), key=lambda i: (abs(roots[i]), roots[i].real))
    roots = roots[order]
    shapes = _along_axes(roots, vectors[: len(M), order], M)
    modes = _paired([Roots.of(x) for x in roots.tolist()], shapes)
    return [(found, scale * shape) for found, shape in modes]


def _pair(w: float, decay: float) -> Roots:
    """The roots of ``s^2 + 2 decay s + w^2``, the smaller real one without cancellation."""
    if w == 0.0:
        return Roots((0j,))
    if abs(decay) < w:
        return Roots.of(complex(-decay, np.sqrt((w - decay) * (w + decay))))
    large = -decay - np.copysign(np.sqrt(max((decay - w) * (decay + w), 0.0)), decay)
    return Roots((complex(w * w / large), complex(large)))


def _paired(roots: list[Roots], shapes: ComplexArray) -> list[tuple[Roots, ComplexArray]]:
    """Roots with their shapes (f, m); two real ones of one shape and sign are one mode."""
    shapes = shapes / np.linalg.norm(shapes, axis=0)
    real = [i for i, x in enumerate(roots) if len(x) == 1 and x[0]]
    for n, i in enumerate(real):
        for j in real[n + 1 :]:
            like = 1.0 - abs(np.vdot(shapes[:, i], shapes[:, j])) ** 2 <= _ONE_SHAPE
            if (
                like
                and len(roots[i]) == len(roots[j]) == 1
                and (roots[i][0] * roots[j][0]).real > 0
            ):
                roots[i], roots[j] = Roots(roots[i] + roots[j]), Roots()
    kept = sorted((i for i, x in enumerate(roots) if x), key=lambda i: roots[i].size)
    return [(roots[i], shapes[:, i]) for i in kept]


def _along_axes(roots: ComplexArray, shapes: ComplexArray, M: Array) -> ComplexArray:
    """Shapes (f, m) whose modes of equal roots (m,) are told apart by their coordinates.

    Any combination of them is a mode. The first is the one in which a coordinate moves most for
    its kinetic energy; the others are orthogonal to it over the masses, and so on. Of motions that
    are not coupled, as those of a shaft along x and y, each has a mode of its own.
    """
    shapes = shapes / np.linalg.norm(shapes, axis=0)
    upper = scipy.linalg.cholesky((M + M.T) / 2.0)
    told = np.zeros(len(roots), bool)
    for root in roots:
        group = np.flatnonzero(~told & (np.abs(roots - root) <= _EQUAL * np.abs(root)))
        told[group] = True
        if len(group) > 1 and np.linalg.svd(shapes[:, group])[1][-1] > _PARALLEL:
            Q = np.linalg.qr(upper @ shapes[:, group])[0]
            for k in range(len(group) - 1):
                V = scipy.linalg.solve_triangular(upper, Q[:, k:])
                size = np.linalg.norm(V, axis=1)
                along = V[np.flatnonzero(size >= (1.0 - _EQUAL) * size.max())[0]].conj()
                Q[:, k:] = Q[:, k:] @ np.linalg.qr(np.column_stack((along, np.eye(len(along)))))[0]
            shapes[:, group] = scipy.linalg.solve_triangular(upper, Q)
    return shapes


def _shape(names: Sequence[str], amplitudes: ComplexArray, scale: Array) -> dict[str, complex]:
    """Amplitudes over the largest of them."""
    largest = amplitudes[np.abs(amplitudes / scale).argmax()]
    return dict(zip(names, (amplitudes / largest).tolist(), strict=True))


def derivatives(
    machine: Machine,
    excitation: Excitation | None = None,
    held: Sequence[str] = (),
    rigid: bool = False,
) -> Linearisation:
    """The derivatives of a machine's equations of motion, its joints ideal.

    Parameters
    ----------
    held : coordinates that a torque moves, but whose motion is given here
    rigid : True if preloaded belts and teeth are ideal, too, so that coordinates follow drives
    """
    plan, ideal = machine.plan, machine.plan.ideal
    if not plan.weighed:
        raise InputError(
            f"{machine.name}: links without mass do not vibrate: give every link 'mass' and "
            "'inertia'"
        )
    if plan.states:
        raise InputError(
            f'{machine.name}: the state {plan.states[0].label} of first order has no part in the '
            'linear equations here: leave states out, or look at the run itself'
        )
    if rubbing := plan.frictions(ideal):
        name = rubbing[0].name
        raise InputError(
            f'{machine.name}: joints.{name}.friction: Coulomb friction has no linear form, and '
            f"near rest it sticks: set it to zero, as '--set joints.{name}.friction.coefficient=0'"
        )
    laws = [plan.laws[c][0] for c in plan.powered if c not in held]
    pairs = () if rigid else plan.joints
    sprung = [joint for joint in pairs if isinstance(joint, HigherPair) and joint.preloaded]
    firm = [name for name in ideal.cut if all(joint.name != name for joint in sprung)]
    pulls = [element for joint in sprung for element in joint.elements(ideal)]
    found = Linearisation(
        ideal, closures(ideal, firm), [*plan.prescribed, *held],
        [law for law in laws if isinstance(law, TorqueLaw)], [*plan.elements(ideal), *pulls],
        [motor for motor in plan.motors if motor.coordinate not in held], excitation,
    )  # fmt: skip
    if machine.assembly.freedom + len(sprung) - len(held) <= 0:
        why = (
            'with its drive held nothing else moves; leave out --along and --speeds'
            if held
            else "its drives prescribe the whole motion; give 'drive.torque' instead of a speed, "
            'or a link that moves on springs'
        )
        if not held and machine.level.dynamic:
            why = (
                'joints count as without play here, contacts, teeth with backlash and belts '
                f'without pretension as rigid even where they are elastic, and then {why}'
            )
        raise InputError(f'{machine.name}: nothing can vibrate: {why}')
    return found


def linearised(
    machine: Machine,
    excitation: Excitation | None = None,
    start: Array | None = None,
    speed: float = 0.0,
    known: Linearisation | None = None,
    turning: bool = False,
) -> LinearMachine:
    """A machine near its equilibrium, driven coordinates held or turning steadily.

    Parameters
    ----------
    start : (n,) near which the equilibrium is sought, driven coordinates where they stay; the
        start of the scene if not given
    speed : speed of the main drive [rad/s, m/s]; links that it carries rotate with it
    known : derivatives of the same machine
    turning : find the steady rotation under a torque instead of rest
    """
    found = known or derivatives(machine, excitation)
    q = machine.assembly.q if start is None else start
    try:
        outside = machine.plan.outside_at_start(found.outside)[:, 0]
        near = found.towed(found.point(np.array(q, float), steady_rates(machine, speed), outside))
        at = None if turning else found.equilibrium(near)
    except FloatingPointError:
        raise InputError(
            f'{machine.name}: near the equilibrium a force is not finite or has no slope: a '
            'spring whose ends meet has no direction (set them apart, or free_length to 0), and '
            'a formula may be out of its range'
        ) from None
    if at is None and not speed and machine.plan.main in machine.plan.powered:
        at = _steady(machine, found, near)
    if at is None:
        raise _without_equilibrium(machine, speed)
    linear = found(at)
    _, rows = machine.plan.kinematics(()).closure(at.q[:, None])  # elastic joints among them
    if speed and np.abs(rows @ at.v).max(initial=0.0) > 1e-9 * abs(speed) * found.scale.max():
        raise InputError(
            f'{machine.name}: at a steady speed of {machine.plan.main} its links move against '
            'each other, so the modes change over the turn: take --along'
        )
    return LinearMachine(machine, found, at, linear, *found.basis(linear.J))


def _without_equilibrium(machine: Machine, speed: float) -> InputError:
    """Error of a machine that nothing holds near its start, which says what may be missing."""
    at = f' at a speed of {speed:g}' if speed else ''
    touching = ', '.join(machine.plan.touching)
    beside = f', and contacts ({touching}) do not here: put a spring there' if touching else ''
    return InputError(
        f'{machine.name}: no equilibrium was found near the start{at}: something must hold every '
        f"coordinate that a weight, a load or a drive's torque moves{beside}; start nearer to it "
        "by 'initial.position'"
    )


def _steady(machine: Machine, found: Linearisation, start: Point) -> Point | None:
    """The steady rotation in which a drive's torque keeps a machine, sought from likely speeds.

    Parameters
    ----------
    start : state at rest
    """
    plan = machine.plan
    if not read_drives(plan) or plan.main in plan.ideal.displacements:
        return None
    paces = [getattr(m.characteristic, 'synchronous_speed', 0.0) / m.ratio
             for m in machine.plan.motors]  # fmt: skip
    for speed in dict.fromkeys((machine.drive.start[1], *paces)):
        try:
            turned = found.turning(start, found.coordinates.index(machine.plan.main))
            at = found.steady(start._replace(v=speed * turned), turned)
        except FloatingPointError:
            continue
        if at is not None:
            return at
    return None


def steady_rates(machine: Machine, speed: float) -> Array:
    """Rates (n,) of a steady motion: the main drive, and the angles of the links it carries."""
    mechanism = machine.plan.ideal
    rates = np.zeros(len(mechanism.coordinates))
    if not speed:
        return rates
    turned = {machine.plan.main}
    for link in mechanism.tree_joints:
        parent = mechanism.parent(link)
        if parent != GROUND and mechanism.frame(parent)[0] in turned:
            turned.add(mechanism.frame(link)[0])
    straight = machine.plan.main in mechanism.displacements
    turned = {machine.plan.main} if straight else turned
    for c in turned:
        if c in mechanism.coordinates:
            rates[mechanism.coordinates.index(c)] = speed
    return rates


def modes(machine: Machine) -> list[NormalMode]:
    """The modes of a machine, as `about`, and of its frames on springs."""
    return about(machine).modes


def about(machine: Machine, turning: bool = False) -> Station:
    """The modes about the static equilibrium, or the steady rotation in which a torque keeps it.

    Those of frames on springs are among them.

    Parameters
    ----------
    turning : find the rotation only
    """
    found = [mode for name in machine.scene.oscillators for mode in _frame_modes(machine, name)]
    if found and not machine.torque_driven:
        return Station({}, 0.0, found)
    one = linearised(machine, turning=turning)
    k = one.derivatives.coordinates.index(machine.plan.main)
    driven = machine.plan.main in machine.plan.prescribed
    own = _station(one, 0.0 if driven else float(one.at.v[k]))
    return own._replace(modes=sorted([*found, *own.modes], key=lambda m: m.roots.size))


def _frame_modes(machine: Machine, name: str) -> list[NormalMode]:
    """The modes of a frame, without effect on the machine."""
    frame = machine.frame(name)
    scale = np.array([machine.plan.ideal.size, machine.plan.ideal.size, 1.0])[: frame.freedom]
    names = [f'{name}.{part}' for part in PARTS[: frame.freedom]]
    return [
        NormalMode(roots, _shape(names, z, scale))
        for roots, z in natural_modes(frame.M, frame.C, frame.K)
    ]


def along(machine: Machine, count: int) -> list[Station]:
    """The modes with the drive held at `count` places around its turn.

    At each the equilibrium is sought from that at the place before. A torque or a motor is
    replaced by what holds its link (frozen).
    """
    if count < 1:
        raise InputError(f'--along {count}: expected 1 angle or more')
    main = turning(machine, '--along')
    found = derivatives(machine, held=kept(machine))
    k, q = found.coordinates.index(main), machine.assembly.q.copy()
    first, stations = q[k], []
    for i in range(count):
        # small steps, so that loops stay on their branch
        turn = first + 2.0 * np.pi * i / count
        while True:
            q[k] += np.clip(turn - q[k], -0.1, 0.1)
            one = linearised(machine, start=q, known=found)
            q = one.at.q.copy()
            if q[k] == turn:
                break
        stations.append(_station(one, 0.0))
    return stations


def campbell(machine: Machine, speeds: Array) -> list[Station]:
    """The modes at steady speeds (s,) [rad/s] of the drive, about the relative equilibrium.

    A torque or a motor is replaced by what keeps the speed. Where a force does not turn with the
    drive, modes are those at the start, and a warning says how much they change over the turn.
    """
    turning(machine, '--speeds')
    found = derivatives(machine, held=kept(machine))
    stations, told = list[Station](), False
    turns = [abs(speed) for speed in speeds.tolist() if speed]
    ends = {min(turns, default=0.0), max(turns, default=0.0)}
    for speed in map(float, speeds):
        one = linearised(machine, speed=speed, known=found)
        stations.append(_station(one, speed))
        # gravity weighs most at the slowest, what grows with the speed at the fastest
        if abs(speed) in ends and not told:
            told = warn_over_turn(one, speed)
    return stations


def warn_over_turn(one: LinearMachine, speed: float) -> bool:
    """Warn of a machine that is not the same all over the turn of its drive at a steady speed.

    It is seen by its natural frequencies a third of a turn on, either way.
    """
    try:
        own = [mode.frequency for mode in one.modes() if mode.oscillates]
    except InputError:  # massless machines have responses, but no modes
        return False
    change = 0.0
    for turn in (-2.0 * np.pi / 3.0, 2.0 * np.pi / 3.0) if speed else ():
        q = one.at.q + turn / speed * one.at.v
        try:
            there = linearised(one.machine, start=q, speed=speed, known=one.derivatives).modes()
            other = [mode.frequency for mode in there if mode.oscillates]
            change = max([change, *(abs(b / a - 1.0) for a, b in zip(own, other, strict=True))])
        except (InputError, ValueError):  # there is no equilibrium, or other modes oscillate
            change = 1.0
    if change > _STEADY:
        warnings.warn(
            f'{one.machine.name}: its modes CHANGE over the turn of {one.machine.plan.main}, '
            f'frequencies by {100.0 * min(change, 1.0):.2g} % at {speed:g} rad/s, as a force does '
            'not turn with it: results are for the start',
            RunWarning,
            stacklevel=3,
        )
    return change > _STEADY


def critical_speeds(machine: Machine, stations: Sequence[Station]) -> list[CriticalSpeed]:
    """Speeds between stations at which the natural frequency of an oscillation is the rotation's.

    Modes are told apart by their order. So an interval in which some begin or cease to oscillate
    is halved until that happens in a part too short to matter, and what a change of order only
    seems to cross is left out.
    """
    known, found = derivatives(machine, held=kept(machine)), []

    def at(speed: float) -> Station:
        return Station({}, speed, linearised(machine, speed=speed, known=known).modes())

    def excess(station: Station, k: int) -> float:
        modes = station.oscillating
        frequency = modes[k].frequency if k < len(modes) else _NONE
        return frequency - abs(station.speed) / (2.0 * np.pi)

    def excess_at(speed: float, k: int) -> float:
        return excess(at(speed), k)

    def enter(station: Station, k: int) -> None:
        mode = station.oscillating[k]
        found.append(CriticalSpeed(station.speed, mode.whirl, float(mode.damping_ratio or 0.0)))

    def search(a: Station, b: Station, halvings: int) -> None:
        count = len(a.oscillating)
        if count != len(b.oscillating) and halvings:
            middle = at(0.5 * (a.speed + b.speed))
            search(a, middle, halvings - 1)
            search(middle, b, halvings - 1)
            return
        for k in range(min(count, len(b.oscillating))):
            low, high = excess(a, k), excess(b, k)
            if not low and a.speed:
                enter(a, k)
            elif low * high < 0.0:
                w = scipy.optimize.brentq(excess_at, a.speed, b.speed, (k,), rtol=1e-14)
                if abs(excess(there := at(w), k)) <= _MEETS * abs(w):
                    enter(there, k)

    for a, b in pairwise([*stations, *stations[-1:]]):  # the last one may be at a crossing, too
        search(a, b, _HALVINGS)
    return sorted(found, key=lambda x: x.speed)


def turning(machine: Machine, option: str) -> str:
    """The main drive's coordinate, which an option turns."""
    plan = machine.plan
    if not read_drives(plan) or plan.main in plan.ideal.displacements:
        raise InputError(
            f"{machine.name}: {option} needs a drive of an angle: give 'drive.coordinate', and "
            "'drive.speed' or 'drive.torque'"
        )
    return machine.plan.main


def kept(machine: Machine) -> list[str]:
    """The main coordinate if a torque moves it: then the torque is what its motion takes."""
    return [machine.plan.main] if machine.plan.main in machine.plan.powered else []


def _station(one: LinearMachine, speed: float) -> Station:
    position = dict(zip(one.derivatives.coordinates, one.at.q.tolist(), strict=True))
    return Station(position, speed, one.modes())
