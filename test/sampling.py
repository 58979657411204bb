"""Cases of broad tests that are quick: a sample drawn by a seed; the others are slow.

A test says by ``@pytest.mark.sample(4)`` how many of its cases are quick. All draw by one seed:
tests of scenes share what is compiled if they draw the same ones. ``pytest -m ''`` runs all.
"""

from __future__ import annotations

from collections import defaultdict
from hashlib import sha256
from typing import Any

import pytest

SEED = 1

FIRST = (
    'four_bar_nominal', 'four_bar_clearance', 'slider_crank', 'valve_train', 'geneva', 'gear_pair',
    'gear_rattle', 'planetary', 'pendulum', 'offset_roller_cam', 'dump_truck',
)  # fmt: skip
"""Scenes that stand for the others of their kind, where a test has them."""

HEAVY = (
    'andrews_squeezer', 'bearing_run_up', 'four_bar_governed', 'gear_four_bar', 'groove_cam',
    'loader', 'measured_cam', 'oscillating_roller', 'sliding_cam', 'slider_crank_engine',
    'ten_links', 'whole_machine', '_024', '_066', 'cam_001', 'compliant_joints',
    'force_that_touches_zero',
)  # fmt: skip
"""Cases that take seconds to compile are slow, whatever the seed."""


def _order(case: str) -> tuple[int, bytes]:
    first = FIRST.index(case) if case in FIRST else len(FIRST)
    return first, sha256(f'{SEED} {case}'.encode()).digest()


def mark(items: list[Any]) -> None:
    """Mark the cases that are not drawn as slow."""
    found: dict[str, list[Any]] = defaultdict(list)
    for item in items:
        if item.get_closest_marker('sample') and item.get_closest_marker('slow') is None:
            found[item.nodeid.partition('[')[0]].append(item)
    for cases in found.values():
        count = cases[0].get_closest_marker('sample').args[0]
        light = [c for c in cases if not any(word in c.callspec.id for word in HEAVY)]
        drawn = sorted(light, key=lambda c: _order(c.callspec.id))[:count]
        for case in cases:
            if case not in drawn:
                case.add_marker(pytest.mark.slow)
