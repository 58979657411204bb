"""Period of a machine in turns of its drive, with gears, belts, cams and tables."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from mechanism_sim.documents import texts_of
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.numerics import formula
from mechanism_sim.numerics.expressions import ExpressionNode
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.planar.drive import DriveLaw, Law, unrolled
from mechanism_sim.planar.mechanism import HigherPair, Weld
from mechanism_sim.planar.points import Vector2
from mechanism_sim.scene.formula_keys import TIME, table_calls
from mechanism_sim.scene.nominal import Nominal
from mechanism_sim.scene.plan import ScenePlan, keeps_speed

MOST = 12
"""Largest number of turns of the drive for which repetition is checked."""
WHOLE = 1e-6
"""Tolerance for whole turns, or tables: angles in degrees have six digits."""
_CENTRED = 1e-9  # share of the machine's size within which a point is at the centre of a wheel
PROSE = 'title', 'description', 'tables'
_GEOMETRY = 'links', 'joints', 'gears'


@dataclass(frozen=True)
class Repetition:
    """Period of a machine in turns of the main drive."""

    #: a whole number; 1 too if there is none up to `MOST`, or nothing is known of it
    turns: int = 1
    #: quantity with the longest period, or without any; empty for a period of one turn
    last: str = ''
    found: bool = True  #: True if the whole machine is periodic
    duration: float | None = None  #: [s] instead, of a drive whose speed repeats itself over time

    def note(self, main: str) -> str:
        """Return what is computed by default, if it is not plainly one turn."""
        if self.duration:
            comes = 'comes' if self.last == main else 'come'
            return f'{self.last} {comes} again after {self.duration:.9g} s: so long is computed'
        if not self.last:
            return ''
        if self.found:
            return (
                f'{self.last} comes again after {self.turns} turns of {main}: '
                f'{self.turns} turns are computed'
            )
        return (
            f'{self.last} does not come again within {MOST} turns of {main}: one turn is '
            'computed, and others differ'
        )


class _Phase(NamedTuple):
    """A sum of angles [rad] of links, or of the time [s], that repeats itself after a span."""

    text: str
    factors: dict[str, float]
    span: float


def calls_of_angles(
    plan: ScenePlan, functions: Collection[str] = (), more: Collection[str] = ()
) -> Iterator[tuple[ExpressionNode, dict[str, float]]]:
    """Calls of tables, and of other functions, at sums of angles in all formulas of a scene.

    Parameters
    ----------
    more : names that count as angles, as the time
    """
    straight, known = plan.ideal.displacements, {*plan.scene.tables, *functions}
    links = [*(link for link in plan.links if link not in straight), *more]
    content = plan.scene.to_document()
    said = dict.fromkeys(text for _, text in texts_of(content, PROSE))
    for text in (x for x in said if any(f'{name}(' in x for name in known)):
        with suppress(InputError):  # words that are no formula
            yield from table_calls(formula.read(text, plan.scene.tables), known, links)


def repetition(nominal: Nominal, period: float) -> Repetition:
    """Period of a machine without clearance in turns of the main drive.

    Where speeds of drives repeat themselves over time: after how many periods of the main drive,
    in which all drives come back or turn round.

    Parameters
    ----------
    nominal : nominal model of the machine with rigid links
    period : period of a turn of the main drive [s], at its constant speed
    """
    found, plan = _by_turns(nominal, period), nominal.plan
    periods = {c: x.period for c, x in plan.sources.items()}
    again = periods.get(plan.main, period if keeps_speed(plan, plan.main) else None)
    known = [c for c in plan.laws if periods.get(c) or keeps_speed(plan, c)]
    if not periods or not again or not math.isfinite(again) or len(known) < len(plan.laws):
        return found
    for n, ways in enumerate(zip(*(_ways(plan, c, again) for c in known), strict=True), 1):
        turns = abs(round(ways[known.index(plan.main)]))
        if all(map(is_whole, ways)) and all(
            is_whole(n * again / p) for p in periods.values() if p
        ):
            if len(known) == 1 and turns and found.turns % turns == 0:  # as many turns as else
                return found
            often = math.lcm(turns, found.turns) // turns if turns else 1
            return replace(found, last=' and '.join(known), duration=often * n * again)
    return found


def _ways(plan: ScenePlan, c: str, period: float) -> Iterator[float]:
    """Turns of a drive in one period [s], two, and so on; of what slides 0, or 0.5 if off."""
    laws = unrolled(plan.laws[c], plan.sources.get(c))
    law, later, start = next(laws), next(laws, None), 0.0
    for n in range(MOST + 1):
        while later and later.valid_from <= n * period:
            law, later = later, next(laws, None)
        assert isinstance(law, DriveLaw)  # noqa: S101 - others have no source
        turns, (place, *_) = law.about(Fraction(n * period))
        place = place if law.straight else turns + place / TWO_PI
        start = start if n else place
        if n:
            way = place - start
            yield 0.5 * (abs(way) > WHOLE * plan.ideal.size) if law.straight else way


def _by_turns(nominal: Nominal, period: float) -> Repetition:
    """Turns of the main drive after which all that follows from it is as before.

    Where links are follows from the angle of the main drive alone, or from drives at constant
    speeds; when formulas of the time come again, from these alone. A link that looks alike at any
    angle, as a wheel, need not come back; a wheel with an eccentric mass has to, and so has a cam.
    Under a torque, as of a four-stroke engine, the turns are those of formulas of its angle.

    Parameters
    ----------
    nominal : nominal model of the machine with rigid links
    period : period of a turn of the main drive [s], at its constant speed
    """
    plan = nominal.plan
    first = [laws[0] for laws in plan.laws.values()]
    steady = all(keeps_speed(plan, c) for c in plan.laws) and math.isfinite(period)
    known = len(first) == 1 or steady
    if not known or plan.main in plan.ideal.displacements:
        return Repetition()
    phases = [
        *(_Phase(link, {link: 1.0}, TWO_PI) for link in _seen(plan)),
        *(
            _Phase(node.text, factors, _span(plan, node.name))
            for node, factors in calls_of_angles(plan, formula.PERIODIC, [TIME] if steady else [])
            if node.name in formula.PERIODIC or plan.scene.tables[node.name].curve.cyclic
        ),
    ]
    of_turn, known_before = period, {plan.main, TIME}
    if len(first) == 1 and not plan.powered:
        pace = math.copysign(TWO_PI, plan.held[plan.main][1])
        first, period = [DriveLaw(plan.main, (plan.held[plan.main][0], pace))], 1.0
    if nominal.assembly.freedom or plan.powered:  # motion of other links is not known beforehand
        phases = [phase for phase in phases if {*phase.factors} <= known_before]
    alone = all({*phase.factors} <= known_before for phase in phases)
    last, never = '', [phase.text for phase in phases]
    try:
        for turns, angles in enumerate(_turned(nominal, first, period, alone), 1):
            now = angles | {TIME: turns * of_turn}
            off = [phase.text for phase in phases if not _again(phase, now)]
            if not off:
                return Repetition(turns, last)
            never = [text for text in never if text in off]
            last = (never or off)[0]
    except (InputError, RunError):  # no full turn
        return Repetition()
    return Repetition(1, last, found=False)


def _turned(
    nominal: Nominal, laws: Sequence[Law], period: float, main_alone: bool
) -> Iterator[dict[str, float]]:
    """Rotations of links [rad] after one turn of the main drive, two, and so on."""
    if main_alone:
        yield from ({nominal.plan.main: TWO_PI * n} for n in range(1, MOST + 1))
        return
    run, start, names = nominal.run(laws), None, nominal.plan.ideal.coordinates
    for n in range(1, MOST + 1):
        curve = run.motion(n * period).curve
        start = curve(np.zeros(1))[0] if start is None else start
        there = curve(np.array([n * period]))[0]
        yield dict(zip(names, (there - start).tolist(), strict=True))


def _again(phase: _Phase, turned: Mapping[str, float]) -> bool:
    """True if a sum of angles has advanced by whole spans."""
    return is_whole(math.fsum(f * turned[x] for x, f in phase.factors.items()) / phase.span)


def is_whole(spans: float) -> bool:
    """True of a whole number of turns or of tables."""
    return abs(spans - round(spans)) < WHOLE


def _span(plan: ScenePlan, function: str) -> float:
    """Period of a function of an angle [rad], or of the time [s]."""
    if function in formula.PERIODIC:
        return TWO_PI
    points = plan.scene.tables[function].points
    return points[-1][0].value - points[0][0].value


def _seen(plan: ScenePlan) -> list[str]:
    """Rotating links whose angle matters: the constraints of others do not depend on it.

    Those are wheels on which all is at one point, their axle.
    """
    pairs = [joint for joint in plan.joints if isinstance(joint, HigherPair)]
    if not pairs and len(plan.laws) == 1:  # links alone are as before after a turn of one drive
        return []
    ideal, at = plan.ideal, dict[str, list[Vector2]]()
    for link, point in (point for joint in plan.joints for point in joint.points):
        at.setdefault(link, []).append(point)
    for body in ideal.bodies:
        at.setdefault(body.name, []).extend([body.cog] if body.mass else [])
    for _, text in texts_of(plan.scene.to_document(), (*PROSE, *_GEOMETRY)):
        link, _, point = text.partition('.')
        if place := plan.points.get(link, {}).get(point or 'start'):
            at.setdefault(link, []).append(place)
    sensors = plan.scene.sensors.values()
    # the axes of what stands at a place of a link turn with it
    seen = {sensor.link for sensor in sensors if getattr(sensor, 'at', None) is not None}
    seen |= {link for pair in pairs for link in pair.links if link not in pair.alike}
    seen |= {
        link
        for link, points in at.items()
        if max(math.dist(points[0], x) for x in points) > _CENTRED * ideal.size
    }
    welds = [joint for joint in plan.joints if isinstance(joint, Weld)]
    for _ in welds:  # as far as they reach one after another
        seen |= {x for j in welds if seen & {j.first, j.second} for x in (j.first, j.second)}
    names = {*ideal.coordinates} - {*ideal.displacements}
    return [body.name for body in ideal.bodies if body.name in seen & names]
