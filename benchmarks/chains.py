"""Linkages of any number of links: a crank-rocker whose rocker drives another, and so on."""

from __future__ import annotations

from typing import Any

from mechanism_sim.scene import Machine
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene

CRANK, COUPLER, ROCKER, SPACING = 0.04, 0.30, 0.12, 0.30  # [m]
SPEED = 30.0  # [rad/s]


def chain(dyads: int, **overrides: Any) -> Machine:
    """A crank and so many pairs of coupler and rocker, each driven by the rocker before it.

    With the ground it has ``2 dyads + 2`` links. Keyword arguments are further keys of the scene.
    """

    def bar(length: float) -> dict[str, Any]:
        mass = 2.0 * length
        return {'length': length, 'mass': mass, 'inertia': mass * length**2 / 12.0,
                'cog': 0.5 * length}  # fmt: skip

    pivots = {f'pivot_{k}': [SPACING * k, 0.0] for k in range(1, dyads + 1)}
    links: dict[str, Any] = {'ground': {'points': pivots}, 'crank': bar(CRANK)}
    joints: dict[str, Any] = {'ground_crank': {'revolute': ['ground', 'crank']}}
    guess: dict[str, float] = {}
    before = 'crank'
    for k in range(1, dyads + 1):
        coupler, rocker = f'coupler_{k}', f'rocker_{k}'
        links |= {coupler: bar(COUPLER), rocker: bar(ROCKER)}
        joints |= {
            f'{before}_{coupler}': {'revolute': [f'{before}.end', coupler]},
            f'{coupler}_{rocker}': {'revolute': [f'{coupler}.end', f'{rocker}.end']},
            f'{rocker}_ground': {'revolute': [rocker, f'ground.pivot_{k}']},
        }
        guess |= {coupler: 0.3 if k == 1 else 0.0, rocker: 1.5}
        before = rocker
    content = {
        'title': f'Chain of {dyads} rockers',
        'mechanism': 'linkage',
        'links': links,
        'joints': joints,
        'gravity': [0.0, -9.81],
        'drive': {'speed': SPEED},
        'guess': guess,
    }
    name = f'chain_{dyads}'
    return build(name, check_scene(name, content | overrides))
