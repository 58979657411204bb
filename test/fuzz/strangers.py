"""Strangers on the network of a run: what they send, and what becomes of the run.

``python test/fuzz/strangers.py --messages 100000 --seed 1`` sends that much to a run of real
nodes, on all keys it has: on topics, services and actions random bytes, real messages with bytes
changed, cut off, added or made NaN, attachments and stamps of all kinds, and liveliness tokens.
The run must not notice: it ends with 0, with the motion of an undisturbed one. What is a message
by every rule is held back, unless ``--well-formed`` is given; then runs may end early, but with a
sentence.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import zenoh
from rosbags.serde import SerdeError

sys.path.insert(0, str(Path(__file__).parents[1]))
from running import command, environment

import mechanism_sim as ms
from mechanism_sim import process_exit
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.messages import (
    DriveLaw,
    MessageError,
    ParameterValue,
    Progress,
    deserialize,
    message_class,
    serialize,
    service_class,
    type_name,
)
from mechanism_sim.messages import Parameter as ParameterMessage
from ros_interfaces.definitions import typestore

SCENE = 'four_bar_clearance'
PATIENCE = 300.0  # [s]
PLAYING, QUITTING = 1, 3
READING = 'get_', 'list_', 'describe_'
TOKEN = re.compile(r'@ros2_lv/\d+(/[^/]+){3}/(NN|MP|MS|SS|SC)/[^/]+/[^/]+/([^/]+).*')
NUMBERS = (
    *(struct.pack('<d', x) for x in (math.nan, math.inf, -math.inf, 1e300, -1e-300)),
    b'\xff' * 4, b'\x00\x00\x00\x80', b'\xff\xff\xff\x7f', b'\x00' * 8,
)  # fmt: skip


def all_numbers_good(value: Any, own: bool, field: str = '', unknown: bool = False) -> bool:
    """True if all stamps are times, and numbers of this package those of a machine."""
    if isinstance(value, float):
        return not own or abs(value) <= 1e60 or (unknown and math.isnan(value))
    if isinstance(value, np.ndarray):
        most = sys.float_info.max if field == 'coefficients' else 1e60
        return not own or value.dtype.kind != 'f' or bool(np.all(np.abs(value) <= most))
    if isinstance(value, list):
        return all(all_numbers_good(x, own) for x in value)
    if not hasattr(value, '__msgtype__'):
        return True
    if value.__msgtype__ == 'builtin_interfaces/msg/Time':
        return bool(value.sec >= 0 and value.nanosec < 10**9)
    unknown = value.__msgtype__.endswith(('CamState', 'GearState', 'GenevaState'))
    names = [n for n in value.__dataclass_fields__ if n != '__msgtype__']
    return all(all_numbers_good(getattr(value, n), own, n, unknown) for n in names)


def is_message(data: bytes, kind: str) -> bool:
    """True if bytes are a good message, by rosbags and the rule above."""
    if data[:2] != b'\x00\x01':
        return False
    message_class(kind)  # before rosbags takes its own
    try:
        message = typestore().deserialize_cdr(data, kind)
    except (SerdeError, ValueError):
        return False
    return all_numbers_good(message, kind.startswith('mechanism_sim/'))


def damaged(dice: random.Random, data: bytes) -> bytes:
    """Bytes flipped, cut off, added or replaced by what numbers and lengths should not be."""
    found = bytearray(data)
    for _ in range(dice.choice((1, 1, 1, 2, 5))):
        what, at = dice.randrange(6), dice.randrange(len(found) + 1)
        if what == 0 and at < len(found):
            found[at] ^= 1 << dice.randrange(8)
        elif what == 1:
            del found[at:]
        elif what == 2:
            found += dice.randbytes(dice.choice((1, 4, 8, 100)))
        elif what == 3:
            found[at : at + 8] = dice.randbytes(len(found[at : at + 8]))
        elif what == 4:
            number = dice.choice(NUMBERS)
            at -= at % len(number) - 4
            found[at : at + len(number)] = number
        else:
            found[:4] = dice.choice((b'\x00\x00\x00\x00', b'\x00\x03\x00\x00', b'\xff' * 4, b''))
    return bytes(found)


def twisted(dice: random.Random, data: bytes, kind: str) -> bytes:
    """A message with other values in some fields, of their types."""
    message = deserialize(data, kind)
    names = list(message_class(kind).__dataclass_fields__)
    for name in dice.choices(names, k=dice.choice((1, 1, 2, 4))):
        value: Any = getattr(message, name)
        if isinstance(value, float):
            value = dice.choice((0.0, -1.0, 1e59, -1e59, 1e-300, 2.0 * value, value + 0.1))
        elif isinstance(value, bool):
            value = not value
        elif isinstance(value, int):
            value = dice.choice((0, 1, 2, 3, 255, value + 1, abs(value - 1), 2**31))
        elif isinstance(value, str):
            value = dice.choice(('', 'crank', 'linkage', 'crank_drive', 'coupler_rocker', '\0é'))
        elif isinstance(value, np.ndarray) and len(value):
            whole = value.dtype.kind in 'iu'
            factor = dice.choice((0, 1, 2)) if whole else 10.0 ** dice.randrange(-50, 50)
            value = dice.choice((value[::-1], value[:-1], np.roll(value, 1), value * factor))
        elif isinstance(value, list):
            value = dice.choice((value[::-1], value[:-1], value * 2))
        setattr(message, name, value)
    try:
        return serialize(message)
    except (MessageError, struct.error, OverflowError):
        return data


class Stranger:
    """Somebody with a session on the network of a run.

    Attributes
    ----------
    sent : how much of what
    slowest : [s] that a node took to answer a question
    """

    def __init__(self, env: dict[str, str], seed: int, well_formed: bool = False) -> None:
        self.dice, self.well_formed = random.Random(seed), well_formed
        self.sent: Counter[str] = Counter()
        self.slowest, self.playing = 0.0, True
        self.domain = env['ROS_DOMAIN_ID']
        config = zenoh.Config()
        config.insert_json5('mode', '"client"')
        config.insert_json5('connect/endpoints', json.dumps([env['MECHANISM_SIM_ROUTER']]))
        config.insert_json5('connect/timeout_ms', '-1')
        config.insert_json5('connect/retry', '{period_init_ms: 50, period_max_ms: 100}')
        config.insert_json5('scouting/multicast/enabled', 'false')
        config.insert_json5('timestamping/enabled', 'true')
        self.session = zenoh.open(config)
        self.tokens: dict[str, None] = {}
        self.heard: dict[str, deque[tuple[bytes, bytes]]] = {}
        self.alive: deque[zenoh.LivelinessToken] = deque()
        self._listening = [
            self.session.liveliness().declare_subscriber(
                f'@ros2_lv/{self.domain}/**', self._on_token, history=True
            ),
            self.session.declare_subscriber(f'{self.domain}/**', self._on_sample),
        ]

    def _on_token(self, sample: zenoh.Sample) -> None:
        self.tokens[str(sample.key_expr)] = None

    def _on_sample(self, sample: zenoh.Sample) -> None:
        if sample.attachment is not None:
            kept = self.heard.setdefault(str(sample.key_expr), deque(maxlen=20))
            kept.append((sample.payload.to_bytes(), sample.attachment.to_bytes()))

    def learn(self, going: Callable[[], bool]) -> None:
        """Listen until the run goes on, then take note of all of its keys; for ever deaf."""
        end = time.monotonic() + PATIENCE
        while not any('/progress/' in key for key in self.heard):
            assert going()
            assert time.monotonic() < end
            time.sleep(0.01)
        time.sleep(0.3)
        for subscriber in self._listening:
            subscriber.undeclare()
        self.real = list(self.tokens)
        self.nodes = {key.split('/')[8] for key in self.real}
        self.topics: dict[str, str] = {}
        self.services: dict[str, str] = {}
        for key in self.real:
            fields = key.split('/')
            if fields[5] == 'NN':
                continue
            name = fields[9].lstrip('%').replace('%', '/')
            package, kind, _, short = fields[10].split('::')
            known = self.topics if fields[5] in {'MP', 'MS'} else self.services
            where = f'{self.domain}/{name}/{fields[10]}/{fields[11]}'
            known[where] = f'{package}/{kind}/{short.removesuffix("_")}'

    def go(self, messages: int, going: Callable[[], bool], each: Callable[[], Any]) -> None:
        """Send so much, as long as the run goes on; `each` is called now and then."""
        ways = [self._put] * 6 + [self._ask] * 2 + [self._announce]
        ways += [self._wild, self._go_astray]
        while (sent := self.sent.total() - self.sent['held back']) < messages:
            self.dice.choice(ways)()
            if sent % 500 == 499:
                each()
                if not going():
                    return

    def _attachment(self, real: bytes | None = None) -> bytes | None:
        """An attachment of some kind; seldom a good one."""
        dice = self.dice
        gid = real[17:] if real and dice.random() < 0.7 else dice.randbytes(16)
        sequence = dice.choice((1, 2**62, 2**63 - 1, 0, -1, -(2**63), dice.randrange(10**6)))
        stamp = dice.choice((0, time.time_ns(), -1, 2**63 - 1, -(2**63)))
        good = struct.pack('<qqB16s', sequence, stamp, 16, gid)
        bad = (
            None,
            b'',
            good[:-1],
            good + b'\0',
            good[:16] + b'\x0f' + good[17:],
            dice.randbytes(33),
        )
        return dice.choice((good, *bad)) if dice.random() < 0.7 else good

    def _bytes(self, base: bytes) -> bytes:
        what = self.dice.random()
        if what < 0.2:
            return self.dice.randbytes(self.dice.choice((0, 1, 3, 4, 7, 20, 100, 1000)))
        if what < 0.202:
            return b'\0\1\0\0' + self.dice.randbytes(1_000_000)
        return damaged(self.dice, base) if what < 0.95 else base

    def _put(self) -> None:
        key = self.dice.choice(sorted(self.topics))
        kind = self.topics[key]
        samples = self.heard.get(key) or [(serialize(message_class(kind)()), b'')]
        base, real = self.dice.choice(list(samples))
        data, attachment = self._bytes(base), self._attachment(real)
        if self.well_formed and self.dice.random() < 0.5:
            data = twisted(self.dice, base, kind)
        good = attachment is not None and len(attachment) == 33 and attachment[16] == 16
        if good and is_message(data, kind) and not self.well_formed:
            # The same once more is no news; of what is kept for late joiners that is not known.
            if not real or '/scene/' in key or data != base or self.dice.random() < 0.5:
                self.sent['held back'] += 1
                return
            attachment = real
        self._send(key, data, attachment)

    def _send(self, key: str, data: bytes, attachment: bytes | None) -> None:
        dice, stamp = self.dice, None
        if dice.random() < 0.1:
            moment = dice.choice((0, 1, 2**31, 2**32 - 1, dice.randrange(2**32)))
            stamp = zenoh.Timestamp(zenoh.NTP64(moment, 0), b'\1' + dice.randbytes(7))
        if dice.random() < 0.01:
            self.session.delete(key, attachment=attachment, timestamp=stamp)
        self.session.put(
            key, data, attachment=attachment, timestamp=stamp,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )  # fmt: skip
        self.sent['messages'] += 1

    def _wild(self) -> None:
        """On many keys at once, and on keys nobody has."""
        key = self.dice.choice((
            f'{self.domain}/**', f'{self.domain}/progress/**', f'{self.domain}/*/x',
            f'@mechanism_sim/{self.domain}/x', f'{self.domain}/progress/x/y',
        ))  # fmt: skip
        self._send(key, self._bytes(b'\0\1\0\0' + bytes(60)), b'no attachment of ROS')

    def _go_astray(self) -> None:
        """A good message that is none of the run's business."""
        dice, run = self.dice, self.dice.choice((2, 7, 2**32 - 1))
        message = dice.choice((
            Progress(node='nobody', topics=['/motion', '/impacts'], counts=[10**6, 10**9],
                     finished=True, again=True, time=1e9),
            Progress(node='linkage', run=run, finished=True, again=True, time=1e9),
            DriveLaw(run=run, coordinate='crank', kind=1, law_id=77, valid_until=1e9,
                     coefficients=[0.0, 1.0]),
        ))  # fmt: skip
        name = type_name(type(message)).replace('/msg/', '::msg::dds_::') + '_'
        key = next(key for key in sorted(self.topics) if f'/{name}/' in key)
        self._send(key, serialize(message), struct.pack('<qqB16s', 1, 0, 16, dice.randbytes(16)))

    def _ask(self) -> None:
        key = self.dice.choice(sorted(self.services))
        kind = f'{self.services[key]}_Request'
        base = serialize(self._request(self.services[key]))
        data, attachment = self._bytes(base), self._attachment()
        good = attachment is not None and len(attachment) == 33 and attachment[16] == 16
        name = key.split('/')[-3]
        harmless = name.startswith(READING) or data == base
        if good and is_message(data, kind) and not harmless and not self.well_formed:
            self.sent['held back'] += 1
            return
        payload = None if self.dice.random() < 0.05 else data
        where = key
        if self.dice.random() < 0.002:  # of all services; for one of them it may be good
            where, attachment = f'{self.domain}/**', b'no attachment of ROS'
        self.session.get(
            where, lambda _: None, payload=payload, attachment=attachment, timeout=10.0,
            target=zenoh.QueryTarget.ALL, consolidation=zenoh.ConsolidationMode.NONE,
        )  # fmt: skip
        self.sent['requests'] += 1

    def _request(self, kind: str) -> Any:
        """A request that changes nothing, though it may ask for it."""
        request = service_class(kind).Request()
        dice, short = self.dice, kind.rpartition('/')[2]
        if short in {'SetParameters', 'SetParametersAtomically'}:
            value = ParameterValue(type=dice.choice((3, 77, 255)), double_value=math.nan)
            path = 'joints.coupler_rocker.clearance.restitution'
            name = dice.choice(('', 'none', path, 'lead', 'realtime_factor', 'scene', '\u202e\0'))
            request.parameters = [ParameterMessage(name=name, value=value)] * dice.choice((1, 3))
        elif short == 'SetSimulationState':
            request.state.state = dice.choice((4, 77, 255))
        elif short == 'StepSimulation':
            request.steps = 2**64 - 1
        elif short == 'ResetSimulation':
            request.scope = 1
        elif short == 'SimulateSteps_SendGoal':
            request.goal.steps = 2**64 - 1
        return request

    def _announce(self) -> None:
        """A token, for a while."""
        dice, real = self.dice, self.dice.choice(self.real)
        if dice.random() < 0.3:
            alphabet = 'abcXYZ019%:,_-. /@~'
            text = ''.join(dice.choices(alphabet, k=dice.randrange(1, 60)))
            key = f'@ros2_lv/{self.domain}/{text}'
        else:
            letters = list(real)
            for _ in range(dice.choice((1, 1, 2, 5))):
                at = dice.randrange(len(f'@ros2_lv/{self.domain}/'), len(letters))
                letters[at : at + dice.choice((0, 1, 1, 3))] = dice.choice(
                    ('9' * 30, '-1', ':', ',', '%', '/', 'x', '', '%%', 'RIHS01_0', '\u0663', ' ')
                )
            key = ''.join(letters)
        known = TOKEN.fullmatch(key)
        ours = known is not None and known[3] in self.nodes
        if key in self.tokens or (ours and not self.well_formed):
            self.sent['held back'] += 1
            return
        try:
            self.alive.append(self.session.liveliness().declare_token(key))
        except (zenoh.ZError, ValueError):
            return  # no key
        self.sent['tokens'] += 1
        while len(self.alive) > 100:
            self.alive.popleft().undeclare()

    def asks(self, name: str, kind: str, **fields: Any) -> bool:
        """True if a service answers; the time that takes is recorded."""
        where = next(key for key in self.services if key.startswith(f'{self.domain}/{name}/'))
        began = time.monotonic()
        attachment = struct.pack('<qqB16s', 1, time.time_ns(), 16, bytes(16))
        request = serialize(service_class(kind).Request(**fields))
        answers = self.session.get(
            where, payload=request, attachment=attachment, timeout=PATIENCE,
            target=zenoh.QueryTarget.ALL,
        )  # fmt: skip
        answers = list(answers)
        found = [answer.ok.payload.to_bytes() for answer in answers if answer.ok is not None]
        if not found:
            print(name, [answer.err.payload.to_bytes() for answer in answers])
        if found and name == 'get_simulation_state':
            response = service_class(kind).Response
            self.playing = deserialize(found[0], response).state.state == PLAYING
        self.slowest = max(self.slowest, time.monotonic() - began)
        return bool(found)

    def state(self) -> bool:
        """True if the drive reports its state."""
        kind = 'simulation_interfaces/srv/GetSimulationState'
        return self.asks('get_simulation_state', kind)

    def finish(self, going: Callable[[], bool]) -> None:
        """Let the run go on as fast as it can; it is held at its end: have it quit there."""
        kind = 'rcl_interfaces/srv/SetParameters'
        fast = ParameterMessage(name='realtime_factor', value=ParameterValue(type=3))
        assert self.asks('crank_drive/set_parameters', kind, parameters=[fast])
        while self.state() and self.playing:
            assert going()
            time.sleep(0.05)
        state = message_class('simulation_interfaces/msg/SimulationState')(state=QUITTING)
        name = 'simulation_interfaces/srv/SetSimulationState'
        assert self.asks('set_simulation_state', name, state=state)


