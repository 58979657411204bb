"""The ratio of drawn teeth: turn one gear, then the other one until its teeth touch.

Nothing is known here of lines of action, common normals or contact ratios. All teeth near the
line of centres take part, so that contact is handed over from tooth to tooth.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize_scalar
from textbook import TOOTH_SYSTEMS

from mechanism_sim.joints.mesh.involute import Gear
from mechanism_sim.joints.mesh.pair import Pair

M = 2e-3
FAR = 1e3
NEAR = range(-2, 3)  # teeth, from the one on the line of centres
RING = Gear(60, M, internal=True)
NOMINAL = Pair(Gear(20, M), Gear(31, M))
PAIRS = {
    'nominal': NOMINAL,
    'farther apart': Pair(Gear(20, M), Gear(31, M), NOMINAL.centre_distance + 0.2e-3),
    'as far apart as it goes': Pair(Gear(20, M), Gear(31, M), NOMINAL.centre_distance + 1e-3),
    'shifted': Pair(Gear(14, M, shift=0.3), Gear(40, M, shift=-0.1)),
    '25 deg': Pair(Gear(18, M, TOOTH_SYSTEMS['full 25']), Gear(18, M, TOOTH_SYSTEMS['full 25'])),
    'stub': Pair(Gear(15, M, TOOTH_SYSTEMS['stub 20']), Gear(52, M, TOOTH_SYSTEMS['stub 20'])),
    'internal': Pair(Gear(22, M), RING),
    'internal, closer': Pair(Gear(22, M), RING, 37.8e-3),
    'internal, shifted': Pair(Gear(20, M, shift=0.2), Gear(65, M, shift=0.5, internal=True)),
}


class Flank:
    """A smooth curve through the points drawn of a tooth's upper flank, complex, root to tip."""

    def __init__(self, gear):
        points = gear.flank(60)
        if not gear.internal and gear.root_radius < gear.base_radius:
            points = points[1:]  # the radius at the root is no part of the involute
        self.curve = make_interp_spline(np.linspace(0.0, 1.0, len(points)), points / M, k=7)

    def __call__(self, u):
        return self.curve(u) @ (1.0, 1.0j)

    def angle(self, radius):
        """Of the points at radii, nan where there are none."""
        u = np.linspace(0.0, 1.0, 501)
        radii = np.abs(self(u))
        order = np.argsort(radii)
        found = np.interp(radius, radii[order], u[order], left=np.nan, right=np.nan)
        slope = self.curve.derivative()
        for _ in range(4):
            z, along = self(found), slope(found) @ (1.0, 1.0j)
            found = found - (np.abs(z) - radius) * np.abs(z) / (z.conj() * along).real
        inside = (found > 1e-3) & (found < 1.0)
        return np.where(inside, np.angle(self(np.where(inside, found, 0.5))), np.nan)


def least(function):
    """The least value of ``function(u, tooth)`` on (0, 1) and of all teeth near.

    Where it is nan, there is nothing to touch.
    """

    def full(u, tooth):
        return np.nan_to_num(function(np.atleast_1d(u), tooth), nan=FAR)

    u = np.linspace(0.0, 1.0, 201)
    coarse = {k: full(u, k) for k in NEAR}
    lowest = min(values.min() for values in coarse.values())
    found = [lowest]
    for tooth, values in coarse.items():
        i = int(np.argmin(values))
        if values[i] < lowest + 0.01:
            fine = minimize_scalar(
                lambda x, k=tooth: float(full(x, k)[0]),
                bounds=(u[max(i - 1, 0)], u[min(i + 1, len(u) - 1)]),
                method='bounded',
                options={'xatol': 1e-8},
            )
            found.append(fine.fun)
    return min(found)


def touching_angle(pair, flanks, turn):
    """Angle by which the wheel can be turned at `turn` of the pinion until teeth touch."""
    one, two = flanks
    internal = pair.wheel.internal
    # the wheel's centre; teeth of an external wheel point towards the pinion, at half a turn
    centre = pair.centre_distance / M * (-1 if internal else 1)
    facing = 0.0 if internal else math.pi

    def limit(u, tooth):
        z = one(u) * np.exp(1j * (turn + 2 * math.pi * tooth / pair.pinion.teeth)) - centre
        # an internal tooth is touched on its lower flank
        own = two.angle(np.abs(z)) * (-1 if internal else 1)
        partner = (1 if internal else -1) * 2 * math.pi * tooth / pair.wheel.teeth
        around = np.angle(z * np.exp(-1j * (facing + own + partner)))
        return -around if internal else around

    angle = least(limit)
    return -angle if internal else angle


