"""How charts look, and how their data are written."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.export.palette import DARK, INK, LINKS
from mechanism_sim.hybrid.events import Mode

MUTED, GRID = '#66727f', '#e9ecf0'

NIGHT = dict(zip(LINKS, DARK, strict=True)) | {
    INK: '#e4e7eb', MUTED: '#a3adb8', GRID: '#2b323a', '#b6bec7': '#5b6570', '#cdd3da': '#4a535d',
    '#ffffff': '#1d2329',
}  # fmt: skip
"""Colours on dark ground, by those on paper."""

MODES: dict[int, tuple[str, str]] = {
    Mode.UNKNOWN: ('unknown', '#dfe3e8'),
    Mode.FREE_FLIGHT: ('free flight', '#a8cdea'),
    Mode.FOLLOWING: ('following', '#e6a065'),
    Mode.STICKING: ('sticking', '#a8500f'),
    Mode.SLIDING_FORWARD: ('sliding forward', '#f0c896'),
    Mode.SLIDING_BACKWARD: ('sliding backward', '#cf7d33'),
    Mode.RECOVERING: ('recovering', '#c3bfe0'),
}
"""Words and colours of the modes of contact."""

_AXIS = {
    'showline': True, 'linecolor': '#b6bec7', 'linewidth': 1, 'ticks': 'outside', 'ticklen': 4,
    'tickcolor': '#b6bec7', 'gridcolor': GRID, 'gridwidth': 1, 'zeroline': True,
    'zerolinecolor': '#cdd3da', 'zerolinewidth': 1, 'automargin': True, 'exponentformat': 'power',
    'title': {'standoff': 6, 'font': {'size': 12, 'color': MUTED}},
}  # fmt: skip
_CIRCLE = {
    'gridcolor': GRID, 'linecolor': '#b6bec7', 'tickfont': {'size': 10, 'color': MUTED},
    'exponentformat': 'power',
}  # fmt: skip
TEMPLATE = go.layout.Template(
    layout={
        'font': {
            'family': 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif',
            'size': 12, 'color': INK,
        },
        'colorway': LINKS, 'paper_bgcolor': 'rgba(0,0,0,0)', 'plot_bgcolor': 'rgba(0,0,0,0)',
        'margin': {'l': 56, 'r': 16, 't': 10, 'b': 44}, 'height': 300, 'hovermode': 'closest',
        'hoverlabel': {'bgcolor': '#ffffff', 'bordercolor': '#b6bec7', 'font': {'color': INK}},
        'legend': {
            'orientation': 'h', 'x': 0.0, 'xanchor': 'left', 'y': 1.02, 'yanchor': 'bottom',
            'bgcolor': 'rgba(0,0,0,0)', 'font': {'size': 11}, 'itemwidth': 30,
        },
        'modebar': {
            'bgcolor': 'rgba(0,0,0,0)', 'color': '#b6bec7', 'activecolor': INK,
            'remove': ['select2d', 'lasso2d', 'autoScale2d', 'toImage', 'zoomIn2d', 'zoomOut2d'],
        },
        'xaxis': _AXIS, 'yaxis': _AXIS,
        'polar': {
            'bgcolor': 'rgba(0,0,0,0)',
            'angularaxis': {
                **_CIRCLE, 'ticksuffix': '°', 'dtick': 45, 'thetaunit': 'degrees',
                'direction': 'counterclockwise', 'rotation': 0,
            },
            'radialaxis': {
                **_CIRCLE, 'nticks': 5, 'rangemode': 'tozero', 'showline': False,
            },
        },
    },
    data={'scatter': [{'line': {'simplify': False}}]},  # else what bends gently gets corners
)  # fmt: skip


def dash(index: int) -> str:
    """Of the line of this number: another where colours come again."""
    return ('solid', 'dash', 'dot', 'dashdot')[index // len(LINKS) % 4]


def pale(shade: str, opacity: float = 0.28) -> str:
    """A colour, mostly transparent."""
    r, g, b = (int(shade[i : i + 2], 16) for i in (1, 3, 5))
    return f'rgba({r},{g},{b},{opacity:g})'


def chart(x: str, y: str, **layout: Any) -> go.Figure:
    """An empty figure with its axes named."""
    figure = go.Figure(layout={'template': TEMPLATE, **layout})
    figure.update_xaxes(title_text=x)
    figure.update_yaxes(title_text=y)
    return figure


def polar(unit: str, size: Array, direction: Array, **layout: Any) -> go.Figure:
    """An empty figure over directions, its scale where the least is of what it will show.

    Parameters
    ----------
    unit : on the radial axis
    size, direction : (N,) of what will be in it, [deg]
    """
    sector = np.floor(np.mod(direction, 360.0) / 45.0).astype(int) % 8
    reach = [float(size[sector == k].max(initial=0.0)) for k in range(8)]
    largest = max(reach) or 1.0
    free = 22.5 + 45.0 * int(np.argmin(np.round(np.array(reach) / largest, 1)))
    margin = {'l': 36, 'r': 36, 't': 30, 'b': 30}
    figure = go.Figure(layout={'template': TEMPLATE, 'height': 320, 'margin': margin, **layout})
    figure.update_polars(
        radialaxis={'angle': free, 'tickangle': free, 'ticksuffix': f' {unit}'},
        radialaxis_showticksuffix='last',
        radialaxis_range=[0.0, 1.08 * largest],
    )
    return figure


def brief(x: ArrayLike) -> NDArray[np.float32]:
    """Numbers with seven digits: half the data, and more than any screen shows."""
    return np.asarray(x, np.float32)


def places(x: NDArray[np.float64]) -> NDArray[Any]:
    """Times or the like, as briefly as tells them apart on any screen."""
    span = float(np.ptp(x)) if len(x) else 0.0
    short = brief(x)
    fine = not len(x) or np.spacing(np.abs(short).max()) < 3e-5 * span
    return short if fine else x


def written(figure: go.Figure) -> dict[str, Any]:
    """What plotly.js takes."""
    found: dict[str, Any] = figure.to_plotly_json()
    return found
