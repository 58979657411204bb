"""The editor as a door: slow pictures, full disks, names, and servers that are killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from contextlib import contextmanager
from multiprocessing import spawn
from multiprocessing.connection import wait
from pathlib import Path
from queue import SimpleQueue
from threading import Event, Thread
from types import SimpleNamespace

import pytest
from editing import Page
from running import TIMEOUT, command, full_disk
from websockets.sync.client import connect

from mechanism_sim.editor import background, picture, session, worker
from mechanism_sim.editor.background import Background, Job
from mechanism_sim.editor.document import Document
from mechanism_sim.editor.recovery import UnsavedEdits, place
from mechanism_sim.editor.serving import Desk
from mechanism_sim.errors import InputError


def chain(count: int) -> str:
    """A closed chain of so many links, driven by its first."""
    links = [f'  l{k}: {{length: 100 mm, mass: 1 kg, inertia: 1 kg mm^2}}' for k in range(count)]
    joints = [f'  j{k}: {{revolute: [l{k - 1}.end, l{k}]}}' for k in range(1, count)]
    return '\n'.join([
        'title: A chain', 'mechanism: linkage', 'links:',
        f'  ground: {{points: {{e: [{60 * count} mm, 0 mm]}}}}', *links, 'joints:',
        '  j0: {revolute: [ground, l0]}', *joints,
        f'  je: {{revolute: [l{count - 1}.end, ground.e]}}',
        'drive: {coordinate: l0, speed: 10 rpm}', '',
    ])  # fmt: skip


@pytest.fixture
def page(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return Page('four_bar_nominal')


@pytest.mark.parametrize('kind', ['drag', 'drop', 'pull', 'draw'])
@pytest.mark.parametrize('x', [1e308, -1e308, 1e5, 10**300])
def test_a_hand_that_reaches_too_far_is_told_so(kind, x, page):
    before = page.text
    spots = {'from': {'x': x, 'y': 0}, 'to': {'x': 0, 'y': x}, 'what': 'link'}
    page.ask(kind, handle='crank_coupler', x=x, y=0.0, step=1e-3, **spots)
    assert 'too far away' in page.said[-1]
    assert page.text == before


def test_whatever_a_message_raises_is_a_sentence(page, monkeypatch):
    """Of the message itself, and of the picture that is made of what it did."""
    page.set('title', 'changed')
    for error in (
        OSError(28, 'No space left'),
        MemoryError(),
        RecursionError('deep'),
        SystemError(),
    ):

        def fail(*_args, error=error, **_more):
            raise error

        with monkeypatch.context() as patch:
            patch.setattr(Document, 'save', fail)
            page.ask('save', name='x')
            assert type(error).__name__ in page.said[-1]
        with monkeypatch.context() as patch:
            patch.setattr(picture, 'Turn', fail)
            page.set('title', f'of {type(error).__name__}')
            assert type(error).__name__ in page.state['problem']
    page.set('title', 'good again')
    assert page.state['assembled']
    assert 'good again' in page.text


@pytest.mark.parametrize(
    'name', ['a' * 252, 'a' * 300, 'a' * 5000, 'pipe', 'loop', 'folder', 'a\0b']
)
def test_a_name_under_which_nothing_can_be_saved_is_a_sentence(name, page, tmp_path):
    os.mkfifo(tmp_path / 'pipe.yaml')
    (tmp_path / 'loop.yaml').symlink_to('loop.yaml')
    (tmp_path / 'folder.yaml').mkdir()
    before = sorted(tmp_path.iterdir())
    page.ask('save', name=name)
    assert 0 < len(page.said[-1]) < 2000
    assert not page.said[-1].startswith('saved')
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize('name', ['away/x', 'link', 'away/under/x', '../x', '/tmp/x'])
def test_nothing_is_saved_outside_the_folder(name, tmp_path, monkeypatch):
    """Not by links in it either, which may be another's."""
    outside, inside = tmp_path / 'outside', tmp_path / 'inside'
    for folder in (outside, outside / 'under', inside):
        folder.mkdir()
    (outside / 'link.yaml').write_text('not: yours\n')
    (inside / 'away').symlink_to(outside)
    (inside / 'link.yaml').symlink_to(outside / 'link.yaml')
    monkeypatch.chdir(inside)
    page = Page('four_bar_nominal')
    page.ask('save', name=name)
    assert 'is not a scene name' in page.said[-1]
    assert sorted(x.name for x in outside.rglob('*')) == ['link.yaml', 'under']
    assert (outside / 'link.yaml').read_text() == 'not: yours\n'


