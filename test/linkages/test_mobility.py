"""Degrees of freedom: the examples of [V] 1.5, and others where counting goes wrong."""

from __future__ import annotations

import numpy as np
import pytest

from mechanism_sim.joints.slot.constraint import PinInSlot
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.mobility import kutzbach, mobility
from mechanism_sim.planar.configuration import Constraints
from mechanism_sim.planar.mechanism import Prismatic, Revolute


class Drawing:
    """A mechanism as it is drawn: every link unturned at its first point, joints at points.

    The frames of links are turned and moved at random, so that nothing rests on them.
    """

    def __init__(self, seed=1):
        self.random = np.random.default_rng(seed)
        self.poses = {'ground': np.zeros(3)}
        self.joints = []

    def link(self, *names):
        self.poses |= {name: self.random.uniform(-1.0, 1.0, 3) for name in names}
        return self

    def local(self, link, at):
        x, y, angle = self.poses[link]
        z = (complex(*at) - complex(x, y)) * np.exp(-1j * angle)
        return z.real, z.imag

    def _ends(self, a, b, at):
        for link in (a, b):
            if link not in self.poses:
                self.link(link)
        name = f'{a}_{b}'
        taken = sum(j.name.startswith(name) for j in self.joints)
        name += f'_{taken + 1}' if taken else ''
        return name, a, b, self.local(a, at), self.local(b, at)

    def pin(self, a, b, *at):
        self.joints.append(Revolute(*self._ends(a, b, at)))
        return self

    def slide(self, a, b, at, angle):
        ends = self._ends(a, b, at)
        tilt = self.poses[a][2]
        self.joints.append(Prismatic(*ends, angle - tilt, self.poses[b][2] - tilt))
        return self

    def slot(self, a, b, at, angle):
        """A pin of link a at a point in a slot of link b."""
        ends = self._ends(a, b, at)
        self.joints.append(PinInSlot(*ends, angle - self.poses[b][2]))
        return self

    @property
    def constraints(self):
        return Constraints(tuple(x for x in self.poses if x != 'ground'), tuple(self.joints))

    def count(self):
        rows = [pose for link, pose in self.poses.items() if link != 'ground']
        return mobility(self.constraints, np.array(rows))

    def freedoms(self):
        """Kutzbach's count, what can begin to move, what goes on moving."""
        return self.count()[:3]


def chain(*points):
    """A closed chain of links pinned at points; the ground joins the last to the first."""
    drawing = Drawing()
    links = ['ground', *(f'link{i}' for i in range(2, len(points) + 1)), 'ground']
    for a, b, at in zip(links, links[1:], points, strict=False):
        drawing.pin(a, b, *at)
    return drawing


FOUR_BAR = ((0.0, 0.0), (0.3, 0.9), (2.2, 1.6), (2.5, 0.1))


def test_kutzbach_is_equation_1_1():
    assert kutzbach(4, 4) == 1
    assert kutzbach(4, 3, 1) == 2
    assert kutzbach(6, 8) == -1
    assert kutzbach(2, 0) == 3


def test_figure_1_7_two_links_free_welded_and_pinned():
    assert Drawing().link('a').freedoms() == (3, 3, 3)
    assert Drawing().link('a', 'b').freedoms() == (6, 6, 6)
    assert Drawing().pin('a', 'b', 0.4, 0.7).freedoms() == (4, 4, 4)
    assert Drawing().slide('a', 'b', (0.4, 0.7), 0.3).freedoms() == (4, 4, 4)


def test_figure_1_8_a_roller_that_rolls_and_slides_on_a_cam():
    assert Drawing().slot('roller', 'cam', (0.4, 0.7), 0.3).freedoms() == (5, 5, 5)


def test_figure_1_9_triangle_four_bar_slider_crank_and_five_bar():
    a, b, c, d = FOUR_BAR
    assert chain(a, b, c).freedoms() == (0, 0, 0)
    assert chain(a, b, c, d).freedoms() == (1, 1, 1)
    slider_crank = Drawing().pin('ground', 'crank', *a).pin('crank', 'rod', *b)
    slider_crank.pin('rod', 'slider', *c).slide('ground', 'slider', c, 0.2)
    assert slider_crank.freedoms() == (1, 1, 1)
    assert chain(a, b, c, (2.9, 0.9), d).freedoms() == (2, 2, 2)


