"""Paths of coupler points: distances by a second route, and four-bars that take them."""

import math

import numpy as np
import pytest
import scipy
from builders import made
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.results.measures import check_measures
from mechanism_sim.results.path_distance import TargetPath
from mechanism_sim.studies import synthesis
from mechanism_sim.studies.synthesis import path_four_bars

GROUND, CRANK, COUPLER, ROCKER = 0.2, 0.05, 0.3, 0.25
POINT = 0.15 + 0.15j
TURN = 2.0 * math.pi


def traced(angles, ground=GROUND, crank=CRANK, coupler=COUPLER, rocker=ROCKER, point=POINT):
    """Coupler points by intersection of circles about crank pin and rocker pivot."""
    pin = crank * np.exp(1j * angles)
    way = ground - pin
    d = np.abs(way)
    along = (d**2 + coupler**2 - rocker**2) / (2.0 * d)
    across = np.sqrt(coupler**2 - along**2)
    end = pin + (along + 1j * across) * way / d
    return pin + point * (end - pin) / coupler


def written(folder, monkeypatch, z, angles=None, name='path.csv'):
    """A file of points [m] in the current folder."""
    monkeypatch.chdir(folder)
    head = 'x [mm],y [mm]' + (',angle [deg]' if angles is not None else '')
    rows = [f'{1e3 * p.real!r},{1e3 * p.imag!r}' for p in z.tolist()]
    if angles is not None:
        rows = [f'{r},{math.degrees(a)!r}' for r, a in zip(rows, angles.tolist(), strict=True)]
    (folder / name).write_text('\n'.join([head, *rows]) + '\n')


def distances(*texts):
    run = ms.simulate('four_bar_coupler_curve', revolutions=1)
    return [x.value for x in ms.measure('four_bar_coupler_curve', run, *texts)]


def test_distances_from_a_path_are_those_to_its_nearest_places(tmp_path, monkeypatch):
    """Against a search of each point's own over the closed form of the four-bar."""
    rng = np.random.default_rng(3)
    z = traced(rng.uniform(0.0, TURN, 25)) + 0.01 * (
        rng.normal(size=25) + 1j * rng.normal(size=25)
    )
    written(tmp_path, monkeypatch, z)
    looks = np.linspace(0.0, TURN, 2001)
    least = []
    for point in z:
        k = int(np.abs(traced(looks) - point).argmin())
        ends = looks[k] - 0.01, looks[k] + 0.01
        found = scipy.optimize.minimize_scalar(
            lambda x, point=point: abs(traced(np.array([x]))[0] - point), bounds=ends,
            method='bounded', options={'xatol': 1e-10},
        )  # fmt: skip
        least.append(found.fun)
    rms, largest = distances(
        'distance(position.coupler.far, path.csv)',
        'largest_distance(position.coupler.far, path.csv)',
    )
    assert rms == pytest.approx(math.sqrt(np.mean(np.square(least))), rel=1e-9)
    assert largest == pytest.approx(max(least), rel=1e-9)


def test_points_on_the_path_have_no_distance(tmp_path, monkeypatch):
    written(tmp_path, monkeypatch, traced(np.linspace(0.0, TURN, 60)))
    assert distances('largest_distance(position.coupler.far, path.csv)')[0] < 1e-15


def test_points_with_angles_belong_to_instants(tmp_path, monkeypatch):
    """Shifted by 0.1 rad of the crank: the chords of the path, which are longer than distances."""
    angles = np.linspace(-1.0, 4.0, 30)
    written(tmp_path, monkeypatch, traced(angles + 0.1), angles)
    chords = np.abs(traced(angles + 0.1) - traced(angles))
    text = 'distance(position.coupler.far, path.csv)'
    rms, share = distances(text, f'{text} / largest_{text}')
    assert rms == pytest.approx(math.sqrt(np.mean(chords**2)), rel=1e-12)
    assert share == pytest.approx(rms / chords.max(), rel=1e-12)


