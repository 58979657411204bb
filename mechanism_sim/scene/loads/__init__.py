"""The kinds of loads that a scene may have: one file each."""

from mechanism_sim.scene.load_keys import LOADS, read_loads

__all__ = ['LOADS', 'read_loads']

LOADS.load(__name__, __path__, backwards=True)
