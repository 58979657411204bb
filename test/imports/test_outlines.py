"""Outlines in drawings, and curves that cannot be one."""

from __future__ import annotations

import math
from io import StringIO

import pytest

from mechanism_sim.errors import InputError
from mechanism_sim.imports import import_machine

PLATE = 5e-3 * 7850.0 * 1e-6  # [kg/mm^2]
SIDES = ((-10, -10), (110, -10)), ((110, 10), (110, -10)), ((110, 10), (-10, 10)), (
    (-10, 10), (-10, -10))  # fmt: skip
SVG = (
    '<svg width="200mm" viewBox="0 0 200 100"><g id="ground"><circle r="2"/></g>'
    '<g id="arm"><circle r="2"/>{}</g></svg>'
)


def plate(folder, *lines, holes=(0, 100), on='arm'):
    """A DXF in millimetres of lines and holes on a layer, with a pivot on the ground."""
    ezdxf = pytest.importorskip('ezdxf')
    document = ezdxf.new('R2010', units=4)
    space = document.modelspace()
    for layer, x in (('ground', 0), *((on, x) for x in holes)):
        space.add_circle((x, 0), 2, dxfattribs={'layer': layer})
    for a, b in lines:
        space.add_line(a, b, dxfattribs={'layer': on})
    return saved(folder, document)


def saved(folder, document):
    """A file of a drawing."""
    stream = StringIO()
    document.write(stream)
    (folder / 'm.dxf').write_text(stream.getvalue())
    return folder / 'm.dxf'


def arm(file, **options):
    """Mass [kg] of a plate, where its holes are, and notes but that of the drive."""
    found = import_machine(file, thickness='5 mm', **options)
    link = found.data['links']['arm']
    notes = [note for note in found.notes if 'defines no drive' not in note]
    return float(link['mass'].split()[0]), link.get('points', {}), notes


@pytest.mark.parametrize('holes', [(0, 100), (0,)])
@pytest.mark.parametrize(
    ('sides', 'words'),
    [
        ((*SIDES[:3], ((-10, 10), (-10, -9.99))), r'gap of 0\.01 mm at \(-10, -(10|9\.99)\) mm$'),
        (SIDES[:3], r'gap of 20 mm at \(-10, -?10\) mm$'),
        ((*SIDES[::2], ((109.9, -10), (109.9, 10))), r'gap of 0\.1 mm at \(1[01.9]+, -?10\) mm$'),
    ],
    ids=['small', 'side', 'pieces'],
)  # fmt: skip
def test_an_outline_that_does_not_close_is_refused_with_its_gap(tmp_path, sides, words, holes):
    """The largest hole was taken for the outline, from which the others were subtracted."""
    with pytest.raises(
        InputError, match='^m: arm: its outline does not close: there is a ' + words
    ):
        import_machine(plate(tmp_path, *sides, holes=holes), thickness='5 mm')


@pytest.mark.parametrize(
    ('lines', 'words'),
    [
        ([((20, 0), (80, 0)), ((20, 5), (80, 5))], '2 open curves'),
        ([((20, 0), (80, 0))], '1 open curve'),
        ([((-20, 0), (120, 0)), ((0, -15), (0, 15)), ((100, -15), (100, 15))], '3 open curves'),
        ([((-10, 15), (110, 15)), ((115, -10), (115, 10))], '2 open curves'),
    ],
    ids=['within', 'one', 'centre lines', 'extension lines'],
)
def test_lines_about_an_outline_are_left_out_with_a_note(tmp_path, lines, words):
    """An outline goes round its holes; lines that stuck out of it were taken for it."""
    mass, points, notes = arm(plate(tmp_path, *SIDES, *lines))
    assert mass == pytest.approx(PLATE * (120 * 20 - 8 * math.pi), rel=1e-12)
    assert points == {'hole_2': ['100.0 mm', '0.0 mm']}
    assert notes == [f'm: arm: left out: {words}']


def test_a_line_without_a_length_is_not_there(tmp_path):
    assert arm(plate(tmp_path, *SIDES, ((50, 0), (50, 0)))) == arm(plate(tmp_path, *SIDES))


