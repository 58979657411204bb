"""Reports of a run as text: summaries, tables, progress.

The room has the name of the public function ``mechanism_sim.report``, and is called in its place:
a room that is imported takes its name in the package.
"""

import inspect
import sys
from types import ModuleType
from typing import Any

from mechanism_sim.engine import plotting


class _Report(ModuleType):
    def __call__(self, *sources: Any, **how: Any) -> Any:
        """Write the page of a run; see `mechanism_sim.pages.writing.report`."""
        return plotting.report()(*sources, **how)

    @property
    def __signature__(self) -> inspect.Signature:
        return inspect.signature(plotting.report())


sys.modules[__name__].__class__ = _Report
