"""Kills processes of runs, sweeps and views at random moments, and looks at what is left.

``python test/fuzz/kills.py --kills 100 --seed 0`` prints a line for each kill and figures at the
end; its exit code says whether all was as promised: no process after two seconds, exit codes, no
traceback, every bag readable (by mcap's own reader once recovered), half a second lost at most.
What is lost is simulated time, and how soon all are gone is CPU time too: a busy machine needs no
more of them.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import struct
import subprocess
import sys
import tempfile
import time
import uuid
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Thread

import zenoh
from mcap.reader import make_reader

sys.path.insert(0, str(Path(__file__).parents[1]))
from running import command, environment

from mechanism_sim.recording.inventory import recover
from mechanism_sim.recording.reader import read_bag

SCENE = 'four_bar_clearance'
NODES = 'recorder', 'linkage', 'crank_drive', 'sensors'
GONE, LOST = 2.0, 0.5  # [s] until no process is left; of recording that may be lost
GONE_BY_CLOCK = GONE
PATIENCE = 300.0  # [s] until processes that are left count as left behind
STATES_HEARD = 50  # before a run that records is killed
TICK = 1.0 / os.sysconf('SC_CLK_TCK')  # [s]
STATES = 'joint_states'
MARK = 'KILLED_TOGETHER'

SWEEP = f"""
scene: {SCENE}
revolutions: 20
bags: true
grid: {{drive.start_angle: [{', '.join(f'{k} deg' for k in range(200))}]}}
"""


@dataclass
class Kill:
    """One kill, what came of it, and what was not as promised."""

    command: str
    victim: str
    number: int
    moment: float  # [s] after the victim's start
    early: bool = False  # the interpreter had not come to the first line of the package
    hit: bool = False  # the victim was still there
    code: int | None = None
    gone: float = 0.0  # [s] until no process was left
    spent: float = 0.0  # [s] of CPU until then, by the process that needed the most
    lost: float | None = None  # [s] of recording, simulated
    bags: int = 0
    cut: int = 0
    said: str = ''
    wrong: list[str] = field(default_factory=list)


class Witness:
    """Hears the published states, as a program that has nothing of this package."""

    def __init__(self, env: dict[str, str]) -> None:
        self.heard: list[tuple[float, int]] = []  # wall time [s], simulated time [ns]
        self._env = env
        Thread(target=self._join, daemon=True).start()

    def _join(self) -> None:
        config = zenoh.Config()
        config.insert_json5('mode', '"client"')
        config.insert_json5('scouting/multicast/enabled', 'false')
        config.insert_json5('connect/endpoints', f'["{self._env["MECHANISM_SIM_ROUTER"]}"]')
        config.insert_json5('connect/timeout_ms', '60000')
        try:
            session = zenoh.open(config)
        except zenoh.ZError:
            return  # there never was a network
        self.session = session
        session.declare_subscriber(f'{self._env["ROS_DOMAIN_ID"]}/{STATES}/**', self._hear)

    def _hear(self, sample: zenoh.Sample) -> None:
        seconds, nanoseconds = struct.unpack_from('<iI', sample.payload.to_bytes(), 4)
        self.heard.append((time.monotonic(), seconds * 10**9 + nanoseconds))

    def lost(self, bag: Path, killed: float) -> float | None:
        """[s] from the first state that is not in the bag to the last before the kill, simulated.

        None if nothing came in the last second: nothing was recorded, or this joined late.
        """
        came = [t for wall, t in self.heard if wall < killed]
        if not came or self.heard[len(came) - 1][0] < killed - 1.0:
            return None
        there = set()
        if bag.exists() and f'/{STATES}' in read_bag(bag).topics:
            there = {t for _, _, t in read_bag(bag).raw(f'/{STATES}')}
        missing = [t for t in came if t not in there]
        return (max(came) - min(missing)) / 1e9 if missing else 0.0


def alive(mark: str) -> dict[int, list[str]]:
    """Processes with a mark in their environment, and their command lines."""
    found = {}
    for file in Path('/proc').glob('[0-9]*/environ'):
        try:
            if f'{MARK}={mark}'.encode() not in file.read_bytes():
                continue
            state = (file.parent / 'stat').read_text('utf-8').rpartition(')')[2].split()[0]
            words = (file.parent / 'cmdline').read_text('utf-8').split('\0')
        except OSError:  # ended meanwhile
            continue
        if state != 'Z':
            found[int(file.parent.name)] = words
    return found


def cpu_time(pid: int) -> float:
    """CPU time of a process until now [s]; 0 if it has ended."""
    try:
        fields = Path(f'/proc/{pid}/stat').read_text('utf-8').rpartition(')')[2].split()
    except OSError:
        return 0.0
    return TICK * (int(fields[11]) + int(fields[12]))


def find(mark: str, head: subprocess.Popen[str], victim: str) -> int | None:
    """Process id of the victim, None as long as there is none."""
    if victim == 'head':
        return head.pid
    for pid, words in alive(mark).items():
        child = '--multiprocessing-fork' in words or words[3:4] == ['run']
        if pid != head.pid and (child if victim == 'child' else words[3:5] == ['node', victim]):
            return pid
    return None


def takes_signals(pid: int) -> bool:
    """True if a process handles or holds SIGTERM."""
    status = Path(f'/proc/{pid}/status').read_text('utf-8')
    masks = [int(status.split(f'{name}:')[1].split()[0], 16) for name in ('SigCgt', 'SigBlk')]
    return bool((masks[0] | masks[1]) >> (signal.SIGTERM - 1) & 1)


def kill(folder: Path, kind: str, victim: str, number: int, moment: float, length: str) -> Kill:
    """Start a command, kill one of its processes, and look.

    `moment` [s] is that after the start of the process, or after something is recorded if
    `length` is 'recording'; if it is 'short', the run lasts a second and may end before.
    """
    mark = uuid.uuid4().hex
    env = environment() | {MARK: mark}
    found = Kill(kind, victim, number, moment)
    paced = ('--duration', '1' if length == 'short' else '1000', '--realtime-factor', '1')
    bag = folder / 'run.mcap'
    args = {
        'run': ('run', SCENE, '--processes', '--record', str(bag), *paced),
        'sweep': ('sweep', str(folder / 'sweep.yaml'), '-o', str(folder / 's.parquet'),
                  '--workers', '2', '--bags', str(folder / 'bags')),
        'view': ('view', SCENE, '--port', '0', '--json', *paced),
    }[kind]  # fmt: skip
    (folder / 'sweep.yaml').write_text(SWEEP, 'utf-8')
    with (folder / 'err').open('w+', encoding='utf-8') as err:
        head = subprocess.Popen(command(*args), env=env, stdout=subprocess.DEVNULL, stderr=err,
                                text=True)  # fmt: skip
        witness = Witness(env) if kind == 'run' else None
        pid = None
        while pid is None and head.poll() is None:
            pid = find(mark, head, victim)
        while length == 'recording' and not (
            bag.exists() and bag.stat().st_size > 20_000
            and witness and len(witness.heard) >= STATES_HEARD
        ):  # fmt: skip
            assert head.poll() is None
            time.sleep(0.01)
        time.sleep(moment)
        if pid is not None and head.poll() is None and pid in alive(mark):
            found.early = victim == 'head' and not takes_signals(pid)
            with suppress(ProcessLookupError):
                os.kill(pid, number)
                found.hit = True
            killed = time.monotonic()
        if not found.hit:  # it was done before
            head.wait(300)
            killed = time.monotonic()
        before: dict[int, float] = {}
        while (left := alive(mark)) and time.monotonic() < killed + PATIENCE:
            for each in left:
                now = cpu_time(each)
                found.spent = max(found.spent, now - before.setdefault(each, now))
            time.sleep(0.01)
        found.gone = time.monotonic() - killed
        if left:
            found.wrong.append(f'{len(left)} processes are left behind')
        if found.gone > GONE_BY_CLOCK:
            found.wrong.append(f'{found.gone:.2f} s until no process was left')
        if found.spent > GONE:
            found.wrong.append(f'{found.spent:.2f} s of CPU until a process ended')
        for orphan in left:
            with suppress(ProcessLookupError):
                os.kill(orphan, signal.SIGKILL)
        found.code = head.wait()
        err.seek(0)
        found.said = err.read().strip()
    judge(found, length == 'short')
    bags = [bag] if kind == 'run' else sorted((folder / 'bags').glob('*.mcap'))
    if witness and found.hit:
        found.lost = witness.lost(bag, killed)
        if found.lost is not None and found.lost > LOST:
            found.wrong.append(f'{found.lost:.2f} s of recording are lost')
    for each in bags:
        if each.exists():
            read_and_recover(each, found)
    return found


def judge(found: Kill, short: bool) -> None:
    """Exit code and sentence of the command."""
    code, number = found.code, found.number
    if not found.hit:
        right = {0}
    elif found.victim == 'head':
        right = {-9} if number == signal.SIGKILL else {130}
        if found.early:
            right |= {-number, 1}  # Python itself, before the package's first line
        elif number != signal.SIGKILL and found.command == 'view':
            right = {0, 130}  # its usual end; before there is a page 130
    elif found.command == 'sweep':
        right = {1}
    else:
        right = {1} if number == signal.SIGKILL else {130}
        if short:
            right |= {0}  # the node had done its work
    if code not in right:
        found.wrong.append(f'exit code {code}, not {right}')
    if 'Traceback' in found.said and not found.early:
        found.wrong.append('a traceback')
    if code in (1, 130) and not found.said and not found.early:
        found.wrong.append('no sentence')
    if found.hit and code == 1 and found.victim in NODES and f"'{found.victim}'" not in found.said:
        found.wrong.append('the node is not named')


def read_and_recover(bag: Path, found: Kill) -> None:
    """Our reader, recovery, and mcap's reader: all the same, byte by byte."""
    before, first = list(read_bag(bag).raw()), read_bag(bag)
    found.bags += 1
    found.cut += not first.complete
    recover(bag)
    with bag.open('rb') as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        after = [(c.topic, m.data, m.log_time)
                 for _, c, m in reader.iter_messages(log_time_order=False)]  # fmt: skip
    if after != before or summary is None or summary.statistics.message_count != len(before):
        found.wrong.append(f'{bag.name} has other messages once it is recovered')
    if not read_bag(bag).complete:
        found.wrong.append(f'{bag.name} is not complete')


