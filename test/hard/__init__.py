"""The hard cases: where simulators of contact break, and what this one does there.

Each module holds cases of one kind; a case says what is hard, what is measured, and by which
second route the truth is known. ``python -m test.hard`` runs them all.
"""
