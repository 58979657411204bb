"""Shapes of machines: whatever has a name can be seen, and every viewer shows the same."""

from __future__ import annotations

import math
import re
from itertools import combinations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from matplotlib.path import Path as Outline
from running import ROOT
from textbook import TOOTH_SYSTEMS

import mechanism_sim as ms
from mechanism_sim.catalogue import scene_names
from mechanism_sim.export.bending import scale_bar
from mechanism_sim.export.palette import DARK, LINKS, PAPER, rgb
from mechanism_sim.export.shapes import OPEN, area, circle, simplified
from mechanism_sim.export.skeleton import skeleton_of
from mechanism_sim.export.stage import stage_of
from mechanism_sim.export.triangles import triangles
from mechanism_sim.joints.mesh.involute import Fillet, Gear
from mechanism_sim.nodes.force_markers import painted
from mechanism_sim.planar.mechanism import Prismatic
from mechanism_sim.planar.points import GROUND
from mechanism_sim.report import drawing, figures
from mechanism_sim.results.cycle import instant

TRIANGLES = 11  # of visualization_msgs/msg/Marker

PAGE = ROOT / 'docs' / 'looking.md'
QUICK = ('catapult', 'four_bar_on_frame', 'geneva', 'loader')


def named(machine):
    """Points that the file names, centres of gravity, and those of joints, (link, x, y)."""
    points = machine.scene.links
    found = {
        (link, *machine.plan.points[link][name])
        for link, part in points.items()
        for name in (getattr(part, 'points', None) or {})
    }
    found |= {(b.name, *b.cog) for b in machine.mechanism.bodies if b.mass}
    for joint in machine.mechanism.joints:
        found.add((joint.second, *joint.on_second))
        if not isinstance(joint, Prismatic):  # whose base nothing needs to be at
            found.add((joint.first, *joint.on_first))
    return found


def in_triangles(corners, point, spare):
    """True if a point is in one of triangles (n, 3, 2), or so near to one."""
    way = np.roll(corners, -1, axis=1) - corners
    to = point - corners
    side = way[..., 0] * to[..., 1] - way[..., 1] * to[..., 0]
    return bool((side >= -spare * np.hypot(*np.moveaxis(way, -1, 0))).all(axis=1).any())


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    'scene',
    [
        *QUICK,
        *(pytest.param(x, marks=pytest.mark.slow) for x in scene_names() if x not in QUICK),
    ],
)
def test_every_named_point_is_drawn_by_every_viewer(scene):
    """In the fills of the figure, of the page and of the markers, each by its own data."""
    machine = ms.load_scene(scene)
    found, t = instant(machine, still=True)
    observed = found.solution.view(np.array([t])).observed
    stage = stage_of(machine, found.solution.view(found.t).observed)
    skeleton = stage.skeleton
    (pose,) = skeleton.poses(observed.position)
    with figures.style():
        axes = drawing.draw(found, t).axes[0]
    patches = [
        (x.get_transform() - axes.transData).transform_path(x.get_path())
        for x in axes.patches
        if x.get_facecolor()[3] > 0.0
    ]
    page = stage.to_json()
    flat = [
        (shape['link'], np.array(curves[0]).reshape(-1, 2))
        for shape in page['shapes']
        for style, curves in shape['paths']
        if style not in OPEN
    ]
    fills = [m for _, m, _ in painted(skeleton, '') if m.type == TRIANGLES]
    fans = [
        (m.header.frame_id, np.array([(p.x, p.y) for p in m.points]).reshape(-1, 3, 2))
        for m in fills
    ]
    spare = 0.02 * skeleton.symbol
    for link, x, y in named(machine):
        at = np.array([x, y])
        world = skeleton.placed(link, at[None], pose[None])[0, 0]
        assert any(patch.contains_point(world, radius=spare) for patch in patches), (link, at)
        ten = 10.0 * at / page['symbol']
        own = [curve for owner, curve in flat if owner == link]
        frame = 'world' if link == GROUND else link
        corners = [fan for owner, fan in fans if owner == frame]
        if any(Outline(c).contains_point(ten, radius=0.2) for c in own):
            assert any(in_triangles(c, at, spare) for c in corners), (link, at)
        else:  # beneath the support, or the pin of the other link: where the joint holds it
            others = [
                10.0
                / page['symbol']
                * skeleton.placed(owner, c * page['symbol'] / 10.0, pose[None])[0]
                for owner, c in flat
            ]
            there = 10.0 * world / page['symbol']
            assert any(Outline(c).contains_point(there, radius=0.2) for c in others), (link, at)