def test_points_with_angles_of_several_turns(tmp_path, monkeypatch):
    """On a wheel that turns half as fast as the drive; a run of one turn comes to half of them."""
    machine = made({
        'links': {
            'ground': {'points': {'b': [0.06, 0.0]}}, 'pinion': {},
            'wheel': {'points': {'p': [0.02, 0.0]}},
        },
        'gears': {'p': {'at': 'pinion', 'teeth': 20, 'module': '2 mm'},
                  'w': {'at': 'wheel', 'teeth': 40, 'module': '2 mm'}},
        'joints': {'a': {'revolute': ['ground', 'pinion']}, 'm': {'mesh': ['p', 'w']},
                   'b': {'revolute': ['ground.b', 'wheel']}},
        'drive': {'coordinate': 'pinion', 'speed': TURN},
    })  # fmt: skip
    angles = np.linspace(0.1, 1.9 * TURN, 13)
    written(tmp_path, monkeypatch, 0.06 + 0.02 * np.exp(-0.5j * angles), angles)
    text = 'largest_distance(position.wheel.p, path.csv)'
    for length in (2.0, 3.4):
        (found,) = ms.measure(machine, ms.simulate(machine, duration=length), text)
        assert found.value < 1e-14
    (short,) = ms.measure(machine, ms.simulate(machine, duration=1.0), text)
    assert math.isnan(short.value)  # it was 0.04 m: the other side of the wheel
    assert short.resolution == (
        'the run does not come to 6 of 13 points, the first at 401.387 deg from its start'
    )


def test_a_turn_that_comes_again_stands_for_the_next_ones(tmp_path, monkeypatch):
    angles = np.linspace(-1.0, 15.0, 30)
    written(tmp_path, monkeypatch, traced(angles), angles)
    assert distances('largest_distance(position.coupler.far, path.csv)')[0] < 1e-15


def test_turns_of_a_loose_machine_stand_for_the_first_one(tmp_path, monkeypatch):
    """They are never quite the same; beside the ideal machine, by samples of the run itself."""
    monkeypatch.chdir(tmp_path)
    loose, ideal = ms.load_scene('four_bar_clearance'), ms.load_scene('four_bar_nominal')
    angles, period = np.radians(np.arange(-180.0, 180.0, 15.0)), loose.drive.period
    t = period * (angles / TURN + 1.0)
    ideal = ms.simulate(ideal, duration=2.0 * period)
    rows = np.c_[angles, ideal.sample(t, 'position.rocker')['position.rocker']].tolist()
    text = ''.join(f'{a!r};{b!r}\n' for a, b in rows)
    (tmp_path / 'ideal.csv').write_text('angle [rad];rocker [rad]\n' + text)
    run = ms.simulate(loose, duration=4.0 * period)
    measure = 'distance(position.rocker, ideal.csv, from 3 revolutions)'
    (found,) = ms.measure(loose, run, measure)
    there = period * (3.0 + np.mod(angles / TURN, 1.0))
    off = run.sample(there, 'position.rocker')['position.rocker'] - np.array(rows)[:, 1]
    off = np.remainder(off + np.pi, TURN) - np.pi
    assert 1e-5 < found.value < 1e-2
    assert found.value == pytest.approx(math.sqrt(np.mean(off**2)), rel=1e-9)