def test_figure_1_10_a_link_more_and_another():
    """Links between crank and rocker, then between crank and ground, at points of no symmetry."""
    drawing = chain(*FOUR_BAR)
    assert drawing.freedoms() == (1, 1, 1)
    drawing.pin('link2', 'fifth', 0.1, 0.5).pin('fifth', 'link4', 2.6, 0.8)
    assert drawing.freedoms() == (0, 0, 0)
    drawing.pin('link2', 'sixth', 0.4, 0.3).pin('sixth', 'link4', 2.1, 1.1)
    seen = drawing.count()
    assert seen[:3] == (-1, 0, 0)
    assert seen.redundancy == 1
    assert len(seen.redundant) == len(drawing.joints)


def test_figure_1_11_slipping_only_and_slipping_with_rolling():
    a, b, c, _ = FOUR_BAR
    slipping = Drawing().pin('ground', 'crank', *a).pin('crank', 'rod', *b)
    slipping.pin('rod', 'block', *c).slide('ground', 'block', c, 0.0)
    assert slipping.freedoms() == (1, 1, 1)
    rolling = Drawing().pin('ground', 'crank', *a).pin('crank', 'rod', *b)
    rolling.pin('rod', 'roller', *c).slot('roller', 'ground', c, 0.0)
    assert rolling.freedoms() == (2, 2, 2)


@pytest.mark.parametrize(
    ('tops', 'freedoms'),
    [
        (((0.3, 1.0), (2.1, 1.5), (1.2, 1.1)), (0, 0, 0)),  # Figure 1.12a: not parallel
        (((0.3, 1.0), (2.3, 1.0), (1.3, 1.0)), (0, 1, 1)),  # Figure 1.12b: parallel and equal
    ],
)
def test_figure_1_12_three_links_carry_a_fourth(tops, freedoms):
    drawing = Drawing()
    for link, x, top in zip(('two', 'four', 'five'), (0.0, 2.0, 1.0), tops, strict=True):
        drawing.pin('ground', link, x, 0.0).pin(link, 'three', *top)
    seen = drawing.count()
    assert seen[:3] == freedoms
    assert seen.redundant == (tuple(j.name for j in drawing.joints) if freedoms[1] else ())


def test_parallel_links_of_different_lengths_only_begin_to_move():
    drawing = Drawing()
    for link, x, top in zip(
        ('two', 'four', 'five'), (0.0, 2.0, 1.0), (1.0, 1.6, 1.2), strict=True
    ):
        drawing.pin('ground', link, x, 0.0).pin(link, 'three', x, top)
    assert drawing.freedoms() == (0, 1, 0)


def test_figure_1_13_two_four_bars_and_a_joint_that_counts_twice():
    a, b, c, d = FOUR_BAR
    drawing = chain(a, b, c, d).pin('link4', 'link5', *c)
    drawing.pin('link5', 'link6', 4.0, 1.2).pin('link6', 'ground', 4.1, -0.2)
    assert len(drawing.joints) == 7
    assert drawing.freedoms() == (1, 1, 1)
    b_alone = Drawing().pin('a', 'b', 0.2, 0.3).pin('b', 'c', 0.2, 0.3)
    assert b_alone.freedoms() == (5, 5, 5)


def test_a_stretched_pair_of_links_only_begins_to_move():
    """It is a triangle without height: a structure, but a soft one."""
    assert chain((0.0, 0.0), (1.0, 0.0), (3.0, 0.0)).freedoms() == (0, 1, 0)


def test_a_structure_that_is_soft_wherever_it_goes():
    """A stretched pair on the coupler: the rank is short by one all along the motion."""
    drawing = chain(*FOUR_BAR)
    drawing.pin('link3', 'left', 0.5, 1.2).pin('left', 'right', 0.9, 1.5)
    drawing.pin('right', 'link3', 1.3, 1.8)
    assert drawing.freedoms() == (1, 2, 1)


