"""Metamorphic: a machine twice as large, heavy or slow, or told in another order, is the same one.

Every number of a scene is changed as its unit says, by a power of two, so that what is computed
rounds alike. Then every quantity is changed as its own unit says: a tolerance, a default or a step
that is absolute, and a table that reads 'the first', show at once.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from builders import made

import mechanism_sim as ms
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.scene.facts import units_at

SCENES = (
    'andrews_squeezer', 'arc_slot_yoke', 'catapult', 'detent', 'double_rocker_tracing',
    'double_toggle_punch', 'eccentric_cam', 'film_advance', 'five_bar', 'four_bar_clearance',
    'four_bar_coupler_curve', 'four_bar_crank_rocker', 'four_bar_crossed',
    'four_bar_double_crank', 'four_bar_double_rocker', 'four_bar_nominal', 'gear_four_bar',
    'groove_cam', 'helical_shafts', 'linear_intermittent', 'loader', 'mass_on_spring',
    'material_handling', 'measured_cam', 'offset_roller_cam', 'oscillating_roller', 'pendulum',
    'quick_return_shaper', 'rack_and_pinion', 'rise_dwell_return', 'rotary_engine',
    'rotor_on_supports', 'rubbing_compressor', 'scotch_yoke', 'scotch_yoke_offset',
    'slider_crank', 'slider_crank_offset', 'sliding_cam', 'ten_links', 'torsional_shaft',
    'two_disk_rotor', 'unbalanced_machine', 'valve_train', 'vibration_absorber', 'wedge',
    'worm_drive',
)  # fmt: skip
"""Without formulas and profiles, whose numbers tell no units, and without default materials."""

POWERS = {
    'm': (1, 0, 0), 'kg': (0, 1, 0), 's': (0, 0, 1), 'N': (1, 1, -2), 'J': (2, 1, -2),
    'W': (2, 1, -3), 'Pa': (-1, 1, -2), 'Hz': (0, 0, -1),
}  # fmt: skip
"""Of length, mass and time."""

SECTIONS = 'links', 'joints', 'gears', 'loads', 'springs', 'sensors'


def powers_of(unit: str) -> Any:
    """Of length, mass and time in a unit such as ``N m s/rad``."""
    above, _, below = unit.partition('/')
    found = np.zeros(3)
    for sign, part in ((1, above), (-1, below)):
        for name, power in re.findall(r'([A-Za-z]+)(?:\^(\d))?', part):
            found += sign * int(power or 1) * np.array(POWERS.get(name, (0, 0, 0)))
    return found


def scaled(machine: ms.Machine, factors: Any) -> Any:
    """The scene of a machine with every number changed."""

    def read(x: Any, at: tuple[str, ...]) -> Any:
        if isinstance(x, dict):
            return {key: read(value, (*at, key)) for key, value in x.items()}
        if isinstance(x, list | tuple):
            if len(x) == 2 and isinstance(x[1], str) and isinstance(x[0], float):
                return f'{x[0] * float(np.prod(factors ** powers_of(x[1])))!r} {x[1]}'.strip()
            return [read(value, (*at, str(i))) for i, value in enumerate(x)]
        if not isinstance(x, float) or not x:
            return x
        _, units = units_at(machine.scene, '.'.join(at))
        straight = at[-1] in machine.mechanism.displacements
        units = [u for u in units if len(units) == 1 or straight != ('rad' in u)]
        return x * float(np.prod(factors ** powers_of(units[0]))) if units else x

    return read(machine.scene.to_document(exclude_none=True), ())


def samples(machine: ms.Machine, length: float) -> Any:
    """Of all quantities; and the sizes of those of a kind, beside which others are rounding."""
    t, known = np.linspace(0.0, length, 17), catalogue(machine)
    seen = ms.simulate(machine, duration=length).sample(t, *known)
    sizes: dict[tuple[str, str], float] = {}
    for name, quantity in known.items():
        size = np.nanmax(np.abs(seen[name]), initial=0.0)
        size = max(size, machine.mechanism.size if quantity.difference else 0.0)
        key = quantity.kind, quantity.unit
        sizes[key] = max(sizes.get(key, 0.0), size)
    return known, seen, sizes


def length_of(machine: ms.Machine) -> float:
    """A third of a turn, or of what the scene tells [s]."""
    ends = machine.drive.period, machine.scene.duration or np.inf
    return 0.3 * float(min(ends))


@pytest.mark.sample(3)
@pytest.mark.parametrize('scene', SCENES)
def test_figures_of_a_scaled_machine_are_those_of_their_units(scene: str) -> None:
    machine = ms.load_scene(scene)
    length = length_of(machine)
    known, first, sizes = samples(machine, length)
    for factors in ((2.0, 1.0, 1.0), (1.0, 2.0, 1.0), (1.0, 1.0, 4.0)):
        other = made(scaled(machine, np.array(factors)))
        again, second, _ = samples(other, factors[2] * length)
        assert again.keys() == known.keys()
        for name, quantity in known.items():
            factor = float(np.prod(np.array(factors) ** powers_of(quantity.unit)))
            error = 1e-9 * factor * sizes[quantity.kind, quantity.unit]
            if quantity.part == 'direction':  # of forces that are nothing but rounding, any
                continue
            assert second[name] / factor == pytest.approx(
                first[name], rel=0.0, abs=max(error / factor, 1e-300), nan_ok=True
            ), (name, factors)


MICRO, GIANT, LIGHT = (2.0**-20, 2.0**-40, 2.0**-7), (2.0**20, 1.0, 1.0), (1.0, 2.0**-30, 1.0)


@pytest.mark.sample(1)
@pytest.mark.parametrize('factors', [MICRO, GIANT, LIGHT], ids=['micro', 'giant', 'light'])
def test_a_pin_that_yields_and_rubs_strikes_alike_at_extreme_scales(factors: Any) -> None:
    """Contact begins at a depth beside the size; it turns from sticking by its own force."""
    factors = np.array(factors)
    contact = {'law': 'lankarani_nikravesh', 'stiffness': 1e8, 'exponent': 1.5}
    own = {'restitution': 0.7, 'friction': 0.1, 'pin_radius': '6 mm', 'contact': contact}
    clearance = {f'joints.coupler_rocker.clearance.{key}': x for key, x in own.items()}
    machine = ms.load_scene('four_bar_clearance', clearance | {'start': 'centred'})
    data = scaled(machine, factors)
    K = 1e8 * factors[1] / factors[2] ** 2 / factors[0] ** 0.5
    data['joints']['coupler_rocker']['clearance']['contact']['stiffness'] = float(K)
    first = ms.simulate(machine, duration=0.012)
    second = ms.simulate(made(data), duration=0.012 * factors[2])
    assert [x.mode for x in second.modes] == [x.mode for x in first.modes]
    impulse = factors[0] * factors[1] / factors[2]
    assert len(second.impacts) == len(first.impacts) == 1
    for one, other in zip(first.impacts, second.impacts, strict=True):
        assert other.t / factors[2] == pytest.approx(one.t, rel=1e-9)
        assert other.normal_impulse / impulse == pytest.approx(one.normal_impulse, rel=1e-8)
        assert other.tangential_impulse / impulse == pytest.approx(
            one.tangential_impulse, rel=1e-8
        )


@pytest.mark.sample(3)
@pytest.mark.parametrize('scene', [x for x in SCENES if x not in ('catapult', 'detent')])
def test_figures_do_not_depend_on_the_order_of_parts(scene: str) -> None:
    """But for a machine without a drive, of which one of no torque is of the first link."""
    machine = ms.load_scene(scene)
    data = scaled(machine, np.ones(3))
    data |= {x: dict(reversed(data[x].items())) for x in SECTIONS if data.get(x)}
    length = length_of(machine)
    known, first, sizes = samples(machine, length)
    again, second, _ = samples(made(data), length)
    assert again.keys() == known.keys()
    for name, quantity in known.items():
        if quantity.part != 'direction':
            error = max(1e-7 * sizes[quantity.kind, quantity.unit], 1e-300)
            apart = second[name] - first[name]
            if quantity.unit == 'rad':
                apart = np.angle(np.exp(1j * apart))
            assert np.nanmax(np.abs(apart), initial=0.0) <= error, name
