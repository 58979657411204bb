"""A loose bearing under a lens: where the pin is in its bushing, its clearance magnified."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.patches import Circle
from numpy.typing import NDArray

from mechanism_sim.analysis.record import Record
from mechanism_sim.arrays import Array
from mechanism_sim.hybrid.events import Mode
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.report.brush import FILL, INK
from mechanism_sim.sensing.joint_view import JointView

ACCENT, FLASH = '#b03a2e', '#e2b3ad'
"""Of forces, and of impacts."""

EDGE = 1.32
"""Half the width of the lens, in radii of the bushing."""

_PLAY = 0.55  # clearance, in radii of the bushing
_POINTS = 12  # of the pin's path in a frame
_FLASH = 0.1  # [s] of film that an impact is shown


class Lens:
    """The pin of a joint in its bushing, at the instants of a film.

    Parameters
    ----------
    axes : Matplotlib's, square
    joint : a revolute joint with clearance
    t : (N,) [s] of the frames
    observed, modes : the machine then
    pace : simulated seconds in a second of film

    Attributes
    ----------
    metre : a metre of clearance, in radii of the bushing
    """

    def __init__(
        self, axes: Any, record: Record, joint: str, t: Array, observed: Observation,
        modes: NDArray[np.uint8], pace: float,
    ) -> None:  # fmt: skip
        machine = record.machine
        self._t, self._pace, self._axes = t, pace, axes
        steady = not record.slides and record.rate > 0.0
        self._turn = 1.0 / record.rate if steady else 0.25 * float(t[-1] - t[0])
        self._joint = machine.mechanism.joint(joint)
        self.metre = _PLAY / machine.clearances[joint].radial
        view = JointView(machine.mechanism, self._joint, machine.physics, observed, modes)
        self._force = -view.force  # of the bushing on the pin
        self._largest = float(np.nanmax(np.hypot(*self._force), initial=0.0)) or 1.0
        known = machine.physics.clearances  # a film of oil has no modes
        numbers = modes[known.index(joint)].tolist() if joint in known else [0] * len(t)
        self._words = [Mode(k).name.replace('_', ' ').lower() if k else '' for k in numbers]
        self._struck = np.array([i.t for i in record.piece.impacts if i.joint == joint])
        events = self._struck[(self._struck >= t[0]) & (self._struck <= t[-1])]
        self._times = np.union1d(np.linspace(t[0], t[-1], _POINTS * len(t)), events)
        self._path = self._separation(record, self._times)
        self._pin = self._separation(record, t)
        self._paint(axes, joint)

    def _separation(self, record: Record, t: Array) -> Array:
        """From the bushing's centre to the pin's (2, N), in radii of the bushing."""
        j, mechanism = self._joint, record.machine.mechanism
        q = record.piece.motion.curve(t).T
        bushing = mechanism.locate_all(j.second, q, j.on_second)
        return self.metre * (mechanism.locate_all(j.first, q, j.on_first) - bushing)

    def _paint(self, axes: Any, joint: str) -> None:
        axes.set(xlim=(-EDGE, EDGE), ylim=(-EDGE, EDGE), aspect='equal')
        axes.set_axis_off()
        self._rim = axes.add_patch(Circle((0.0, 0.0), 1.14, fc=FILL, ec=INK, lw=1.0, zorder=1))
        axes.add_patch(Circle((0.0, 0.0), 1.0, fc='white', ec=INK, lw=0.8, zorder=2))
        axes.add_patch(
            Circle((0.0, 0.0), _PLAY, fc='none', ec='0.75', lw=0.7, ls=(0, (4, 3)), zorder=4)
        )
        axes.plot(0.0, 0.0, '+', color='0.6', ms=7.0, mew=0.7, zorder=4)
        self._disc = axes.add_patch(
            Circle((0.0, 0.0), 1.0 - _PLAY, fc='0.80', ec=INK, lw=1.0, alpha=0.8, zorder=3)
        )
        self._disc.set_gid(f'lens-{joint}')
        (self._trace,) = axes.plot([], [], color='0.25', lw=0.8, zorder=5)
        (self._dot,) = axes.plot([], [], 'o', color=INK, ms=3.0, zorder=7)
        self._arrow = axes.quiver(
            [0.0], [0.0], [0.0], [0.0], color=ACCENT, angles='xy', scale_units='xy', scale=1.0,
            units='xy', width=0.035, zorder=6, minlength=0.0,
        )  # fmt: skip
        self._mode = axes.text(0.0, -EDGE, '', ha='center', va='top', fontsize=9.0)

    def title(self, text: str) -> None:
        """Write above the lens."""
        self._axes.text(0.0, EDGE, text, ha='center', va='bottom', fontsize=9.0)

    def show(self, i: int) -> None:
        """The instant of frame i."""
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
        self._rim.set_facecolor(FLASH if before[1] > before[0] else FILL)
        self._mode.set_text(self._words[i])
