"""The hard cases: where simulators of contact break, and what this one does there.

Each module holds cases of one kind; a case says what is hard, what is measured, and by which
second route the truth is known. `mechanism-sim bench hard` runs them all.
"""

from mechanism_sim.bench.hard.case import Case, Figure, Outcome, cases, run

__all__ = ['Case', 'Figure', 'Outcome', 'cases', 'run']
