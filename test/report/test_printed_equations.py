"""The equations that `equations` prints, read back and held against what the engine computes."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import dedent
from xml.etree import ElementTree

import heyoka as hy
import numpy as np
import pytest
from matplotlib.mathtext import MathTextParser
from running import TIMEOUT, environment, one_of, run, run_json

import mechanism_sim as ms
from mechanism_sim.catalogue import scene_names
from mechanism_sim.engine.events import Mode
from mechanism_sim.engine.observer import Instants, Observer
from mechanism_sim.numerics.symbolic import add, dense, mul
from mechanism_sim.planar.drive import DriveLaw, TorqueLaw
from mechanism_sim.planar.reactions import generalized_forces
from mechanism_sim.planar.switches import SwitchTable
from mechanism_sim.planar.virtual_work import generalised
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.schema import Scene

sympy = pytest.importorskip('sympy')

from mechanism_sim.report.derivation import derive  # noqa: E402
from mechanism_sim.report.typeset import Typesetter  # noqa: E402

LOOSE = 'joints.{}.clearance.'
AT = LOOSE.format('coupler_rocker')
RUBBING = {AT + 'friction': 0.2, AT + 'pin_radius': '4 mm'}
VARIANTS = {
    **{name: (name, {}) for name in scene_names()},
    'profile': (
        'four_bar_nominal',
        {'drive.speed': None, 'drive.profile': {'points': [[0, 1], [1, 30]], 'ramp': 'smooth'}},
    ),
    'motor': ('four_bar_nominal', {'drive.motor': {'stall_torque': 2, 'no_load_speed': 40}}),
    'induction': ('four_bar_nominal', {'drive.motor': {'ratio': 2, 'induction': {
        'synchronous_speed': 90, 'rated_speed': 80, 'rated_torque': 1, 'breakdown_torque': 3}}}),
    'unknown': ('slider_crank', {'drive.effort': '3 + sin(crank)', 'loads.r': {
        'at': 'rod.end', 'force': [1, -2], 'frame': 'link', 'reaction': 'ground',
        'unknown': True}}),
    'rubbing': ('four_bar_clearance', RUBBING),
    'all loose': (
        'four_bar_clearance',
        {'drive.torque.constant': 0.3, 'drive.torque.per_speed': -0.01}
        | RUBBING
        | {
            LOOSE.format(joint) + key: value
            for joint in ('ground_crank', 'crank_coupler', 'rocker_ground')
            for key, value in (('radial', '0.1 mm'), ('restitution', 0.3))
        },
    ),
    'compliant': (
        'four_bar_clearance',
        RUBBING | {AT + 'contact': {'law': 'flores', 'stiffness': 1e10}},
    ),
    'parting': (
        'four_bar_clearance',
        {'start': 'centred', AT + 'restitution': 0.5}
        | {AT + 'contact': {'law': 'flores', 'stiffness': 1e9}},
    ),
    'film': (
        'four_bar_clearance',
        {'start': 'centred'}
        | {AT + 'contact.' + key: value for key, value in (
            ('law', 'film'), ('viscosity', 0.05), ('width', '20 mm'), ('radius', '10 mm'),
        )},
    ),
}  # fmt: skip


SCENES = {
    'slider_with_loads': """
        title: Offset slider-crank with a spring and loads
        mechanism: linkage
        links:
          ground: {points: {guide: [0 mm, 20 mm], wall: [400 mm, 30 mm]}}
          crank: {length: 50 mm, mass: 0.5 kg, inertia: 300 kg mm^2, cog: 20 mm}
          rod:
            {length: 200 mm, points: {tracer: [100 mm, 60 mm]}, mass: 0.4 kg,
             inertia: 900 kg mm^2, cog: [90 mm, 5 mm]}
          piston: {mass: 0.8 kg}
        joints:
          ground_crank: {revolute: [ground, crank]}
          crank_rod: {revolute: [crank.end, rod]}
          rod_piston: {revolute: [rod.end, piston]}
          piston_ground: {prismatic: [ground.guide, piston], axis: 3 deg}
        gravity: [0, -9.81 m/s^2]
        drive: {coordinate: crank, speed: 300 rpm, start_angle: 30 deg}
        guess: {rod: -10 deg, piston: 240 mm}
        springs:
          return:
            {between: [ground.wall, rod.tracer], stiffness: 200 N/m, free_length: 100 mm,
             damping: 5 N s/m}
        loads:
          cutting:
            {at: piston, force: [-400 N, 0 N],
             during: {coordinate: crank, from: 20 deg, to: 160 deg}}
          follower: {at: rod.tracer, force: [10 N, 3 N], frame: link}
          wind: {at: piston, force: ["3*sin(20*t) - 5*vx*abs(vx)", 0]}
          brake: {at: crank, torque: "-0.02*crank_rate"}
    """,
    'torsion_return': """
        title: Quick return, its block on a guide that turns, with a torsion spring
        mechanism: linkage
        links:
          ground: {points: {lever: [0 mm, -80 mm]}}
          crank: {length: 30 mm, mass: 0.2 kg, inertia: 50 kg mm^2, cog: 15 mm}
          lever: {length: 200 mm, mass: 0.6 kg, inertia: 2000 kg mm^2, cog: 100 mm}
          block: {mass: 0.1 kg, inertia: 10 kg mm^2, cog: [3 mm, 1 mm]}
        joints:
          ground_crank: {revolute: [ground, crank]}
          ground_lever: {revolute: [ground.lever, lever]}
          lever_block: {prismatic: [lever, block], angle: 30 deg}
          crank_block: {revolute: [crank.end, block]}
        gravity: [0, -9.81 m/s^2]
        drive:
          {coordinate: crank, torque: {constant: 0.3 N m, per_speed: -0.02 N m s/rad},
           speed: 5 rad/s}
        guess: {lever: 80 deg, block: 110 deg}
        springs:
          torsion:
            {between: [ground, lever], stiffness: 3 N m/rad, free_angle: 70 deg,
             damping: 0.1 N m s/rad}
    """,
    'skew_slot': """
        title: Pin in a slot
        mechanism: linkage
        links:
          ground: {points: {lever: [0 mm, -80 mm]}}
          crank: {length: 30 mm, mass: 0.2 kg, inertia: 50 kg mm^2, cog: 15 mm}
          lever: {length: 200 mm, mass: 0.6 kg, inertia: 2000 kg mm^2, cog: 100 mm}
        joints:
          ground_crank: {revolute: [ground, crank]}
          ground_lever: {revolute: [ground.lever, lever]}
          pin: {slot: [crank.end, lever], axis: 5 deg}
        drive: {coordinate: crank, speed: 60 rpm}
        guess: {lever: 80 deg}
    """,
    'geneva_wheel': """
        title: Geneva wheel of four slots
        mechanism: linkage
        links:
          ground: {points: {wheel_centre: [70.710678118654752 mm, 0 mm]}}
          crank: {length: 50 mm, mass: 0.6 kg, inertia: 600 kg mm^2}
          wheel: {length: 50 mm, mass: 0.9 kg, inertia: 900 kg mm^2}
        joints:
          ground_crank: {revolute: [ground, crank]}
          ground_wheel: {revolute: [ground.wheel_centre, wheel]}
          crank_wheel: {geneva: [crank.end, wheel], slots: 4}
        drive: {speed: 120 rpm, start_angle: 300 deg}
        guess: {wheel: 135 deg}
        loads: {bearing: {at: wheel, torque: "-0.02*wheel_rate"}}
    """,
    'driven_cylinder': """
        title: Oscillating cylinder whose rod is driven
        mechanism: linkage
        links:
          ground: {points: {trunnion: [300 mm, 0 mm]}}
          crank: {length: 60 mm, mass: 0.5 kg, inertia: 300 kg mm^2, cog: 20 mm}
          cylinder: {mass: 1 kg, inertia: 2000 kg mm^2, cog: 20 mm}
          rod: {length: 120 mm, mass: 0.4 kg, inertia: 400 kg mm^2, cog: [60 mm, 4 mm]}
        joints:
          ground_crank: {revolute: [ground, crank]}
          ground_cylinder: {revolute: [ground.trunnion, cylinder]}
          cylinder_rod: {prismatic: [cylinder, rod]}
          crank_rod: {revolute: [crank.end, rod.end]}
        gravity: [0, -9.81 m/s^2]
        drive:
          {coordinate: rod, force: {constant: 20 N, per_speed: -8 N s/m}, start_position: 160 mm}
        guess: {crank: 60 deg, cylinder: 170 deg}
    """,
}
VARIANTS |= {name: (name, {}) for name in SCENES}
VARIANTS['no forces'] = ('slider_with_loads', {'outputs.forces': False})


@cache
def machine_of(variant):
    scene, overrides = VARIANTS[variant]
    if scene not in SCENES:
        return ms.load_scene(scene, overrides=overrides)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f'{scene}.yaml'
        path.write_text(dedent(SCENES[scene]))
        return ms.load_scene(str(path), overrides=overrides)


@cache
def setter(variant):
    return Typesetter(derive(machine_of(variant), rates=True))


@cache
def printed(variant):
    return setter(variant).to_json()


@cache
def read(text):
    """Names in printed text, and its value as a function of theirs."""
    words = re.findall(r'[A-Za-z_]\w*\b(?!\()', text)  # but for functions
    names = {word: sympy.Symbol(word) for word in words}
    expression = sympy.parse_expr(text, local_dict=names)
    symbols = sorted(expression.free_symbols, key=str)
    return [s.name for s in symbols], sympy.lambdify(symbols, expression, 'numpy')


class Reader:
    """Evaluates printed text with the numbers it is given, and those it has found."""

    def __init__(self, page, **given):
        self.page = page
        self.values = {p['text']: p['value'] for p in page['parameters']} | given

    def __call__(self, text):
        names, evaluate = read(text)
        return float(evaluate(*(self.values[name] for name in names)))

    def sides(self, equation):
        return equation['text'].split(' = ')

    def begin(self):
        """Work out the vectors, and what acts where in the cycle."""
        self.define('vectors')
        for e in self.page.get('switches', []):  # of which one may depend on those before it
            flag, (left, right) = e['note'].split()[0], self.sides(e)
            self.values[left] = self(right)
            self.values[flag] = float(self.values[left] > 0.0)

    def define(self, *parts):
        """Work through parts whose left-hand sides are symbols."""
        found = []
        for part in parts:
            for equation in self.page.get(part, []):
                left, right = self.sides(equation)
                self.values[left] = self(right)
                found.append(self.values[left])
        return np.array(found)


def equations_of(machine):
    return model_of(machine).equations


def model_of(machine):
    return machine.equations.system if machine.level.dynamic else machine.nominal.inverse_dynamics


def engine(machine, terms, state, parameters=()):
    """Values of the engine's own terms in a state (q, v, a), compiled by heyoka."""
    eq = equations_of(machine)
    symbols = [*eq.frames.q.values(), *eq.frames.v.values(), *eq.frames.a.values()]
    expressions = [*(dense(t) for t in terms), hy.expression(0.0)]
    rows = present_rows(eq, *state[:2]) | dict.fromkeys(turns_of(eq), 0.0) | states_of(eq)
    expressions = list(hy.subs(expressions, {x: hy.expression(n) for x, n in rows.items()}))
    function = hy.cfunc(expressions, vars=symbols, opt_level=0)
    values = np.array(eq.parameters.values)
    for name, value in parameters:
        values[eq.parameters.names[name]] = value
    return function(np.concatenate(state), pars=values[: function.nparams])[:-1]