@pytest.mark.parametrize('hub', ['', '<circle r="9"/>'])
def test_centre_lines_of_a_disc_are_no_outline_but_lines_round_its_hub_are(tmp_path, hub):
    for d, outline in (('M-20 0H20M0-20V20', False), ('M-20-20H20V20H-20V-19', True)):
        (tmp_path / 'm.svg').write_text(SVG.format(f'<circle r="12"/>{hub}<path d="{d}"/>'))
        if outline:
            with pytest.raises(InputError, match='does not close: there is a gap of 1 mm'):
                import_machine(tmp_path / 'm.svg', thickness='5 mm')
        else:
            assert arm(tmp_path / 'm.svg')[2] == ['m: arm: left out: 2 open curves']


def test_a_layer_without_a_closed_curve_has_a_note(tmp_path):
    file = tmp_path / 'm.svg'
    plates = '<rect x="-5" y="-5" width="90" height="10"/></g><g id="axis"><path d="M0 0h90"/>'
    file.write_text(SVG.format(plates))
    assert arm(file)[2] == ['axis: left out: no curve on it is closed']


@pytest.mark.parametrize(
    ('shape', 'at'),
    [
        ('<rect x="115" y="-9" width="30" height="18"/>', '130, -?0'),
        ('<rect x="60" y="-9" width="60" height="18"/>', '90, -?0'),
        ('<circle cx="200" r="3"/>', r'200, -?0'),
    ],
    ids=['beside', 'across', 'hole'],
)
def test_two_outlines_of_one_link_are_refused(tmp_path, shape, at):
    """One was subtracted from the other: a moment of inertia below 0, or a wrong one."""
    file = tmp_path / 'm.svg'
    file.write_text(SVG.format(f'<rect x="-10" y="-10" width="120" height="20"/>{shape}'))
    with pytest.raises(
        InputError, match=rf'^m: arm has two outlines: the one around \({at}\) mm '
    ):
        import_machine(file, thickness='5 mm')


def test_a_window_may_touch_its_outline(tmp_path):
    file = tmp_path / 'm.svg'
    window = '<path d="M60 -10h20v20h-20z"/>'
    file.write_text(SVG.format(f'<rect x="-10" y="-10" width="120" height="20"/>{window}'))
    area = 120 * 20 - 20 * 20 - 4 * math.pi
    assert arm(file)[0] == pytest.approx(PLATE * area, rel=1e-12)


@pytest.mark.parametrize('turned', ['M-10-10h120v20h-120v-20', 'M110 10h-120v-20h120v20'])
def test_a_path_that_ends_where_it_begins_is_closed(tmp_path, turned):
    """Without a Z it was passed over, and its hole was the plate."""
    file = tmp_path / 'm.svg'
    file.write_text(SVG.format(f'<path d="{turned}"/>'))
    assert arm(file)[0] == pytest.approx(PLATE * (2400 - 4 * math.pi), rel=1e-12)


@pytest.mark.parametrize(
    ('scale', 'end'), [({}, 100), ({'xscale': -1}, -100), ({'rotation': 180}, -100)]
)
def test_a_block_that_is_referred_to_on_a_layer_is_drawn_there(tmp_path, scale, end):
    """What is on layer 0 in a block, also in a block of it, is on that of the reference."""
    ezdxf = pytest.importorskip('ezdxf')
    document = ezdxf.new('R2010', units=4)
    holes, block = (document.blocks.new(name) for name in ('holes', 'plate'))
    for x in (0, 100):
        holes.add_circle((x, 0), 2)
    block.add_lwpolyline([(-10, -10), (110, -10), (110, 10), (-10, 10)], close=True)
    block.add_blockref('holes', (0, 0))
    space = document.modelspace()
    space.add_circle((20, 50), 2, dxfattribs={'layer': 'ground'})
    space.add_blockref('plate', (20, 50), dxfattribs={'layer': 'arm', **scale})
    mass, points, notes = arm(saved(tmp_path, document))
    assert mass == pytest.approx(PLATE * (2400 - 8 * math.pi), rel=1e-12)
    x, y = (float(part.split()[0]) for part in points['hole_2'])
    assert (x, y) == pytest.approx((end, 0), abs=1e-12)
    assert notes == []


