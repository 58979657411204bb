"""Dimensions behind a page of ideal motion, and how they follow keys of the scene.

All numbers that the page computes or draws with are arrays by name. Lengths and points go into
them linearly: a second machine tells how fast each number follows a key, a third one whether that
is all, together with the keys before it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, nearest, quoted
from mechanism_sim.export.shapes import BAR, Shape
from mechanism_sim.export.skeleton import Skeleton, skeleton_of
from mechanism_sim.pages.ideal_equations import PageEquations
from mechanism_sim.planar.mechanism import Mechanism, Revolute
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.planar.view import SLOT
from mechanism_sim.scene import Machine, load_scene
from mechanism_sim.scene.facts import value_at
from mechanism_sim.scene.files import check_scene
from mechanism_sim.units import alike, for_people, to_si_text, typeset

_GUIDES = 'rail', 'slot'  # kinds of shapes on which something slides

_STEP = 0.01  # step of a value, as a share of it or of the machine's size
_LINEAR = 1e-8  # tolerance of straight lines, as a share of such a step
_MOST, _FEW = 8, 4  # sliders by default: of lengths, and then of points
_WIDTH = 0.6  # range to each side, as a share of a value
_MOVING = 'par:', 'point:'  # dimensions that rule the motion, or a path


@dataclass(frozen=True)
class Slider:
    """A number of the scene that a page changes, in SI units."""

    path: str  #: dotted; of a component of a point with ``.x`` or ``.y`` behind it
    value: float
    low: float
    high: float
    unit: str
    change: Mapping[str, Array]  #: derivatives of the arrays of `dimensions` by its value

    def to_json(self) -> dict[str, Any]:
        """Description for a page, with what `Control.to_json` has."""
        unit, scale = for_people(self.unit, max(abs(self.low), abs(self.high)))
        words = [word for word in self.path.split('.') if word not in ('links', 'points')]
        low, high, value = scale * self.low, scale * self.high, scale * self.value
        return {
            'path': self.path, 'label': '.'.join(words), 'unit': typeset(unit),
            'low': low, 'high': high, 'value': value, 'step': (high - low) / 1000.0,
            'si': self.value, 'scale': scale, 'effect': 'now', 'logarithmic': False,
            'change': {name: x.tolist() for name, x in self.change.items() if x.any()},
        }  # fmt: skip


def shapes_of(skeleton: Skeleton) -> dict[str, Shape]:
    """All but centres of gravity, by names under which machines of one kind have them."""
    found: dict[str, Shape] = {}
    for shape in skeleton.shapes:
        name = f'{shape.kind} {shape.link} {shape.label}'
        if shape.kind != 'cog':
            found[f'{name} {sum(known.startswith(name) for known in found)}'] = shape
    return found


def curves_of(
    skeleton: Skeleton, shape: Shape, lines: Mapping[str, Array] | None = None
) -> list[tuple[str, tuple[Array, ...], tuple[float, ...]]]:
    """Style and curves (k, 2) [m] of what is painted, and how far around them edges are [m].

    Machines of one kind have equally many points: nothing is thinned, and bars, plates and slots
    are told by their corners.

    Parameters
    ----------
    lines : both ends (2, 2) [m] of guides by the names of their shapes, if not as they are drawn
    """
    s, drawn = shape.symbol, shapes_of(skeleton)
    lines = {n: x.outline for n, x in drawn.items() if x.kind in _GUIDES} | dict(lines or {})
    line = next((lines[name] for name, x in drawn.items() if x is shape and name in lines), None)
    if shape.kind == 'slot' and line is not None:
        inner, outer = s * SLOT, s * (SLOT + 0.35)
        return [('body', (line, line), (outer, inner)), ('paper', (line,), (inner,))]
    if line is not None and shape.link != GROUND:
        return [('body', (line,), (0.6 * BAR * s,))]
    if line is not None:
        across = _across(shape.outline) * (_across(shape.outline) @ (line - shape.outline)[0])
        return [(p.style, tuple(x + across for x in p.curves), (0.0,) * len(p.curves))
                for p in shape.paths]  # fmt: skip
    if shape.kind == 'link' and shape.paths:
        own = [x for name, x in lines.items() if drawn[name].link == shape.link]
        return [(shape.paths[0].style, (_corners(skeleton, shape, own),), (BAR * s,))]
    if shape.kind in ('wheel', 'cam', 'slider'):
        return [('body', shape.curves, (0.0,) * len(shape.curves))]
    return [(path.style, path.curves, (0.0,) * len(path.curves)) for path in shape.paths]


def _corners(skeleton: Skeleton, shape: Shape, lines: Sequence[Array]) -> Array:
    """Points (k, 2) [m] of a bar or plate: what its link reaches to, and its guides."""
    marked = any(x.kind == 'cog' and x.link == shape.link for x in skeleton.shapes)
    # the last leads to a centre of gravity that is marked, which the page leaves out
    found = np.array(skeleton.corners[shape.link][: len(skeleton.corners[shape.link]) - marked])
    if shape.size or len(found) + len(lines) < 2:  # a hand or a pendulum
        return np.concatenate(shape.curves)
    middle, feet = (found if len(found) else lines[0]).mean(axis=0), []
    for start, end in lines:
        share = (middle - start) @ (end - start) / ((end - start) @ (end - start))
        feet.append(start + np.clip(share, 0.0, 1.0) * (end - start))
    return np.array([*found, *feet])


def _moved(base: Array, line: Array) -> Array:
    """A guide (2, 2) of one machine where another has it, as long: enough of it is drawn."""
    normal = _across(base)
    return np.asarray(base + normal * (normal @ (line[0] - base[0])))


def _across(line: Array) -> Array:
    """The normal (2,) of a line (2, 2)."""
    (x, y) = line[1] - line[0]
    return np.asarray(np.array([-y, x]) / np.hypot(x, y))


def four_bar_sides(mechanism: Mechanism) -> dict[str, list[Vector2]]:
    """Joints on each link of a machine that is a four-bar: ground first, coupler last."""
    joints, links = mechanism.joints, (GROUND, *(body.name for body in mechanism.bodies))
    if len(links) != 4 or len(joints) != 4 or not all(isinstance(j, Revolute) for j in joints):
        return {}
    sides = {link: [at for j in joints for x, at in j.points if x == link] for link in links}
    grounded = {x for j in joints if GROUND in j.links for x in j.links}
    whole = len(grounded) == 3 and all(len(ends) == 2 for ends in sides.values())
    return {x: sides[x] for x in sorted(links, key=lambda x: x not in grounded)} if whole else {}


class SliderReader:
    """Sliders of a machine without clearance.

    Parameters
    ----------
    q : (n, N) coordinates along its drive, for its drawing
    size : size for the scale of symbols, if not that of the machine [m]
    """

    def __init__(self, machine: Machine, q: Array, size: float = 0.0) -> None:
        self.machine, self._q = machine, q
        self.skeleton = skeleton_of(machine, q, size=size)  #: skeleton of the drawing
        drawn = shapes_of(self.skeleton)
        self._guides = {name: x.outline for name, x in drawn.items() if x.kind in _GUIDES}
        #: dimensions of the base machine, and equations with all sliders moved, where no term
        #: vanishes by chance
        self.base, self.equations = self._dimensions(machine)
        self.found: list[Slider] = []  #: the sliders
        self.refused: list[str] = []  #: usual keys without a slider
        self._document = machine.scene.to_document()

    def _dimensions(self, machine: Machine) -> tuple[dict[str, Array], PageEquations]:
        """Numbers that a page computes and draws with, by what they are of."""
        equations = PageEquations(machine.plan.ideal)
        skeleton = skeleton_of(machine, self._q, size=self.skeleton.size)
        found: dict[str, Any] = {f'par:{name}': x for name, x in equations.parameters.items()}
        drawn = shapes_of(skeleton)
        guides = {n: _moved(x, drawn[n].outline) for n, x in self._guides.items() if n in drawn}
        for name, shape in drawn.items():
            lines = [x for _, curves, _ in curves_of(skeleton, shape, guides) for x in curves]
            found[f'shape:{name}'] = lines or [[]]
            if shape.kind == 'point' or not lines:
                found[f'outline:{name}'] = shape.outline
        found |= {f'spring:{i}': [x for _, x in ends] for i, ends in enumerate(skeleton.springs)}
        for i, (ends, radii) in enumerate(skeleton.strings):
            found[f'rope:{i}'] = [[*x, radius] for (_, x), radius in zip(ends, radii, strict=True)]
        for link, named in machine.plan.points.items():
            found |= {f'point:{link}.{name}': at for name, at in named.items()}
        sides = four_bar_sides(machine.plan.ideal)
        found |= {f'side:{link}': ends for link, ends in sides.items()}
        return {name: _flat(x) for name, x in found.items()}, equations

    def read(self, asked: Mapping[str, tuple[str, str]]) -> None:
        """Make the requested sliders, lowest and highest values by path, or the usual ones."""
        for path, texts in asked.items():
            if why := self._add(path, *self._limits(path, texts)):
                raise InputError(f"--slider '{path}': {why}")
        for path in () if asked else self._usual():
            if len(self.found) < (_MOST if path.endswith('.length') else _FEW):
                value = self._value(path)
                away = _WIDTH * abs(value)
                if self._add(path, value - away, value + away, 'm'):
                    self.refused.append(path)

    def _usual(self) -> list[str]:
        """Lengths of links, then coordinates of points, those of the frame first."""
        links = self.machine.scene.links
        lengths = [f'links.{x}.length' for x, link in links.items() if link.length is not None]
        return lengths + [
            f'links.{link}.points.{name}.{axis}'
            for link in sorted(links, key=lambda x: x != GROUND)
            for name, at in links[link].points.items()
            for axis, x in zip('xy', at, strict=True)
            if x
        ]

    def _value(self, path: str) -> float:
        value, _ = value_at(self.machine.scene, path)
        if not isinstance(value, float):
            usual = self._usual()
            raise InputError(
                f"--slider '{path}': it is not a number of the scene that may have any "
                f'value{nearest(path, usual)}; such are: {", ".join(usual)}'
            )
        return value

    def _limits(self, path: str, texts: tuple[str, str]) -> tuple[float, float, str]:
        """Lowest and highest value of a slider, and their unit."""
        value, where = self._value(path), f"--slider '{path}': {quoted(':'.join(texts))}"
        try:
            (low, unit), (high, other) = map(to_si_text, texts)
        except ValueError as error:
            raise InputError(f'{where} {error}') from error
        if path.startswith('links.'):
            unit, other = unit or 'm', other or 'm'
        if not alike(unit, other) or not low < high:
            raise InputError(f"{where} must be a low and a high value, as '40 mm:80 mm'")
        for text in texts:
            check_scene(self.machine.name, self._document, {path: text})
        if not low <= value <= high:
            shown, scale = for_people(unit)
            own = f'{scale * value:.6g} {shown}'.rstrip()
            raise InputError(f'{where} does not contain the value of the scene, {own}')
        return low, high, unit

    def at(self, values: Mapping[str, float]) -> Machine:
        """The machine at other values [SI] by path."""
        return load_scene(self.machine, values)

    def _add(self, path: str, low: float, high: float, unit: str) -> str:
        """Give a key a slider; why it cannot have one, else nothing."""
        value, size, zero = self._value(path), self.skeleton.size, np.zeros(1)
        step = _STEP * (abs(value) or (size if unit == 'm' else 1.0))
        away = {s.path: s.value + 0.3 * _STEP * (s.high - s.low) for s in self.found}
        parts = [(away[s.path] - s.value, s.change) for s in self.found]
        try:
            one, every = (
                self._dimensions(self.at(values))
                for values in ({**away, path: value + step}, {**away, path: value - 2.0 * step})
            )
        except InputError as error:
            return f'beside {value:g} {unit} there is no such machine: {error}'
        if not one[1].is_like(every[1]):
            return 'the motion does not follow it in proportion'
        change: dict[str, Array] = {}
        for name in dict.fromkeys([*self.base, *one[0], *every[0]]):
            base, first, last = (x.get(name, zero) for x in (self.base, one[0], every[0]))
            if not base.shape == first.shape == last.shape:
                return 'the drawing would consist of other parts'
            moved = base + sum(far * of.get(name, 0.0) for far, of in parts)
            slope = (first - moved) / step
            told = moved - 2.0 * step * slope
            off = np.abs(last - told).max(initial=0.0)
            if off > _LINEAR * _STEP * max(size, np.abs(last).max(initial=0.0)):
                if not _may_stay(name):
                    what = 'motion' if name.startswith(_MOVING) else 'drawing'
                    return f'the {what} does not follow it in proportion'
                slope = 0.0 * base
            change[name] = np.where(np.abs(slope) > 1e-9, slope, 0.0)
        if not any(x.any() for name, x in change.items() if name.startswith(_MOVING)):
            return 'nothing of the ideal motion depends on it'
        self.equations = every[1]
        self.found.append(Slider(path, value, low, high, unit, change))
        return ''


def _flat(x: Any) -> Array:
    """Numbers, points or curves as numbers in a row."""
    parts = x if isinstance(x, list) else [x]
    return np.concatenate([np.ravel(part) for part in parts])


def _may_stay(name: str) -> bool:
    """True of scales of closures, whose zeros alone matter, and of arrows beside a joint."""
    scale = name.startswith('par:') and name.endswith('.size')
    return scale or name.startswith('shape:drive')
