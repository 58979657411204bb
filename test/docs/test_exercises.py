"""The exercises of cams and gears by a second route: closed forms, not the program's own."""

import math
import re

import numpy as np
import pytest
from running import ROOT
from willis import Mesh, Train

import mechanism_sim as ms
from mechanism_sim.report.profile import profile
from mechanism_sim.results.cycle import cycle

PAGE = (ROOT / 'docs/exercises.md').read_text('utf-8')
LAW = 'joints.contact.law'
R, D, W = 0.03, 0.006, 10.0
CIRCULAR = {LAW: {'eccentric': D}, 'joints.contact.base_radius': R - D, 'drive.speed': -W}


def rise(curve):
    ends = ((0, 90, '10 mm'), (180, 360, '-10 mm'))
    return {
        LAW: {
            'segments': [
                {'from': f'{a} deg', 'to': f'{b} deg', 'rise': u, 'curve': curve}
                for a, b, u in ends
            ]
        }
    }


def turn(scene, changes=None):
    return cycle(ms.load_scene(scene, changes or {}))


def figures(scene, joint, changes=None):
    sheet = profile(ms.load_scene(scene, changes or {}), joint)
    return {f.name: f.value for f in sheet.figures}


def test_the_circular_cam():
    """[V] 4.2 to 4.4, 4.10, 4.12 and exercise 1; gamma is the angle of the cam."""
    found = turn('rise_dwell_return', CIRCULAR)
    gamma = -found['position.cam']
    q = np.sqrt(R**2 - (D * np.cos(gamma)) ** 2)
    assert found['position.follower'] == pytest.approx(D * np.sin(gamma) + q, rel=1e-12)
    velocity = W * (D * np.cos(gamma) + 0.5 * D**2 * np.sin(2 * gamma) / q)
    assert found['velocity.follower'] == pytest.approx(velocity, rel=1e-10, abs=1e-14)
    ends = found.extremes()
    place, pull = ends['position.follower'], ends['acceleration.follower']
    assert (place.least.value, place.greatest.value) == pytest.approx((R - D, R + D), rel=1e-12)
    assert pull.least.value == pytest.approx(-D * W**2 * (1 + D / R), rel=1e-9)
    assert pull.greatest.value == pytest.approx(D * W**2 * (1 - D / R), rel=1e-9)
    sine = np.sin(found['pressure_angle.contact'])
    assert abs(sine) == pytest.approx(abs(D / R * np.cos(gamma)), abs=1e-12)
    across = found['sliding_speed.contact'] * np.cos(found['pressure_angle.contact'])
    assert across == pytest.approx(W * found['position.follower'], rel=1e-10)
    flat = turn('rise_dwell_return', {**CIRCULAR, 'joints.contact.follower': 'flat'})
    assert flat['position.follower'] == pytest.approx(R + D * np.sin(gamma), rel=1e-12)


@pytest.mark.parametrize(
    ('curve', 'peak'),
    [('cycloidal', 2 * math.pi), ('harmonic', math.pi**2 / 2), ('four_spline', 12.0)],
)
def test_accelerations_of_rise_and_return(curve, peak):
    """[V] 4.6, 4.7 and 4.9: times L/beta^2, over a quarter of a turn and over half a one."""
    found = turn('rise_dwell_return', rise(curve))
    ends, lift = found.extremes()['acceleration.follower'], 0.01
    assert ends.greatest.value == pytest.approx(peak * lift / (math.pi / 2) ** 2, rel=1e-9)
    back = found.at(np.linspace(math.pi + 1e-6, 2 * math.pi - 1e-6, 2001))
    assert abs(back['acceleration.follower']).max() == pytest.approx(
        peak * lift / math.pi**2, rel=2e-3
    )


@pytest.mark.parametrize('curve', ['cycloidal', 'harmonic'])
def test_a_larger_base_circle_has_a_smaller_pressure_angle(curve):
    """Exercises 5 and 6, over samples of tan(alpha) = u'/(r + u)."""
    s = np.linspace(0.0, 1.0, 400_001)
    if curve == 'cycloidal':
        u, u1 = s - np.sin(2 * np.pi * s) / (2 * np.pi), 1 - np.cos(2 * np.pi * s)
    else:
        u, u1 = (1 - np.cos(np.pi * s)) / 2, np.pi * np.sin(np.pi * s) / 2
    seen = []
    for base in (0.02, 0.03, 0.045):
        found = figures(
            'rise_dwell_return', 'contact', {**rise(curve), 'joints.contact.base_radius': base}
        )
        told = np.arctan(0.01 * u1 / (math.pi / 2) / (base + 0.01 * u)).max()
        assert found['largest_pressure_angle'] == pytest.approx(told, rel=1e-9)
        seen.append(told)
    assert seen == sorted(seen, reverse=True)


