"""All charts of a run, subject by subject."""

from __future__ import annotations

from mechanism_sim.analysis.record import Record
from mechanism_sim.report.charts.chart import ChartSection
from mechanism_sim.report.charts.contacts import contacts
from mechanism_sim.report.charts.course import ChartedRun
from mechanism_sim.report.charts.energy import energy, solver
from mechanism_sim.report.charts.impacts import impacts
from mechanism_sim.report.charts.loads import loads
from mechanism_sim.report.charts.motion import drive, elastic, forces, guides, motion
from mechanism_sim.report.charts.parts import parts
from mechanism_sim.report.charts.sensors import sensors


def sections(record: Record, skip: int = 0) -> list[ChartSection]:
    """All that there is to see of a run, subject by subject; only what its machine has.

    However long the run, a line has no more than some 4,000 points; each keeps its extremes.

    Parameters
    ----------
    skip : whole turns of the main drive at the start that are left out
    """
    course = ChartedRun(record, skip)
    found = (
        motion(course),
        elastic(course),
        loads(course),
        forces(course),
        drive(course),
        contacts(course),
        impacts(course, skip),
        sensors(course, skip),
        *parts(course),
        guides(course),
        energy(course),
        solver(course),
    )
    return [s for s in found if s and (s.charts or s.rows or s.table)]