def test_angles_of_a_file_are_the_same_whole_turns_on(tmp_path, monkeypatch):
    """Freudenstein's equations of y = lg x, 1 to 2, at three points: 0.1686 deg off at most.

    The rocker of the run is at -45 deg where the table has 315 deg.
    """
    monkeypatch.chdir(tmp_path)
    x = 1.5 - 0.5 * np.cos(np.pi / 6.0 * np.array([1.0, 3.0, 5.0]))
    phi = np.radians(45.0 + 60.0 * (x - 1.0))
    psi = np.radians(315.0 + 90.0 * np.log2(x))
    k = np.linalg.solve(np.c_[np.cos(psi), -np.cos(phi), np.ones(3)], np.cos(phi - psi))
    crank, rocker = 0.1 / k[0], 0.1 / k[1]
    coupler = math.sqrt(crank**2 + rocker**2 + 0.1**2 - 2.0 * crank * rocker * k[2])
    x = np.linspace(1.0, 2.0, 21)
    table = 315.0 + 90.0 * np.log2(x)
    rows = [f'{60.0 * (a - 1.0)!r};{b!r}' for a, b in zip(x.tolist(), table.tolist(), strict=True)]
    (tmp_path / 'lg.csv').write_text('angle [deg];rocker [deg]\n' + '\n'.join(rows) + '\n')
    machine = ms.load_scene({
        'mechanism': 'four_bar', 'duration': '6 s',
        'links': {'ground': {'length': 0.1}, 'crank': {'length': crank},
                  'coupler': {'length': coupler}, 'rocker': {'length': rocker}},
        'drive': {'speed': '10 deg/s', 'start_angle': '45 deg'},
    })  # fmt: skip
    pin = crank * np.exp(1j * np.radians(45.0 + 60.0 * (x - 1.0)))
    way = pin - 0.1
    across = np.arccos((np.abs(way) ** 2 + rocker**2 - coupler**2) / (2.0 * rocker * np.abs(way)))
    off = np.degrees(np.angle(way) - across) - (table - 360.0)
    texts = [f'{f}(position.rocker, lg.csv)' for f in ('largest_distance', 'distance')]
    largest, rms = (f.value for f in ms.measure(machine, ms.simulate(machine), *texts))
    assert math.degrees(largest) == pytest.approx(np.abs(off).max(), abs=1e-9)
    assert math.degrees(rms) == pytest.approx(math.sqrt(np.mean(off**2)), abs=1e-9)
    assert np.abs(off).max() == pytest.approx(0.168637, abs=1e-6)


def test_a_function_of_the_drive_is_a_distance_of_a_coordinate(tmp_path, monkeypatch):
    """Rocker angles over those of the crank, by the same intersection of circles."""
    monkeypatch.chdir(tmp_path)
    t = np.linspace(0.0, 0.9, 10)
    pin = CRANK * np.exp(1j * TURN * t)
    end = traced(TURN * t, point=COUPLER)
    rocker = np.degrees(np.angle(end - GROUND))
    rows = [f'{x};{y + 0.5}' for x, y in zip(t.tolist(), rocker.tolist(), strict=True)]
    (tmp_path / 'f.csv').write_text('t [s];rocker [deg]\n' + '\n'.join(rows))
    assert np.abs(np.abs(end - pin) - COUPLER).max() < 1e-15
    (rms,) = distances('distance(position.rocker, f.csv)')
    assert rms == pytest.approx(math.radians(0.5), rel=1e-9)


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('distance(position.coupler.far)', 'of the form distance(EXPRESSION, FILE.csv)'),
        ('distance(velocity.coupler.far, path.csv)', 'needs a position'),
        ('distance(position.coupler.far, none.csv)', 'cannot be read'),
        ('distance(position.coupler.fat, path.csv)', 'position.coupler'),
        ('distance(position.coupler.far, units.csv)', "'y' needs a unit of m"),
        ('distance(position.coupler.far, columns.csv)', "no column 'y'"),
        ('distance(position.coupler.far, /etc/passwd)', 'not a formula'),
    ],
)
def test_mistakes_of_distances_are_one_sentence(tmp_path, monkeypatch, text, said):
    written(tmp_path, monkeypatch, traced(np.linspace(0.0, 1.0, 5)))
    (tmp_path / 'units.csv').write_text('x [mm],y [deg]\n1,2\n')
    (tmp_path / 'columns.csv').write_text('x [mm],z [mm]\n1,2\n')
    with pytest.raises(InputError) as refused:
        distances(text)
    assert said in str(refused.value)
    assert '\n' not in str(refused.value)