def angles_as_such(eq):
    """Parameters with which closures of angles stay angles, as they are printed."""
    return [(name, 1.0) for name in eq.parameters.names if name.endswith('.size')]


def turns_of(eq):
    """Whole turns of coordinates, none here."""
    return [x for name, x in eq.frames.outside.items() if name.endswith('.turns')]


def states_of(eq):
    """Values of states of first order, any that their formulas take."""
    outside = eq.frames.outside.items()
    return {x: 1e6 + int(name[6:]) for name, x in outside if name.startswith('state:')}


def present_rows(eq, q, v):
    """The numbers of all switches at coordinates q and rates v."""
    found = {}
    waiting = [*eq.frames.switches.values()]
    while waiting:  # where one depends on others, these are the first
        switch = waiting.pop(0)
        known = dict.fromkeys(turns_of(eq), 0.0) | states_of(eq) | found
        others = {str(x) for other in waiting for x in other.symbols}
        if others.intersection(hy.get_variables(switch.place)):
            waiting.append(switch)
            continue
        wound = hy.subs(switch.place, {x: hy.expression(n) for x, n in known.items()})
        place = hy.cfunc([wound], [*eq.frames.q.values(), *eq.frames.v.values()], opt_level=0)
        (at,) = place(np.concatenate([q, v]), pars=np.array(eq.parameters.values)[: place.nparams])
        numbers = switch.values_at(np.array([at]))[:, 0]
        found |= zip(switch.symbols, numbers.tolist(), strict=True)
    return found


