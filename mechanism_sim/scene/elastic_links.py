"""Elastic links: from their keys to beams and carried masses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

import numpy as np

from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import Names
from mechanism_sim.planar.beam_sections import Taper
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.elastic import Beam, Damping
from mechanism_sim.planar.mechanism import (
    HigherPair,
    Joint,
    Mechanism,
    bending_guides,
)
from mechanism_sim.planar.points import Vector2
from mechanism_sim.scene.drives import is_straight
from mechanism_sim.scene.schema import DrivePart, LinkPart
from mechanism_sim.tolerances import TOLERANCES

_MECHANISM = TOLERANCES.mechanism

_QUASI_STATIC, _RIGID = 20.0, 200.0
"""Ratios of the first mode to the drive from which on vibration, and then bending, is small."""


def read_beams(
    names: Names, joints: Iterable[Joint], driven: Mapping[str, DrivePart]
) -> dict[str, Body]:
    """The elastic links as bodies with their own mass, by name."""
    found = {
        link: _body(f'links.{link}', link, given)
        for link in names.links
        if (given := names.scene.links[link]).elastic
    }
    for joint in joints:
        for link in dict.fromkeys((joint.first, joint.second, getattr(joint, 'carrier', ''))):
            if link in found:
                _check(names, joint, found[link], driven)
    for link in driven:
        body = found.get(link)
        if body and isinstance(body.extension, Beam) and body.extension.ends != 'clamped':
            raise InputError(
                f'links.{link}.elastic.ends must be clamped: a drive holds the direction of its '
                'link where that starts'
            )
    return found


def _check(names: Names, joint: Joint, body: Body, driven: Mapping[str, DrivePart]) -> None:
    """Refuse joints that ask more of an elastic link than where its cross-sections are."""
    where, link = f'joints.{joint.name}', body.name
    if isinstance(joint, HigherPair) and not joint.bears(link):
        kind = names.scene.joints[joint.name].kind
        raise InputError(
            f'{where}: this {kind} needs the whole of {link}, which is elastic: make it rigid, or '
            'put a rigid link between'
        )
    line, friction = joint.line, names.scene.joints[joint.name].friction
    along = line and line.link == link and abs(math.sin(line.axis)) <= _MECHANISM.parallel
    if along and friction and friction.coefficient:
        raise InputError(
            f'{where}.friction: along the elastic link {link} only what has play rubs: give the '
            "friction in a 'clearance'"
        )
    slides = joint.second if bending_guides([body], [joint]) else ''
    if slides in driven and is_straight(driven[slides]):
        raise InputError(
            f'{where}: a drive cannot push {slides} along a guide of the elastic link {link}: put '
            'a rigid link between'
        )


def stiffened(link: LinkPart) -> LinkPart:
    """A link made rigid and kept in its plane."""
    link = link.model_copy(update={'tilt': None})
    if not link.elastic:
        return link
    body = _body('', '', link)
    known = {'mass': body.mass, 'inertia': body.inertia, 'cog': body.cog, 'elastic': None}
    return link.model_copy(update=known)


def _body(where: str, link: str, given: LinkPart) -> Body:
    elastic = given.elastic
    assert elastic  # noqa: S101 - only those are read
    if given.length is None:
        raise InputError(f"{where}: 'length' is missing: an elastic link is a beam of that length")
    modulus, density = elastic.matter
    taper, area, moment, fibre = elastic.geometry(given.length)
    ends = (0.0, 0.0)
    if given.mass is not None:
        line, ends = _spread(where, given, given.mass, given.length, taper)
    elif given.inertia is not None:
        raise InputError(f"{where}.inertia: 'mass' is missing: give both, or neither")
    elif density is None:
        raise InputError(f"{where}.elastic: needs 'material' or 'density', or the link a mass")
    else:
        line = density * area
    beam = Beam(
        given.length,
        modulus * moment,
        modulus * area,
        line,
        modulus,
        elastic.modes,
        elastic.stretch,
        elastic.ends,
        elastic.functions,
        Damping(elastic.damping, elastic.rayleigh.mass, elastic.rayleigh.stiffness),
        elastic.foreshortening,
        tuple((m, (x, 0.0)) for m, x in zip(ends, (0.0, given.length), strict=True) if m),
        fibre=fibre,
        taper=taper,
    )
    return loaded(Body(link, 0.0, 0.0, (0.0, 0.0), beam), (), 0.0)


def loaded(body: Body, lumps: Iterable[tuple[float, Vector2]], spin: float) -> Body:
    """An elastic link that carries more: masses at points, and what turns with its frame."""
    old = body.extension
    assert isinstance(old, Beam)  # noqa: S101 - it is elastic
    beam = replace(old, lumps=(*old.lumps, *lumps), spin=old.spin + spin)
    weights = np.array([m for m, _ in beam.particles])
    places = np.array([at for _, at in beam.particles])
    mass = float(weights.sum())
    x, y = (weights @ places / mass).tolist()
    about = float((weights * ((places - (x, y)) ** 2).sum(axis=1)).sum())
    return Body(body.name, mass, about + beam.spin, (x, y), beam)


def _spread(
    where: str, given: LinkPart, m: float, L: float, taper: Taper | None
) -> tuple[float, tuple[float, float]]:
    """Mean mass of the beam per length [kg/m], and the masses at its start and its end [kg].

    A mass alone lies along the beam as its area does. With a centre of gravity and a moment of
    inertia, part
    of it sits at both ends, so that the undeformed link has what is given.
    """
    if given.inertia is None:
        if given.cog not in (0.0, (0.0, 0.0)):
            raise InputError(
                f"{where}.cog: 'inertia' is missing: without it the mass lies evenly along the "
                'elastic link'
            )
        return m / L, (0.0, 0.0)
    c, off = given.cog if isinstance(given.cog, tuple) else (given.cog, 0.0)
    second = given.inertia + m * c**2
    # m = r L + a + b, m c = r S + b L, second = r T + b L^2, where S, T = L^2/2, L^3/3 if even
    if taper:
        _, S, T = taper.moments()
        line = (m * c * L - second) / (S * L - T)
        end = m * c / L - line * S / L
    else:
        line = 6.0 * (m * c * L - second) / L**3
        end = m * c / L - 0.5 * line * L
    start = m - end - line * L
    rounding = 1e-9 * m
    if off or line <= 0.0 or min(start, end) < -rounding:
        raise InputError(
            f'{where}: mass, cog and inertia fit no beam with masses at its ends: leave inertia '
            'and cog out to spread the mass evenly'
        )
    return line, (start if start > rounding else 0.0, end if end > rounding else 0.0)


def elastic_notes(
    mechanism: Mechanism, period: float, impacts: bool, held: Callable[[], Mapping[str, float]]
) -> list[str]:
    """Frequencies of the modes of each elastic link by itself, and a sufficient treatment.

    Accelerations of a machine that turns at W are about ``W^2`` times its size, and bend a link of
    the first angular frequency w by about ``(W/w)^2`` of that; loads and weight bend it besides.

    Parameters
    ----------
    held : gives deformations [m] by coordinate that forces at the start hold, see `Start`
    """
    notes = []
    turns = 1.0 / period
    for link, beam in mechanism.having(Beam).items():
        modes = {name: w / (2.0 * math.pi) for name, w in beam.frequencies.items()}
        listed = ', '.join(f'{name} {f:.6g} Hz' for name, f in modes.items())
        ends = f'{beam.ends} ends' if beam.ends == 'pinned' else 'clamped where it starts'
        note = f'elastic {link}, {ends}: {listed}'
        if turns:
            ratio = modes['bend1'] / turns
            note += f'; the drive turns at {turns:.6g} Hz, bend1 is {ratio:.3g} times as fast: '
            bent = ratio**-2
            if ratio >= _RIGID and not impacts:
                bent = max(bent, abs(held()[f'{link}.bend1']) / beam.length)
            note += _treatment(ratio, bent, impacts)
        notes.append(note)
    return notes


def _treatment(ratio: float, bent: float, impacts: bool) -> str:
    """Advice for a link by the ratio of its first natural frequency to the drive's.

    Parameters
    ----------
    bent : of its size, by its own inertia or by the forces at the start
    """
    if impacts:
        return 'impacts are faster than any mode: take modes until their impulses converge'
    if ratio < _QUASI_STATIC:
        return 'it vibrates, and needs its modes'
    if ratio < _RIGID:
        return 'it bends nearly as if at rest (quasi-static), and one mode is sufficient'
    by = f'inertia, and forces as at the start, bend it by about {bent:.1g} of its size'
    if bent <= _RIGID**-2:
        return f'{by}, and a rigid link is sufficient'
    return f'{by}, nearly as if at rest (quasi-static), and one mode is sufficient'
