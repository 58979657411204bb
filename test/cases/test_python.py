"""Machines built and asked in Python: every form of a scene is one machine, numbers are SI."""

from __future__ import annotations

import copy
import inspect
import math
import pickle
from pathlib import Path

import numpy as np
import pytest
import yaml
from editing import Page
from running import ROOT, environment, run_json

import mechanism_sim as ms
from mechanism_sim.analysis.record import read_record
from mechanism_sim.errors import InputError
from mechanism_sim.export.mjcf import to_mjcf
from mechanism_sim.imports import import_machine
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.scene.schema import AffineTorque

CONFIG = ROOT / 'config'
QUICK = 'pendulum', 'slider_crank', 'four_bar_clearance', 'scotch_yoke', 'oscillating_follower'


def bouncing() -> ms.Scene:
    """A pendulum with a loose pivot, in SI numbers of every kind."""
    bar = ms.LinkPart(length=1.0, mass=np.float32(1.25), inertia='0.1 kgm^2', cog='50 cm')
    pivot = ms.JointPart(
        revolute=['ground', 'bar'], clearance={'radial': '0.5 mm', 'restitution': 0.5}
    )
    return ms.Scene(
        title='A loose pendulum', links={'bar': bar}, joints={'pivot': pivot}, start='centred',
        gravity=np.array([0.0, -9.81]), initial={'position': {'bar': '30 deg'}}, duration='0.3 s',
    )  # fmt: skip


@pytest.mark.parametrize('name', [n for n in QUICK if (CONFIG / f'{n}.yaml').is_file()])
def test_a_scene_is_one_machine_in_every_form(name, tmp_path):
    """By name, path, text, dictionary, `Scene`, machine, and what `to_yaml` writes."""
    path = CONFIG / f'{name}.yaml'
    text = path.read_text(encoding='utf-8')
    by_name = ms.load_scene(name)
    own = tmp_path / 'own.yaml'
    own.write_text(by_name.scene.to_yaml(), encoding='utf-8')
    forms = [path, str(path), text, yaml.safe_load(text), by_name.scene, by_name, own,
             by_name.scene.to_yaml(), by_name.scene.to_document()]  # fmt: skip
    if by_name.scene.mechanism == yaml.safe_load(text)['mechanism']:
        forms.append(ms.Scene(**yaml.safe_load(text)))
    digest = ms.simulate(name, duration='50 ms').digest()
    for form in forms:
        machine = ms.load_scene(form)
        assert machine.scene == by_name.scene
        assert machine.fingerprint == by_name.fingerprint
    for form in (text, by_name.scene.to_yaml(), forms[-1]):
        assert ms.simulate(form, duration=0.05).digest() == digest


def test_a_machine_by_file_dictionary_builder_editor_and_import_has_one_digest(tmp_path):
    """In the editor it is drawn on and back; from MJCF with what that format does not have."""
    written = yaml.safe_load((CONFIG / 'pendulum.yaml').read_text(encoding='utf-8'))
    built = ms.Scene(
        title='Pendulum',
        links={'bar': ms.LinkPart(length=1.0, cog=0.5, mass=1.2, inertia=0.1)},
        joints={'ground_bar': ms.JointPart(revolute=['ground', 'bar'])},
        gravity=(0.0, -9.81),
        initial={'position': {'bar': '-30 deg'}},
    )
    page = Page('pendulum')
    for mass in ('3 kg', '1.2 kg'):
        page.set('links.bar.mass', mass)
    exported = tmp_path / 'pendulum.xml'
    exported.write_text(to_mjcf(ms.load_scene('pendulum')))
    imported = import_machine(exported).data | {k: written[k] for k in ('gravity', 'initial')}
    forms = 'pendulum', written, built, page.session.document.text, imported
    assert len({ms.simulate(form, duration=0.5).digest() for form in forms}) == 1


def test_what_is_built_equals_what_is_written():
    """The same numbers by classes of the schema, NumPy and a file with units."""
    written = """
    title: A loose pendulum
    mechanism: linkage
    links: {bar: {length: 1000 mm, mass: 1250 g, inertia: 1e5 kg mm^2, cog: 0.5 m}}
    joints:
      pivot: {revolute: [ground, bar], clearance: {radial: 500 um, restitution: 0.5}}
    start: centred
    gravity: [0, -981 cm/s^2]
    initial: {position: {bar: 30 deg}}
    duration: 300 ms
    """
    assert ms.load_scene(written).scene == bouncing()
    solution = ms.simulate(bouncing())
    assert len(solution.impacts) > 3
    assert solution.digest() == ms.simulate(written).digest()
    assert solution.digest() == ms.simulate(bouncing().to_yaml()).digest()


