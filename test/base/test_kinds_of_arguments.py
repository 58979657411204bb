"""Arguments of the public functions: one of a wrong kind is one sentence."""

from __future__ import annotations

import inspect
import math
import pickle
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.arguments import as_annotated, check_options, listed, public
from mechanism_sim.errors import InputError
from mechanism_sim.output import path_of

WRONG = (
    None, 3.5, math.nan, -1, True, 'zzz', '', [], {}, b'x', object(), [None], [1], {1: 2}, {'a'},
    np.zeros(0), np.eye(2), np.int64(7),
)  # fmt: skip
"""Values, of which every parameter takes some at most."""
QUICK = {'duration': '1 ms', 'samples': 2, 'fps': '20 Hz', 'end': '50 ms', 'parameters': {},
         'source': {'duration': '1 ms', 'runs': [{}]}, 'vary': {}, 'path': [], 'found': None,
         'values': [], 'quantity': 'position', 'file': 'no.zzz'}  # fmt: skip
"""Arguments with which calls are short, or are refused."""
FUNCTIONS = [n for n in ms.__all__ if inspect.isfunction(getattr(ms, n)) and n != 'scene_names']


@pytest.mark.parametrize('name', FUNCTIONS)
def test_arguments_of_wrong_kinds_are_sentences(name, tmp_path, monkeypatch):
    """Never a traceback of something inside."""
    monkeypatch.chdir(tmp_path)
    function = getattr(ms, name)
    parameters = inspect.signature(function).parameters.values()
    several = inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL
    known = {p.name: p for p in parameters if p.kind not in several}
    usual = {n: x for n, x in QUICK.items() if n in known}
    if 'scene' in known:
        usual['scene'] = 'pendulum'
    if name in ('plot', 'report', 'measure', 'open_run', 'play', 'animate'):
        usual[next(iter(known))] = ms.simulate('pendulum', duration='1 ms')
    for key in known:
        for value in WRONG:
            with suppress(InputError):
                function(**{**usual, key: value})


@pytest.mark.parametrize(
    ('call', 'said'),
    [
        (lambda: ms.cycle('pendulum', samples='12'), "cycle: samples = '12' is not a whole numb"),
        (lambda: ms.cycle('pendulum', samples=2.5), 'cycle: samples = 2.5 is not a whole number'),
        (lambda: ms.cycle('pendulum', local='yes'), "cycle: local = 'yes' is not True or False"),
        (lambda: ms.cycle('pendulum', points=3), 'points = 3 is neither a text nor a list of tex'),
        (lambda: ms.draw('pendulum', labels='zzz'), "labels = 'zzz' is not one of all, links, no"),
        (lambda: ms.simulate('pendulum', progress=3), 'simulate: progress = 3 is not a function'),
        (lambda: ms.simulate('pendulum', resume=3), 'resume = 3 is not a snapshot, as .snapshot'),
        (lambda: ms.stream('pendulum', observers=3), 'observers: 3 is not a function'),
        (lambda: ms.report('pendulum', 3), 'report: file = 3 is not a path'),
        (lambda: ms.report('pendulum', skip=-1), 'report: skip = -1 must be at least 0'),
        (lambda: ms.load_scene('pendulum', [('duration', 1)]), "('duration', 1) is not a text"),
        (lambda: ms.load_scene('pendulum', {3: 1}), "3 is no path, as 'drive.speed' is one"),
        (lambda: ms.find('slider_crank', {'drive.speed': (1, 2)}, 'mean(drive_torque) = 1',
                         workers='two'), "workers = 'two' is not a whole number"),
        (lambda: ms.find('pendulum', {}, search='far'), 'is not one of local, global'),
        (lambda: ms.find('pendulum', 3, 'mean(power) = 1'), 'vary = 3 is neither a text nor a li'),
        (lambda: ms.basins('pendulum', {}, keep=2.5), 'basins: keep = 2.5 is not a whole number'),
        (lambda: ms.sweep(None), 'null is not a sweep: give a name, a path, or its keys and valu'),
        (lambda: ms.sweep({}, scene='pendulum', file=3), 'sweep: file = 3 is not a path'),
        (lambda: ms.find_four_bars(object()), 'path: give points (n, 2) of x, y, or (n, 3)'),
        (lambda: ms.animate('pendulum', 'x.gif', size='big'), "size = 'big' is not a whole numb"),
        (lambda: ms.play('pendulum', 3), '3 is not a run: expected a solution of pendulum'),
    ],
)  # fmt: skip
def test_sentences_say_of_what_an_argument_is(call, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as caught:
        call()
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ('call', 'said'),
    [
        (lambda: ms.cycle('pendulum', revolutions=2), "here that is 'periods'; it has scene, sam"),
        (lambda: ms.simulate('pendulum', periods=2), "simulate has no option 'periods'; here tha"),
        (lambda: ms.find('pendulum', {}, values=5), "no option 'values'; here that is 'samples'"),
        (lambda: ms.lyapunov('pendulum', exponents=2), "here that is 'count'; it has scene, revo"),
        (lambda: ms.measure('pendulum', start=2), "no option 'start'; here that is 'since'"),
        (lambda: ms.plot('pendulum', since=2), "no option 'since'; here that is 'start'"),
        (lambda: ms.simulate('pendulum', duratoin=2), "did you mean 'duration'?; it has scene, "),
    ],
)  # fmt: skip
def test_options_that_are_called_otherwise_are_named(call, said):
    """Some have another name in other functions, or in commands."""
    with pytest.raises(InputError) as caught:
        call()
    assert said in str(caught.value)


