"""Dimensions behind a page of ideal motion, and how they follow keys of the scene.

All numbers that the page computes or draws with are arrays by name. Lengths and points go into
them linearly: a second machine tells how fast each number follows a key, a third one whether that
is all, together with the keys before it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, nearest, quoted
from mechanism_sim.export.shapes import Shape
from mechanism_sim.export.skeleton import Skeleton, skeleton_of
from mechanism_sim.pages.ideal_equations import PageEquations
from mechanism_sim.planar.mechanism import Mechanism, Prismatic, Revolute, StraightLine
from mechanism_sim.planar.points import GROUND, LinkPoint, Vector2
from mechanism_sim.scene import Machine, load_scene
from mechanism_sim.scene.files import check_scene
from mechanism_sim.units import alike, for_people, to_si_text, typeset

COMPUTED = 'link', 'rail', 'slot'
"""Kinds of shapes that the page makes itself: they depend on the motion."""

_STEP = 0.01  # of a value, or of the machine's size, by which it is changed
_LINEAR = 1e-8  # of such a step: what is farther off a straight line is none
_MOST, _FEW = 8, 4  # sliders that a page has unasked: of lengths, and then of points
_WIDTH = 0.6  # of a value, to each side


@dataclass(frozen=True)
class Slider:
    """A number of the scene that a page changes, in SI units.

    Attributes
    ----------
    path : dotted; of a component of a point with ``.x`` or ``.y`` behind it
    change : how fast the arrays of `dimensions` follow its value
    """

    path: str
    value: float
    low: float
    high: float
    unit: str
    change: Mapping[str, Array]

    def to_json(self) -> dict[str, Any]:
        """Description for a page."""
        unit, scale = for_people(self.unit)
        words = self.path.split('.')
        label = ' '.join(words[words[0] == 'links' :]).replace('_', ' ')
        own = {key: getattr(self, key) for key in ('path', 'value', 'low', 'high')}
        change = {name: x.tolist() for name, x in self.change.items() if x.any()}
        return own | {'label': label, 'unit': typeset(unit), 'scale': scale, 'change': change}


def rails(skeleton: Skeleton) -> dict[int, tuple[StraightLine, LinkPoint]]:
    """The lines on which something slides, and the point that does, by number of the shape."""
    found = {}
    for joint in skeleton.mechanism.joints:
        if (line := joint.line) is None:
            continue
        runner = joint.points[1 if isinstance(joint, Prismatic) else 0]
        for i, shape in enumerate(skeleton.shapes):
            if shape.kind in ('rail', 'slot') and shape.link == line.link:
                x, y = (shape.outline - line.on).T
                if np.abs(np.cos(line.axis) * y - np.sin(line.axis) * x).max() < 1e-9:
                    found[i] = line, runner
    return found


def drawn(shape: Shape) -> list[tuple[str, tuple[Array, ...]]]:
    """Style and curves (k, 2) [m] of a shape's paths, as many points in any machine of its kind."""
    if shape.kind in ('wheel', 'cam', 'slider'):
        return [('body', shape.curves)]
    return [(path.style, path.curves) for path in shape.paths]


def four_bar_sides(mechanism: Mechanism) -> dict[str, list[Vector2]]:
    """Both joints on each link of a machine that is a four-bar: ground first, coupler last."""
    joints, links = mechanism.joints, (GROUND, *(body.name for body in mechanism.bodies))
    if len(links) != 4 or len(joints) != 4 or not all(isinstance(j, Revolute) for j in joints):
        return {}
    sides = {link: [at for j in joints for x, at in j.points if x == link] for link in links}
    grounded = {x for j in joints if GROUND in j.links for x in j.links}
    ring = sorted(links, key=lambda link: link not in grounded)
    whole = len(grounded) == 3 and all(len(ends) == 2 for ends in sides.values())
    return {link: sides[link] for link in ring} if whole else {}


def dimensions(
    machine: Machine, equations: PageEquations, skeleton: Skeleton
) -> dict[str, Array]:
    """Numbers that a page computes and draws with, by what they are of."""
    found: dict[str, Any] = {f'par:{name}': x for name, x in equations.parameters.items()}
    for i, shape in enumerate(skeleton.shapes):
        found[f'outline:{i}'] = shape.outline
        lines = [x for _, curves in drawn(shape) for x in curves]
        found[f'shape:{i}'] = np.concatenate(lines) if lines else []
    found |= {f'corners:{link}': corners for link, corners in skeleton.corners.items()}
    for i, (line, (_, at)) in rails(skeleton).items():
        found[f'rail:{i}'] = [*line.on, np.cos(line.axis), np.sin(line.axis), *at]
    for i, ends in enumerate(skeleton.springs):
        found[f'spring:{i}'] = [at for _, at in ends]
    for i, string in enumerate(skeleton.strings):
        rows = zip(string.ends, string.radii, strict=True)
        found[f'rope:{i}'] = [[*at, radius] for (_, at), radius in rows]
    for link, named in machine.plan.points.items():
        found |= {f'point:{link}.{name}': at for name, at in named.items()}
    found |= {f'side:{link}': ends for link, ends in four_bar_sides(machine.plan.ideal).items()}
    return {name: np.array(x, float).ravel() for name, x in found.items()}


