"""A machine on a figure whose parts move from frame to frame, with a magnified clearance.

`Stage` and its frames say where everything is; this draws it with Matplotlib, a lens in radii of
the bushing or halves of the space between walls. Pages and viewers draw the same data.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterator, Sequence
from itertools import cycle as endless
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.patches import Circle, ConnectionPatch, FancyBboxPatch, Rectangle
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from mechanism_sim.analysis.record import Record
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, check_known
from mechanism_sim.export.palette import ACCENT, INK, colour, tint
from mechanism_sim.export.skeleton import bounds
from mechanism_sim.export.stage import HALF, PLAY, Stage, StageFrames, Swaying, stage_of
from mechanism_sim.planar.gaps import gaps_of
from mechanism_sim.report.drawing import PATHS, Brush, Labels, Move, rule, trace
from mechanism_sim.report.picture import Picture
from mechanism_sim.results.quantities.motion import choose_points
from mechanism_sim.results.run import instants
from mechanism_sim.units import for_people

FLASH = tint(ACCENT, 0.4)
"""Colour of impacts."""

EDGE = 1.32
"""Half the width of the lens, in radii of the bushing."""

_POINTS = 12  # points of the pin's path in a frame
_FLASH = 0.1  # [s] of film that an impact is shown
DENSITY = 100.0
"""Pixels in an inch of print."""

_BLOCK = 256  # frames placed at once
_SWEEP = 721  # instants by which sizes are chosen
_ARROW = 0.3  # length of the largest force, as a share of the machine's size
_HEAD, _FOOT = 34.0, 26.0  # [pixels] for the title, and for the clock
_LETTER = 7.5  # [pixels] of the title
_LENS, _WORDS = 170.0, 60.0  # [pixels] at least, and above and below it
_PART = 0.5, 0.3, 0.75  # shares of the drawing: height, width, largest height


class FilmParts(NamedTuple):
    """Parts of a film beside the machine."""

    #: joint under the lens; ``''`` the first that is loose, ``None`` no lens
    lens: str | None = ''
    forces: bool = False  #: arrows at all joints
    paths: str | Sequence[str] = ()  #: points ``LINK.POINT`` whose paths are drawn
    #: names that are drawn, as `mechanism_sim.report.drawing.draw` has it
    labels: Literal['all', 'links', 'none'] = 'none'


class Screen:
    """A machine at the instants of a film.

    Parameters
    ----------
    t : (N,) [s] of the frames
    pace : simulated seconds in a second of film
    size : longer side of the figure, or its width and height [pixels]
    """

    def __init__(
        self, record: Record, t: Array, shown: FilmParts, pace: float, size: int | tuple[int, int]
    ) -> None:
        self._record, self._t, machine = record, t, record.machine
        if shown.forces and not machine.physics.has_forces:
            raise InputError(f'{machine.name}: forces are not computed at its level')
        points = choose_points(machine, shown.paths)
        self._span = t[0], min(2.0 * t[-1] - t[-2], record.end) if len(t) > 1 else t[0]
        many = np.linspace(*self._span, _SWEEP)
        samples, sway = record.piece.view(many), Swaying(machine).take(record.history)
        self._stage = stage_of(machine, samples.observed, sway(many))
        self._sway = self._stage.drawn(sway(t))
        skeleton = self._skeleton = self._stage.skeleton
        low, high = bounds(skeleton, skeleton.poses(samples.observed.local))
        lens = _lens_joint(record, self._stage, shown.lens)
        layout = _layout((high - low) / (high[1] - low[1]), size, bool(lens))
        self.size = layout.size  #: width and height [pixels], even numbers
        #: Matplotlib's
        self.figure = Picture((self.size[0] / DENSITY, self.size[1] / DENSITY), dpi=DENSITY)
        axes = self.figure.add_axes(layout.machine, xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_axis_off()
        metre = layout.machine[3] * self.size[1] / (high[1] - low[1])  # [pixels]
        self._brush = brush = Brush(axes, skeleton, metre * 72.0 / DENSITY)
        names = Labels(axes, brush, skeleton.symbol, low, high)
        rule(axes, skeleton, low + brush.thick(6.0), high[0] - low[0])
        self._shows: list[Callable[[int], None]] = [self._clock()]
        for (name, place), style in zip(points.items(), endless(PATHS)):
            line = self._path(axes, place, style, name)
            names.avoid(line)
        (first,) = skeleton.poses(self._coordinates(t[:1]))
        brush.paint(first)
        self._moves: list[Move] = []
        if shown.labels != 'none':
            self._moves.append(names.write(skeleton, first, shown.labels == 'all'))
        lines = textwrap.wrap(machine.scene.title, max(20, int(self.size[0] / _LETTER)))
        self.figure.text(
            0.5, 1.0 - 0.55 * _HEAD / self.size[1], '\n'.join(lines[:2]), ha='center',
            va='center', fontsize=10.0 if len(lines) == 1 else 8.5,
        )  # fmt: skip
        if not (lens or shown.forces):
            return
        k, dt = record.piece.motion.curve.find(t)
        observed = machine.physics.observe(record.piece.motion, k, dt)
        frames = self._stage.frames(t, observed, record.piece.motion.modes[k].T)
        if shown.forces:
            self._shows.append(self._arrows(axes, frames))
        if lens:
            under = self.figure.add_axes(layout.lens)
            glass = _lens_of(under, record, self._stage, lens, frames, pace)
            self._shows.append(self._callout(axes, under, lens, frames))
            times = glass.metre * layout.lens[2] * self.size[0] / (2.0 * EDGE) / metre
            glass.title(f'{lens.replace("_", " ")}\n{times:.3g} times larger')
            self._shows.append(glass.show)

    def frames(self) -> Iterator[int]:
        """Put everything to the instant of each frame, one after the other; gives its number."""
        for first in range(0, len(self._t), _BLOCK):
            poses = self._skeleton.poses(self._coordinates(self._t[first : first + _BLOCK]))
            for i in range(first, min(first + _BLOCK, len(self._t))):
                self._brush.move(poses[i - first], self._sway[i])
                for move in self._moves:
                    move(poses[i - first])
                for show in self._shows:
                    show(i)
                yield i

    def _coordinates(self, t: Array) -> Array:
        curve = self._record.piece.motion.curve
        return curve.local(*curve.find(t)).T

    def _path(self, axes: Any, place: Any, style: Any, name: str) -> Array:
        """The whole path of a point, and a dot that runs on it."""
        link, at = place
        fine = np.linspace(*self._span, max(_SWEEP, 4 * len(self._t)))

        def along(t: Array) -> Array:
            poses = self._skeleton.poses(self._coordinates(t))
            return self._skeleton.placed(link, np.array([at]), poses)[:, 0]

        path = along(fine)
        trace(axes, self._skeleton, name, path, style)
        (dot,) = axes.plot([], [], 'o', color=INK, ms=3.0, zorder=5.5)
        now = along(self._t)
        self._shows.append(lambda i: dot.set_data(*now[i : i + 1].T))
        return path

    def _clock(self) -> Callable[[int], None]:
        """The time, and where the drive is."""
        record, (width, height) = self._record, self.size
        text = self.figure.text(
            12.0 / width, 0.5 * _FOOT / height, '', fontsize=9.0, va='center', color='0.3'
        )
        i = record.machine.physics.coordinates.index(record.machine.plan.main)
        drive, degrees = self._coordinates(self._t)[i], np.degrees(record.angle(self._t))
        unit, scale = for_people('m', record.machine.mechanism.size)

        def show(i: int) -> None:
            where = f'{scale * drive[i]:.1f} {unit}' if record.slides else f'{degrees[i]:.0f}°'
            name = record.machine.plan.main
            text.set_text(f't = {self._t[i]:.4f} s    {name} {where}')

        return show

    def _callout(
        self, axes: Any, under: Any, lens: str, frames: StageFrames
    ) -> Callable[[int], None]:
        """A line from the joint to its lens."""
        joint = self._record.machine.mechanism.joint(lens)
        if joint in self._stage.joints:
            at = frames.acting(self._stage)[self._stage.joints.index(joint)].T
        else:
            place = np.array([joint.on_second])
            at = self._skeleton.placed(joint.second, place, frames.poses)[:, 0]
        line = ConnectionPatch(
            (0.0, 0.0), (-EDGE, 0.0), 'data', 'data', axesA=axes, axesB=under, color='0.55',
            lw=0.7, ls=(0, (4, 3)), zorder=0.5,
        )  # fmt: skip
        self.figure.add_artist(line)

        def show(i: int) -> None:
            x, y = at[i].tolist()
            line.xy1 = x, y
            line.set_visible(bool(np.isfinite(at[i]).all()))

        return show

    def _arrows(self, axes: Any, frames: StageFrames) -> Callable[[int], None]:
        """The force of the first-named on the second-named link of each joint, where it acts."""
        at, force = frames.acting(self._stage), frames.forces.transpose(1, 2, 0)  # (j, 2, N)
        size = np.hypot(*force.swapaxes(0, 1))
        largest = float(np.nanmax(size, initial=0.0)) or 1.0
        shown = np.where(size > 1e-3 * largest, size, np.nan)
        arrows = force / shown[:, None] * (_ARROW * self._skeleton.size / largest) * size[:, None]
        symbol = self._skeleton.symbol
        quiver = axes.quiver(
            *at[:, :, 0].T, *np.zeros((2, len(at))), color=ACCENT, angles='xy', scale_units='xy',
            scale=1.0, units='xy', width=0.45 * symbol, zorder=8, minlength=0.0,
        )  # fmt: skip
        self.figure.text(
            1.0 - 12.0 / self.size[0], 0.5 * _FOOT / self.size[1],
            f'longest arrow {largest:.3g} N', fontsize=9.0, va='center', ha='right', color=ACCENT,
        )  # fmt: skip

        def show(i: int) -> None:
            quiver.set_offsets(at[:, :, i])
            quiver.set_UVC(*np.ma.masked_invalid(arrows[:, :, i].T))

        return show


def _lens_joint(record: Record, stage: Stage, wanted: str | None) -> str:
    """The joint under the lens; none if empty."""
    if wanted is None:
        return ''
    machine = record.machine
    known = [joint.name for joints in (stage.bearings, stage.plays) for joint in joints]
    if wanted:
        wrong = f"'{wanted}' is not a joint with play"
        check_known(wanted, known, wrong, f'such joints of {machine.name}:')
    return wanted or (known[0] if known else '')


class _Layout(NamedTuple):
    """Places of axes as parts of a figure: left, bottom, width, height."""

    size: tuple[int, int]  #: size of the figure [pixels]
    machine: tuple[float, float, float, float]
    lens: tuple[float, float, float, float]


def _layout(shape: Array, size: int | tuple[int, int], lens: bool) -> _Layout:
    """The machine with its lens to the right, the title above, the clock below.

    Parameters
    ----------
    shape : width and height of the drawing of the machine, in heights
    """
    wide, high = (size, size) if isinstance(size, int) else size
    if not 240 <= min(wide, high) <= max(wide, high) <= 4096:
        raise InputError(f'a film of {wide} by {high} pixels: choose from 240 to 4096')
    aspect, part = float(shape[0]), 0.0
    if lens:
        part = min(max(_PART[0], _PART[1] * aspect), _PART[2])
    rest = high - _HEAD - _FOOT
    height = min(rest, wide / (aspect + part))
    beside = min(max(part * height, _LENS), 0.45 * wide) if lens else 0.0
    height = min(height, (wide - beside) / aspect)
    if isinstance(size, int):
        wide, high = math.ceil(aspect * height + beside), math.ceil(height + _HEAD + _FOOT)
    wide, high = wide + wide % 2, high + high % 2
    left = 0.5 * (wide - aspect * height - beside)
    bottom = _FOOT + 0.5 * (high - _HEAD - _FOOT - height)
    side = max(1.0, min(beside, height - _WORDS))
    up = bottom + 0.5 * (height - side)
    return _Layout(
        (wide, high),
        (left / wide, bottom / high, aspect * height / wide, height / high),
        ((left + aspect * height + 0.5 * (beside - side)) / wide, up / high, side / wide,
         side / high),
    )  # fmt: skip


class Lens:
    """A clearance at the instants of a film; `_lens_of` makes that of a joint.

    Parameters
    ----------
    axes : Matplotlib's, square
    states : (N,) indices among the words of the clearance
    """

    metre: float  #: length in the lens per metre of clearance

    def __init__(self, axes: Any, words: list[str], states: NDArray[np.uint8]) -> None:
        axes.set(xlim=(-EDGE, EDGE), ylim=(-EDGE, EDGE), aspect='equal')
        axes.set_axis_off()
        self._axes = axes
        self._words = [words[k] for k in states.tolist()]
        self._text = axes.text(0.0, -EDGE, '', ha='center', va='top', fontsize=9.0)

    def title(self, text: str) -> None:
        """Write above the lens."""
        self._axes.text(0.0, EDGE, text, ha='center', va='bottom', fontsize=9.0)

    def show(self, i: int) -> None:
        """The instant of frame i."""
        self._text.set_text(self._words[i])


def _lens_of(
    axes: Any, record: Record, stage: Stage, joint: str, frames: StageFrames, pace: float
) -> Lens:
    """The lens over a joint with clearance.

    Parameters
    ----------
    axes : Matplotlib's, square
    stage, frames : moving parts, and their poses at N instants
    pace : simulated seconds in a second of film
    """
    if joint in {pair.name for pair in stage.plays}:
        return _Slit(axes, stage, joint, frames)
    return _Bushing(axes, record, stage, joint, frames, pace)


class _Bushing(Lens):
    """The pin of a revolute joint in its bushing."""

    def __init__(
        self, axes: Any, record: Record, stage: Stage, joint: str, frames: StageFrames, pace: float
    ) -> None:
        machine, t = record.machine, frames.t
        bearing = [j.name for j in stage.bearings].index(joint)
        self._joint = stage.bearings[bearing]
        super().__init__(axes, stage.words(self._joint), frames.modes[:, bearing])
        self._t, self._pace = t, pace
        steady = not record.slides and record.rate > 0.0
        self._turn = 1.0 / record.rate if steady else 0.25 * float(t[-1] - t[0])
        self.metre = PLAY / machine.plan.clearances[joint].radial
        # force of the bushing on the pin; stages without forces have no joints
        known = self._joint in stage.joints
        k = stage.joints.index(self._joint) if known else 0
        self._force = -frames.forces[:, k].T if known else np.zeros((2, len(t)))
        self._largest = float(np.nanmax(np.hypot(*self._force), initial=0.0)) or 1.0
        own = gaps_of(machine.mechanism, joint, machine.physics.clearances)
        struck = record.piece.impacts
        self._impact_times = struck.column('t')[np.isin(struck.names, own)]
        many = _POINTS * len(t)
        self._times = instants(record.piece, float(t[0]), float(t[-1]), 0.0, many, many)
        # pin's centre relative to the bushing's (2, N), in radii of the bushing
        pair, mechanism = self._joint, record.machine.mechanism
        curve = record.piece.motion.curve
        q = curve.local(*curve.find(self._times)).T
        bushing = mechanism.locate_all(pair.second, q, pair.on_second)
        self._path = self.metre * (mechanism.locate_all(pair.first, q, pair.on_first) - bushing)
        self._pin = self.metre * frames.pins[:, bearing].T
        links = stage.links
        pin, self._fill = (
            tint(colour(links.index(x) if x in links else -1))
            for x in (self._joint.first, self._joint.second)
        )

        def circle(radius: float, **how: Any) -> Any:
            return axes.add_patch(Circle((0.0, 0.0), radius, **how))

        self._rim = circle(1.14, fc=self._fill, ec=INK, lw=1.0, zorder=1)
        circle(1.0, fc='white', ec=INK, lw=0.8, zorder=2)
        circle(PLAY, fc='none', ec='0.75', lw=0.7, ls=(0, (4, 3)), zorder=4)
        axes.plot(0.0, 0.0, '+', color='0.6', ms=7.0, mew=0.7, zorder=4)
        self._disc = circle(1.0 - PLAY, fc=pin, ec=INK, lw=1.0, alpha=0.9, zorder=3)
        self._disc.set_gid(f'lens-{self._joint.name}')
        (self._trace,) = axes.plot([], [], color='0.25', lw=0.8, zorder=5)
        (self._dot,) = axes.plot([], [], 'o', color=INK, ms=3.0, zorder=7)
        self._arrow = axes.quiver(
            [0.0], [0.0], [0.0], [0.0], color=ACCENT, angles='xy', scale_units='xy', scale=1.0,
            units='xy', width=0.035, zorder=6, minlength=0.0,
        )  # fmt: skip

    def show(self, i: int) -> None:
        super().show(i)
        now, pin, force = self._t[i], self._pin[:, i], self._force[:, i]
        self._disc.set_center((pin[0], pin[1]))
        self._dot.set_data(pin[:1], pin[1:])
        first, last = np.searchsorted(self._times, [now - self._turn, now], side='right')
        self._trace.set_data(*np.append(self._path[:, first:last], pin[:, None], axis=1))
        arrow = 0.9 * np.nan_to_num(force) / self._largest
        self._arrow.set_offsets(pin)
        self._arrow.set_UVC(arrow[:1], arrow[1:])
        self._arrow.set_visible(bool(np.hypot(*arrow) > 1e-3))
        before = np.searchsorted(
            self._impact_times, [now - _FLASH * self._pace, now], side='right'
        )
        self._rim.set_facecolor(FLASH if before[1] > before[0] else self._fill)


class _Slit(Lens):
    """A part between the walls of a pair with clearance, or off the one it may leave."""

    def __init__(self, axes: Any, stage: Stage, joint: str, frames: StageFrames) -> None:
        k = [pair.name for pair in stage.plays].index(joint)
        about = stage.to_json()['plays'][k]
        super().__init__(axes, about['words'], frames.touching[:, k])
        self.metre = 2.0 * PLAY / about['width']
        # across the walls all is as many times larger, so that corners touch them where they do
        self._at, tilt = self.metre * frames.off[:, k].T
        self._lean = 0.5 * tilt / HALF
        face, body = (colour(about[x]) for x in ('face', 'body'))
        for x in (-1.25, 1.0) if about['walls'] > 1 else (1.0,):
            axes.add_patch(Rectangle((x, -1.0), 0.25, 2.0, fc=tint(face), ec=face))
        half = 1.0 - PLAY
        shape = FancyBboxPatch(
            (-half, -HALF), 2.0 * half, 2.0 * HALF,
            boxstyle='square,pad=0' if about['tilts'] else 'round,pad=0,rounding_size=0.1',
            fc=tint(body), ec=body,
        )  # fmt: skip
        self._body = axes.add_patch(shape)
        self._body.set_gid(f'lens-{joint}')

    def show(self, i: int) -> None:
        super().show(i)
        way = Affine2D.from_values(1.0, 0.0, -self._lean[i], 1.0, self._at[i], 0.0)
        self._body.set_transform(way + self._axes.transData)
