"""The pictures of the gallery are those that the command ``draw`` makes of the scenes today."""

from __future__ import annotations

import base64
import json
import re
import sys
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from running import ROOT

import mechanism_sim as ms
from mechanism_sim.analysis.record import Record
from mechanism_sim.pages.recorded import recorded

sys.path.insert(0, str(ROOT / 'docs'))

import gallery

NUMBER = re.compile(r'-?\d+(?:\.\d+)?(?:e-?\d+)?')
TOLERANCE = 0.5  # [pt]


def elements(file):
    """Of each element its tag and text; of what is drawn the box of its coordinates, too."""
    for element in ET.parse(file).getroot().iter():
        tag = element.tag.partition('}')[2]
        if tag in ('path', 'use', 'text', 'rect', 'svg'):
            yield tag, (element.text or '').strip(), box(element)


def box(element):
    """Least and greatest coordinates of a path; where another element stands, and its size."""
    if 'd' in element.attrib:
        x = [float(n) for n in NUMBER.findall(element.attrib['d'])]
        return [min(x[::2]), max(x[::2]), min(x[1::2]), max(x[1::2])]
    keys = 'x', 'y', 'width', 'height', 'viewBox', 'transform'
    return [float(n) for key in keys for n in NUMBER.findall(element.get(key, ''))]


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', ms.scene_names())
def test_the_picture_in_the_gallery_is_that_of_the_scene(name, tmp_path):
    drawn = list(elements(gallery.draw(name, tmp_path)))
    kept = list(elements(gallery.FOLDER / f'{name}.svg'))
    assert [e[:2] for e in drawn] == [e[:2] for e in kept]
    for (tag, text, here), (_, _, there) in zip(drawn, kept, strict=True):
        assert here == pytest.approx(there, abs=TOLERANCE), (tag, text)


def test_options_belong_to_scenes():
    assert set(gallery.OPTIONS) <= set(ms.scene_names())


@pytest.fixture
def motion(monkeypatch, tmp_path):
    """The part of the site that moves pictures; it keeps its runs apart."""
    pytest.importorskip('sphinx')
    monkeypatch.syspath_prepend(str(ROOT / 'docs' / 'site'))
    import motion  # noqa: PLC0415 - of the site

    monkeypatch.setattr(motion, 'KEPT', tmp_path)
    return motion


def test_a_card_moves_as_its_machine_does(motion):
    """By the law of cosines at every instant; one turn, at whose end it begins again."""
    machine = ms.load_scene('four_bar_nominal')
    card = motion.moving(recorded(Record(machine, ms.simulate(machine), {})))
    t, poses, drive = (
        np.frombuffer(base64.b64decode(card['frames'][name]['bdata']), kind)
        for name, kind in (('t', 'f8'), ('poses', 'f4'), ('drive', 'f8'))
    )
    poses = poses.reshape(len(t), 3, 3)
    assert card['stage']['links'] == ['crank', 'coupler', 'rocker']
    assert t[-1] - t[0] == pytest.approx(card['turn']) == pytest.approx(60.0 / 350.0)
    assert 100 < len(t) <= motion.MOST
    ground, crank, coupler, rocker = 0.387, 0.064, 0.309, 0.312
    far = np.sqrt(ground**2 + crank**2 - 2.0 * ground * crank * np.cos(drive))
    between = np.arctan2(crank * np.sin(drive), crank * np.cos(drive) - ground)
    corner = np.arccos((far**2 + rocker**2 - coupler**2) / (2.0 * far * rocker))
    assert poses[:, 2, 2] == pytest.approx(np.mod(between, 2.0 * np.pi) - corner, abs=1e-5)
    first, last = (poses[k].astype(float) for k in (0, -1))
    assert np.abs(np.exp(1j * first[:, 2]) - np.exp(1j * last[:, 2])).max() < 1e-5
    assert len(json.dumps(card)) < 60_000


def test_a_run_that_has_been_made_is_not_made_again(motion):
    made = []
    for text in ('one', 'one', 'two'):
        key = motion.key_of(text)
        file = motion.kept(key, 'html', lambda text=text: made.append(text) or text)
        assert file.read_text(encoding='utf-8') == text
    assert made == ['one', 'two']
