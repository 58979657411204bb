"""What can be said of a cam without moving it: pressure angle, jumps, whether it may pull."""

from __future__ import annotations

import math

from mechanism_sim.cams.laws import check_smoothness
from mechanism_sim.cams.pair import CamPair, GroovePair

#: pressure angles [deg] above these are usually avoided
LARGEST_PRESSURE = {False: 30.0, True: 45.0}  # for followers that slide, that swing


def cam_notes(pair: CamPair, *, loose: bool) -> list[str]:
    """Of one cam and its follower; `loose` if they may part."""
    cam, name = pair.cam, pair.name
    notes = []
    if not loose and not isinstance(pair, GroovePair):
        notes.append(
            f'{name}: always in contact, so that the cam pulls its follower where the force is '
            "negative; with 'lift_off' it would part (the command lift-off says from which speed)"
        )
    pressure = math.degrees(cam.largest_pressure_angle)
    limit = LARGEST_PRESSURE[pair.distance.swings]
    note = f'{name}: pressure angle up to {pressure:.4g} deg'
    notes.append(note + (f', more than the usual {limit:g} deg' if pressure > limit else ''))
    unit = 'm' if pair.distance.slides else 'rad'
    jumps = check_smoothness(cam.law, 2)
    notes += [f'{name}: {jump} [per {unit}^2]: the force jumps' for jump in jumps]
    return notes
