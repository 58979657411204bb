"""Trains of [V] 5.9 and 5.10, with its numbering of the members."""

from __future__ import annotations

import math
from collections.abc import Mapping

from willis import Mesh, Train

from mechanism_sim.errors import InputError


def gear_box(teeth: Mapping[str, int], gear: int) -> Train:
    """Gear box of [V] Figure 5.31, in its first, second or third (reverse) gear.

    Input shaft 2, output shaft `out`, on which 3 and 4 slide; 5, 6, 7, 8 on the auxiliary shaft;
    9 the idler, always in mesh with 8.

    Raises
    ------
    InputError
        If there is no such gear.
    """
    ways = {1: Mesh('7', '4'), 2: Mesh('6', '3'), 3: Mesh('9', '4')}
    if gear not in ways:
        raise InputError(f'the gear box has gears 1, 2 and 3, not {gear}')
    fixed = (*(('5', g) for g in '678'), ('3', 'out'), ('4', 'out'))
    return Train(teeth, (Mesh('2', '5'), Mesh('8', '9'), ways[gear]), fixed)


def planetary(sun: int, planet: int, ring: int) -> Train:
    """Planetary train of [V] Figure 5.33: 2 sun, 4 planet, 5 ring, 3 carrier."""
    meshes = Mesh('2', '4', '3'), Mesh('4', '5', '3', internal=True)
    return Train({'2': sun, '4': planet, '5': ring}, meshes)


def compound_planetary(teeth: Mapping[str, int]) -> Train:
    """Train of [V] Figure 5.34: sun 2, planets 3 and 4-5, central gear 6, carrier 7."""
    meshes = Mesh('2', '3', '7'), Mesh('3', '4', '7'), Mesh('5', '6', '7')
    return Train(teeth, meshes, (('4', '5'),))


def differential(teeth: Mapping[str, int]) -> Train:
    """Differential of [V] Figure 5.35: drive 2, crown gear and carrier 3, planet 4, axles 5, 6."""
    meshes = Mesh('2', '3'), Mesh('5', '4', '3'), Mesh('6', '4', '3', internal=True)
    return Train(teeth, meshes, square=frozenset({'4'}))


def planets_fit(sun: int, planet: int, ring: int, planets: int) -> bool:
    """True if equal planets can be mounted at equal angles between sun and ring.

    The shafts coincide, N5 = N2 + 2 N4 (no profile shift), the teeth of all planets find their
    spaces, (N2 + N5)/planets is an integer, and neighbours do not touch (addenda of one module).
    """
    apart = (sun + planet) * math.sin(math.pi / planets) if planets > 1 else math.inf
    return ring == sun + 2 * planet and (sun + ring) % planets == 0 and apart > planet + 2
