"""Films of runs: what is in the files that were written."""

from __future__ import annotations

import re
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from bags import write_bag
from builders import simulated
from PIL import Image
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.export.palette import LINKS, rgb
from mechanism_sim.joints.slot.constraint import PinInSlot
from mechanism_sim.planar.mechanism import Revolute
from mechanism_sim.report import video

SVG = '{http://www.w3.org/2000/svg}'


@pytest.fixture(scope='module')
def machine():
    return ms.load_scene('four_bar_clearance')


@pytest.fixture(scope='module')
def solution(machine):
    return ms.simulate(machine, revolutions=2)


def pictures(file):
    """All frames (N, height, width, 3) of a video, as ffmpeg decodes them, and what it knows."""
    reader = imageio_ffmpeg.read_frames(str(file))
    about = next(reader)
    width, height = about['size']
    frames = [np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in reader]
    return np.array(frames), about


def circles(file):
    """Middle (2,) [pixels, upwards] of each circle of a drawing by its name."""
    root = ET.parse(file).getroot()
    height = float(root.get('viewBox').split()[3])
    found = {}
    for group in root.iter(f'{SVG}g'):
        if group.get('id', '').startswith(('pin-', 'lens-')):
            numbers = re.findall(r'-?\d+\.?\d*', group.find(f'{SVG}path').get('d'))
            points = np.array(numbers, float).reshape(-1, 2)
            middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
            found[group.get('id')] = middle * [1.0, -1.0] + [0.0, height]
    return found


