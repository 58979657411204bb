"""A machine in its first cycle, for the sizes of pictures and layouts."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields

from mechanism_sim.arrays import Array
from mechanism_sim.export.stage import Stage, Swaying, stage_of
from mechanism_sim.results.cycle import Cycle, cycle, is_steady
from mechanism_sim.results.ranges import LoadPeaks
from mechanism_sim.scene import Machine


@dataclass(frozen=True, eq=False)
class Preview(Stage):
    """A machine in its first cycle, by which sizes are chosen."""

    found: Cycle = field(kw_only=True)  #: first cycle
    #: largest joint reaction [N]; 0 where forces are not known
    largest: float = field(kw_only=True)

    @property
    def centre(self) -> Array:
        """Middle of the view (2,) [m]."""
        return 0.5 * (self.low + self.high)


def preview(machine: Machine, duration: float | None = None) -> Preview:
    """Run a machine over a cycle, or without one as long as its scene lasts.

    Parameters
    ----------
    duration : [s] of a run that may be shorter than the scene
    """
    wanted = [d for d in (machine.scene.duration, duration) if d]
    found = cycle(machine, 180, duration=None if is_steady(machine) or not wanted else min(wanted))
    observed = found.solution.view(found.t).observed
    peaks = LoadPeaks(machine, float(found.t[0]))
    peaks.add(found.solution.motion)
    bounded = [x.value for x in peaks.forces.values() if math.isfinite(x.value)]
    sway = Swaying(machine).take(found.solution.motion)(found.t)
    stage = stage_of(machine, observed, sway)
    known = {x.name: getattr(stage, x.name) for x in fields(Stage)}
    return Preview(**known, found=found, largest=max(bounded, default=0.0))
