"""Starts by positions and rates of points, and by quantities that are no coordinates.

A machine's coordinates are angles of links and displacements of blocks along the guides that carry
them. Who writes a scene need not know which: where a point is, or how far a block is along a guide
that closes a loop, are equations for the coordinates, solved with the closures of the loops.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import Names, kind_of
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.mechanism import HigherPair, Mechanism, Prismatic
from mechanism_sim.planar.points import GROUND, LinkPoint
from mechanism_sim.scene.schema import StartValue
from mechanism_sim.units import QuantityValue

Values = dict[str, float]

_TRIES = 128
_STEPS = 40
_SETTLED = 1e-14
_NEAR = 1e-3  # tolerance for rounded digits, as a share of the machine's size, or of its rates
_WEAK = 1e-4  # weight of rough values relative to given positions
_MOVES = 1e-9


@dataclass(frozen=True)
class StartTarget:
    """Further conditions on a start: two equations of a point, one of a block."""

    key: str  #: path of the key, as ``guess.coupler.E``
    points: tuple[LinkPoint, ...]  #: point with given position, or two with a given displacement
    #: the guide along which that counts; None for the place of the only point
    joint: Prismatic | None
    value: tuple[float, ...]  #: (2,) [m, m/s], or (1,)

    def of(self, tree: Mechanism, q: Array) -> tuple[Array, Array]:
        """Values (k,) at coordinates (n,), and their derivatives (k, n)."""
        n = len(q)
        many, unit = np.repeat(q[:, None], n, axis=1), np.eye(n)
        traced = [tree.trace(point, many, unit) for point in self.points]
        place, slope = traced[0][0][:, 0], traced[0][1]
        if self.joint is None:
            return place, slope
        other, more = traced[1][0][:, 0], traced[1][1]
        frame, offset = tree.frame(self.joint.first)
        turning = frame != GROUND
        angle = offset + self.joint.axis + (q[tree.coordinates.index(frame)] if turning else 0.0)
        way = np.array([math.cos(angle), math.sin(angle)])
        off = other - place
        rows = way @ (more - slope)
        if turning:
            rows = rows + unit[tree.coordinates.index(frame)] * float(off @ [-way[1], way[0]])
        return np.array([off @ way]), rows[None]


def split(
    names: Names, where: str, given: Mapping[str, StartValue], tree: Mechanism, unit: str = 'm'
) -> tuple[dict[str, QuantityValue], list[StartTarget]]:
    """Values of coordinates, and the rest as targets.

    Parameters
    ----------
    unit : unit of the values of points and blocks
    """
    plain: dict[str, QuantityValue] = {}
    found: list[StartTarget] = []
    for name, said in given.items():
        key = f'{where}.{name}'
        if not isinstance(said, QuantityValue):
            point = names.find(key, name)
            if point[0] == GROUND:
                raise InputError(f'{key}: the ground does not move: give a point of another link')
            found.append(StartTarget(key, (point,), None, tuple(said)))
            continue
        link, _, point_name = name.partition('.')
        if (
            point_name
            and point_name in names.points.get(link, ())
            and name not in tree.coordinates
        ):
            raise InputError(
                f'{key} = {said.value:g} {said.unit}: {point_name} is a point of {link}: give '
                f'its position, as {name}: [x, y]'.replace(' :', ':')
            )
        straight = name in tree.displacements
        if straight and said.unit == 'rad' and where == 'guess':
            guide = tree.tree_joints[name].name
            raise InputError(
                f'{key} is given in rad, but it is {kind_of(True)}, in m: {name} slides along '
                f'{guide}, which determines its angle'
            )
        if name in names.links and said.unit == unit and not straight:
            found.append(_along_guide(key, name, said, tree))
        else:
            plain[name] = said
    return plain, found


def _along_guide(key: str, link: str, said: QuantityValue, tree: Mechanism) -> StartTarget:
    """The displacement of a link whose guide closes a loop, so that its coordinate is an angle."""
    guides = [j for j in tree.joints if isinstance(j, Prismatic) and j.second == link]
    if len(guides) != 1:
        slides = 'slides in no guide' if not guides else 'slides in several guides'
        raise InputError(
            f'{key} is given in {said.unit}, but it is {kind_of(False)}: {link} {slides}; give an '
            f'angle, or a point of it, as {link}.end: [x, y]'
        )
    (joint,) = guides
    ends = (joint.first, joint.on_first), (joint.second, joint.on_second)
    return StartTarget(key, ends, joint, (said.value,))


def solved(
    tree: Mechanism, targets: Sequence[StartTarget], rough: Values, held: Values, exact: bool
) -> Values:
    """Coordinates at which targets are met as nearly as the loops allow; all of them by name.

    Of all ways to close the loops of pins and guides, that which comes nearest.

    Parameters
    ----------
    rough, held : values of coordinates, near enough and kept
    exact : targets must be met, up to rounded digits
    """
    names = tree.coordinates
    lower = [j for j in tree.cut if not isinstance(tree.joint(j), HigherPair)]
    kinematics = Kinematics(tree, closures(tree, lower), [c for c in names if c in held])
    start = np.array([held.get(c, rough.get(c, 0.0)) for c in names])
    weak = np.array([_WEAK if c in rough else 0.1 * _WEAK for c in names])
    # a link that no joint carries goes to its target rather than turn there
    placed = {*moved_by(tree, targets, start)} - rough.keys()
    weak[[c in placed and c.partition('.')[0] in tree.floating and '.' in c for c in names]] = 0.0
    spread = np.random.default_rng(5).standard_normal((len(names), _TRIES))
    spread *= np.linspace(0.0, 2.0, _TRIES) * kinematics.scale[:, None]
    spread[kinematics.held] = 0.0
    tried, left = kinematics.positions(start[:, None] + spread)
    tried = tried[:, left == 0.0] if (left == 0.0).any() else start[:, None]
    off = [_missed(tree, targets, q) for q in tried.T]
    order = np.argsort(off)[:8]
    best = min(
        (_refined(kinematics, targets, tried[:, i], start, weak) for i in order),
        key=lambda q: (round(_missed(tree, targets, q) / tree.size, 9), _far(q, start, weak)),
    )
    closed, left = kinematics.positions(best[:, None])
    best = closed[:, 0] if left[0] == 0.0 else best
    turning = [i for i in kinematics.sought if names[i] not in tree.displacements]
    best[turning] -= TWO_PI * np.round((best[turning] - start[turning]) / TWO_PI)
    if exact:  # rough values have chosen the branch, and no more
        best = _refined(kinematics, targets, best, best, 0.0 * weak)
        _check(tree, targets, best)
    return dict(zip(names, best.tolist(), strict=True))


def _refined(
    kinematics: Kinematics, targets: Sequence[StartTarget], q: Array, start: Array, weak: Array
) -> Array:
    """Coordinates (n,) nearest to the targets, by Gauss and Newton's method with closed loops."""
    tree, sought = kinematics.mechanism, kinematics.sought
    scale, size = kinematics.scale, kinematics.mechanism.size
    q = q.copy()
    for _ in range(_STEPS):
        off, J = kinematics.closure(q[:, None])
        rows, missing = [J[0] / size], [-off[0] / size]
        for target in targets:
            value, slope = target.of(tree, q)
            rows.append(1e-2 * slope / size)
            missing.append(1e-2 * (np.array(target.value) - value) / size)
        rows.append(1e-2 * np.diag(weak / scale))
        missing.append(1e-2 * weak * (start - q) / scale)
        matrix = (np.concatenate(rows) * scale)[:, sought]
        step = np.linalg.lstsq(matrix, np.concatenate(missing), rcond=1e-14)[0]
        longest = float(np.abs(step).max(initial=0.0))
        q[sought] += step * scale[sought] * min(1.0, 0.5 / max(longest, 1e-300))
        if longest <= _SETTLED:
            break
    return q


