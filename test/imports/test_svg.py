"""Curves of drawings in an SVG, by closed forms and by other words for the same curve."""

from __future__ import annotations

import math

import pytest

from mechanism_sim.errors import InputError
from mechanism_sim.imports import import_machine

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" {}>'
ARM = '<g id="ground">{0}</g><g id="arm">{0}{1}</g></svg>'
IN_MM = 'width="200mm" height="100mm" viewBox="0 0 200 100"'
PLATE = 1e-6 * 5e-3 * 7850.0  # [kg/mm^2]


def arm(folder, shape, head=IN_MM, hole='<circle r="1"/>', **options):
    """Mass [kg] and moment of inertia [kg m^2] of a plate of 5 mm with a hole at the origin."""
    file = folder / 'm.svg'
    file.write_text(HEAD.format(head) + ARM.format(hole, shape))
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


@pytest.mark.parametrize(
    ('smooth', 'whole'),
    [
        ('C0 -20 40 -20 40 0 S90 -30 90 20', 'C0 -20 40 -20 40 0 C40 20 90 -30 90 20'),
        ('C0 -20 40 -20 40 0 H60 S90 -30 90 20', 'C0 -20 40 -20 40 0 L60 0 C60 0 90 -30 90 20'),
        ('C0 -20 40 -20 40 0 V5 S90 -30 90 20', 'C0 -20 40 -20 40 0 L40 5 C40 5 90 -30 90 20'),
        ('C0 -20 40 -20 40 0 a5 5 0 1 1 10 0 S90 -30 90 20',
         'C0 -20 40 -20 40 0 a5 5 0 1 1 10 0 C50 0 90 -30 90 20'),
        ('Q20 -40 40 0 S90 -30 90 20', 'Q20 -40 40 0 C40 0 90 -30 90 20'),
        ('Q20 -40 40 0 T80 5 T90 20', 'Q20 -40 40 0 Q60 40 80 5 Q100 -30 90 20'),
        ('C0 -20 40 -20 40 0 T90 20', 'C0 -20 40 -20 40 0 L90 20'),
        ('Q20 -40 40 0 L50 0 T90 20', 'Q20 -40 40 0 L50 0 L90 20'),
    ],
)  # fmt: skip
def test_a_smooth_curve_goes_on_from_one_of_its_kind_only(tmp_path, smooth, whole):
    """Else its first control point is where it begins (SVG 1.1, 8.3.6)."""
    short, long = (
        arm(tmp_path, f'<path d="M-10 0 {part} V40 H-10 Z"/>') for part in (smooth, whole)
    )
    assert short == pytest.approx(long, rel=1e-5)


def test_a_smooth_curve_after_a_closed_part_begins_without_a_handle(tmp_path):
    """The second part is a window, of which the closed form of a cubic gives the area."""
    plate = 'M-50 -50 C-50 -60 50 -60 50 -50 V50 H-50 Z'
    mass, _ = arm(tmp_path, f'<path d="{plate} s60 30 60 0 z"/>')
    area = 100 * 100 + 0.6 * 100 * 10 - 0.3 * 60 * 30 - math.pi
    assert mass == pytest.approx(PLATE * area, rel=1e-5)


@pytest.mark.parametrize(
    'turn', ['010 20', '01 0 20', '0,1,0,20', '0 10 20', ' 010,20', '01.0 20']
)
def test_flags_of_arcs_need_nothing_between_them(tmp_path, turn):
    """A bar with round ends, as programs that shorten paths write it."""
    long = f'a10 10 0 {turn} h-100 a10 10 0 {turn.replace("20", "-20")} z'
    mass, _ = arm(tmp_path, f'<path d="M0-10h100{long}"/>')
    assert mass == pytest.approx(PLATE * (100 * 20 + 100 * math.pi - math.pi), rel=1e-5)


