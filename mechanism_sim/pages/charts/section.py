"""The parts of a report that hold charts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

_HEIGHT = 360  # [pixels] of a figure that does not say

Axis = Literal['time', 'angle', 'frequency', 'polar', 'other']


@dataclass(frozen=True)
class Chart:
    """A chart with its data.

    Attributes
    ----------
    key : unique among all charts of a report
    figure : ``data`` and ``layout`` as plotly.js takes them, arrays in base64
    axis : what is on the horizontal axis: of ``time`` it is the time of the run [s]; at points
        over ``angle`` and of impacts ``customdata`` is that time
    joint : the joint, sensor or part that it is about; empty if it is about several
    """

    key: str
    title: str
    figure: dict[str, Any]
    axis: Axis
    joint: str = ''

    @property
    def height(self) -> int:
        """Of the figure [pixels]."""
        return self.figure.get('layout', {}).get('height') or _HEIGHT


@dataclass(frozen=True)
class Section:
    """A subject with its charts.

    Attributes
    ----------
    text : a sentence or two on what is to be seen; may be empty
    rows : a table beside the charts, line by line: what, and its value with its unit
    """

    key: str
    title: str
    text: str
    charts: tuple[Chart, ...]
    rows: tuple[tuple[str, str], ...] = ()
