"""Machines and runs that several tests take."""

from __future__ import annotations

import mechanism_sim as ms
from mechanism_sim.analysis.record import Record

KINDS = (
    'four_bar_clearance', 'bearing_run_up', 'ten_links', 'whole_machine', 'planetary', 'loader',
    'geneva', 'linear_intermittent', 'valve_train', 'rack_and_pinion', 'scotch_yoke', 'pendulum',
    'four_bar_on_frame', 'locking_pliers',
)  # fmt: skip
"""Scenes that have all kinds of joints, drives and levels among them."""


def simulated(scene, overrides=(), **length):
    machine = ms.load_scene(scene, overrides)
    return Record(machine, ms.simulate(machine, **length), {})
