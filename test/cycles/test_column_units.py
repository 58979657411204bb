"""Units of the columns that kinds of joints add, which the kinds name themselves."""

from typing import ClassVar

import pytest

import mechanism_sim as ms
from mechanism_sim.cams.pair import CamPair
from mechanism_sim.planar.mechanism import HigherPair


def test_a_quantity_has_the_unit_that_its_kind_of_joint_names():
    units = ms.cycle(ms.load_scene('offset_roller_cam'), samples=4).units()
    named = {name: unit for name, unit in units.items() if name.split('.')[0] in CamPair.units}
    assert len(named) == 5
    assert all(unit == CamPair.units[name.split('.')[0]] for name, unit in named.items())


def test_a_quantity_without_a_unit_is_refused_and_not_taken_for_a_force(monkeypatch):
    known = {name: unit for name, unit in CamPair.units.items() if name != 'contact_speed'}
    monkeypatch.setattr(CamPair, 'units', known)
    found = ms.cycle(ms.load_scene('offset_roller_cam'), samples=4)
    with pytest.raises(TypeError, match=r'CamPair\.units lacks contact_speed'):
        found.table()


def test_a_name_has_one_unit_in_all_kinds():
    with pytest.raises(TypeError, match='pressure_angle has the units rad and m'):

        class _Other(HigherPair):
            units: ClassVar[dict[str, str]] = {'pressure_angle': 'm'}