@pytest.mark.parametrize('turn', ['210 20', '0 1 0', '0', '01'])
def test_other_flags_and_arcs_that_end_early_are_refused(tmp_path, turn):
    with pytest.raises(InputError, match='ends within a command'):
        arm(tmp_path, f'<path d="M0-10h100a10 10 0 {turn}"/>')


@pytest.mark.parametrize(
    ('head', 'across', 'upwards'),
    [
        ('width="200mm" height="50mm"', 0.5, 0.5),
        ('width="100mm" height="100mm"', 0.5, 0.5),
        ('width="20cm"', 1.0, 1.0),
        ('height="2in"', 0.508, 0.508),
        ('width="100%" height="50mm"', 0.5, 0.5),
        ('width="200mm" height="50mm" preserveAspectRatio="xMinYMin meet"', 0.5, 0.5),
        ('width="200mm" height="50mm" preserveAspectRatio="xMidYMid slice"', 1.0, 1.0),
        ('width="200mm" height="50mm" preserveAspectRatio="none"', 1.0, 0.5),
        ('', 25.4 / 96, 25.4 / 96),
    ],
)
def test_a_drawing_is_as_large_as_it_is_shown(tmp_path, head, across, upwards):
    """A plate whose hole is round as shown: mass and inertia by closed forms."""
    hole = f'<ellipse rx="{1 / across}" ry="{1 / upwards}"/>'
    found = arm(
        tmp_path, '<rect x="-10" y="-10" width="120" height="60"/>',
        f'{head} viewBox="-20 -20 200 100"', hole,
    )  # fmt: skip
    w, h, x, y = 120 * across, 60 * upwards, 50 * across, 20 * upwards
    area, round_ = w * h, math.pi
    polar = area * ((w**2 + h**2) / 12 + x**2 + y**2) - round_ / 2
    polar -= (area * math.hypot(x, y)) ** 2 / (area - round_)
    assert found == pytest.approx([PLATE * (area - round_), PLATE * polar * 1e-6], rel=1e-12)


@pytest.mark.parametrize(
    'head',
    ['width="1000" height="500" viewBox="0 0 200 100"', 'width="9px" height="5" viewBox="0 0 9 1"',
     'height="50" viewBox="0 0 2 1" preserveAspectRatio="none"', 'viewBox="0 0 2 1"', ''],
)  # fmt: skip
def test_numbers_of_a_drawing_in_pixels_are_in_the_unit_that_is_told(tmp_path, head):
    """They were in pixels of the window too: five times as large in the first."""
    rectangle = '<rect x="-10" y="-10" width="120" height="20"/>'
    mass, _ = arm(tmp_path, rectangle, head, unit='mm')
    assert mass == pytest.approx(PLATE * (2400 - math.pi), rel=1e-12)


@pytest.mark.parametrize(
    'nothing',
    ['<path d="M50 0 l0 0"/>', '<path d="M0 0 L0 0 z"/>', '<path d="M0 0zz"/>', '<path d=""/>',
     '<circle cx="9" r="0"/>', '<polygon points=""/>', '<rect x="5"/>'],
)  # fmt: skip
def test_a_shape_without_extent_is_not_there(tmp_path, nothing):
    """It was refused as a closed curve that has no area."""
    plate = '<rect x="-10" y="-10" width="120" height="20"/>'
    assert arm(tmp_path, plate + nothing) == arm(tmp_path, plate)


@pytest.mark.parametrize(
    ('shape', 'words'),
    [
        ('<path d="z"/>', "^the path 'z' does not begin with M$"),
        ('<path d="L5 5 9 0z"/>', 'does not begin with M'),
        ('<rect width="9" height="9" rx="50%"/>', "^'50%' is the length of a shape: give a num"),
        ('<circle r="3mm"/>', "^'3mm' is the length of a shape: give a number without % or unit"),
    ],
)
def test_shapes_that_cannot_be_read_are_refused_in_words(tmp_path, shape, words):
    with pytest.raises(InputError, match=words):
        arm(tmp_path, shape)