def second_derivative(jet, frames):
    return add(*(mul(slope, frames.a[c]) for c, slope in jet.gradient.items()), jet.curvature)


def anywhere(machine):
    """A state (q, v, a), not one that the machine can reach."""
    rng = np.random.default_rng(5)
    n = len(machine.mechanism.coordinates)
    return rng.uniform(-3.0, 3.0, n), rng.uniform(-40.0, 40.0, n), rng.uniform(-1e3, 1e3, n)


def in_motion(machine, time):
    """The state at a time [s] of a run."""
    at = ms.simulate(machine, duration=1.5 * time).sample([time])
    return tuple(
        np.array([at[f'{kind}.{c}'][0] for c in machine.mechanism.coordinates])
        for kind in ('position', 'velocity', 'acceleration')
    )


def reader_of(variant, state):
    page = printed(variant)
    given = {}
    for i, c in enumerate(page['coordinates']):
        for key, values in zip(('text', 'rate', 'acceleration'), state, strict=True):
            given[c[key]] = values[i]
    eq = equations_of(machine_of(variant))
    rows = present_rows(eq, *state[:2])
    for name, table in eq.frames.switches.items():
        if isinstance(table, SwitchTable):
            for k, symbol in enumerate(table.symbols):
                given[f'c{k}_{name}'] = rows[symbol]
    given |= {f'n_{x[:-6]}': 0.0 for x in eq.frames.outside if x.endswith('.turns')}
    labels = [x.label for x in machine_of(variant).plan.states]
    given |= {f'xi_{label}': 1e6 + k for k, label in enumerate(labels)}
    return Reader(page, **given)


