"""From bags to numbers: what a recorded run did, and whether all of it was recorded."""

from mechanism_sim.analysis.record import Record, find_topics, machine_of, read_record
from mechanism_sim.analysis.summary import Summary, analyze
from mechanism_sim.hybrid.digest import MotionDigest

__all__ = [
    'MotionDigest',
    'Record',
    'Summary',
    'analyze',
    'find_topics',
    'machine_of',
    'read_record',
]
