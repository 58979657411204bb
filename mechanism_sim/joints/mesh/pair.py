"""Two involute gears, or a gear and a rack, in mesh: centre distance, path of contact, losses.

Along the line of action places are counted from the pitch point, in the direction in which the
contact moves: it starts (negative, but for large profile shifts) at a tip of the wheel and ends at
a tip of the pinion, which drives.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

from mechanism_sim.errors import InputError
from mechanism_sim.joints.mesh.involute import Gear, inv, inverse_inv, rounded_up


class Path(NamedTuple):
    """Start and end of contact on the line of action [m] from the pitch point."""

    start: float
    end: float


@dataclass(frozen=True)
class Pair:
    """A pinion and a wheel, which may be internal.

    Parameters
    ----------
    pinion, wheel : of one module and pressure angle
    centre_distance : C [m]; without it, that of no backlash
    """

    pinion: Gear
    wheel: Gear
    centre_distance: float = math.nan

    def __post_init__(self) -> None:
        one, two = self.pinion, self.wheel
        if one.internal:
            raise InputError('the pinion is the gear with external teeth')
        if two.internal and two.teeth <= one.teeth:
            raise InputError('an internal wheel has more teeth than its pinion')
        if one.module != two.module:
            raise InputError(f'modules {one.module:g} m and {two.module:g} m do not mesh')
        if one.system.pressure_angle != two.system.pressure_angle:
            raise InputError('gears of different pressure angles do not mesh')
        if math.isnan(self.centre_distance):
            object.__setattr__(self, 'centre_distance', self.tight_distance)
        if not self.centre_distance > two.base_radius + self._side * one.base_radius:
            raise InputError('at this centre distance the base circles have no common tangent')
        if self.backlash < -1e-12 * one.module:
            raise InputError(
                f'the teeth jam: without backlash the centre distance is {self.tight_distance:g} m'
            )
        if min(self.clearances) < -1e-12 * one.module:
            raise InputError('the tips of one gear touch the roots of the other')
        start, end = self.path
        if self.contact_ratio < 1.0:
            cut = [
                f'the gear of {g.teeth} teeth is undercut up to a profile shift of '
                f'{rounded_up(g.least_shift)} modules in the plane of rotation'
                for g in (one, two)
                if g.undercut
            ]
            raise InputError(
                'a pair of teeth separates before the next one engages: the contact ratio is '
                f'{"; ".join([f"{self.contact_ratio:.4g}", *cut])}{self._cure() if cut else ""}'
            )
        if start < -self._reach(one) * (1.0 + 1e-12) and not one.undercut:
            raise InputError('the tips of the wheel reach inside the base circle of the pinion')
        if not two.internal and end > self._reach(two) * (1.0 + 1e-12) and not two.undercut:
            raise InputError('the tips of the pinion reach inside the base circle of the wheel')

        if two.internal and self._tips_meet:
            raise InputError(
                f'the tips of {one.teeth} and {two.teeth} internal teeth meet on their way out: '
                f'the numbers differ too little'
            )

    def _cure(self) -> str:
        """Profile shifts that end undercut, if the pair meshes with them, and their distance.

        What one gear gains the other gives, as far as it is not undercut itself.
        """
        gears = self.pinion, self.wheel
        first, second = (rounded_up(g.least_shift) if g.undercut else g.shift for g in gears)
        if not self.wheel.undercut:
            gain = first - self.pinion.shift
            least = -math.inf if self.wheel.internal else rounded_up(self.wheel.least_shift)
            second = max(self.wheel.shift - self._side * gain, least)
        elif not self.pinion.undercut:
            gain = second - self.wheel.shift
            first = max(self.pinion.shift - gain, rounded_up(self.pinion.least_shift))
        try:
            cured = Pair(replace(self.pinion, shift=first), replace(self.wheel, shift=second))
        except InputError:
            return '; take more teeth'
        return (
            f'; shifts of {first:.4f} and {second:.4f} such modules end it at a centre distance '
            f'of {cured.centre_distance:.9g} m'
        )

    @property
    def _tips_meet(self) -> bool:
        """True if a tip of the pinion leaves an internal wheel through the tip of a tooth.

        Followed from the pitch point on: there the flanks touch, and turned until the pinion's
        corner is where the tip circles cross, it must not have overtaken the wheel's corner.
        """
        one, two, c = self.pinion, self.wheel, self.centre_distance
        a, b = one.tip_radius, two.tip_radius
        cosines = (b**2 - a**2 - c**2) / (2 * c * a), (b**2 - a**2 + c**2) / (2 * c * b)
        if max(map(abs, cosines)) > 1.0:
            return True
        working = inv(self.pressure_angle)
        turn = math.acos(cosines[0]) + inv(one.profile_angle(a)) - working
        corner = working - inv(two.profile_angle(b)) + turn * one.teeth / two.teeth
        return math.acos(cosines[1]) > corner

    @property
    def _side(self) -> int:
        return -1 if self.wheel.internal else 1

    def _reach(self, gear: Gear) -> float:
        """Length of the line of action from the pitch point to a base circle [m]."""
        return gear.base_radius * math.tan(self.pressure_angle)

    @property
    def ratio(self) -> float:
        """Speed of the pinion over that of the wheel, [V] eq. 5.7; negative for external gears."""
        return -self._side * self.wheel.teeth / self.pinion.teeth

    @property
    def tight_distance(self) -> float:
        """Centre distance without backlash [m]: inv phi_w = inv phi + 2 tan phi (x3+x2)/(N3+N2).

        For an internal wheel with differences instead of sums.
        """
        one, two, side = self.pinion, self.wheel, self._side
        pressure = one.system.pressure_angle
        shifts, teeth = two.shift + side * one.shift, two.teeth + side * one.teeth
        value = inv(pressure) + 2.0 * math.tan(pressure) * shifts / teeth
        if value < 0.0:
            raise InputError(
                f'with profile shifts of {one.shift:g} and {two.shift:g} modules no centre '
                'distance is without backlash: take larger ones'
            )
        working = inverse_inv(value)
        return (two.base_radius + side * one.base_radius) / math.cos(working)

    @property
    def pressure_angle(self) -> float:
        """Working pressure angle [rad], [V] eqs. 5.10, 5.31."""
        bases = self.wheel.base_radius + self._side * self.pinion.base_radius
        return math.acos(bases / self.centre_distance)

    @property
    def pitch_radii(self) -> tuple[float, float]:
        """Working pitch radii [m] of pinion and wheel."""
        cosine = math.cos(self.pressure_angle)
        return self.pinion.base_radius / cosine, self.wheel.base_radius / cosine

    @property
    def backlash(self) -> float:
        """Free travel [m] along the working pitch circles: pitch less both thicknesses."""
        one, two = self.pitch_radii
        pitch = 2.0 * math.pi * one / self.pinion.teeth
        return pitch - self.pinion.thickness(one) - self.wheel.thickness(two)

    @property
    def clearances(self) -> tuple[float, float]:
        """Between tips and roots [m]: at the pinion's roots, at the wheel's roots."""
        one, two, side = self.pinion, self.wheel, self._side
        return (
            side * (self.centre_distance - two.tip_radius) - one.root_radius,
            side * (self.centre_distance - two.root_radius) - one.tip_radius,
        )

    @property
    def path(self) -> Path:
        """Path of contact; of undercut teeth it begins where their involute does."""
        one, two = self.pinion, self.wheel
        start = self._side * (self._reach(two) - two.tangent(two.tip_radius))
        end = one.tangent(one.tip_radius) - self._reach(one)
        if one.undercut:
            start = max(start, one.tangent(one.form_radius) - self._reach(one))
        if two.undercut:
            end = min(end, self._reach(two) - two.tangent(two.form_radius))
        return Path(start, end)

    @property
    def contact_ratio(self) -> float:
        """Path of contact over base pitch: how many pairs of teeth touch in the mean."""
        start, end = self.path
        return (end - start) / self.pinion.base_pitch

    def efficiency(self, friction: float) -> float:
        """Mean efficiency for a coefficient of friction, to its first order.

        The n pairs of teeth in contact share the normal force F equally and slide at
        (w2 + w3) |s|, s from the pitch point (w3 - w2 for an internal wheel): with the base pitch
        p the loss is 2 pi mu (1/N2 + 1/N3)/p^2 times the integral of |s|/n along the path. Helical
        teeth have `PlacedMesh.friction_share` of the coefficient.
        """
        if not 0.0 <= friction < math.inf:
            raise InputError('a coefficient of friction is not negative')
        sliding = 1.0 / self.pinion.teeth + self._side / self.wheel.teeth
        pitch = self.pinion.base_pitch
        return 1.0 - 2.0 * math.pi * friction * sliding * sliding_arm(self.path, pitch) / pitch


def sliding_arm(path: Path, pitch: float) -> float:
    """Mean distance [m] of contact from the pitch point, of a force that all teeth share equally.

    The integral of |s|/n along the path, over the base pitch; n pairs of teeth touch.
    """
    start, end = path
    shifts = [k * pitch for k in range(math.ceil((end - start) / pitch) + 1)]
    # between these the number of pairs in contact, and the sense of sliding, stay the same
    places = {0.0, *(start + d for d in shifts), *(end - d for d in shifts)}
    integral = 0.0
    for a, b in pairwise(sorted(s for s in places if start <= s <= end)):
        middle = (a + b) / 2.0
        others = (side * d for side in (-1, 1) for d in shifts[1:])
        touching = 1 + sum(start <= middle + d <= end for d in others)
        integral += abs(b * b - a * a) / 2.0 / touching
    return integral / pitch


def path_with_rack(pinion: Gear, out: float = 0.0) -> Path:
    """Path of contact [m] of a gear and the rack of its tooth system, [V] Figure 5.11.

    The rack stands off by the profile shift, so that there is no backlash, and `out` [m] more.
    """
    pressure = pinion.system.pressure_angle
    height = (pinion.system.addendum - pinion.shift) * pinion.module
    reach = pinion.base_radius * math.tan(pressure)
    start = (out - height) / math.sin(pressure)
    if pinion.undercut:
        start = max(start, pinion.tangent(pinion.form_radius) - reach)
    return Path(start, pinion.tangent(pinion.tip_radius) - reach)