def close(found, expected, bound=1e-12):
    found, expected = np.asarray(found, float), np.asarray(expected, float)
    scale = np.abs(expected).max(initial=0.0)
    np.testing.assert_allclose(found, expected, rtol=bound, atol=bound * scale)


@pytest.mark.sample(3)
@pytest.mark.parametrize('variant', one_of(4, VARIANTS))
def test_printed_closures_and_gaps_are_those_of_the_engine(variant):
    machine = machine_of(variant)
    eq, state = equations_of(machine), anywhere(machine)
    reader = reader_of(variant, state)
    page = reader.page
    assert [c['name'] for c in page['coordinates']] == list(eq.coordinates)
    reader.begin()
    quantities = (
        lambda jet: jet.value, lambda jet: jet.rate, lambda jet: second_derivative(jet, eq.frames)
    )  # fmt: skip
    for part, quantity in zip(
        ('closures', 'closure_rates', 'closure_accelerations'), quantities, strict=True
    ):
        found = [reader(reader.sides(e)[0]) for e in page.get(part, [])]
        expected = engine(machine, map(quantity, eq.relation_jets), state, angles_as_such(eq))
        close(found, expected)
    terms = [jet.value for jet in eq.gap_jets]
    for i, gap in enumerate(eq.gaps):
        if gap.friction:
            terms.append(machine.equations.system.dynamics.contacts.tangent[i].rate)
    close(sorted(reader.define('gaps')), sorted(engine(machine, terms, state)))
    for part, quantity in zip(('gap_rates', 'gap_accelerations'), quantities[1:], strict=True):
        close(reader.define(part), engine(machine, map(quantity, eq.gap_jets), state))


@pytest.mark.sample(6)
@pytest.mark.parametrize('variant', VARIANTS)
def test_printed_equations_of_motion_are_those_of_the_engine(variant):
    """Left: M a + h; right: every force alone, along its row of the Jacobian."""
    machine = machine_of(variant)
    eq, state = equations_of(machine), anywhere(machine)
    reader = reader_of(variant, state)
    motion = reader.page.get('motion', [])
    if machine.level.value == 'kinematic':
        assert not {'motion', 'forces', 'switches', 'vectors'} & set(reader.page)
        return
    reader.begin()
    reader.define('gaps')
    left = [reader(reader.sides(e)[0]) for e in motion]
    close(left, engine(machine, generalized_forces(eq, eq.frames.a), state))
    if rates := reader.page.get('states'):
        given = [reader(reader.sides(e)[1]) for e in rates]
        close(given, engine(machine, model_of(machine).dynamics.state_rates, state))
    unknown = [s['text'] for s in reader.page['variables']]
    closing = [name for name in unknown if name.startswith('lambda')]
    rows = {
        name: engine(machine, jet.row(eq.coordinates), state, angles_as_such(eq))
        for name, jet in zip(closing, eq.relation_jets, strict=True)
    }
    for i, (gap, jet) in enumerate(zip(eq.gaps, eq.gap_jets, strict=True)):
        rows[f'N_{gap.name}'] = engine(machine, jet.row(eq.coordinates), state)
        if gap.friction:
            slip = machine.equations.system.dynamics.contacts.tangent[i].row(eq.coordinates)
            rows[f'T_{gap.name}'] = engine(machine, slip, state)
    for driven, laws in machine.plan.laws.items():
        moved = driven in (motor.coordinate for motor in machine.plan.motors)
        if laws == (TorqueLaw(driven),) and not moved:
            continue  # free: no drive is printed
        stem = 'F' if driven in machine.mechanism.displacements else 'tau'
        rows[f'{stem}_{driven}'] = np.array([c == driven for c in eq.coordinates])
    for element in model_of(machine).elements:
        for c in generalised(element.loads(eq.frames), eq.frames, eq.mechanism):
            name = element.name.partition('.')[2] or element.name
            rows[f'Q_{name}_{c.replace(".", "_")}'] = np.array([d == c for d in eq.coordinates])
    model = model_of(machine)
    for joint in (
        model.dynamics.frictional_joints if machine.level.dynamic else model._frictional_joints
    ):
        found = generalised(
            joint.friction.loads(eq.frames, hy.expression(1.0)), eq.frames, eq.mechanism
        )
        terms = [found.get(c) for c in eq.coordinates]
        rows[f'T_{joint.friction.label}'] = engine(machine, terms, state)
    for load in machine.plan.unknowns(eq.mechanism):
        found = generalised(load.loads(eq.frames), eq.frames, eq.mechanism)
        terms = [found.get(c) for c in eq.coordinates]
        rows[f'f_{load.label}'] = engine(machine, terms, state)
    for force, row in rows.items():
        reader.values |= dict.fromkeys(rows, 0.0) | {force: 1.0}
        close([reader(reader.sides(e)[1]) for e in motion], row)


