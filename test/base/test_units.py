"""Quantities at the door: exact where decimal arithmetic is exact, refused with a hint."""

from __future__ import annotations

import math
import re
from datetime import timedelta
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp, mpf, pi

from mechanism_sim import units
from mechanism_sim.units import (
    EXAMPLES,
    argument,
    counted,
    instant,
    plain,
    to_si,
    to_si_of,
    to_si_text,
    typeset,
    unrounded,
    written,
)

EXACT = (
    ('0.254 mm', 'm', '0.000254'),
    ('0.1016 mm', 'm', '0.0001016'),
    ('64 mm', 'm', '0.064'),
    ('387mm', 'm', '0.387'),
    ('1 inch', 'm', '0.0254'),
    ('.5 um', 'm', '5e-7'),
    ('2645 kg mm^2', 'kg m^2', '0.002645'),
    ('2645 kg*mm**2', 'kg m^2', '0.002645'),
    ('609.5 g', 'kg', '0.6095'),
    ('9.8145 m/s^2', 'm/s^2', '9.8145'),
    ('-981 cm/s^2', 'm/s^2', '-9.81'),
    ('10 kHz', 'Hz', '10000'),
    ('20 ms', 's', '0.02'),
    ('3.5e-1 mm', 'm', '0.00035'),
    (' +7 mm ', 'm', '0.007'),
)


@pytest.mark.parametrize(('text', 'unit', 'exact'), EXACT)
def test_decimal_units_give_the_float_nearest_to_the_exact_value(text, unit, exact):
    assert to_si(text, unit) == float(Fraction(exact))


@given(st.decimals(min_value='0.0001', max_value=9999, places=7))
def test_every_millimetre_text_is_the_nearest_float(number):
    assert to_si(f'{number} mm', 'm') == float(Fraction(number) / 1000)


@pytest.mark.parametrize(
    ('text', 'unit', 'factor'),
    [('350 rpm', 'rad/s', 350 * 2 / Fraction(60)), ('30 deg', 'rad', Fraction(30, 180)),
     ('1.5 turn', 'rad', 3), ('2 turn/s', 'rad/s', 4), ('90 deg/s', 'rad/s', Fraction(1, 2))],
)  # fmt: skip
def test_angles_are_right_to_the_last_digit(text, unit, factor):
    with mp.workdps(40):
        exact = float(pi * mpf(factor.numerator) / mpf(factor.denominator))
    assert to_si(text, unit) == pytest.approx(exact, rel=3e-16, abs=0.0)


@pytest.mark.parametrize(
    'text', ['3000 1/min', '3000/min', '3000 min^-1', '3000 min**-1', '3000 min⁻¹', '3000 min-1',
             '3000 r/min', '3000 RPM', '3000 r.p.m.', '3000 U/min', '3000 rev/min', '50 rev/s'],
)  # fmt: skip
def test_what_catalogues_write_for_a_speed_means_revolutions(text):
    """Not 50 rad/s, as the dimension of 1/min alone would have it; of a frequency it is 50 Hz."""
    assert to_si(text, 'rad/s') == to_si('3000 rpm', 'rad/s') == pytest.approx(100.0 * math.pi)


@pytest.mark.parametrize('per', ['rev/min^2', 'U/min²', 'r/min2', 'rev / min**2', 'rpm/min'])
def test_revolutions_per_minute_squared_are_an_acceleration(per):
    """2 pi rad in 60 s, in a minute; the square of a speed is none."""
    assert to_si(f'36000 {per}', 'rad/s^2') == pytest.approx(20.0 * math.pi, rel=1e-15)


@pytest.mark.parametrize('unit', ['rpm^2', 'rad^2/s^2', 'turn^2/s^2'])
def test_the_square_of_a_speed_is_no_acceleration(unit):
    with pytest.raises(ValueError, match='not a unit of'):
        to_si(f'3 {unit}', 'rad/s^2')


