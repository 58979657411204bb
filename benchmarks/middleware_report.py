"""Costs of nodes on each middleware, as text and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from benchmarks.middleware import Delay, Figure, Stream, WholeRun
from mechanism_sim import text_table


def render(figures: Sequence[Figure]) -> str:
    """Three tables for people."""
    streams = [f for f in figures if isinstance(f, Stream)]
    delays = [f for f in figures if isinstance(f, Delay)]
    runs = [f for f in figures if isinstance(f, WholeRun)]
    parts = [
        _table(
            'throughput, from a process to another, reliable and keep all',
            ('middleware', 'message', 'size [B]', 'per second', 'best', 'MB/s',
             'CPU of source [us]', 'of sink [us]', 'lost'),
            [(f.method, f.message, f'{f.size}', f'{f.rate:.0f}', f'{f.fastest:.0f}',
              f'{1e-6 * f.size * f.rate:.1f}', f'{1e6 * f.cpu_source:.1f}',
              f'{1e6 * f.cpu_sink:.1f}', f'{f.error}') for f in streams],
        ),
        _table(
            'latency',
            ('middleware', 'what', 'times', 'median [ms]', 'p99 [ms]', 'work alone [ms]',
             'CPU of both [ms]', 'lost'),
            [(f.method, f.what, f'{f.count}', _ms(f.median), _ms(f.p99), _ms(f.alone or None),
              _ms(f.cpu_per_unit), f'{f.error}') for f in delays],
        ),
        _table(
            f'whole runs of {runs[0].revolutions if runs else 0} revolutions',
            ('middleware', 'nodes', 'CPU [s]', 'wall [s]', 'CPU per revolution [ms]',
             'x real time', 'sent', 'lost', 'digest'),
            [(f.method, f.arrangement, f'{f.cpu:.2f}', f'{f.wall:.2f}', _ms(f.cpu_per_unit),
              f'{f.realtime_factor:.1f}', f'{f.sent or ""}',
              '' if f.error is None else f'{f.error}', (f.digest or '')[:8])
             for f in runs],
        ),
    ]  # fmt: skip
    return '\n\n'.join(parts)


def to_json(figures: Sequence[Figure]) -> list[dict[str, object]]:
    """Rows as those of the problems; the error is the number of messages lost, none is allowed."""
    return [_row(f) | {'tolerance': 0, 'error_unit': 'message'} for f in figures]


def _row(f: Figure) -> dict[str, object]:
    if isinstance(f, Stream):
        cpu = f.cpu_source + f.cpu_sink
        return {'problem': 'throughput', 'unit': 'message', 'cpu_per_unit': cpu, **asdict(f)}
    if isinstance(f, Delay):
        return {'problem': 'latency', 'unit': 'round', **asdict(f)}
    return {'problem': 'run of nodes', 'unit': 'revolution', **asdict(f)}


def _table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return '\n'.join([title, '', *text_table.lines([head, *rows], 2, '', rule=True)])


def _ms(seconds: float | None) -> str:
    return '' if seconds is None else f'{1e3 * seconds:.3g}'