def unit(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def joints(machine, solution, t):
    """Places of the joints by name, and of the pin in the loose bearing, from link to link."""
    links, x = machine.scene.links, solution.sample(t)
    th2, th3, th4 = (float(x[f'position.{name}'][0]) for name in ('crank', 'coupler', 'rocker'))
    A = links['crank'].length * unit(th2)
    O4 = np.array([links['ground'].length, 0.0])
    pin, bushing = A + links['coupler'].length * unit(th3), O4 + links['rocker'].length * unit(th4)
    return {'crank_coupler': A, 'coupler_rocker': pin}, pin - bushing


def test_a_solution_is_filmed_as_its_machine_with_it_is(machine, solution, tmp_path):
    how = {'start': 0.15, 'end': 0.16, 'speed': 0.01, 'fps': 2.0}
    for name, given in (('a', (solution,)), ('b', (machine, solution))):
        first, *more = given
        ms.animate(first, tmp_path / name, *more, **how)
    for k in range(2):
        one, other = (tmp_path / name / f'frame_{k:04d}.svg' for name in 'ab')
        assert {n: [*x] for n, x in circles(one).items()} == {
            n: [*x] for n, x in circles(other).items()
        }


def test_frames_of_svg_show_pins_where_the_run_has_them(machine, solution, tmp_path):
    """Pins of the frame give the scale; the bearing is magnified so that its clearance is seen."""
    files = ms.animate(
        machine, tmp_path / 'frames', solution, start=0.15, end=0.25, speed=0.1, fps=8.0
    )
    assert [file.name for file in files] == [f'frame_{k:04d}.svg' for k in range(8)]
    seen_in_lens, true = [], []
    for k, file in enumerate(files):
        seen = circles(file)
        wanted, out = joints(machine, solution, 0.15 + 0.0125 * k)
        base = seen['pin-ground_crank']
        ground = machine.scene.links['ground'].length
        scale = (seen['pin-rocker_ground'] - base)[0] / ground
        assert abs((seen['pin-rocker_ground'] - base)[1]) < 1e-4
        for name, at in wanted.items():
            np.testing.assert_allclose((seen[f'pin-{name}'] - base) / scale, at, atol=2e-6 / 3)
        seen_in_lens.append(seen['lens-coupler_rocker'])
        true.append(out)
    seen_in_lens, true = np.array(seen_in_lens), np.array(true)
    # the lens shows the way between two instants, magnified
    (dx, dy), (ex, ey) = np.ptp(seen_in_lens, axis=0), np.ptp(true, axis=0)
    assert dx / ex == pytest.approx(dy / ey, rel=1e-3)
    moved = seen_in_lens - seen_in_lens[0]
    np.testing.assert_allclose(moved / (dx / ex), true - true[0], atol=1e-3 * 0.254e-3)
    assert dx / ex > 100.0 * scale


def test_a_short_mp4_lasts_as_long_as_it_should(machine, solution, tmp_path):
    file = tmp_path / 'film.mp4'
    ms.animate(machine, file, solution, end=0.1 * machine.drive.period, fps=10.0, size=240)
    frames, about = pictures(file)
    assert about['fps'] == 10.0
    assert len(frames) == 3  # a turn takes three seconds
    assert max(about['size']) == 240
    assert not any(side % 2 for side in about['size'])
    assert np.ptp(frames.astype(int), axis=0).max() > 50
    assert [x.name for x in tmp_path.iterdir()] == ['film.mp4']


@pytest.mark.slow
def test_an_mp4_lasts_as_long_as_it_should_and_moves(machine, solution, tmp_path):
    file = tmp_path / 'film.mp4'
    period = machine.drive.period
    for _ in range(2):  # the same frames are the same file
        before = file.read_bytes() if file.exists() else None
        ms.animate(machine, file, solution, end=period, fps=10.0, size=480, forces=True)
    assert file.read_bytes() == before
    frames, about = pictures(file)
    assert about['fps'] == 10.0
    assert len(frames) == 30  # a turn takes three seconds
    assert about['duration'] == pytest.approx(3.0, abs=0.02)
    assert max(about['size']) == 480
    assert not any(side % 2 for side in about['size'])
    moving = np.ptp(frames.astype(int).sum(axis=3), axis=0) > 150
    left, right = moving[:, :240].mean(), moving[:, 240:].mean()
    assert left > 0.05
    assert right > 0.02
    assert not moving[:28].any()  # the title stands still
    assert [x.name for x in tmp_path.iterdir()] == ['film.mp4']


@pytest.mark.slow
def test_a_gif_goes_on_and_on_in_plain_colours(tmp_path):
    file = tmp_path / 'leg.gif'
    said = run_json(
        'animate', 'ten_links', '--path', 'foot.toe', '-o', str(file), '--size', '300x320',
        '--fps', '10',
    )  # fmt: skip
    assert said['frames'] == 30
    assert (said['width'], said['height']) == (300, 320)
    with Image.open(file) as gif:
        assert gif.size == (300, 320)
        assert gif.info['loop'] == 0
        lasts, shown = 0, []
        for k in range(gif.n_frames):
            gif.seek(k)
            lasts += gif.info['duration']
            shown.append(np.asarray(gif.convert('RGB'), int))
    assert lasts == 3000
    used = {tuple(x) for image in shown for x in image.reshape(-1, 3).tolist()}
    assert 20 < len(used) < 256
    assert min(np.abs(np.array([*used]) - [255 * x for x in rgb(LINKS[0])]).sum(axis=1)) < 3
    assert np.abs(shown[0] - shown[len(shown) // 2]).max() > 100
    assert np.abs(shown[0] - shown[-1]).mean() < np.abs(shown[0] - shown[len(shown) // 2]).mean()


@pytest.mark.slow
def test_a_bag_is_shown_as_it_was_recorded(machine, solution, tmp_path):
    """Read from the bag: the same frames as from memory."""
    bag = write_bag(tmp_path / 'run.mcap', simulated('four_bar_clearance', revolutions=2))
    said = run_json(
        'animate', str(bag), '--from', '0.2', '--revolutions', '0.5', '--fps', '2', '--labels',
        'all', '-o', str(tmp_path / 'bag.svg'),
    )  # fmt: skip
    assert said['frames'] == 3
    assert said['end'] - said['start'] == pytest.approx(0.5 * machine.drive.period, rel=1e-9)
    files = ms.animate(
        machine, tmp_path / 'memory.svg', solution, start=0.2, end=said['end'], fps=2.0,
        speed=said['speed'], labels='all',
    )  # fmt: skip
    for mine, theirs in zip(files, said['files'], strict=True):
        assert mine.read_bytes() == Path(theirs).read_bytes()


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('scene', 'more'),
    [
        ('valve_train', ('--forces',)),
        ('planetary', ()),
        ('loader', ('--labels', 'all')),
        ('four_bar_nominal', ('--forces', '--path', 'coupler.cog')),
        ('andrews_squeezer', ()),
    ],
)
def test_every_kind_of_machine_makes_a_film(scene, more, tmp_path):
    said = run_json('animate', scene, '-o', str(tmp_path), '--fps', '0.6', '--size', '400', *more)
    assert len(said['files']) == said['frames'] > 0
    machine = ms.load_scene(scene)
    pins = [j.name for j in machine.mechanism.joints if isinstance(j, Revolute | PinInSlot)]
    lens = {f'lens-{name}' for name in machine.plan.clearances}
    assert set(circles(tmp_path / 'frame_0000.svg')) - lens == {f'pin-{name}' for name in pins}


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('-o', 'film.avi'), 'the ending must be .mp4, .gif or .svg'),
        (('-o', 'nowhere/film.gif'), "there is no directory 'nowhere'"),
        (('-o', 'film.gif', '--fps', '30'), 'hundredths of a second'),
        (('-o', 'film.gif', '--fps', '0'), 'must be positive'),
        (('-o', 'film.gif', '--realtime-factor', '-1'), 'must be positive'),
        (('-o', 'film.gif', '--size', 'big'), 'write for example 960 or 1280x720'),
        (('-o', 'film.gif', '--size', '20'), 'choose from 240 to 4096'),
        (('-o', 'film.gif', '--lens', 'coupler_roker'), "did you mean 'coupler_rocker'?"),
        (('-o', 'film.gif', '--path', 'cupler.cog'), "did you mean 'coupler.cog'"),
        (('-o', 'film.gif', '--to', '1', '--duration', '2'), 'give only one of'),
        (('-o', 'film.gif', '--to', '0.1', '--realtime-factor', '1e-9'), 'frames, more than'),
        (('-o', 'film.gif', '--from', '0.2', '--to', '0.1'), 'is not within the run'),
    ],
)
def test_bad_input_is_one_sentence(arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run('animate', 'four_bar_clearance', *arguments)
    assert done.returncode == 2
    assert words in done.stderr
    assert done.stderr.count('\n') == 1
    assert not list(tmp_path.iterdir())


def test_without_ffmpeg_a_sentence_says_what_to_install(tmp_path, monkeypatch):
    def none():
        raise RuntimeError('no ffmpeg exe could be found')

    monkeypatch.setattr(shutil, 'which', lambda _: None)
    monkeypatch.setattr(imageio_ffmpeg, 'get_ffmpeg_exe', none)
    with pytest.raises(InputError, match=r"MP4 needs .* pip install 'mechanism_sim\[video\]'"):
        video.Target(str(tmp_path / 'film.mp4'))
    assert video.Target(str(tmp_path / 'film.gif')).kind == '.gif'


def test_a_failing_ffmpeg_is_a_failed_run(machine, solution, tmp_path, monkeypatch):
    program = tmp_path / 'ffmpeg'
    program.write_text('#!/bin/sh\ncat > /dev/null\nexit 3\n', encoding='utf-8')
    program.chmod(0o755)
    monkeypatch.setattr(shutil, 'which', lambda _: str(program))
    with pytest.raises(RunError, match='ffmpeg failed'):
        ms.animate(machine, tmp_path / 'film.mp4', solution, fps=1.0)
    assert not (tmp_path / 'film.mp4').exists()
