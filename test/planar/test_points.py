"""The two ways in which points are known: in numbers (`trace`) and in symbols (`Frames`)."""

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.numerics.compiled import Evaluation
from mechanism_sim.numerics.symbolic import add, dense, mul
from mechanism_sim.planar.frames import Frames, Parameters


def in_symbols(mechanism, point, q, v, a):
    """Position, velocity and acceleration (3, 2, N) from compiled expressions."""
    frames = Frames(mechanism.coordinates, Parameters())
    jets = frames.position(point, 'point')
    pulls = [add(*(mul(s, frames.a[c]) for c, s in x.gradient.items()), x.curvature) for x in jets]
    rows = [[x.value for x in jets], [x.rate for x in jets], pulls]
    motion = [*frames.q.values(), *frames.v.values(), *frames.a.values()]
    terms = [dense(x) for row in rows for x in row]
    (found,) = Evaluation(terms, motion, frames.parameters.values, [6])(np.concatenate([q, v, a]))
    return found.reshape(3, 2, -1)


@pytest.mark.parametrize(
    'scene', ['ten_links', 'four_bar_elastic', 'four_bar_misaligned', 'overhung_rotor']
)
def test_points_move_alike_in_numbers_and_in_symbols(scene):
    mechanism = ms.load_scene(scene).mechanism
    q, v, a = np.random.default_rng(3).normal(0.0, 0.3, (3, len(mechanism.coordinates), 5))
    for joint in mechanism.joints:
        for link, at in joint.points:
            point = mechanism.point(link, at)
            found = mechanism.trace((link, at), q, v, a)
            expected = in_symbols(mechanism, point, q, v, a)
            np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)
            np.testing.assert_array_equal(found[0], mechanism.locate_all(link, q, at))
