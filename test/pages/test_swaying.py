"""Frames on springs sway alike in films, as markers and in the live view."""

from __future__ import annotations

import math

import numpy as np
import pytest
from builders import simulated
from live_pages import motion_messages, unpacked

from mechanism_sim.analysis.preview import preview
from mechanism_sim.export.stage import Swaying
from mechanism_sim.messages.events import describe
from mechanism_sim.nodes.force_markers import ForceMarkers, shapes
from mechanism_sim.pages.live import Live
from mechanism_sim.report import figures
from mechanism_sim.report.screen import FilmParts, Screen

SCENE = 'four_bar_on_frame'
T = np.linspace(0.02, 0.16, 8)


@pytest.fixture(scope='module')
def record():
    return simulated(SCENE, duration=0.17)


@pytest.fixture(scope='module')
def true(record):
    """Position of the frame (3, N), by its own equations."""
    return record.machine.oscillator('frame').take(record.history)(T).position


def moved(turn, to, cog):
    """Displacement of a centre of gravity [m] by a turn [rad] about the origin and a shift."""
    c, s = math.cos(turn), math.sin(turn)
    return np.array(to) + np.array([[c, -s], [s, c]]) @ cog - cog


def test_in_a_film_the_frame_goes_as_far_as_the_scale_bar_says(record, true):
    """By the points of its patch, and the upper ends of its springs."""
    with figures.style():
        screen = Screen(record, T, FilmParts(labels='all'), 1.0, 480)
    axes = screen.figure.axes[0]
    (patch,) = (x for x in axes.patches if x.get_gid() == 'frame-frame')
    (text,) = (x.get_text() for x in axes.texts if 'sway' in x.get_text())
    times = float(text.split('sway ')[1].split()[0])
    assert times > 1.0
    part = record.machine.scene.oscillators['frame']
    at = patch.get_path().vertices
    for i in screen.frames():
        now = (patch.get_transform() - axes.transData).transform(at)
        x, y, angle = times * true[:, i]
        c, s = math.cos(angle), math.sin(angle)
        wanted = (at - part.cog) @ np.array([[c, s], [-s, c]]) + part.cog + [x, y]
        assert np.abs(now - wanted).max() < 1e-9
        (coils,) = axes.collections[:1]
        for mount, line in zip(part.mounts.values(), coils.get_segments(), strict=True):
            near = np.hypot(*(now - line[0]).T).min()
            rest = np.hypot(*(at - mount.at).T).min()
            assert near == pytest.approx(rest, abs=1e-9)  # it stays on its frame


def test_as_markers_it_goes_as_in_a_film(record, true):
    seen = preview(record.machine)
    times = seen.skeleton.sways['frame']
    cog = np.array(record.machine.scene.oscillators['frame'].cog)
    sway = Swaying(record.machine).take(record.history)
    samples = record.piece.view(T)
    assert not [m for m in shapes(seen.skeleton, '').markers if m.ns == 'frames']
    for i, array in enumerate(ForceMarkers(seen).at(T, samples.observed, samples.modes, sway(T))):
        own = [m for m in array.markers if m.ns == 'frames']
        assert len(own) == 2  # what is filled, and its edge
        for marker in own:
            at, q = marker.pose.position, marker.pose.orientation
            turn = 2.0 * math.atan2(q.z, q.w)
            assert turn == pytest.approx(times * true[2, i], abs=1e-12)
            assert moved(turn, (at.x, at.y), cog) == pytest.approx(times * true[:2, i], abs=1e-9)


def test_in_a_film_a_block_leans_as_its_corners_do():
    """Its corners under the lens are as far from the walls as the gaps of the run."""
    run = simulated('slider_with_play', {'links.slider.cog': ['15 mm', '10 mm']}, duration=0.05)
    t = np.linspace(0.01, 0.045, 6)
    with figures.style():
        screen = Screen(run, t, FilmParts(), 1.0, 480)
    axes = screen.figure.axes[1]
    (body,) = (x for x in axes.patches if x.get_gid() == 'lens-guide')
    told, lean = run.piece.sample(t), []
    for i in screen.frames():
        corners = (body.get_transform() - axes.transData).transform_path(body.get_path()).vertices
        for end, up in (('front', 1.0), ('rear', -1.0)):
            x = [x for x, y in corners if up * y > 0.0]
            gaps = np.array([told[f'gap.guide_{end}_{side}'][i] for side in ('left', 'right')])
            drawn = np.array([1.0 + min(x), 1.0 - max(x)])
            assert drawn == pytest.approx(gaps * drawn.sum() / gaps.sum(), abs=0.02)
        lean.append(gaps[0])
    assert np.ptp(lean) > 1e-4


def test_the_live_view_shows_it_where_all_motion_since_the_start_is_known(record):
    machine = record.machine
    told = motion_messages(machine, [0.05, 0.1, 0.17])
    live, late = Live(describe(machine)), Live(describe(machine))
    times = live.stage.skeleton.sways['frame']
    seen = []
    for message in told:
        live.take(message)
        frames = live.batch()['frames']
        seen.append((unpacked(frames['t']), unpacked(frames['sway'])[:, 0]))
    t, sway = (np.concatenate(x) for x in zip(*seen, strict=True))
    assert t[-1] > T[-1]
    frame = machine.oscillator('frame').take(record.history)
    wanted = frame(np.minimum(t, record.end)).position.T
    assert np.abs(sway - times * wanted).max() < 1e-5 * np.abs(times * wanted).max()
    for message in told[1:]:
        late.take(message)
    assert late.swaying is None
    assert not unpacked(late.batch()['frames']['sway']).any()
    late.take(motion_messages(machine, [0.05], run=1)[0])  # begun anew
    assert late.swaying is not None
    assert unpacked(late.batch()['frames']['sway']).any()
