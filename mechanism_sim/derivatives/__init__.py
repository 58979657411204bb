"""Derivatives of runs with respect to numbers of a scene, through impacts and other events."""