def driven(pair, turns, flanks=None):
    """Angles of the wheel, divided by the pinion's share of teeth, at angles of the pinion."""
    flanks = flanks or (Flank(pair.pinion), Flank(pair.wheel))
    angles = np.array([touching_angle(pair, flanks, t) for t in turns])
    return angles * pair.wheel.teeth / pair.pinion.teeth * (1 if pair.wheel.internal else -1)


def some_turns(teeth):
    """Over two pitches, not in step with them."""
    return np.linspace(-2 * math.pi / teeth, 2 * math.pi / teeth, 16) + 1e-3


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', PAIRS)
def test_the_ratio_of_drawn_teeth_is_constant(name):
    pair = PAIRS[name]
    turns = some_turns(pair.pinion.teeth)
    found = driven(pair, turns)
    assert np.ptp(found - turns) < 1e-9 * np.ptp(turns)
    assert np.diff(found) / np.diff(turns) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize('name', PAIRS)
def test_both_flanks_together_leave_the_backlash(name):
    """Mirrored, the flanks on the other side touch after the free way."""
    pair = PAIRS[name]
    (ahead,) = driven(pair, [0.0])
    tooth_and_space = 2 * math.pi / pair.pinion.teeth
    # a tooth of each stands on the line of centres: half a pitch is taken off by symmetry
    free = abs(tooth_and_space - 2 * abs(ahead)) * pair.pitch_radii[0]
    assert free == pytest.approx(pair.backlash, abs=1e-9 * M)


def test_other_curves_are_not_conjugate():
    """The search tells: teeth of another pressure angle, or circles instead of involutes."""
    pair = NOMINAL
    turns = some_turns(20)
    other = Flank(Gear(31, M, TOOTH_SYSTEMS['full 22.5']))
    off = driven(pair, turns, (Flank(pair.pinion), other)) - turns
    assert np.ptp(off) > 1e-4
    three = Flank(pair.wheel)
    u = np.linspace(0.0, 1.0, 60)
    # a parabola through three points of the involute, about as good as a circle
    points = np.stack([three(u).real, three(u).imag], axis=1)
    arc = np.polynomial.Polynomial.fit(points[[0, 29, 59], 0], points[[0, 29, 59], 1], 2)
    points[:, 1] = arc(points[:, 0])
    three.curve = make_interp_spline(u, points, k=7)
    off = driven(pair, turns, (Flank(pair.pinion), three)) - turns
    assert np.ptp(off) > 1e-5


@pytest.mark.parametrize('shift', [0.0, 0.3])
@pytest.mark.parametrize('apart', [0.0, 0.3e-3])
def test_a_rack_moves_evenly_with_the_drawn_gear(shift, apart):
    """Its flank is straight; moved outwards, it still moves by the pitch radius."""
    gear = Gear(22, M, shift=shift)
    flank, slope = Flank(gear), math.tan(gear.system.pressure_angle)
    r = gear.pitch_radius / M
    line = r + shift + apart / M
    turns = some_turns(22)
    # from the rack's tips to its roots
    height = np.array([line - gear.system.addendum, line + gear.system.dedendum])
    drawn = (line - height) * slope

    def place(turn):
        def lag(u, tooth):
            z = flank(u) * np.exp(1j * (turn + 2 * math.pi * tooth / gear.teeth))
            at = np.interp(z.real, height, drawn, left=np.nan, right=np.nan)
            return at - z.imag + math.pi * tooth

        return -least(lag)

    places = np.array([place(t) for t in turns])
    assert np.ptp(places - r * turns) < 1e-9 * r * np.ptp(turns)
    # a tooth on the pitch line is half a pitch thick; play opens by twice the slope
    middle = places[0] - r * turns[0]
    assert middle == pytest.approx(math.pi / 4 - apart / M * slope, abs=1e-9)
