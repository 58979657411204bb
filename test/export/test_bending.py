"""Drawing of elastic links: bent, magnified by a stated factor, in one piece."""

from __future__ import annotations

import re

import numpy as np
import pytest
from browsing import open_page, scrub
from builders import simulated

import mechanism_sim as ms
from mechanism_sim import output
from mechanism_sim.export.skeleton import Skeleton
from mechanism_sim.pages import report
from mechanism_sim.pages.recorded import recorded
from mechanism_sim.report import drawing, figures
from mechanism_sim.results.cycle import instant


def cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


@pytest.mark.parametrize('factor', [1.0, 30.0])
def test_a_sine_grows_and_its_ends_stay(factor):
    """The middle of the rod is so many times as far off; what is not elastic stays as it is."""
    mechanism = ms.load_scene('elastic_slider_crank').mechanism
    q = np.array([[0.0], [0.0], [0.45], [2e-3], [0.0]])  # crank, rod, slider, bends
    skeleton = Skeleton(mechanism, q, magnified=factor)
    pose = skeleton.poses(q)
    along = np.array([0.0, 0.075, 0.15, 0.3])
    at = skeleton.placed('rod', np.stack([along, 0.0 * along], axis=1), pose)[0]
    assert at[:, 0] == pytest.approx(0.15 + along)
    assert at[:, 1] == pytest.approx(factor * 2e-3 * np.sin(np.pi * along / 0.3), abs=1e-15)
    beside = skeleton.placed('rod', np.array([[0.0, 0.01]]), pose)[0, 0]
    assert beside == pytest.approx([0.15 - 0.01 * factor * 2e-3 * np.pi / 0.3, 0.01])
    assert skeleton.placed('crank', np.array([[0.15, 0.0]]), pose)[0, 0] == pytest.approx(
        [0.15, 0]
    )


@pytest.mark.parametrize('ends', ['pinned', 'clamped'])
def test_joints_hold_what_is_magnified(ends):
    """By the joints' own closure: at 200 times the deflection both pins are where they are."""
    machine = ms.load_scene('elastic_slider_crank', {'links.rod.elastic.ends': ends})
    solution = ms.simulate(machine, duration=0.02)
    q = solution.view(np.linspace(0.0, 0.02, 9)).observed.position
    skeleton = Skeleton(machine.mechanism, q, magnified=200.0)
    poses = skeleton.poses(q)
    for name in ('crank_rod', 'rod_slider'):
        joint = machine.mechanism.joint(name)
        first = skeleton.placed(joint.first, np.array([joint.on_first]), poses)
        second = skeleton.placed(joint.second, np.array([joint.on_second]), poses)
        # but for foreshortening, of second order: (pi w/L)^2 L/4
        assert first == pytest.approx(second, abs=1e-3)
    middle = skeleton.placed('rod', np.array([[0.15, 0.0]]), poses)[:, 0]
    ends_at = [skeleton.placed('rod', np.array([[x, 0.0]]), poses)[:, 0] for x in (0.0, 0.3)]
    chord = ends_at[1] - ends_at[0]
    off = cross(chord, middle - ends_at[0]) / np.hypot(*chord.T)
    true = Skeleton(machine.mechanism, q, magnified=1.0)
    here = true.placed('rod', np.array([[0.15, 0.0]]), poses)[:, 0] - ends_at[0]
    assert off == pytest.approx(200.0 * cross(chord, here) / np.hypot(*chord.T), rel=1e-6)


def test_a_figure_and_its_factor():
    """What bends by a millimetre is seen to; the figure says how much larger it is drawn."""
    found, t = instant(ms.load_scene('elastic_slider_crank'), None, 6e-3, still=True)
    with figures.style():
        axes = drawing.draw(found, t).axes[0]
    (factor,) = re.findall(
        r'bending (\S+) times larger', ' '.join(x.get_text() for x in axes.texts)
    )
    (rod,) = (x for x in axes.patches if x.get_gid() == 'link-rod')
    edge = (rod.get_transform() - axes.transData).transform(rod.get_path().vertices)
    bent = found.at(np.array([t]))['deflection.rod'][0]
    crank = 0.15 * np.exp(1j * 150.0 * t)
    slider = crank.real + np.sqrt(0.3**2 - crank.imag**2)
    chord = slider - crank
    off = ((edge[:, 0] + 1j * edge[:, 1] - crank) / (chord / abs(chord))).imag
    # an edge on either side of the axis
    assert 0.5 * (off.max() + off.min()) == pytest.approx(0.5 * float(factor) * bent, rel=0.05)


@pytest.mark.slow
def test_a_page_bends_them_alike(tab, tmp_path):
    """The rod's edge as the browser has it, against Python's shapes at the same instant."""
    run = recorded(simulated('elastic_slider_crank', duration=0.03))
    file = tmp_path / 'bent.html'
    output.write_text(file, report.page(run))
    open_page(tab, file)
    t = np.linspace(0.0, 0.03, 61)
    most = np.abs(run.record.piece.sample(t, 'deflection.rod')['deflection.rod']).argmax()
    t = scrub(tab.page, most / 60)
    flat, shift, turn = tab.page.locator(
        '#stage .machine g[data-kind=link][data-link=rod]'
    ).evaluate(
        'g => [g.querySelector("path").getAttribute("d"), ...(g.getAttribute("transform")'
        '.match(/\\(([^)]*)\\)/g).map((x) => x.slice(1, -1)))]'
    )
    skeleton = run.stage.skeleton
    unit = skeleton.symbol / 10.0
    drawn = np.array(re.findall(r'[-\d.]+', flat), float).reshape(-1, 2) * [unit, -unit]
    pose = skeleton.poses(run.record.piece.view(np.array([t])).observed.position)
    (shape,) = (s for s in skeleton.shapes if s.kind == 'link' and s.link == 'rod')
    wanted = skeleton.deformed('rod', shape.paths[0].curves[0], pose[0])
    assert drawn == pytest.approx(wanted, abs=0.02 * skeleton.symbol)
    assert np.ptp(drawn[:, 1]) > 2.0 * skeleton.symbol  # a straight bar is 1.1 wide
    x, y = map(float, shift.split())
    assert [run.stage.low[0] + unit * x, run.stage.high[1] - unit * y] == pytest.approx(
        pose[0, 1, :2], abs=0.02 * skeleton.symbol
    )
    assert -np.radians(float(turn)) == pytest.approx(pose[0, 1, 2], abs=1e-3)
    assert 'times larger' in tab.page.locator('#stage .rule text').first.text_content()
    assert tab.complaints == []
