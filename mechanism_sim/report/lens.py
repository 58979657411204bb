"""Plays under a lens: where a pin is in its bushing, or a part between walls, magnified.

`Stage` and its frames say where everything is; this draws it with Matplotlib, in radii of the
bushing or halves of the space between walls. Pages and viewers draw the same data.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.patches import Circle, FancyBboxPatch, Rectangle
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from mechanism_sim.analysis.record import Record
from mechanism_sim.arrays import Array
from mechanism_sim.export.palette import ACCENT, INK, colour, tint
from mechanism_sim.export.stage import HALF, PLAY, Stage, StageFrames
from mechanism_sim.planar.play import gaps_of
from mechanism_sim.results.instants import instants

FLASH = tint(ACCENT, 0.4)
"""Of impacts."""

EDGE = 1.32
"""Half the width of the lens, in radii of the bushing."""

_POINTS = 12  # of the pin's path in a frame
_FLASH = 0.1  # [s] of film that an impact is shown


class Lens:
    """A play at the instants of a film; `lens_of` makes the one for a joint.

    Parameters
    ----------
    axes : Matplotlib's, square
    states : (N,) numbers among the words of the play

    Attributes
    ----------
    metre : a metre of play in the lens
    """

    metre: float

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


def lens_of(
    axes: Any, record: Record, stage: Stage, joint: str, frames: StageFrames, pace: float
) -> Lens:
    """The lens over a joint with play.

    Parameters
    ----------
    axes : Matplotlib's, square
    stage, frames : what moves, at N instants
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
        # of the bushing on the pin; stages without forces have no joints
        known = self._joint in stage.joints
        k = stage.joints.index(self._joint) if known else 0
        self._force = -frames.forces[:, k].T if known else np.zeros((2, len(t)))
        self._largest = float(np.nanmax(np.hypot(*self._force), initial=0.0)) or 1.0
        own = gaps_of(machine.mechanism, joint, machine.physics.clearances)
        self._struck = np.array([i.t for i in record.piece.impacts if i.joint in own])
        many = _POINTS * len(t)
        self._times = instants(record.piece, float(t[0]), float(t[-1]), 0.0, many, many)
        self._path = self._separation(record, self._times)
        self._pin = self.metre * frames.pins[:, bearing].T
        self._paint(axes, stage)

    def _separation(self, record: Record, t: Array) -> Array:
        """From the bushing's centre to the pin's (2, N), in radii of the bushing."""
        j, mechanism = self._joint, record.machine.mechanism
        curve = record.piece.motion.curve
        q = curve.local(*curve.find(t)).T
        bushing = mechanism.locate_all(j.second, q, j.on_second)
        return self.metre * (mechanism.locate_all(j.first, q, j.on_first) - bushing)

    def _paint(self, axes: Any, stage: Stage) -> None:
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
        before = np.searchsorted(self._struck, [now - _FLASH * self._pace, now], side='right')
        self._rim.set_facecolor(FLASH if before[1] > before[0] else self._fill)


class _Slit(Lens):
    """A part between the walls of a pair with play, or off the one it may leave."""

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