def test_a_parallelogram_in_line_chooses_between_two_motions():
    assert chain((0.0, 0.0), (1.0, 0.0), (3.0, 0.0), (2.0, 0.0)).freedoms() == (1, 2, 1)


@pytest.mark.parametrize('count', [9, pytest.param(60, marks=pytest.mark.slow)])
def test_four_joints_in_line_go_on_unless_one_link_spans_the_others(count):
    random = np.random.default_rng(0)
    spanned = 0
    for _ in range(count):
        xs = random.uniform(-1.0, 1.0, 4)
        lengths = np.abs(np.diff([*xs, xs[0]]))
        rigid = 2.0 * lengths.max() - lengths.sum() > -1e-12
        assert chain(*((float(x), 0.0) for x in xs)).freedoms() == (1, 2, 0 if rigid else 1)
        spanned += rigid
    assert count / 6 < spanned < count / 2


def test_three_parallel_links_in_line_have_one_way_on():
    """Two motions can begin; of the two that two links would have, the third allows one."""
    drawing = Drawing()
    for link, x in zip(('two', 'four', 'five'), (0.0, 2.0, 1.2), strict=True):
        drawing.pin('ground', link, x, 0.0).pin(link, 'three', x + 1.0, 0.0)
    assert drawing.freedoms() == (0, 2, 1)


def test_a_five_bar_in_line_loses_no_motion_but_a_stretched_one_all():
    assert chain((0.0, 0.0), (1.0, 0.0), (3.0, 0.0), (2.0, 0.0), (2.5, 0.0)).freedoms() == (
        2,
        3,
        2,
    )
    assert chain(*((x, 0.0) for x in (0.0, 1.0, 2.0, 3.0, 4.0))).freedoms() == (2, 3, 0)


def test_a_kite_folded_up_chooses_too():
    """Both pins of the rocker's end and the crank's pivot coincide."""
    assert chain((0.0, 0.0), (1.0, 0.0), (1.7, 0.0), (1.0, 0.0)).freedoms() == (1, 2, 1)


def test_dead_points_of_a_slider_are_not_singular_for_the_crank():
    drawing = Drawing().pin('ground', 'crank', 0.0, 0.0).pin('crank', 'rod', 1.0, 0.0)
    drawing.pin('rod', 'slider', 4.0, 0.0).slide('ground', 'slider', (4.0, 0.0), 0.0)
    assert drawing.freedoms() == (1, 1, 1)


def test_three_slides_move_although_kutzbach_says_no():
    """A wedge mechanism: no angle can change, so one equation of angles is said twice."""
    drawing = Drawing().slide('ground', 'wedge', (0.0, 0.0), 0.0)
    drawing.slide('wedge', 'stem', (0.2, 0.3), 0.6).slide('stem', 'ground', (0.4, 0.8), 1.4)
    seen = drawing.count()
    assert seen[:3] == (0, 1, 1)
    assert seen.redundant == ('ground_wedge', 'wedge_stem', 'stem_ground')


def test_elliptic_trammel_by_slots_and_by_blocks():
    slots = Drawing().slot('bar', 'ground', (0.7, 0.0), 0.0)
    slots.slot('bar', 'ground', (0.0, 1.1), np.pi / 2)
    assert slots.freedoms() == (1, 1, 1)
    blocks = Drawing().slide('ground', 'low', (0.7, 0.0), 0.0).pin('low', 'bar', 0.7, 0.0)
    blocks.slide('ground', 'high', (0.0, 1.1), np.pi / 2).pin('high', 'bar', 0.0, 1.1)
    assert blocks.freedoms() == (1, 1, 1)


