"""The page of a machine's ideal motion: one HTML file whose sliders need no server.

The page closes the loops itself, by the machine's own closures in JavaScript.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from math import ceil, log10
from typing import Any

import numpy as np
from markupsafe import Markup

from mechanism_sim.arrays import Array
from mechanism_sim.catalogue import installed_version
from mechanism_sim.errors import InputError
from mechanism_sim.export.palette import index
from mechanism_sim.export.shapes import BAR, COIL, Shape, simplified
from mechanism_sim.export.skeleton import Skeleton
from mechanism_sim.pages.assets import embedded, import_map, render, styles
from mechanism_sim.pages.ideal_equations import PURPOSE
from mechanism_sim.pages.ideal_sliders import SliderReader, drawn, four_bar_sides, rails
from mechanism_sim.packages import needed
from mechanism_sim.planar.drive import TWO_PI, DriveLaw
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.view import SLOT
from mechanism_sim.scene import Machine, span
from mechanism_sim.scene.ideal import without_clearance

MODULES = 'svg', 'stage', 'player', 'curves', 'keys', 'zoom', 'ideal_drawing', 'ideal_motion', 'ideal'

_TURN, _LOOKS = float(TWO_PI), 361
_FINE = 0.015  # of a symbol, how far edges of bodies may be off


def page(machine: Machine, sliders: Mapping[str, tuple[str, str]]) -> tuple[str, list[str]]:
    """The page as HTML, and in sentences what of the machine it leaves out.

    Parameters
    ----------
    sliders : lowest and highest values by the dotted paths of keys; none: the usual ones
    """
    needed('sympy', PURPOSE)
    ideal = _ideal(machine)
    drive = _Drive(ideal)
    reader = SliderReader(ideal, drive.course)
    _check(ideal, drive.kinematics, reader)
    reader.read(sliders)
    names = [*reader.equations.parameters]
    data = {
        **drive.to_json(),
        'stage': _stage(ideal, reader),
        'parameters': names,
        'dimensions': {name: _brief(name, x, reader) for name, x in reader.base.items()},
        'sliders': [slider.to_json() for slider in reader.found],
        'points': [
            [link, name] for link, named in ideal.plan.points.items() for name in named
            if link != 'ground' and any(s.kind == 'point' and s.link == link for s in reader.skeleton.shapes)
        ],
        'sides': [*four_bar_sides(ideal.plan.ideal)],
    }  # fmt: skip
    text = render(
        'ideal.html.jinja',
        version=installed_version(),
        scene=machine.name,
        title=ideal.scene.title,
        description=machine.scene.description.strip(),
        style=styles('stage', 'style', 'ideal'),
        modules=Markup(import_map(MODULES, {'equations': reader.equations.to_javascript(names)})),  # noqa: S704 - ours
        data=embedded(data),
    )
    return text, [*_left_out(machine), *reader.refused]


def _ideal(machine: Machine) -> Machine:
    """The machine without clearance, and without what only watches or shakes."""
    plan = machine.plan
    if plan.ideal.deformations:
        link = plan.ideal.deformations[0].partition('.')[0]
        raise _refusal(machine, f'{link} is elastic, and how it deforms depends on forces')
    scene = machine.scene
    if not (scene.drive or scene.drives):
        raise _refusal(machine, 'nothing drives it: its motion is free')
    silent = {'sensors': {}, 'oscillators': {}, 'measures': {}}
    watched = type(machine)(machine.name, scene.model_copy(update=silent))
    return without_clearance(watched, rigid=True)


def _refusal(machine: Machine, why: str) -> InputError:
    return InputError(
        f'{machine.name} cannot be a page of ideal motion: {why}; '
        f"'mechanism-sim report {machine.name}' makes a page of a run"
    )


def _check(machine: Machine, kinematics: Kinematics, reader: SliderReader) -> None:
    """Refuse what does not follow from the drives by smooth closures."""
    if switched := reader.equations.switched:
        raise _refusal(
            machine, f'{", ".join(sorted(switched))}: it follows another law in each part of a turn'
        )
    rows, sought = len(kinematics.rows), len(kinematics.sought)
    if rows < sought or machine.assembly.freedom > len(machine.plan.powered):
        free = [kinematics.coordinates[i].replace('.', ' ') for i in kinematics.sought]
        raise _refusal(machine, f'drives do not say how {", ".join(free)} move')
    if rows > sought:
        raise _refusal(machine, 'its loops depend on each other: other lengths would open them')


class _Drive:
    """The variable that a page is played over: the only drive, or the time if there are more.

    Attributes
    ----------
    course : (n, N) coordinates as far as the drive can go from the start
    """

    def __init__(self, machine: Machine) -> None:
        plan = self._plan = machine.plan
        self.driven = [*plan.laws]
        self.kinematics = plan.kinematics(self.driven)
        self._q, self._timed = machine.assembly.q, len(self.driven) > 1
        self.slides = plan.main in plan.ideal.displacements
        law, size = plan.laws[plan.main][0], plan.ideal.size
        start = 0.0 if self._timed else float(self._q[self.kinematics.held[0]])
        self.speed, self._laws = machine.drive.start[1], []
        self.start, self.low, self.high = start, start, start + _TURN
        if isinstance(law, DriveLaw):
            if not (self._timed or self.slides) and machine.drive.steady:
                pass
            else:
                end = span(machine, None, None)
                self._laws = [self._pieces(c, end) for c in self.driven]
                along = self._values(np.linspace(0.0, end, 10 * _LOOKS))[0]
                self.speed = float(np.abs(np.gradient(along, end / (10 * _LOOKS - 1))).max())
                self.low, self.high = along.min(), along.max()
                if self._timed:
                    self.low, self.high, self.speed = 0.0, end, 1.0
                elif not self.slides and self.high - self.low > _TURN:
                    self.low, self.high = start, start + _TURN
        elif self.slides:
            self.low, self.high = start - size, start + size
        if not self.speed:
            self.speed = 0.1 * size if self.slides else _TURN
        self.course = self._followed()

    def _pieces(self, c: str, end: float) -> list[tuple[float, tuple[float, ...]]]:
        """From when on [s], and powers of the time since then, of a coordinate's laws."""
        found, first = [], 0
        for law in self._plan.laws_until(c, end):
            assert isinstance(law, DriveLaw)  # noqa: S101 - prescribed ones have no others
            turns, (x, *more) = law.about(Fraction(law.valid_from))
            first = first if found else turns
            found.append((law.valid_from, (x + _TURN * (turns - first), *more)))
        return found

    def _values(self, t: Array) -> Array:
        """The driven coordinates (p, N) at times (N,)."""
        rows = []
        for pieces in self._laws:
            which = np.searchsorted([at for at, _ in pieces], t, 'right') - 1
            rows.append([
                np.polynomial.polynomial.polyval(x - pieces[k][0], pieces[k][1])
                for k, x in zip(which, t, strict=True)
            ])  # fmt: skip
        return np.array(rows)

    def _followed(self) -> Array:
        """Coordinates from the start to both ends, or to where the loops cannot be closed."""
        found = [self._q]
        for end in (self.high, self.low):
            last = [self._q, self._q]
            for u in np.linspace(self.start, end, _LOOKS)[1:]:
                guess = 2.0 * last[-1] - last[-2]
                guess[self.kinematics.held] = self._values(np.array([u]))[:, 0] if self._timed else u
                q, left = self.kinematics.positions(guess[:, None])
                if left.any() or np.abs(q[:, 0] - guess).max() > 0.3 * self.kinematics.scale.max():
                    break
                last.append(q[:, 0])
            found += last[2:]
        return np.array(found).T

    def to_json(self) -> dict[str, Any]:
        """All about it for a page."""
        plan, mechanism = self._plan, self._plan.ideal
        links = [body.name for body in mechanism.bodies]
        kinematics = self.kinematics
        return {
            'coordinates': [
                {'name': c, 'slides': c in mechanism.displacements, 'colour': index(links.index(c))}
                for c in mechanism.coordinates
            ],
            'held': kinematics.held,
            'sought': kinematics.sought,
            'scale': kinematics.scale.tolist(),
            'reach': mechanism.reach,
            'q': self._q.tolist(),
            'start': self.start,
            'low': self.low,
            'high': self.high,
            'turns': not self._timed and not self.slides and self.high - self.low >= _TURN - 1e-9,
            'speed': self.speed,
            'laws': self._laws if self._timed else [],
            'main': plan.main,
            'slides': self.slides,
        }