@pytest.mark.parametrize('unit', ['Nm/(1/min)', 'N m/min^-1', 'Nm/(U/min)', 'N m/rpm'])
def test_damping_over_revolutions_per_minute(unit):
    assert to_si(f'2 {unit}', 'N m s/rad') == pytest.approx(60.0 / math.pi, rel=1e-15)


INCH, POUND = Fraction('0.0254'), Fraction('0.45359237')
WEIGHT = POUND * Fraction('9.80665')
TRADE = (
    ('3 Nm', 'N m', 3), ('3 Nmm', 'N m', Fraction(3, 1000)), ('3 N-m', 'N m', 3),
    ('3 N⋅m', 'N m', 3), ('3 kNm', 'N m', 3000), ('3 mNm', 'N m', Fraction(3, 1000)),
    ('2645 kgmm^2', 'kg m^2', Fraction('0.002645')), ('3 kgm^2', 'kg m^2', 3),
    ('3 kgm2', 'kg m^2', 3), ('3 kg-m^2', 'kg m^2', 3), ('3 Ns/m', 'N s/m', 3),
    ('3 Nm/rad', 'N m/rad', 3), ('3 Nms/rad', 'N m s/rad', 3), ('3 Pas', 'Pa s', 3),
    ('3 m/s2', 'm/s^2', 3), ('3 m s-2', 'm/s^2', 3), ('3 N m-1', 'N/m', 3), ('3 s-1', 'Hz', 3),
    ('2 g', 'm/s^2', Fraction('19.6133')),
    ('3 lbm', 'kg', 3 * POUND), ('3 lb', 'kg', 3 * POUND), ('3 lb', 'N', 3 * WEIGHT),
    ('3 lbf', 'N', 3 * WEIGHT), ('3 ft-lb', 'N m', 36 * INCH * WEIGHT),
    ('3 lb-ft', 'N m', 36 * INCH * WEIGHT), ('3 in-lb', 'N m', 3 * INCH * WEIGHT),
    ('3 lbf in', 'N m', 3 * INCH * WEIGHT), ('3 oz in', 'N m', 3 * INCH * WEIGHT / 16),
    ('3 oz-in', 'N m', 3 * INCH * WEIGHT / 16), ('3 lb/in', 'N/m', 3 * WEIGHT / INCH),
    ('3 oz in^2', 'kg m^2', 3 * POUND / 16 * INCH**2),
    ('3 lb-ft^2', 'kg m^2', 3 * POUND * (12 * INCH) ** 2),
    ('5 kgfm', 'N m', 5 * Fraction('9.80665')), ('5 kpcm', 'N m', 5 * Fraction('0.0980665')),
    ('2 PS', 'W', 150 * Fraction('9.80665')),  # of 75 kgf m/s each
)  # fmt: skip


@pytest.mark.parametrize(('text', 'unit', 'exact'), TRADE)
def test_units_as_workshops_and_catalogues_write_them(text, unit, exact):
    """Pounds and inches by their definitions: 0.45359237 kg, 25.4 mm, 9.80665 m/s^2."""
    assert to_si(text, unit) == pytest.approx(float(exact), rel=2e-16)
    if text in ('3 Nm', '3 Nmm', '3 N⋅m', '3 kNm', '2 PS'):  # tables read them too
        assert to_si_text(text) == (to_si(text, unit), unit)


@pytest.mark.parametrize('unit', ['°KW', '° CA', 'deg CA', 'degKW'])
def test_degrees_of_the_crank_of_an_engine_are_degrees(unit):
    assert to_si(f'90 {unit}', 'rad') == to_si('90 deg', 'rad')
    assert to_si_text(f'90 {unit}') == to_si_text('90 deg')