def test_quantities_of_pint_are_as_text():
    pint = pytest.importorskip('pint').UnitRegistry()
    bar = ms.LinkPart(length=100 * pint.cm, mass=1250 * pint.gram, cog=pint.Quantity(0.5, 'm'),
                      inertia=1e5 * pint.kg * pint.mm**2)  # fmt: skip
    scene = bouncing().model_copy(update={'links': {'bar': bar}})
    assert scene == bouncing()
    faster = ms.load_scene('slider_crank', {'drive.speed': 300 * pint.rpm})
    assert faster.fingerprint == ms.load_scene('slider_crank', ['drive.speed=300 rpm']).fingerprint
    points = {'title': 'a', 'mechanism': 'linkage', 'joints': {'o': {'revolute': ['ground', 'b']}},
              'links': {'b': {'points': {'p': [30, 40] * pint.mm}}},
              'drive': {'coordinate': 'b', 'speed': 2 * pint.radian / pint.second}}  # fmt: skip
    assert ms.load_scene(points).scene.links['b'].points == {'p': (0.03, 0.04)}
    assert ms.simulate('slider_crank', duration=20 * pint.ms).duration == 0.02
    with pytest.raises(InputError, match=r'drive.speed = .*5.*Hz.*it may mean rev/s or rad/s'):
        ms.load_scene('slider_crank', {'drive.speed': 5 * pint.Hz})


def test_points_of_a_data_frame_are_those_of_its_rows():
    """One of pandas or polars is known by its `to_numpy`; its columns were read as the points."""

    class Frame:
        def __iter__(self):
            return iter(('t', 'angle'))

        def to_numpy(self):
            return np.array([[0.0, 0.0], [1.0, 0.5], [2.0, 0.2], [3.0, 0.0]])

    def scene(points):
        drive = {'coordinate': 'crank', 'position': {'points': points}}
        return ms.load_scene('slider_crank', {'drive': drive})

    assert scene(Frame()).fingerprint == scene(Frame().to_numpy().tolist()).fingerprint


def test_times_and_angles_have_units_where_they_are_arguments():
    assert ms.simulate('pendulum', duration='1500 ms').duration == 1.5
    assert ms.stream('pendulum', duration='0.5 s').finish().duration == 0.5
    one = ms.cycle('slider_crank', start='90 deg', duration='20 ms', samples=4)
    assert one['position.crank'][0] == pytest.approx(math.pi / 2.0, rel=1e-14)
    assert one.duration == pytest.approx(0.02, rel=1e-12)
    assert ms.draw('slider_crank', t='25 ms').get_axes()
    run = ms.simulate('slider_crank', duration='0.1 s')
    late, all_of_it = (
        ms.measure('slider_crank', run, 'mean(velocity.piston)', **window)[0].value
        for window in ({'since': '50 ms'}, {})
    )
    assert late == pytest.approx((0.25 - 0.15) / 0.05, rel=1e-9)  # outward in half of a turn
    assert all_of_it == pytest.approx(0.0, abs=1e-12)


def test_data_frames_have_the_samples(monkeypatch):
    pandas, polars = pytest.importorskip('pandas'), pytest.importorskip('polars')
    solution = ms.simulate('slider_crank', duration='0.1 s')
    frame = solution.to_frame('position.piston', rate='1 kHz')
    assert isinstance(frame, pandas.DataFrame)
    assert frame['t'].to_numpy() == pytest.approx(np.arange(101) / 1000.0)
    assert frame.attrs['units'] == {'t': 's', 'position.piston': 'm'}
    at = solution.sample(frame['t'].to_numpy(), 'position.piston')['position.piston']
    assert frame['position.piston'].to_numpy().tolist() == at.tolist()
    assert len(solution.to_frame()) == 1000
    monkeypatch.setattr('mechanism_sim.tables.find_spec', lambda _: None)
    assert isinstance(solution.to_frame('position'), polars.DataFrame)
    with pytest.raises(InputError, match='samples need a positive rate'):
        solution.to_frame(rate=0.0)