class Watched:
    """A run in processes of its own: what it says, and the most memory of each."""

    def __init__(self, folder: Path, args: list[str]) -> None:
        self.env, self.bag = environment(), folder / 'run.mcap'
        self._said = (folder / 'stderr').open('w+')
        self.process = subprocess.Popen(
            command('run', SCENE, '--record', str(self.bag), '--overwrite', *args),
            env=process_exit.owned(self.env), stdout=subprocess.DEVNULL, stderr=self._said,
        )  # fmt: skip
        self.memory = 0.0  # [MB]

    def going(self) -> bool:
        """True while it has not ended."""
        return self.process.poll() is None

    def look(self) -> None:
        """Record the memory of each of its processes."""
        pids = [self.process.pid]
        for pid in pids:
            try:
                children = Path(f'/proc/{pid}/task/{pid}/children').read_text().split()
                status = Path(f'/proc/{pid}/status').read_text()
            except OSError:
                continue
            pids += map(int, children)
            if found := re.search(r'VmHWM:\s+(\d+)', status):
                self.memory = max(self.memory, int(found[1]) / 1e3)

    def ended(self, patience: float = PATIENCE) -> int:
        """Its exit code; interrupted if it does not end by itself."""
        try:
            return self.process.wait(patience)
        except subprocess.TimeoutExpired:
            self.process.send_signal(signal.SIGINT)
            return self.process.wait(patience)

    def stderr(self) -> str:
        """All it said."""
        self._said.seek(0)
        return self._said.read()


