"""Hostile pages, files and names for the editor and tables.

``python test/fuzz/doors.py --messages 20000 --seed 0`` edits in a folder on a disk of a megabyte,
which is full half of the time (as root; else on the disk there is), and prints figures; its exit
code says whether all was as promised: the server answers, within five seconds and in sentences,
what was saved is there, and nothing outside the folder is touched.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from broken_scenes import TEXTS, broken_file
from running import command
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

HANG = 5.0  # [s] until a page has its answer, or knows that it will come
MEMORY = 500.0  # [MiB] of the server and of who draws, at any time
MARGIN = 1.1
"""Who runs machines takes no more than this multiple of what `solve` of the same document takes in
a new process, where that is more than `MEMORY`: to compile what is large takes what it takes."""
ALONE = 60.0  # [s] for such a `solve`; the editor gives up most of what takes long, too
RUNS = 'editor: run'
KINDS = (
    'drag', 'drop', 'pull', 'draw', 'set', 'remove', 'rename', 'select', 'trace', 'text', 'undo',
    'redo', 'save', 'open',
)  # fmt: skip
FIELDS = (
    'handle', 'x', 'y', 'step', 'near', 'number', 'what', 'from', 'to', 'path', 'text', 'name',
    'point',
)  # fmt: skip
NUMBERS = (
    0, 1, -1, 0.05, 0.1, -0.2, 1e308, -1e308, 1e300, 5e-324, 1e-12, 2**64, -0.0, 10**300, 1e4, 1e5,
)  # fmt: skip
NAMES = (
    'machine', 'mine.yaml', 'mine', 'a' * 252, 'a' * 247 + '.yaml', 'a' * 300, 'a' * 5000,
    'é' * 126, '../out', '../../out.yaml', '/tmp/out_of_the_folder.yaml', '/etc/passwd',
    '.hidden', 'sub/x',
    'none/x.yaml', 'sub', 'sub.yaml', 'pipe.yaml', 'link.yaml', 'loop.yaml', 'a\0b', 'a\nb', '-rf',
    '=1+1', '~', '..', '\udc80', '.', '/', 'x/../../out', 'away/x.yaml', 'two.yaml', 'CON', ' ',
    'a b.yml',
)  # fmt: skip
"""Of files; of some of them there is something in the way."""


def message(dice: random.Random, state: dict) -> object:
    """Something that a page might send, or that none would."""
    handles = [h['key'] for h in state.get('handles', [])] or ['']
    paths = [['links', x] for x in state.get('stage', {}).get('links', [])] or [[]]
    paths += [[*p, k] for p in paths for k in ('mass', 'length', 'points', 'nothing')]
    paths += [['drive', 'speed'], ['title'], ['gravity'], ['joints', 'x'], [], ['links']]

    def anything(depth: int = 0) -> object:
        what = dice.randrange(10)
        if what < 3:
            return dice.choice(NUMBERS)
        if what < 5:
            return dice.choice(TEXTS)[:5000]
        if what == 5:
            return dice.choice((None, True, False, [], {}, ''))
        if what == 6 and depth < 4:
            return [anything(depth + 1) for _ in range(dice.randrange(4))]
        if what == 7 and depth < 4:
            return {dice.choice(FIELDS): anything(depth + 1) for _ in range(dice.randrange(4))}
        return dice.choice((dice.choice(handles), dice.choice(paths), dice.uniform(-0.5, 0.5)))

    def spot() -> object:
        place = dice.choice(NUMBERS) if dice.random() < 0.2 else dice.uniform(-0.5, 0.5)
        on = {'handle': dice.choice(handles)} if dice.random() < 0.5 else {}
        seen = {'number': state.get('number', 0) - dice.randrange(3)}
        return {'x': place, 'y': dice.uniform(-0.5, 0.5), **on, **seen}

    kind = dice.choice(KINDS)
    values = {
        'handle': dice.choice(handles), 'x': dice.uniform(-0.5, 0.5), 'y': dice.uniform(-0.5, 0.5),
        'step': 1e-3, 'near': 7e-3,
        'what': dice.choice(('revolute', 'prismatic', 'link', 'spring', 'cam')),
        'from': spot(), 'to': spot(), 'path': dice.choice(paths), 'point': 'crank.end',
        'text': dice.choice(('0.3 kg', '64 mm', '350 rpm', 'x', 'x: \ud800', *TEXTS))[:5000],
        'name': dice.choice(NAMES),
    }  # fmt: skip
    if kind == 'text':
        values['text'] = broken_file(dice.randrange(1 << 40)).decode(errors='replace')[:100_000]
    if kind == 'open':
        values['name'] = dice.choice(('', 'four_bar_nominal', 'slider_crank', 'none', *NAMES))
    if kind == 'rename':
        values['name'] = dice.choice(('crank', 'new_name', *NAMES, *TEXTS))[:5000]
    for field in FIELDS:
        if dice.random() < 0.12:
            values[field] = anything()
    if dice.random() < 0.05:
        return {'type': anything(), **values}
    return {'type': kind, **values}


@contextmanager
def disk(folder: Path):
    """A folder on a disk of a megabyte; False where none can be mounted."""
    folder.mkdir()
    done = subprocess.run(
        ['mount', '-t', 'tmpfs', '-o', 'size=1m,mode=0755', 'tmpfs', str(folder)],
        check=False, capture_output=True,
    )  # fmt: skip
    try:
        yield done.returncode == 0
    finally:
        if done.returncode == 0:
            subprocess.run(['umount', '-l', str(folder)], check=True)


def obstruct(folder: Path, outside: Path) -> None:
    """Obstruct names by folders, pipes, links in circles and links to elsewhere."""
    (folder / 'sub').mkdir()
    (folder / 'sub.yaml').mkdir()
    os.mkfifo(folder / 'pipe.yaml')
    (folder / 'link.yaml').symlink_to('mine.yaml')
    (folder / 'loop.yaml').symlink_to('loop.yaml')
    (folder / 'away').symlink_to(outside)
    (folder / 'two.yaml').write_text('two: names\n')
    (folder / 'second name').hardlink_to(folder / 'two.yaml')


class Saves:
    """Texts of saved files, by the messages of the editor in the order they came.

    A state may come at any time, of a run that ended as of a process that began anew. The text
    that was saved is therefore that of the first state after the sentence that says so: the
    process that draws sends both, and does nothing in between.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.texts: dict[Path, str] = {}
        self.wrong: list[str] = []
        self._said: Path | None = None

    def hear(self, heard: dict) -> None:
        """A message of the editor; the file that it saved is compared at once."""
        if heard['type'] == 'said' and heard['text'].startswith('saved: '):
            if self._said:
                self.wrong.append(f'no state came after {_short(self._said)} was saved')
            self._said = (self.folder / heard['text'].removeprefix('saved: ')).resolve()
        elif heard['type'] == 'state' and self._said:
            file, self._said = self._said, None
            self.texts[file] = heard['text']
            if heard['changed']:
                self.wrong.append(f'{_short(file)} was saved, and is said to be changed')
            self._compare(file, 'after it was saved')

    def close(self) -> None:
        """Compare all files at the end."""
        if self._said:
            self.wrong.append(f'no state came after {_short(self._said)} was saved')
        for file in self.texts:
            self._compare(file, 'at the end')

    def _compare(self, file: Path, when: str) -> None:
        there, wanted = file.read_bytes() if file.is_file() else b'', self.texts[file].encode()
        if there != wanted or not file.is_file():
            self.wrong.append(
                f'{_short(file)} is not what was saved, {when}: '
                f'{len(there)} bytes {_digest(there)}, not {len(wanted)} bytes {_digest(wanted)}'
            )