def test_a_drawing_of_the_ground_alone_has_no_link(tmp_path):
    """It ended in a sentence about its thickness."""
    with pytest.raises(InputError, match='there is no link: closed curves are on ground alone'):
        import_machine(plate(tmp_path, holes=()), thickness='5 mm')


@pytest.mark.parametrize('hide', ['off', 'freeze'])
def test_what_is_on_a_layer_that_is_not_shown_is_not_there(tmp_path, hide):
    ezdxf = pytest.importorskip('ezdxf')
    document = ezdxf.readfile(plate(tmp_path, *SIDES))
    mass = arm(tmp_path / 'm.dxf')[0]
    document.modelspace().add_circle((50, 0), 5, dxfattribs={'layer': 'aids'})
    getattr(document.layers.add('aids'), hide)()
    document.modelspace().add_circle((50, 0), 8, dxfattribs={'layer': 'aids'})
    assert arm(saved(tmp_path, document))[0] == mass
    assert set(import_machine(tmp_path / 'm.dxf', thickness='5 mm').data['links']) == {
        'ground', 'arm'}  # fmt: skip


@pytest.mark.parametrize(
    ('hide', 'on', 'shown'),
    [('freeze', 'arm', False), ('off', 'arm', True), ('freeze', '0', False), ('off', '0', False)],
)
def test_a_block_on_a_layer_that_is_not_shown(tmp_path, hide, on, shown):
    """None of it is there if its reference is frozen; else what is on layers that are shown."""
    ezdxf = pytest.importorskip('ezdxf')
    document = ezdxf.readfile(plate(tmp_path, *SIDES))
    document.blocks.new('a').add_circle((0, 0), 5, dxfattribs={'layer': on})
    document.blocks.new('b').add_blockref('a', (50, 0))
    document.modelspace().add_blockref('b', (0, 0), dxfattribs={'layer': 'AIDS'})
    getattr(document.layers.add('aids'), hide)()
    points = arm(saved(tmp_path, document))[1]
    assert ('hole_3' in points) == shown


@pytest.mark.parametrize('kind', ['circle', 'polyline', 'block'])
def test_what_is_invisible_in_a_dxf_is_not_there(tmp_path, kind):
    ezdxf = pytest.importorskip('ezdxf')
    document = ezdxf.readfile(plate(tmp_path, *SIDES))
    known, space = arm(tmp_path / 'm.dxf'), document.modelspace()
    document.blocks.new('a').add_circle((50, 0), 5)
    hidden = {'layer': 'arm', 'invisible': 1}
    if kind == 'circle':
        space.add_circle((50, 0), 5, dxfattribs=hidden)
    elif kind == 'block':
        space.add_blockref('a', (0, 0), dxfattribs=hidden)
    else:
        space.add_lwpolyline([(50, 0), (60, 0), (50, 5)], close=True, dxfattribs=hidden)
    assert arm(saved(tmp_path, document)) == known


@pytest.mark.parametrize('off', [False, True])
def test_names_of_layers_of_a_dxf_have_no_case(tmp_path, off):
    """Each spelling was a layer of its own, which stayed when the layer was off."""
    ezdxf = pytest.importorskip('ezdxf')
    document = ezdxf.readfile(plate(tmp_path, *SIDES))
    layer = document.layers.add('Arm')
    document.modelspace().add_circle((50, 0), 5, dxfattribs={'layer': 'ARM'})
    if off:
        layer.off()
        with pytest.raises(InputError, match='closed curves are on ground alone'):
            import_machine(saved(tmp_path, document), thickness='5 mm')
    else:
        links = import_machine(saved(tmp_path, document), thickness='5 mm').data['links']
        assert set(links) == {'ground', 'Arm'}
        assert len(links['Arm']['points']) == 2


@pytest.mark.parametrize('hide', ['style="fill:none; display: none"', 'visibility="hidden"'])
def test_what_an_svg_hides_is_not_there(tmp_path, hide):
    shape = '<rect x="-10" y="-10" width="120" height="20"/>'
    for name, more in (('a', ''), ('b', f'<g {hide}><circle cx="50" r="5"/></g>')):
        (tmp_path / f'{name}.svg').write_text(SVG.format(shape + more))
    assert arm(tmp_path / 'a.svg') == arm(tmp_path / 'b.svg')
