"""A ball that bounces on a table that a crank moves up and down: its periods are known exactly."""

from __future__ import annotations

import math

G, A, E = 9.81, 0.01, 0.5

BALL = f"""
title: A ball on a table that goes up and down
mechanism: linkage
gravity: [0, -{G}]
links:
  crank: {{length: {A}, mass: 1, cog: 0, inertia: 1}}
  table: {{mass: 1, points: {{middle: [0, 0]}}}}
  ball: {{mass: 0.1}}
joints:
  shaft: {{revolute: [ground, crank]}}
  guide: {{prismatic: [ground, table], axis: 90 deg}}
  yoke: {{slot: [crank.end, table], axis: 0 deg}}
  flight: {{prismatic: [table, ball], axis: 90 deg, stops: {{lower: 0, restitution: {E}}}}}
drive: {{coordinate: crank, speed: SPEED, start_angle: PHASE}}
initial: {{velocity: {{ball: PACE}}, position: {{ball: HEIGHT}}}}
"""


def speed(gamma: float) -> float:
    """Speed of the crank [rad/s] at which the table's acceleration is so many g."""
    return math.sqrt(gamma * G / A)


def ball(gamma: float, periods: int = 1, e: float = E) -> str:
    """The scene when the ball is highest, on its way back after so many periods of the table."""
    T = periods * 2.0 * math.pi / speed(gamma)
    left = math.acos(periods * math.pi * (1.0 - e) / (1.0 + e) / gamma)  # the table, at this angle
    phase = left + periods * math.pi
    height = A * math.sin(left) + G * T**2 / 8.0 - A * math.sin(phase)
    pace = -A * speed(gamma) * math.cos(phase)
    scene = BALL.replace(f'restitution: {E}', f'restitution: {e}')
    given = {'SPEED': speed(gamma), 'PHASE': phase, 'PACE': pace, 'HEIGHT': height}
    for name, value in given.items():
        scene = scene.replace(name, repr(value))
    return scene