def _short(file: Path) -> str:
    return repr(file.name[:50])


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:12]


class Client:
    """A page that sends whatever it likes, and looks at what comes of it.

    Attributes
    ----------
    worst : [s] that it waited longest for an answer, or for the word that it will come
    memory : [MiB] by role, the most that one of its processes has held
    large : of each process that ran and held more, the most it held and documents of late
    log : a file that gets a line for every message, in the order they went and came; beside it, in
        a folder, the documents that were there when something went wrong
    """

    def __init__(
        self, folder: Path, dice: random.Random, hang: float, log: Path | None = None
    ) -> None:
        self.folder, self.dice, self.hang = folder, dice, hang
        self.state: dict = {}
        self.saves = Saves(folder)
        self.counts: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.worst = 0.0
        self.memory: dict[str, float] = {}
        self.large: dict[int, tuple[float, list[str]]] = {}
        self._late: deque[str] = deque(maxlen=4)
        self._log = log.open('w', buffering=1) if log else None
        self._kept = log.with_suffix('.documents') if log else None
        self._errors = folder.parent.with_name('errors')
        self._read = 0  # characters of it that were looked at
        self._messages = self._asked = 0
        with self._errors.open('w') as errors:
            self.process = subprocess.Popen(
                command('edit', 'four_bar_nominal', '--port', '0', '--json'), cwd=folder,
                stdout=subprocess.PIPE, stderr=errors, text=True,
            )  # fmt: skip
        text = ''
        while '}' not in text:
            text += self.process.stdout.readline()
        self.address = json.loads(text)['address']
        self._connect()
        self.answer(patience=20.0 * hang)
        self.worst = 0.0  # it had to start

    def _connect(self) -> None:
        place = self.address.replace('http', 'ws').replace('/?', '/live?')
        self.socket = connect(place, max_size=None).__enter__()  # until the process ends

    def _note(self, way: str, text: str) -> None:
        """A line of the log: when, number, which way, and what, texts by their digests."""
        self._messages += 1
        if self._log is None:
            return
        said = json.loads(text)
        kind, inner, path = '', '', ''
        if isinstance(said, dict):
            kind, inner, path = said.get('type'), said.get('text'), said.get('path')
        if kind != 'said' and isinstance(inner, str):
            inner = _digest(inner.encode('utf-8', 'surrogatepass'))
        line = [round(time.monotonic(), 3), self._messages, way, kind, inner, path, len(text)]
        print(json.dumps(line), file=self._log)

    def answer(self, path: list[str] | None = None, patience: float = 0.0) -> None:
        """Wait for the next state of the document, or for the word that it is computed.

        `path` : that the state has to show as chosen; of others there may be some before it
        """
        begun, working, patience = time.monotonic(), False, patience or self.hang
        while True:
            try:
                text = self.socket.recv(timeout=patience)
            except TimeoutError:
                self.wrong.append(f'no answer after {patience} s')
                return
            self._note('from', text)
            heard = json.loads(text)
            if not working:
                waited = time.monotonic() - begun
                if waited > self.hang:
                    self._note('slow', json.dumps({'type': f'{waited:.1f} s', 'path': path}))
                self.worst = max(self.worst, waited)
            kind = heard['type']
            self.counts[kind] += 1
            self.saves.hear(heard)
            if kind == 'said':
                self._look_at(heard['text'])
            if kind == 'busy':
                working, patience = heard['busy'], 24.0 * self.hang
                begun = time.monotonic()
            if kind == 'state':
                self.state = heard
                if heard['text'] not in self._late:
                    self._late.append(heard['text'])
                if path is None or heard['path'] == path:
                    return

    def catch_up(self) -> None:
        """Wait until all that was asked for is done: for the state of a path of its own."""
        self._asked += 1
        path = ['asked', str(self._asked)]
        self._send({'type': 'select', 'path': path})
        self.answer(path)

    def _send(self, given: object) -> None:
        text = json.dumps(given)
        self._note('to', text)
        self.socket.send(text)

    def _look_at(self, said: str) -> None:
        if not 0 < len(said) < 2000 or 'Traceback' in said:
            self.wrong.append(f'no sentence: {said[:200]}')

    def send(self, given: object) -> None:
        """Send something, and wait until it is done."""
        kind = given.get('type') if isinstance(given, dict) else ''
        try:
            self._send(given)
            if kind == 'save' or self.dice.random() < 0.2:
                self.catch_up()
            elif isinstance(kind, str) and kind not in ('drag', 'pull') and kind in KINDS:
                self.answer()
        except ConnectionClosed:
            self.counts['cut off'] += 1
            self._connect()
            self.catch_up()
        self._look_at_processes()

    def _look_at_processes(self) -> None:
        """Their memory, and what they say to nobody; a document that is too much is kept."""
        for pid in children(self.process.pid):
            size, role = most_held(pid), 'server' if pid == self.process.pid else name_of(pid)
            if size > max(MEMORY, self.memory.get(role, 0.0)):
                self._keep(f'{size:.0f} MiB in process {pid}, {role}')
            if role == RUNS and size > max(MEMORY, self.large.get(pid, (0.0,))[0]):
                self.large[pid] = size, [*self._late]
            self.memory[role] = max(self.memory.get(role, 0.0), size)
        if said := self._said():
            self.wrong.append(said)
            self._keep(said)

    def _said(self) -> str:
        """New text on standard error since the last call."""
        said = self._errors.read_text(errors='replace')[self._read :]
        self._read += len(said)
        return said

    def _keep(self, why: str) -> None:
        if self._kept:
            self._kept.mkdir(exist_ok=True)
            text = ''.join(f'# {x}\n' for x in why.splitlines()) + self.state.get('text', '')
            file = self._kept / f'{self._messages}.yaml'
            file.write_text(text, encoding='utf-8', errors='backslashreplace')

    def close(self) -> None:
        """End the editor, and compare what was saved."""
        if self.process.poll() is not None:
            self.wrong.append(f'the server ended with {self.process.returncode}')
        else:
            with suppress(ConnectionClosed):
                self.catch_up()
        self.process.send_signal(signal.SIGINT)
        try:
            code = self.process.wait(60)
        except subprocess.TimeoutExpired:
            code = 'no'
            self.process.kill()
        said = self._said()
        if code != 0 or 'Traceback' in said or len(said.splitlines()) > 1:
            self.wrong.append(f'exit code {code}: {said}')
        self.saves.close()
        self.wrong += self.saves.wrong