def test_numbers_of_numpy_and_quantities_of_pint_are_as_text():
    assert to_si(np.float32(0.5), 'm') == 0.5
    assert to_si(np.int64(3), '') == 3.0
    assert to_si_of(np.float64(2.0), ('rad', 'm')) == (2.0, '')
    pint = pytest.importorskip('pint').UnitRegistry()
    assert to_si(2645 * pint.kg * pint.mm**2, 'kg m^2') == 0.002645
    assert to_si(0.1016 * pint.mm, 'm') == 0.0001016
    assert to_si(pint.Quantity(3000, 'rpm'), 'rad/s') == to_si('3000 rpm', 'rad/s')
    assert to_si_of(30 * pint.degree, ('m', 'rad')) == (to_si('30 deg', 'rad'), 'rad')
    assert to_si_text(pint.Quantity(np.float64(5.0), 'kN')) == (5000.0, 'N')
    assert plain([1, 2] * pint.mm) == ['1.0 mm', '2.0 mm']
    with pytest.raises(ValueError, match='it may mean rev/s or rad/s'):
        to_si(50 * pint.Hz, 'rad/s')
    with pytest.raises(ValueError, match="'kg', which is not a unit of 'm'"):
        to_si(5 * pint.kg, 'm')


def test_per_minute_of_a_frequency_stays_a_frequency():
    assert to_si('3000 1/min', 'Hz') == 50.0


@pytest.mark.parametrize('given', ['1/s', '/s', 's^-1', 'Hz', 'kHz', '1/h', '1/ms'])
def test_a_speed_without_an_angle_is_asked_back(given):
    with pytest.raises(ValueError, match=r'it may mean rev/s or rad/s.*350 rpm'):
        to_si(f'50 {given}', 'rad/s')
    with pytest.raises(ValueError, match=r"'1/s\^2', which is not a unit of 'rad/s\^2'"):
        to_si('20 1/s^2', 'rad/s^2')


def test_a_plain_number_is_taken_to_be_in_si():
    assert to_si(0.064, 'm') == 0.064
    assert to_si('36.6519', 'rad/s') == 36.6519
    assert to_si(3, '') == 3.0
    assert to_si('1e-12', '') == 1e-12  # YAML 1.1 reads this as text


factors = st.lists(
    st.tuples(
        st.sampled_from([' ', '*', '/', ' / ']),
        st.sampled_from(sorted(units._KNOWN)),
        st.sampled_from(['', '', '^2', '**3', '^-1']),
    ),
    min_size=1,
    max_size=3,
)


def outcome(call, *arguments):
    """Result of a call, or the text of its ValueError."""
    try:
        return call(*arguments)
    except ValueError as error:
        return str(error)


@given(st.decimals(min_value='0.0001', max_value=9999, places=7), factors)
def test_common_units_are_those_of_pint_to_the_last_bit(number, factors):
    text = ''.join(''.join(f) for f in factors)[len(factors[0][0]) :]
    for unit in filter(None, EXAMPLES):
        if unit == 'rad/s' and units._PER_MINUTE.fullmatch(text):
            continue  # means revolutions, which pint cannot know
        if unit == 'm/s^2' and text == 'g':
            continue  # the acceleration
        mine = outcome(units._text_to_si, f'{number} {text}', unit, 'hint')
        expected = outcome(units._converted_by_pint, str(number), text, text, unit, 'hint')
        if isinstance(expected, str) and 'lb' in text:  # a force where one is wanted
            weight = re.sub(r'\blb\b', 'lbf', text)
            force = outcome(units._converted_by_pint, str(number), weight, text, unit, 'hint')
            expected = expected if isinstance(force, str) else force
        assert mine == expected


@pytest.mark.parametrize('unit', units._KNOWN)
def test_units_in_formulas_are_those_of_numbers(unit):
    found = units.read_common('3', unit)
    assert found.value == units._text_to_si(f'3 {unit}', found.unit, 'hint')


@pytest.mark.parametrize('unit', EXAMPLES)
def test_the_example_of_every_refusal_is_accepted(unit):
    assert to_si(EXAMPLES[unit], unit) > 0.0


