"""Pressure of an oil film by the short-bearing solution, and motions of a journal in it."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from mechanism_sim.engine.contact.film import ShortBearing

OIL = ShortBearing(viscosity=0.02, width=8e-3, radius=10e-3, clearance=30e-6)
eccentric = st.floats(0.0, 0.95)
angles = st.floats(-np.pi, np.pi)
speeds = st.floats(1e-3, 0.1)
spins = st.floats(-300.0, 300.0)


@st.composite
def motions(draw):
    """[x, y, vx, vy, spin of the journal, spin of the bushing]."""
    e, v = OIL.clearance * draw(eccentric), draw(speeds)
    at, towards = draw(angles), draw(angles)
    place = e * np.cos(at), e * np.sin(at), v * np.cos(towards), v * np.sin(towards)
    return np.array([*place, draw(spins), draw(spins)])


def squeeze(motion):
    """V as complex number."""
    x, y, vx, vy, journal, bushing = motion
    return vx + 1j * vy - 0.5j * (journal + bushing) * (x + 1j * y)


def pressure(motion, theta, z, bearing=OIL):
    """Of the full film, by the short-bearing solution [Pa]."""
    n = np.exp(1j * theta)
    h = bearing.clearance - (np.conj(motion[0] + 1j * motion[1]) * n).real
    Vn = (np.conj(squeeze(motion)) * n).real
    return 6.0 * bearing.viscosity * Vn / h**3 * (bearing.width**2 / 4.0 - z * z), h