def children(pid: int) -> list[int]:
    """A process, and those that it started."""
    found = [pid]
    with suppress(OSError):
        for task in Path(f'/proc/{pid}/task').iterdir():
            found += map(int, (task / 'children').read_text().split())
    return found


def most_held(pid: int) -> float:
    """Memory of a process at its largest [MiB]."""
    with suppress(OSError):
        found = re.search(r'VmHWM:\s*(\d+)', Path(f'/proc/{pid}/status').read_text())
        return int(found[1]) / 1024.0 if found else 0.0
    return 0.0


def name_of(pid: int) -> str:
    """Name of a process in lists of processes, where one of the editor states its role."""
    with suppress(OSError):
        return Path(f'/proc/{pid}/comm').read_text().strip()
    return ''


def alone(text: str) -> float:
    """[MiB] that `solve` of a document takes at most, in a new process."""
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / 'scene.yaml'
        scene.write_text(text, encoding='utf-8', errors='replace')
        process = subprocess.Popen(
            command('solve', str(scene)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        end, held = time.monotonic() + ALONE, 0.0
        while process.poll() is None:
            held = max(held, most_held(process.pid))
            if time.monotonic() > end:
                process.kill()
            time.sleep(0.02)
    return held


def memory_beyond(client: Client) -> Iterator[str]:
    """Sentences on processes that held more than they may."""
    for role, size in client.memory.items():
        if role != RUNS and size > MEMORY:
            yield f'{size:.0f} MiB in {role}'
    for size, texts in client.large.values():
        needed = max(map(alone, texts))
        said = f'{size:.0f} MiB in {RUNS}, where solve alone takes {needed:.0f}'
        print(said, file=sys.stderr)
        if size > MARGIN * needed:
            yield said


def edit(
    folder: Path, messages: int, seed: int, hang: float = HANG, log: Path | None = None
) -> Client:
    """Send so many messages to an editor in a new folder; what came of it.

    `hang` [s] is longer where the machine is busy with other things.
    """
    dice, outside = random.Random(seed), folder / 'outside'
    outside.mkdir(parents=True)
    (outside / 'mine.yaml').write_text('not: yours\n')
    with disk(folder / 'disk') as small:
        own = folder / 'disk'
        obstruct(own, outside)
        before = {x: x.stat().st_mtime_ns for x in [*outside.iterdir(), *folder.iterdir()]}
        client = Client(own, dice, hang, log)
        try:
            for k in range(messages):
                if small and k % 500 == 250:
                    with suppress(OSError):
                        (own / 'fill').write_bytes(bytes(2_000_000))
                elif k % 500 == 0:
                    (own / 'fill').unlink(missing_ok=True)
                client.send(message(dice, client.state))
                if k % 1000 == 999:
                    wrong = [*client.wrong, *client.saves.wrong][-3:]
                    print(k + 1, dict(client.counts), wrong, file=sys.stderr)
        except KeyboardInterrupt:  # what was found so far is told
            client.wrong.append(f'stopped after {k} messages of {messages}')
        finally:
            (own / 'fill').unlink(missing_ok=True)
            client.close()
        after = {x: x.stat().st_mtime_ns for x in [*outside.iterdir(), *folder.iterdir()]}
        before.pop(own)
        after.pop(own)
        if before != after:
            client.wrong.append(f'outside its folder: {set(after.items()) ^ set(before.items())}')
        left = [x.name for x in own.rglob('*') if '.part' in x.name]
        if left:
            client.wrong.append(f'parts are left: {left}')
    if client.worst > hang:
        client.wrong.append(f'{client.worst:.1f} s without a word')
    client.wrong += memory_beyond(client)
    return client


def table(dice: random.Random) -> bytes:
    """A file of comma-separated values, more or less."""
    units = ('deg', 'rad', 'N', 'kN', 'm', 's', '', 'blub', 'N m', '%', 'm^99', 'µm', '\x00')
    heads = ['a', 'b', 'c', 'force', '=x', '', 'é', 'a' * 300, '"', "'=y", 'a']
    head = [f'{dice.choice(heads)} [{dice.choice(units)}]' for _ in range(dice.randrange(5))]
    rows = []
    for k in range(dice.choice((0, 1, 2, 5, 50, 1000))):
        row = [f'{k * dice.uniform(0.5, 2.0):g}', *(f'{dice.uniform(-9, 9):g}' for _ in head[1:])]
        if dice.random() < 0.02:
            row[dice.randrange(len(row))] = dice.choice(('', 'nan', 'inf', '1e999', *TEXTS))[:9999]
        rows.append(row)
    text = dice.choice(('\n', '\r\n', '\r')).join(','.join(r) for r in [head, *rows])
    data = bytearray(text.encode('utf-8', 'surrogatepass'))
    for _ in range(dice.choice((0, 0, 0, 1, 5, 50))):
        if data:
            data[dice.randrange(len(data))] = dice.randrange(256)
    return bytes(data) + b'x' * dice.choice((0, 0, 0, 0, 0, 0, 0, 0, 0, 3_000_000))


def main() -> int:
    """Figures of a run; whether all was as promised."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--messages', type=int, default=20_000)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--log', type=Path, help='file for a line of every message')
    options = parser.parse_args()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's & takes away
    with tempfile.TemporaryDirectory() as folder:
        found = edit(Path(folder) / 'editor', options.messages, options.seed, log=options.log)
    print(dict(found.counts), f'{len(found.saves.texts)} files saved')
    held = ', '.join(f'{role} {size:.0f}' for role, size in sorted(found.memory.items()))
    print(f'longest without a word {found.worst:.2f} s; most held [MiB]: {held}')
    for wrong in found.wrong:
        print('WRONG:', wrong)
    return bool(found.wrong)


if __name__ == '__main__':
    sys.exit(main())
