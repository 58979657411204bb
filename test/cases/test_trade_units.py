"""Units of the trade in scenes: what they mean, what is asked back, and stiffness of contact."""

from __future__ import annotations

import math

import pytest
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.cli.options import quantity
from mechanism_sim.errors import InputError
from mechanism_sim.scene.check import check

PIN = 'joints.coupler_rocker.clearance'
STEEL = {'young': '207 GPa', 'poisson': 0.3}


@pytest.mark.parametrize(
    'text', ['3000 1/min', '3000/min', '3000 min^-1', '3000 min-1', '3000 r/min', '3000 RPM',
             '3000 U/min'],
)  # fmt: skip
def test_a_speed_per_minute_is_of_revolutions(text):
    """100 pi rad/s (the drive at 3000 1/min of the list of cases)."""
    machine = ms.load_scene('slider_crank', {'drive.speed': text})
    assert machine.drive.fastest == pytest.approx(100.0 * math.pi, rel=1e-15)
    assert quantity('--speed', text, 'rad/s') == (machine.drive.fastest, 'rad/s')
    coordinates = run_json('check', 'slider_crank', '--set', f'drive.speed={text}')['coordinates']
    assert coordinates['crank'] == 'prescribed, 314.159 rad/s (3000 rpm)'


@pytest.mark.slow
def test_a_toggle_press_under_a_load_during_a_part_of_its_way_is_searched():
    """The motor starts with 12.5 times the speed of the crank, and slows down; 150/12.5 rad/s."""
    found = ms.find(
        'toggle_press', {'drive.speed': ('100 rpm', '119 rpm')},
        'lowest(motor.speed) = 150 rad/s', samples=2, duration='5 ms',
    )  # fmt: skip
    assert found.measures['lowest(motor.speed)'] == pytest.approx(150.0, rel=1e-9)
    assert 11.9 < found.values['drive.speed'] < 12.1


def test_a_bar_in_pounds_and_inches_swings_as_in_si():
    """The period of small swings, 2 pi sqrt(I/(m g a)), of figures by their definitions."""
    bar = {'length': '12 in', 'mass': '2 lbm', 'inertia': '24 lb-in^2', 'cog': '6 inches'}
    scene = ms.Scene(
        title='A bar', links={'bar': bar}, joints={'pivot': {'revolute': ['ground', 'bar']}},
        gravity=[0, '-1 g'], initial={'position': {'bar': '-90 deg'}, 'velocity': {'bar': 1e-4}},
    )  # fmt: skip
    m, a, g = 2 * 0.45359237, 6 * 0.0254, 9.80665
    inertia = 24 * 0.45359237 * 0.0254**2 + m * a**2
    period = 2.0 * math.pi * math.sqrt(inertia / (m * g * a))
    solution = ms.simulate(scene, duration=period)
    (end,) = solution.sample(period, 'position.bar')['position.bar']
    assert end == pytest.approx(-math.pi / 2.0, abs=1e-11)


@pytest.mark.parametrize(
    ('stiffness', 'exponent', 'right'),
    [
        ('2e9 N/m^1.5', None, 2e9), ('2 GN/m^1.5', None, 2e9), ('2e9 N/m^(3/2)', 1.5, 2e9),
        ('60 kN/mm^1.5', None, 60e3 * 1e3**1.5), ('2e6 N/mm', 1.0, 2e9), ('50 N/um^1.1', 1.1,
        50.0 * 1e6**1.1), (2e9, None, 2e9), ('2e9', None, 2e9),
    ],
)  # fmt: skip
def test_a_stiffness_of_contact_has_the_unit_of_its_exponent(stiffness, exponent, right):
    contact = {'law': 'flores', 'stiffness': stiffness, 'exponent': exponent}
    machine = ms.load_scene('four_bar_clearance', {f'{PIN}.contact': contact})
    play = machine.plan.clearances['coupler_rocker']
    assert play.stiffness == pytest.approx(right, rel=1e-14)
    assert ms.load_scene(machine.scene.to_yaml()).scene == machine.scene


