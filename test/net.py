"""The record of what the package computes, which restructuring must not change.

``python test/net.py`` compares everything with ``references/net.json`` and lists what differs;
``python test/net.py --write`` makes the record anew, to be committed together with the change
that explains it. With names of scenes it does so with these alone: a new scene is entered by
``python test/net.py SCENE --write``. `test_net.py` compares a part of the record on every run of
the tests.

Three kinds of entries:

- ``scenes``: bits, final state and counts of every scene over a short run;
- ``commands``: keys and figures of ``--json`` of the commands on three scenes;
- ``topics``: types, numbers and first messages of the topics of three recorded runs.

Figures are compared everywhere, to `TOLERANCE`. Bits, digest and number of steps, depend on
processor and compilers (docs/accuracy.md): each environment has its own, which ``--write`` adds
where it had none. Where its own are others than before, those of other environments go: nobody
knows them.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import sys
import tempfile
from collections.abc import Iterable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import running
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

import mechanism_sim as ms
from mechanism_sim.catalogue import scene_names
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.scene import span

RECORD = Path(__file__).parent / 'references/net.json'
TOLERANCE = 1e-7
"""Of a figure, or of the largest of its list: other processors round otherwise."""

LENGTH = 0.02
"""[s] of a scene whose drive has no period; of the others a quarter of a turn is run."""

LOOSE, IDEAL, FREE = 'four_bar_clearance', 'four_bar_nominal', 'mass_on_spring'
SHORT = ('--duration', '0.05')
COMMANDS = {
    'check': [('check', s) for s in (IDEAL, LOOSE, FREE)],
    'solve': [('solve', s, *SHORT) for s in (IDEAL, LOOSE, FREE)],
    'cycle': [('cycle', IDEAL), *(('cycle', s, *SHORT) for s in (LOOSE, FREE))],
    'modes': [('modes', s) for s in (IDEAL, FREE)],
    'response': [
        ('response', FREE, '--base', 'base', '--frequencies', '1 Hz:3 Hz:3'),
        ('response', 'unbalanced_machine', '--harmonics', '3'),
    ],
    'find --periodic': [('find', LOOSE, '--periodic', '--transient', '3', '--longest', '1')],
    'statistics': [('statistics', LOOSE, '--revolutions', '24', '--skip', '2')],
    'find --lift-off': [('find', 'eccentric_cam', '--lift-off')],
    'find': [
        ('find', IDEAL, '--vary', 'drive.speed=300 rpm:400 rpm', '--so-that',
         'largest(reaction.coupler_rocker) = 12 N'),
    ],
    'scenes': [('scenes',)],
    'thesis contact-loss': [('thesis', 'contact-loss', LOOSE)],
    'thesis starts': [('thesis', 'starts', LOOSE, '--angles', '2')],
    'draw': [('draw', s, '-o', '{folder}/drawing.svg') for s in (IDEAL, LOOSE, FREE)],
    'export': [
        ('export', s, '--format', 'urdf', '-o', '{folder}/machine.urdf') for s in (IDEAL, LOOSE)
    ],
    'bag info': [('bag', 'info', f'{{folder}}/{s}.mcap') for s in (IDEAL, LOOSE, FREE)],
    'analyze': [('analyze', f'{{folder}}/{s}.mcap') for s in (IDEAL, LOOSE, FREE)],
}  # fmt: skip

CHAOTIC = ('statistics', 'find --periodic', 'thesis')
"""Commands that run through many impacts: their figures are those of one processor."""

_BY_THE_CLOCK = ('wall_time', 'cpu_time', 'compile_time', 'realtime', 'size', 'path', 'file')
_TIMED_TOPICS = ('/clock', '/rosout', '/diagnostics', '/parameter_events')


def environment() -> dict[str, str]:
    """All that digests depend on beside the package: processor, integrator, arrays, Python."""
    cpu = Path('/proc/cpuinfo')
    lines = cpu.read_text(encoding='utf-8').splitlines() if cpu.exists() else []
    known = dict(line.split(':', 1) for line in lines if ':' in line)
    names = {key.strip(): value.strip() for key, value in known.items()}
    processor = ' '.join(names.get(x, '') for x in ('model name', 'cpu family', 'model', 'flags'))
    return {
        'processor': hashlib.sha256(processor.encode()).hexdigest()[:12],
        'heyoka': version('heyoka'),
        'numpy': version('numpy'),
        'python': '.'.join(map(str, sys.version_info[:2])),
    }


def name_of(known: dict[str, str]) -> str:
    """An environment in a line."""
    return ' '.join(known[key] for key in ('processor', 'heyoka', 'numpy', 'python'))


def own() -> str:
    """This environment in a line."""
    return name_of(environment())


def scene_entry(name: str, duration: float | None = None) -> dict[str, Any]:
    """Bits, final state and counts of a scene over `duration` [s], or the usual short run."""
    machine = ms.load_scene(name)
    period = machine.drive.period if math.isfinite(machine.drive.period) else LENGTH / 0.25
    usual = min(0.25 * period, machine.scene.duration or math.inf)
    digest, impacts = MotionDigest(), 0
    run = ms.stream(machine, duration=span(machine, None, duration or usual))
    for piece in run:
        digest.add(piece.motion, piece.impacts)
        impacts += len(piece.impacts)
    final = run.final.observed
    return {
        'duration': run.duration,
        'level': machine.level.value,
        'bits': {own(): [digest.hexdigest(), run.stats.steps]},
        'impacts': impacts,
        'coordinates': list(machine.physics.coordinates),
        'position': final.position[:, 0].tolist(),
        'velocity': final.velocity[:, 0].tolist(),
    }


def record_bags(folder: Path) -> None:
    """Record the three runs that commands and topics are read from."""
    for scene in (IDEAL, LOOSE, FREE):
        bag = str(folder / f'{scene}.mcap')
        done = running.run('run', scene, *SHORT, '--record', bag)
        assert done.returncode == 0, done.stderr


def command_entry(arguments: tuple[str, ...], folder: Path) -> dict[str, Any]:
    """Exit code, and the leaves of the JSON of a command."""
    done = running.run(*(x.format(folder=folder) for x in arguments), '--json')
    found = json.loads(done.stdout) if done.stdout.strip() else None
    if arguments[:2] == ('bag', 'info'):  # how often the time is told depends on the machine
        told = [t for t in found['topics'] if t['name'].endswith(_TIMED_TOPICS)]
        found['messages'] -= sum(t['count'] for t in told)
        found['topics'] = [t for t in found['topics'] if t not in told]
    return {'code': done.returncode, 'leaves': leaves(found)}


def topic_entries(bag: Path) -> dict[str, Any]:
    """Type, number of messages and leaves of the first message, by topic of a bag."""
    found: dict[str, Any] = {}
    with bag.open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, _, message in reader.iter_decoded_messages():
            entry = found.setdefault(
                channel.topic, {'type': schema.name, 'count': 0, 'first': leaves(plain(message))}
            )
            entry['count'] += 1
    for topic, entry in found.items():
        if topic.endswith(_TIMED_TOPICS):
            entry.update(count=None, first=sorted(entry['first']))
    return found


def plain(message: Any) -> Any:
    """A decoded message as dictionaries, lists, numbers and text."""
    if isinstance(message, bytes):
        return message.hex()
    if isinstance(message, list | tuple | np.ndarray):
        return [plain(x) for x in message]
    slots = getattr(message, '__slots__', None)
    return {s: plain(getattr(message, s)) for s in slots} if slots else message


def leaves(value: Any) -> dict[str, Any]:
    """Leaves by path: of all items of lists together, numbers as count, sum and largest size.

    Text is kept where it is one short word, such as a name or a unit.
    """
    numbers: dict[str, list[float]] = {}
    texts: dict[str, Any] = {}
    for path, leaf in _walk(value, ''):
        if any(word in path for word in _BY_THE_CLOCK):
            texts[path] = 'by the clock'
        elif path.endswith('coefficients[]'):  # high powers of short pieces hold rounding
            texts[path] = 'in the digest'
        elif isinstance(leaf, int | float) and not isinstance(leaf, bool):
            numbers.setdefault(path, []).append(float(leaf))
        else:
            short = not isinstance(leaf, str) or (len(leaf) <= 40 and '/' not in leaf)
            texts.setdefault(path, leaf if short else 'text')
    return {
        **texts,
        **{
            path: [len(x), math.fsum(x), max(map(abs, x))]
            for path, x in numbers.items()
            if np.isfinite(x).all()
        },
    }


def _walk(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _walk(item, f'{path}.{key}'.lstrip('.'))
    elif isinstance(value, list):
        yield f'{path}#', float(len(value))
        for item in value:
            yield from _walk(item, f'{path}[]')
    else:
        yield path, value


def differences(name: str, old: Any, new: Any, same_bits: bool) -> list[str]:
    """Sentences, one for each thing in which an entry differs from its record."""
    if isinstance(old, dict) and isinstance(new, dict):
        found = [f'{name}.{key}: {"lost" if key in old else "new"}' for key in old ^ new.keys()]
        for key in old.keys() & new.keys():
            # the time is when rounding was largest, where an energy balance closes
            if same_bits or not key.endswith('largest_residual_time'):
                found += differences(f'{name}.{key}', old[key], new[key], same_bits)
        return sorted(found)
    if all(isinstance(x, list) and x and _numbers(x) for x in (old, new)):
        a, b = np.array(old, float), np.array(new, float)
        size = max(np.abs(a).max(), 1e-12)
        if a.shape == b.shape and (np.abs(a - b) <= TOLERANCE * size).all():
            return []
    elif isinstance(old, float) and isinstance(new, int | float):
        if abs(old - new) <= TOLERANCE * max(abs(old), 1e-12):
            return []
    elif old == new:
        return []
    return [f'{name}: {_shown(old)} before, {_shown(new)} now']


def compare(part: str, name: str, old: Any, new: Any, same_bits: bool) -> list[str]:
    """As `differences`; of what impacts made other on another processor, keys only."""
    words = {*name.split()}
    if part == 'scenes':
        here = old['bits'].keys() & new['bits'].keys()
        same_bits = bool(here)
        old, new = ({**x, 'bits': {k: x['bits'][k] for k in here}} for x in (old, new))
    chaotic = (
        any({*x.split()} <= words for x in CHAOTIC)
        if part == 'commands'
        else (old.get('impacts', 0))
    )
    if same_bits or not chaotic:
        return differences(name, old, new, same_bits)
    keys = ('leaves',) if part == 'commands' else ()
    return differences(name, _outline(old, keys), _outline(new, keys), same_bits)


def _outline(entry: dict[str, Any], keys: tuple[str, ...]) -> dict[str, Any]:
    return {key: sorted(entry[key]) if key in keys else '' for key in entry}


def merged(old: dict[str, Any], new: dict[str, Any]) -> dict[str, Any]:
    """A scene's new entry, with the bits of other environments where its own are as they were."""
    known = all(old['bits'].get(k, x) == x for k, x in new['bits'].items())
    return {**new, 'bits': (old['bits'] if known else {}) | new['bits']}


