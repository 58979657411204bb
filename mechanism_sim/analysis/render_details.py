"""What was asked of a bag beyond its summary as text for people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from mechanism_sim.analysis.details import Average, Beside, Details, Line, Struck
from mechanism_sim.analysis.render import ROWS, table
from mechanism_sim.analysis.wear import WearMap

_LINES = 10
_ORDERS = 12
_SECTORS = 6


def render_details(details: Details) -> str:
    """Return the text that the command line shows."""
    parts = [_spectrum(name, line) for name, line in details.spectra.items()]
    parts += [_orders(name, line, details.drive) for name, line in details.orders.items()]
    parts += [_envelope(name, line) for name, line in details.envelopes.items()]
    parts += [_average(name, a, details.drive) for name, a in details.averages.items()]
    parts += [_struck(name, struck, details.drive) for name, struck in details.impacts.items()]
    parts += [_wear(name, *maps) for name, maps in details.wear.items()]
    parts += [_beside(name, beside) for name, beside in details.deviations.items()]
    return '\n\n'.join('\n'.join(lines) for lines in parts)


def _spectrum(name: str, line: Line) -> Iterator[str]:
    s = line.spectrum
    whole = float(s.values.sum()) or 1.0
    rows = ((f, x, f'{100 * x / whole:.3g} %') for f, x in s.strongest(_LINES))
    yield (
        f'power spectrum of {name}: lines {s.step:.4g} Hz apart up to {s.frequency[-1]:.4g} '
        f'Hz, RMS {math.sqrt(whole * s.step):.6g} about the mean'
    )
    yield from table(('peak at [Hz]', line.unit, 'share of the whole'), rows)


def _orders(name: str, line: Line, drive: str) -> Iterator[str]:
    yield f'orders of {name}, in cycles a turn of the {drive}'
    yield from table(('order', line.unit), line.spectrum.strongest(_LINES))


def _envelope(name: str, line: Line) -> Iterator[str]:
    low, high = line.band or (0.0, 0.0)
    yield f'spectrum of the squared envelope of {name} from {low:.4g} Hz to {high:.4g} Hz'
    yield from table(('peak at [Hz]', line.unit), line.spectrum.strongest(_LINES))


def _average(name: str, average: Average, drive: str) -> Iterator[str]:
    turns, n = average.turns, average.turns.values.shape[1]
    mean, spread = turns.mean, turns.spread
    rows = (
        (f'{math.degrees(turns.angle[k]):.4g}', mean[k], spread[k])
        for k in range(0, n, max(1, n // _ORDERS))
    )
    yield f'{name} over the angle of the {drive}: {len(turns.values)} turns of {n} angles'
    yield from table((f'{drive} [deg]', f'mean [{average.unit}]', 'standard deviation'), rows)


def _struck(name: str, struck: Struck, drive: str) -> Iterator[str]:
    rose, cycles = struck.rose, struck.cycles
    yield f'impacts in {name}: {len(rose)}; pin on {rose.pin}, bushing on {rose.bushing}'
    columns = (
        'largest', 'impulse [N s]', 'at [s]', f'{drive} [deg]', f'on {rose.pin} [deg]',
        f'on {rose.bushing} [deg]',
    )  # fmt: skip
    yield from table(
        columns,
        (
            (f'Y{i}', float(rose.normal_impulse[k]), float(rose.time[k]),
             *(float(math.degrees(x[k]))
               for x in (rose.crank_angle, rose.on_pin, rose.on_bushing)))
            for i, k in enumerate(rose.largest, 1)
        ),
    )  # fmt: skip
    if cycles is None:
        return
    names = {'count': 'impacts', 'impulse': 'sum of impulses [N s]', 'I_n': 'I_n [N s]'}
    rows = ((names[key], *figures) for key, figures in cycles.means.items())
    head = f'{len(cycles.count)} turns', 'mean', '+/- (95 %)', 'standard deviation'
    yield from ('', *table(head, rows), '')
    by_turn: list[Sequence[str | int | float]] = [
        [
            str(cycles.first + i), int(cycles.count[i]), float(cycles.impulse[i]),
            *(
                '' if k < 0 else f'{math.degrees(rose.crank_angle[k]):.4g} deg '
                f'{rose.normal_impulse[k]:.3g}'
                for k in cycles.dominant[i]
            ),
        ]
        for i in range(len(cycles.count))
    ]  # fmt: skip
    if len(by_turn) > ROWS:
        by_turn = [*by_turn[: ROWS // 2], ['...', '', '', '', '', ''], *by_turn[-ROWS // 2 :]]
    yield from table(('turn', 'impacts', '[N s]', 'first', 'second', 'third'), by_turn)


def _wear(name: str, bushing: WearMap, pin: WearMap) -> Iterator[str]:
    yield f'wear in {name}'
    yield from (*_map('bushing', bushing), *_map('pin', pin))


def _map(part: str, wear: WearMap) -> Iterator[str]:
    yield (
        f'  {part} on {wear.link}: impulses of impacts {wear.impulse.sum():.6g} N s, force times '
        f'way {wear.load_way.sum():.6g} N m, sliding work {wear.work.sum():.6g} J'
    )
    hardest = sorted(range(len(wear.load_way)), key=lambda k: -wear.load_way[k])[:_SECTORS]
    columns = 'direction [deg]', 'N m', 'J', 'impacts [N s]'
    yield from table(
        columns,
        (
            (f'{math.degrees(wear.middles[k]):.4g}', float(wear.load_way[k]),
             float(wear.work[k]), float(wear.impulse[k]))
            for k in sorted(hardest)
        ),
    )  # fmt: skip


def _beside(name: str, beside: Beside) -> Iterator[str]:
    d = beside.deviation
    ideal = float((d.ideal.values**2).mean()) ** 0.5
    yield (
        f'{name} beside the ideal machine: deviation {d.rms:.6g} {beside.unit} RMS, the ideal '
        f'{ideal:.6g}'
    )
    if beside.alpha:
        a = beside.alpha
        yield f'  alpha over {beside.against}: {a.rms:.6g} by RMS, {a.spectrum:.6g} by spectrum'
        rows = zip(map(str, a.order[:_ORDERS]), a.by_order[:_ORDERS].tolist(), strict=True)
        yield from table(('order', 'alpha'), rows)