@pytest.mark.slow
def test_a_sweep_and_a_search_take_scenes_of_every_form():
    """Torque in a crank at rest, ``m g r cos``: a bar of 2 kg, 0.25 m, held by its drive."""
    bar = ms.Scene(
        title='A bar', gravity=[0.0, -9.81],
        links={'bar': {'mass': 2.0, 'inertia': 0.1, 'cog': 0.25}},
        joints={'o': {'revolute': ['ground', 'bar']}}, drive={'coordinate': 'bar', 'speed': 5.0},
    )  # fmt: skip
    table = ms.sweep(
        {'grid': {'links.bar.cog': [0.1, '20 cm', '0.3 m']}, 'revolutions': 1}, scene=bar,
        measures=['top = highest(drive_torque)'],
    )  # fmt: skip
    assert table['top'] == pytest.approx(2.0 * 9.81 * np.array([0.1, 0.2, 0.3]), rel=1e-12)
    assert table.units['top'] == 'N m'
    assert len(table.to_frame()) == 3
    assert table['status'].tolist() == ['done'] * 3
    found = ms.find(bar.to_yaml(), {'links.bar.cog': (0.1, '30 cm')},
                    'highest(drive_torque) = 4 N m', samples=3)  # fmt: skip
    assert found.values['links.bar.cog'] == pytest.approx(4.0 / (2.0 * 9.81), rel=1e-11)
    with pytest.raises(InputError, match="has a 'scene' of its own"):
        ms.sweep({'scene': 'pendulum', 'duration': 1, 'runs': [{}]}, scene=bar)