def _missed(tree: Mechanism, targets: Sequence[StartTarget], q: Array) -> float:
    """Distance by which targets are missed altogether [m]."""
    return math.hypot(*(x for t in targets for x in t.of(tree, q)[0] - np.array(t.value)))


def _far(q: Array, start: Array, weak: Array) -> float:
    return float(np.linalg.norm(weak * np.angle(np.exp(1j * (q - start)))))


def _check(tree: Mechanism, targets: Sequence[StartTarget], q: Array) -> None:
    for target in targets:
        value = target.of(tree, q)[0]
        off = float(np.abs(value - np.array(target.value)).max())
        if off > _NEAR * tree.size:
            raise InputError(
                f'{target.key} cannot be {_text(target.value)}: the nearest that the joints and '
                f'drives allow is {_text(value.tolist())}, {off:.4g} m off'
            )


def _text(value: Sequence[float], unit: str = 'm') -> str:
    said = ', '.join(f'{x:.6g} {unit}' for x in value)
    return f'[{said}]' if len(value) > 1 else said


def moved_by(tree: Mechanism, targets: Sequence[StartTarget], q: Array) -> list[str]:
    """Names of the coordinates on which targets depend at a position (n,)."""
    rows = np.concatenate([np.zeros((1, len(q))), *(t.of(tree, q)[1] for t in targets)])
    return [
        c
        for c, column in zip(tree.coordinates, rows.T, strict=True)
        if np.abs(column).max() > _MOVES * (1.0 if c in tree.displacements else tree.size)
    ]


def rates(
    kinematics: Kinematics, targets: Sequence[StartTarget], q: Array, known: Values
) -> Values:
    """Rates of the coordinates on which targets depend, with closed loops and known rates."""
    tree, names = kinematics.mechanism, kinematics.coordinates
    J = kinematics.closure(q[:, None])[1][0]
    rows, right = [J], [np.zeros(len(J))]
    for target in targets:
        rows.append(target.of(tree, q)[1])
        right.append(np.array(target.value))
    matrix, goal = np.concatenate(rows), np.concatenate(right)
    v = np.array([known.get(c, 0.0) for c in names])
    rest = [i for i, c in enumerate(names) if c not in known]
    scale = kinematics.scale[rest]
    left = goal - matrix @ v
    v[rest] = scale * np.linalg.lstsq(matrix[:, rest] * scale, left, rcond=1e-12)[0]
    for target in targets:
        rate = target.of(tree, q)[1] @ v
        off = float(np.abs(rate - np.array(target.value)).max())
        if off > _NEAR * max(map(abs, target.value)):
            raise InputError(
                f'{target.key} cannot be {_text(target.value, "m/s")}: with the drives and what '
                f'else is given it is {_text(rate.tolist(), "m/s")}'
            )
    open_by = float(np.abs(J @ v).max(initial=0.0))
    if open_by > 1e-9 * tree.size * float(np.abs(v).max(initial=0.0)):
        raise InputError(
            f'{targets[0].key} cannot be: with what else is given the loops would open at '
            f'{open_by:.4g} m/s'
        )
    return {c: float(v[names.index(c)]) for c in moved_by(tree, targets, q) if c not in known}
