"""The pictures of the gallery are those that the command ``draw`` makes of the scenes today."""

from __future__ import annotations

import re
import sys
from xml.etree import ElementTree as ET

import pytest
from blocks import ROOT

import mechanism_sim as ms

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


@pytest.mark.parametrize('name', ms.scene_names())
def test_the_picture_in_the_gallery_is_that_of_the_scene(name, tmp_path):
    drawn = list(elements(gallery.draw(name, tmp_path)))
    kept = list(elements(gallery.FOLDER / f'{name}.svg'))
    assert [e[:2] for e in drawn] == [e[:2] for e in kept]
    for (tag, text, here), (_, _, there) in zip(drawn, kept, strict=True):
        assert here == pytest.approx(there, abs=TOLERANCE), (tag, text)


def test_options_belong_to_scenes():
    assert set(gallery.OPTIONS) <= set(ms.scene_names())
