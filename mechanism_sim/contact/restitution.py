"""Frictionless impact with Newton's coefficient of restitution."""

from __future__ import annotations

from collections.abc import Sequence

from mechanism_sim.numerics.complementarity import solve_lcp


def newton_impulses(
    compliance: list[list[float]], approach: Sequence[float], restitution: Sequence[float]
) -> list[float]:
    """Normal impulses of the m contacts that touch at one instant [N s].

    Newton's hypothesis in the form of a complementarity: each contact ends with at least
    ``-e`` times its approach rate, and carries an impulse only if with exactly that. For a
    single contact it is ``(1 + e) m_eff v`` ([SB] 5.1).

    Parameters
    ----------
    compliance : (m, m) gap rates per unit impulse [1/kg]
    approach : (m,) gap rates before [m/s], negative when closing
    restitution : (m,)
    """
    b = [(1.0 + e) * rate for e, rate in zip(restitution, approach, strict=True)]
    return solve_lcp(compliance, b)
