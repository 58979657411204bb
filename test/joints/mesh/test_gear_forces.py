"""Forces between teeth against the geometry of the teeth in space, and the balance of power."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from builders import made
from tooth_forces import bevel, helical, spur
from tooth_forces import worm as worm_forces

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.joints.bevel.constraint import pitch_angles
from mechanism_sim.joints.worm.constraint import WormPair
from mechanism_sim.report.profile import profile

PHI = math.radians(20)
X, Y, Z = np.eye(3)
RANDOM = np.random.default_rng(8)


def along_teeth(helix_angle):
    """Direction of a tooth in the tangential plane: Y tangential, Z axial."""
    return math.cos(helix_angle) * Z + math.sin(helix_angle) * Y


def balance(pair, torque):
    """Power in, out and lost, at a speed of 1 rad/s of the driver."""
    return SimpleNamespace(into=torque, out=pair.torque / pair.ratio)


def test_helical_force_is_normal_to_the_tooth():
    """[V] Figure 5.20: square to the tooth line, at phi_n to the tangential plane."""
    for _ in range(100):
        phi, psi = RANDOM.uniform(0.2, 0.5), RANDOM.uniform(0.0, 0.8)
        torque, radius = RANDOM.uniform(1, 100), RANDOM.uniform(0.01, 0.2)
        pair = helical(torque, radius, phi, psi, 2.5)
        force = -pair.driver.tangential * Y - pair.driver.radial * X + pair.driver.axial * Z
        assert force @ along_teeth(psi) == pytest.approx(0.0, abs=1e-12 * pair.driver.total)
        assert pair.driver.radial == pytest.approx(pair.driver.total * math.sin(phi))
        assert np.cross(radius * X, force) @ Z == pytest.approx(-torque)
        # the driven gear's axis lies on the other side, at 2.5 times the radius
        assert np.cross(-2.5 * radius * X, -force) @ Z == pytest.approx(-pair.torque)
        assert pair.driven == pair.driver


def test_spur_is_helical_without_helix():
    """[V] eqs. 5.8, 5.9, 5.11 to 5.14, in numbers that a pocket calculator gives."""
    pair = spur(12.0, 0.03, PHI, 50 / 20)
    assert pair == helical(12.0, 0.03, PHI, 0.0, 2.5)
    assert pair.driver.tangential == pytest.approx(400.0)
    assert pair.driver.radial == pytest.approx(145.588, abs=1e-3)
    assert pair.driver.axial == 0.0
    assert pair.torque == pytest.approx(30.0)


@pytest.mark.parametrize('shafts', [math.pi / 2, 1.2, 2.0])
@pytest.mark.parametrize('speeds', [0.6, 1.0, 3.0])
def test_bevel_forces_balance_in_space_and_are_normal_to_the_tooth(shafts, speeds):
    """[V] Figure 5.25, for both gears in one frame with the apex at its origin."""
    radius, torque = 0.04, 7.0
    pair = bevel(torque, radius, PHI, speeds, shafts)
    gamma2, gamma3 = pitch_angles(speeds, shafts)
    axes = Z, math.sin(shafts) * X + math.cos(shafts) * Z
    line = math.sin(gamma2) * X + math.cos(gamma2) * Z  # of contact of the cones
    point = line * radius / math.sin(gamma2)
    forces = []
    for force, axis, way in zip((pair.driver, pair.driven), axes, (-1, 1), strict=True):
        outward = point - (point @ axis) * axis
        outward /= np.linalg.norm(outward)
        forces.append(way * force.tangential * Y - force.radial * outward + force.axial * axis)
    np.testing.assert_allclose(forces[0], -forces[1], atol=1e-12 * pair.driver.total)
    assert forces[0] @ line == pytest.approx(0.0, abs=1e-12 * pair.driver.total)
    assert pair.driver.tangential == pytest.approx(pair.driver.total * math.cos(PHI))
    moments = [np.cross(point, f) @ a for f, a in zip(forces, axes, strict=True)]
    assert np.abs(moments) == pytest.approx([torque, pair.torque])
    assert gamma2 + gamma3 == pytest.approx(shafts)


@pytest.mark.parametrize('wheel_drives', [False, True])
def test_worm_forces_balance_and_power_in_is_power_out_and_friction(wheel_drives):
    """Normal force and friction along the thread, as vectors."""
    for _ in range(100):
        lead, mu = RANDOM.uniform(0.15, 0.7), RANDOM.uniform(0.0, 0.12)
        worm = WormPair(3, 40, 0.05, lead, RANDOM.uniform(0.2, 0.5))
        pair = worm_forces(worm, 11.0, mu, wheel_drives=wheel_drives)
        on_worm, on_wheel = (pair.driver, pair.driven)[:: -1 if wheel_drives else 1]
        assert on_worm == (on_wheel.axial, on_wheel.radial, on_wheel.tangential)
        # worm: X along the axis, Y with its motion, Z from its axis to the wheel's
        force = np.array([on_worm.axial, -on_worm.tangential, -on_worm.radial])
        if wheel_drives:
            assert on_worm.tangential > 0.0  # the worm is pushed on
        thread = math.sin(lead) * X + math.cos(lead) * Y
        across = math.cos(lead) * X - math.sin(lead) * Y
        # the flank faces +X; a wheel that drives presses on the other one, the worm runs to -Y
        phi = worm.pressure_angle
        normal = math.cos(phi) * across - math.sin(phi) * Z
        size = on_worm.radial / math.sin(phi)
        friction = (1 if wheel_drives else -1) * mu * size * thread
        np.testing.assert_allclose(force, size * normal + friction, atol=1e-10 * size)
        # speeds of the worm's surface and of sliding, at 1 rad/s of the worm
        around = worm.diameter / 2.0
        lost = mu * size * around / math.cos(lead)
        worm_power = on_worm.tangential * around
        wheel_power = on_wheel.tangential * worm.wheel_diameter / 2.0 * 3 / 40
        into, out = (wheel_power, worm_power) if wheel_drives else (worm_power, wheel_power)
        assert into == pytest.approx(out + lost, rel=1e-12)
        found = worm.efficiency(mu, wheel_drives=wheel_drives)
        assert found == pytest.approx(out / into, rel=1e-12)
        account = balance(pair, 11.0)
        assert account.out == pytest.approx(found * account.into, rel=1e-12)


def test_power_in_is_power_out_and_losses():
    for pair in (
        spur(5.0, 0.02, PHI, 3.0, 0.97),
        helical(5.0, 0.02, PHI, 0.4, 3.0, 0.97),
        bevel(5.0, 0.02, PHI, 3.0, efficiency=0.97),
    ):
        account = balance(pair, 5.0)
        assert account.into == pytest.approx(account.out + 0.03 * account.into)


def test_self_locking_begins_where_the_wheel_can_no_longer_drive():
    worm = WormPair(1, 30, 0.04, 0.1)
    limit = math.cos(PHI) * math.tan(0.1)
    assert worm.self_locking(limit * 1.0001)
    assert not worm.self_locking(limit * 0.9999)
    assert worm.efficiency(limit * 0.9999, wheel_drives=True) < 1e-3
    with pytest.raises(InputError, match='self-locking'):
        worm.efficiency(limit * 1.0001, wheel_drives=True)
    assert worm.efficiency(limit) < 0.5  # what locks itself loses more than half


def test_worm_of_problem_15():
    """[V] 5, problem 15: double thread, 10 deg, 20 mm, 15:1."""
    worm = WormPair(2, 30, 0.02, math.radians(10))
    assert worm.wheel_diameter == pytest.approx(15 * 0.02 * math.tan(math.radians(10)))
    assert worm.centre_distance == pytest.approx(36.449e-3, abs=1e-6)
    assert worm_forces(worm, 1.0).ratio == 15.0
    assert worm_forces(worm, 1.0).torque == pytest.approx(15.0)


@pytest.mark.parametrize(
    ('make', 'sentence'),
    [
        (lambda: ms.load_scene('worm_drive', {'joints.pair.teeth': [0, 3]}), 'teeth'),
        (lambda: ms.load_scene('worm_drive', {'joints.pair.lead_angle': 0.0}), 'lead_angle'),
        (lambda: WormPair(1, 30, 0.02, 0.1).efficiency(-0.1), 'not negative'),
        (lambda: WormPair(9, 30, 0.02, 1.4).efficiency(0.3), 'too large'),
    ],
)
def test_wrong_pairs_are_refused_by_name(make, sentence):
    with pytest.raises(InputError, match=sentence):
        make()


def sliding_in_space(helix, module=2e-3, teeth=(20, 40)):
    """Of flanks as surfaces in space: lever of the force along their normal [m], mean slip [m/s].

    The first turns at 1 rad/s. The flank of the first is swept by its involute as that turns along
    the shaft; pairs that touch share the force equally, along the path between both tip circles.
    """
    press = math.atan(math.tan(math.radians(20)) / math.cos(helix))
    r1, r2 = (0.5 * module * n / math.cos(helix) for n in teeth)
    b1, b2 = r1 * math.cos(press), r2 * math.cos(press)
    reach = [math.sqrt((r + module) ** 2 - b**2) for r, b in ((r1, b1), (r2, b2))]
    start, end = b2 * math.tan(press) - reach[1], reach[0] - b1 * math.tan(press)
    pitch = 2 * math.pi * b1 / teeth[0]
    twist = math.tan(helix) / r1

    def at(s):
        """At the distance s along the line of action from the pitch point, at z = 0."""
        u = math.tan(press) + s / b1
        point = b1 * np.array([math.cos(u) + u * math.sin(u), math.sin(u) - u * math.cos(u), 0.0])
        along = b1 * u * np.array([math.cos(u), math.sin(u), 0.0])
        lead = np.array([-twist * point[1], twist * point[0], 1.0])
        normal = np.cross(along, lead)
        normal /= np.linalg.norm(normal)
        foot = b1 * np.array([math.cos(u), math.sin(u), 0.0])
        centre = (point - s * (point - foot) / (b1 * u)) * (r1 + r2) / r1
        spin = np.array([0.0, 0.0, 1.0])
        slip = np.cross(-spin * r1 / r2, point - centre) - np.cross(spin, point)
        assert abs(slip @ normal) < 1e-12  # along the flank
        return abs(np.cross(point, normal)[2]), np.linalg.norm(slip)

    slips = []
    for s in start + pitch * (np.arange(2000) + 0.5) / 2000:
        touching = [x for x in (s + k * pitch for k in range(3)) if x <= end]
        slips.append(np.mean([at(x)[1] for x in touching]))
    return at(0.3 * end)[0], float(np.mean(slips))


@pytest.mark.parametrize('helix', [0.0, math.acos(0.75)])
def test_helical_teeth_rub_by_the_force_normal_to_their_flanks(helix):
    """Efficiency, losses of ideal teeth and of those with backlash, by vectors in space."""
    mu, load, speed = 0.1, 3.0, 10 * math.pi

    def machine(**mesh):
        bodies = {'mass': 1.0, 'inertia': 1e-3}
        gear = {'module': 2e-3, 'helix_angle': helix}
        return made({
            'links': {'ground': {'points': {'w': [0.06 / math.cos(helix), 0.0]}},
                      'p': bodies, 'q': bodies},
            'gears': {'p': {**gear, 'at': 'p', 'teeth': 20},
                      'q': {**gear, 'at': 'q', 'teeth': 40, 'helix_angle': -helix}},
            'joints': {'a': {'revolute': ['ground', 'p']}, 'b': {'revolute': ['ground.w', 'q']},
                       'mesh': {'mesh': ['p', 'q'], **mesh}},
            'drive': {'coordinate': 'p', 'speed': speed},
            'loads': {'brake': {'at': 'q', 'torque': load}},
            **({'start': 'seated'} if 'backlash' in mesh else {}),
        })  # fmt: skip

    lever, slip = sliding_in_space(helix)
    rubbing = machine(friction={'coefficient': mu})
    told = {f.name: f.value for f in profile(rubbing, 'mesh', friction=mu).figures}
    assert told['efficiency'] == pytest.approx(1.0 - mu * slip / lever, abs=1e-5)
    # what brakes the wheel: its load, and the couple of friction against the relative turning
    force = load / (2.0 * lever - mu * slip / 1.5)
    loss = ms.cycle(rubbing, samples=12)['friction_loss.mesh']
    assert loss == pytest.approx(mu * slip * force * speed, rel=1e-3)
    play = {'width': 1e-4, 'restitution': 0.0, 'friction': mu}
    run = ms.simulate(machine(backlash=play), duration=0.1)
    lost = run.sample(np.array([0.05, 0.1]), 'energy.dissipated')['energy.dissipated']
    assert np.diff(lost) / 0.05 - 0.5 * load * speed == pytest.approx(loss[0], rel=1e-6)
