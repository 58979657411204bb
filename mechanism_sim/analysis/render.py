"""The summary of a run as text for people."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any

from mechanism_sim import text_table
from mechanism_sim.analysis.delivery_audit import Ledger
from mechanism_sim.analysis.impacts import ImpactSummary
from mechanism_sim.analysis.loads import LoadSummary, Peak
from mechanism_sim.analysis.modes import JointModes
from mechanism_sim.analysis.published import PARTS, EnergySummary, PartSummary
from mechanism_sim.analysis.summary import Summary
from mechanism_sim.analysis.vibration import SensorSummary
from mechanism_sim.results.means import Mean
from mechanism_sim.text_table import Cell

ROWS = 12  # of a table of revolutions, before its middle is left out


def render(summary: Summary) -> str:
    """Return the text that the command line shows."""
    s = summary
    drive = s.motion.crank if s.motion else ''
    found: list[tuple[Any, Callable[[Any], Iterable[str]]]] = [
        (s, _head),
        (s.impacts, partial(_impacts, drive)),
        (s.modes, _modes),
        (s.loads, partial(_loads, drive)),
        (s.energy, _energy),
        *((parts, partial(_parts, PARTS[topic].title)) for topic, parts in s.parts.items()),
        (s.vibration, _vibration),
        (s.ledger, _ledger),
        (s.absent or None, _absent),
    ]
    return '\n\n'.join('\n'.join(lines(of)) for of, lines in found if of is not None)


def _head(s: Summary) -> Iterator[str]:
    lines = [
        ('bag', s.bag if s.complete else f'{s.bag} (CUT SHORT: what could be read is analysed)'),
        ('scene', s.scene or 'not recorded'),
        ('run', f'{s.start:.9g} s to {s.end:.9g} s'),
    ]
    if s.motion is not None:
        m = s.motion
        how = f'slides, {m.mean_speed:.6g} m/s on average'
        if m.revolutions is not None:
            rpm = m.mean_speed * 30 / math.pi
            how = f'{m.revolutions:.9g} revolutions, {rpm:.6g} rpm on average'
        lines += [
            (m.crank, how),
            ('motion', f'{m.segments} segments of {", ".join(m.coordinates)}'),
        ]
        lines += [('MISSING', f'motion from {a:.9g} s to {b:.9g} s') for a, b in m.gaps]
    if s.digest is not None:
        lines.append(('digest', s.digest))
    width = max(len(key) for key, _ in lines)
    yield from (f'{key:<{width}}  {value}' for key, value in lines)


def _impacts(drive: str, impacts: ImpactSummary) -> Iterator[str]:
    yield f'impacts: {impacts.count}, normal impulse {impacts.normal_impulse:.6g} N s'
    if impacts.means is not None:
        count, impulse, _ = impacts.means
        yield (
            f'  per revolution {count.shown()}, {impulse.shown()} N s '
            f'(95 %, over the last {count.revolutions})'
        )
    elif impacts.count_per_revolution is not None:
        yield (
            f'  per revolution {impacts.count_per_revolution:.6g}, '
            f'{impacts.normal_impulse_per_revolution:.6g} N s'
        )
    if impacts.joints:
        yield from table(
            ('joint', 'impacts', 'impulse [N s]', 'I_n [N s]', 'loss [J]', 'fastest [m/s]'),
            (
                (j.joint, j.count, j.normal_impulse,
                 Mean('I_n', 'N s', j.I_n, j.I_n_half_width).shown(), j.energy_loss,
                 j.largest_approach_speed)
                for j in impacts.joints
            ),
        )  # fmt: skip
    by_turn = impacts.table
    if by_turn is not None and by_turn.joints:
        head_row = ['revolution']
        for joint in by_turn.joints:
            head_row += [joint, '[N s]']
        rows = [
            [str(k), *(x for pair in zip(counts, sums, strict=True) for x in pair)]
            for k, (counts, sums) in enumerate(
                zip(by_turn.count.tolist(), by_turn.normal_impulse.tolist(), strict=True)
            )
        ]
        if len(rows) > ROWS:
            rows = [*rows[: ROWS // 2], ['...'] + [''] * (len(head_row) - 1), *rows[-ROWS // 2 :]]
        yield from table(head_row, rows)
        if by_turn.elsewhere:
            yield f'  {by_turn.elsewhere} at times of which the motion is not recorded'
    for j in impacts.joints:
        for d in j.dominant:
            yield (
                f'  hardest in {j.joint}: {d.normal_impulse:.6g} N s at {d.time:.9g} s'
                f'{_at_angle(drive, d.crank_angle)}, {d.approach_speed:.6g} m/s'
            )


def _modes(joints: tuple[JointModes, ...]) -> Iterator[str]:
    names = sorted({mode for joint in joints for mode in joint.share})
    rows = [
        [j.joint, str(j.changes), *(f'{100 * j.share.get(mode, 0.0):.4g} %' for mode in names)]
        for j in joints
    ]
    yield 'modes: share of time'
    yield from table(('joint', 'changes', *names), rows)


def _loads(drive: str, loads: LoadSummary) -> Iterator[str]:
    def row(peak: Peak, unit: str) -> tuple[str, str, float, str, str, str]:
        angle = '' if peak.crank_angle is None else f'{math.degrees(peak.crank_angle):.4g} deg'
        value, least = f'{peak.value:.6g} {unit}', '' if peak.whole else '>= '
        if peak.duration is None or peak.impulse is None:
            return peak.name, value, peak.time, angle, '', ''
        impulse = f'{least}{peak.impulse:.4g} {unit.rstrip()} s'
        return peak.name, value, peak.time, angle, f'{least}{peak.duration:.4g} s', impulse

    rows = [row(peak, 'N  ') for peak in loads.joints] + [row(loads.drive_torque, 'N m')]
    rows += [row(peak, 'N m') for peak in loads.moments]
    published = '' if loads.samples is None else f', of {loads.samples} published instants'
    yield f'loads between impacts{published}'
    if any(row[4] for row in rows):
        yield from table(('joint', 'largest', 'at [s]', drive, 'above half for', 'impulse'), rows)
    else:
        yield from table(('joint', 'largest', 'at [s]', drive), [row[:4] for row in rows])


def _energy(e: EnergySummary) -> Iterator[str]:
    share = e.largest_residual / e.exchanged if e.exchanged else 0.0
    yield (
        f'energy [J]: {e.initial:.6g} + drive {e.drive_work:.6g} '
        f'- dissipated {e.dissipated:.6g} = {e.final:.6g}'
    )
    yield (
        f'  residual {e.residual_at_end:.3g} at the end; among {e.samples} published instants '
        f'at most {e.largest_residual:.3g}'
    )
    yield f'  ({share:.1g} of what was exchanged) at {e.largest_residual_time:.9g} s'


def _parts(title: str, parts: tuple[PartSummary, ...]) -> Iterator[str]:
    published = f': ranges of {sum(p.samples for p in parts)} published instants'
    yield f'{title}, in SI units{"" if all(p.of_motion for p in parts) else published}'
    for p in parts:
        share = ', '.join(f'{name} {100 * x:.4g} %' for name, x in p.share.items())
        rows = ((r.quantity, r.lowest, r.lowest_time, r.highest, r.highest_time) for r in p.ranges)
        yield f'  {p.joint}: {share}' if share else f'  {p.joint}'
        yield from table(('quantity', 'lowest', 'at [s]', 'highest', 'at [s]'), rows)


def _vibration(sensors: tuple[SensorSummary, ...]) -> Iterator[str]:
    rows = (
        (
            f'{s.sensor} on {s.link}',
            s.samples,
            s.missing,
            f'{s.rms:.6g} {s.unit}',
            s.peak,
            '' if s.crest is None else s.crest,
            '' if s.kurtosis is None else s.kurtosis,
        )
        for s in sensors
    )
    head = ('sensor', 'samples', 'missing', 'RMS', 'peak', 'crest', 'kurtosis')
    yield from ('vibration', *table(head, rows))
    for s in sensors:
        if s.orders:
            strongest = ', '.join(f'{order:.4g} ({size:.4g} {s.unit})' for order, size in s.orders)
            yield f'  strongest orders of {s.sensor}: {strongest}'
    for s in sensors:
        if s.overloads:
            yield f'  {s.sensor}: {s.overloads} samples were CUT at the end of the range'


def _ledger(ledger: Ledger) -> Iterator[str]:
    total = sum(account.sent for account in ledger.topics)
    if not ledger.lost:
        yield f'messages: all {total} that were sent are recorded'
    else:
        yield f'messages: {ledger.lost} of {total} are LOST'
        rows = ((a.topic, a.sent, a.recorded, a.lost) for a in ledger.topics if a.lost)
        yield from table(('topic', 'sent', 'recorded', 'lost'), rows)
    if ledger.unfinished:
        names = ', '.join(ledger.unfinished)
        yield f'  {names} did not finish: more may have been sent'


def _absent(sentences: tuple[str, ...]) -> Iterator[str]:
    yield 'not in this bag'
    yield from (f'  {line}' for line in sentences)


def _at_angle(drive: str, angle: float | None) -> str:
    """The angle of the driven coordinate, by its name: it need not be that of a crank."""
    return '' if angle is None else f', {drive} at {math.degrees(angle):.4g} deg'


def table(head: Sequence[str], rows: Iterable[Sequence[Cell]]) -> list[str]:
    """Lines of a table with a head."""
    return text_table.lines([head, *rows])