@pytest.mark.parametrize(
    ('value', 'unit', 'said'),
    [
        ('64 kg', 'm', "has the unit 'kg', which is not a unit of 'm': write for example '64 mm'"),
        ('350 Hz', 'rad/s', "has the unit 'Hz', which is not a unit of 'rad/s'"),
        ('350 rpm', 'Hz', "has the unit 'rpm', which is not a unit of 'Hz'"),
        ('10 rad/s', 'Hz', "has the unit 'rad/s', which is not a unit of 'Hz'"),
        ('2950 kg', 'kg m^2', "has the unit 'kg', which is not a unit of 'kg m^2'"),
        ('5 mm', '', "has the unit 'mm' where a plain number belongs"),
        ('5 furlnog', 'm', "has the unknown unit 'furlnog': write for example '64 mm'"),
        ('5 mm)', 'm', "has the unknown unit 'mm)'"),
        ('90 deg-1', 'rad', "has the unknown unit 'deg-1'"),  # in formulas a difference
        ('30 Grad', 'rad', "degrees are 'deg': write for example '30 deg'"),
        ('60 Grad/s', 'rad/s', "has the unit 'Grad/s', in which Grad is"),
        ('1,5 mm', 'm', 'has a decimal comma, 1,5, where a point belongs, as in 1.5'),
        ('5 1/4 in', 'm', 'has a fraction where a decimal number belongs, as in 5.25 in'),
        ('3/8 in', 'm', 'a fraction where a decimal number belongs, as in 0.375 in'),
        ('2 tons', 'kg', "in which a ton may be 1000 kg, 't', or 907.18474 kg, 'short_ton'"),
        ('2 mil', 'm', "a thousandth of an inch is a 'thou'"),
        ('-1.500,25 mm', 'm', 'a decimal comma, -1.500,25, where a point belongs, as in -1500.25'),
        ('1,500 mm', 'm', 'where a point belongs, as in 1.500 or 1500'),
        ('0,254 mm', 'm', 'where a point belongs, as in 0.254'),
        ('1,500.5 mm', 'm', 'where a point belongs, as in 1500.5'),
        ('0,5', '', 'has a decimal comma, 0,5'),
        ('5 kg cm', 'N m', "is not a unit of 'N m' (a mass; its weight is in 'kgf cm')"),
        ('5 kg', 'N', "(a mass; its weight is in 'kgf')"),
        ('68 cSt', 'Pa s', "'cSt', which is not a unit of 'Pa s' (it is one of kinematic viscos"),
        ('68 mm^2/s', 'Pa s', 'kinematic viscosity: multiply by the density)'),
        ('ISO VG 68', 'Pa s', 'is a grade of oil, not its viscosity (an ISO VG is kinematic'),
        ('SAE 30', 'Pa s', 'is a grade of oil, not its viscosity'),
        ('fast', 'rad/s', "is not a number with a unit: write for example '350 rpm'"),
        ('', 'm', 'is not a number with a unit'),
        ('nan', 'm', 'is not a number with a unit'),
        ('mm 64', 'm', 'is not a number with a unit'),
        (True, 'm', "is not a quantity: write for example '64 mm'"),
        (None, 'kg', "is not a quantity: write for example '0.61 kg'"),
        ([64], 'm', 'is not a quantity'),
    ],
)
def test_what_is_not_such_a_quantity_is_refused_with_an_example(value, unit, said):
    with pytest.raises(ValueError, match='write for example') as caught:
        to_si(value, unit)
    assert said in str(caught.value)
    assert str(caught.value).endswith(f"write for example '{EXAMPLES[unit]}'")


@given(st.text(max_size=12), st.sampled_from(sorted(EXAMPLES)))
def test_no_text_does_anything_but_become_a_number_or_a_refusal(text, unit):
    try:
        number = to_si(text, unit)
    except ValueError as error:
        number = str(error)
    assert isinstance(number, float) or 'write for example' in number