def test_a_stiffness_follows_from_materials_by_hertz():
    """Lankarani, Nikravesh 1990: ``4/(3 (s1 + s2)) sqrt(Ri Rj/(Ri - Rj))``, s = (1 - nu^2)/E.

    The dry journal of Flores et al. (2004): steel in steel, radii 10 and 9.5 mm: 6.61e10 N/m^1.5.
    """
    contact = {'law': 'lankarani_nikravesh', 'materials': [STEEL], 'radius': '9.5 mm'}
    changes = {f'{PIN}.contact': contact, f'{PIN}.radial': '0.5 mm'}
    machine = ms.load_scene('four_bar_clearance', changes)
    play = machine.plan.clearances['coupler_rocker']
    s = (1.0 - 0.3**2) / 207e9
    right = 4.0 / (3.0 * 2.0 * s) * math.sqrt(10e-3 * 9.5e-3 / 0.5e-3)
    assert play.stiffness == pytest.approx(right, rel=1e-12)
    assert right == pytest.approx(6.61e10, rel=2e-3)
    (said,) = check(machine).gaps
    assert f'stiffness {right:.6g} N/m^1.5 of its materials' in said
    hollow = {**contact, 'radius': None, 'radii': ['9.5 mm', '-10 mm'], 'materials': [STEEL] * 2}
    same = ms.load_scene('four_bar_clearance', {**changes, f'{PIN}.contact': hollow})
    found = same.plan.clearances['coupler_rocker'].stiffness
    assert found == pytest.approx(right, rel=1e-12)
    number = {'law': 'lankarani_nikravesh', 'stiffness': play.stiffness}
    runs = [
        ms.simulate(ms.load_scene('four_bar_clearance', {**changes, f'{PIN}.contact': c}),
                    duration='10 ms').digest()
        for c in (contact, number)
    ]  # fmt: skip
    assert runs[0] == runs[1]


@pytest.mark.parametrize(
    ('change', 'said'),
    [
        ('drive.speed=50 Hz', "drive.speed = '50 Hz' has the unit 'Hz', which is not a unit of"),
        ('drive.speed=50 Hz', 'it may mean rev/s or rad/s'),
        ('drive.speed=1,5 rpm', 'has a decimal comma, 1,5, where a point belongs, as in 1.5'),
        ('links.crank.length=1.064,5 mm', 'as in 1064.5'),
        ('links.crank.mass=0,8 kg', 'links.crank.mass'),
        ('links.crank.mass=8 N', "is not a unit of 'kg'"),
        ('links.rod.inertia=5 kg', "is not a unit of 'kg m^2'"),
        ('gravity=[0, -9.81 kg]', "'kg', which is not a unit of 'm/s^2'"),
        ('loads={a: {at: crank, torque: 5 kg cm}}', "its weight is in 'kgf cm'"),
    ],
)
def test_mistakes_of_units_are_one_sentence(change, said):
    done = run('check', 'slider_crank', '--set', change)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ('contact', 'said'),
    [
        ({'stiffness': '2e9 N/m'}, "'N/m', but the exponent is 1.5: write for example '2e9 N/m^1"),
        ({'stiffness': '2e9 kg'}, 'not a force per length'),
        ({'stiffness': '2e9 kg/m^1.5'}, 'not a force per length'),
        ({'stiffness': '2,5e9 N/m^1.5'}, 'a decimal comma, 2,5'),
        ({'stiffness': 2e9, 'materials': [STEEL]}, "has 'stiffness' and 'materials': keep one"),
        ({'materials': [STEEL]}, "without 'contact.radii', or of a pin 'contact.radius'"),
        ({'materials': [STEEL], 'radii': [0.01, -0.009]}, 'between which no point touches'),
        ({'materials': [STEEL], 'radii': [0.01, 0.01], 'exponent': 2}, 'after Hertz'),
        ({'materials': [{'young': '207 GPa', 'poisson': 0.6}], 'radius': 0.01}, 'at most 0.5'),
        ({'materials': [{'young': '207 kg'}], 'radius': 0.01}, "is not a unit of 'Pa'"),
        ({'materials': [STEEL] * 3, 'radius': 0.01}, 'materials'),
        ({'stiffness': 2e9, 'radii': [0.01, 0.02]}, "has 'radii' without 'materials'"),
    ],
)
def test_mistakes_in_a_stiffness_are_one_sentence(contact, said):
    with pytest.raises(InputError) as caught:
        ms.load_scene('four_bar_clearance', {f'{PIN}.contact': {'law': 'flores', **contact}})
    assert said in str(caught.value)
    assert f'{PIN}' in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('length', ['64 m', '64', 64])
def test_a_length_in_metres_beside_millimetres_is_questioned(length):
    """Also where the machine is refused because of it."""
    said = f'links.crank.length = {length}: the lengths in other units are about 312 mm: is the'
    with pytest.raises(InputError, match=said):
        ms.load_scene('four_bar_clearance', {'links.crank.length': length})
    rod = ms.load_scene('slider_crank', {'links.rod.length': 200})
    assert rod.questions == (
        'links.rod.length = 200: the lengths in other units are about 50 mm: is the unit right?',
    )
    spring = {'a': {'between': ['ground', 'piston'], 'stiffness': '5 N/m', 'free_length': '250 m'}}
    asked = ms.load_scene('slider_crank', {'springs': spring}).questions
    assert 'springs.a.free_length = 250 m' in asked[0]