def _numbers(values: list[Any]) -> bool:
    return all(isinstance(x, int | float) for x in values)


def _shown(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 90 else f'{text[:90]}...'


def load() -> dict[str, Any]:
    """The committed record."""
    record: dict[str, Any] = json.loads(RECORD.read_text(encoding='utf-8'))
    return record


def same_bits(record: dict[str, Any]) -> bool:
    """Tell if figures behind many impacts can be compared with those of the record."""
    return bool(record['environment'] == environment())


def make_scenes(names: Iterable[str], record: dict[str, Any] | None) -> dict[str, Any]:
    """Scenes anew; durations are those of a record if there is one."""
    known = record['scenes'] if record else {}
    scenes = {}
    for name in names:
        print(name, file=sys.stderr)
        scenes[name] = scene_entry(name, known.get(name, {}).get('duration'))
    return scenes


def make(record: dict[str, Any] | None) -> dict[str, Any]:
    """Everything anew."""
    scenes = make_scenes(scene_names(), record)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        record_bags(folder)
        commands = {
            ' '.join(line): command_entry(line, folder)
            for lines in COMMANDS.values()
            for line in lines
        }
        topics = {s: topic_entries(folder / f'{s}.mcap') for s in (IDEAL, LOOSE, FREE)}
    return {
        'environment': environment(),
        'scenes': scenes,
        'commands': commands,
        'topics': topics,
    }


def _main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('scenes', nargs='*', metavar='SCENE', help='these alone')
    parser.add_argument('--write', action='store_true', help='make the record anew')
    options = parser.parse_args()
    write, names = options.write, options.scenes
    old = load() if RECORD.exists() else None
    if names and old:
        fresh = make_scenes(names, None if write else old)
        new = {**old, 'scenes': {**old['scenes'], **fresh}}
    else:
        new = make(None if write else old)
    said: list[str] = []
    if old:
        same = same_bits(old)
        for part in ('scenes', 'commands', 'topics'):
            gone = old[part].keys() ^ new[part].keys()
            said += [f'{part}: {name} is in one record only' for name in sorted(gone)]
            for name in sorted(old[part].keys() & new[part].keys()):
                said += compare(part, name, old[part][name], new[part][name], same)
    print('\n'.join(said) or 'nothing differs')
    if old and not write and not any(own() in x['bits'] for x in old['scenes'].values()):
        print(
            'no bits of this processor are recorded, none was compared: before any change, '
            'python test/net.py --write'
        )
    if said and not write:
        print('if this is the purpose: python test/net.py --write')
    if write:
        for name, entry in (old['scenes'] if old else {}).items():
            if name in new['scenes']:
                new['scenes'][name] = merged(entry, new['scenes'][name])
        RECORD.write_text(json.dumps(new, indent=1, sort_keys=True) + '\n', encoding='utf-8')
    return 1 if said and not write else 0


if __name__ == '__main__':
    sys.exit(_main())
