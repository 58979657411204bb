"""MuJoCo as a peer: a tendon of limited length is the pin in its bushing.

The tendon between pin and bushing may be as long as the clearance: exact geometry, where contact
of a sphere with a ring of shapes would be a polygon. MuJoCo holds a limit by the acceleration
a = -b v - k r of the tendon, for its overlap r and speed v. With b = (1 + e)/h, over one step h,
that is Newton's law of impact, v+ = -e v. The spring k only takes away the overlap that a step has
left; on average it adds k h^2/2 to e, which b has less.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np

from mechanism_sim.bench.four_bar import LooseFourBar, Peer
from mechanism_sim.bench.problem import Outcome, Run, without

RIGIDITY = 0.9999  #: the share of the acceleration asked for that a limit keeps, at most
FLYWHEEL = 1e9  #: [kg m^2] on the crank's axle: its speed stays the same to 1e-11 rad/s

MODEL = """
<mujoco>
  <compiler angle="radian" autolimits="false"/>
  <option timestep="{h!r}" gravity="0 {gravity!r} 0" integrator="Euler" solver="PGS"
          iterations="1" tolerance="0" jacobian="dense">
    <flag contact="disable" eulerdamp="disable" island="disable"/>
  </option>
  <worldbody>
    <body>
      <joint axis="0 0 1" armature="{flywheel!r}"/>
      {crank_inertial}
      <body pos="{bar.crank!r} 0 0">
        <joint axis="0 0 1"/>
        {coupler_inertial}
        <site name="pin" pos="{bar.coupler!r} 0 0"/>
      </body>
    </body>
    <body pos="{bar.ground!r} 0 0">
      <joint axis="0 0 1"/>
      {rocker_inertial}
      <site name="bushing" pos="{bar.rocker!r} 0 0"/>
    </body>
  </worldbody>
  <tendon>
    <spatial limited="true" range="0 {bar.clearance!r}" solreflimit="{stiffness!r} {damping!r}"
             solimplimit="{rigidity!r} {rigidity!r} 1 0.5 1">
      <site site="pin"/>
      <site site="bushing"/>
    </spatial>
  </tendon>
</mujoco>
"""


def inertial(mass: float, inertia: float, cog: float) -> str:
    """Mass [kg], inertia about the centre of gravity [kg m^2], its distance from the joint [m]."""
    inertias = f'{inertia!r} {inertia!r} {inertia!r}'
    return f'<inertial pos="{cog!r} 0 0" mass="{mass!r}" diaginertia="{inertias}"/>'


def model(bar: LooseFourBar, steps: int) -> str:
    """The mechanism in MuJoCo's language, for a number of steps of the whole run."""
    h = bar.duration / steps
    pull = 1.0 / sqrt(steps)  # k h^2
    return MODEL.format(
        bar=bar,
        h=h,
        gravity=-bar.gravity,
        flywheel=FLYWHEEL,
        rigidity=RIGIDITY,
        stiffness=-pull / h**2,
        damping=-(1.0 + bar.restitution - pull / 2.0) / h,
        crank_inertial=inertial(bar.crank_mass, bar.crank_inertia, bar.crank_cog),
        coupler_inertial=inertial(bar.coupler_mass, bar.coupler_inertia, bar.coupler_cog),
        rocker_inertial=inertial(bar.rocker_mass, bar.rocker_inertia, bar.rocker_cog),
    )


def prepare(bar: LooseFourBar, setting: float) -> Run:
    """A run in `setting` steps per revolution."""
    import mujoco  # noqa: PLC0415 - an optional package

    steps = round(setting * bar.revolutions)
    compiled = mujoco.MjModel.from_xml_string(model(bar, steps))
    data = mujoco.MjData(compiled)

    def run() -> Callable[[], Outcome]:
        mujoco.mj_resetData(compiled, data)
        data.qpos = bar.crank_angle, bar.coupler_angle - bar.crank_angle, bar.rocker_angle
        data.qvel = bar.crank_speed, bar.coupler_rate - bar.crank_speed, bar.rocker_rate
        mujoco.mj_step(compiled, data, nstep=steps)
        crank, coupler, rocker = data.qpos
        return lambda: Outcome(np.array([crank + coupler, rocker]), steps)

    return run


PEER = Peer(
    'MuJoCo',
    (5e3, 20e3, 80e3, 320e3, 1280e3),
    'steps per revolution',
    prepare,
    'MJCF of hinges, the crank with a flywheel as armature, the pin a tendon of limited length '
    'whose solref makes the law of Newton out of one step; semi-implicit Euler and PGS in one '
    'call of mj_step. Tried and worse at equal cost: springs that resolve the impact (Euler and '
    'RK4, 4 to 60 steps per impact), the Newton solver, other stiffnesses. Where impacts fall '
    'within a step is chance: the error of one run scatters by a factor of ten about its trend.',
    lambda: without('mujoco'),
    any_restitution=True,
)
