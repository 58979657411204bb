"""MuJoCo as a peer: a tendon of limited length is the pin in its bushing.

The tendon between pin and bushing may be as long as the clearance: exact geometry, where contact
of a sphere with a ring of shapes would be a polygon. MuJoCo holds a limit by the acceleration
a = -b v - k r of the tendon, for its overlap r and speed v. With b = (1 + e)/h, over one step h,
that is Newton's law of impact, v+ = -e v. The spring k only takes away the overlap that a step has
left; on average it adds k h^2/2 to e, which b has less.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, sqrt

from benchmarks.four_bar import Peer
from benchmarks.problem import Outcome, Run, missing
from benchmarks.tree import HINGE, SLIDE_X, SLIDE_Y, Link, Tree
from mechanism_sim.errors import RunError
from mechanism_sim.planar.points import GROUND

RIGIDITY = 0.9999  #: the share of the acceleration asked for that a limit keeps, at most


def element(link: Link, children: str) -> str:
    """A link and what it carries."""
    axes = {SLIDE_X: ('slide', '1 0 0'), SLIDE_Y: ('slide', '0 1 0'), HINGE: ('hinge', '0 0 1')}
    joints = ''
    for axis in link.axes:
        kind, way = axes[axis]
        more = f'armature="{link.flywheel!r}" damping="{link.damping!r}"' * (axis == HINGE)
        joints += f'<joint name="{link.name}.{axis}" type="{kind}" axis="{way}" {more}/>'
    inertia = link.inertia
    return f"""
<body pos="{link.at[0]!r} {link.at[1]!r} 0" euler="0 0 {link.turn!r}">{joints}
  <inertial pos="{link.cog[0]!r} {link.cog[1]!r} 0" mass="{link.mass!r}"
            diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>{children}
</body>"""


def model(tree: Tree, h: float, pull: float) -> str:
    """The machine in MuJoCo's language.

    Parameters
    ----------
    h : time step [s]
    pull : the share of an overlap that is taken away in a step, k h^2
    """

    def bodies_on(parent: str) -> str:
        sites = ''.join(
            f'<site name="{pin.name}.{k}" pos="{at[0]!r} {at[1]!r} 0"/>'
            for pin in tree.pins
            for k, (link, at) in enumerate(zip(pin.links, pin.points, strict=True))
            if link == parent
        )
        children = (link for link in tree.links.values() if link.parent == parent)
        return sites + ''.join(element(link, bodies_on(link.name)) for link in children)

    def softness(e: float) -> str:
        return f'"{-pull / h**2!r} {-(1.0 + e - pull / 2.0) / h!r}"'

    impedance = f'"{RIGIDITY!r} {RIGIDITY!r} 1 0.5 1"'
    tendons = ''.join(
        f"""
<spatial limited="true" range="0 {play.radial!r}" solreflimit={softness(play.restitution)}
         solimplimit={impedance}>
  <site site="{pin.name}.0"/><site site="{pin.name}.1"/>
</spatial>"""
        for pin, play in tree.loose.items()
    )
    closing = ''.join(
        f"""
<connect site1="{pin.name}.0" site2="{pin.name}.1" solref={softness(0.0)} solimp={impedance}/>"""
        for pin in tree.pins
        if not pin.play
    )
    x, y = tree.mechanism.gravity
    solver, iterations = ('PGS', 1) if len(tree.pins) == 1 else ('Newton', 20)
    return f"""
<mujoco>
  <compiler angle="radian" autolimits="false"/>
  <option timestep="{h!r}" gravity="{x!r} {y!r} 0" integrator="Euler" solver="{solver}"
          iterations="{iterations}" tolerance="0" jacobian="dense">
    <flag contact="disable" eulerdamp="disable" island="disable"/>
  </option>
  <worldbody>{bodies_on(GROUND)}</worldbody>
  <tendon>{tendons}</tendon>
  <equality>{closing}</equality>
</mujoco>"""


def prepare_machine(tree: Tree, duration: float, setting: float) -> Run:
    """A run in `setting` steps per revolution, or what is left of one.

    The answer are the coordinates of the tree's mechanism.

    Raises
    ------
    RunError
        For joints with friction.
    """
    if any(play.friction for play in tree.loose.values()):
        raise RunError('a tendon has no friction across it')
    import mujoco  # noqa: PLC0415 - an optional package

    steps = ceil(setting * duration / tree.machine.drive.period * (1.0 - 1e-9))
    pull = 1.0 / sqrt(setting)
    compiled = mujoco.MjModel.from_xml_string(model(tree, duration / steps, pull))
    data = mujoco.MjData(compiled)
    places = {
        name: [compiled.joint(f'{name}.{axis}').qposadr[0] for axis in link.axes]
        for name, link in tree.links.items()
    }
    pushes = [
        (places[name], [places[link][-1] for link in push.angles], push.force)
        for name, push in tree.pushes.items()
    ]

    def run() -> Callable[[], Outcome]:
        mujoco.mj_resetData(compiled, data)
        for name, link in tree.links.items():
            data.qpos[places[name]], data.qvel[places[name]] = link.start, link.rates
        at_once = 1 if pushes else steps
        for _ in range(steps // at_once):
            for place, turning, force in pushes:
                data.qfrc_applied[place] = force(data.qpos[turning])
            mujoco.mj_step(compiled, data, nstep=at_once)
        q = tree.answer({name: tuple(data.qpos[at]) for name, at in places.items()})
        return lambda: Outcome(q, steps)

    return run


PEER = Peer(
    'MuJoCo',
    (5e3, 20e3, 80e3, 320e3, 1280e3),
    'steps per revolution',
    lambda bar, setting: bar.run_as_tree(prepare_machine, setting),
    'MJCF of hinges, the crank with a flywheel as armature, the pin a tendon of limited length '
    'whose solref makes the law of Newton out of one step; semi-implicit Euler and PGS in one '
    'call of mj_step. Tried and worse at equal cost: springs that resolve the impact (Euler and '
    'RK4, 4 to 60 steps per impact), the Newton solver, other stiffnesses. Where impacts fall '
    'within a step is chance: the error of one run scatters by a factor of ten about its trend.',
    lambda: missing('mujoco'),
    any_restitution=True,
)