def test_the_frame_of_an_oscillator_carries_the_ground_on_its_springs():
    machine = ms.load_scene('four_bar_on_frame')
    skeleton = skeleton_of(machine, machine.assembly.q[:, None])
    (frame,) = (s for s in skeleton.shapes if s.kind == 'frame')
    part = machine.scene.oscillators['frame']
    for at in (part.cog, (0.0, 0.0), (0.387, 0.0), *(m.at for m in part.mounts.values())):
        assert Outline(frame.paths[0].curves[0]).contains_point(at)
    tops = {ends[0][1] for ends in skeleton.springs}
    assert tops == {m.at for m in part.mounts.values()}


@given(
    st.integers(3, 40), st.integers(0, 10**6), st.booleans(),
    st.sampled_from([1e-3, 1.0, 1e3]),
)  # fmt: skip
def test_triangles_fill_what_lies_between_curves(corners, seed, hole, scale):
    """By area (Green's theorem), all counterclockwise; and points at random by crossings."""
    random = np.random.default_rng(seed)
    turn = np.sort(random.uniform(0.0, 2.0 * np.pi, corners)) + 1e-3 * np.arange(corners)
    radii = random.uniform(1.0, 3.0, corners)
    outer = scale * np.stack([radii * np.cos(turn), radii * np.sin(turn)], axis=1)
    assume(area(outer) > 1e-6 * scale**2 and turn[-1] - turn[0] < 6.28)
    around = np.diff(turn, append=turn[0] + 2.0 * np.pi).max() < 2.0  # has its middle inside
    curves = [outer]
    if hole and around:
        curves.append(circle(0.4 * scale, points=17)[::-1])
    found = triangles(curves)
    total = sum(area(c) for c in curves)
    assert sum(area(x) for x in found) == pytest.approx(total, rel=1e-12)
    assert all(area(x) >= 0.0 for x in found)
    for point in random.uniform(-3.0 * scale, 3.0 * scale, (20, 2)):
        inside = sum(Outline(c).contains_point(point) for c in curves) % 2 == 1
        edge = min(np.abs(np.hypot(*(c - point).T)).min() for c in curves) < 1e-6 * scale
        assert edge or inside == in_triangles(found, point, 1e-12 * scale)


@pytest.mark.parametrize('system', TOOTH_SYSTEMS.values(), ids=TOOTH_SYSTEMS)
@pytest.mark.parametrize(('teeth', 'shift'), [(20, 0.0), (45, -0.2), (300, 0.1), (14, 0.5)])
def test_a_fillet_goes_over_into_the_involute_without_a_corner(system, teeth, shift):
    """Place and direction where the rack's arc ends: it lies on the involute, along it."""
    gear = Gear(max(teeth, 14), 2e-3, system, shift)
    if gear.undercut:
        gear = Gear(60, 2e-3, system, shift)
    fillet = Fillet.of(gear)
    drawn = gear.flank(4001, fillet=True)
    radii = np.hypot(*drawn.T)
    assert radii[[0, -1]] == pytest.approx([gear.root_radius, gear.tip_radius], rel=1e-12)
    k = 1999
    assert radii[k] == pytest.approx(fillet.end, rel=1e-12)
    assert math.atan2(*drawn[k, ::-1]) == pytest.approx(gear.half_angle(radii[k]), abs=1e-12)
    before, after = drawn[k] - drawn[k - 1], drawn[k + 1] - drawn[k]
    turn = np.angle((after @ (1.0, 1.0j)) / (before @ (1.0, 1.0j)))
    assert abs(turn) < 5e-3
    assert fillet.end >= gear.base_radius * (1.0 - 1e-12)


