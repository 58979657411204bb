"""The page of the bearing that wears: seen, heard and measured, without a network."""

from __future__ import annotations

import base64
import io
import itertools
import json
import re

import numpy as np
import pytest
from running import ROOT
from scipy.io import wavfile

pytestmark = pytest.mark.slow


@pytest.fixture(scope='module')
def worn():
    """The module of the site, and its page."""
    pytest.importorskip('sphinx')
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / 'docs' / 'site'))
        import worn  # noqa: PLC0415 - of the site

        yield worn, worn.page()


def test_wear_is_seen_heard_and_measured(worn):
    module, page = worn
    text = re.search(r'id="data">(.*?)</script>', page, re.DOTALL)[1]
    runs = json.loads(text)['runs']
    assert [run['radial'] for run in runs] == list(module.RADII)
    # of a clearance at least twice as large; between the last two no run of this length decides
    impulse = {run['radial']: run['figures']['impulse'] for run in runs}
    pairs = [(a, b) for a, b in itertools.combinations(impulse, 2) if b >= 2.0 * a]
    assert len(pairs) == 11
    assert all(impulse[a] < impulse[b] for a, b in pairs)
    highest, loud = [], []
    for run in runs:
        rate, sound = wavfile.read(io.BytesIO(base64.b64decode(run['sound'])))
        assert rate == module.RATE
        assert sound.dtype == np.int16
        assert len(sound) / rate > 2.0
        highest.append(np.abs(sound.astype(int)).max())
        loud.append(np.sqrt(np.mean(sound.astype(float) ** 2)))
    assert max(highest) == 32767  # of all on one scale
    assert loud[0] < 0.6 * loud[-1]  # by all impacts: the hardest of twelve turns is any
    plateau = [np.mean([p for f, p in run['spectrum'] if f > 2000.0]) for run in runs]
    assert plateau[-1] - plateau[0] > 6.0  # [dB]


def test_the_slider_chooses_what_is_shown(worn, tab, tmp_path):
    module, page = worn
    file = tmp_path / 'worn.html'
    file.write_text(page, encoding='utf-8')
    tab.page.goto(file.as_uri())
    tab.page.wait_for_selector('html[data-ready="1"]', state='attached')
    assert tab.page.inner_text('#value') == f'{1e3 * module.RADII[0]:g} µm'
    tab.page.focus('#radius')
    tab.page.keyboard.press('End')
    assert tab.page.inner_text('#value') == f'{1e3 * module.RADII[-1]:g} µm'
    assert tab.page.locator('#spectrum .chosen').count() == 1
    assert '254 µm' in tab.page.text_content('#lens')
    tab.page.click('#listen')
    assert tab.page.get_attribute('#listen', 'aria-pressed') == 'true'
    assert tab.requests == [file.as_uri()]
    assert not tab.complaints
