"""Expressions: read as Python reads them, alike by both back ends, with units, or refused."""

import math
import random

import heyoka as hy
import numpy as np
import pytest

from mechanism_sim.errors import InputError
from mechanism_sim.numerics.expressions import FUNCTIONS, numbers, parse, sides, unit_of
from mechanism_sim.numerics.formula import Words, expression

KNOWN = {'x': 0.7, 'y': -1.3, 'speed': 2.1}
UNITS = {'x': 'm', 'y': 'm', 'speed': 'm/s', 'a.b': 'N', 'n': ''}
PYTHON = {
    **{name: getattr(math, name) for name in FUNCTIONS if hasattr(math, name)},
    'abs': abs, 'min': min, 'max': max, 'pi': math.pi, 'sign': lambda x: (x > 0) - (x < 0),
}  # fmt: skip


def term(dice: random.Random, depth: int) -> str:
    """A random formula that has a value nearly everywhere."""
    if depth == 0 or dice.random() < 0.1:
        return dice.choice([*KNOWN, 'pi', '2', '0.5', '3e-1', '.25'])
    a, b, c = (term(dice, depth - 1) for _ in range(3))
    sign = dice.choice(('<', '<=', '>', '>='))
    apart = f'{c} + 0.0137'  # flags do not tell what is equal from what is less
    return dice.choice((
        f'{a} + {b}', f'{a} - {b}', f'{a}*{b}', f'({a} - {b})', f'{a}/(2 + ({b})**2)', f'-{a}',
        f'-({a})**{dice.choice("234")}', f'{a} - {b} - {c}', f'(1 + ({b})**2)/{a}/2', f'--{a}',
        f'{dice.choice(("sin", "cos", "tanh", "abs"))}({a})', f'exp(-abs({a}))',
        f'sign({apart})', f'sqrt(1 + ({a})**2)', f'log(2 + abs({a}))', f'hypot({a}, {b})',
        f'{dice.choice(("min", "max"))}({a}, {b}, {c})', f'({a} if {b} {sign} {apart} else {b})',
        f'({a} if not {b} {sign} 0.51 and {apart} < 1 or {a} > {b} > {apart} else {b})',
        f'({a} if {b} < {apart} else {b} if 1 > {apart} else {c})',
    ))  # fmt: skip


@pytest.mark.sample(15)
@pytest.mark.parametrize('seed', range(40))
def test_both_back_ends_find_what_python_does(seed):
    dice = random.Random(seed)
    variables = {name: hy.expression(name) for name in KNOWN}
    for _ in range(10):
        text = term(dice, 3)
        try:
            expected = eval(text, {'__builtins__': {}}, {**PYTHON, **KNOWN})  # our own text
        except (ZeroDivisionError, OverflowError):
            continue
        found = numbers(parse(text.replace('**', dice.choice(('**', '^')))), KNOWN)
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-12), text
        made = hy.cfunc([expression(text, Words(variables))], [*variables.values()])
        assert made([*KNOWN.values()])[0] == pytest.approx(expected, rel=1e-12, abs=1e-12), text