def test_a_full_disk_is_a_sentence_and_nothing_is_lost(page, tmp_path):
    page.set('title', 'first')
    page.ask('save')
    saved = page.text
    page.ask('text', text=page.text + '# more\n' * 4000)
    with full_disk(1000):
        page.ask('save')
    assert 'cannot be written' in page.said[-1]
    (file,) = tmp_path.iterdir()
    assert file.read_text() == saved
    assert page.state['changed']
    page.ask('save')
    assert file.read_text() == page.text


def test_what_is_too_large_is_not_drawn_and_stays_what_it_is(page):
    text = chain(200)
    page.ask('text', text=text)
    assert 'are not drawn' in page.state['problem']
    assert page.text == text
    page.ask('undo')
    assert page.state['assembled']


def test_what_is_not_saved_is_kept_and_given_back(tmp_path, monkeypatch):
    """Beside the file; gone when it is saved; never from a link or of somebody else."""
    monkeypatch.chdir(tmp_path)
    Path('m.yaml').write_text('title: saved\n')
    document, recovery = Document.open('m.yaml'), UnsavedEdits()
    document.replace('title: not saved\n')
    assert recovery.keep(document) == ''
    assert place(document).name == '.m.yaml.unsaved'
    again = Document.open('m.yaml')
    Desk(again)  # as a server does that begins
    assert again.text == 'title: not saved\n'
    assert again.changed
    again.undo()
    assert again.text == 'title: saved\n'
    document.save()
    recovery.keep(document)
    assert [x.name for x in tmp_path.iterdir()] == ['m.yaml']
    Path('elsewhere').write_text('title: planted\n')
    place(document).symlink_to('elsewhere')
    assert UnsavedEdits().give_back(document) == ('', '')
    place(document).unlink()
    os.mkfifo(place(document))
    assert UnsavedEdits().give_back(document) == ('', '')
    document.replace('title: once more\n')
    assert 'cannot be kept' in recovery.keep(document)


