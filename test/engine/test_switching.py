"""Brakes and dry friction that hold a motion, and contacts that strike, press or hold it too."""

from __future__ import annotations

import math

import numpy as np
import pytest
from builders import made, weightless, without_work

import mechanism_sim as ms
from mechanism_sim.planar.drive import DriveLaw, TorqueLaw
from mechanism_sim.planar.switches import HOLDS

MASS, PULL, RUB = 2.0, 2.0, 5.0  # [kg], [N], [N]
MOTOR, CRANK = 5e-3, 2.6e-3  # [kg m^2] inertias
TORQUE, BRAKE = 12.0, 30.0  # [N m] of the motor, and of the brake on the crank
RADIUS, PLAY = 40e-3, 0.5e-3  # [m] of the motor's gear, half that of the crank's; in their teeth
STRIKES = math.sqrt(PLAY / RADIUS * MOTOR / TORQUE)  # [s] over half of the play
SLANT = math.cos(math.radians(20.0))  # of their force
RATE = TORQUE / MOTOR * STRIKES  # [rad/s] of the motor then
STOPS = STRIKES * BRAKE / (BRAKE - 2.0 * TORQUE)  # [s] where the brake takes its momentum


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


def braked_gears(rub=None, way=1.0, **backlash):
    """A motor that drives a crank through loose teeth, less than the crank's brake holds."""
    return weightless(
        links={
            'ground': {'points': {'m': [-120e-3, 0.0]}},
            'motor': {'mass': 0.4, 'inertia': MOTOR},
            'crank': {'mass': 0.6, 'inertia': CRANK},
        },
        gears={
            'p': {'at': 'motor', 'teeth': 40, 'module': '2 mm'},
            'w': {'at': 'crank', 'teeth': 80, 'module': '2 mm'},
        },
        joints={
            'motor_bearing': {'revolute': ['ground.m', 'motor']},
            'crank_bearing': {'revolute': ['ground', 'crank'], **(rub or {})},
            'mesh': {'mesh': ['p', 'w'], 'backlash': {'width': PLAY, **backlash}},
        },
        drive={'coordinate': 'motor', 'torque': {'constant': way * TORQUE}, 'speed': 0.0},
        loads={'brake': {'at': 'crank', 'torque': f'-{BRAKE}*sign(crank_rate)'}},
    )


@pytest.mark.slow
def test_a_brake_holds_what_teeth_press_on():
    """Against the momenta: an impact that both go on from together, and a stop for good.

    The bearing rubs too little to matter, but makes contacts be resolved where the brake stops.
    """
    rub = {'friction': {'coefficient': 1e-10, 'radius': 10e-3}}
    solution = ms.simulate(braked_gears(rub, way=-1.0, restitution=0.0), duration=0.2)
    (impact,) = solution.impacts
    assert impact.t == pytest.approx(STRIKES, rel=1e-9)
    assert impact.approach_speed == pytest.approx(RATE * RADIUS * SLANT, rel=1e-9)
    both = MOTOR * RATE / (MOTOR + 0.25 * CRANK)  # rate of the motor, twice that of the crank
    seen = without_work(solution, [0.99 * STOPS, 1.01 * STOPS, 0.2])
    angle = 0.25 * both * (STOPS - STRIKES)
    assert seen['position.crank'][1:] == pytest.approx(angle, rel=1e-9)
    assert seen['velocity.crank'][0] == pytest.approx(
        0.5 * both * 0.01 * STOPS / (STOPS - STRIKES), rel=1e-6
    )
    assert seen['velocity.crank'][1:] == pytest.approx(0.0, abs=1e-11)
    pressed = np.hypot(seen['reaction.motor_bearing.x'][1:], seen['reaction.motor_bearing.y'][1:])
    assert pressed == pytest.approx(TORQUE / RADIUS / SLANT, rel=1e-9)
    assert abs(solution.energy.residual) < 1e-12