@contextmanager
def watched(folder: Path, *args: str) -> Iterator[Watched]:
    """A run that ends with this, whatever happens."""
    run = Watched(folder, list(args))
    try:
        yield run
    finally:
        if run.going():
            run.process.terminate()  # it has children, who end with it
            run.process.wait(PATIENCE)


def digest_of(duration: float) -> str:
    """The motion of an undisturbed run."""
    solution = ms.simulate(ms.load_scene(SCENE), duration=duration)
    digest = MotionDigest()
    digest.add(solution.motion, solution.impacts)
    return digest.hexdigest()


def disturb(
    folder: Path, messages: int, seed: int, duration: float, *args: str
) -> tuple[Watched, Stranger, int]:
    """A run that strangers speak to until they have sent so much; ended, and its exit code."""
    with watched(folder, '--duration', str(duration), '--hold', *args) as run:
        stranger = Stranger(run.env, seed)
        stranger.learn(run.going)

        def each() -> None:
            run.look()
            assert stranger.state(), f'{run.process.poll()}: {run.stderr()[-3000:]}'

        stranger.go(messages, run.going, each)
        stranger.finish(run.going)
        code = run.ended()
        run.look()
        stranger.session.close()
    return run, stranger, code


def well_formed(folder: Path, messages: int, seed: int) -> list[tuple[int, str]]:
    """Runs that strangers speak to who know the rules: exit codes, and the last that was said."""
    found, sent = [], 0
    while sent < messages:
        with watched(folder, '--duration', '100', '--processes') as run:
            stranger = Stranger(run.env, seed + len(found), well_formed=True)
            stranger.learn(run.going)
            stranger.go(min(messages - sent, 5000), run.going, run.look)
            sent += sum(stranger.sent.values())
            if run.going():
                run.process.send_signal(signal.SIGINT)
            code = run.ended()
            stranger.session.close()
        said = run.stderr()
        found.append((code, said))
        lines = [line for line in said.splitlines() if not line.startswith('[')]
        print(f'ended with {code}, {run.memory:.0f} MB, {dict(stranger.sent)}: {lines[-3:]}')
        if 'Traceback' in said or code not in {0, 1, 130}:
            Path(tempfile.gettempdir(), f'strangers-{seed}-{len(found)}').write_text(said)
    return found


