"""The page of ideal motion: its own JavaScript against the closures of the engine, and in a browser."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from running import TIMEOUT

import mechanism_sim as ms
from mechanism_sim.pages import ideal
from mechanism_sim.pages.ideal_sliders import SliderReader
from mechanism_sim.scene.files import check_scene
from mechanism_sim.scene.plan import ScenePlan

DRIVER = """
import { readFileSync } from 'node:fs';
import * as equations from 'equations';
import { IdealMotion } from 'ideal_motion';
const { data, values } = JSON.parse(readFileSync(0, 'utf8'));
const motion = new IdealMotion(data, equations);
const told = () => ({ low: motion.low, high: motion.high, full: motion.full, limited: motion.limited,
  places: motion.all() });
const seen = [{ closed: true, ...told() }];
for (const own of values) seen.push({ closed: motion.change({ ...motion.values, ...own }), ...told() });
process.stdout.write(JSON.stringify(seen));
"""

SMOOTH = (
    'four_bar_clearance', 'slider_crank_offset', 'quick_return_shaper', 'ten_links', 'windshield_wiper',
    'gear_four_bar', 'planetary', 'belt_drive', 'rack_and_pinion', 'loader', 'four_bar_triple_rocker',
    'scotch_yoke_offset', 'toggle_press', 'eccentric_cam', 'double_toggle_punch', 'wedge', 'punch',
)  # fmt: skip


def interpreter() -> str:
    """Node: that of this machine, or the one that comes with Playwright."""
    if found := shutil.which('node'):
        return found
    driver = pytest.importorskip('playwright._impl._driver')
    return str(driver.compute_driver_executable()[0])


class Page:
    """A page of ideal motion, and what its own modules compute."""

    def __init__(self, folder: Path, scene: str, sliders=None, **overrides) -> None:
        self.machine = ideal._ideal(ms.load_scene(scene, overrides))
        self.text, self.left_out = ideal.page(ms.load_scene(scene, overrides), sliders or {})
        self.data = json.loads(re.search(r'id="data">(.*?)</script>', self.text, re.S)[1])
        modules = json.loads(re.search(r'type="importmap">(.*?)</script>', self.text, re.S)[1])
        for name, address in modules['imports'].items():
            place = folder / 'node_modules' / name
            place.mkdir(parents=True)
            (place / 'index.js').write_bytes(base64.b64decode(address.partition(',')[2]))
            (place / 'package.json').write_text('{"type": "module", "main": "index.js"}')
        self._program = folder / 'driver.mjs'
        self._program.write_text(DRIVER, encoding='utf-8')

    def moved(self, *values: dict[str, float]) -> list[dict]:
        """The motion, as in the scene and at other values of sliders."""
        done = subprocess.run(
            [interpreter(), str(self._program)], text=True, capture_output=True, check=False,
            input=json.dumps({'data': self.data, 'values': values}), timeout=TIMEOUT,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    def random(self, rng: np.random.Generator, share: float) -> dict[str, float]:
        """Values of all sliders, within a share of their ranges."""
        return {
            s['path']: (s['value'] + share * (rng.uniform(s['low'], s['high']) - s['value'])) / s['scale']
            for s in self.data['sliders']
        }

    def at(self, values: dict[str, float]):
        """The same machine by the engine."""
        reader = SliderReader(self.machine, np.array([self.data['q']]).T)
        content = self.machine.scene.to_document()
        return ScenePlan(check_scene('page', content, reader._overrides(values)))


def off(page: Page, values: dict[str, float], seen: dict) -> tuple[float, float, float, float]:
    """Largest differences from the engine's closures: coordinates, rates, accelerations, poses."""
    plan = page.at(values)
    kinematics, mechanism = plan.kinematics([*plan.laws]), plan.ideal
    q, v, a = (np.array([p[key] for p in seen['places']], float).T for key in 'qva')
    scale = kinematics.scale[:, None]
    found, left = kinematics.positions(q)
    held = kinematics.held
    rates = kinematics.rates(q, v[held])
    bends = kinematics.accelerations(q, rates, a[held])
    regular = kinematics.independence(q) > 1e-3
    assert not left[regular].any()
    poses = np.array([p['poses'] for p in seen['places']], float)  # (N, L, 9)
    worst = 0.0
    for i, body in enumerate(mechanism.bodies):
        path = mechanism.trace((body.name, (0.0, 0.0)), q, v, a).transpose(2, 0, 1)
        away = np.abs(poses[:, i].reshape(-1, 3, 3)[:, :, :2] - path)
        size = np.abs(path).max(axis=(0, 2))[None, :, None] + mechanism.size
        worst = max(worst, (away / size)[regular].max())
        turned = poses[:, i, 2] - mechanism.angle_all(body.name, q)
        worst = max(worst, np.abs(turned).max())

    def apart(one, other):
        size = np.abs(other[:, regular]).max(axis=1, keepdims=True) + scale
        return (np.abs(one - other)[:, regular] / size).max()

    return (np.abs(found - q) / scale)[:, regular].max(), apart(v, rates), apart(a, bends), worst


@pytest.mark.parametrize('scene', SMOOTH)
def test_the_page_moves_as_the_engine(scene, tmp_path):
    """Positions, rates, accelerations, over a turn and over random values of all sliders."""
    page, rng = Page(tmp_path, scene), np.random.default_rng(7)
    tried = [page.random(rng, share) for share in (0.1, 0.3, 0.6, 1.0)]
    seen = page.moved(*tried)
    for values, found in zip([{}, *tried], seen, strict=True):
        print(scene, found['closed'], len(found['places']), found['low'], found['high'], found['full'], found['limited'], off(page, values, found) if found['closed'] else '')