@pytest.mark.parametrize('variant', ['four_bar_nominal', 'profile'])
def test_forces_of_inverse_dynamics_fulfil_the_printed_equations(variant):
    machine = machine_of(variant)
    state = in_motion(machine, 0.7)
    reader = reader_of(variant, state)
    inverse = machine.nominal.inverse_dynamics(*(x[:, None] for x in state))
    joints = [j.name for j in machine.mechanism.joints]
    on_second = inverse.reaction[joints.index('coupler_rocker'), :, 0]
    reader.values['lambdax_coupler_rocker'] = -on_second[0]
    reader.values['lambday_coupler_rocker'] = -on_second[1]
    reader.values['tau_crank'] = inverse.drive_torque[0, 0]
    sides = [[reader(s) for s in reader.sides(e)] for e in reader.page['motion']]
    close([left for left, _ in sides], [right for _, right in sides])


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    'variant', ['four_bar_clearance', 'rubbing', 'motor', 'induction', 'compliant', 'film']
)
def test_motion_that_is_solved_fulfils_the_printed_equations(variant):
    """Accelerations and forces of the compiled system, in the contact that rubs or presses."""
    machine = machine_of(variant)
    system = machine.equations.system
    q, v, _ = in_motion(machine, 0.0137)
    sliding = (
        Mode.SLIDING_FORWARD if system.frictional and not system.compliant else Mode.FOLLOWING
    )
    modes = np.full((len(system.gaps), 1), sliding, np.uint8)
    if system.compliant:  # pressed in by some micrometres
        q = pressed_in(machine, q)
    torque = None
    if system.powered:
        constant, _, per_speed = machine.drive.law.coefficients
        torque = np.array([[constant + per_speed * v[0]]])
    approach = np.full((len(system.gaps), 1), 0.3) if system.compliant else None
    a_p = np.zeros((len(system.prescribed), 1))
    seen = Observer(system).observe(Instants(q[:, None], v[:, None], a_p, modes, torque, approach))
    reader = reader_of(variant, (q, v, seen.acceleration[:, 0]))
    reader.values |= {'v0_coupler_rocker': 0.3, 't': 0.0}
    reader.begin()
    reader.define('gaps', 'gap_rates')
    if system.compliant:
        assert reader.values['g_coupler_rocker'] < 0.0
    else:
        for i, gap in enumerate(system.gaps):
            reader.values[f'N_{gap.name}'] = seen.normal_force[i, 0]
            reader.values[f'T_{gap.name}'] = seen.friction_force[i, 0]
    if machine.torque_driven:
        reader.define('drive_laws')
    else:
        reader.values['tau_crank'] = seen.drive_torque[0, 0]
    reader.define('forces')
    joints = [j.name for j in machine.mechanism.joints]
    for relation in system.relations:
        x, y = -seen.reaction[joints.index(relation.name), :, 0]
        reader.values |= {f'lambdax_{relation.name}': x, f'lambday_{relation.name}': y}
    sides = np.array([[reader(s) for s in reader.sides(e)] for e in reader.page['motion']])
    scale = np.abs(sides).max()
    np.testing.assert_allclose(sides[:, 0], sides[:, 1], rtol=1e-11, atol=1e-11 * scale)


