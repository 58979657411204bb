"""The page of a machine's ideal motion: one HTML file whose sliders need no server.

It closes the loops itself, by the machine's own closures in JavaScript.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from math import ceil, log10
from typing import Any

import numpy as np
from markupsafe import Markup

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.export.palette import index
from mechanism_sim.export.shapes import COIL, simplified
from mechanism_sim.packages import needed
from mechanism_sim.pages.assets import embedded, import_map, render, styles
from mechanism_sim.pages.ideal_equations import PURPOSE
from mechanism_sim.pages.ideal_sliders import SliderReader, curves_of, four_bar_sides, shapes_of
from mechanism_sim.planar.drive import TWO_PI, DriveLaw, Law
from mechanism_sim.scene import Machine, span
from mechanism_sim.scene.load import without_clearance
from mechanism_sim.units import for_people

MODULES = (
    'html', 'svg', 'stage', 'player', 'curves', 'keys', 'sliders', 'zoom', 'ideal_motion', 'ideal',
)  # fmt: skip

_TURN, _LOOKS = float(TWO_PI), 181
_FINE = 0.015  # tolerance of edges of bodies, in symbols


def page(
    machine: Machine, sliders: Mapping[str, tuple[str, str]], source: str = ''
) -> tuple[str, list[str]]:
    """The page as HTML, and in sentences what of the machine it leaves out.

    Parameters
    ----------
    sliders : lowest and highest values by the dotted paths of keys; none: the usual ones
    source : name or file of the scene, for the command that the page recommends
    """
    needed('sympy', PURPOSE)
    ideal = _ideal(machine)
    drive = PageDrive(ideal)
    reader = SliderReader(ideal, drive.coordinates)
    _check(ideal, drive, reader)
    reader.read(sliders)
    if any(joint.line for joint in ideal.plan.joints):
        reader = _widened(reader, drive, sliders)
    names = [*reader.equations.parameters]
    digits = 4 + ceil(-log10(reader.skeleton.symbol))
    data = {
        **drive.to_json(),
        'stage': _stage(ideal, reader),
        'parameters': names,
        'dimensions': {
            name: (np.round(x, digits) if name.startswith('shape:') else x).tolist()
            for name, x in reader.base.items()
        },
        'sliders': [slider.to_json() for slider in reader.found],
        'points': [
            [link, name]
            for link, named in ideal.plan.points.items()
            for name, at in named.items()
            for shape in reader.skeleton.shapes
            if shape.kind == 'point' and shape.number >= 0
            and shape.link == link and tuple(shape.outline[0]) == at
        ],
        'sides': [*four_bar_sides(ideal.plan.ideal)],
    }  # fmt: skip
    equations = {'equations': reader.equations.to_javascript(names)}
    text = render(
        'ideal.html.jinja',
        scene=machine.name,
        source=shlex.quote(source or machine.name),
        title=machine.scene.title,
        description=machine.scene.description.strip(),
        style=styles('stage', 'style', 'live', 'ideal'),
        modules=Markup(import_map(MODULES, equations)),  # noqa: S704 - ours
        data=embedded(data),
    )
    without = [f'{name}: it has no clearance here' for name in machine.plan.clearances]
    if reader.refused:
        refused = ', '.join(reader.refused)
        without.append(f"{refused}: no slider; '--slider PATH=LOW:HIGH' gives the reason for one")
    return text, without


def _ideal(machine: Machine) -> Machine:
    """The machine without clearance, and without what only watches it or is shaken by it."""
    if machine.plan.ideal.deformations:
        link = machine.plan.ideal.deformations[0].partition('.')[0]
        raise _refusal(machine, f'{link} is elastic, and how it deforms depends on forces')
    if not (machine.scene.drive or machine.scene.drives):
        raise _refusal(machine, 'nothing drives it, its motion is free')
    silent: dict[str, Any] = {'sensors': {}, 'oscillators': {}, 'measures': {}}
    scene = machine.scene.model_copy(update=silent)
    return without_clearance(replace(machine, scene=scene), rigid=True)


def _refusal(machine: Machine, why: str) -> InputError:
    return InputError(
        f'{machine.name} cannot be a page of ideal motion: {why}; '
        f"'mechanism-sim report {machine.name}' makes a page of a run"
    )


def _check(machine: Machine, drive: PageDrive, reader: SliderReader) -> None:
    """Refuse what does not follow from the drives by smooth closures."""
    if switched := reader.equations.switched:
        which = ', '.join(sorted(switched))
        raise _refusal(machine, f'{which} follows a different law in each part of a turn')
    rows, sought = len(drive.kinematics.rows), drive.kinematics.sought
    if rows < len(sought) or machine.assembly.freedom > len(machine.plan.powered):
        free = ', '.join(drive.kinematics.coordinates[i] for i in sought)
        raise _refusal(machine, f'how {free} moves does not follow from its drives')
    if rows > len(sought):
        raise _refusal(machine, 'its loops depend on each other: other lengths would open them')


def _widened(
    reader: SliderReader, drive: PageDrive, sliders: Mapping[str, tuple[str, str]]
) -> SliderReader:
    """The sliders, drawn with guides that are long enough at both ends of each of them."""
    every = [drive.coordinates]
    for slider in reader.found:
        for value in (slider.low, slider.high):
            with suppress(InputError):  # cannot be assembled there, or at the start
                every.append(PageDrive(reader.at({slider.path: value})).coordinates)
    wide = SliderReader(reader.machine, np.concatenate(every, axis=1), reader.skeleton.size)
    wide.read(sliders)
    return wide


def _pieces(laws: Sequence[Law]) -> list[tuple[float, tuple[float, ...]]]:
    """Start times [s] of a coordinate's laws, and powers of the time since then."""
    prescribed = [law for law in laws if isinstance(law, DriveLaw)]
    local = [law.about(Fraction(law.valid_from)) for law in prescribed]
    return [
        (law.valid_from, (x + _TURN * (turns - local[0][0]), *more))
        for law, (turns, (x, *more)) in zip(prescribed, local, strict=True)
    ]


