"""One run of the loose four-bar in Siconos, by an interpreter that has it (not ours).

Reads a problem as JSON from standard input and writes the answer and its CPU time to standard
output. `siconos.py` beside it says what the problem holds.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any


def solve(problem: dict[str, Any]) -> dict[str, Any]:
    """Angles of coupler and rocker [rad] at the end, and the CPU time of the steps [s]."""
    import siconos.kernel as sk  # noqa: PLC0415 - not in the interpreter that reads this module

    library = problem['library']
    links = sk.LagrangianDS(problem['angles'], problem['rates'], problem['mass_matrix'])
    links.setComputeFIntFunction(library, 'load')
    links.setComputeJacobianFIntqFunction(library, 'stiffness')
    name = library.removesuffix('.so')
    relation = sk.LagrangianRheonomousR(f'{name}:gap', f'{name}:gradient', f'{name}:drift')
    law = sk.NewtonImpactNSL(problem['restitution'])

    system = sk.NonSmoothDynamicalSystem(0.0, 2.0 * problem['duration'])  # ends after all steps
    system.insertDynamicalSystem(links)
    system.link(sk.Interaction(law, relation), links)
    clock = sk.TimeDiscretisation(0.0, problem['duration'] / problem['steps'])
    stepping = sk.TimeStepping(system, clock, sk.MoreauJeanOSI(0.5), sk.LCP())
    stepping.setNewtonOptions(sk.SICONOS_TS_LINEAR)

    began = time.process_time()
    for _ in range(problem['steps']):
        stepping.computeOneStep()
        stepping.nextStep()
    return {'answer': list(links.q()), 'cpu_time': time.process_time() - began}


if __name__ == '__main__':
    json.dump(solve(json.load(sys.stdin)), sys.stdout)
