"""Where contact is lost, beside criteria of the literature for the ideal mechanism."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.events import Mode
from mechanism_sim.report.sections import Section, text
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine
from mechanism_sim.strict_json import plain
from mechanism_sim.thesis.contact_loss import (
    ClearanceLink,
    Prediction,
    contact_loss,
)
from mechanism_sim.thesis.force_cycle import ForceCycle


@dataclass(frozen=True)
class Losses:
    """One loose joint: what was predicted, and what happened.

    Attributes
    ----------
    predictions : of the criteria of [SB] 3.5 and of the clearance as a link
    turns : of the crank at every loss of contact
    """

    joint: str
    predictions: tuple[Prediction, ...]
    turns: tuple[float, ...]


def losses(machine: Machine, revolutions: float = 3.0) -> list[Losses]:
    """Criteria and reality for every loose joint.

    The criteria of the clearance link are known for the joint between coupler and rocker only.
    """
    angle, speed = machine.drive.start
    steady = machine.drive.steady and not machine.torque_driven
    if not steady or not speed or not machine.plan.clearances:
        raise InputError(f'{machine.name}: criteria need clearance and a crank at constant speed')
    linkage = machine.nominal.linkage
    solution = simulate(machine, revolutions=revolutions)
    found = []
    about = [
        body.inertia + body.mass * body.cog[0] ** 2
        for body in (machine.mechanism.body(link) for link in ('coupler', 'rocker'))
    ]
    for joint, clearance in machine.plan.clearances.items():
        cycle = ForceCycle.nominal(linkage, machine.nominal.inverse_dynamics, joint, speed)
        link = (
            ClearanceLink.four_bar(clearance.radial, linkage, about[0], about[1])
            if (joint,) == machine.plan.closing
            else None
        )
        predictions = contact_loss(cycle, link, start=angle, turns=revolutions)
        turns = [
            m.t * abs(speed) / (2.0 * math.pi)
            for m in solution.modes
            if m.joint == joint and m.mode == Mode.FREE_FLIGHT and m.previous > Mode.FREE_FLIGHT
        ]
        found.append(Losses(joint, tuple(predictions), tuple(turns)))
    return found


def render(found: Sequence[Losses]) -> str:
    """Criteria and reality for people."""
    return text(_section(joint) for joint in found)


def _section(found: Losses) -> Section:
    rows = []
    for p in found.predictions:
        at = ', '.join(f'{math.degrees(a):.1f}' for a in p.angles[:6])
        unit = p.unit if p.unit != '1' else ''
        verdict = 'loss' if p.predicts_loss else 'no loss'
        where = f'at {at} deg' if at else ''
        rows.append((p.criterion, verdict, f'{p.figure:.4g}', unit, f'{p.threshold:g}', where))
    really = ', '.join(f'{t:.6g}' for t in found.turns[:8])
    more = f' and {len(found.turns) - 8} more' if len(found.turns) > 8 else ''
    return Section(
        f'{found.joint}: predictions for the ideal mechanism',
        table=[('criterion', '', 'figure', '', 'limit', ''), *rows],
        notes=[f'really lost at {really or "no time"}{more} revolutions'],
        left=(0, 1, 3, 5),
    )


def to_json(found: Sequence[Losses]) -> list[dict[str, object]]:
    """Predictions as JSON."""
    return [
        {
            'joint': joint.joint,
            'predictions': plain(joint.predictions),
            'lost_at_revolutions': list(joint.turns),
        }
        for joint in found
    ]
