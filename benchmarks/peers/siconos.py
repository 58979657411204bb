"""Siconos as a peer: Moreau-Jean time stepping with Newton's law of impact.

Coupler and rocker angle are the coordinates of a Lagrangian system with constant mass matrix,
the crank is in the load; the bearing is a relation that depends on time. Loads and relation are
plug-ins in C, as Siconos has them. It lives in an interpreter of its own: that of the environment
variable `MECHANISM_SIM_SICONOS_PYTHON`, else `python3`, else `/usr/bin/python3` of the system.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.four_bar import LooseFourBar, Peer
from benchmarks.problem import Outcome, Run

PROCESS = Path(__file__).with_name('siconos_process.py')

TRIAL = """
try:
    import siconos.kernel
    print('here')
except ImportError:
    pass
"""

PLUGIN = """
#include <math.h>

static const double crank = %(crank)r, coupler = %(coupler)r, rocker = %(rocker)r;
static const double ground = %(ground)r, clearance = %(clearance)r, gravity = %(gravity)r;
static const double start = %(crank_angle)r, speed = %(crank_speed)r;
static const double first_moment_of_coupler = %(coupler_mass)r * %(coupler_cog)r;
static const double first_moment_of_rocker = %(rocker_mass)r * %(rocker_cog)r;

/* M q'' + load(t, q) = contact */
void load(double t, unsigned n, double *q, double *v, double *f, unsigned nz, double *z)
{
  f[0] = first_moment_of_coupler
    * (gravity * cos(q[0]) - crank * speed * speed * sin(start + speed * t - q[0]));
  f[1] = first_moment_of_rocker * gravity * cos(q[1]);
}

void stiffness(double t, unsigned n, double *q, double *v, double *J, unsigned nz, double *z)
{
  J[0] = first_moment_of_coupler
    * (crank * speed * speed * cos(start + speed * t - q[0]) - gravity * sin(q[0]));
  J[1] = J[2] = 0.0;
  J[3] = -first_moment_of_rocker * gravity * sin(q[1]);
}

/* the pin, from the centre of the bushing */
static void pin(double t, const double *q, double *x, double *y)
{
  double a = start + speed * t;
  *x = crank * cos(a) + coupler * cos(q[0]) - ground - rocker * cos(q[1]);
  *y = crank * sin(a) + coupler * sin(q[0]) - rocker * sin(q[1]);
}

/* (c^2 - r^2)/(2 c): value and slope of c - r at contact, smooth at the centre */
void gap(unsigned n, double *q, double t, unsigned m, double *y, unsigned nz, double *z)
{
  double X, Y;
  pin(t, q, &X, &Y);
  y[0] = (clearance * clearance - X * X - Y * Y) / (2.0 * clearance);
}

void gradient(unsigned n, double *q, double t, unsigned m, double *G, unsigned nz, double *z)
{
  double X, Y;
  pin(t, q, &X, &Y);
  G[0] = coupler * (X * sin(q[0]) - Y * cos(q[0])) / clearance;
  G[1] = rocker * (Y * cos(q[1]) - X * sin(q[1])) / clearance;
}

void drift(unsigned n, double *q, double t, unsigned m, double *y, unsigned nz, double *z)
{
  double X, Y, a = start + speed * t;
  pin(t, q, &X, &Y);
  y[0] = crank * speed * (X * sin(a) - Y * cos(a)) / clearance;
}
"""


def output(command: list[str], text: str = '', folder: str | None = None) -> str:
    """Output of a command for a text, in a folder.

    Raises
    ------
    RuntimeError
        If it fails, with its standard error.
    """
    done = subprocess.run(  # noqa: S603 - commands of this module
        command, input=text, cwd=folder, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f'{command[0]} failed: {done.stderr.strip()}')
    return done.stdout


@cache
def interpreter() -> str | None:
    """A Python that can import Siconos, ``None`` if there is none."""
    wanted = os.environ.get('MECHANISM_SIM_SICONOS_PYTHON')
    for python in [wanted] if wanted else ['python3', '/usr/bin/python3']:
        path = shutil.which(python)
        if path and output([path, '-I', '-c', TRIAL]).strip() == 'here':
            return path
    return None


def missing() -> str | None:
    """Reason why Siconos cannot run here; ``None`` if it can."""
    if interpreter() is None:
        return 'no python3 can import siconos; MECHANISM_SIM_SICONOS_PYTHON may name one'
    if shutil.which('cc') is None:
        return 'there is no C compiler `cc`, which its plug-ins need'
    return None


def prepare(bar: LooseFourBar, setting: float) -> Run:
    """A run in `setting` steps per revolution."""
    folder = TemporaryDirectory()
    library = Path(folder.name, 'four_bar.so')
    compiler = ['cc', '-x', 'c', '-', '-O3', '-shared', '-fPIC', '-o', str(library), '-lm']
    output(compiler, PLUGIN % vars(bar))
    steps = round(setting * bar.revolutions)
    problem = {
        'library': str(library),
        'angles': [bar.coupler_angle, bar.rocker_angle],
        'rates': [bar.coupler_rate, bar.rocker_rate],
        'mass_matrix': np.diag(bar.inertias).tolist(),
        'restitution': bar.restitution,
        'duration': bar.duration,
        'steps': steps,
    }
    command = [interpreter() or 'python3', '-I', str(PROCESS)]

    def run() -> Callable[[], Outcome]:
        result = json.loads(output(command, json.dumps(problem), folder.name))
        return lambda: Outcome(np.array(result['answer']), steps, cpu_time=result['cpu_time'])

    return run


PEER = Peer(
    'Siconos',
    (5e3, 20e3, 80e3, 320e3),
    'steps per revolution',
    prepare,
    'Two coordinates, plug-ins in C, MoreauJeanOSI with theta = 1/2 and one Newton iteration a '
    'step, LCP and NewtonImpactNSL. Tried and no better: theta 0.51, more Newton iterations, '
    'other gamma, direct and combined projection. EventDriven with LsodarOSI (4.4) finds the '
    'impacts to 1e-11 s but stops with an error where chatter ends: the acceleration it finds for '
    'the lasting contact is not zero.',
    missing,
    any_restitution=True,
)