@pytest.mark.slow
def test_a_report_is_written_of_runs_of_every_form(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = ms.simulate('slider_crank', revolutions=1)
    assert ms.report(run) == Path('slider_crank.html')
    assert ms.report('slider_crank', 'part.html', start='20 ms', duration='30 ms').is_file()
    two = ms.report(run, other=ms.load_scene('slider_crank', {'drive.speed': '700 rpm'}))
    assert two == Path('slider_crank_slider_crank.html')
    assert 'rms(drive_torque)' in ms.report(
        run, 'm.html', measures=['rms(drive_torque)']
    ).read_text(encoding='utf-8')
    with pytest.raises(InputError, match='measures apply to a single run'):
        ms.report(run, other=run, measures=['rms(drive_torque)'])


@pytest.mark.parametrize('turns', [25, pytest.param(10_000, marks=pytest.mark.slow)])
def test_thousands_of_turns_end_where_the_first_does(turns):
    """At 3000 1/min, in 0.5 or 200 s: the phase of a whole turn, to the rounding of its turns."""
    fast = ms.load_scene('slider_crank', {'drive.speed': '3000 1/min'})
    run = ms.stream(fast, duration=f'{turns / 50} s').finish()
    assert run.final.t[0] == turns / 50
    names = ['velocity.crank', 'position.crank', 'position.piston']
    speed, angle, place = (x[0] for x in catalogue(fast).columns(names, run.final).values())
    assert speed == pytest.approx(100.0 * math.pi, rel=1e-15)
    assert angle == pytest.approx(2.0 * turns * math.pi, rel=1e-15)
    assert place == pytest.approx(0.25, rel=1e-12)


@pytest.mark.slow
@pytest.mark.network
def test_a_machine_of_python_runs_as_nodes_and_comes_back_from_its_bag(tmp_path):
    file, bag = tmp_path / 'own.yaml', tmp_path / 'own.mcap'
    file.write_text(bouncing().to_yaml(), encoding='utf-8')
    run_json('run', str(file), '--record', str(bag), env=environment())
    assert read_record(bag).digest() == ms.simulate(bouncing()).digest()
    assert ms.open_run(bag).machine.scene == bouncing()


@pytest.mark.parametrize(
    ('source', 'said'),
    [
        (3, '3 is not a scene: give a name, a path, YAML as text, a dictionary, a Scene or a'),
        (None, 'null is not a scene'),
        ('pendulm', "there is no scene 'pendulm'; did you mean 'pendulum'?"),
        (Path('none.yaml'), "there is no scene file 'none.yaml'"),
        ({'title': 'x'}, "scene: 'mechanism' is missing"),
        ('title: x\n- y', 'scene: line 2 is not valid YAML'),
        ('- title\n- x', 'scene: a scene is a list of keys with values'),
        ({'mechanism': 'linkage', 'titel': 'x'}, "did you mean 'title'"),
        ({'mechanism': 'linkage', 'title': {1, 2}, 'links': {}, 'joints': {}}, 'scene: title'),
        ({'mechanism': 'linkage', 'title': 'x', 'links': {'a': {'mass': object()}}, 'joints': {}},
         'scene: links.a.mass'),
    ],
)  # fmt: skip
def test_what_is_no_scene_is_one_sentence(source, said):
    with pytest.raises(InputError) as caught:
        ms.load_scene(source)
    assert said in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('call', 'said'),
    [
        (lambda: ms.simulate('pendulum', duration='10 kg'), "duration = '10 kg' has the unit"),
        (lambda: ms.simulate('pendulum', duration='-1 s'), 'must be positive and finite'),
        (lambda: ms.cycle('slider_crank', start='3 s'), "start = '3 s' has the unit 's'"),
        (lambda: ms.draw('slider_crank', angle='1,5 rad'), 'a decimal comma, 1,5'),
        (lambda: ms.play('slider_crank', end='5 mm'), "end = '5 mm' has the unit 'mm'"),
        (lambda: ms.find('slider_crank', {}, 'mean(drive_torque) = 1'), 'at least one key'),
        (lambda: ms.find('slider_crank', {'drive.speed': (2, 1)}, minimise='rms(drive_torque)'),
         'the second value must be larger'),
        (lambda: ms.sweep({'grid': {}}, scene='pendulum'), "give 'revolutions' or 'duration'"),
        (lambda: ms.report('pendulum', 'a.pdf'), '.html'),
        (lambda: ms.draw('pendulum', 'x.svg'), "draw(...).savefig('x.svg')"),
        (lambda: ms.draw('pendulum', file='x.svg'), 'here that is savefig(FILE) of the picture'),
        (lambda: ms.draw('pendulum', position=3), "has no option 'position'; did you mean 'pos"),
        (lambda: ms.plot('pendulum', agains='t'), "plot has no option 'agains'; did you mean 'ag"),
        (lambda: ms.animate('pendulum', 'x.gif', label='all'), "did you mean 'labels'?; it has"),
        (lambda: ms.ensemble('pendulum', {}, n_jobs=2), "no option 'n_jobs'; here that is 'worke"),
        (lambda: ms.ensemble('pendulum', {}, mesures=''), "'mesures'; did you mean 'measures'?"),
        (lambda: ms.sweep('x', processes=2), "no option 'processes'; here that is 'workers'; it"),
        (lambda: ms.find('pendulum', {}, cores=2), "no option 'cores'; here that is 'workers'"),
        (lambda: ms.life('pendulum', tolerances=1), "did you mean 'tolerance'?; it has scene, un"),
        (lambda: ms.bifurcation('pendulum', {}, joint=''), "bifurcation has no option 'joint'"),
        (lambda: ms.basins('pendulum', {}, transients=3), "did you mean 'transient'?; it has"),
        (lambda: ms.draw(ms.simulate('pendulum', duration=0.1)), 'or a machine, as .machine of'),
    ],
)  # fmt: skip
def test_wrong_arguments_are_one_sentence(call, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as caught:
        call()
    assert said in str(caught.value)
    assert not [*tmp_path.iterdir()]


def test_parts_of_a_scene_have_their_keys_in_their_signatures():
    """By which notebooks complete them; those of all kinds of joints and loads."""
    joint = inspect.signature(ms.JointPart).parameters
    assert {'revolute', 'prismatic', 'slot', 'cam', 'clearance', 'friction'} <= {*joint}
    scene = inspect.signature(ms.Scene).parameters
    assert {'links', 'joints', 'loads', 'springs', 'tables', 'measures'} <= {*scene}
    assert AffineTorque(constant='2 Nm').constant == 2.0


@pytest.mark.parametrize('name', [n for n in ms.__all__ if inspect.isfunction(getattr(ms, n))])
def test_keywords_that_nobody_takes_are_refused_by_the_name_of_the_function(name):
    """Not by that of a private one which they are handed on to."""
    function = getattr(ms, name)
    needed = [p for p in inspect.signature(function).parameters.values() if p.default is p.empty]
    count = sum(p.kind is p.POSITIONAL_OR_KEYWORD for p in needed)
    with pytest.raises((InputError, TypeError), match=rf"^{name}(\(\) got| has no option).*'zzz'"):
        function(*['pendulum'] * count, zzz=1)


def test_machines_and_runs_are_keys_of_dictionaries():
    """Machines of one scene are equal, as for `lru_cache`; a run is itself only."""
    one, two = ms.load_scene('slider_crank'), ms.load_scene('slider_crank')
    fast = ms.load_scene('slider_crank', {'drive.speed': '1 rad/s'})
    assert len({one, two, fast, copy.deepcopy(one)}) == 2
    run = ms.simulate(one, duration='1 ms')
    same = pickle.loads(pickle.dumps(run))
    assert run == run != same  # noqa: PLR0124
    assert run in [same, run]
    assert len({run, same, ms.open_run(run).piece}) == 2
    assert run.digest() == same.digest()
