"""Results of the package equal their record (`net.py`), until a commit says otherwise."""

from pathlib import Path

import net
import pytest

pytestmark = pytest.mark.optimised  # the record has the bits of users

RECORD = net.load()
LINES = {' '.join(line): line for lines in net.COMMANDS.values() for line in lines}


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Bags of the three runs."""
    place = tmp_path_factory.mktemp('net')
    net.record_bags(place)
    return place


def differences(part: str, name: str, new: object) -> str:
    """Differences from the record, a line each; empty if there are none."""
    same = net.same_bits(RECORD)
    return '\n'.join(net.compare(part, name, RECORD[part][name], new, same))


def test_the_record_is_of_all_scenes_and_commands():
    missing = {*net.scene_names()} - RECORD['scenes'].keys()
    assert not missing, f'python test/net.py {" ".join(sorted(missing))} --write'
    assert sorted(RECORD['scenes']) == net.scene_names()
    assert RECORD['commands'].keys() == LINES.keys()
    assert RECORD['topics'].keys() == {net.IDEAL, net.LOOSE, net.FREE}


@pytest.mark.sample(8)
@pytest.mark.parametrize('name', net.scene_names())
def test_a_scene_moves_as_recorded(name):
    duration = RECORD['scenes'][name]['duration']
    assert not differences('scenes', name, net.scene_entry(name, duration))


@pytest.mark.parametrize('line', sorted(LINES))
def test_a_command_says_what_is_recorded(line, folder):
    assert not differences('commands', line, net.command_entry(LINES[line], folder))


def test_topics_hold_what_is_recorded(folder):
    for name in RECORD['topics']:
        assert not differences('topics', name, net.topic_entries(folder / f'{name}.mcap'))


def test_a_changed_figure_or_key_is_seen():
    old = RECORD['scenes'][net.IDEAL]
    moved = {**old, 'position': [x * (1.0 + 1e-6) for x in old['position']]}
    (said,) = net.differences('x', old, moved, same_bits=False)
    assert said.startswith('x.position: ')
    lost = {key: value for key, value in old.items() if key != 'level'}
    assert net.differences('x', old, lost, same_bits=False) == ['x.level: lost']


def test_bits_are_those_of_their_environment():
    """Where there were none they are added; others than before leave none elsewhere valid."""
    entry = {'impacts': 3, 'position': [1.0], 'bits': {'here': ['a', 5], 'there': ['b', 6]}}
    here, other, new = ({**entry, 'bits': {k: x}} for k, x in (
        ('here', ['a', 5]), ('here', ['c', 5]), ('elsewhere', ['d', 7]),
    ))  # fmt: skip
    assert net.compare('scenes', 'x', entry, here, same_bits=False) == []
    assert len(net.compare('scenes', 'x', entry, other, same_bits=False)) == 1
    assert net.compare('scenes', 'x', entry, new, same_bits=True) == []
    assert len(net.compare('scenes', 'x', entry, {**here, 'impacts': 4}, same_bits=False)) == 1
    assert net.compare('scenes', 'x', entry, {**new, 'impacts': 4}, same_bits=True) == []
    still = {**entry, 'impacts': 0}
    assert net.compare('scenes', 'x', still, {**new, 'impacts': 0, 'position': [1.1]}, True)
    assert net.merged(entry, here) == entry
    assert net.merged(entry, new)['bits'] == {**entry['bits'], **new['bits']}
    assert net.merged(entry, other) == other


def test_every_environment_has_bits_that_were_compared():
    """A record of bits that no machine makes compares nothing."""
    known = {key for entry in RECORD['scenes'].values() for key in entry['bits']}
    assert net.name_of(RECORD['environment']) in known


def test_figures_behind_many_impacts_are_compared_on_one_processor_only():
    name = f'statistics {net.LOOSE} --revolutions 24 --skip 2'
    old = RECORD['commands'][name]
    key = 'means.impacts.mean'
    other = {**old, 'leaves': {**old['leaves'], key: [1, 60.0, 60.0]}}
    assert not net.compare('commands', name, old, other, same_bits=False)
    assert len(net.compare('commands', name, old, other, same_bits=True)) == 1
    assert net.compare('commands', name, old, {**old, 'leaves': {}}, same_bits=False)