def _stage(machine: Machine, reader: SliderReader) -> dict[str, Any]:
    """What a page draws, without its dimensions."""
    skeleton = reader.skeleton
    lines = rails(skeleton)
    return {
        'scene': machine.name,
        'title': machine.scene.title,
        'symbol': skeleton.symbol,
        'links': skeleton.links,
        'shapes': [_shape(skeleton, i, shape) for i, shape in enumerate(skeleton.shapes)],
        'rails': {i: {'link': line.link, 'runner': link} for i, (line, (link, _)) in lines.items()},
        'springs': [[link for link, _ in ends] for ends in skeleton.springs],
        'ropes': [[link for link, _ in string.ends] for string in skeleton.strings],
        'coil': COIL.tolist(),
        'sizes': {'bar': BAR, 'slot': SLOT},
        'main': machine.plan.main,
    }


def _shape(skeleton: Skeleton, number: int, shape: Shape) -> dict[str, Any]:
    """A shape: of each of its paths the style, and which of its points belong to each curve."""
    paths, first = [], 0
    for style, curves in drawn(shape):
        ranges = []
        for curve in curves:
            kept = np.arange(len(curve))
            if shape.kind in ('wheel', 'cam', 'slider'):
                few = {tuple(x) for x in simplified(curve, _FINE * shape.symbol).tolist()}
                kept = np.array([k for k, x in enumerate(curve.tolist()) if tuple(x) in few])
            ranges.append((first + kept).tolist())
            first += len(curve)
        paths.append([style, ranges])
    joined = shape.kind == 'link' and bool(paths) and not shape.size
    corners = joined and len(skeleton.corners[shape.link]) + _guides(skeleton, shape.link) > 1
    return {
        'kind': shape.kind, 'link': shape.link, 'label': shape.label,
        'colour': index(shape.number), 'paths': paths, 'joined': bool(corners),
    }  # fmt: skip


def _guides(skeleton: Skeleton, link: str) -> int:
    return sum(line.link == link for line, _ in rails(skeleton).values())


def _brief(name: str, values: Array, reader: SliderReader) -> list[float]:
    """Numbers for the page: of what is only drawn no more digits than can be seen."""
    if name.startswith('shape:'):
        return np.round(values, 4 + ceil(-log10(reader.skeleton.symbol))).tolist()
    return values.tolist()


def _left_out(machine: Machine) -> list[str]:
    """Properties that the ideal machine lacks, in sentences."""
    found = [f'{name}: it has no clearance here' for name in machine.plan.clearances]
    found += [f'{name}: it is rigid here' for name in machine.plan.elastic]
    return found