@pytest.mark.parametrize(('e', 'way'), [(0.0, -1.0), (0.5, -1.0), (0.0, 1.0)])
def test_what_a_brake_holds_need_not_be_stuck_to(e, way):
    """Teeth that rub hold the crank, too, once they stick: their friction is not determined."""
    solution = ms.simulate(braked_gears(way=way, restitution=e, friction=0.1), duration=0.1)
    seen = without_work(solution, [0.05, 0.1])
    assert seen['velocity.crank'] == pytest.approx(0.0, abs=1e-11)
    assert solution.impacts[-1].t < 0.02
    assert abs(solution.energy.residual) < 1e-12


def test_a_brake_holds_on_where_a_law_changes_or_a_run_begins_anew():
    """Else the contact would part, and strike again."""
    run = braked_gears(restitution=0.0).start()
    for k in range(5):
        run.change_law(TorqueLaw('motor', (TORQUE * (1.0 - 0.1 * k), 0.0, 0.0), 0.02 + 0.01 * k))
    run.advance(0.1, final=True)
    assert len(run.drain()[1]) == 1
    before = run.state
    run.restart(before)
    run.advance(0.2, final=True)
    _, impacts, changes = run.drain()
    assert not impacts
    assert len(changes) == 2  # from unknown to what they were
    assert run.state.closed == before.closed
    assert run.state.q == pytest.approx(before.q, abs=1e-12)


def test_a_held_part_that_a_new_law_asks_too_much_of_lets_go():
    """Constant acceleration of both from then on."""
    run = braked_gears(restitution=0.0).start()
    run.change_law(TorqueLaw('motor', (1.5 * TORQUE, 0.0, 0.0), 0.02))
    run.advance(0.02, final=True)
    before = run.state
    run.advance(0.05, final=True)
    a = (1.5 * TORQUE - 0.5 * BRAKE) / (MOTOR + 0.25 * CRANK)
    assert run.state.q[0] - before.q[0] == pytest.approx(0.5 * a * 0.03**2, rel=1e-8)


@pytest.mark.parametrize('way', [1, -1])
def test_what_a_freewheel_drives_is_held_no_more(way):
    """The drive turns both and the brake from the first instant on."""
    inertia, a, brake = 300e-6, 20.0, 3.0
    machine = weightless(
        links={
            'ground': {'points': {'m': [-120e-3, 0.0]}},
            'motor': {'mass': 0.4, 'inertia': inertia},
            'crank': {'mass': 0.6, 'inertia': CRANK},
        },
        joints={
            'motor_bearing': {'revolute': ['ground.m', 'motor']},
            'crank_bearing': {'revolute': ['ground', 'crank']},
            'wheel': {
                'freewheel': ['motor', 'crank'],
                'drives': 'counterclockwise' if way > 0 else 'clockwise',
            },
        },
        drive={'coordinate': 'motor', 'speed': f'{way * a}*t'},
        loads={'brake': {'at': 'crank', 'torque': f'-{brake}*sign(crank_rate)'}},
    )
    solution = ms.simulate(machine, duration=1.0)
    seen = without_work(solution, [0.01, 1.0])
    assert seen['velocity.crank'] == pytest.approx([0.01 * way * a, way * a], rel=1e-8)
    torque = way * ((inertia + CRANK) * a + brake)
    assert seen['drive_torque'] == pytest.approx(torque, rel=1e-9)
    assert solution.energy.drive_work == pytest.approx(0.5 * a * abs(torque), rel=1e-7)
    assert abs(solution.energy.residual) < 1e-10


def slipping_belt(**parts):
    """A pulley behind a belt that may slip on a driven one."""
    links = {
        'ground': {'points': {'m': [-120e-3, 0.0]}},
        'motor': {'mass': 0.4, 'inertia': 300e-6},
        'crank': {'length': 64e-3, 'mass': 0.6, 'inertia': CRANK},
    }
    joints = {
        'motor_bearing': {'revolute': ['ground.m', 'motor']},
        'crank_bearing': {'revolute': ['ground', 'crank']},
        'belt': {
            'belt': ['motor', 'crank'],
            'radii': [30e-3, 50e-3],
            'pretension': 500.0,
            'friction': {'coefficient': 0.3},
        },
    }
    return {
        'links': links | parts.pop('links', {}),
        'joints': joints | parts.pop('joints', {}),
        'drive': {'coordinate': 'motor', 'speed': 20.0},
        **parts,
    }


