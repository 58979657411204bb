"""The life of bearings that wear: as text, JSON and a chart, and scenes of its stages."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mechanism_sim.report.charts.chart import Axis, Chart, ChartCurve, Panel
from mechanism_sim.report.sections import Section, text
from mechanism_sim.scene.facts import yaml_text
from mechanism_sim.scene.files import check_scene
from mechanism_sim.studies.life import PLACES, Life, LifeStage
from mechanism_sim.units import counted, for_people

_SHADES = '#c6dbef', '#9ecae1', '#6baed6', '#4292c6', '#2171b5', '#08519c', '#08306b'
_PROFILES = 7  # drawn of each surface, along the life


def render(found: Life) -> str:
    """Life as text, then a row for each stage."""
    head = ['cycles']
    for joint in found.joints:
        head += [f'clearance of {joint} [mm]', '+-', 'bushing [um]', 'pin [um]', 'impacts a cycle']
    named = [name for name in found.units if name not in head]
    head += [f'{name} [{found.units[name]}]' if found.units[name] else name for name in named]
    table: list[tuple[str, ...]] = [tuple(head)]
    for stage in found.stages:
        cells = [f'{stage.cycles:.4g}']
        for k, joint in enumerate(found.joints):
            doubt = stage.error[k] + stage.scatter[k]
            deepest = 1e6 * stage.depths[joint].max(axis=1) + 0.0  # -0 is 0
            cells += [
                f'{1e3 * stage.clearance[k]:.5g}', f'{1e3 * doubt:.1g}', f'{deepest[0]:.4g}',
                f'{deepest[1]:.4g}', f'{stage.impacts[k]:.4g}',
            ]  # fmt: skip
        table.append((*cells, *(f'{stage.figures[name] + 0.0:.4g}' for name in named)))
    return text([Section(table=table, notes=[_said(found)])])


def _said(found: Life) -> str:
    runs = f'{counted(found.runs, "run")} of {counted(found.plan.revolutions, "turn")}'
    if found.low < found.plan.cycles and found.note:
        return f'it cannot be computed: {found.note}'
    if math.isnan(found.cycles):
        reached = f', and {found.until} is not reached' if found.until else ''
        because = f': {found.note}' if found.note else ''
        return f'{found.plan.cycles:.6g} cycles are over{reached}{because}; {runs}'
    return (
        f'{found.until} after {found.cycles:.4g} cycles, between {found.low:.4g} and '
        f'{found.high:.4g}; {runs}'
    )


def to_json(found: Life) -> dict[str, Any]:
    """All stages in SI units; depths at even angles from 0 on."""
    ended = not math.isnan(found.cycles)
    return {
        'until': found.until or None,
        'cycles': found.cycles if ended else None,
        'low': found.low,
        'high': found.high if math.isfinite(found.high) else None,
        'runs': found.runs,
        **({'note': found.note} if found.note else {}),
        'units': found.units,
        'wear': {
            joint: [
                {
                    'cycles': stage.cycles,
                    'clearance': float(stage.clearance[k]),
                    'error': float(stage.error[k]),
                    'scatter': float(stage.scatter[k]),
                    'bushing': stage.depths[joint][0].tolist(),
                    'pin': stage.depths[joint][1].tolist(),
                    'impacts': float(stage.impacts[k]),
                }
                for stage in found.stages
            ]
            for k, joint in enumerate(found.joints)
        },
        'figures': [stage.figures for stage in found.stages],
    }


def scene_text(found: Life, stage: LifeStage) -> str:
    """The machine at a stage, as a file of a scene."""
    scene = check_scene(found.machine.name, found.scene(stage))
    return f'# after {stage.cycles:.6g} cycles\n{yaml_text(scene)}'


def chart(found: Life, title: str) -> Chart:
    """All of `charts` above each other."""
    both = charts(found, title)
    return Chart('life', title, sum((each.panels for each in both), ()))


def charts(found: Life, title: str) -> tuple[Chart, Chart]:
    """Clearances over cycles, and profiles of worn surfaces along the life."""
    n = np.array([stage.cycles for stage in found.stages])
    curves = []
    for k, joint in enumerate(found.joints):
        own = np.array([stage.clearance[k] for stage in found.stages])
        doubt = np.array([stage.error[k] + stage.scatter[k] for stage in found.stages])
        curves.append(ChartCurve(n, own, joint, joint, k, marker='circle', error=doubt))
    size = Panel(Axis('cycles'), Axis('largest clearance', 'm'), tuple(curves), height=2.6)
    panels = []
    count = len(found.stages)
    chosen = np.unique(np.linspace(1, count - 1, min(count - 1, _PROFILES)).round().astype(int))
    angle = 360.0 / PLACES * np.arange(PLACES + 1.0)
    for joint in found.joints:
        for side, name in enumerate(('bushing', 'pin')):
            depths = [found.stages[k].depths[joint][side] for k in chosen]
            deepest = max((float(d.max()) for d in depths), default=0.0)
            if not deepest:
                continue
            unit, scale = for_people('m', deepest)
            lines = [
                ChartCurve(
                    angle, scale * np.append(depth, depth[0]),
                    f'{found.stages[k].cycles:.3g} cycles', joint,
                    _SHADES[min(len(_SHADES) - 1, (i + 1) * len(_SHADES) // len(chosen) - 1)],
                )
                for i, (k, depth) in enumerate(zip(chosen, depths, strict=True))
            ]  # fmt: skip
            axes = Axis('angle on its link', 'deg', 0.0, 360.0, every=60.0), Axis('depth', unit)
            panels.append(Panel(*axes, tuple(lines), f'{name} of {joint}', height=2.6))
    wear = Chart('life', title, (size,), 'value')
    return wear, Chart('profiles', 'Worn surfaces', tuple(panels), 'angle')
