"""Notes on a mechanism's motion, found without moving it: freedoms, full turns, limits."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping

from mechanism_sim.linkages.four_bar import FourBar, SliderCrank, four_bars, slider_cranks
from mechanism_sim.linkages.grashof import (
    change_points,
    classify,
    crank_limits,
    crank_turns,
    excess,
    rocker_limits,
    swing,
    time_ratio,
    transmission_range,
)
from mechanism_sim.linkages.mobility import mobility
from mechanism_sim.planar.configuration import Constraints, poses
from mechanism_sim.planar.mechanism import Mechanism

#: transmission angles [deg] below this are usually avoided
_LEAST_TRANSMISSION = 30.0


class Limit(str):
    """A note on possible blocking of a machine, printed first."""

    __slots__ = ()


def motion_notes(
    mechanism: Mechanism, q: Mapping[str, float], driven: Collection[str]
) -> list[str]:
    """Mobility at the coordinates `q`, and what its four-bars and slider-cranks can do."""
    notes = [*mobility_notes(mechanism, q)]
    found: list[tuple[tuple[str, str, str], FourBar | SliderCrank]] = [
        *four_bars(mechanism, driven).items(),
        *slider_cranks(mechanism, driven).items(),
    ]
    swung = _swung(found, driven)
    for links, linkage in found:
        crank, _, last = links
        if crank in swung:
            # another linkage swings it: a toggle, a second four-bar
            (by, through), kind = swung[crank], 'slider-crank'
            if isinstance(linkage, FourBar):
                kind = f'Grashof: {classify(linkage.lengths)}'
            lines = [
                f'{kind}; the {crank} is moved by {by}, and swings through at most '
                f'{math.degrees(through):.6g} deg'
            ]
        elif isinstance(linkage, FourBar):
            lines = _four_bar_notes(linkage, crank, last)
        else:
            lines = _slider_crank_notes(linkage, crank)
        whose = f'{", ".join(links)}: ' if len(found) > 1 else ''
        # links that follow others block nothing
        notes += [(type(line) if crank in driven else str)(whose + line) for line in lines]
    return notes


def _swung(
    found: Collection[tuple[tuple[str, str, str], FourBar | SliderCrank]], driven: Collection[str]
) -> dict[str, tuple[str, float]]:
    """Links that a four-bar swings through less than a turn: its links, and the angle [rad].

    What such a link could do if it were a crank says nothing of how it moves in this machine.
    """
    swings = {}
    for links, linkage in found:
        last = links[-1]
        if isinstance(linkage, FourBar) and last not in driven:
            through = swing(rocker_limits(linkage))
            if through < 2.0 * math.pi:
                swings[last] = ', '.join(links), through
    return swings


def mobility_notes(mechanism: Mechanism, q: Mapping[str, float]) -> Iterator[str]:
    """Degrees of freedom at coordinates, why Kutzbach counts others, and joints to leave out."""
    seen = mobility(Constraints.of(mechanism), poses(mechanism, q))
    alike = seen.finite == seen.kutzbach
    text = f'mobility: {seen.finite}, {"as" if alike else "where"} Kutzbach counts'
    if not alike:
        text += f' {seen.kutzbach}'
    if seen.instantaneous > seen.finite:
        text += f'; {seen.instantaneous} at the start, which is a singular position'
    if seen.redundant:
        text += f'; {seen.redundancy} redundant among {", ".join(seen.redundant)}'
    yield Limit(text) if seen.redundant or seen.instantaneous > seen.finite else text
    if extra := seen.repeating:
        one = len(extra) == 1
        yield (
            f'{", ".join(extra)} {"is" if one else "are"} redundant beside the joints named '
            f'before: as {"a slot it leaves" if one else "slots they leave"} the motion as it is, '
            'and the forces are determined'
        )


def _four_bar_notes(linkage: FourBar, crank: str, rocker: str) -> list[str]:
    """Notes on the motion of a four-bar's links, and on its transmission angle."""
    spare = float(excess(linkage.lengths))
    compared = f'{abs(spare):.6g} m {"less" if spare > 0 else "more"} than'
    lines = change_points(linkage)
    if lines:
        compared = 'equal to'
    notes = [
        f'Grashof: {classify(linkage.lengths)}, the sum of shortest and longest link is '
        f'{compared} that of the others'
    ]
    if lines:
        angles = ' and '.join(f'{math.degrees(x):g}' for x in lines)
        notes.append(
            Limit(
                f'change point: all links lie in one line at {angles} deg between {crank} and '
                'ground, from where they may go on folded, or jam with a loose joint: a drive '
                'that holds its speed takes them along at any force'
            )
        )
    elif not crank_turns(linkage):
        low, high = (math.degrees(x) for x in crank_limits(linkage))
        notes.append(
            Limit(
                f'the {crank} cannot turn fully: it stays between {between(low, high)} deg from '
                'the line of the ground joints'
            )
        )
    if (through := swing(rocker_limits(linkage))) < 2.0 * math.pi:
        most = '' if crank_turns(linkage) else ' at most'
        note = f'the {rocker} swings through{most} {math.degrees(through):.6g} deg'
        ratio = time_ratio(linkage)
        steady = f', time ratio {ratio:.6g} at constant speed of the {crank}'
        notes.append(note if math.isnan(ratio) else note + steady)
    limited = '' if crank_turns(linkage) else crank
    return [*notes, _transmission(*transmission_range(linkage), limited)]