@pytest.mark.parametrize('more', ['', 'title: more\n'])
def test_what_is_saved_under_another_name_is_not_given_back(more, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    document, recovery = Document.open('geneva'), UnsavedEdits()
    document.replace('title: mine\n')
    recovery.keep(document)
    document.save('mine.yaml')
    if more:
        document.replace(more)
    recovery.keep(document)
    assert [*tmp_path.glob('.geneva*')] == []
    assert UnsavedEdits().give_back(Document.open('geneva')) == ('', '')
    assert bool([*tmp_path.glob('.mine*')]) == bool(more)


def test_unsaved_changes_of_a_file_that_another_program_changed_are_put_aside(
    tmp_path, monkeypatch
):
    """Neither's work is lost: given back as the text, they would be saved over the other's."""
    monkeypatch.chdir(tmp_path)
    file = Path('m.yaml')
    file.write_text('title: first\n')
    document = Document.open('m.yaml')
    document.replace('title: mine\n')
    UnsavedEdits().keep(document)
    file.write_text('title: of another\n')
    again = Document.open('m.yaml')
    desk = Desk(again)
    assert again.text == 'title: of another\n'
    assert (
        "was changed by another program after an edit that was not saved: that is in 'm.uns"
        in (''.join(desk.greeting))
    )
    assert Path('m.unsaved1.yaml').read_text() == 'title: mine\n'
    assert not place(again).exists()


def test_unsaved_changes_are_kept_where_another_editor_saved_its_own(tmp_path, monkeypatch):
    """Who saves removes what he wrote, not what another one did; and what is gone is not kept."""
    monkeypatch.chdir(tmp_path)
    Path('m.yaml').write_text('title: first\n')
    one, other = Document.open('m.yaml'), Document.open('m.yaml')
    ones, others = UnsavedEdits(), UnsavedEdits()
    one.replace('title: one\n')
    ones.keep(one)
    other.replace('title: other\n')
    others.keep(other)
    one.save()
    ones.keep(one)
    assert place(other).read_text().endswith('\ntitle: other\n')
    place(other).unlink()
    assert others.keep(other) == ''
    assert place(other).read_text().endswith('\ntitle: other\n')
    place(other).unlink()
    place(other).mkdir()
    assert 'cannot be kept' in others.keep(other)
    assert 'cannot be kept' in others.keep(other)  # nor is it the second time


class Editor:
    """An editor in a process of its own, and a page that has it open."""

    def __init__(self, folder, *args):
        self.process = subprocess.Popen(
            command('edit', *args, '--port', '0', '--json'), cwd=folder, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        text = ''
        while '}' not in text:
            text += self.process.stdout.readline()
        address = json.loads(text)['address']
        self.socket = connect(
            address.replace('http', 'ws').replace('/?', '/live?'), max_size=None
        ).__enter__()

    def ask(self, kind, **more):
        self.socket.send(json.dumps({'type': kind, **more}))

    def until(self, condition):
        """First message to the page for which a condition holds."""
        while True:
            heard = json.loads(self.socket.recv(TIMEOUT))
            if condition(heard):
                return heard

    def state(self, text):
        """The state that has a text."""
        return self.until(lambda m: m['type'] == 'state' and m['text'] == text)


def drawing(process) -> int:
    """The process of an editor that draws."""
    children = Path(f'/proc/{process.pid}/task/{process.pid}/children').read_text().split()
    (found,) = (
        int(pid) for pid in children if Path(f'/proc/{pid}/comm').read_text() == 'editor: draw\n'
    )
    return found


@contextmanager
def editor(folder, *args):
    found = Editor(folder, *args)
    try:
        yield found
    finally:
        found.process.kill()
        found.process.communicate()


@pytest.mark.slow
def test_a_slow_picture_holds_nobody_up_and_a_killed_server_loses_nothing(tmp_path):
    """It is said that it is computed; a newer text comes first; its text outlives the server."""
    with editor(tmp_path) as first:
        first.until(lambda m: m['type'] == 'state')
        os.kill(drawing(first.process), signal.SIGSTOP)  # slower than any machine would be
        first.ask('text', text=chain(60))
        first.until(lambda m: m['type'] == 'busy' and m['busy'])
        first.ask('text', text='title: newer\n')
        assert first.state('title: newer\n')['undo'] >= 1
        kept = tmp_path / '.machine.yaml.unsaved'
        while not kept.exists():
            time.sleep(0.02)
        first.process.kill()
    with editor(tmp_path) as second:
        assert second.state('title: newer\n')['changed']
        os.kill(drawing(second.process), signal.SIGKILL)  # as by a fault of a library
        second.ask('text', text='title: newest\n')
        assert second.state('title: newest\n')
        second.ask('save', name='mine')
        second.until(lambda m: m['type'] == 'said' and m['text'] == 'saved: mine.yaml')
        second.process.send_signal(signal.SIGINT)
        assert second.process.wait(TIMEOUT) == 0
        assert second.process.stderr.read() == ''
    assert (tmp_path / 'mine.yaml').read_text() == 'title: newest\n'


@pytest.mark.slow
def test_a_picture_that_takes_too_long_is_given_up(tmp_path, monkeypatch):
    """Its text stays. The process is stopped while it draws: no machine draws faster than that."""
    monkeypatch.chdir(tmp_path)
    document, states = Document(), []

    def send(kind, _number, text):
        if kind == 'state':
            states.append(json.loads(text))

    def take_until(condition):
        while not condition():
            wait(found.links, 0.05)
            found.take()

    found = worker.Worker(document, send, print)
    try:
        take_until(lambda: not found.busy)
        for text in map(chain, range(60, 40, -1)):  # until one is caught
            found.ask('page', {'type': 'text', 'text': text})
            take_until(lambda text=text: document.text == text)
            os.kill(found._process.pid, signal.SIGSTOP)
            found.take()
            if states[-1]['text'] != text:
                break
            os.kill(found._process.pid, signal.SIGCONT)
            take_until(lambda: not found.busy)
        with monkeypatch.context() as patch:
            patch.setattr(worker, 'PATIENCE', 0.0)
            found.look(outdated=False)
        take_until(lambda: 'takes longer' in states[-1]['problem'])
        assert document.text == states[-1]['text'] == text
    finally:
        found.close()


@pytest.fixture
def deaf(tmp_path):
    """Processes that start, and never take what they are given."""
    file, before = tmp_path / 'deaf', spawn.get_executable()
    file.write_text('#!/bin/sh\nexec sleep 600\n')
    file.chmod(0o755)
    spawn.set_executable(str(file))
    yield
    spawn.set_executable(before)


def ends(act) -> bool:
    """True if an action comes to its end within 20 s."""
    thread = Thread(target=act, daemon=True)
    thread.start()
    thread.join(20.0)
    return not thread.is_alive()


@pytest.mark.usefixtures('deaf')
def test_whoever_serves_waits_for_no_process_that_begins():
    """It may import for half a minute; a document is more than a pipe holds."""
    document, found = Document('a: 1\n'), []
    for k in range(100):
        document.replace(f'a: {k} # {"x" * 50_000}\n')
    assert ends(lambda: found.append(worker.Worker(document, print, print)))
    found[0].close()


@pytest.mark.usefixtures('deaf')
def test_whoever_serves_waits_for_no_run_to_take_its_document():
    runs = Background(print)
    try:
        assert ends(lambda: runs.submit(Job(1, 'a', {'a': 'x' * 5_000_000})))
        assert ends(lambda: runs.submit(Job(2, 'a', {'a': 'x' * 5_000_000})))
    finally:
        runs.close()


@pytest.mark.slow
def test_who_draws_and_has_grown_gives_way_to_another_and_nothing_is_lost(monkeypatch):
    sizes: dict[int, float] = {}
    monkeypatch.setattr(worker, 'resident', lambda pid: sizes.setdefault(pid, 200.0))
    document, states = Document(), []

    def send(kind, _number, text):
        if kind == 'state':
            states.append(json.loads(text))

    def catch_up():
        while found.busy:
            wait(found.links, 0.05)
            found.take()

    found = worker.Worker(document, send, print)
    try:
        for item in ('text', 'title: newer\n'), ('path', ['links']):
            catch_up()
            assert not found.grown
            found.ask(
                'page', {'type': 'select' if item[0] == 'path' else 'text', item[0]: item[1]}
            )
        catch_up()
        (first,) = sizes
        sizes[first] = 450.0
        assert found.grown
        found.renew()
        assert not found.grown  # it begins
        catch_up()
        assert not found.grown
        assert (states[-1]['text'], states[-1]['path']) == ('title: newer\n', ['links'])
        assert states[-1]['undo']
        assert len(sizes) == 2
        sizes |= dict.fromkeys(sizes, 250.0)
        assert not found.grown
    finally:
        found.close()


@pytest.mark.parametrize(('error', 'said'), [
    (KeyError('coupler'), "it cannot be checked and run (KeyError: 'coupler')"),
    (MemoryError(), 'it cannot be checked and run (MemoryError)'),
    (InputError('a: b is missing'), 'a: b is missing'),
])  # fmt: skip
def test_whatever_a_run_raises_is_a_sentence(error, said, monkeypatch):
    def fail(*_):
        raise error

    monkeypatch.setattr(background, '_work', fail)
    assert background._problem(Job(1, 'machine', {}), None) == said


@pytest.mark.slow
def test_where_no_process_starts_the_editor_says_so_and_goes_on_when_one_does(monkeypatch):
    said, document = [], Document()
    context = type(worker.get_context('spawn').Process(target=print))
    start, runs = context.start, SimpleQueue()

    def refuse(_self):
        raise BlockingIOError(11, 'Resource temporarily unavailable')

    monkeypatch.setattr(context, 'start', refuse)
    monkeypatch.setattr(worker, 'RETRY', 0.0)
    found = worker.Worker(document, lambda *x: said.append(x), print)
    try:
        for _ in range(3):
            found.take()
            found.look(outdated=True)
        assert found.busy  # nothing is given to it
        assert [kind for kind, _, _ in said] == ['said']  # once
        assert 'cannot be started (BlockingIOError: [Errno 11] Resource' in said[0][2]
        desk = Desk(document)
        desk._worker = found
        assert desk.greeting == [said[0][2]]  # whoever comes later is told, too
        Background(lambda *x: runs.put(x)).submit(Job(5, 'a', {}))
        number, kind, text = runs.get()
        assert (number, kind) == (5, 'problem')
        assert 'no process starts (BlockingIOError: [Errno 11] Resource' in text
        monkeypatch.setattr(context, 'start', start)
        while found.busy:
            wait(found.links, 0.05)
            found.take()
            found.look(outdated=False)
        assert 'state' in [kind for kind, _, _ in said]
        assert not found.trouble
    finally:
        found.close()


def test_whoever_serves_waits_for_no_disk(tmp_path, monkeypatch):
    """What is not saved is kept by a thread; at the end it is there."""
    monkeypatch.chdir(tmp_path)
    free, sync = Event(), os.fsync
    monkeypatch.setattr(os, 'fsync', lambda number: (free.wait(TIMEOUT), sync(number)))
    document = Document('title: old\n', Path('m.yaml'), 'm')
    desk, asked = Desk(document), []
    idle = SimpleNamespace(
        busy=0.0, grown=False, job=None, number=0, document=document, ask=asked.append
    )
    desk._worker, desk._since = idle, 0.0
    document.replace('title: new\n')
    assert ends(lambda: [desk._work(idle, None) for _ in range(3)])
    assert asked == ['job', 'pause']
    free.set()
    document.replace('title: newest\n')
    assert desk.keep() == ''
    again = Document('title: old\n', Path('m.yaml'), 'm')
    assert UnsavedEdits().give_back(again)[0] == 'title: newest\n'


@pytest.mark.parametrize('message', [
    {'type': 'text', 'text': 'title: a\nb: \ud800\n'},
    {'type': 'set', 'path': ['title'], 'text': 'x\udfff'},
    {'type': 'rename', 'path': ['links', 'crank'], 'name': 'x\udfff'},
    {'type': 'save', 'name': '\ud800'},
])  # fmt: skip
def test_half_a_character_is_refused_before_it_has_to_be_kept(message, tmp_path, monkeypatch):
    """It came to the process that serves, which ended when it wrote what is not saved."""
    monkeypatch.chdir(tmp_path)
    heard, document = [], Document.open('four_bar_nominal')
    before = document.text
    session.Session(document, heard.append).handle(message)
    said = [m['text'] for m in heard if m['type'] == 'said']
    assert len(said) == 1
    assert document.text == before
    if message['type'] == 'text':
        assert said == ['four_bar_nominal:2: an incomplete character (U+D800) cannot be saved']