PARALLELOGRAM = '<path d="M-20 -10 H80 L120 30 H20 Z"/>'


@pytest.mark.parametrize(
    'same',
    [
        '<polyline points="-20,-10 80,-10 120,30 20,30 -20,-10"/>',
        '<polyline points="80 -10 120 30 20 30"/><line x1="20" y1="30" x2="-20" y2="-10"/>'
        '<path d="M80-10H-20"/>',
        '<line x1="-20" y1="-10" x2="80" y2="-10"/><line x1="120" y1="30" x2="80" y2="-10"/>'
        '<line x1="120" y1="30" x2="20" y2="30"/><line x1="-20" y1="-10" x2="20" y2="30"/>',
        '<rect x="-10" y="-10" width="100" height="40" transform="skewX(45)"/>',
        '<g transform="matrix(0 1 1 0 0 0)"><rect x="-10" y="-10" width="40" height="100" '
        'transform="skewY(45)"/></g>',
        '<a><use href="#plate" x="-20" y="-10"/></a>'
        '<defs><path id="plate" d="M0 0H100L140 40H40Z"/></defs>',
        '<use href="#half" transform="rotate(180 50 10)"/>'
        '<defs><g id="half" transform="translate(20 30)">'
        '<path d="M0 0H100L60-40H-40Z"/></g></defs>',
    ],
)  # fmt: skip
def test_the_same_plate_in_other_words(tmp_path, same):
    """A parallelogram of 100 mm by 40 mm, whose side leans by 45 deg, less a hole of 1 mm."""
    found = arm(tmp_path, same)
    assert found[0] == pytest.approx(PLATE * (4000.0 - math.pi), rel=1e-5)
    assert found == pytest.approx(arm(tmp_path, PARALLELOGRAM), rel=1e-9)


def test_a_clone_of_a_link_is_a_link(tmp_path):
    """Its group has its name, and where it stands is by both transforms."""
    file = tmp_path / 'm.svg'
    bar = '<g id="left"><rect x="-5" y="-5" width="60" height="10"/><circle r="1"/></g>'
    clone = '<g id="right"><use xlink:href="#left" transform="translate(50 20) rotate(90)"/></g>'
    ground = '<g id="ground"><circle r="1"/><circle cx="50" cy="20" r="1"/></g>'
    head = HEAD.format(IN_MM)[:-1] + ' xmlns:xlink="http://www.w3.org/1999/xlink">'
    file.write_text(f'{head}{bar}{clone}{ground}</svg>')
    found = import_machine(file, thickness='5 mm').data
    left, right = (found['links'][name] for name in ('left', 'right'))
    assert float(left['mass'].split()[0]) == pytest.approx(float(right['mass'].split()[0]))
    along = 25.0 * 600.0 / (600.0 - math.pi)
    for link, place in ((left, [along, 0.0]), (right, [0.0, -along])):  # y upwards
        cog = [float(value.split()[0]) for value in link['cog']]
        assert cog == pytest.approx(place, rel=1e-5, abs=1e-9)
    assert len(found['joints']) == 2


@pytest.mark.slow
def test_clones_that_cannot_be_drawn_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"the clone of '#nut' has no original in the drawing"):
        arm(tmp_path, PARALLELOGRAM + '<use href="#nut"/>')
    with pytest.raises(InputError, match=r"the clone of '' has no original in the drawing"):
        arm(tmp_path, PARALLELOGRAM + '<use/>')
    with pytest.raises(InputError, match='groups nested more than 100 deep'):
        arm(tmp_path, '<g id="own"><use href="#own"/></g>')
    rings = ''.join(f'<g id="r{k}">{f"""<use href="#r{k + 1}"/>""" * 10}</g>' for k in range(9))
    with pytest.raises(InputError, match='more than 100000 shapes with those of its clones'):
        arm(tmp_path, f'{rings}<g id="r9"/>')