def test_points_over_the_angle_of_a_drive_at_rest_are_refused(tmp_path, monkeypatch):
    """They were divided by its speed."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'a.csv').write_text('x [mm],y [mm],angle [deg]\n1,2,0\n2,1,90\n')
    machine = ms.load_scene('four_bar_nominal', {'drive.speed': 0.0})
    with pytest.raises(InputError, match='a column angle needs a drive at constant speed'):
        check_measures(machine, ['distance(position.coupler.end, a.csv)'], 'measures')


def target(z, angles=None):
    points = tuple((p.real, p.imag) for p in z.tolist())
    return TargetPath(points, '' if angles is None else 'angle', tuple(angles or ()))


def path_of(found, angles):
    """Places (N,) of the point of a solution, with its crank at angles from its ground."""
    lengths, point = found.lengths, complex(*found.point)
    if found.branch == 'crossed':
        path = traced(-angles, *lengths, point.conjugate()).conj()
    else:
        path = traced(angles, *lengths, point)
    return complex(*found.pivot) + path * np.exp(1j * found.angle)


def error(found, z):
    """Least distances (n,) of points from the path of a solution over all its turn."""
    angles = np.linspace(0.0, TURN, 2001)
    nearest = angles[np.abs(path_of(found, angles) - z[:, None]).argmin(axis=1)]
    for width in (1e-2, 1e-4):
        near = nearest[:, None] + np.linspace(-width, width, 201)
        k = np.abs(path_of(found, near) - z[:, None]).argmin(axis=1)
        nearest = near[np.arange(len(z)), k]
    return np.abs(path_of(found, nearest) - z)


def test_points_that_leave_a_four_bar_open_give_the_same_one_at_every_call():
    """Six points have twelve coordinates, four-bars and their angles fifteen unknowns."""
    z = traced(np.radians([10.0, 70.0, 130.0, 200.0, 260.0, 320.0]))
    z = (z - z.mean()) / np.sqrt((np.abs(z - z.mean()) ** 2).mean())
    shape, angles = np.array([4.2, 6.3, 5.1, 0.4, 0.6]), np.arange(1.0, 7.0)
    fit = synthesis._Fit(z, None, 0.0)
    rng, found, memory = np.random.default_rng(5), set(), []
    for _ in range(25):
        memory += [np.empty(rng.integers(3000)) for _ in range(7)]  # where arrays come to lie
        found.add(fit.solve(fit.pack(shape, angles), 40).tobytes())
    assert len(found) == 1
    assert np.abs(fit.linear(np.frombuffer(found.pop()))[2]).max() < 1e-9


@pytest.mark.slow
def test_a_curve_of_a_four_bar_is_found_again_with_its_cognates():
    """Roberts: three four-bars trace one curve, here turned, moved and reversed.

    Cognates have the lengths of the first times the sides of its coupler's triangle.
    """
    z = (traced(np.linspace(0.0, TURN, 20, endpoint=False)) * np.exp(0.7j) + 3.0 - 0.4j)[::-1]
    found = path_four_bars(target(z))
    exact = [x for x in found if x.rms < 1e-12]
    legs = abs(POINT) / COUPLER, abs(POINT - COUPLER) / COUPLER
    mine = np.array([GROUND, CRANK, COUPLER, ROCKER])
    # of a cognate at the crank's pivot: ground, crank, coupler and rocker, in another order
    known = [mine, legs[0] * mine[[0, 1, 3, 2]], legs[1] * mine]
    for one in exact:
        assert any(sorted(one.lengths) == pytest.approx(sorted(x), rel=1e-6) for x in known)
        assert error(one, z).max() < 1e-6  # of the looks: squares of their distance
    assert exact


LOOP = np.array([
    0.5 + 1.1j, 0.4 + 1.1j, 0.3 + 1.1j, 0.2 + 1j, 0.1 + 0.9j, 0.05 + 0.75j, 0.02 + 0.6j, 0.5j,
    0.4j, 0.03 + 0.3j, 0.1 + 0.25j, 0.15 + 0.2j, 0.2 + 0.3j, 0.3 + 0.4j, 0.4 + 0.5j, 0.5 + 0.7j,
    0.6 + 0.9j, 0.6 + 1j,
])  # fmt: skip
"""A loop of Kunjur and Krishnamurty, with 20 degrees of the crank between points.

