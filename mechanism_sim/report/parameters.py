"""Words for the runtime parameters of a machine's equations, read off their names."""

from __future__ import annotations

import re
from typing import NamedTuple

from mechanism_sim.planar.equations import Equations
from mechanism_sim.planar.points import GROUND


class Description(NamedTuple):
    """A parameter for people: symbol, meaning and unit."""

    stem: str  #: of its symbol
    subjects: tuple[str, ...]  #: indices of its symbol
    meaning: str
    unit: str
    direction: bool = False  #: whether it is a component of a unit vector
    changes: bool = False  #: whether it changes during a run


def describe(name: str, equations: Equations) -> Description:
    """Words for the parameter `name`; one that is not known stands for itself."""
    for read in (_of_masses, _of_vectors):
        found = read(name, equations)
        if found:
            return found
    for pattern, stem, meaning, unit in _MEANINGS:
        if match := re.fullmatch(pattern, name):
            subjects = tuple(bare(x) for x in match.groups())
            said = meaning.format(*subjects)
            return Description(
                stem, subjects, said, unit, stem in ('ex', 'ey', 'ez'), stem in ('sigma', 'v0')
            )
    return Description('p', (bare(name),), name, '')


def bare(subject: str) -> str:
    """A name without the kind of thing it belongs to."""
    return re.sub(r'^(springs|loads)\.|^.*:', '', subject)


_MEANINGS = (
    (r'unknown:(.+)\.x', 'ex', 'x of the direction of {0}', ''),
    (r'unknown:(.+)\.y', 'ey', 'y of the direction of {0}', ''),
    (r'unknown:(.+)\.torque', 'ez', 'sense of {0}', ''),
    (r'(.+)\.slip:(.+)', 'r', 'arm of the friction in {0} on {1}', 'm'),
    (r'(.+)\.height', 'h', 'height of the wall of {0}', 'm'),
    (r'(.+)\.closed', 'sigma', '1 while {0} is closed, otherwise 0', ''),
    (
        r'(.+)\.approach',
        'v0',
        'speed at which {0} closed, or that its load gives it from rest',
        'm/s',
    ),
    (r'(.+)\.stiffness', 'k', 'stiffness of {0}', 'N/m or N m/rad'),
    (r'(.+)\.damping', 'd', 'damping of {0}', 'N s/m or N m s/rad'),
    (r'(.+)\.free_length', 'l0', 'length of {0} without force', 'm'),
    (r'(.+)\.stiffness\.(\d+)', 'k', 'stiffness against {0}, entry {1} of its row', 'N/m, N, N m'),
    (r'(.+)\.damping\.(\d+)', 'c', 'damping of {0}, entry {1} of its row', 'N s/m, N s, N m s'),
    (
        r'(.+)\.internal_damping\.(\d+)',
        'ci',
        'damping of {0} in the shaft, entry {1}',
        'N s/m, N s, N m s',
    ),
    (r'(.+)\.polar_inertia', 'Ip', 'polar moment of inertia of {0}', 'kg m^2'),
    (r'(.+)\.free_angle', 'theta0', 'angle of {0} without moment', 'rad'),
    (r'(.+)\.torque', 'Mz', 'torque of {0}', 'N m'),
    (r'(.+)\.entry', 'R', 'radius of the mouths of the slots of {0}', 'm'),
    (r'(.+)\.entry\.square', 'Rsq', 'square of the radius of the slots of {0}', 'm^2'),
    (r'(.+)\.towards', 'theta0', 'direction in which {0} is locked', 'rad'),
    (r'(.+)\.distance', 'D', 'distance of the centres of {0}', 'm'),
    (r'(.+)\.wave', 'K', 'angle by length of the slots of {0}', 'rad/m'),
    (r'(.+)\.(?:middle|offset|towards|axis)\.x', 'ex', 'x of the direction of {0}', ''),
    (r'(.+)\.(?:middle|offset|towards|axis)\.y', 'ey', 'y of the direction of {0}', ''),
    (r'(.+)\.lowest', 's0', 'place of the follower of {0} on the base circle', 'm or rad'),
    (r'(.+)\.offset', 'e', 'offset of the follower of {0}', 'm'),
    (r'(.+)\.pivot_distance', 'D', 'distance of the pivot of the follower of {0}', 'm'),
    (r'(.+)\.place', 'theta0', 'angle of the frame of {0}', 'rad'),
    (r'(.+)\.arm\.0', 'r1', 'radius of the first pulley of {0}', 'm'),
    (r'(.+)\.arm\.1', 'r2', 'radius of the second pulley of {0}', 'm'),
    (r'(.+)\.pull', 'r2', 'radius of the second pulley of {0}', 'm'),
    (r'(.+)\.stretched', 'z0', 'stretch of {0} by its pretension', 'm'),
    (r'(.+)\.apart', 'D', 'distance of the pulleys of {0}', 'm'),
    (r'(.+)\.motor\.ratio', 'i', 'turns of the motor of {0} in one of the link', ''),
    (r'(.+)\.motor\.pace', 'T0', 'reciprocal of the synchronous speed of {0}', 's/rad'),
    (r'(.+)\.motor\.slip', 'sk', 'slip of the motor of {0} at its breakdown torque', ''),
    (r'(.+)\.motor\.breakdown', 'Mk', 'breakdown torque of the motor of {0}', 'N m'),
    (r'(.+)\.arm', 'r', 'length of the follower of {0}', 'm'),
    (r'(.+)\.per_phase', 'b', 'displacement of the flanks of {0} by phase of the teeth', 'm/rad'),
    (r'(.+)\.phase', 'u0', 'phase of the teeth of {0} at the start', 'rad'),
    (r'(.+)\.play', 'c', 'play of {0} to either side', 'm'),
    (r'(.+)\.variation\.(\d+)', 'a', 'part {1} of the variation of the stiffness of {0}', ''),
    (r'(.+)\.error\.(\d+)', 'E', 'part {1} of the transmission error of {0}', 'm'),
    (r'(.+)\.(?:first\.)?lever', 'rb', 'arm of the line of action of {0}', 'm'),
    (r'(.+)\.narrow', 'w', 'reciprocal sine of a quarter of the part of the cycle of {0}', ''),
    (r'(.+)\.halfway\.x', 'hx', 'x of the direction at half the angle of {0}', ''),
    (r'(.+)\.halfway\.y', 'hy', 'y of the direction at half the angle of {0}', ''),
    (r'(.+)\.half', 'w', 'cosine of half the part of the cycle in which {0} acts', ''),
    (r'(.+)\.stop_radius', 'rs', 'radius at which {0} stops', 'm'),
    (r'(.+)\.stop_at', 's', 'limit at which {0} stops', 'rad or m'),
    (r'(.+)\.stop_half', 's', 'half of the angle between the stops of {0}', 'rad'),
    (r'(.+)\.stop_middle', 'sm', 'minus the angle in the middle between the stops of {0}', 'rad'),
    (r'(.+)\.stop_offset', 'sm', 'angle of the frames of {0} against each other', 'rad'),
    (r'(.+)\.reach', 'R', 'sum of the radii of {0}', 'm'),
    (
        r'(.+)\.across\.(\d+)',
        'rd',
        'difference of the radii at the ends of stretch {1} of {0}',
        'm',
    ),
    (r'(.+)\.radius\.(\d+)', 'r', 'radius of pulley {1} of {0}', 'm'),
    (r'(.+)\.length', 'L', 'length of {0}', 'm'),
    (r'(.+)\.bar_length', 'L', 'length of the bar of {0}', 'm'),
    (r'(.+)\.x', 'Fx', 'x of the force {0}', 'N'),
    (r'(.+)\.y', 'Fy', 'y of the force {0}', 'N'),
)
"""Pattern, stem, meaning, unit."""


