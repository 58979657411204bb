"""The live view: real nodes in processes of their own, and a browser that operates them."""

from __future__ import annotations

import json
import math
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import PLAY, weightless
from live_pages import Acted, data, motion_messages, unpacked
from middleware_network import PATIENCE, eventually
from running import command, run
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

import mechanism_sim as ms
from mechanism_sim import process_exit
from mechanism_sim.errors import InputError
from mechanism_sim.messages import Impact, String, service_class
from mechanism_sim.messages import Motion as MotionMessage
from mechanism_sim.messages.events import describe
from mechanism_sim.messages.segments import motion_of
from mechanism_sim.nodes import middleware
from mechanism_sim.nodes.qos import LATCHED
from mechanism_sim.pages.assets import contents_of
from mechanism_sim.pages.controls import controls, visible_pace
from mechanism_sim.pages.live import MOST, Live
from mechanism_sim.pages.server import PAGES, Command, Mailbox, Server
from mechanism_sim.pages.view import MODULES, NEWEST

SCENE = 'four_bar_clearance'
COMMANDS = 'drive.commands={acceleration: 1000 rad/s^2, fastest: 60 rad/s}'


def ended(process: subprocess.Popen[str]) -> int:
    """End a command as Ctrl-C does; its exit code."""
    process.send_signal(signal.SIGINT)
    return process.wait(PATIENCE)


@contextmanager
def started(*args: str) -> Iterator[subprocess.Popen[str]]:
    """A command on the network of this process."""
    process = process_exit.start(command(*args), text=True, stdout=subprocess.PIPE)
    try:
        yield process
    finally:
        process.terminate()  # it has children, who end with it
        process.communicate(timeout=PATIENCE)


def address_of(view: subprocess.Popen[str]) -> str:
    """Address that `view --json` prints."""
    assert view.stdout is not None
    text = ''
    while '}' not in text:
        line = view.stdout.readline()
        assert line
        text += line
    return str(json.loads(text)['address'])


class Listener:
    """Hears a run in this process, and asks its nodes."""

    def __init__(self, node: Any) -> None:
        self.node = node
        self.motion: list[Any] = []
        self.impacts: list[Any] = []
        self.scenes: list[Any] = []
        for kind, topic, heard, qos in (
            (MotionMessage, 'motion', self.motion, NEWEST),
            (Impact, 'impacts', self.impacts, NEWEST),
            (String, 'scene', self.scenes, LATCHED),
        ):
            node.create_subscription(kind, topic, heard.append, qos)

    def until(self, condition: Callable[[], Any]) -> None:
        """Listen until something is so."""
        end = time.monotonic() + 2.0 * PATIENCE
        while not condition():
            assert time.monotonic() < end
            middleware.spin_once(self.node, timeout_sec=0.02)

    def still(self) -> float:
        """Time [s] of the machine once it stands still."""
        count, since = len(self.motion), time.monotonic()
        while time.monotonic() < since + 1.0:
            middleware.spin_once(self.node, timeout_sec=0.1)
            if len(self.motion) > count:
                count, since = len(self.motion), time.monotonic()
        return float(self.motion[-1].known_until)

    def parameter(self, owner: str, name: str) -> Any:
        """Value of a parameter of a node."""
        kind = service_class('rcl_interfaces/srv/GetParameters')
        client = self.node.create_client(kind, f'{owner}/get_parameters')
        assert client.wait_for_service(PATIENCE)
        answer = client.call_async(kind.Request(names=[name]))
        self.until(answer.done)
        self.node.destroy_client(client)
        (value,) = answer.result().values
        return value.double_value if value.type == 3 else value.string_value  # PARAMETER_DOUBLE

    def crank(self) -> float:
        """Speed [rad/s] of the crank at the end of the newest motion."""
        motion = motion_of([m for m in self.motion if m.segments][-1])
        return float(motion.curve(np.array([motion.curve.end]), 1)[0, 0])

    def rebounds(self) -> set[float]:
        """Rebound by approach of what has been heard of impacts."""
        return {round(m.rebound_speed / m.approach_speed, 6) for m in self.impacts
                if not m.ends_chatter}  # fmt: skip


