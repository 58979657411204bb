"""An interactive wearing bearing: machine, lens, sound and spectrum.

The directive ``worn`` runs the thesis scene at several clearances when the site is built, and
keeps the page as `motion` keeps its runs.
"""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np
from docutils import nodes
from docutils.parsers.rst import Directive
from markupsafe import Markup
from motion import beside, kept, key_of
from scipy.io import wavfile

import mechanism_sim as ms
from mechanism_sim import strict_json
from mechanism_sim.analysis.record import Record
from mechanism_sim.messages.events import describe
from mechanism_sim.pages.assets import embedded, import_map, styles
from mechanism_sim.pages.recorded import recorded, together
from mechanism_sim.sensing.indicators import indicators
from mechanism_sim.sensing.sound import Listener, pressure, strikes
from mechanism_sim.sensing.spectra import power

HERE = Path(__file__).parent
SCENE, JOINT, SENSOR = 'four_bar_clearance', 'coupler_rocker', 'rocker_accelerometer'
CLEARANCE = f'joints.{JOINT}.clearance.radial'
RADII = 0.0254, 0.0508, 0.0762, 0.1016, 0.1778, 0.254
"""Radial clearances [mm], the last that of the thesis."""
REAL = {
    f'sensors.{SENSOR}.instrument': 'adxl1005',
    f'sensors.{SENSOR}.anti_alias.frequency': '4 kHz',
}
TURNS, SHOWN, HEARD = 60, (20, 23), (20, 32)
"""Revolutions of a run; those shown, and those in the sound."""
RATE = 22050  # [Hz] of the sound
MODULES = 'svg', 'html', 'stage', 'lens', 'player', 'keys'


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_directive('worn', Worn)
    return {'parallel_read_safe': True, 'parallel_write_safe': False}


class Worn(Directive):
    """Directive that inserts the page in a frame."""

    def run(self) -> list[nodes.Node]:
        """Insert a frame with the page."""
        given = strict_json.dumps([RADII, TURNS, SHOWN, HEARD, RATE])
        files = HERE / 'worn.js', HERE / 'worn.html'
        own = ''.join(file.read_text(encoding='utf-8') for file in files)
        made = kept(key_of(describe(ms.load_scene(SCENE)), given + own), 'html', page)
        env = self.state.document.settings.env
        known = env.metadata.setdefault(env.docname, {})
        known['explored'] = ' '.join([*known.get('explored', '').split(), made.name])
        return [nodes.raw('', (
            '<iframe class="explore worn" title="A bearing that wears: seen, heard and measured" '
            f'src="{beside(env.docname, made.name)}" loading="lazy"></iframe>'
        ), format='html')]  # fmt: skip


def page() -> str:
    """The page as self-contained HTML."""
    runs = [Record(*run_at(radius), {}) for radius in RADII]
    period = runs[0].machine.drive.period
    seen = together(*(recorded(x.between(*(k * period for k in SHOWN))) for x in runs))
    heard = [_pressure(x, *(k * period for k in HEARD)) for x in runs]
    loudest = max(float(np.abs(p).max()) for p in heard)
    data = [
        {
            **shown.to_json(),
            'radial': radius,
            'sound': _wav(p / loudest),
            'spectrum': spectrum_of(record),
            'figures': _figures(record),
        }
        for radius, shown, record, p in zip(RADII, seen, runs, heard, strict=True)
    ]
    own = (HERE / 'worn.js').read_text(encoding='utf-8')
    text = (HERE / 'worn.html').read_text(encoding='utf-8')
    for name, value in (
        ('style', styles('stage')),
        ('modules', Markup(import_map(MODULES, {'worn': own}))),  # noqa: S704 - ours
        ('data', embedded({'runs': data, 'joint': JOINT, 'turn': period})),
    ):
        text = text.replace(f'<!-- {name} -->', value)
    return text


def run_at(radius: float) -> tuple[Any, Any]:
    """The machine at a radial clearance [mm], and its run."""
    machine = ms.load_scene(SCENE, overrides={CLEARANCE: f'{radius} mm', **REAL})
    return machine, ms.simulate(machine, revolutions=TURNS)


def _pressure(record: Record, start: float, end: float) -> np.ndarray:
    """Sound pressure (N,) [Pa] one metre away from impacts between two times."""
    part = record.piece
    impacts = [impact for impact in part.impacts if start <= impact.t < end]
    train = strikes(record.machine.mechanism, part.motion, impacts)
    whole = pressure(train, RATE, end + 0.05, Listener())
    return whole[round(start * RATE) :]


def _wav(samples: np.ndarray) -> str:
    """A sound of 16 bit, in base64."""
    file = io.BytesIO()
    wavfile.write(file, RATE, np.round(32767.0 * samples).astype(np.int16))
    return base64.b64encode(file.getvalue()).decode('ascii')


def spectrum_of(record: Record) -> list[list[float]]:
    """Power spectral density after two turns: [Hz], [dB re 1 (m/s^2)^2/Hz]."""
    part = record.between(2.0 * record.machine.drive.period, record.end)
    signal = part.signal(SENSOR)
    found = power(signal.runs, signal.rate, 512)
    return [
        [round(f, 1), round(10.0 * float(np.log10(p)), 2)]
        for f, p in zip(found.frequency[1:], found.values[1:], strict=True)
    ]


def _figures(record: Record) -> dict[str, float]:
    """Impacts and impulse [mN s] of a turn; largest acceleration [m/s^2] and kurtosis."""
    part = record.between(2.0 * record.machine.drive.period, record.end)
    turns = TURNS - 2
    signal = part.signal(SENSOR)
    found = indicators(signal.longest)
    impulse = sum(impact.normal_impulse for impact in part.piece.impacts)
    return {
        'impacts': len(part.piece.impacts) / turns,
        'impulse': 1e3 * impulse / turns,
        'rms': found.rms,
        'peak': found.peak,
        'kurtosis': found.kurtosis,
    }
