"""The kinds of joints that a scene may have: one file each."""

from mechanism_sim.scene.joint_keys import KINDS

__all__ = ['KINDS']

KINDS.load(__name__, __path__)
