"""The live view's motion and charts at any pace, by its own modules, without a browser."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from running import TIMEOUT

import mechanism_sim as ms
from mechanism_sim.messages.events import describe
from mechanism_sim.messages.segments import pack
from mechanism_sim.pages.assets import asset
from mechanism_sim.pages.live import FEWEST, MOST, Live

TICK = 0.04  # [s] of the view
DRIVER = """
import { readFileSync } from 'node:fs';
let lines = [];
const pen = new Proxy({}, {
  get: (_, name) => (...at) => {
    if (name === 'beginPath') lines = []; // the last path is the curve
    if (name === 'lineTo') lines.push(at);
  },
  set: () => true,
});
const element = () => ({ append() {}, setAttribute() {}, getContext: () => pen,
  clientWidth: 600, clientHeight: 90, textContent: '' });
globalThis.document = { createElement: element };
globalThis.window = { devicePixelRatio: 1 };
globalThis.getComputedStyle = () => ({ getPropertyValue: () => '' });
const { Stream } = await import('page_stream');
const { Strip } = await import('page_strip');
const { stage, batches, seconds } = JSON.parse(readFileSync(0, 'utf8'));
const stream = new Stream(stage);
const strip = new Strip(element(), { label: 'speed', unit: 'rad/s', scale: 1 });
const seen = [];
let k = 0;
for (let i = 1; i <= seconds * 60; i += 1) {
  const wall = i / 60;
  while (k < batches.length && batches[k].wall <= wall) {
    const before = stream.parts.at(-1)?.end;
    const part = stream.add(batches[k].batch, batches[k].wall);
    if (part.start > before) strip.part(part.start);
    strip.add(part.t, part.speed);
    k += 1;
  }
  const frame = stream.tick(1 / 60, wall);
  if (frame) {
    const span = stream.span(4, 0);
    lines = [];
    strip.draw(frame.t, span);
    seen.push({ wall, t: frame.t, end: stream.parts.at(-1).end, span, lines: lines.length,
      finite: lines.flat().every(Number.isFinite), holes: strip.y.filter(Number.isNaN).length,
      width: lines.length ? lines.at(-1)[0] - lines[0][0] : 0 });
  }
}
process.stdout.write(JSON.stringify(seen));
"""


def interpreter() -> str:
    """Node: that of this machine, or the one that comes with Playwright."""
    if found := shutil.which('node'):
        return found
    driver = pytest.importorskip('playwright._impl._driver')
    return str(driver.compute_driver_executable()[0])


def shown(folder: Path, live: Live, batches: list[dict], seconds: float) -> list[dict]:
    """Frames of a page, 60 times a second."""
    modules(folder)
    (folder / 'page.mjs').write_text(DRIVER, encoding='utf-8')
    given = {'stage': live.stage.to_json(), 'batches': batches, 'seconds': seconds}
    return node(folder / 'page.mjs', json.dumps(given))


def modules(folder: Path) -> None:
    """The modules of the page, where Node finds them."""
    known = {'page_stream': 'stream', 'page_strip': 'strip', 'player': 'player', 'html': 'html',
             'svg': 'svg'}  # fmt: skip
    for package, name in known.items():  # Node has a module 'stream' of its own
        module = folder / 'node_modules' / package
        module.mkdir(parents=True)
        (module / 'index.js').write_text(asset(f'{name}.js'), encoding='utf-8')
        (module / 'package.json').write_text('{"type": "module", "main": "index.js"}')


def node(file: Path, given: str = '') -> list[dict]:
    """Output of a program, in JSON."""
    done = subprocess.run(
        [interpreter(), str(file)], input=given, capture_output=True, text=True, check=False,
        timeout=TIMEOUT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


NOISE = """
const strips = [1, 1e-11].map((size) => {
  const strip = new Strip(element(), { label: 'speed', unit: 'rad/s', scale: 1, usual: 1 });
  const t = Array.from({ length: 200 }, (_, i) => 0.01 * i);
  strip.add(t, t.map((x) => size * Math.sin(40 * x)));
  strip.draw(1.99, 2);
  const heights = lines.map(([, y]) => y);
  return { text: strip.value.textContent, far: Math.max(...heights) - Math.min(...heights) };
});
process.stdout.write(JSON.stringify(strips));
"""


def test_rounding_noise_is_zero(tmp_path):
    """Of a part in 10^11 of what is usual a chart shows a straight line, and writes zero."""
    modules(tmp_path)
    head, _, _ = DRIVER.partition('const { stage')
    (tmp_path / 'noise.mjs').write_text(head + NOISE, encoding='utf-8')
    seen, noise = node(tmp_path / 'noise.mjs')
    assert seen['far'] > 30.0  # [px] of 90
    assert seen['text'] != '0 rad/s'
    assert noise == {'text': '0 rad/s', 'far': 0.0}


def batches_of(pace: float, seconds: float, lost: tuple[float, float] = (0.0, 0.0)):
    """Batches that a view sends of a run at a pace; messages within `lost` [s] never come."""
    machine = ms.load_scene('four_bar_clearance')
    names = machine.physics.coordinates, machine.physics.clearances
    live, run, found = Live(describe(machine)), machine.start(), []
    for wall in np.arange(TICK, seconds, TICK).tolist():
        run.advance(pace * wall)
        motion, *_ = run.drain()
        if len(motion) and not lost[0] <= wall < lost[1]:
            live.take(pack(motion, *names, pace * wall))
        if batch := live.batch():
            count = int(batch['frames']['t'].get('shape', '0').split(',')[0]) or None
            assert count is None or FEWEST <= count - 1 <= MOST
            found.append({'wall': wall, 'batch': batch})
    return live, found


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ('pace', 'seconds'),
    [(1e-3, 20.0), (0.05, 8.0), (1.0, 8.0), pytest.param(40.0, 5.0, marks=pytest.mark.slow)],
)
def test_motion_goes_on_evenly_and_charts_are_full(pace, seconds, tmp_path):
    live, batches = batches_of(pace, seconds)
    seen = shown(tmp_path, live, batches, seconds)
    settled = [s for s in seen if s['wall'] > 0.6 * seconds]
    t = np.array([s['t'] for s in settled])
    steps = np.diff(t) * 60.0 / pace  # of the pace at which the machine goes
    assert steps.min() >= 0.0
    assert steps.max() < 4.0
    assert 0.5 < (t[-1] - t[0]) / (pace * (settled[-1]['wall'] - settled[0]['wall'])) < 1.5
    gaps = [np.diff([b['wall'] for b in batches]).max(), 0.2]
    assert all(s['end'] - s['t'] <= 3.0 * max(gaps) * pace for s in settled)
    assert all(1.0 < s['span'] / pace < 10.0 for s in settled)
    assert all(s['lines'] > 30 and s['finite'] for s in settled)
    assert settled[-1]['width'] > 0.5 * (600 - 66)
    assert not any(s['holes'] for s in seen)


def test_what_did_not_come_leaves_a_hole_and_the_view_goes_on(tmp_path):
    live, batches = batches_of(1.0, 4.0, lost=(1.5, 1.7))
    assert live.missed == pytest.approx(0.2, abs=0.05)
    seen = shown(tmp_path, live, batches, 4.0)
    t = np.array([s['t'] for s in seen])
    assert (np.diff(t) >= 0.0).all()
    assert seen[-1]['t'] > 3.6
    assert seen[-1]['holes'] == 1
    assert seen[-1]['finite']
    assert seen[-1]['width'] > 400.0  # what was drawn before the hole stays


def test_a_hole_shorter_than_a_batch_does_not_end_the_view():
    """A message of some milliseconds is dropped: the motion in the hole is not asked for."""
    machine = ms.load_scene('four_bar_clearance')
    names = machine.physics.coordinates, machine.physics.clearances
    live, run = Live(describe(machine)), machine.start()
    for k, end in enumerate((0.01, 0.02, 0.03, 0.04)):
        run.advance(end)
        motion, *_ = run.drain()
        if k != 1:
            live.take(pack(motion, *names, end))
        last = motion
    batch = live.batch()
    assert batch is not None
    assert live.missed == pytest.approx(0.01, abs=0.002)
    assert live.time == last.curve.end