def _of_masses(name: str, equations: Equations) -> Description | None:
    """Constants of mass matrix, velocity products and weight."""
    coordinates, straight = equations.coordinates, equations.mechanism.displacements
    kind, *rest = re.sub(r'(\.\d+)?(\.cross)?$', '', name).split(':')
    # on a guide that turns a displacement takes a metre off some of the constants
    plain = not any(
        slide and frame != GROUND
        for body in equations.mechanism.bodies
        for frame, slide in equations.mechanism.point(body.name, body.cog)
    )
    if kind == 'weight':
        (f,) = rest
        unit, arm = ('N', '') if f in straight else ('N m', ', times its arm')
        return Description('W', (f,), f'weight moved by {f}{arm}', unit if plain else '')
    if kind not in ('inertia', 'centripetal', 'coriolis'):
        return None
    f, g = rest[0], rest[-1]
    pair = tuple(sorted((f, g), key=coordinates.index))
    if kind == 'coriolis':
        return Description('C', pair, f'Coriolis term of {f}: masses times arms', '')
    unit = ('kg m^2', 'kg m', 'kg')[sum(c in straight for c in pair)] if plain else ''
    if f == g:
        stem = 'm' if f in straight else 'I'
        meaning = f'inertia of all that moves with {f}, reduced to it'
        return Description(stem, (f,), meaning, unit)
    # the constants of a pair come up in the mass matrix and in velocity products
    meaning = f'sum of masses times their arms on {pair[0]} and {pair[1]}'
    return Description('P', pair, meaning, unit)


def _of_vectors(name: str, equations: Equations) -> Description | None:
    """Components of the vectors of which a position is the sum, and of directions."""
    rest, _, axis = name.rpartition('.')
    label, *arm = rest.split('@')
    if not arm:
        return None
    frame, *slide = arm
    if slide:
        meaning = f'{axis} in the frame of {frame} of the direction of {slide[0]}'
        return Description(f'e{axis}', (slide[0],), meaning, '', direction=True)
    joint, _, part = label.removesuffix('.x').rpartition('.')
    joints = {joint.name for joint in equations.mechanism.joints}
    if joint in joints and part in ('normal', 'along', 'across', 'first', 'second'):
        meaning = f'{axis} in the frame of {frame} of a direction in {joint}'
        stem = {'normal': 'n', 'across': 'n', 'along': 'u'}.get(part, 'e')
        own = (joint, part) if stem == 'e' else (joint,)
        return Description(f'{stem}{axis}', own, meaning, '', direction=True)
    meaning = f'arm on {frame} towards {bare(label)}, {axis} in its frame'
    return Description('l' if axis == 'x' else 'h', (frame,), meaning, 'm')