@pytest.mark.parametrize(
    ('unit', 'printed'),
    [
        ('m/s^2', 'm/s²'), ('N m', 'N·m'), ('N s/m', 'N·s/m'), ('kg mm^2', 'kg·mm²'),
        ('rad/s or m/s', 'rad/s or m/s'), ('N m per N', 'N·m per N'), ('s^-1', 's⁻¹'),
        ('m^10', 'm¹⁰'), ('', ''),
    ],
)  # fmt: skip
def test_units_are_typeset(unit, printed):
    assert typeset(unit) == printed


@pytest.mark.parametrize(
    ('value', 'unit', 'said'),
    [
        (12930.0, 'N', '12.93 kN'), (9300.0, 'N', '9300 N'), (-2.5e4, 'N m', '-25 kN m'),
        (3.1e-6, 's', '3.1 µs'), (0.0025, 's', '2.5 ms'), (2.0, 's', '2 s'),
        (0.2677, 'N s', '267.7 mN s'), (0.004367, 'J', '4.367 mJ'), (0.0, 'J', '0 J'),
        (2.1e8, 'Pa', '210 MPa'), (math.pi / 2, 'rad', '90 deg'), (12345.678, '1/s', '12350 1/s'),
        (1.234567e9, '', '1.235e9'), (math.inf, 'N', 'inf N'),
    ],
)  # fmt: skip
def test_quantities_are_written_as_engineers_do(value, unit, said):
    """With a prefix in place of a power of ten."""
    assert written(value, unit) == said


def test_an_instant_of_a_clock_that_began_in_1970_keeps_its_microseconds():
    assert [instant(t) for t in (0.1 + 0.2, 12345.678901, -2.5)] == ['0.3', '12345.6789', '-2.5']
    assert instant(1764240000.25, 6) == '1764240000.25'
    assert instant(1764240000.000001) == '1764240000.000001'
    assert instant(2e6) == '2000000'


@pytest.mark.parametrize(
    ('count', 'said'), [(0, '0 runs'), (1, '1 run'), (2, '2 runs'), (-1, '-1 run')]
)
def test_one_thing_is_singular(count, said):
    assert counted(count, 'run') == said


def test_a_number_in_another_unit_is_without_its_rounding():
    speed = to_si('3000 rpm', 'rad/s') * 30.0 / math.pi
    assert unrounded(speed * (1.0 + 2e-16)) == 3000.0


def test_of_several_units_the_advice_of_the_first_is_kept():
    with pytest.raises(
        ValueError, match="degrees are 'deg': write for example '30 deg' or '64 mm'"
    ):
        to_si_of('30 Grad', ('rad', 'm'))


def test_durations_of_python_numpy_and_pandas_are_in_seconds():
    """Of nanoseconds NumPy's `tolist` makes plain numbers, which were read as seconds."""
    pandas = pytest.importorskip('pandas')
    for ten in (timedelta(milliseconds=10), np.timedelta64(10, 'ms'), np.timedelta64(10**7, 'ns'),
                pandas.Timedelta('10ms'), pandas.Timedelta('10ms').as_unit('ns')):  # fmt: skip
        assert to_si(ten, 's') == 0.01
        assert argument('t', ten, 's') == 0.01
        with pytest.raises(ValueError, match="has the unit 's', which is not a unit of 'm'"):
            to_si(ten, 'm')
    assert plain(np.array([[1, 2]], 'm8[s]')) == [['1.0 s', '2.0 s']]
    assert plain(pandas.Series(pandas.to_timedelta([1, 2], unit='ms'))) == ['0.001 s', '0.002 s']
    with pytest.raises(ValueError, match=r'a time in months or years has no length .*: 2 months'):
        to_si(np.timedelta64(2, 'M'), 's')


def test_turns_a_minute_in_french():
    assert to_si('300 tr/min', 'rad/s') == to_si('300 rpm', 'rad/s')
    assert to_si('300 tr/min^2', 'rad/s^2') == to_si('300 rpm/min', 'rad/s^2')
