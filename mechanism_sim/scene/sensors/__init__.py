"""The kinds of sensors that a scene may have: one file each."""

from mechanism_sim.scene.sensor_keys import SENSORS

__all__ = ['SENSORS']

SENSORS.load(__name__, __path__)