def draw(dice: random.Random, span: float) -> tuple[str, str, int, float, str]:
    """Draw what is killed, how, and when; `span` [s] is what a run of a second takes."""
    kind = dice.choices(('run', 'sweep', 'view'), (70, 15, 15))[0]
    if kind == 'run':
        victim = dice.choices(('head', *NODES), (4, 2, 2, 2, 1))[0]
    else:
        victim = dice.choice(('head', 'child'))
    number = dice.choices((signal.SIGKILL, signal.SIGTERM, signal.SIGINT), (6, 2, 2))[0]
    if kind == 'sweep' and victim == 'child' and number == signal.SIGINT:
        number = signal.SIGTERM  # Ctrl-C is for the sweep
    length = (
        dice.choices(('short', 'long', 'recording'), (3, 3, 4))[0] if kind == 'run' else 'long'
    )
    most = {'short': 1.1 * span, 'long': 1.5 * span, 'recording': 3.0}[length]
    return kind, victim, number, dice.uniform(0.0, most), length


def main(args: list[str] | None = None) -> int:
    """Kill as often as asked; 0 if all was as promised."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n', 1)[0])
    parser.add_argument('--kills', type=int, default=100)
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args(args)
    with tempfile.TemporaryDirectory() as name:
        began = time.monotonic()
        one_second = ('--duration', '1', '--realtime-factor', '1')
        subprocess.run(command('run', SCENE, '--processes', *one_second), env=environment(),
                       check=True, stdout=subprocess.DEVNULL)  # fmt: skip
        span = time.monotonic() - began
        found: list[Kill] = []
        number = 0
        while sum(k.hit for k in found) < options.kills:
            dice = random.Random(f'{options.seed} {number}')
            folder = Path(name) / str(number)
            (folder / 'bags').mkdir(parents=True)
            found.append(one := kill(folder, *draw(dice, span)))
            number += 1
            lost = '-' if one.lost is None else f'{one.lost:.2f} s'
            print(
                f'{one.command:5} {one.victim:13} {signal.Signals(one.number).name:7} '
                f'{one.moment:5.2f} s {"" if one.hit else "(done before) "}'
                f'{"(interpreter starting) " if one.early else ""}code {one.code}, gone '
                f'{one.gone:.2f} s, lost {lost}, bags {one.bags} (cut {one.cut}), '
                f'{one.said!r} {"WRONG: " + "; ".join(one.wrong) if one.wrong else ""}',
                flush=True,
            )
    print(summary(found, span))
    return 1 if any(one.wrong for one in found) else 0


def summary(found: list[Kill], span: float) -> str:
    """The figures."""
    hits = [one for one in found if one.hit]
    losses = [one.lost for one in hits if one.lost is not None]
    by = Counter(f'{one.command} {one.victim}' for one in hits)
    lines = [
        f'{len(hits)} kills, a run of one second taking {span:.1f} s: '
        + ', '.join(f'{n} of {name}' for name, n in sorted(by.items())),
        f'  by {Counter(signal.Signals(one.number).name for one in hits)}',
        f'  {sum(one.early for one in hits)} before the first line of the package',
        f'  no process left after {max(one.gone for one in hits):.2f} s',
        f'  bags: {sum(one.bags for one in hits)}, cut {sum(one.cut for one in hits)}, all read, '
        'recovered and read by mcap',
        f'  lost at most {max(losses, default=0.0):.2f} s of recording',
        f'  {sum(bool(one.wrong) for one in found)} not as promised',
    ]
    return '\n'.join(lines)


if __name__ == '__main__':
    sys.exit(main())
