"""Dry friction that holds a block, and an impact too weak to move it."""

from __future__ import annotations

import math

import pytest
from builders import weightless

from mechanism_sim.planar.switches import HOLDS

MASS, PULL, RUB = 2.0, 2.0, 5.0  # [kg], [N], [N]


@pytest.fixture(scope='module')
def held():
    """A run of a block that is pulled less than its friction holds."""
    machine = weightless(
        links={'block': {'mass': MASS}},
        joints={'guide': {'prismatic': ['ground', 'block']}},
        loads={'rub': {'at': 'block', 'force': [f'{PULL} - {RUB}*sign(vx)', 0.0]}},
    )
    return machine.start()


@pytest.mark.parametrize(('way', 'braking'), [(1.0, RUB - PULL), (-1.0, RUB + PULL)])
def test_what_would_stop_again_within_a_rounding_of_its_place_stays(held, way, braking):
    """``v^2 = 2 a s`` with the pull against friction one way, and with it the other."""
    present, switching = held._present, held._contacts.switching
    limit = math.sqrt(2.0 * present.system.rounding * braking / MASS)
    for share, row in ((0.95, HOLDS), (1.05, int(way > 0.0))):
        switching.set_rows((HOLDS,))
        present.v[:] = share * limit * way
        switching.release()
        assert switching.rows == (row,)
        assert present.v[0] == pytest.approx(0.0 if row == HOLDS else 1.05 * limit * way)