@pytest.mark.slow
def test_forces_of_a_compliant_contact_are_the_printed_law_where_that_says_they_act():
    """In flight, pressing, and parting faster than the law presses: where it would pull."""
    machine = machine_of('parting')
    solution = ms.simulate(machine, revolutions=1.1)
    page = printed('parting')
    assert page['notes']['gaps'] == [
        'coupler_rocker: its forces are those below while g_coupler_rocker < 0 and '
        'N_coupler_rocker so found is positive, and zero otherwise.'
    ]
    motion, modes = solution.motion, solution.motion.modes[:, 0]
    for mode in (Mode.FREE_FLIGHT, Mode.FOLLOWING, Mode.RECOVERING):
        k = np.flatnonzero(modes == mode)
        assert k.size
        k = k[[k.size // 2]]
        dt = 0.5 * motion.curve.duration[k]
        seen = solution.physics.observe(motion, k, dt)
        reader = reader_of(
            'parting', (seen.position[:, 0], seen.velocity[:, 0], seen.acceleration[:, 0])
        )
        reader.values |= {
            't': motion.curve.start[k[0]] + dt[0],
            'v0_coupler_rocker': motion.approach[k[0], 0],
            'tau_crank': seen.drive_torque[0, 0],
        }
        reader.begin()
        reader.define('gaps', 'gap_rates')
        overlaps = reader.values['g_coupler_rocker'] < 0.0
        assert overlaps == (mode != Mode.FREE_FLIGHT)
        if overlaps:
            reader.define('forces')
            assert (reader.values['N_coupler_rocker'] > 0.0) == (mode == Mode.FOLLOWING)
        if mode != Mode.FOLLOWING:
            reader.values['N_coupler_rocker'] = 0.0
        sides = [[reader(s) for s in reader.sides(e)] for e in page['motion']]
        close([left for left, _ in sides], [right for _, right in sides], 1e-11)


@pytest.mark.sample(2)
@pytest.mark.parametrize('variant', ['four_bar_nominal', 'profile', 'motor', *SCENES])
def test_printed_text_alone_gives_accelerations_and_drive_forces(variant):
    """The printed rows, linear in what is unknown, solved beside what the engine says."""
    machine = machine_of(variant)
    time = 0.0437
    q, v, a = in_motion(machine, time)
    reader = reader_of(variant, (q, v, a))
    page = reader.page
    turns = [s['text'] for s in page['variables'] if s['name'].endswith('.turns')]
    reader.values |= dict.fromkeys(turns, 0.0) | {'t': time}
    reader.begin()
    reader.define('forces')
    prescribed = machine.plan.prescribed
    unknown = [s['text'] for s in page['variables'] if s['text'].startswith('lambda')]
    drives = []
    for c in page['coordinates']:
        if c['name'] not in prescribed:
            unknown.append(c['acceleration'])
        elif not machine.level.dynamic:
            drives.append(('tau_' if c['unit'] == 'rad' else 'F_') + c['name'])
    if machine.torque_driven:
        reader.define('drive_laws')
    unknown += drives
    rows = [reader.sides(e) for part in ('motion', 'closure_accelerations') for e in page[part]]

    def residual():
        return np.array([reader(left) - reader(right) for left, right in rows])

    reader.values |= dict.fromkeys(unknown, 0.0)
    constant = residual()
    columns = []
    for name in unknown:
        reader.values |= dict.fromkeys(unknown, 0.0) | {name: 1.0}
        columns.append(residual() - constant)
    found = dict(zip(unknown, np.linalg.solve(np.array(columns).T, -constant), strict=True))
    for c, expected in zip(page['coordinates'], a, strict=True):
        if c['name'] not in prescribed:
            assert found[c['acceleration']] == pytest.approx(expected, rel=1e-9, abs=1e-9)
    if not machine.level.dynamic:
        forces = machine.nominal.inverse_dynamics(
            *(x[:, None] for x in (q, v, a)), *outside(machine, time)
        )
        close([found[name] for name in drives], forces.drive_torque[:, 0], 1e-9)


def outside(machine, time):
    """Values that loads need beside the motion."""
    names = machine.nominal.inverse_dynamics.outside
    return [np.array([[time if name == 'time' else 0.0] for name in names])] if names else []


def pressed_in(machine, q):
    """Coordinates with the rocker turned until the pin is 10 micrometres deep."""
    system = machine.equations.system
    for angle in np.linspace(0.0, 2e-3, 2001):
        moved = q + angle * (np.array(system.coordinates) == 'rocker')
        gap = machine.equations.observer.gaps.distances(
            machine.equations.observer.gaps.values(moved[:, None], np.zeros((0, 1)))
        )[0, 0]
        if -2e-5 < gap < -5e-6:
            return moved
    raise AssertionError('never pressed in')


def test_laws_of_the_drive_are_printed_with_the_times_from_which_they_hold():
    machine = machine_of('profile')
    laws = [e for e in printed('profile')['drive_laws'] if e['text'].startswith('theta_')]
    assert len(laws) == len(machine.drive.laws) > 1
    for law, e in zip(machine.drive.laws, laws, strict=True):
        assert isinstance(law, DriveLaw)
        assert e['note'] == f'for t >= {law.valid_from!r} s'
        t = law.valid_from + 0.37
        expected = np.polynomial.polynomial.polyval(t - law.reference_time, law.coefficients)
        reader = Reader(printed('profile'), t=t)
        assert reader(reader.sides(e)[1]) == pytest.approx(expected, rel=1e-12)


def test_the_four_bar_reads_as_in_the_thesis():
    """[SB] 4.1-20 and 4.2-1: I_A3, I_O4, m3 l2 S3 with the angle between crank and coupler."""
    page = printed('four_bar_clearance')
    rows = {e['name']: e['text'].split(' = ')[0] for e in page['motion']}
    assert rows['coupler'] == (
        'I_coupler*thetaddot_coupler + P_crank_coupler*thetaddot_crank*cos(theta_coupler - '
        'theta_crank) + P_crank_coupler*thetadot_crank**2*sin(theta_coupler - theta_crank) + '
        'W_coupler*cos(theta_coupler)'
    )
    assert rows['rocker'] == 'I_rocker*thetaddot_rocker + W_rocker*cos(theta_rocker)'
    values = {p['text']: p['value'] for p in page['parameters']}
    assert values['P_crank_coupler'] == pytest.approx(0.2439 * 0.064 * 0.185, rel=1e-14)
    assert values['I_coupler'] == pytest.approx(2950e-6 + 0.2439 * 0.185**2, rel=1e-14)
    assert values['c_coupler_rocker'] == 0.254e-3
    assert all(value > 0.0 for value in values.values())


@pytest.mark.slow
def test_another_process_prints_the_same():
    """Whatever the order in which sets of symbols come: it differs from process to process."""
    args = 'check', 'four_bar_clearance', '--equations', '--rates'
    assert run(*args).stdout == run(*args, env=environment() | {'PYTHONHASHSEED': '1'}).stdout


@pytest.mark.slow
def test_the_same_scene_is_always_printed_the_same():
    """Whatever the order in which sets of symbols come."""
    texts = {
        run(
            'check', 'four_bar_clearance', '--equations', '--rates',
            env=environment() | {'PYTHONHASHSEED': seed},
        ).stdout
        for seed in '12'
    }  # fmt: skip
    assert len(texts) == 1


@pytest.mark.sample(7)
@pytest.mark.parametrize('variant', VARIANTS)
def test_latex_is_balanced(variant):
    text = setter(variant).document()
    assert balanced(text)
    assert len(re.findall(r'\\left\W', text)) == len(re.findall(r'\\right\W', text))
    environments = []
    for what, name in re.findall(r'\\(begin|end)\{(\w+)\}', text):
        if what == 'begin':
            environments.append(name)
        else:
            assert environments.pop() == name
    assert not environments
    assert '_' not in re.sub(r'\\_|_\{', '', text)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    'variant', ['rubbing', 'compliant', 'film', 'slider_with_loads', 'torsion_return']
)
def test_every_formula_is_read_by_another_program(variant):
    """The mathematics of matplotlib: a smaller LaTeX, written by others."""
    page, parser = printed(variant), MathTextParser('path')
    tables = ('coordinates', 'parameters', 'variables')
    symbols = [s['latex'] for table in tables for s in page[table]]
    equations = [
        line.replace('&', '')
        for name, part in page.items() if isinstance(part, list) and name not in tables
        for e in part
        for line in e['latex'].split('\\\\')
    ]  # fmt: skip
    assert len(equations) > 4
    for formula in {x.strip() for x in (*symbols, *equations)}:
        parser.parse(f'${formula}$')


def balanced(text):
    depth = 0
    for brace in re.findall(r'(?<!\\)[{}]', text):
        depth += 1 if brace == '{' else -1
        if depth < 0:
            return False
    return depth == 0


@pytest.mark.skipif(
    not (shutil.which('tectonic') or shutil.which('pdflatex')), reason='no LaTeX here'
)
@pytest.mark.parametrize('variant', ['four_bar_clearance', 'all loose', 'film'])
def test_latex_compiles(variant, tmp_path):
    source = tmp_path / 'equations.tex'
    source.write_text(setter(variant).document())
    program = shutil.which('tectonic') or shutil.which('pdflatex')
    options = [] if program.endswith('tectonic') else ['-halt-on-error']
    subprocess.run([program, *options, source.name], cwd=tmp_path, check=True, capture_output=True)
    assert source.with_suffix('.pdf').exists()


def test_command_line(tmp_path):
    page = run_json('check', 'four_bar_clearance', '--equations')
    assert page == json.loads(json.dumps(page))
    assert set(page) == {
        'scene', 'title', 'level', 'coordinates', 'parameters', 'variables', 'drive_laws',
        'vectors', 'gaps', 'motion', 'notes',
    }  # fmt: skip
    assert set(page['motion'][0]) == {'name', 'latex', 'text'}
    text = run('check', 'four_bar_clearance', '--equations').stdout
    joined = ' '.join(text.split())
    assert all(e['text'] in joined for e in page['motion'])
    assert run('check', 'four_bar_nominal', '--equations', '--latex').stdout.startswith('% needs')
    assert '$$' in run('check', 'four_bar_nominal', '--equations', '--markdown').stdout
    file = tmp_path / 'machine.tex'
    done = run('check', 'four_bar_crossed', '--equations', '-o', str(file))
    assert (done.returncode, done.stdout) == (0, '')
    assert file.read_text().startswith(r'\documentclass')


def test_without_sympy_it_says_what_to_install():
    code = (
        "import sys; sys.modules['sympy'] = None; from mechanism_sim.cli import main; "
        "main(['check', 'four_bar_nominal', '--equations'])"
    )
    command = [sys.executable, '-c', code]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.endswith("pip install 'mechanism_sim[equations]'\n")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (['-o', 'machine.doc'], 'the ending must be'),
        (['-o', '/nowhere/machine.tex'], "there is no directory '/nowhere'"),
        (['--set', 'drive.speed=1 kg'], 'drive.speed'),
    ],
)
def test_bad_input_is_one_sentence(arguments, said):
    done = run('check', 'four_bar_nominal', '--equations', *arguments)
    assert done.returncode == 2
    assert said in done.stderr
    assert 'Traceback' not in done.stderr


