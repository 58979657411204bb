"""The film of the README, and the preview picture of links to the site.

``python docs/worn_film.py`` writes docs/pictures/worn.gif and docs/site/static/social.png, a
bearing at four clearances, seen through a lens, and measured by an accelerometer.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

sys.path.insert(0, str(Path(__file__).parent / 'site'))
from worn import RADII, SENSOR, SHOWN, run_at, spectrum_of

from mechanism_sim.analysis.record import Record

FILE = Path(__file__).parent / 'pictures' / 'worn.gif'
SOCIAL = Path(__file__).parent / 'site' / 'static' / 'social.png'
FPS, FRAMES = 10, 20
CHOSEN = 0.0254, 0.0762, 0.1778, 0.254
BLUE, RED, GREY = '#1f5f99', '#c4342d', '0.75'


def main() -> None:
    """Run the machines, and draw them."""
    records = {radius: Record(*run_at(radius), {}) for radius in RADII if radius in CHOSEN}
    figure = Figure(figsize=(6.8, 2.95), dpi=100)
    lens = figure.add_axes((0.005, 0.02, 0.40, 0.80))
    trace = figure.add_axes((0.50, 0.62, 0.48, 0.24))
    lines = figure.add_axes((0.50, 0.15, 0.48, 0.29))
    heading = figure.text(0.02, 0.92, '', fontsize=12, weight='bold')
    spectra = {radius: np.array(spectrum_of(record)).T for radius, record in records.items()}
    period = next(iter(records.values())).machine.drive.period
    start, end = SHOWN[0] * period, (SHOWN[0] + 1) * period
    for axes in (trace, lines):
        axes.spines[['top', 'right']].set_visible(False)
        axes.tick_params(labelsize=7)

    def frame(number: int) -> None:
        radius = CHOSEN[number // FRAMES]
        record, share = records[radius], (number % FRAMES) / (FRAMES - 1)
        now = start + share * (end - start)
        heading.set_text(f'Radial clearance {1e3 * radius:g} µm')
        _lens(lens, record, now, 1e-3 * radius)
        _trace(trace, record, (start, end), now)
        lines.clear()
        lines.spines[['top', 'right']].set_visible(False)
        for other, (f, level) in spectra.items():
            chosen = other == radius
            lines.plot(f, level, lw=1.3 if chosen else 0.7, color=BLUE if chosen else GREY,
                       zorder=3 if chosen else 1)  # fmt: skip
        lines.set_title('measured: spectrum of the accelerometer [dB]', fontsize=8, loc='left')
        lines.set_xlabel('frequency [Hz]', fontsize=7)
        lines.tick_params(labelsize=7)
        lines.set_xlim(0, 5000)

    film = FuncAnimation(figure, frame, frames=FRAMES * len(CHOSEN))
    film.save(FILE, writer=PillowWriter(fps=FPS))
    figure.set_size_inches(8.0, 4.0)
    heading.set_text('mechanism_sim: machines as loose as they are')
    figure.savefig(SOCIAL, dpi=160)  # 1280 by 640, as those who show links want it


def _lens(axes: Axes, record: Record, now: float, radial: float) -> None:
    """The pin in its bushing, the clearance magnified, and its path over the last quarter turn."""
    axes.clear()
    axes.set_axis_off()
    axes.set_aspect('equal')
    axes.set(xlim=(-1.35, 1.35), ylim=(-1.2, 1.2))
    t = np.linspace(now - 0.25 * record.machine.drive.period, now, 400)
    view = record.piece.view(t)
    frames = _stage(record).frames(t, view.observed, view.modes, np.zeros((len(t), 0, 3)))
    x, y = 0.6 * frames.pins[:, 0].T / radial
    flies = frames.modes[-1, 0] == 1
    axes.add_patch(Circle((0, 0), 1.15, fc='#eceef0', ec='0.2', lw=1.0))
    axes.add_patch(Circle((0, 0), 1.0, fc='#fbfbf6', ec='0.2', lw=1.0))
    axes.plot(x, y, color=BLUE, lw=1.1, alpha=0.8)
    axes.add_patch(Circle((x[-1], y[-1]), 0.4, fc='#cfe2f1' if flies else '#f5d7b8', ec='0.2'))
    short = 0.04 * record.machine.drive.period
    last = [i for i in record.piece.impacts if 0.0 <= now - i.t < short]
    hardest = max((i.normal_impulse for i in record.piece.impacts), default=1.0)
    for impact in last:
        size = 0.28 * (impact.normal_impulse / hardest) ** (1 / 3)
        at = np.cos(impact.normal_angle), np.sin(impact.normal_angle)
        axes.add_patch(Circle(at, size, fc='#f5c518', ec='none', alpha=0.7))
    axes.text(0, -1.32, 'in flight' if flies else 'in contact', ha='center', va='top', fontsize=8)


def _stage(record: Record) -> object:
    """Drawing of the machine, made once."""
    if record not in _STAGES:
        from mechanism_sim.export.stage import stage_of  # noqa: PLC0415

        t = np.linspace(record.start, record.end, 400)
        seen = record.piece.view(t).observed
        _STAGES[record] = stage_of(record.machine, seen, np.zeros((len(t), 0, 3)))
    return _STAGES[record]


_STAGES: dict = {}


def _trace(axes: Axes, record: Record, part: tuple[float, float], now: float) -> None:
    """The signal of a turn, in colour up to the present."""
    axes.clear()
    axes.spines[['top', 'right']].set_visible(False)
    signal = record.signal(SENSOR)
    (t,), (a,) = signal.times, signal.runs
    inside = (t >= part[0]) & (t < part[1])
    t, a = t[inside], a[inside]
    axes.plot(1e3 * (t - part[0]), a, color=GREY, lw=0.6)
    seen = t <= now
    axes.plot(1e3 * (t[seen] - part[0]), a[seen], color=RED, lw=0.8)
    axes.set(ylim=(-620, 620), xlim=(0, 1e3 * (part[1] - part[0])))
    axes.tick_params(labelsize=7)
    axes.set_title('measured: accelerometer on the rocker [m/s$^2$] over a turn [ms]',
                   fontsize=8, loc='left')  # fmt: skip


if __name__ == '__main__':
    main()