def test_what_stops_a_pulley_again_takes_work_from_the_drive():
    """An impulse on the rims: ``J (w - w') / 50 mm`` from the belt, and on the drive."""
    run = weightless(**slipping_belt()).start()
    present, switching = run._present, run._contacts.switching
    assert switching.rows == (HOLDS,)
    off = -1e-8
    present.v[:] = 12.0 + off
    found = switching.release()
    assert present.v[0] == pytest.approx(12.0, rel=1e-15)
    impulse = -CRANK * off / 50e-3 * 30e-3
    assert found.drive_impulse == pytest.approx(impulse, rel=1e-5)
    assert found.drive_work == pytest.approx(20.0 * impulse, rel=1e-5)
    # of that all is gained, but for half of the slip
    assert found.loss == pytest.approx(0.5 * CRANK * off * off, abs=1e-15)


def test_energy_balances_where_impacts_move_what_a_belt_holds():
    bob = {'length': 0.1, 'mass': 0.5, 'inertia': 500e-6, 'cog': 0.05}
    machine = made(
        slipping_belt(
            links={'bob': bob},
            joints={
                'pin': {
                    'revolute': ['crank.end', 'bob'],
                    'clearance': {'radial': '1 mm', 'restitution': 0.5},
                }
            },
            gravity=[0.0, -9.81],
            initial={'position': {'bob': '-90 deg'}},
        )
    )
    energy = ms.simulate(machine, duration=1.3).energy
    assert abs(energy.residual) < 1e-11


# --- strengths that end ----------------------------------------------------------------------

HALF, SPIN, STRONG, PUSH = math.pi / 3.0, 0.02, 2.0, 0.5  # [s], [kg m^2], [N m], [N m]
ON = 'sin(3*t) > 0'


def disks(*names, **parts):
    """Disks on the ground, each free to turn."""
    links = {name: {'mass': 1.0, 'inertia': SPIN} for name in names}
    joints = {f'j{name}': {'revolute': ['ground', name]} for name in names}
    return weightless(links={'ground': {}, **links}, joints=joints, **parts)


@pytest.mark.parametrize(
    'torque',
    [
        f'-({STRONG} if {ON} else 0)*sign(b_rate)',
        f'-{STRONG}*sign(b_rate) if {ON} else 0',
        f'-strength(3*t/{math.pi})*sign(b_rate)',
    ],
)
def test_a_brake_that_is_taken_off_lets_go(torque):
    """Half of the time pushed from rest, then braked down to it again, and held."""
    steps = [[0.0, STRONG], [1.0, STRONG], [1.0, 0.0], [2.0, 0.0]]
    machine = disks(
        'b',
        tables={'strength': {'points': steps, 'periodic': True}},
        loads={'push': {'at': 'b', 'torque': PUSH}, 'brake': {'at': 'b', 'torque': torque}},
    )
    solution = ms.simulate(machine, duration=10.5 * HALF)
    rate = PUSH / SPIN * HALF
    each = 0.5 * rate * HALF + 0.5 * rate**2 / ((STRONG - PUSH) / SPIN)
    seen = without_work(solution, [0.5 * HALF, 1.5 * HALF, 6.5 * HALF, 10.5 * HALF])
    gone = [0.0, 0.125 * rate * HALF, 3.0 * each, 5.0 * each]
    assert seen['position.b'] == pytest.approx(gone, rel=1e-10, abs=1e-10)
    assert seen['velocity.b'] == pytest.approx([0.0, 0.5 * rate, 0.0, 0.0], rel=1e-10, abs=1e-10)
    assert abs(solution.energy.residual) < 1e-11


@pytest.mark.parametrize('strength', [f'max({STRONG}*sin(3*t), 0)', 'ramp(t)'])
def test_what_nothing_pushes_rests_while_its_brake_fades_and_comes_back(strength):
    ends = [[0.0, STRONG], [1.0, STRONG], [1.5, 0.0], [2.0, 0.0], [2.5, STRONG], [3.0, STRONG]]
    machine = disks(
        'b',
        tables={'ramp': {'points': ends, 'periodic': True}},
        loads={'brake': {'at': 'b', 'torque': f'-{strength}*sign(b_rate)'}},
    )
    run = machine.start()
    run.advance(10.0, final=True)
    assert [*run.state.q, *run.state.v] == pytest.approx([0.0, 0.0], abs=1e-11)