GUIDED = (
    'oscillating_cylinder', 'dump_truck', 'quick_return_shaper', 'rotary_engine', 'scotch_yoke',
    'slider_crank_piston_driven', 'torsion_return', 'gear_box', 'five_bar', 'skew_slot',
)  # fmt: skip


def enlarged(variant, factor):
    """The machine with every length times a factor, but for those of its drives and loads."""
    content = machine_of(variant).scene.model_dump(exclude_none=True, by_alias=True)
    for link in content['links'].values():
        points = link.get('points', {})
        link['points'] = {k: [factor * x for x in xy] for k, xy in points.items()}
        if 'length' in link:
            link['length'] *= factor
        cog = link.get('cog', 0.0)
        link['cog'] = factor * cog if isinstance(cog, float) else [factor * x for x in cog]
    for part in (content.get('guess', {}), content.get('initial', {}).get('position', {})):
        for place in part.values():
            if isinstance(place, dict) and place['unit'] == 'm':
                place['value'] *= factor
    for drive in (content.get('drive', {}), *content.get('drives', {}).values()):
        if 'start_position' in drive:
            drive['start_position'] *= factor
    for gear in content.get('gears', {}).values():
        if 'module' in gear:
            gear['module'] *= factor
    content.pop('duration', None)
    content.pop('sensors', None)
    return Machine('enlarged', Scene.model_validate(content))


