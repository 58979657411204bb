"""The summary of a run as text for people."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from mechanism_sim import text_table
from mechanism_sim.analysis.delivery_audit import Ledger
from mechanism_sim.analysis.impacts import ImpactSummary
from mechanism_sim.analysis.loads import EnergySummary, LoadSummary, Peak
from mechanism_sim.analysis.modes import JointModes
from mechanism_sim.analysis.parts import PARTS, PartSummary
from mechanism_sim.analysis.summary import Summary
from mechanism_sim.analysis.vibration import SensorSummary
from mechanism_sim.text_table import Cell

ROWS = 12  # of a table of revolutions, before its middle is left out


def render(summary: Summary) -> str:
    """Return the text that the command line shows."""
    parts = [_head(summary)]
    if summary.impacts is not None:
        parts.append(_impacts(summary.impacts))
    if summary.modes is not None:
        parts.append(_modes(summary.modes))
    if summary.loads is not None:
        parts.append(_loads(summary.loads))
    if summary.energy is not None:
        parts.append(_energy(summary.energy))
    parts += [_parts(PARTS[topic].title, found) for topic, found in summary.parts.items()]
    if summary.vibration is not None:
        parts.append(_vibration(summary.vibration))
    if summary.ledger is not None:
        parts.append(_ledger(summary.ledger))
    if summary.absent:
        parts.append('\n'.join(['not in this bag', *(f'  {line}' for line in summary.absent)]))
    return '\n\n'.join(parts)


def _head(s: Summary) -> str:
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
    return '\n'.join(f'{key:<{width}}  {value}' for key, value in lines)


def _impacts(impacts: ImpactSummary) -> str:
    head = f'impacts: {impacts.count}, normal impulse {impacts.normal_impulse:.6g} N s'
    if impacts.count_per_revolution is not None:
        head += (
            f'; per revolution {impacts.count_per_revolution:.6g}, '
            f'{impacts.normal_impulse_per_revolution:.6g} N s'
        )
    lines = [head]
    if impacts.joints:
        lines += table(
            ('joint', 'impacts', 'impulse [N s]', 'I_n [N s]', 'loss [J]', 'fastest [m/s]'),
            (
                (j.joint, j.count, j.normal_impulse, j.I_n, j.energy_loss,
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
        lines += table(head_row, rows)
        if by_turn.elsewhere:
            lines.append(f'  {by_turn.elsewhere} at times of which the motion is not recorded')
    lines += [
        f'  hardest in {j.joint}: {d.normal_impulse:.6g} N s at {d.time:.9g} s'
        f'{_at_angle(d.crank_angle)}, {d.approach_speed:.6g} m/s'
        for j in impacts.joints
        for d in j.dominant
    ]
    return '\n'.join(lines)


def _modes(joints: tuple[JointModes, ...]) -> str:
    names = sorted({mode for joint in joints for mode in joint.share})
    rows = [
        [j.joint, str(j.changes), *(f'{100 * j.share.get(mode, 0.0):.4g} %' for mode in names)]
        for j in joints
    ]
    return '\n'.join(['modes: share of time', *table(('joint', 'changes', *names), rows)])


def _loads(loads: LoadSummary) -> str:
    def row(peak: Peak, unit: str) -> tuple[str, str, float, str]:
        angle = '' if peak.crank_angle is None else f'{math.degrees(peak.crank_angle):.4g} deg'
        return peak.name, f'{peak.value:.6g} {unit}', peak.time, angle

    rows = [row(peak, 'N  ') for peak in loads.joints] + [row(loads.drive_torque, 'N m')]
    head = ('joint', 'largest', 'at [s]', 'crank')
    title = 'loads between impacts'
    if loads.samples is not None:
        title += f', of {loads.samples} published instants'
    return '\n'.join([title, *table(head, rows)])


def _energy(e: EnergySummary) -> str:
    share = e.largest_residual / e.largest_energy if e.largest_energy else 0.0
    return '\n'.join(
        [
            f'energy [J]: {e.initial:.6g} + drive {e.drive_work:.6g} '
            f'- dissipated {e.dissipated:.6g} = {e.final:.6g}',
            f'  residual {e.residual_at_end:.3g} at the end; among {e.samples} published instants '
            f'at most {e.largest_residual:.3g}',
            f'  ({share:.1g} of the largest term) at {e.largest_residual_time:.9g} s',
        ]
    )


def _parts(title: str, parts: tuple[PartSummary, ...]) -> str:
    lines = [f'{title}, in SI units']
    if not all(p.of_motion for p in parts):
        lines[0] += f': ranges of {sum(p.samples for p in parts)} published instants'
    for p in parts:
        share = ', '.join(f'{name} {100 * x:.4g} %' for name, x in p.share.items())
        rows = ((r.quantity, r.lowest, r.lowest_time, r.highest, r.highest_time) for r in p.ranges)
        lines += [f'  {p.joint}: {share}' if share else f'  {p.joint}']
        lines += table(('quantity', 'lowest', 'at [s]', 'highest', 'at [s]'), rows)
    return '\n'.join(lines)


def _vibration(sensors: tuple[SensorSummary, ...]) -> str:
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
    lines = ['vibration', *table(head, rows)]
    for s in sensors:
        if s.orders:
            strongest = ', '.join(f'{order:.4g} ({size:.4g} {s.unit})' for order, size in s.orders)
            lines.append(f'  strongest orders of {s.sensor}: {strongest}')
    lines += [
        f'  {s.sensor}: {s.overloads} samples were CUT at the end of the range'
        for s in sensors
        if s.overloads
    ]
    return '\n'.join(lines)


def _ledger(ledger: Ledger) -> str:
    total = sum(account.sent for account in ledger.topics)
    if not ledger.lost:
        lines = [f'messages: all {total} that were sent are recorded']
    else:
        lines = [f'messages: {ledger.lost} of {total} are LOST']
        lost = [a for a in ledger.topics if a.lost]
        rows = ((a.topic, a.sent, a.recorded, a.lost) for a in lost)
        lines += table(('topic', 'sent', 'recorded', 'lost'), rows)
    if ledger.unfinished:
        names = ', '.join(ledger.unfinished)
        lines.append(f'  {names} did not finish: more may have been sent')
    return '\n'.join(lines)


def _at_angle(angle: float | None) -> str:
    return '' if angle is None else f', crank at {math.degrees(angle):.4g} deg'


def table(head: Sequence[str], rows: Iterable[Sequence[Cell]]) -> list[str]:
    """Lines of a table with a head."""
    return text_table.lines([head, *rows])