def main() -> None:
    """Disturb a run, and print how it bore that."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--messages', type=int, default=100_000)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--duration', type=float, default=5.0)
    parser.add_argument('--pace', type=float, default=0.05, help='real-time factor')
    parser.add_argument('--well-formed', action='store_true')
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if given.well_formed:
            ends = well_formed(folder, given.messages, given.seed)
            bad = [code for code, said in ends if code not in {0, 1, 130} or 'Traceback' in said]
            sys.exit(f'{len(bad)} of {len(ends)} runs ended badly' if bad else 0)
        began = time.monotonic()
        pace = '--realtime-factor', str(given.pace)
        args = given.duration, '--processes', *pace
        run, stranger, code = disturb(folder, given.messages, given.seed, *args)
        said = run.stderr()
        same = analyze(run.bag).digest == digest_of(given.duration)
        bad = code or not same or 'Traceback' in said or run.memory > 500.0
        if bad:
            kept = Path(tempfile.gettempdir(), f'strangers-{given.seed}')
            shutil.copy(run.bag, kept.with_suffix('.mcap'))
            kept.write_text(said)
        found = {
            'code': code,
            'sent': dict(stranger.sent),
            'seconds': time.monotonic() - began,
            'same motion': same,
            'traceback': 'Traceback' in said,
            'warnings': said.count('[WARN]'),
            'slowest answer [s]': stranger.slowest,
            'memory [MB]': run.memory,
        }
    print(json.dumps(found, indent=2))
    sys.exit(bool(bad))


if __name__ == '__main__':
    main()