def slide(tab: Any, path: str, place: int) -> None:
    """Move a slider, whose way is 0 to 1000, as somebody's hand does."""
    tab.page.locator(f'input[data-path="{path}"]').fill(str(place))


@pytest.mark.parametrize(
    ('args', 'said'),
    [
        (('node', 'view', '--port', '70000'), 'between 0 and 65535'),
        (('view', 'four_bar_clearence'), "did you mean 'four_bar_clearance'?"),
        (('view', SCENE, '--realtime-factor', '-1'), '--realtime-factor'),
        (('view', SCENE, '--duration', '-1'), 'positive'),
        (('view', '--duration', '1'), 'give a SCENE'),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_sentence(args, said):
    done = run(*args, refused=True)
    assert done.returncode == 2
    assert said in done.stderr
    assert 'Traceback' not in done.stderr


@pytest.mark.slow
def test_a_page_shows_the_machine_that_runs_and_what_it_asks_for_is_done(node, tab):
    heard = Listener(node)
    with started('view', '--port', '0', '--json') as view:
        address = address_of(view)
        tab.page.goto(address)
        tab.page.get_by_text('mechanism-sim run four_bar_clearance').wait_for()
        args = [SCENE, '--duration', '600', '--realtime-factor', '0.2', '--hold']
        with started('run', *args, '--set', COMMANDS, '--processes') as running:
            watch(tab, heard)
            operate(tab, heard)
            refuse(address)
            assert ended(running) == 130
        tab.page.get_by_text('No machine is running').wait_for()
        assert tab.complaints == []
        assert all(request.startswith(address) for request in tab.requests)
        assert ended(view) == 0


def watch(tab: Any, heard: Listener) -> None:
    """The page follows: its time goes on as that of the machine, and the pin is in its bushing."""
    heard.until(lambda: data(tab, 'time'))
    heard.until(lambda: float(data(tab, 'time')) > 0.05)
    heard.until(lambda: abs(float(data(tab, 'time')) - heard.motion[-1].known_until) < 0.5)
    pin = tab.page.locator('#lens .journal')
    # both at one instant; between two with an impact among them a cubic leaves the bore a little
    x, y = map(float, pin.evaluate('pin => [pin.dataset.x, pin.dataset.y]'))
    assert 0.0 < math.hypot(x, y) < 1.15 * 0.254e-3
    assert tab.page.locator('#stage .machine').bounding_box()['height'] > 100
    heard.until(lambda: tab.page.locator('#play').get_attribute('aria-label') == 'pause')
    assert tab.shoot('live_view').stat().st_size > 10_000


def operate(tab: Any, heard: Listener) -> None:
    """Sliders and buttons change the nodes that run."""
    path = f'{PLAY}.restitution'
    slide(tab, path, 900)
    heard.until(lambda: heard.parameter('linkage', path) == 0.9)
    heard.until(lambda: f'{path}=0.9' in heard.parameter('crank_drive', 'overrides'))
    heard.impacts.clear()
    heard.until(lambda: 0.9 in heard.rebounds())
    heard.impacts.clear()
    heard.until(lambda: len(heard.impacts) > 3)
    assert heard.rebounds() == {0.9}
    slide(tab, 'velocity', 1000)
    heard.until(lambda: abs(heard.crank() - 60.0) < 1e-9)
    # A value of the next run begins one, which keeps what was set before.
    slide(tab, f'{PLAY}.radial', 700)
    heard.until(lambda: heard.motion[-1].run == 1)
    heard.until(lambda: len(heard.scenes) == 2)
    scene = json.loads(heard.scenes[-1].data)['scene']
    play = scene['joints']['coupler_rocker']['clearance']
    assert play['radial'] == pytest.approx(0.0254e-3 * 100.0**0.7, rel=0.03)
    assert play['restitution'] == 0.9
    heard.until(lambda: data(tab, 'run') == '1' and heard.impacts)
    # Paused, time stands still; a step is a step.
    tab.page.locator('#play').click()
    heard.until(lambda: tab.page.locator('#play').get_attribute('aria-label') == 'play')
    paused = heard.still()
    tab.page.locator('#step').click()
    heard.until(lambda: heard.motion[-1].known_until > paused)
    assert heard.still() - paused == pytest.approx(1e-3)
    tab.page.locator('#reset').click()
    heard.until(lambda: heard.motion[-1].run == 2)
    assert heard.motion[-1].known_until == 0.0
    heard.until(lambda: float(data(tab, 'time')) == 0.0)


def refuse(address: str) -> None:
    """A page of another site may not even speak; what makes no sense is answered."""
    live = address.replace('http', 'ws') + 'live'
    for origin in ('http://example.org', address.rstrip('/').replace('http', 'https'), 'null'):
        with pytest.raises(InvalidStatus, match='403'):
            connect(live, origin=origin)
    with connect(live, origin=address.rstrip('/')) as page:
        for asked, said in (
            ({'type': 'set', 'path': f'{PLAY}.restitution', 'value': 2}, 'outside 0 to 1'),
            ({'type': 'set', 'path': 'scene', 'value': 1}, "'scene' cannot be set"),
            ({'type': 'set', 'path': f'{PLAY}.restitution', 'value': 10**20}, '1e+20 is outside'),
        ):
            with connect(live, origin=address.rstrip('/')) as junk:
                junk.send('no JSON')
                assert closed(junk) == 1007
            page.send(json.dumps(asked))
            while (found := json.loads(page.recv(PATIENCE)))['type'] != 'message':
                pass
            assert said in found['text']


@pytest.mark.slow
@pytest.mark.parametrize('more', [('--realtime-factor', '0.5'), ('--paused',)])
def test_a_view_with_a_scene_runs_it_and_ends_it(more, network):
    with started('view', SCENE, '--port', '0', '--json', *more) as view:
        with connect(address_of(view).replace('http', 'ws') + 'live') as page:
            found = [json.loads(page.recv(2.0 * PATIENCE))]
            assert found[0] == {'type': 'waiting', 'starting': True}
            while found[-1]['type'] != 'frames' or found[-1]['frames']['t'] is None:
                found.append(json.loads(page.recv(2.0 * PATIENCE)))
        assert 'stage' in [message['type'] for message in found]
        assert (unpacked(found[-1]['frames']['t'])[-1] == 0.0) == (more == ('--paused',))
        run = int(Path(f'/proc/{view.pid}/task/{view.pid}/children').read_text())
        assert ended(view) == 0
    assert not Path(f'/proc/{run}').exists()
    assert network


@pytest.mark.slow
def test_a_view_that_is_killed_leaves_no_run_behind(network):
    with started('view', SCENE, '--port', '0', '--json', '--paused') as view:
        address_of(view)
        children = Path(f'/proc/{view.pid}/task/{view.pid}/children')
        assert eventually(lambda: bool(children.read_text()))
        run = Path('/proc', children.read_text().strip(), 'stat')
        view.kill()
        assert eventually(lambda: not run.exists() or ') Z ' in run.read_text())
    assert network


# --- what a page gets, without a network --------------------------------------------------------


def test_what_a_page_gets_is_the_motion_at_these_instants():
    """Against the solution; who joins late, or misses messages, sees what is there."""
    machine = ms.load_scene(SCENE)
    live = Live(describe(machine))
    assert live.batch() is None
    first, second, third, fourth = motion_messages(machine, [0.1, 0.12, 0.3, 0.32])
    live.take(second)  # joined late, and one is missing later
    batches = [live.batch()]
    live.take(fourth)
    batches.append(live.batch())
    assert live.batch() is None
    solution = ms.simulate(machine, duration=0.4)
    joint = machine.mechanism.joint('coupler_rocker')
    for batch, message in zip(batches, (second, fourth), strict=True):
        frames = {name: unpacked(packed) for name, packed in batch['frames'].items()}
        t = frames['t']
        motion = motion_of(message)
        assert t[-1] == motion.curve.end
        assert t[0] == motion.curve.start[0]
        assert np.diff(t).max() <= live.step * (1.0 + 1e-6)
        seen = solution.view(t[1:-1]).observed  # the ends may be events
        places = [machine.mechanism.locate_all(link, seen.position, at) for link, at in
                  joint.points]  # fmt: skip
        assert np.abs(frames['pins'][1:-1, 0] - (places[0] - places[1]).T).max() < 1e-10
        assert frames['speed'] == pytest.approx(36.6519)
        assert np.abs(frames['torque'][1:-1] - seen.drive_torque[0]).max() < 1e-4
    assert batches[0]['epoch'] == batches[1]['epoch']
    live.take(third)  # goes back: somebody has begun anew
    assert live.batch()['epoch'] == batches[0]['epoch'] + 1
    (again,) = motion_messages(machine, [0.05], run=1)
    live.take(again)
    assert live.batch()['epoch'] == batches[0]['epoch'] + 2
    (long,) = motion_messages(machine, [3.0], run=2)
    live.take(long)
    assert len(unpacked(live.batch()['frames']['t'])) <= MOST + 1
    assert first.segments


def test_a_run_that_stands_at_its_start_is_shown_there():
    """One that begins paused, and one that is reset: there is no motion of it yet."""
    machine = ms.load_scene(SCENE)
    live = Live(describe(machine))
    (moved,), (again,) = (motion_messages(machine, [0.1], run=run) for run in (0, 1))
    none = MotionMessage(coordinates=again.coordinates, joints=again.joints, run=1)
    place = ms.simulate(machine, duration=0.01).sample(0.0, 'position.rocker')['position.rocker']
    live.show_start()
    start = live.batch()
    assert live.batch() is None
    live.take(moved)
    live.show_start()  # too late
    following = live.batch()
    live.take(none)
    reset = live.batch()
    for batch in (start, reset):
        assert unpacked(batch['frames']['t']).tolist() == [0.0]
        assert unpacked(batch['frames']['poses'])[0, 2, 2] == pytest.approx(place, abs=1e-6)
    assert unpacked(following['frames']['t'])[0] == 0.0
    live.take(again)
    epochs = [batch['epoch'] for batch in (start, following, reset, live.batch())]
    assert epochs == [0, 0, 1, 1]
    late = Live(describe(machine))
    late.show_start()
    late.batch()
    late.take(motion_messages(machine, [0.1, 0.2])[1])  # it had moved: the start was none
    assert late.batch()['epoch'] == 1


def test_what_is_no_scene_is_refused():
    for text in ('', '[]', '{"name": "x"}', '{"name": "x", "scene": {"mechanism": "y"}}'):
        with pytest.raises(InputError):
            Live(text)


@pytest.mark.parametrize(
    ('scene', 'paths'),
    [
        (SCENE, {'drive.speed', f'{PLAY}.radial', f'{PLAY}.restitution'}),
        ('slider_crank', {'drive.speed'}),
        ('valve_train', {'drive.speed', 'joints.contact.lift_off.restitution'}),
        ('gear_rattle', {'drive.speed', 'joints.mesh.backlash.restitution'}),
    ],
)
def test_every_control_is_in_its_limits_and_what_it_sets_is_a_value_of_the_scene(scene, paths):
    machine = ms.load_scene(scene)
    found = controls(machine)
    assert found.keys() == paths | {'realtime_factor'}
    names = {*machine.plan.clearances, machine.plan.main}
    for path in paths:
        control = found[path]
        assert control.label.rpartition(' of ')[2] in names  # as the scene has them
        assert control.low <= control.value <= control.high
        changed = controls(ms.load_scene(scene, [control.override(control.high)]))[path]
        assert changed.value == pytest.approx(control.high)


def test_sliders_are_in_the_units_of_what_they_reach():
    """Clearances of micromachines in µm, large torques in kN m, and what is set is as shown."""
    fine = controls(ms.load_scene(SCENE, {f'{PLAY}.radial': '0.8 um'}))[f'{PLAY}.radial']
    assert fine.unit == 'µm'
    assert (fine.low, fine.value, fine.high) == pytest.approx((0.08, 0.8, 8.0))
    assert fine.override(2.0) == f'{PLAY}.radial=2e-06 m'
    wheel = {'points': {'rim': ['1 m', 0]}, 'mass': 1000, 'inertia': 500}
    parts = {
        'links': {'wheel': wheel},
        'joints': {'shaft': {'revolute': ['ground', 'wheel']}},
        'drive': {'coordinate': 'wheel', 'torque': '5 kN m'},
    }
    strong = controls(weightless(**parts))['effort']
    assert (strong.unit, strong.value, strong.high) == ('kN m', 5.0, 15.0)
    assert strong.si(strong.low) == -15e3


def test_what_a_control_sets_has_no_rounding_of_its_unit():
    radial = controls(ms.load_scene(SCENE))[f'{PLAY}.radial']
    assert 0.26 / 1000.0 != 0.00026
    assert radial.override(0.26) == f'{PLAY}.radial=0.00026 m'


def closed(page: Any) -> int:
    """The code with which a page is sent away."""
    with suppress(ConnectionClosed):
        while page.recv(PATIENCE):
            pass
    return int(page.close_code)


@pytest.fixture
def serving():
    """A server that keeps what pages ask for, and its address for them."""
    asked = Mailbox()
    server = Server({}, 0, lambda: [{'type': 'waiting'}], asked.put)
    yield server, asked, server.address.replace('http', 'ws') + 'live'
    server.close()


@pytest.mark.parametrize(
    ('junk', 'code'),
    [
        ('no JSON', 1007),
        ('{"type": "set", "path": "a", "value": NaN}', 1007),
        ('{"type": "set", "path": "a", "value": 1e400}', 1007),
        ('[' * 5000, 1007),
        (b'\xff\xfe', 1007),
        ('[1]', 1008),
        ('{"type": "dance"}', 1008),
        ('{"type": ["play"]}', 1008),
        ('{"type": "set", "path": "a", "value": true}', 1008),
        ('{"type": "set", "path": 3, "value": 1}', 1008),
        (json.dumps({'type': 'set', 'path': 'a', 'value': 10**400}), 1008),
        (' ' * 20_000, 1009),
        (b'x' * 2_000_000, 1009),
    ],
)
def test_a_page_that_talks_nonsense_is_sent_away_and_others_are_not(serving, junk, code):
    server, asked, address = serving
    with connect(address) as good, connect(address) as bad:
        bad.send(junk)
        assert closed(bad) == code
        good.send('{"type": "pause"}')
        assert eventually(lambda: asked.take() == Command('pause'))
        server.send({'type': 'state'})
        assert [json.loads(good.recv(PATIENCE))['type'] for _ in range(2)] == ['waiting', 'state']


@pytest.mark.slow
def test_a_page_that_floods_is_sent_away(serving):
    _, asked, address = serving
    with connect(address) as good, connect(address) as bad:
        with suppress(ConnectionClosed):
            for _ in range(1_000_000):
                bad.send('{"type": "step"}')
        assert closed(bad) == 1008
        assert list(iter(asked.take, None)) == [Command('step')]
        good.send('{"type": "reset"}')
        assert eventually(lambda: asked.take() == Command('reset'))


def test_of_commands_that_wait_the_newest_counts_and_only_so_many_wait():
    asked = Mailbox()
    given = Command('set', 'a', 1), Command('set', 'b', 2), Command('play'), Command('set', 'a', 3)
    for asking in (*given, Command('pause'), Command('step'), Command('step')):
        asked.put(asking)
    newest = [Command('set', 'b', 2), Command('set', 'a', 3), Command('pause'), Command('step')]
    assert list(iter(asked.take, None)) == newest
    for n in range(1000):
        asked.put(Command('set', f'p{n}', n))
    assert [c.value for c in iter(asked.take, None)] == list(range(700, 1000))


def test_a_page_that_takes_nothing_is_cut_off_and_pages_are_counted(serving):
    server, _, address = serving
    with connect(address) as good, socket.create_connection(('127.0.0.1', server.port)) as deaf:
        deaf.sendall(
            b'GET /live HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n'
            b'Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n'
            b'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n'
        )
        assert eventually(lambda: server.pages == 2)
        while server.pages == 2:
            server.send({'type': 'state', 'text': 'x' * 1_000_000})
            while json.loads(good.recv(PATIENCE))['type'] != 'state':
                pass
        assert server.pages == 1
    with ExitStack() as open_pages:
        assert eventually(lambda: server.pages == 0)
        for _ in range(PAGES):
            open_pages.enter_context(connect(address))
        assert eventually(lambda: server.pages == PAGES)
        with pytest.raises(InvalidStatus, match='503'):
            connect(address)


def test_two_servers_find_ports_of_their_own(monkeypatch):
    servers = [Server({}, port, list, print) for port in (0, 0)]
    with pytest.raises(InputError, match='is taken: choose another'):
        Server({}, servers[0].port, list, print)
    monkeypatch.setattr('mechanism_sim.pages.server.PORT', servers[0].port)
    servers.append(Server({}, None, list, print))
    assert len({s.port for s in servers}) == 3
    for server in servers:
        server.close()
    assert eventually(lambda: not any(s._thread.is_alive() for s in servers))


# --- the page itself, operated by hand, with a server that answers as a run would ---------------


@pytest.fixture
def acted(tab):
    """Makes pages of runs, and ends them."""
    made: list[Acted] = []

    def make(*given: Any) -> Acted:
        made.append(Acted(tab, *given))
        return made[-1]

    yield make
    for each in made:
        each.server.close()


@pytest.mark.slow
def test_a_page_says_that_its_view_has_ended(tab):
    server = Server(contents_of('live', MODULES), 0, lambda: [{'type': 'waiting'}], print)
    tab.page.goto(server.address)
    tab.page.get_by_text('No machine is running').wait_for()
    server.close()
    tab.page.get_by_text('The view has ended').wait_for()
    assert not tab.page.get_by_text('This page waits').is_visible()


@pytest.mark.slow
def test_a_page_shows_nothing_of_a_machine_before_it_knows_where_it_is(acted):
    run = acted(SCENE, 0.1)
    links = run.page.locator('#stage .machine')
    assert links.is_visible()
    run.server.send(run.stage())
    links.wait_for(state='hidden')
    run.server.send(run.batch)
    links.wait_for(state='visible')


@pytest.mark.slow
def test_a_slider_keeps_what_was_asked_for_until_the_machine_has_it_or_refuses(acted):
    run = acted(SCENE, 0.1, 0.2)
    path = f'{PLAY}.radial'
    slider = run.page.locator(f'input[data-path="{path}"]')
    box = run.page.locator('.slider', has=slider)
    run.tell()
    slide(run.tab, path, 700)
    asked = run.command()
    assert (asked.type, asked.path) == ('set', path)
    for _ in range(3):  # the run goes on as it was: nothing jumps back
        run.tell()
        assert slider.input_value() == '700'
        assert box.locator('small').inner_text() == 'restarting …'
    run.controls[path] = run.controls[path].at(1e-3 * asked.value)
    run.server.send(run.stage())
    box.get_by_text('restarts the run').wait_for()
    shown = math.log(asked.value / 0.0254) / math.log(100.0)
    assert float(slider.input_value()) == pytest.approx(1e3 * shown, abs=1.0)
    slide(run.tab, path, 900)
    assert run.command().value > asked.value
    run.server.send({'type': 'message', 'text': 'no such thing', 'path': path})
    box.get_by_text('restarts the run').wait_for()
    assert float(slider.input_value()) == pytest.approx(1e3 * shown, abs=1.0)
    assert run.tab.complaints == []


@pytest.mark.slow
@pytest.mark.parametrize('path', ['drive.speed', f'{PLAY}.radial', 'realtime_factor'])
def test_a_key_moves_a_slider_by_a_value_at_least(acted, path):
    run = acted(SCENE, 0.1, 0.2)
    slider = run.page.locator(f'input[data-path="{path}"]')
    run.tell()
    control = run.controls[path]
    place, value = float(slider.input_value()), control.value
    for key, way in (('ArrowRight', 1), ('ArrowRight', 1), ('ArrowLeft', -1), ('ArrowLeft', -1)):
        slider.press(key)
        asked = run.command()
        assert (asked.type, asked.path) == ('set', path)
        assert way * (asked.value - value) > 0.0
        assert way * (float(slider.input_value()) - place) > 0.0
        place, value = float(slider.input_value()), asked.value
        run.controls[path] = control.at(asked.value / control.scale)
        run.tell()


@pytest.mark.slow
def test_space_pauses_whatever_was_clicked_before(acted):
    run = acted(SCENE, 0.05)
    run.tell(playing=False)
    run.page.evaluate("document.getElementById('choice').hidden = false")  # as of several plays
    for selector in ('#step', '#names', 'input[data-path=realtime_factor]', '#stage', '#bearing'):
        for playing, wanted in ((True, 'pause'), (False, 'play')):
            run.tell(playing)
            if selector == '#bearing':
                run.page.select_option(selector, index=0)
            elif selector != '#step' or not playing:  # no steps while it plays
                run.page.locator(selector).click()
            while command := run.asked.take():
                assert command.type in ('step', 'set')
            run.page.keyboard.press('Space')
            found = run.command()
            while found.type not in ('play', 'pause'):
                found = run.command()
            assert found == Command(wanted), selector
    assert run.tab.complaints == []


@pytest.mark.slow
def test_every_play_has_its_lens_in_the_live_view(acted):
    run = acted('whole_machine', 0.05, 0.1)
    told = run.live.stage.to_json()
    names = [play['joint'] for play in (*told['bearings'], *told['plays'])]
    assert len(names) > 2
    frames = {name: unpacked(packed) for name, packed in run.batch['frames'].items()}
    for name in names:
        run.page.select_option('#bearing', name)
        run.page.locator('#lens .title', has_text=name).wait_for()
        assert run.page.locator('#stage .callout').bounding_box()['height'] > 10
        if name in [play['joint'] for play in told['plays']]:
            (k,) = [k for k, play in enumerate(told['plays']) if play['joint'] == name]
            left, right = frames['walls'][-1, k].astype(float)
            right = 0.5 * (left - right) if told['plays'][k]['walls'] == 2 else right
            run.page.wait_for_timeout(100)
            shown = float(run.page.locator('#lens .journal').get_attribute('data-x'))
            assert shown == pytest.approx(right, abs=1e-2 * told['plays'][k]['width'])
    run.tab.shoot('live_plays')
    assert run.tab.complaints == []


@pytest.mark.slow
def test_the_wheel_enlarges_where_it_points_and_the_scale_stays_true(acted):
    run = acted(SCENE, 0.1)
    stage, told = run.page.locator('#stage'), run.live.stage.to_json()
    unit = told['symbol'] / 10.0
    place = stage.bounding_box()
    x, y = round(place['x'] + 0.7 * place['width']), round(place['y'] + 0.4 * place['height'])
    under = """([x, y]) => {
        const matrix = document.querySelector('#stage').getScreenCTM().inverse();
        const point = new DOMPoint(x, y).matrixTransform(matrix);
        return [point.x, point.y];
    }"""
    before = run.page.evaluate(under, [x, y])
    whole = stage.get_attribute('viewBox')
    run.page.mouse.move(x, y)
    for _ in range(5):
        run.page.mouse.wheel(0, -200)
    run.page.wait_for_timeout(100)
    assert run.page.evaluate(under, [x, y]) == pytest.approx(before, abs=0.5)
    times = float(whole.split()[2]) / float(stage.get_attribute('viewBox').split()[2])
    assert times == pytest.approx(math.exp(0.0015 * 1000), rel=1e-3)
    rule = stage.locator('.rule:not(.of-forces)')
    number, prefix = rule.locator('text').text_content().split()
    length = float(number) * {'mm': 1e-3, 'm': 1.0}[prefix]
    drawn = rule.locator('path').evaluate('x => x.getBoundingClientRect().width')
    scale = stage.evaluate('x => x.getScreenCTM().a')
    assert drawn * unit / scale == pytest.approx(length, rel=0.03)  # but for the line's width
    run.page.mouse.down()
    run.page.mouse.move(x - 40, y - 30)
    run.page.mouse.up()
    assert run.page.evaluate(under, [x - 40, y - 30]) == pytest.approx(before, abs=0.5)
    run.tab.shoot('live_zoomed')
    run.page.mouse.dblclick(x, y)
    assert [float(v) for v in stage.get_attribute('viewBox').split()] == pytest.approx(
        [float(v) for v in whole.split()], abs=0.01
    )
    assert run.tab.complaints == []


@pytest.mark.slow
def test_two_fingers_enlarge_what_is_between_them(acted):
    """By as much as they part, and what was between them stays there."""
    run = acted(SCENE, 0.1)
    stage = run.page.locator('#stage')
    place, whole = stage.bounding_box(), float(stage.get_attribute('viewBox').split()[2])
    x, y = place['x'] + 0.5 * place['width'], place['y'] + 0.5 * place['height']
    under = """([x, y]) => {
        const matrix = document.querySelector('#stage').getScreenCTM().inverse();
        const point = new DOMPoint(x, y).matrixTransform(matrix);
        return [point.x, point.y];
    }"""
    before = run.page.evaluate(under, [x, y])
    session = run.page.context.new_cdp_session(run.page)

    def touch(kind: str, *far: float) -> None:
        fingers = [
            {'x': x + side * d, 'y': y, 'id': k} for d in far for k, side in ((0, -1), (1, 1))
        ]
        session.send('Input.dispatchTouchEvent', {'type': kind, 'touchPoints': fingers})

    touch('touchStart', 30.0)
    for far in range(35, 91, 5):
        touch('touchMove', float(far))
    touch('touchEnd')
    run.page.wait_for_timeout(100)
    times = whole / float(stage.get_attribute('viewBox').split()[2])
    assert times == pytest.approx(3.0, rel=0.05)
    assert run.page.evaluate(under, [x, y]) == pytest.approx(before, abs=3.0)
    assert run.page.evaluate('window.visualViewport.scale') == 1.0  # the page itself does not
    assert run.tab.complaints == []


@pytest.mark.parametrize('scene', [SCENE, 'rotary_engine', 'pendulum', 'five_bar'])
def test_the_pace_begins_where_motion_can_be_followed(scene):
    machine = ms.load_scene(scene)
    pace = visible_pace(machine)
    assert 1e-3 <= pace <= 1.0
    if 4e-3 < machine.drive.period < 4.0:
        assert 4.0 <= machine.drive.period / pace <= 10.1


@pytest.mark.parametrize('scene', ['andrews_squeezer', 'catapult', 'loader'])
def test_a_run_that_is_shorter_than_a_turn_can_be_followed(scene):
    """Of 0.03, 0.11 and 0.7 s: `view` went through them as fast as they go."""
    machine = ms.load_scene(scene)
    assert 4.0 <= machine.scene.duration / visible_pace(machine, machine.scene.duration) <= 10.1