Sums of squares of Nguyen-Van et al., Symmetry 14 (2022) 381, case 3, by data published with it:
0.016078 (their method), 0.10599 (differential evolution), 1.3194 (Jaya). With these lengths.
"""
PUBLISHED = 0.01607768518983885


@pytest.mark.slow
def test_a_loop_of_the_literature_with_prescribed_angles():
    angles = (np.arange(18) * math.pi / 9.0).tolist()
    found = path_four_bars(target(LOOP, angles), math.radians(20.0))[0]
    turned = found.start - found.angle + (1.0 if found.forward else -1.0) * np.array(angles)
    off = np.abs(path_of(found, turned) - LOOP)
    assert (off**2).sum() == pytest.approx(18.0 * found.rms**2, rel=1e-9)
    assert (off**2).sum() < 0.57 * PUBLISHED
    assert off.max() == pytest.approx(found.largest, rel=1e-9)
    assert found.transmission == pytest.approx(np.radians([43.3, 154.6]), abs=1e-3)


def test_published_lengths_have_the_published_error():
    """The sum of squares of their best design, by the intersection of circles of these tests."""
    r1, r2, r3, r4, along, across, x0, y0, turned, first = (
        49.800886, 0.28817159, 48.476138, 1.633642, -23.41281, 7.6644886, -14.836153, 20.140223,
        2.5286091, 5.0644224,
    )  # fmt: skip
    angles = first + np.arange(18) * math.pi / 9.0
    path = traced(angles, r1, r2, r3, r4, complex(along, across))
    other = traced(-angles, r1, r2, r3, r4, complex(along, -across)).conj()
    sums = [(np.abs(p * np.exp(1j * turned) + complex(x0, y0) - LOOP) ** 2).sum()
            for p in (path, other)]  # fmt: skip
    assert min(sums) == pytest.approx(PUBLISHED, rel=1e-6)


@pytest.mark.slow
def test_a_straight_line_of_the_literature():
    """Six points of a line, of Cabrera et al. (2002): 8.8e-4 by differential evolution there."""
    z = 20.0 + 1j * np.arange(20.0, 46.0, 5.0)
    found = path_four_bars(target(z), math.radians(20.0))[0]
    assert 6.0 * found.rms**2 < 8.7979826e-04
    assert error(found, z).max() == pytest.approx(found.largest, rel=0.1)


@pytest.mark.slow
def test_the_command_writes_a_four_bar_that_takes_the_path(tmp_path, monkeypatch):
    """Its own measure is the distance that the command told, and it stays so as a file."""
    z = traced(np.linspace(0.0, TURN, 24, endpoint=False))
    z = z + 1e-3 * np.cos(7.0 * np.angle(z - z.mean()))
    written(tmp_path, monkeypatch, z)
    found = run_json('find', '--path', 'path.csv', '-o', 'four.yaml')['four_bars'][0]
    cycle = ms.cycle('four.yaml')
    (told,) = ms.measure(cycle.machine, cycle.solution)
    assert told.name == 'path_error'
    assert told.value == pytest.approx(found['rms'], rel=1e-6)
    assert 0.0 < told.value < 1e-3


@pytest.mark.parametrize(
    ('args', 'said'),
    [
        (('slider_crank', '--path', 'path.csv'), 'takes no scene'),
        (('--path', 'path.csv', '--vary', 'a=1:2'), 'does not apply to --path'),
        (('--path', 'path.csv', '-o', 'a.svg'), 'writes a scene'),
        (('--path', 'few.csv'), 'at least 5 points'),
        (('--path', 'none.csv'), 'cannot be read'),
        (('slider_crank', '--transmission', '30 deg'), 'needs --path'),
        (('--path', 'path.csv', '--transmission', '30'), "write for example '30 deg'"),
    ],
)
def test_mistakes_of_the_command_are_one_sentence(tmp_path, monkeypatch, args, said):
    written(tmp_path, monkeypatch, traced(np.linspace(0.0, 1.0, 5)))
    written(tmp_path, monkeypatch, traced(np.linspace(0.0, 1.0, 4)), name='few.csv')
    done = run('find', *args)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
