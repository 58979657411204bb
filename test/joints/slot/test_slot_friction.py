"""Friction of a loose pin on the walls of its slot."""

import numpy as np
import pytest

import mechanism_sim as ms

MU, RADIUS = 0.3, 6e-3


def test_a_pin_loses_its_friction_times_the_slip_of_its_surface_on_the_wall():
    """Slip by differences of places: of the pin's surface, which turns with the crank."""
    machine = ms.load_scene(
        'quick_return',
        {
            'joints.crank_arm.clearance': {
                'radial': '0.2 mm', 'restitution': 0.0, 'friction': MU, 'pin_radius': RADIUS,
            },
            'loads': {}, 'gravity': [60.0, 0.0],
            'drive': {'start_angle': 3.0, 'speed': -6.0},
        },
    )  # fmt: skip
    solution = ms.simulate(machine, duration=0.12)
    h, t = 1e-6, np.linspace(0.03, 0.11, 9)
    before, now, after = (solution.sample(t + k * h) for k in (-1, 0, 1))
    (side,) = (s for s in ('left', 'right') if now[f'closed.crank_arm_{s}'].all())
    lost = (after['energy.dissipated'] - before['energy.dissipated']) / (2 * h)
    mechanism = machine.mechanism
    joint = mechanism.joint('crank_arm')

    def place(link, at, seen, i):
        q = {c: float(seen[f'position.{c}'][i]) for c in mechanism.coordinates}
        return np.array(mechanism.locate(link, q, at))

    for i in range(len(t)):
        arm = float(now['position.arm'][i])
        sign = 1.0 if side == 'left' else -1.0  # along the slot to the right, so to the left
        normal = sign * np.array([-np.sin(arm), np.cos(arm)])
        tangent = np.array([-normal[1], normal[0]])
        pin = place(joint.first, joint.on_first, now, i)
        moved = place(joint.first, joint.on_first, after, i)
        moved = (moved - place(joint.first, joint.on_first, before, i)) / (2 * h)
        pivot = place('arm', (0.0, 0.0), now, i)
        contact = pin + RADIUS * normal

        def turned(rate, off):
            return rate * np.array([-off[1], off[0]])

        of_pin = moved + turned(now['velocity.crank'][i], contact - pin)
        of_wall = turned(now['velocity.arm'][i], contact - pivot)
        slip = float(tangent @ (of_pin - of_wall))
        friction = now[f'friction_force.crank_arm_{side}'][i]
        assert abs(friction) == pytest.approx(MU * now[f'normal_force.crank_arm_{side}'][i])
        assert lost[i] == pytest.approx(abs(friction * slip), rel=1e-5)
    assert np.ptp(lost) > 0.1