class SliderReader:
    """Sliders of a machine without clearance.

    Parameters
    ----------
    q : (n, N) coordinates along its drive, for its drawing

    Attributes
    ----------
    base : `dimensions` of the machine itself
    equations : of the machine with all sliders moved: there no dimension vanishes by chance
    found : the sliders
    refused : why keys of the machine have none
    """

    def __init__(self, machine: Machine, q: Array) -> None:
        self.machine, self._q = machine, q
        self.equations = PageEquations(machine.plan.ideal)
        self.skeleton = skeleton_of(machine, q)
        self.base = dimensions(machine, self.equations, self.skeleton)
        self.found: list[Slider] = []
        self.refused: list[str] = []
        self._document = machine.scene.to_document()

    def read(self, asked: Mapping[str, tuple[str, str]]) -> None:
        """Make the sliders that are asked for, lowest and highest values by path, or the usual."""
        for path, texts in asked.items():
            low, high, unit = self._limits(path, texts)
            if why := self._add(path, low, high, unit):
                raise InputError(f"--slider '{path}': {why}")
        for path in () if asked else self._usual():
            if len(self.found) < (_MOST if path.endswith('.length') else _FEW):
                value = self._value(path)
                away = _WIDTH * (abs(value) or 0.2 * self.skeleton.size)
                if why := self._add(path, value - away, value + away, 'm'):
                    self.refused.append(f'{path} has no slider: {why}')

    def _usual(self) -> list[str]:
        """Lengths of links, then coordinates of points, those of the frame first."""
        links = self.machine.scene.links
        lengths = [f'links.{x}.length' for x, link in links.items() if link.length is not None]
        return lengths + [
            f'links.{link}.points.{name}.{axis}'
            for link in sorted(links, key=lambda x: x != 'ground')
            for name, at in links[link].points.items()
            for axis, x in zip('xy', at, strict=True)
            if x
        ]

    def _value(self, path: str) -> float:
        place, axis = _split(path)
        value: Any = self._document
        for key in place.split('.'):
            value = value.get(key) if isinstance(value, Mapping) else None
        if axis is not None:
            value = value[axis] if isinstance(value, list | tuple) and len(value) == 2 else None
        if not isinstance(value, float):
            usual = self._usual()
            raise InputError(
                f"--slider '{path}': it is no number of the scene that may have any "
                f'value{nearest(path, usual)}; such are: {", ".join(usual)}'
            )
        return value

    def _limits(self, path: str, texts: tuple[str, str]) -> tuple[float, float, str]:
        value = self._value(path)
        try:
            (low, unit), (high, other) = map(to_si_text, texts)
        except ValueError as error:
            raise InputError(f"--slider '{path}': {quoted(':'.join(texts))} {error}") from error
        if not alike(unit, other) or not low < high:
            raise InputError(
                f"--slider '{path}': {quoted(':'.join(texts))} must be a low and a high value of "
                "one unit, as '40 mm:80 mm'"
            )
        for text in texts:
            check_scene(self.machine.name, self._document, self._overrides({path: text}))
        if not low <= value <= high:
            shown, scale = for_people(unit)
            raise InputError(
                f"--slider '{path}': {quoted(':'.join(texts))} leaves out the value of the scene, "
                f'{scale * value:.6g} {shown}'
            )
        return low, high, unit

    def _overrides(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Values by key, points with both components."""
        found: dict[str, Any] = {}
        for path, value in values.items():
            place, axis = _split(path)
            if axis is None:
                found[place] = value
                continue
            known: Any = self._document
            for key in place.split('.'):
                known = known[key]
            found.setdefault(place, [*known])[axis] = value
        return found

    def _with(self, values: Mapping[str, float]) -> tuple[dict[str, Array], PageEquations]:
        other = load_scene(self.machine, self._overrides(values))
        equations = PageEquations(other.plan.ideal)
        skeleton = skeleton_of(other, self._q, size=self.skeleton.size)
        return dimensions(other, equations, skeleton), equations

    def _add(self, path: str, low: float, high: float, unit: str) -> str:
        """Give a key a slider; why it cannot have one, else nothing."""
        value, size = self._value(path), self.skeleton.size
        step = _STEP * (abs(value) or (size if unit == 'm' else 1.0))
        away = {s.path: s.value + 0.3 * _STEP * (s.high - s.low) for s in self.found}
        try:
            one, _ = self._with({path: value + step})
            every, equations = self._with({**away, path: value - 2.0 * step})
        except InputError as error:
            return f'beside {value:g} {unit} there is no such machine: {error}'
        zero, change = np.zeros(1), {}
        for name in dict.fromkeys([*self.base, *one, *every]):
            base, first, last = (x.get(name, zero) for x in (self.base, one, every))
            if not base.shape == first.shape == last.shape:
                return 'the machine would be drawn of other parts'
            slope = (first - base) / step
            told = base - 2.0 * step * slope
            for slider in self.found:
                told = told + (away[slider.path] - slider.value) * slider.change.get(name, 0.0)
            off = np.abs(last - told).max(initial=0.0)
            if off > _LINEAR * _STEP * max(size, np.abs(last).max(initial=0.0)):
                if not self._redrawn(name):
                    return 'the motion does not follow it in proportion'
                slope = np.zeros(1)
            change[name] = np.where(np.abs(slope) > 1e-9, slope, 0.0)
        if not any(x.any() for x in change.values()):
            return 'nothing of the ideal motion depends on it'
        self.equations = equations
        self.found.append(Slider(path, value, low, high, unit, change))
        return ''

    def _redrawn(self, name: str) -> bool:
        """True of what the page makes itself, and of arrows that may stay where they are."""
        kind, _, number = name.partition(':')
        of_shape = kind in ('shape', 'outline')
        return of_shape and self.skeleton.shapes[int(number)].kind in ('drive', *COMPUTED)


def _split(path: str) -> tuple[str, int | None]:
    """A key, and which component of its value is meant."""
    place, _, last = path.rpartition('.')
    return (place, 'xy'.index(last)) if last in ('x', 'y') and place else (path, None)
