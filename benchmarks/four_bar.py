"""The four-bar of the thesis with one loose bearing, as plain numbers that any simulator takes."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from benchmarks.problem import (
    Answer,
    Method,
    Outcome,
    Run,
    find_instances,
    nothing_missing,
)
from benchmarks.tree import Tree
from mechanism_sim.scene import load_scene


@dataclass(frozen=True)
class LooseFourBar:
    """The thesis mechanism, SI units: everything that a peer needs, nothing of this package.

    The crank turns about (0, 0), the rocker about (`ground`, 0). Angles of the links run from +x
    and from the proximal joint: the coupler's lies at the end of the crank. Centres of gravity lie
    on the links at `*_cog` from the proximal joint, inertias are about them. Gravity points along
    -y. The end of the coupler (a point pin) stays within `clearance` of the end of the rocker,
    without friction; impacts obey Newton's law with `restitution`. The crank turns at constant
    speed from `crank_angle`. A run starts in free flight, or `seated`: in contact.
    """

    ground: float
    crank: float
    coupler: float
    rocker: float
    crank_mass: float
    crank_inertia: float
    crank_cog: float
    coupler_mass: float
    coupler_inertia: float
    coupler_cog: float
    rocker_mass: float
    rocker_inertia: float
    rocker_cog: float
    gravity: float
    clearance: float
    restitution: float
    crank_angle: float
    crank_speed: float
    coupler_angle: float
    rocker_angle: float
    coupler_rate: float
    rocker_rate: float
    seated: bool
    duration: float  #: [s] of the run, `revolutions` of the crank
    revolutions: float
    final: tuple[float, float]  #: angles of coupler and rocker at its end, from the reference

    @classmethod
    def thesis(
        cls, start: str = 'centred', e: float = 0.5, revolutions: float | None = None
    ) -> LooseFourBar:
        """Table 6.1 of the thesis, at the initial state that the scene builder computes.

        Parameters
        ----------
        start : 'centred' or 'seated'
        e : restitution for which there is a reference: 0.1, 0.5, 1 (seated: 0.5)
        revolutions : a multiple of 1/64; the whole of the reference if not given
        """
        scene = load_scene('four_bar_clearance', scene_overrides(start, e))
        lengths, clearance = scene.nominal.linkage, scene.plan.clearances['coupler_rocker']
        state = scene.initial_state()
        run = reference(f'four_bar_{start}_e{f"{e:g}".replace(".", "")}')
        whole = float(run['revolutions'])
        revolutions = whole if revolutions is None else revolutions
        at = round(64 * revolutions)
        states = run['states']
        masses = {
            f'{name}_{key}': getattr(scene.scene.links[name], key)
            for name in scene.plan.links
            for key in ('mass', 'inertia', 'cog')
        }
        return cls(
            ground=lengths.ground,
            crank=lengths.crank,
            coupler=lengths.coupler,
            rocker=lengths.rocker,
            **masses,
            gravity=-scene.scene.gravity[1],
            clearance=clearance.radial,
            restitution=clearance.restitution,
            crank_angle=scene.drive.start[0],
            crank_speed=scene.drive.start[1],
            coupler_angle=state.q[0],
            rocker_angle=state.q[1],
            coupler_rate=state.v[0],
            rocker_rate=state.v[1],
            seated=start == 'seated',
            duration=float(states['t'][at]),
            revolutions=revolutions,
            final=(float(states['th3'][at]), float(states['th4'][at])),
        )

    @property
    def inertias(self) -> tuple[float, float]:
        """Inertias of the coupler about the crank pin, of the rocker about its pivot [kg m^2]."""
        return (
            self.coupler_inertia + self.coupler_mass * self.coupler_cog**2,
            self.rocker_inertia + self.rocker_mass * self.rocker_cog**2,
        )

    @property
    def moments(self) -> tuple[float, float]:
        """Masses of coupler and rocker times the distances of their centres of gravity [kg m]."""
        return self.coupler_mass * self.coupler_cog, self.rocker_mass * self.rocker_cog

    def run_as_tree(self, prepare: Callable[[Tree, float, float], Run], setting: float) -> Run:
        """A run by what takes any machine; its answer are the final angles."""
        start = 'seated' if self.seated else 'centred'
        machine = load_scene('four_bar_clearance', scene_overrides(start, self.restitution))
        run = prepare(Tree(machine), self.duration, setting)

        def angles() -> Callable[[], Outcome]:
            tell = run()

            def outcome() -> Outcome:
                found = tell()
                return found._replace(answer=found.answer[1:])  # without that of the crank

            return outcome

        return angles

    def error(self, answer: Answer) -> float:
        """Largest error of the final angles of coupler and rocker (2,) [rad]."""
        return float(np.abs(answer - self.final).max())


def scene_overrides(start: str, e: float) -> dict[str, Any]:
    """Overrides of the thesis scene for a start and a restitution."""
    return {'start': start, 'joints.coupler_rocker.clearance.restitution': e}


def reference(name: str) -> dict[str, Any]:
    """A file of `benchmarks/references`; numbers are decimal strings."""
    text = files('benchmarks').joinpath('references', f'{name}.json').read_text('utf-8')
    content: dict[str, Any] = json.loads(text)
    return content


@dataclass(frozen=True)
class Peer:
    """A way to compute the loose four-bar; see `Method` for the names.

    `prepare` takes the mechanism and a setting; the answer are the angles of coupler and rocker
    (2,) [rad] at the end. `any_restitution`: whether it takes every start and restitution, or is
    tuned to the centred start with e = 0.5.
    """

    name: str
    settings: tuple[float, ...]
    setting: str
    prepare: Callable[[LooseFourBar, float], Run]
    how: str
    missing: Callable[[], str | None] = nothing_missing
    any_restitution: bool = False

    def method(self, four_bar: LooseFourBar) -> Method:
        """The peer at work on a mechanism."""
        return Method(
            self.name,
            self.settings,
            self.setting,
            lambda setting: self.prepare(four_bar, setting),
            self.how,
            self.missing,
        )


@cache
def peers() -> tuple[Peer, ...]:
    """All peers of the modules in `benchmarks.peers`, in the order of their files."""
    return tuple(find_instances('benchmarks.peers', Peer))