class PageDrive:
    """The variable that a page is played over: the only drive, or the time if there are more."""

    def __init__(self, machine: Machine) -> None:
        plan = self._plan = machine.plan
        driven = [*plan.laws]
        self.kinematics = plan.kinematics(driven)  #: closures with the driven coordinates held
        self._q, self._timed = machine.assembly.q, len(driven) > 1
        self._slides = plan.main in plan.ideal.displacements
        start, size = float(self._q[self.kinematics.held[0]]), plan.ideal.size
        self._speed = machine.drive.start[1]
        self._range, self._laws = (start, start, start + _TURN), []
        prescribed = len(driven) == len(plan.prescribed)
        if prescribed and (self._timed or self._slides or not machine.drive.steady):
            looked = [plan.laws_until(c, span(machine, None, None)) for c in driven]
            end = min(end for _, end in looked)
            self._laws = [_pieces(laws) for laws, _ in looked]
            t = np.linspace(0.0, end, 10 * _LOOKS)
            along = self._values(t)[0]
            if self._timed:
                self._range, self._speed = (0.0, 0.0, end), 1.0
            elif self._slides or np.ptp(along) < _TURN:
                self._range = start, float(along.min()), float(along.max())
            self._speed = self._speed or float(np.abs(np.gradient(along, t)).max())
        elif self._slides:
            self._range = start, start - size, start + size
        self._speed = self._speed or (0.1 * size if self._slides else _TURN)
        # from the start to both ends, or to the last closed loops
        found, (start, low, high) = [self._q], self._range
        for end in (high, low):
            last = [self._q, self._q]
            for u in np.linspace(start, end, _LOOKS)[1:]:
                guess = 2.0 * last[-1] - last[-2]
                held = self._values(np.array([u]))[:, 0] if self._timed else u
                guess[self.kinematics.held] = held
                q, left = self.kinematics.positions(guess[:, None])
                if left.any() or (np.abs(q[:, 0] - guess) > 0.3 * self.kinematics.scale).any():
                    break
                last.append(q[:, 0])
            found += last[2:]
        #: (n, N) coordinates over the range of the drives from the start
        self.coordinates = np.array(found).T

    def _values(self, t: Array) -> Array:
        """The driven coordinates (p, N) at times (N,)."""
        found = np.zeros((len(self._laws), len(t)))
        for row, pieces in zip(found, self._laws, strict=True):
            for start, powers in pieces:
                later = t >= start
                row[later] = np.polynomial.polynomial.polyval(t[later] - start, powers)
        return found

    def to_json(self) -> dict[str, Any]:
        """All about it for a page."""
        mechanism, (start, low, high) = self._plan.ideal, self._range
        return {
            'coordinates': [
                {'name': c, 'slides': c in mechanism.displacements} for c in mechanism.coordinates
            ],
            'held': self.kinematics.held,
            'sought': self.kinematics.sought,
            'scale': self.kinematics.scale.tolist(),
            'reach': mechanism.reach,
            'q': self._q.tolist(),
            'start': start,
            'low': low,
            'high': high,
            'turns': not (self._timed or self._slides) and high - low >= _TURN,
            'speed': self._speed,
            'laws': self._laws if self._timed else [],
            'main': self._plan.main,
            'slides': self._slides,
            'length': for_people('m', mechanism.size),  # unit, and how many of it a metre is
        }


def _stage(machine: Machine, reader: SliderReader) -> dict[str, Any]:
    """Shapes of a page, as `Stage.to_json` has it, with names instead of dimensions."""
    skeleton, shapes, none = reader.skeleton, [], dict.fromkeys(('force', 'force_scale'), 0.0)
    for name, shape in shapes_of(skeleton).items():
        paths, first = [], 0
        for style, curves, radii in curves_of(skeleton, shape):
            ranges = []
            for curve in curves:
                kept = np.arange(len(curve))
                if style == 'body' and shape.kind in ('wheel', 'cam'):
                    few = {*map(tuple, simplified(curve, _FINE * shape.symbol).tolist())}
                    kept = np.array([k for k, x in enumerate(curve.tolist()) if tuple(x) in few])
                ranges.append((first + kept).tolist())
                first += len(curve)
            paths.append([style, ranges, radii])
        shapes.append({
            'name': name, 'kind': shape.kind, 'link': shape.link, 'label': shape.label,
            'colour': index(shape.number), 'paths': paths,
        })  # fmt: skip
    empty: dict[str, Any] = {name: [] for name in ('joints', 'bearings', 'plays', 'frames')}
    return none | empty | {
        'title': machine.scene.title,
        'symbol': skeleton.symbol,
        'links': skeleton.links,
        'shapes': shapes,
        'springs': [[link for link, _ in ends] for ends in skeleton.springs],
        'ropes': [[link for link, _ in string.ends] for string in skeleton.strings],
        'coil': COIL.tolist(),
        'bendings': {},
        'main': machine.plan.main,
    }  # fmt: skip