@pytest.mark.slow
def test_trains():
    """[V] 5.11 to 5.14, by the linear equations of all meshes."""
    sun = turn('planetary')['velocity.sun'][0]
    simple = Train({'2': 24, '4': 24, '5': 72},
                   (Mesh('2', '4', '3'), Mesh('4', '5', '3', internal=True)))  # fmt: skip
    told = simple.speeds({'2': sun, '5': 0.0})
    found = turn('planetary')
    assert found['velocity.carrier'][0] == pytest.approx(told['3'])
    assert found['velocity.planet'][0] == pytest.approx(told['4'])
    assert (told['4'] - told['3']) / (told['2'] - told['3']) == pytest.approx(-1.0)
    found = turn('compound_planetary')
    m = 20 / 20 * 18 / 36
    ratio = found['velocity.carrier'][0] / found['velocity.sun'][0]
    assert ratio == pytest.approx(m / (1 + m))
    found = turn('differential')
    both = found['velocity.left'] + found['velocity.right']
    assert both == pytest.approx(2 * found['velocity.carrier'])


def test_sizes_of_gears():
    """[V] 5.10, 5.15 and 5.16."""
    worm = figures('worm_drive', 'pair')
    lead = math.pi * 0.02 * math.tan(math.radians(10))
    assert worm['lead'] == pytest.approx(lead)
    assert worm['ratio'] == pytest.approx(math.pi * worm['wheel_diameter'] / lead)
    assert worm['centre_distance'] == pytest.approx((0.02 + 15 * lead / math.pi) / 2)
    pressure = math.acos(1 - 2.2 / 18)
    found = figures('gear_pair', 'mesh', {
        'gears.pinion.teeth': 18, 'gears.wheel.teeth': 36,
        'links.ground.points.wheel': [0.054, 0.0],
        'gears.pinion.pressure_angle': pressure, 'gears.wheel.pressure_angle': pressure,
    })  # fmt: skip
    assert 2 * found['pinion.base_radius'] == pytest.approx(0.036 - 2.2 * 0.002)
    assert found['ratio'] == pytest.approx(-2.0)


def test_every_problem_is_in_the_tables():
    named = set()
    for cell in re.findall(r'^\| (\d[^|]*) \|', PAGE, re.MULTILINE):
        for part in cell.split(','):
            first, _, last = (word.rstrip('abc') for word in part.strip().partition(' to '))
            *chapter, low = re.split(r'(?<=[.E])(?=\d+$)', first)
            high = re.split(r'(?<=[.E])(?=\d+$)', last or first)[-1]
            named |= {f'{"".join(chapter)}{n}' for n in range(int(low), int(high) + 1)}
    problems = {'1.': 12, '2.': 19, '3.': 12, '4.': 12, '5.': 16, '6.': 20}
    exercises = {'2.E': 9, '3.E': 7, '4.E': 6, '6.E': 2, '3.5.': 5}
    counts = problems | exercises
    assert named == {f'{part}{n}' for part, most in counts.items() for n in range(1, most + 1)}


def smoothness(pieces):
    """Equations of value, slope and curvature of a rise of cubic splines between two dwells.

    Rows of coefficients (3 (pieces + 1), 4 pieces), and right sides for a lift of 1.
    """
    edges = np.linspace(0.0, 1.0, pieces + 1)
    rows, sides = [], []
    for k, x in enumerate(edges):
        for d in range(3):
            terms = np.array([math.perm(j, d) * x ** max(j - d, 0) if j >= d else 0.0
                              for j in range(4)])  # fmt: skip
            row = np.zeros(4 * pieces)
            if k > 0:
                row[4 * k - 4 : 4 * k] += terms
            if k < pieces:
                row[4 * k : 4 * k + 4] -= terms
            rows.append(row)
            sides.append(1.0 if (k, d) == (pieces, 0) else 0.0)
    return np.array(rows), np.array(sides)


def test_smoothness_counts_the_dwells_too():
    """[V] 4.8: of 2N splines 3 (2N + 1) equations; of its two twice two splines it counts 18."""
    assert 2 * len(smoothness(2)[0]) == 18
    for n in range(1, 5):
        equations, lift = smoothness(2 * n)
        assert len(equations) == 3 * (2 * n + 1)
        solution, _, rank, _ = np.linalg.lstsq(equations, lift, rcond=None)
        # with two splines one equation is too many, as [V] says; from four on all can hold
        assert rank == min(equations.shape)
        left = np.abs(equations @ solution - lift).max()
        assert (left < 1e-12) == (n > 1)
    assert '3 (2N + 1)' in PAGE
