"""Teeth that give way: mesh stiffness, which changes as pairs of teeth come and go.

Seen along the line of action a mesh is a spring and a damper. With the way x by which a flank is
pressed in and the phase u of the teeth,

    k(u) = k0 (1 + sum_j a_j cos(j u))

where u = 0 is the middle of the part with most pairs of teeth in contact. The force follows from
the potential k(u) x^2/2: beside k x along the line of action there is the couple -k'(u) x^2/2
between first gear and carrier, without which a turning gear would gain energy from nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import heyoka as hy

from mechanism_sim.joints.mesh.compliance import Elasticity
from mechanism_sim.joints.mesh.constraint import MeshClosure
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.protocols import Load, Wrench


class _Flank(NamedTuple):
    """One side of the teeth: what presses on it."""

    share: Term  #: 1 where it is pressed, else 0
    pressed: Term  #: x [m]
    rate: Term  #: x' [m/s]
    stiffness: Term  #: k [N/m]
    slope: Term  #: dk/d a of the first gear [N/m/rad]
    sign: float  #: of the force along the row


@dataclass(frozen=True)
class MeshSpring:
    """Elastic teeth in the place of a joint, with play or without.

    Which flank is pressed is told by switches of the engine: the equations are smooth between
    them. The damper acts while a flank is pressed, so that it pulls a little where flanks part.
    """

    closure: MeshClosure
    elasticity: Elasticity
    play: float = 0.0  #: [m] to either side

    @property
    def name(self) -> str:
        """That of the joint."""
        return self.closure.name

    def _flanks(self, frames: Frames) -> list[_Flank]:
        e, name, p = self.elasticity, self.name, frames.parameters
        (h,) = self.closure.values(frames)
        k0 = dense(p(f'{name}.stiffness', e.stiffness))
        play = p(f'{name}.play', self.play)
        if play is None and not e.variation:
            return [_Flank(hy.expression(1.0), h.value, h.rate, k0, None, 1.0)]
        found: list[_Flank] = []
        for side, sign in (('left', 1.0), ('right', -1.0)):
            own = h if sign > 0.0 else -h
            x = dense(add(own.value, neg(play)))
            if play is None and found:
                share = 1.0 - found[0].share
            else:
                share = frames.switch(f'{name}.{side}', x / self.closure.joint.per_phase)
            found.append(_Flank(share, x, own.rate, *self._stiffness(frames, k0, sign), sign))
        return found

    def _stiffness(self, frames: Frames, k0: Term, sign: float) -> tuple[Term, Term]:
        """K and its derivative by the place of the first."""
        e, p = self.elasticity, frames.parameters
        wave = self.closure.joint.waves[0]
        turned = wave * dense(self.closure.places(frames)[0].value)
        start = p(f'{self.name}.flank.{sign:g}', sign * e.lead - e.tooth)
        u = dense(add(turned, start))
        value, slope = hy.expression(1.0), hy.expression(0.0)
        for j, size in enumerate(e.variation, 1):
            a = dense(p(f'{self.name}.variation.{j}', size))
            value += a * hy.cos(j * u)
            slope -= (j * wave) * a * hy.sin(j * u)
        return k0 * value, k0 * slope

    def _row(self, frames: Frames) -> Term:
        """Force along the row, on the first [N]."""
        d = frames.parameters(f'{self.name}.damping', self.elasticity.damping)
        return add(*(
            mul(f.share, mul(hy.expression(-f.sign), add(mul(f.stiffness, f.pressed),
                                                         mul(d, f.rate))))
            for f in self._flanks(frames)
        ))  # fmt: skip

    def loads(self, frames: Frames) -> list[Load]:
        """On first and second at their centres, and the couple on the carrier.

        The force that parts the gears is left out: it does no work.
        """
        joint, row = self.closure.joint, self._row(frames)
        second = self.closure.tangential(frames, row)
        bulge = add(*(
            mul(f.share, mul(hy.expression(-0.5), mul(f.slope, mul(f.pressed, f.pressed))))
            for f in self._flanks(frames)
        ))  # fmt: skip
        couples = self.closure.couples(frames, row)
        on_first, on_second = add(couples[0], bulge), couples[1]
        back = neg(second.x), neg(second.y)
        lever = frames.parameters(f'{self.name}.first.lever', joint.per_phase * joint.waves[0])
        turn = mul(row, lever)
        found = [
            Load(f'{self.name}.first', joint.first, joint.on_first, back, add(turn, on_first)),
            Load(f'{self.name}.second', joint.second, joint.on_second, (second.x, second.y),
                 add(second.moment, on_second)),
        ]  # fmt: skip
        if joint.carrier != GROUND:
            couple = neg(add(on_first, on_second))
            found.append(Load(f'{self.name}.carrier', joint.carrier, (0.0, 0.0), moment=couple))
        return found

    def wrench(self, frames: Frames) -> Wrench:
        """Wrench of the first on the second, with the part that parts the gears."""
        return self.closure.wrench(frames, [self._row(frames)])

    def power_lost(self, frames: Frames) -> Term:
        """``d x'^2`` of the flanks that are pressed."""
        d = frames.parameters(f'{self.name}.damping', self.elasticity.damping)
        return add(*(
            mul(f.share, mul(d, mul(f.rate, f.rate))) for f in self._flanks(frames)
        ))  # fmt: skip

    def energy(self, frames: Frames) -> Term:
        """``k x^2/2`` of the flanks that are pressed."""
        return add(*(
            mul(f.share, mul(hy.expression(0.5), mul(f.stiffness, mul(f.pressed, f.pressed))))
            for f in self._flanks(frames)
        ))  # fmt: skip
