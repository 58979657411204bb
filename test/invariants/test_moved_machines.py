"""Metamorphic: a machine turned, shifted or seen in a mirror is the same machine.

Every vector of the catalogue turns with it, every angle and torque changes its sense in a mirror,
and all else stays: what is taken for granted of an axis or of a sense shows at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from builders import made
from moved import Isometry, moved

import mechanism_sim as ms
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.quantity import Quantity

SCENES = (
    'adjustable_stroke_drive', 'andrews_squeezer', 'arc_slot_yoke', 'catapult',
    'compound_planetary', 'constant_velocity_slider', 'double_rocker_tracing',
    'double_toggle_punch', 'dump_truck', 'eccentric_cam', 'film_advance', 'five_bar',
    'four_bar_clearance', 'four_bar_crossed', 'four_bar_governed', 'four_bar_triple_rocker',
    'gear_box', 'gear_pair', 'geneva', 'groove_cam', 'hand_pump', 'hydraulic_arm',
    'linear_intermittent', 'loader', 'locking_pliers', 'material_handling', 'measured_cam',
    'mesh_stiffness', 'offset_roller_cam', 'oscillating_cylinder', 'oscillating_roller',
    'pendulum', 'planetary', 'punch', 'quick_return', 'quick_return_shaper', 'rack_and_pinion',
    'rise_dwell_return', 'rotary_engine', 'rubbing_compressor', 'slider_crank',
    'slider_crank_engine', 'slider_crank_piston_driven', 'straight_line_drive', 'ten_links',
    'torsional_shaft', 'unbalanced_machine', 'valve_train', 'variable_stroke_drive',
    'vibration_absorber', 'watched_compressor', 'wedge', 'windshield_wiper',
)  # fmt: skip
"""Without axes that the world has, as those of supports and mounts, without ratios of angles in
the world, and without files."""

FLAT = (
    'bearing_run_up', 'belt_drive', 'bevel_pair', 'differential', 'elastic_slider_crank',
    'four_bar_elastic', 'four_bar_misaligned', 'four_bar_on_frame', 'half_car', 'helical_shafts',
    'mass_on_spring', 'overhung_rotor', 'rotor_on_supports', 'rotor_run_up', 'scotch_yoke',
    'sliding_cam', 'spinning_beam', 'toggle_press', 'two_disk_rotor',
)  # fmt: skip
"""With axes that the world has, or with ratios of angles: driven backwards in the mirror y = 0."""

TURNED = Isometry(0.7)
MIRRORED = Isometry(2.5, -1, (0.3, 0.2))
FAR = Isometry(shift=(3.0, -7.0))
ERROR = 1e-9
"""Of the largest quantity of a kind."""


def expected(name: str, quantity: Quantity, seen: Any, by: Isometry, after: Any) -> Iterator[Any]:
    """What a quantity may be of a moved machine: of a scalar in a mirror, of either sign."""
    x = seen[name]
    stem, _, part = name.rpartition('.')
    if part in ('x', 'y') and f'{stem}.x' in seen and f'{stem}.y' in seen:
        vector = by.sense * seen[f'{stem}.y']
        c, s = np.cos(by.angle), np.sin(by.angle)
        turned = c * seen[f'{stem}.x'] - s * vector, s * seen[f'{stem}.x'] + c * vector
        own = turned[part == 'y']
        if quantity.unit == 'm':  # a place, or a vector between two
            yield own + by.shift[part == 'y']
        if quantity.kind != 'position':
            yield own
        if quantity.unit == 'N m':  # an axial vector
            yield by.sense * own
        return
    yield from {1: (x,), -1: (x, -x)}[by.sense]
    if quantity.unit == 'rad':
        yield by.sense * x + by.angle
    if name == 'energy.potential':
        yield x + after[name][0] - x[0]
    if name == 'shaking_moment':
        x_force, y_force = after['shaking_force.x'], after['shaking_force.y']
        about = by.shift[1] * x_force - by.shift[0] * y_force
        yield by.sense * x + about
        yield by.sense * x - about


def off(found: Any, right: Any, unit: str) -> float:
    """Largest difference, where both are known."""
    apart = np.angle(np.exp(1j * (found - right))) if unit == 'rad' else found - right
    assert (np.isnan(found) == np.isnan(right)).all()
    return float(np.nanmax(np.abs(apart), initial=0.0))


@pytest.mark.sample(4)
@pytest.mark.parametrize('by', [TURNED, MIRRORED, FAR], ids=['turned', 'mirrored', 'far'])
@pytest.mark.parametrize('scene', SCENES)
def test_a_moved_machine_is_the_same_machine(scene: str, by: Isometry) -> None:
    assert_same(scene, by)


@pytest.mark.sample(2)
@pytest.mark.parametrize('scene', FLAT)
def test_a_machine_driven_backwards_in_a_mirror_is_the_same_machine(scene: str) -> None:
    assert_same(scene, Isometry(sense=-1))


def assert_same(scene: str, by: Isometry) -> None:
    """Compare a machine with the moved one, by all quantities over a tenth of a turn."""
    machine = ms.load_scene(scene)
    length = 0.1 * min(machine.drive.period, machine.scene.duration or np.inf)
    other = made(moved(machine, by))
    quantities = catalogue(machine)
    known = [name for name in quantities if '.ground.' not in name]
    assert {*known} <= {*catalogue(other)}
    t = np.linspace(0.0, length, 9)
    first, second = (ms.simulate(m, duration=length) for m in (machine, other))
    assert len(first.impacts) == len(second.impacts)
    seen, after = first.sample(t, *known), second.sample(t, *known)
    sizes: dict[str, float] = {}
    for name in known:
        unit = quantities[name].unit
        size = np.nanmax(np.abs(seen[name]), initial=0.0)
        sizes[unit] = max(sizes.get(unit, 1e-300), size)
    sizes['N m'] = max(sizes.get('N m', 0.0), sizes.get('N', 0.0) * machine.mechanism.size)
    for power, unit in enumerate(('m', 'm/s', 'm/s^2')):  # beside which a rest is rounding
        least = machine.mechanism.size / length**power
        sizes[unit] = max(sizes.get(unit, 0.0), least)
    sizes['W'] = max(sizes.get('W', 0.0), sizes.get('N', 0.0) * sizes['m/s'])
    for name in known:
        quantity = quantities[name]
        if quantity.part == 'direction' or quantity.kind == 'mode':
            continue
        right = expected(name, quantity, seen, by, after)
        error = min(off(after[name], value, quantity.unit) for value in right)
        assert error <= ERROR * sizes.get(quantity.unit, 1.0), (name, error)


STEADY = (
    'adjustable_stroke_drive', 'arc_slot_yoke', 'constant_velocity_slider', 'double_toggle_punch',
    'film_advance', 'five_bar', 'four_bar_double_rocker', 'material_handling', 'measured_cam',
    'oscillating_cylinder', 'quick_return', 'quick_return_shaper', 'scotch_yoke_offset',
    'slider_crank_offset', 'ten_links', 'variable_stroke_drive',
)  # fmt: skip
"""Ideal, without friction, of a drive at constant speed, all of whose links come back."""


@pytest.mark.sample(3)
@pytest.mark.parametrize('scene', STEADY)
def test_a_cycle_driven_backwards_is_that_forwards_from_its_end(scene: str) -> None:
    """Forces and torques are those of the places, speeds and powers the opposite."""
    speed = ms.load_scene(scene).drive.start[1]
    one, other = (
        ms.cycle(ms.load_scene(scene, {'loads': {}, 'drive.speed': sign * speed}), samples=24)
        for sign in (1.0, -1.0)
    )
    known = catalogue(one.machine)
    for name in one.names:
        quantity = known[name]
        if name == 't' or quantity.cumulative or quantity.part == 'direction':
            continue
        odd = quantity.kind.endswith(('velocity', 'speed', 'power'))
        right = -one[name] if odd else one[name]
        size = max(float(np.abs(one[name]).max()), 1e-3 * one.machine.mechanism.size)
        assert off(other[name][::-1], right, quantity.unit) <= 1e-8 * size, name
    for (link, swing), back in zip(one.swings().items(), other.swings().values(), strict=True):
        figures = swing.size, swing.rising, swing.falling, swing.standing, swing.time_ratio
        others = back.size, back.falling, back.rising, back.standing, back.time_ratio
        for x, y in zip(figures, others, strict=True):
            assert x == y or x == pytest.approx(y, rel=1e-8), link
