"""The charts of a run, made by plotly: what a report shows below the animated machine."""

from mechanism_sim.pages.charts.section import Chart, Section
from mechanism_sim.pages.charts.subjects import sections

__all__ = ['Chart', 'Section', 'sections']