def _slider_crank_notes(linkage: SliderCrank, crank: str) -> list[str]:
    """Notes on the motion of a slider-crank's links, and on its transmission angle."""
    if linkage.turns == 'crank':
        first = f'slider-crank: the {crank} can turn fully, stroke {linkage.stroke:.6g} m'
        if linkage.offset:
            first += f', time ratio {linkage.time_ratio:.6g} at constant speed'
    elif linkage.turns == 'both':
        first = (
            f'slider-crank: the {crank} and the rod can turn fully, through change points where '
            'both are square to the guide'
        )
    else:
        low, high = (math.degrees(math.asin(x)) for x in linkage.crank_limits())
        first = (
            f'slider-crank: the {crank} cannot turn fully: the sine of its angle to the guide '
            f'stays between those of {low:.6g} and {high:.6g} deg'
        )
        if linkage.turns == 'rod':
            first += '; the rod can'
        first = Limit(first)
    limited = '' if linkage.turns in ('crank', 'both') else crank
    return [first, _transmission(*linkage.transmission_range(), limited)]


def _transmission(least: float, greatest: float, limited: str) -> str:
    """Note on the transmission angle; `limited` names a crank that cannot turn fully."""
    low, high = math.degrees(least), math.degrees(greatest)
    note = f'transmission angle: {low:.4g} to {high:.4g} deg'
    if limited:
        note += f' over all that the {limited} can do'
    if min(low, 180.0 - high) < _LEAST_TRANSMISSION:
        note += (
            f'; within {_LEAST_TRANSMISSION:g} deg of 0 or 180 the driven end moves little: it is '
            'hard to move, or presses hard, as in a toggle'
        )
    return note


def between(low: float, high: float) -> str:
    """Limits [deg] of an angle whose absolute value is limited."""
    if high == 180.0:
        return f'{_limit(low)} and {_limit(360.0 - low)}'
    if low == 0.0:
        return f'{_limit(-high)} and {_limit(high)}'
    return f'{_limit(low)} and {_limit(high)}, or {_limit(-high)} and {_limit(-low)}'


def _limit(angle: float) -> str:
    """A limit [deg] in six digits, or as many as distinguish it from the excluded half turn."""
    texts = (f'{angle:.{digits}g}' for digits in range(6, 18))
    return next(text for text in texts if float(text) % 180.0 or not angle % 180.0)