@pytest.mark.parametrize(
    ('text', 'value', 'unit'),
    [
        ('-2^2', -4.0, None),
        ('2**3 * 5', 40.0, None),
        ('1/2 s', 0.5, 'Hz'),
        ('3 m^2', 3.0, 'm^2'),
        ('3 m**2', 3.0, 'm^2'),
        ('(3 m)^2', 9.0, 'm^2'),
        ('2 kN/mm * x', 1.4e6, 'N'),
        ('20 N m / (5 N)', 4.0, 'm'),
        ('3 kN mm + 1', 4.0, 'N m'),
        ('5 Nm', 5.0, 'N m'),  # as quantities have them
        ('3 N·m + 2 Ncm', 3.02, 'N m'),
        ('7 Nms/rad * (300 r/min)', 7.0 * 10.0 * math.pi, 'N m'),
        ('2 kgm2', 2.0, 'kg m^2'),
        ('30 mN', 0.03, 'N'),
        ('300 rpm', 10.0 * math.pi, 'rad/s'),
        ('sin(30 deg)', 0.5, ''),
        ('ln(exp(2))', 2.0, ''),
        ('sqrt(x*x)', 0.7, 'm'),
        ('max(x, 50 cm)', 0.7, 'm'),
        ('x > 50 cm and not y > 0', 1.0, ''),
        ('1 if 0 < x < 1 m else 0', 1.0, None),
        ('1_000 # a remark', 1000.0, None),
    ],
)
def test_a_text_has_this_value_and_unit(text, value, unit):
    tree = parse(text)
    assert numbers(tree, KNOWN) == pytest.approx(value, rel=1e-15)
    assert unit_of(tree, UNITS, text) == unit


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('', 'something is missing at the beginning'),
        ('3*', r"something is missing behind '\*'"),
        ('sin(x', r"'\(' was never closed"),
        ('x y', "'y' cannot stand behind 'x'"),
        ('3,5*x', "',' cannot stand behind '3'"),
        ('* 3', r"'\*' cannot stand at the beginning"),
        ('1 if x', "else is missing behind 'x'"),
        ('x = 3', "'=' cannot stand behind 'x'"),
        ('1 if x == 3 else 0', 'a condition in .* must be made of < and >'),
        ('x[0]', r"is not made of .*: '\[' is none of them"),
        ('x & y', "is not made of .*'and', 'or', 'not'.*: '&' is none of them"),
        ('2 pi*x', r'a product is written 2\*pi'),
        ('2 sin(x)', r'a product is written 2\*sin'),
        ('5 Nmx', "'Nmx' behind 5 .* is not a unit: a product is written"),
        ('5 Nm(x)', "'Nm' behind 5 .* is not a unit: a product is written"),
        ('24 V - 2*x', "'V' behind 24 .* is not a unit of formulas: those of electrical"),
        ('-3 A', r'electrical quantities are .*; a product is written 3\*A'),  # of a state A
        ('90d*x', "'d' behind 90 .* is not a unit; here that is 'deg'"),
        ('where(x < 1, 2, 3)', "'where' .*; here that is a choice, 'A if X > Y else B'; known"),
        ('IMPACT(x, y, 0, 1, 1, 1, 1)', "here that is a joint 'contact', or 'stops' of a joint"),
        ('3 N Nm', 'is not a product of different units'),
        ('3 N N', 'is not a product of different units'),
        ('x^y', "the power 'y' in .* must be a number"),
        ('x^(2 m)', "the power '2 m' in .* must be a number"),
        ('x^40', 'must be from -20 to 20'),
        ('x^(1/0)', 'a number in .* is larger than'),
        ('abs(x, y)', 'abs in .* needs one argument, but has 2'),
        ('hypot(x)', 'hypot in .* needs at least two arguments'),
        ('sine(x)', "not a function known here; did you mean 'sin'?"),
        ('sin(x, from 2 s)', "'from' in .* stands in 'sin', which is of no run"),
        ('1e31', 'is larger than 1e'),
        ('(' * 400, 'nested too deep'),
        ('-' * 400 + 'x', 'nested too deep'),
        ('+'.join('x' * 300), 'nested deeper than 200 levels'),
        ('x' * 1001, 'longer than 1000 characters'),
    ],
)
def test_what_is_no_expression_is_refused_in_one_sentence(text, said):
    with pytest.raises(InputError, match=said) as refused:
        parse(text)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('x + speed', 'm and m/s are added in'),
        ('min(x, 3 N)', 'm and N are in min in'),
        ('x < 3 N', 'm and N are compared in'),
        ('x if n > 0 else n', 'm and a plain number are chosen between'),
        ('sin(x)', 'sin in .* needs a plain number, not one in m'),
        ('sqrt(x)', 'the root of m in .* has no unit'),
        ('x^1.3', 'the power 1.3 in .* needs a plain number, not one in m'),
        ('x^0.5', 'the power 0.5 in .* needs a plain number, not one in m'),
    ],
)
def test_unlike_units_are_refused(text, said):
    with pytest.raises(InputError, match=said):
        unit_of(parse(text), UNITS, text)


def test_names_and_functions_of_ones_own_are_no_operations():
    units = {'negative': 'm', 'sin': 'm', 'press()': 'N'}
    assert unit_of(parse('-negative'), units, '') == 'm'
    assert unit_of(parse('-sin'), units, '') == 'm'
    assert unit_of(parse('press(sin)*sin', {'press': 1}), units, '') == 'N m'


def test_arrays_and_what_has_no_value():
    x = np.array([-1.0, 0.0, 4.0])
    assert numbers(parse('1/x if x > 0 else sqrt(x)'), {'x': x}) == pytest.approx(
        [np.nan, 0.0, 0.25], nan_ok=True
    )
    assert np.isinf(numbers(parse('((1e30^4)^4)^4'), {}))


def test_sides_of_an_equals_sign():
    assert sides('peak = largest(x > 3)') == ('peak', '=', 'largest(x > 3)')
    assert sides(' rms(x, from 2 s) =20 N m') == ('rms(x, from 2 s)', '=', '20 N m')
    assert sides('x >= 3') is sides('a = b = c') is sides('f(a = b)') is sides('') is None
