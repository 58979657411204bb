"""Start values are honoured to the last bit, or refused in a sentence; never dropped."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from builders import LINKAGE, digest_of, made

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.results.run import Solution
from mechanism_sim.scene.check import check, render

SLIDERS = """
title: Two parallel sliders with a loose joint
mechanism: linkage
links: {one: {mass: 1 kg}, two: {mass: 3 kg}}
joints:
  a: {prismatic: [ground, one]}
  b: {prismatic: [ground, two]}
  gap: {KIND}
initial: {velocity: {one: 1 m/s, two: -1 m/s}}
"""
SLOT = 'slot: [one, two], axis: 90 deg, clearance: {radial: 10 mm, restitution: 0.5}'
PIN = 'revolute: [one, two], clearance: {radial: 10 mm, restitution: 0.5}'


@pytest.mark.parametrize('kind', [SLOT, PIN])
def test_two_sliders_start_apart_and_meet_when_they_must(kind: str) -> None:
    """2 m/s close 10 mm in 5 ms; e = 0.5 and momentum give the speeds behind."""
    machine = made(SLIDERS.replace('KIND', kind))
    solution = ms.simulate(machine, duration=0.006)
    at = solution.sample([0.0, 0.006], 'velocity.one', 'velocity.two')
    assert at['velocity.one'][0] == 1.0
    assert at['velocity.two'][0] == -1.0
    (impact,) = solution.impacts
    assert impact.t == pytest.approx(0.005, rel=1e-12)
    assert impact.approach_speed == pytest.approx(2.0, rel=1e-12)
    assert at['velocity.one'][1] == pytest.approx(-1.25, rel=1e-12)  # -0.5 - 0.75
    assert at['velocity.two'][1] == pytest.approx(-0.25, rel=1e-12)
    start = check(machine).starts[impact.joint]
    assert (start.open, start.closing) == (pytest.approx(0.01), pytest.approx(2.0))
    assert 'starts open by 0.01 m, closing at 2 m/s' in render(check(machine))


def test_a_loose_joint_between_parallel_sliders_needs_no_force_to_be_known() -> None:
    text = SLIDERS.replace('KIND', PIN).replace('initial', 'guess: {}\n#')
    with pytest.raises(InputError, match="force in gap is not determined; write 'start: centred'"):
        made(text).initial_state()
    start = made(text, start='centred').initial_state()
    assert start.v == (0.0, 0.0)


PENDULUM = """
title: A pendulum
mechanism: linkage
gravity: [0 m/s^2, -9.81 m/s^2]
links: {arm: {length: 1 m, mass: 1 kg, inertia: 0.1 kg m^2, cog: 0.5 m}}
joints: {pivot: {revolute: [ground, arm]CLEARANCE}}
"""


def test_what_no_drive_moves_starts_on_its_bushing() -> None:
    ideal, loose = (
        made(PENDULUM.replace('CLEARANCE', more))
        for more in ('', ', clearance: {radial: 0.01 mm, restitution: 0}')
    )
    one, two = (ms.simulate(m, duration=0.2).sample([0.0, 0.2]) for m in (ideal, loose))
    assert two['position.arm'][1] == pytest.approx(one['position.arm'][1], rel=1e-3)
    place = loose.mechanism.separation('pivot')
    start = np.array([[two[f'position.{c}'][0]] for c in loose.mechanism.coordinates])
    assert np.hypot(*loose.mechanism.trace(place, start)[0]) == pytest.approx(1e-5, rel=1e-9)


def test_a_gap_that_cannot_change_is_refused() -> None:
    along = SLOT.replace('90 deg', '0 deg')
    with pytest.raises(InputError, match='never opens nor closes'):
        made(SLIDERS.replace('KIND', along)).initial_state()


def test_a_follower_starts_lifted_and_falls_by_its_own_motion() -> None:
    machine = ms.load_scene(
        'valve_train', {'initial.position.valve': '30 mm', 'initial.velocity.valve': '0.2 m/s'}
    )
    start = check(machine).starts['contact']
    assert start.open == pytest.approx(0.012, rel=1e-12)  # the base circle is at 18 mm
    assert start.closing == pytest.approx(-0.2, rel=1e-9)
    at = ms.simulate(machine, duration=1e-4).sample([0.0], 'position.valve', 'velocity.valve')
    assert (at['position.valve'][0], at['velocity.valve'][0]) == (0.03, 0.2)
    with pytest.raises(InputError, match=r'initial\.position puts contact'):
        ms.load_scene('valve_train', {'initial.position.valve': '17 mm'}).initial_state()


def test_a_pin_starts_in_the_middle_of_its_clearance_as_in_the_template() -> None:
    given = {
        'initial.position.coupler': 0.877, 'initial.position.rocker': 1.7,
        'initial.velocity.coupler': -1.5, 'initial.velocity.rocker': 2.0,
    }  # fmt: skip
    probe = made(LINKAGE, start='centred').initial_state()
    given['initial.position.coupler'] = probe.q[0] + 1e-3
    given['initial.position.rocker'] = probe.q[1] - 2e-3
    machine = made(LINKAGE, **given)
    at = ms.simulate(machine, duration=1e-5).sample([0.0])
    for key, value in given.items():
        _, kind, link = key.split('.')
        assert at[f'{kind}.{link}'][0] == value
    # by hand: the pin's place in its bushing, and its velocity
    q = at['position.crank'][0], at['position.coupler'][0], at['position.rocker'][0]
    z = 0.064 * np.exp(1j * q[0]) + 0.309 * np.exp(1j * q[1]) - 0.312 * np.exp(1j * q[2]) - 0.387
    w = 1j * (
        0.64 * np.exp(1j * q[0]) - 0.309 * 1.5 * np.exp(1j * q[1]) - 0.624 * np.exp(1j * q[2])
    )
    start = check(machine).starts['coupler_rocker']
    assert start.open == pytest.approx(2e-3 - abs(z), rel=1e-9)
    assert start.closing == pytest.approx((w * z.conjugate()).real / abs(z), rel=1e-9)
    # what is not given follows: the other link goes with it, and the pin stays inside
    alone = made(LINKAGE, **{'initial.position.coupler': probe.q[0] + 0.004})
    assert alone.initial_state().q[0] == probe.q[0] + 0.004
    with pytest.raises(InputError, match=r'initial\.position puts the pin of coupler_rocker'):
        made(LINKAGE, **given | {'initial.position.rocker': 1.2}).initial_state()


def test_values_that_contradict_each_other_are_refused_with_how_much() -> None:
    firm = LINKAGE.replace(', clearance: {radial: 2 mm, restitution: 0.5}', '')
    free = firm.replace('speed: 10 rad/s', 'torque: {}')
    for text, key in ((firm, 'rocker'), (free, 'rocker')):
        overrides = {f'initial.velocity.{key}': 3.0, 'initial.velocity.coupler': 2.0}
        with pytest.raises(InputError, match=r'loop closed by coupler_rocker would open at [\d.]'):
            made(text, **overrides)
    with pytest.raises(InputError, match=r'initial.velocity.crank is 3, but its drive begins'):
        made(firm, **{'initial.velocity.crank': 3.0})
    # what follows may be said, if it is right; a free drive says nothing
    machine = made(free, **{'initial.velocity.rocker': 0.5})
    v = dict(zip(machine.plan.ideal.coordinates, machine.assembly.v, strict=True))
    assert v['rocker'] == 0.5
    again = {f'initial.velocity.{c}': float(x) for c, x in v.items()}
    assert np.allclose(made(free, **again).assembly.v, machine.assembly.v, rtol=1e-12)


def test_rates_that_nothing_determines_are_those_of_a_machine_of_any_size() -> None:
    """A rod and a slider share a slot: of all rates that keep it closed, the least."""

    def rates(size: float) -> tuple[float, float, float]:
        machine = made(
            {
                'links': {
                    'one': {'mass': 1.0}, 'two': {'mass': 1.0},
                    'rod': {'length': 0.4 * size, 'mass': 1.0, 'inertia': 0.01},
                },
                'joints': {
                    'guide': {'prismatic': ['ground', 'one']},
                    'pin': {'revolute': ['one', 'rod']},
                    'rail': {'prismatic': ['ground', 'two'], 'axis': 1.0},
                    'slot': {'slot': ['rod.end', 'two'], 'axis': 0.3},
                },
                'guess': {'rod': 0.8, 'two': 0.1 * size},
                'initial': {'position': {'one': 0.1 * size}, 'velocity': {'one': 0.7 * size}},
            }
        )  # fmt: skip
        v = dict(zip(machine.plan.ideal.coordinates, machine.assembly.v, strict=True))
        return v['one'] / size, v['two'] / size, v['rod']

    assert rates(0.03) == pytest.approx(rates(1.0), rel=1e-12)
    assert min(map(abs, rates(1.0))) > 0.01


PEAUCELLIER = {
    'links': {
        'ground': {'points': {'centre': ['50 mm', '0 mm']}},
        'crank': {'length': '50 mm'},
        **{name: {'length': '150 mm'} for name in ('upper', 'lower')},
        **{name: {'length': '60 mm'} for name in ('one', 'two', 'three', 'four')},
    },
    'joints': {
        name: {'revolute': pair.split()}
        for name, pair in {
            'a': 'ground.centre crank', 'b': 'ground upper', 'c': 'ground lower',
            'd': 'crank.end one', 'e': 'crank.end two', 'f': 'upper.end one.end',
            'g': 'lower.end two.end', 'h': 'upper.end three', 'i': 'lower.end four',
            'j': 'three.end four.end',
        }.items()
    },
    'guess': {'three.end': ['180 mm', '0 mm'], 'upper': '30 deg', 'lower': '-30 deg'},
    'drive': {'coordinate': 'crank', 'start_angle': '-20 deg', 'speed': '40 deg/s'},
}  # fmt: skip


@pytest.mark.slow
def test_a_rhombus_opens_where_folded_it_would_leave_links_loose() -> None:
    """Newton's method folds it from there; Peaucellier's inverts the circle to a line."""
    run = ms.simulate(made(PEAUCELLIER), duration=1.0)
    t = np.linspace(0.0, 1.0, 7)
    at = run.sample(t, 'position.upper', 'position.three')
    drawn = 0.15 * np.exp(1j * at['position.upper']) + 0.06 * np.exp(1j * at['position.three'])
    line = (0.15**2 - 0.06**2) / 0.1
    exact = line * (1.0 + 1j * np.tan(0.5 * np.radians(40.0 * t - 20.0)))
    assert np.abs(drawn - exact).max() <= 1e-15


SCENES = (
    'four_bar_clearance', 'four_bar_nominal', 'valve_train', 'groove_cam', 'gear_rattle',
    'pendulum', 'andrews_squeezer', 'slider_crank', 'scotch_yoke', 'geneva', 'quick_return',
    'bearing_run_up', 'catapult',
)  # fmt: skip


@pytest.mark.sample(2)
@pytest.mark.parametrize('scene', SCENES)
def test_any_start_value_is_honoured_or_refused(scene: str) -> None:
    """Seeded: some coordinates get values near or far from where they would be."""
    rng = random.Random(scene)
    base = ms.load_scene(scene)
    at = ms.simulate(base, duration=1e-6).sample([0.0])
    links, outcomes = list(base.plan.links), []
    for _ in range(12):
        given = {}
        for link in rng.sample(links, min(len(links), rng.choice([1, 1, 2, 3]))):
            for kind in ('position', 'velocity'):
                if rng.random() < 0.6 and f'{kind}.{link}' in at:
                    near = float(at[f'{kind}.{link}'][0])
                    given[f'initial.{kind}.{link}'] = near + rng.choice(
                        [0.0, 1e-5, -1e-4, 0.3, -2.0]
                    )
        try:
            machine = ms.load_scene(scene, given)
            if machine.level.dynamic:
                machine.initial_state()
        except InputError as error:
            said = str(error)
        else:
            said = ''
            solution = ms.simulate(machine, duration=1e-6)
            _check_honoured(machine, given, solution)
        assert said.startswith(scene if said else ''), said
        outcomes.append(not said)
    assert any(outcomes)


def _check_honoured(machine: ms.Machine, given: dict[str, float], solution: Solution) -> None:
    """What is read back from the run at t = 0; where it strikes there, from before the impact."""
    found = {key: float(x[0]) for key, x in solution.sample([0.0]).items()}
    if any(impact.t == 0.0 for impact in solution.impacts):
        state = machine.initial_state()
        found |= {
            f'velocity.{c}': v for c, v in zip(machine.equations.system.free, state.v, strict=True)
        }
    for key, value in given.items():
        _, kind, link = key.split('.')
        off = found[f'{kind}.{link}'] - value
        if kind == 'position' and link not in machine.mechanism.displacements:
            off = math.remainder(off, 2.0 * math.pi)
        assert abs(off) <= 1e-12 * max(1.0, abs(value)), (key, value, found)


@pytest.mark.parametrize(
    ('start', 'said'),
    [
        ('27 m', 'the root of m/Pa in .* states.pushing.start is in m'),
        ('27 A', 'the root of A/Pa in .* states.pushing.start is in A'),
        ('27', 'the root of 1/Pa in .* states.pushing.start is a plain number'),
    ],
)
def test_a_state_in_another_unit_than_its_formulas_is_refused(start: str, said: str) -> None:
    with pytest.raises(InputError, match=f'states.pushing.rate: .*{said}'):
        ms.load_scene('hydraulic_arm', {'states.pushing.start': start})


def test_a_rate_in_another_unit_than_the_start_is_refused() -> None:
    scene = {
        'links': {'block': {'mass': 1.0}},
        'joints': {'guide': {'prismatic': ['ground', 'block']}},
        'states': {'work': {'start': '3 N', 'rate': '5 N*block_rate'}},
    }
    with pytest.raises(InputError, match=r"'.*' is in W, not in N/s; states.work.start is in N"):
        made(scene)
    scene['states']['work']['start'] = '3 J'
    assert made(scene).plan.states


@pytest.mark.slow
def test_units_in_formulas_of_states_change_no_bit() -> None:
    """Beside the same formulas of numbers in SI units, which know no units."""
    plain = {
        'springs.cylinder.force': '1e3*rate - 1e-3*pushing + 6e-4*holding',
        'states.valve.rate': '(12*(0.1 - arm) - valve)/0.05',
        'states.pushing.rate': '1e9/(1e-4 + 1e-3*(cylinder.length - 0.3))*(4e-8*valve*sqrt(max('
        '100e5 - pushing if valve > 0 else pushing - 1e5, 0)) - 1e-3*cylinder.rate)',
        'states.holding.rate': '1e9/(1e-4 + 6e-4*(0.5 - cylinder.length))*(6e-4*cylinder.rate'
        ' - 4e-8*valve*sqrt(max(holding - 1e5 if valve > 0 else 100e5 - holding, 0)))',
    }
    assert digest_of('hydraulic_arm', plain, 0.5) == digest_of('hydraulic_arm', (), 0.5)