@pytest.mark.parametrize('variant', GUIDED)
def test_printed_lengths_are_those_of_the_scene_and_closures_lengths_or_angles(variant):
    """With the machine twice as large every length is, and closures are as large or twice that."""
    machine, large = machine_of(variant), enlarged(variant, 2.0)
    pages = [Typesetter(derive(m, False)).to_json() for m in (machine, large)]
    values = [{p['text']: p for p in page['parameters']} for page in pages]
    assert values[0].keys() == values[1].keys()
    for name, one in values[0].items():
        if one['unit'] == 'm':
            assert values[1][name]['value'] == pytest.approx(2.0 * one['value']), name
    q = anywhere(machine)[0]
    found = []
    for page, size in zip(pages, (1.0, 2.0), strict=True):
        given = {}
        for c, angle in zip(page['coordinates'], q, strict=True):
            given[c['text']] = size * angle if c['unit'] == 'm' else angle
            given |= {c['rate']: 0.0, c['acceleration']: 0.0}
        reader = Reader(page, **given)
        reader.define('vectors')
        found.append([reader(reader.sides(e)[0]) for e in page['closures']])
    for small, other in zip(*found, strict=True):
        assert other / small == pytest.approx(1.0) or other / small == pytest.approx(2.0)


def test_an_oscillating_cylinder_is_written_as_in_the_book():
    """[V] 2.4: its piston turns with the cylinder, whose line passes through the crank's pin."""
    page = printed('oscillating_cylinder')
    assert '1.0' not in [repr(p['value']) for p in page['parameters']]
    texts = [e['text'] for e in page['closures']]
    assert '-sin(theta_cylinder - theta_piston) = 0' in texts
    (moment,) = [s for s in page['variables'] if s['text'] == 'lambda2_cylinder_piston']
    assert moment['unit'] == 'N m'


@pytest.mark.parametrize('variant', ['slider_with_loads', 'four_bar_clearance', 'induction'])
def test_pages_and_notebooks_have_set_mathematics(variant):
    set_by = ms.equations(machine_of(variant))
    body = set_by._repr_latex_()
    assert body.startswith('$$')
    assert body.endswith('$$')
    for part in set_by.equations.parts:
        for e in part.equations:
            assert set_by.equation_latex(e) in body
    assert body.count('{') == body.count('}')
    text = set_by.html().replace('&InvisibleTimes;', '').removeprefix('<!DOCTYPE html>')
    root = ElementTree.fromstring(re.sub('<meta[^>]*>', '', text))
    formulas = [x for x in root.iter('math') if x.get('display') == 'block']
    assert len(formulas) == sum(len(p.equations) for p in set_by.equations.parts)
    letters = {''.join(x.itertext()) for x in root.iter('mi')}
    assert not [x for x in letters if '_' in x or 'dot' in x]  # all indices are set below
    assert str(set_by) == set_by.plain()


def test_numbers_have_the_digits_that_they_have():
    """Not those of rounding, in text and in LaTeX."""
    rounded = {'links.piston.mass': 0.1 * 0.1 * 0.125, 'links.rod.inertia': 0.1 * 3.0}
    setter = ms.equations(ms.load_scene('slider_crank', rounded))
    assert [repr(x) for x in rounded.values()] == ['0.0012500000000000002', '0.30000000000000004']
    for text in (setter.plain(), setter.latex()):
        assert '0.00125' in text
        assert not re.search(r'\d\.\d*(0{8}|9{8})\d', text)


@pytest.mark.slow
def test_pi_is_printed_where_the_scene_was_loaded_before():
    # sympy is imported when a page needs it; until then heyoka has a stand-in of its constants
    code = (
        'import mechanism_sim as ms\n'
        "drive = {'coordinate': 'crank', 'position': '60 deg*sin(pi*t)'}\n"
        "scene = ms.load_scene('slider_crank', {'drive': drive, 'duration': '1 s'})\n"
        "print('pi' in str(ms.equations(scene)))\n"
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          timeout=TIMEOUT, check=False)  # fmt: skip
    assert done.stdout == 'True\n', done.stderr
