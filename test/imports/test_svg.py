"""Curves of drawings in an SVG, by closed forms and by other words for the same curve."""

from __future__ import annotations

import math

import pytest

from mechanism_sim.imports import import_machine

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" {}>'
ARM = '<g id="ground"><circle r="1"/></g><g id="arm"><circle r="1"/>{}</g></svg>'
IN_MM = 'width="200mm" height="100mm" viewBox="0 0 200 100"'
PLATE = 1e-6 * 5e-3 * 7850.0  # [kg/mm^2]


def arm(folder, shape, head=IN_MM, **options):
    """Mass [kg] and moment of inertia [kg m^2] of a plate of 5 mm with a hole at the origin."""
    file = folder / 'm.svg'
    file.write_text(HEAD.format(head) + ARM.format(shape))
    keys = import_machine(file, thickness='5 mm', **options).data['links']['arm']
    return [float(keys[key].split()[0]) for key in ('mass', 'inertia')]


@pytest.mark.parametrize(
    ('given', 'rx', 'ry'),
    [('rx="4"', 4, 4), ('ry="3"', 3, 3), ('rx="auto" ry="3"', 3, 3), ('rx="6" ry="2"', 6, 2),
     ('rx="70"', 60, 10), ('rx="0" ry="5"', 0, 0), ('', 0, 0)],
)  # fmt: skip
def test_corners_of_a_rectangle_are_quarters_of_ellipses(tmp_path, given, rx, ry):
    """Area by its closed form, all of it as a path of lines and arcs beside."""
    rectangle = arm(tmp_path, f'<rect x="-10" y="-10" width="120" height="20" {given}/>')
    area = 120 * 20 - (4 - math.pi) * rx * ry - math.pi
    assert rectangle[0] == pytest.approx(PLATE * area, rel=1e-5)
    w, h, turn = 120 - 2 * rx, 20 - 2 * ry, f'a{rx} {ry} 0 0 1'
    path = (
        f'<path d="M{rx - 10} -10h{w}{turn} {rx} {ry}v{h}{turn} -{rx} {ry}h-{w}{turn} -{rx} -{ry}'
        f'v-{h}{turn} {rx} -{ry}z"/>'
    )
    assert rectangle == pytest.approx(arm(tmp_path, path), rel=1e-12)
