"""Equalities of an MJCF, and what of them and of others is left out with a note."""

from __future__ import annotations

import pytest

import mechanism_sim as ms
from mechanism_sim.imports import import_machine

BODIES = ''.join(
    f'<body name="{x}" pos="{k} 0 0" {{{x}}}><joint name="j{x}" axis="0 0 1" {{j{x}}}/>'
    '<inertial pos="0.1 0 0" mass="1" diaginertia="1 1 2"/></body>'
    for k, x in enumerate('abcd')
)
NONE = dict.fromkeys([*'abcd', 'ja', 'jb', 'jc', 'jd'], '')


def imported(folder, more, **given):
    """Transmissions by name, and the notes but those of drives and gravity."""
    file = folder / 'm.xml'
    worldbody = BODIES.format(**{**NONE, **given})
    file.write_text(f'<mujoco><worldbody>{worldbody}</worldbody>{more}</mujoco>')
    found = import_machine(file)
    joints = {k: j for k, j in found.data['joints'].items() if 'transmission' in j}
    return joints, [x for x in found.notes if 'defines no drive' not in x]


def tendon(name, **factors):
    """A sum of joint coordinates."""
    terms = ''.join(f'<joint joint="j{x}" coef="{f}"/>' for x, f in factors.items())
    return f'<fixed name="{name}">{terms}</fixed>'


def test_equalities_of_joints_are_ratios(tmp_path):
    """``ja = 2 jb`` and ``jd = jc``: the second turns by the ratio of the first."""
    found, notes = imported(
        tmp_path,
        '<equality><joint name="held" joint1="ja" joint2="jb" polycoef="0 2 0 0 0"/>'
        '<joint name="other" joint1="jc" joint2="jd"/></equality>',
    )
    assert (found['held']['transmission'], found['held']['ratio']) == (['a', 'b'], '1/2')
    assert (found['other']['transmission'], found['other']['ratio']) == (['c', 'd'], '1')
    assert notes == []


@pytest.mark.parametrize('held', [
    '<joint name="held" active="false" joint1="ja" joint2="jb"/>',
    '<joint name="held" class="off" joint1="ja" joint2="jb"/>',
    '<tendon name="held" active="false" tendon1="t"/>',
    '<connect name="held" active="false" body1="a" body2="b" anchor="0 0 0"/>',
])  # fmt: skip
def test_equalities_that_are_not_active_hold_nothing(tmp_path, held):
    """They became transmissions and joints."""
    off = '<default><default class="off"><equality active="false"/></default></default>'
    sums = f'<tendon>{tendon("t", a=1, b=1)}</tendon>'
    found = imported(tmp_path, f'{off}{sums}<equality>{held}</equality>')
    assert found == ({}, ['held: left out: an equality that is not active'])


@pytest.mark.parametrize(
    ('polynomial', 'ratio', 'words'),
    [
        ('0 2 0.7 0 0', None, 'held: left out: a ratio that is a polynomial'),
        ('0 2 0 0 1e-3', None, 'held: left out: a ratio that is a polynomial'),
        (
            '0.3 2 0 0 0',
            '1/2',
            'held: its constant 0.3 is left out: it holds what is at the start',
        ),
    ],
)
def test_other_parts_of_a_polynomial_have_a_note(tmp_path, polynomial, ratio, words):
    joint = f'<joint name="held" joint1="ja" joint2="jb" polycoef="{polynomial}"/>'
    found, notes = imported(tmp_path, f'<equality>{joint}</equality>')
    assert [x['ratio'] for x in found.values()] == ([ratio] if ratio else [])
    assert notes == [words]


@pytest.mark.parametrize(
    ('first', 'second', 'ratio', 'pair'),
    [
        ({'a': 1}, {'b': 3}, '1/6', ['a', 'b']),  # a = 2 (3 b)
        ({'a': 1, 'b': 4}, {'b': 3}, '1/2', ['a', 'b']),  # a + 4 b = 6 b
        ({'a': 1, 'b': 1}, None, '-1', ['a', 'b']),
    ],
)
def test_a_tendon_may_follow_a_second_one(tmp_path, first, second, ratio, pair):
    """The second was passed over, and the first stayed as long as it was."""
    sums = tendon('one', **first) + (tendon('other', **second) if second else '')
    to = 'tendon2="other"' if second else ''
    held = f'<equality><tendon name="held" tendon1="one" {to} polycoef="0 2 0 0 0"/></equality>'
    found, notes = imported(tmp_path, f'<tendon>{sums}</tendon>{held}')
    assert (found['held']['transmission'], found['held']['ratio']) == (pair, ratio)
    assert notes == []


def test_tendons_over_more_than_two_links_are_left_out(tmp_path):
    sums = tendon('one', a=1, b=1) + tendon('other', c=1, d=1)
    held = '<equality><tendon name="held" tendon1="one" tendon2="other"/></equality>'
    found, notes = imported(tmp_path, f'<tendon>{sums}</tendon>{held}')
    assert not found
    assert notes == ['held: left out: it is not a ratio of the angles of two links']


@pytest.mark.parametrize(
    ('given', 'words'),
    [
        ({'b': 'gravcomp="1"'}, 'b: left out: gravcomp, a force against its weight'),
        ({'jb': 'springdamper="0.1 1"'}, 'jb: its springdamper is left out: see `springs`'),
        ({'b': 'gravcomp="0"', 'jb': 'springdamper="0 0"'}, None),
    ],
)
def test_forces_that_a_scene_has_not_have_a_note(tmp_path, given, words):
    assert imported(tmp_path, '', **given) == ({}, [words] if words else [])