@pytest.mark.slow
def test_dyads_add_nothing_to_the_freedoms_of_an_open_chain():
    """Assur's groups, at points of no special position: what is known without counting."""
    random = np.random.default_rng(5)
    for seed in range(30):
        drawing, links = Drawing(seed), ['ground']
        freedoms = int(random.integers(1, 4))
        for i in range(freedoms):
            old, new, at = random.choice(links), f'open{i}', random.uniform(-2.0, 2.0, 2)
            if random.random() < 0.3:
                drawing.slide(old, new, at, random.uniform(0.0, 3.0))
            else:
                drawing.pin(old, new, *at)
            links.append(new)
        for i in range(int(random.integers(1, 5))):
            a, b = random.choice(links, 2, replace=False)
            c, d = f'dyad{i}', f'end{i}'
            drawing.pin(a, c, *random.uniform(-2.0, 2.0, 2))
            at = random.uniform(-2.0, 2.0, 2)
            if random.random() < 0.5:
                drawing.pin(c, d, *at).pin(d, b, *random.uniform(-2.0, 2.0, 2))
            elif random.random() < 0.5:
                drawing.pin(c, d, *at).slide(b, d, at, random.uniform(0.0, 3.0))
            else:
                drawing.slot(c, b, at, random.uniform(0.0, 3.0)).pin(c, d, *at)
                drawing.slot(d, b, random.uniform(-2.0, 2.0, 2), random.uniform(0.0, 3.0))
            links += [c, d]
        seen = drawing.count()
        assert seen[:3] == (freedoms,) * 3
        assert seen.redundant == ()


def test_jacobian_is_the_derivative_of_the_residual():
    drawing = chain(*FOUR_BAR).slot('link3', 'block', (1.0, 1.0), 0.3)
    drawing.slide('link4', 'block', (1.0, 1.0), 0.9)
    constraints = drawing.constraints
    poses = np.random.default_rng(3).uniform(-1.0, 1.0, (len(constraints.links), 3))
    jacobian = constraints.linearise(poses)[1]
    assert jacobian.shape == (11, 12)
    assert constraints.rows[-3:] == ('link3_block', 'link4_block', 'link4_block')
    h = 1e-5
    for k in range(poses.size):
        step = np.zeros(poses.size)
        step[k] = h
        step = step.reshape(poses.shape)
        change = constraints.linearise(poses + step)[0] - constraints.linearise(poses - step)[0]
        assert np.abs(change / (2.0 * h) - jacobian[:, k]).max() < 1e-9


def test_rank_does_not_depend_on_units():
    for unit in (1e-6, 1.0, 1e3):
        scaled = [(x * unit, y * unit) for x, y in FOUR_BAR]
        drawing = Drawing()
        drawing.poses |= {f'link{i}': np.array([0.0, 0.0, i]) for i in (2, 3, 4)}
        links = ['ground', 'link2', 'link3', 'link4', 'ground']
        for a, b, at in zip(links, links[1:], scaled, strict=False):
            drawing.pin(a, b, *at)
        assert drawing.freedoms() == (1, 1, 1)


def test_a_mechanism_that_is_not_assembled_is_refused():
    drawing = chain(*FOUR_BAR)
    poses = np.array([p for link, p in drawing.poses.items() if link != 'ground'])
    poses[2, 0] += 0.01
    with pytest.raises(ValueError, match='not assembled: the links of link3_link4'):
        mobility(drawing.constraints, poses)


def test_residual_vanishes_where_the_closed_form_says():
    f = FourBar(4.0, 1.0, 6.0, 5.0)
    joints = (
        Revolute('a', 'ground', 'crank', (0.0, 0.0), (0.0, 0.0)),
        Revolute('b', 'crank', 'coupler', (1.0, 0.0), (0.0, 0.0)),
        Revolute('c', 'coupler', 'rocker', (6.0, 0.0), (5.0, 0.0)),
        Revolute('d', 'rocker', 'ground', (0.0, 0.0), (4.0, 0.0)),
        Prismatic('e', 'ground', 'crank', (0.0, 0.0), (0.0, 0.0), 0.2, 0.7 - 2.0 * np.pi),
    )
    th3, th4 = f.positions(np.array([0.7]))
    poses = [[0.0, 0.0, 0.7], [np.cos(0.7), np.sin(0.7), th3[0]], [4.0, 0.0, th4[0]]]
    constraints = Constraints(('crank', 'coupler', 'rocker'), joints)
    assert np.abs(constraints.linearise(np.array(poses))[0]).max() < 1e-14
    assert constraints.size == 6.0
