"""Summary of a bag, and further requested results, in sections."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

from mechanism_sim.analysis.collectors import (
    FieldRange,
    SensorSummary,
)
from mechanism_sim.analysis.details import Details, ImpactDetails
from mechanism_sim.analysis.published import PARTS, PartSummary, PublishedRange
from mechanism_sim.analysis.roses import WearMap
from mechanism_sim.analysis.summary import ImpactSummary, Summary
from mechanism_sim.errors import InputError
from mechanism_sim.recording.inventory import is_being_recorded
from mechanism_sim.report.sections import Section, SummaryRow, text
from mechanism_sim.report.summary import energy_rows, impact_rows, load_rows
from mechanism_sim.results.turns import Mean
from mechanism_sim.sensing.indicators import indicators
from mechanism_sim.sensing.spectra import severity, severity_spectrum
from mechanism_sim.signal_files import ChannelSamples, rate_text
from mechanism_sim.text_table import Cell, lines
from mechanism_sim.units import instant

_LITTLE = 0.1  # share of the power of a signal: a smaller envelope is not that of its main part
_LOGGED = 1e-6  # [s] tolerance of stamps relative to the time above
_EPOCH = 1e9  # [s]: later times count from 1970
_ROWS = 12  # rows of a table of revolutions before its middle is left out
_LINES = 10
_ORDERS = 12
_SECTORS = 6
_SHORTEST, _SLOWEST = 0.2, 20.0  # [s], [Hz]: a severity is of whole periods of 10 Hz


def render(summary: Summary) -> str:
    """Return the text that the command line shows."""
    return text(sections(summary))


def channel_figures(channels: Mapping[str, ChannelSamples]) -> dict[str, dict[str, Any]]:
    """Figures of the channels of a file of signals, by name, in their units."""
    figures = {}
    for name, c in channels.items():
        found = indicators(c.values)
        figures[name] = {
            'unit': c.unit, 'samples': found.samples, 'rate': c.rate, 'rate_error': c.rate_error,
            'start': float(c.times[0]), 'end': float(c.times[-1]),
            'smallest': float(c.values.min()), 'largest': float(c.values.max()),
            'mean': found.mean, 'rms': found.rms, 'peak': found.peak, 'crest': found.crest,
            'kurtosis': found.kurtosis, 'velocity_rms': _severity(c),
        }  # fmt: skip
    return figures


def _severity(c: ChannelSamples) -> float | None:
    """Severity [m/s] of an acceleration; None of what does not show 10 Hz."""
    try:
        runs = replace(c, values=c.in_unit('m/s^2')).runs if c.unit and c.rate else []
    except InputError:
        return None
    longest = max(map(len, runs), default=0)
    if not c.rate or c.rate <= _SLOWEST or longest < _SHORTEST * c.rate:
        return None
    return severity(severity_spectrum(runs, c.rate))


def render_channels(figures: Mapping[str, Mapping[str, Any]]) -> str:
    """Table of the figures of channels."""
    head = [key for key in next(iter(figures.values())) if key != 'rate_error']
    if all(own['velocity_rms'] is None for own in figures.values()):
        head.remove('velocity_rms')
    rows = [[name, *(_cell(own, key) for key in head)] for name, own in figures.items()]
    units = {'rate': 'rate [Hz]', 'start': 'start [s]', 'end': 'end [s]',
             'velocity_rms': 'velocity rms [mm/s]'}  # fmt: skip
    return '\n'.join(lines([['channel', *(units.get(key, key) for key in head)], *rows], 2))


def _cell(own: Mapping[str, Any], key: str) -> Cell:
    """A figure of a channel; empty if it has none."""
    if key == 'rate':
        return rate_text(own['rate'], own['rate_error'])
    if key == 'velocity_rms' and own[key] is not None:
        return 1e3 * float(own[key])
    return '' if own[key] is None else own[key]


def render_details(details: Details) -> str:
    """Return the text of the requested results for the command line."""
    return text(_detail_sections(details))


def sections(s: Summary) -> Iterator[Section]:
    """The parts of a summary that are known."""
    drive = s.motion.crank if s.motion else ''
    yield Section(rows=[*_head(s)])
    if s.impacts is not None:
        yield from _impacts(drive, s.impacts)
    if s.modes is not None:
        names = sorted({mode for joint in s.modes for mode in joint.share})
        rows = [
            [j.joint, str(j.changes), *(f'{100 * j.share.get(mode, 0.0):.4g} %' for mode in names)]
            for j in s.modes
        ]
        yield Section('modes: share of time', table=[('joint', 'changes', *names), *rows])
    if s.loads is not None:
        published = '' if s.loads.samples is None else f', of {s.loads.samples} published instants'
        yield Section(f'loads between impacts{published}', table=load_rows(drive, s.loads))
    if s.energy is not None:
        e = s.energy
        share = e.largest_residual / e.exchanged if e.exchanged else 0.0
        balance = e.initial, e.final, e.drive_work, e.dissipated, e.residual_at_end, e.exchanged
        note = (
            f'among {e.samples} published instants at most {e.largest_residual:.3g} J are missing '
            f'({share:.1g} of what was exchanged), at {instant(e.largest_residual_time)} s'
        )
        title = f'energy from {instant(e.start)} s to {instant(e.end)} s'
        yield Section(title, [*energy_rows(*balance)], notes=[note])
    for topic, parts in s.parts.items():
        yield from _parts(PARTS[topic].title, parts)
    if s.vibration is not None:
        yield _vibration(s.vibration)
    if s.ledger is not None:
        total = sum(account.sent for account in s.ledger.topics)
        table: list[Sequence[Cell]] = []
        heading = f'messages: all {total} that were sent are recorded'
        if s.ledger.lost:
            heading = f'messages: {s.ledger.lost} of {total} are LOST'
            lost = [(a.topic, a.sent, a.recorded, a.lost) for a in s.ledger.topics if a.lost]
            table = [('topic', 'sent', 'recorded', 'lost'), *lost]
        nodes = ', '.join(s.ledger.unfinished)
        unknown = [f'{nodes} did not finish: more may have been sent'] if nodes else []
        yield Section(heading, table=table, notes=unknown)
    if s.fields:
        yield _fields(s.fields, s.start, s.end)
    if s.absent:
        yield Section('not in this bag', notes=s.absent)


def _head(s: Summary) -> Iterator[SummaryRow]:
    state = 'STILL BEING RECORDED' if is_being_recorded(s.bag) else 'CUT SHORT'
    words = '' if s.complete else f'{state}: what could be read is analysed'
    yield SummaryRow('bag', s.bag, words=words)
    yield SummaryRow('scene', s.scene or 'not recorded')
    early = ''
    if s.ended_early and s.planned_end is not None:
        early = f'ENDED EARLY: it was to last until {instant(s.planned_end)} s'
    origin = s.start if s.start > _EPOCH else 0.0  # all other times count from there
    if origin:
        early = f'from {datetime.fromtimestamp(origin, UTC):%Y-%m-%d %H:%M:%S} UTC on'
    end = round(s.end - origin, 6) if origin else s.end  # what a float of 1970 on resolves
    span = f'{instant(s.start - origin)} s to {instant(end)}'
    yield SummaryRow('time', span, 's', words=early)
    if s.motion is not None:
        m = s.motion
        how = f'slides, {m.mean_speed:.6g} m/s on average'
        if m.revolutions is not None:
            rpm = m.mean_speed * 30 / math.pi
            how = f'{m.revolutions:.9g} revolutions, {rpm:.6g} rpm on average'
        yield SummaryRow(m.crank, how)
        yield SummaryRow('motion', f'{m.segments} segments of {", ".join(m.coordinates)}')
        yield from (
            SummaryRow('MISSING', f'motion from {instant(a)} s to {instant(b)}', 's')
            for a, b in m.gaps
        )
    if s.digest is not None:
        yield SummaryRow('digest', s.digest)


def _impacts(drive: str, impacts: ImpactSummary) -> Iterator[Section]:
    rows = [*impact_rows(impacts.count, impacts.normal_impulse, impacts.means)]
    if impacts.means is None and impacts.count_per_revolution is not None:
        per = impacts.count_per_revolution, impacts.normal_impulse_per_revolution or 0.0
        rows.append(SummaryRow('per revolution', f'{per[0]:.6g} impacts, {per[1]:.6g}', 'N s'))
    table: list[Sequence[Cell]] = [
        (j.joint, j.count, j.normal_impulse, Mean('I_n', 'N s', j.I_n, j.I_n_half_width).shown(),
         j.energy_loss, j.largest_approach_speed)
        for j in impacts.joints
    ]  # fmt: skip
    if table:
        head = 'joint', 'impacts', 'impulse [N s]', 'I_n [N s]', 'loss [J]', 'fastest [m/s]'
        table.insert(0, head)
    hardest = [
        f'hardest impact in {j.joint}: {d.normal_impulse:.6g} N s at {instant(d.time)} '
        f's{_at_angle(drive, d.crank_angle)}, {d.approach_speed:.6g} m/s'
        for j in impacts.joints
        for d in j.dominant
    ]
    yield Section('impacts', rows, table, hardest)
    by_turn = impacts.table
    if by_turn is None or not by_turn.joints:
        return
    turns = zip(by_turn.count.tolist(), by_turn.normal_impulse.tolist(), strict=True)
    cells = [
        [str(k), *(x for pair in zip(*both, strict=True) for x in pair)]
        for k, both in enumerate(turns)
    ]
    head_row = ['revolution', *(x for joint in by_turn.joints for x in (joint, '[N s]'))]
    elsewhere = f'{by_turn.elsewhere} at times of which the motion is not recorded'
    notes = [elsewhere] if by_turn.elsewhere else []
    yield Section('impacts by revolution', (), [head_row, *_without_middle(cells)], notes)


def _without_middle(rows: Sequence[Sequence[Cell]]) -> list[Sequence[Cell]]:
    """The first and the last rows of many."""
    if len(rows) <= _ROWS:
        return [*rows]
    return [*rows[: _ROWS // 2], ['...'] + [''] * (len(rows[0]) - 1), *rows[-_ROWS // 2 :]]


def _parts(title: str, parts: tuple[PartSummary, ...]) -> Iterator[Section]:
    published = f': ranges of {sum(p.samples for p in parts)} published instants'
    yield Section(f'{title}, in SI units{"" if all(p.of_motion for p in parts) else published}')
    head = 'quantity', 'lowest', 'at [s]', 'highest', 'at [s]'
    for p in parts:
        share = ', '.join(f'{name} {100 * x:.4g} %' for name, x in p.share.items())
        rows = [(r.quantity, *_ends(r)) for r in p.ranges]
        yield Section(rows=[SummaryRow(p.joint, share)], table=[head, *rows])


def _ends(r: PublishedRange) -> tuple[Cell, ...]:
    return r.lowest, instant(r.lowest_time, 6), r.highest, instant(r.highest_time, 6)


def _fields(fields: tuple[FieldRange, ...], start: float, end: float) -> Section:
    head = 'field', 'unit', 'samples', 'lowest', 'at [s]', 'highest', 'at [s]'
    rows: list[Sequence[Cell]] = []
    for f in fields:
        count = f'{f.samples - f.unknown} of {f.samples}' if f.unknown else f.samples
        rows.append((f.quantity, f.unit, count, *_ends(f)))
    first, last = (0.0, end - start) if start > _EPOCH else (start, end)
    apart = any(f.start < first - _LOGGED or f.end > last + _LOGGED for f in fields)
    notes = ['these times are stamps: they differ from when messages were logged'] * apart
    return Section('numbers in its messages', table=[head, *rows], notes=notes, left=2)


def _vibration(sensors: tuple[SensorSummary, ...]) -> Section:
    rows: list[Sequence[Cell]] = [
        (f'{s.sensor} on {s.link}', s.samples, s.missing, f'{s.rms:.6g} {s.unit}', s.peak,
         '' if s.crest is None else s.crest, '' if s.kurtosis is None else s.kurtosis)
        for s in sensors
    ]  # fmt: skip
    notes = [
        f'strongest orders of {s.sensor}: '
        + ', '.join(f'{order:.4g} ({size:.4g} {s.unit})' for order, size in s.orders)
        for s in sensors
        if s.orders
    ]
    notes += [
        f'{s.sensor}: {s.overloads} samples were CUT at the end of the range'
        for s in sensors
        if s.overloads
    ]
    head = 'sensor', 'samples', 'missing', 'RMS', 'peak', 'crest', 'kurtosis'
    return Section('vibration', table=[head, *rows], notes=notes)


def _at_angle(drive: str, angle: float | None) -> str:
    """The angle of the driven coordinate, by its name: it need not be that of a crank."""
    return '' if angle is None else f', {drive} at {math.degrees(angle):.4g} deg'


def _detail_sections(details: Details) -> Iterator[Section]:
    """All requested results."""
    drive = details.drive
    for name, line in details.spectra.items():
        s = line.spectrum
        whole = float(s.values.sum())
        rows = [(f, x, f'{100 * x / whole:.3g} %') for f, x in s.strongest(_LINES)]
        rms = f'{math.sqrt(whole * s.step):.6g} {line.signal_unit}'.rstrip()
        title = (
            f'power spectrum of {name}: lines {s.step:.4g} Hz apart up to {s.frequency[-1]:.4g} '
            f'Hz, RMS {rms} of all lines'
        )
        head = 'peak at [Hz]', line.unit, 'share of all lines'
        yield Section(
            title, table=[head, *rows], notes=['RMS and shares are those about the mean']
        )
    for name, line in details.orders.items():
        title = f'orders of {name}, in cycles a turn of the {drive}'
        yield Section(title, table=[('order', line.unit), *line.spectrum.strongest(_LINES)])
    for name, line in details.envelopes.items():
        low, high = line.band or (0.0, 0.0)
        title = f'spectrum of the squared envelope of {name} from {low:.4g} Hz to {high:.4g} Hz'
        peaks, share = line.spectrum.strongest(_LINES), line.share or 0.0
        little = (
            f'the band holds {100.0 * share:.2g} % of the power of the signal: --band gives '
            'another'
        )
        notes = [little] * (share < _LITTLE)
        yield Section(title, table=[('peak at [Hz]', line.unit), *peaks], notes=notes)
    for name, average in details.averages.items():
        turns, n = average.turns, average.turns.values.shape[1]
        mean, spread = turns.mean, turns.spread
        means = [
            (f'{math.degrees(turns.angle[k]):.4g}', mean[k], spread[k])
            for k in range(0, n, max(1, n // _ORDERS))
        ]
        title = f'{name} over the angle of the {drive}: {turns.text} of {n // turns.turns} angles'
        columns = f'{drive} [deg]', f'mean [{average.unit}]', 'standard deviation'
        yield Section(title, table=[columns, *means])
    for name, hits in details.impacts.items():
        yield from _impact_details(name, hits, drive)
    for name, (bushing, pin) in details.wear.items():
        yield from (_map(f'bushing of {name}', bushing), _map(f'pin of {name}', pin))
    for name, beside in details.deviations.items():
        d, a = beside.deviation, beside.alpha
        ideal = float((d.ideal.values**2).mean()) ** 0.5
        yield Section(
            f'{name} beside the ideal machine: deviation {d.rms:.6g} {beside.unit} RMS, the ideal '
            f'{ideal:.6g}'
        )
        if a is not None:
            orders = zip(map(str, a.order[:_ORDERS]), a.by_order[:_ORDERS].tolist(), strict=True)
            yield Section(
                f'alpha over {beside.against}: {a.rms:.6g} by RMS, {a.spectrum:.6g} by spectrum',
                table=[('order', 'alpha'), *orders],
            )


def _impact_details(name: str, hits: ImpactDetails, drive: str) -> Iterator[Section]:
    rose, cycles = hits.rose, hits.cycles
    angles = rose.crank_angle, rose.on_pin, rose.on_bushing
    largest: list[Sequence[Cell]] = [
        (str(i), float(rose.normal_impulse[k]), float(rose.time[k]),
         *(float(math.degrees(x[k])) for x in angles))
        for i, k in enumerate(rose.largest, 1)
    ]  # fmt: skip
    head = ('largest', 'impulse [N s]', 'at [s]', f'{drive} [deg]', f'on {rose.pin} [deg]',
            f'on {rose.bushing} [deg]')  # fmt: skip
    title = f'impacts in {name}: {len(rose)}; pin on {rose.pin}, bushing on {rose.bushing}'
    yield Section(title, table=[head, *largest])
    if cycles is None:
        return
    names = {'count': 'impacts', 'impulse': 'sum of impulses [N s]', 'I_n': 'I_n [N s]'}
    means: list[Sequence[Cell]] = [(names[k], *found) for k, found in cycles.means.items()]
    columns = f'{len(cycles.count)} turns', 'mean', '+/- (95 %)', 'standard deviation'
    yield Section(table=[columns, *means])
    by_turn: list[Sequence[Cell]] = [
        [str(cycles.first + i), int(cycles.count[i]), float(cycles.impulse[i]),
         *('' if k < 0 else f'{math.degrees(rose.crank_angle[k]):.4g} deg '
           f'{rose.normal_impulse[k]:.3g}' for k in cycles.dominant[i])]
        for i in range(len(cycles.count))
    ]  # fmt: skip
    by = 'turn', 'impacts', '[N s]', 'first', 'second', 'third'
    yield Section(table=[by, *_without_middle(by_turn)])


def _map(part: str, wear: WearMap) -> Section:
    title = (
        f'wear of the {part} on {wear.link}: impulses of impacts {wear.impulse.sum():.6g} N s, '
        f'force times sliding distance {wear.load_way.sum():.6g} N m, '
        f'sliding work {wear.work.sum():.6g} J'
    )
    hardest = sorted(range(len(wear.load_way)), key=lambda k: -wear.load_way[k])[:_SECTORS]
    rows = [  # in as many digits as hold, see `wear_sums`
        (f'{math.degrees(wear.middles[k]):.4g}',
         *(f'{x[k]:.3g}' for x in (wear.load_way, wear.work, wear.impulse)))
        for k in sorted(hardest)
    ]  # fmt: skip
    return Section(title, table=[('direction [deg]', 'N m', 'J', 'impacts [N s]'), *rows])
