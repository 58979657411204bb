"""Figures that belong to no window, and that notebooks show by themselves."""

from __future__ import annotations

from io import BytesIO
from typing import Any

from matplotlib.figure import Figure

_DENSITY = 2.0  # dots for each pixel of a notebook


class Picture(Figure):
    """A figure without a window: save it with ``savefig``, or let a notebook show it."""

    def _repr_png_(self) -> tuple[bytes, dict[str, Any]]:
        """The picture as notebooks ask for it, and how large it is to be shown [pixels]."""
        buffer = BytesIO()
        self.savefig(buffer, format='png', dpi=_DENSITY * self.dpi)
        width, height = (round(side * self.dpi) for side in self.get_size_inches())
        return buffer.getvalue(), {'width': width, 'height': height}