def test_a_clutch_and_a_brake_act_in_turn():
    """The disk runs up as the clutch drags it, and stops as the brake does: areas of trapezia."""
    machine = disks(
        'a',
        'b',
        drive={'coordinate': 'a', 'speed': 10.0},
        loads={
            'clutch': {
                'at': 'b',
                'reaction': 'a',
                'torque': f'-({STRONG} if {ON} else 0)*sign(b_rate - a_rate)',
            },
            'brake': {'at': 'b', 'torque': f'-(0 if {ON} else {STRONG})*sign(b_rate)'},
        },
    )
    solution = ms.simulate(machine, duration=12.0 * HALF)
    seen = without_work(solution, [0.5 * HALF, 1.5 * HALF, 12.0 * HALF])
    assert seen['velocity.b'] == pytest.approx([10.0, 0.0, 0.0], abs=1e-10)
    assert seen['position.b'][-1] == pytest.approx(6 * 10.0 * HALF, rel=1e-9)
    # each time what the clutch gives the disk, and as much that it loses itself
    assert solution.energy.drive_work == pytest.approx(6 * SPIN * 10.0**2, rel=1e-9)


def test_of_two_that_hold_only_the_one_without_strength_lets_go():
    """A clutch keeps two disks together when their brake is taken off: both are pushed as one."""
    machine = disks(
        'a',
        'b',
        loads={
            'clutch': {'at': 'a', 'reaction': 'b', 'torque': f'-{STRONG}*sign(a_rate - b_rate)'},
            'brake': {'at': 'b', 'torque': f'-({STRONG} if {ON} else 0)*sign(b_rate)'},
            'push': {'at': 'a', 'torque': PUSH},
        },
    )
    run = machine.start()
    run.advance(0.9 * HALF, final=True)
    held, before = run._contacts.switching.rows, run.events
    run.advance(1.5 * HALF, final=True)
    rows = run._contacts.switching.rows
    turned = [k for k, (old, new) in enumerate(zip(held, rows, strict=True)) if old != new]
    assert [held[k] for k in turned].count(HOLDS) == 1
    assert rows.count(HOLDS) == 1
    rate = 0.5 * PUSH / SPIN * 0.5 * HALF
    assert run.state.v == pytest.approx([rate, rate], rel=1e-10)
    assert run.events == before + 1


def test_a_brake_lets_go_that_a_new_law_takes_off():
    """Where the rate that engages it passes its limit just as the law changes."""
    machine = disks(
        'a',
        'b',
        drive={'coordinate': 'a', 'speed': '6 - t'},
        loads={
            'push': {'at': 'b', 'torque': PUSH},
            'brake': {'at': 'b', 'torque': f'-({STRONG} if a_rate > 5 else 0)*sign(b_rate)'},
        },
    )
    run = machine.start()
    run.change_law(DriveLaw('a', (5.5, 5.0, -0.5), 1.0, 1.0))
    run.advance(1.0, final=True)
    assert run.state.v == pytest.approx([0.0], abs=1e-11)
    run.advance(2.0, final=True)
    assert run.state.v == pytest.approx([PUSH / SPIN], rel=1e-9)


@pytest.mark.parametrize('on', ['abs(b_rate) < 0.1', 'a_rate > 5'])
def test_a_brake_holds_by_what_a_condition_on_a_rate_leaves_of_it(on):
    """Two conditions on rates multiply: what holds has the strength of the other as it is."""
    brake = {'at': 'b', 'torque': f'-(3 if {on} else {STRONG})*sign(b_rate)'}
    parts = {'drive': {'coordinate': 'a', 'speed': 6.0}}
    for push, rate in ((2.5, 0.0), (3.5, 0.05)):
        loads = {'push': {'at': 'b', 'torque': push}, 'brake': brake}
        run = disks('a', 'b', loads=loads, **parts).start()
        run.advance(rate * SPIN / 0.5 or 1.0, final=True)
        assert run.state.v == pytest.approx([rate], rel=1e-9, abs=1e-11)
