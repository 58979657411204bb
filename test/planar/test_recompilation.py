"""Another number of any load, table or motor compiles nothing: drawn over scenes and numbers."""

import re

import numpy as np
import pytest
from builders import compilations, made
from running import ROOT

import mechanism_sim as ms
from mechanism_sim.numerics import compiled
from mechanism_sim.scene.files import read_yaml

NUMBER = re.compile(r'(?<![\w.*^])\d+\.?\d*(?:e[-+]?\d+)?(?![\w.])')  # no exponent, no name
NAMES = 'at', 'coordinate', 'moving', 'frame', 'file', 'columns', 'ramp'
SCENES = [
    file.stem
    for file in sorted((ROOT / 'config').glob('*.yaml'))
    if re.search(r'^loads:', file.read_text('utf-8'), re.MULTILINE)
]


def varied(value, factor):
    """Value with each number times a factor; what is zero becomes a small number."""
    match value:
        case dict():
            pairs = value.items()
            return {k: x if k in NAMES else varied(x, factor) for k, x in pairs}
        case list():
            return [varied(x, factor) for x in value]
        case str():
            return NUMBER.sub(lambda found: repr(float(found[0]) * factor()), value)
        case bool():
            return value
        case int() | float():
            return value * factor() if value else 1e-3 * factor()
    return value


def draw(content, random, width):
    """A scene with all numbers of its loads, tables and motor changed, by a part up to `width`."""

    def factor():
        return 1.0 + float(random.uniform(-width, width))

    drawn = content | {'loads': varied(content['loads'], factor)}
    if 'tables' in content:  # abscissae stay in their order
        drawn['tables'] = {
            name: table | {'points': [[x, varied(y, factor)] for x, y in table['points']]}
            for name, table in content['tables'].items()
        }
    if 'motor' in content.get('drive', {}):
        drawn['drive'] = content['drive'] | {'motor': varied(content['drive']['motor'], factor)}
    return drawn


def run(name, content):
    return ms.simulate(made(content, name), duration=0.02).stats


def compare(name, count):
    """Impacts that others do not have may compile what they need, but no integrator."""
    random = np.random.default_rng([*name.encode()])
    content = read_yaml(ROOT / 'config' / f'{name}.yaml', 'scene')
    run(name, content)
    integrators = compiled._integrator.cache_info().misses
    drawn = [draw(content, random, 0.03) for _ in range(count)]
    for one in drawn:
        run(name, one)
    assert compiled._integrator.cache_info().misses == integrators
    before = compilations()
    for one in drawn:
        assert run(name, draw(one, random, 1e-9)).compile_time == 0.0
    assert compilations() == before


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', ['geneva', 'gear_rattle', 'slider_crank_piston_driven'])
def test_other_numbers_of_loads_compile_nothing(name):
    compare(name, 1)


@pytest.mark.slow
@pytest.mark.parametrize('name', SCENES)
def test_many_other_numbers_of_loads_compile_nothing(name):
    compare(name, 5)


@pytest.mark.sample(1)
@pytest.mark.parametrize(('crowded', 'kept'), [(True, [1, 1, 1, 1]), (False, [1, 1, 2, 2])])
def test_machines_before_are_forgotten_for_a_new_integrator(crowded, kept, monkeypatch):
    """Where there is no room for both; for the same machine again nothing is."""
    monkeypatch.setattr(compiled, '_crowded', [])
    compiled.forget()
    digests, integrators, functions = [], [], []
    loose, other = 'four_bar_clearance', 'slider_with_play'
    for name in loose, loose, other, loose:
        content = read_yaml(ROOT / 'config' / f'{name}.yaml', 'scene')
        compiled.forget_for_others(lambda: crowded)
        digests.append(run_digest(name, content))
        integrators.append(compiled._integrator.cache_info().currsize)
        functions.append(compiled._function.cache_info().currsize)
    assert digests[0] == digests[1] == digests[3]
    assert integrators == kept
    assert functions[1] == functions[0]


def run_digest(name, content):
    return ms.simulate(made(content, name), duration=0.02).digest()
