"""The kinds of joints that a scene may have: one folder each, known by its `keys.py`."""

from mechanism_sim import joints
from mechanism_sim.joints.joint_keys import KINDS

__all__ = ['KINDS']

KINDS.load(joints.__name__, joints.__path__, 'keys')