def test_numbers_of_numpy_are_as_those_of_python():
    @public
    def given(count: int, flag: bool = False, *others: int, file: str | Path | None = None):
        return count, flag, others, file

    assert given(np.int64(3), np.bool_(1)) == (3, True, (), None)
    assert given(3.0, 1, 4.5) == (3, True, (4.5,), None)
    assert [type(x) for x in given(np.float32(3.0))[:2]] == [int, bool]
    assert type(given(np.array(3))[0]) is int
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'count'"):
        given()
    with pytest.raises(TypeError, match="multiple values for argument 'count'"):
        given(1, count=2)
    assert inspect.signature(ms.cycle).parameters['samples'].default == 360
    assert pickle.loads(pickle.dumps(ms.simulate)) is ms.simulate
    for value in (True, math.inf, math.nan, 2.5, '2', None, [2]):
        with pytest.raises(InputError, match=r'n = .* is not a whole number'):
            as_annotated('n', value, 'int')
    assert as_annotated('n', None, 'int | None') is None
    assert as_annotated('n', 'zzz', 'float | None') == 'zzz'  # read by the function itself
    assert type(check_options(ms.draw, {'flag': 1}, given)['flag']) is bool


def test_names_come_in_any_kind_of_list():
    pandas, polars = pytest.importorskip('pandas'), pytest.importorskip('polars')
    kinds = tuple, iter, dict.fromkeys, np.array, pandas.Index, pandas.Series, polars.Series
    forms = [['a', 'b'], *(kind(['a', 'b']) for kind in kinds)]
    for form in forms:
        assert listed(form, 'names') == ['a', 'b']
    assert (listed('ab', 'names'), listed(None, 'names')) == (['ab'], [])
    run = ms.simulate('pendulum', duration='1 ms')
    for kind in (*kinds[:1], *kinds[3:]):
        assert [*run.sample([0.0], kind(['position', 't']))] == ['position.bar', 't']


def test_home_is_a_folder_in_paths_of_python(tmp_path, monkeypatch):
    """Shells expand ``~``, Python does not by itself."""
    monkeypatch.setenv('HOME', str(tmp_path))
    monkeypatch.chdir('/')
    assert path_of('~/a.csv') == path_of(Path('~/a.csv')) == tmp_path / 'a.csv'
    machine = ms.load_scene('slider_crank')
    (tmp_path / 'own.yaml').write_text(machine.scene.to_yaml(), encoding='utf-8')
    for file in ('~/own.yaml', Path('~/own.yaml')):
        assert ms.load_scene(file).fingerprint == machine.fingerprint
    run = {'scene': '~/own.yaml', 'duration': '1 ms', 'runs': [{}]}
    assert ms.sweep(run, '~/table.csv')['status'].tolist() == ['done']
    assert (tmp_path / 'table.csv').is_file()
    (tmp_path / 'speed.csv').write_text('t [s],speed [rpm]\n0,300\n1,300\n')
    own = {**machine.scene.to_document(), 'drive': {'speed': {'file': '~/speed.csv'}}}
    monkeypatch.chdir(tmp_path)
    assert ms.load_scene(own).drive.start[1] == pytest.approx(10.0 * math.pi)
    snapshot = ms.simulate(machine, duration='1 ms').snapshot
    snapshot.save('~/at.json')
    assert type(snapshot).load('~/at.json') == snapshot
    for call in (lambda: ms.open_run('~/no.mcap'), lambda: ms.plot('~/no.csv')):
        with pytest.raises(InputError, match=f'^{tmp_path}/no'):
            call()