# G. M. Machado, M. M. Oliveira, L. A. F. Fernandes, IEEE TVCG 15(6), 2009, severity 1.0
SEEN = {
    'normal': np.eye(3),
    'protanopia': [
        [0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    'deuteranopia': [
        [0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    'tritanopia': [
        [1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}  # fmt: skip
TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
     [0.0193339, 0.1191920, 0.9503041]]
)  # fmt: skip


def linear(shade):
    c = np.array(rgb(shade))
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab(light):
    f = TO_XYZ @ np.clip(light, 0.0, 1.0) / TO_XYZ.sum(axis=1)
    f = np.where(f > 216 / 24389, np.cbrt(f), (24389 / 27 * f + 16) / 116)
    return 116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])


def distance(one, two):
    """CIEDE2000 (G. Sharma, W. Wu, E. N. Dalal, Color Res. Appl. 30(1), 2005, eqs. 2 to 22)."""
    (L1, a1, b1), (L2, a2, b2) = one, two
    C = 0.5 * (math.hypot(a1, b1) + math.hypot(a2, b2))
    grown = 1.0 + 0.5 * (1.0 - math.sqrt(C**7 / (C**7 + 25.0**7)))
    a1, a2 = grown * a1, grown * a2
    C1, C2 = math.hypot(a1, b1), math.hypot(a2, b2)
    h1, h2 = (math.degrees(math.atan2(b, a)) % 360.0 for a, b in ((a1, b1), (a2, b2)))
    dh = (h2 - h1 + 180.0) % 360.0 - 180.0 if C1 * C2 else 0.0
    dH = 2.0 * math.sqrt(C1 * C2) * math.sin(math.radians(0.5 * dh))
    L, C = 0.5 * (L1 + L2), 0.5 * (C1 + C2)
    h = 0.5 * (h1 + h2) if abs(h1 - h2) <= 180.0 else 0.5 * (h1 + h2 + 360.0) % 360.0
    T = 1.0 - 0.17 * math.cos(math.radians(h - 30.0)) + 0.24 * math.cos(math.radians(2.0 * h))
    T += 0.32 * math.cos(math.radians(3.0 * h + 6.0))
    T -= 0.20 * math.cos(math.radians(4.0 * h - 63.0))
    SL = 1.0 + 0.015 * (L - 50.0) ** 2 / math.sqrt(20.0 + (L - 50.0) ** 2)
    SC, SH = 1.0 + 0.045 * C, 1.0 + 0.015 * C * T
    around = math.radians(60.0 * math.exp(-(((h - 275.0) / 25.0) ** 2)))
    RT = -2.0 * math.sqrt(C**7 / (C**7 + 25.0**7)) * math.sin(around)
    dL, dC, dH = (L2 - L1) / SL, (C2 - C1) / SC, dH / SH
    return math.sqrt(dL * dL + dC * dC + dH * dH + RT * dC * dH)


def test_the_measure_of_distance_is_that_of_its_authors():
    """Pairs 1, 7, 17 and 25 of table 1 of Sharma et al."""
    for one, two, wanted in (
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, 0.0, 0.0), (50.0, -1.0, 2.0), 2.3669),
        ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ):
        assert distance(one, two) == pytest.approx(wanted, abs=5e-5)


@pytest.mark.parametrize('vision', SEEN)
@pytest.mark.parametrize('shades', [LINKS, DARK], ids=['paper', 'dark'])
def test_colours_of_links_are_told_apart_by_every_vision(shades, vision):
    seen = [lab(np.array(SEEN[vision]) @ linear(shade)) for shade in shades]
    least = min(distance(*pair) for pair in combinations(seen, 2))
    assert least > 18.0
    (said,) = re.findall(r'colours differ by ([\d.]+) at least', PAGE.read_text(encoding='utf-8'))
    assert round(least, 1) >= float(said)


def test_colours_of_links_stand_out_from_paper():
    """WCAG 2.2, 1.4.11: a contrast of 3."""
    light = {shade: float(TO_XYZ[1] @ linear(shade)) for shade in (*LINKS, PAPER)}
    for shade in LINKS:
        assert (light[PAPER] + 0.05) / (light[shade] + 0.05) >= 3.0
    night = float(TO_XYZ[1] @ linear('#15191e'))
    for shade in DARK:
        assert (float(TO_XYZ[1] @ linear(shade)) + 0.05) / (night + 0.05) >= 3.0


@given(st.floats(1e-5, 1e4))
def test_a_scale_bar_is_round_and_fits(width):
    length, text = scale_bar(width)
    assert 0.08 * width < length <= 0.2 * width * (1 + 1e-12)
    number, unit = text.split()
    assert float(number) * {'m': 1.0, 'mm': 1e-3, 'µm': 1e-6}[unit] == pytest.approx(
        length, rel=1e-9
    )
    assert number.strip('0.')[:1] in {'1', '2', '5'}


@given(st.integers(3, 200), st.floats(1e-4, 0.5), st.integers(0, 10**6))
def test_a_simplified_curve_is_nowhere_farther_off_than_said(count, tolerance, seed):
    random = np.random.default_rng(seed)
    turn = np.sort(random.uniform(0.0, 2.0 * np.pi, count))
    curve = random.uniform(0.5, 1.5, (count, 1)) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    found = simplified(curve, tolerance)
    assert len(found) >= 2
    assert {tuple(p) for p in found.tolist()} <= {tuple(p) for p in curve.tolist()}
    ends = np.roll(found, -1, axis=0)
    for point in curve:
        way, to = ends - found, point - found
        long = (way**2).sum(axis=1)
        share = np.clip((to * way).sum(axis=1) / np.where(long > 0.0, long, 1.0), 0.0, 1.0)
        assert np.hypot(*(to - share[:, None] * way).T).min() <= tolerance * (1.0 + 1e-9)