def test_what_else_a_file_has_of_tendons_and_its_medium_has_a_note(tmp_path):
    sums = tendon('t', a=1, b=1).replace('name=', 'range="0 1" frictionloss="2" name=')
    _, notes = imported(tmp_path, f'<option density="1.2"/><tendon>{sums}</tendon>')
    assert notes == [
        'density of the medium is left out',
        't: its limits are left out: see `stops`',
        't: its friction is left out, which does not depend on its load',
    ]


def springs(folder, more, **given):
    """Springs by name, and the notes."""
    file = folder / 'm.xml'
    file.write_text(
        f'<mujoco>{given.pop("default", "")}<worldbody><site name="s" pos="0 1 0"/>'
        f'{BODIES.format(**{**NONE, **given}).replace("<inertial", PLACE, 1)}</worldbody>'
        f'<tendon>{more}</tendon></mujoco>'
    )
    found = import_machine(file)
    return found.data.get('springs', {}), found.notes


PLACE = '<site name="p" pos="0.1 0 0"/><inertial'
LINE = '<site site="s"/><site site="p"/></spatial>'


def test_tendons_take_stiffness_and_damping_from_their_class(tmp_path):
    """Joints and sites did, and what tendons have besides: their springs were lost in silence."""
    default = '<default><default class="soft"><tendon stiffness="9" damping="2"/></default>'
    more = f'<spatial name="line" class="soft" springlength="0.5">{LINE}'
    more += tendon('sum', a=1).replace('<fixed', '<fixed class="soft" springlength="0.25"')
    found, notes = springs(tmp_path, more, default=f'{default}</default>')
    assert (found['line']['stiffness'], found['line']['damping']) == ('9.0 N/m', '2.0 N s/m')
    assert found['line']['free_length'] == '0.5 m'
    assert found['sum']['stiffness'] == '9.0 N m/rad'
    assert found['sum']['free_angle'] == '0.25 rad'
    assert not [note for note in notes if 'left out' in note]


def test_dampers_between_points_are_no_springs_without_length(tmp_path):
    """They were left out as tendons that are no springs, those of angles as without length."""
    more = f'<spatial name="line" damping="2">{LINE}'
    more += tendon('sum', a=1).replace('<fixed', '<fixed damping="3"')
    found, notes = springs(tmp_path, more)
    assert (found['line']['stiffness'], found['line']['damping']) == ('0.0 N/m', '2.0 N s/m')
    assert found['sum'] == {'between': ['ground', 'a'], 'damping': '3.0 N m s/rad'}
    assert not [note for note in notes if 'left out' in note]


ARM_ON_BAND = """<mujoco><worldbody><site name="wall" pos="0.1 0 0.3"/><body name="arm">
<joint name="j" type="hinge" axis="0 1 0"/><site name="tip" pos="0.3 0 0"/>
<inertial pos="0.15 0 0" mass="1" diaginertia="0.01 0.01 0.01"/></body></worldbody><tendon>
<spatial name="band" stiffness="200" damping="{}" springlength="{}"><site site="wall"/>
<site site="tip"/></spatial></tendon></mujoco>"""


@pytest.mark.parametrize(
    ('lengths', 'damping', 'right', 'parts'),
    [
        ('0.35 0.35', 3, -0.0755560, {'band'}),
        ('0.3 0.4', 0, -0.3307956, {'band_shorter', 'band_longer'}),
        ('0.3 0.4', 3, -0.3328705, {'band', 'band_shorter', 'band_longer'}),
        ('0 0.5', 3, -1.0857622, {'band', 'band_longer'}),  # a rope, which only pulls
    ],
)
def test_a_band_that_is_free_between_two_lengths_moves_as_in_mujoco(
    tmp_path, lengths, damping, right, parts
):
    """Angles after 1 s are those of MuJoCo 4.0.0, by Runge and Kutta's steps of 0.1 ms."""
    file = tmp_path / 'band.xml'
    file.write_text(ARM_ON_BAND.format(damping, lengths))
    found = import_machine(file, overrides={'gravity': [0, -9.81]})
    assert found.data['springs'].keys() == parts
    solution = ms.simulate(found.data, duration=1.0)
    assert float(solution.sample([1.0])['position.arm'][0]) == pytest.approx(right, abs=2e-7)


def test_a_sum_of_joints_that_is_free_between_two_values_has_two_springs(tmp_path):
    more = tendon('sum', a=-2).replace(
        '<fixed', '<fixed stiffness="9" damping="2" springlength="-0.5 0.25"'
    )
    found, _ = springs(tmp_path, more)
    assert found['sum'] == {'between': ['a', 'ground'], 'damping': '8.0 N m s/rad'}
    for part, side, free in (('sum_shorter', 'below', -0.25), ('sum_longer', 'above', 0.125)):
        assert found[part]['acts'] == side
        assert found[part]['stiffness'] == '36.0 N m/rad'
        assert found[part]['free_angle'] == f'{free} rad'
    unknown = more.replace('-0.5 0.25', '-1 -1')  # by the file's definition it is not given
    assert 'sum' not in springs(tmp_path, unknown)[0]


@pytest.mark.parametrize(
    ('lengths', 'free'),
    [
        ('-1 1', {'sum_shorter': '-1.0 rad', 'sum_longer': '1.0 rad'}),
        ('-0.5 -0.5', {'sum': '-0.5 rad'}),
        ('-0.5', {'sum': '-0.5 rad'}),
        ('-1', {}),
    ],
)
def test_sums_of_joints_may_be_free_at_negative_values(tmp_path, lengths, free):
    """As ``tendon_lengthspring`` of MuJoCo 4.0.0 has them: only -1 alone, or twice, is none."""
    more = tendon('sum', a=1).replace('<fixed', f'<fixed stiffness="9" springlength="{lengths}"')
    found, _ = springs(tmp_path, more)
    assert {name: spring['free_angle'] for name, spring in found.items()} == free
