"""Moving parts of a machine on a film or a page, and their positions at each instant.

All in SI units and as plain data: viewers draw and move it without mechanics.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.events import Mode
from mechanism_sim.export.bending import round_below
from mechanism_sim.export.palette import index
from mechanism_sim.export.shapes import COIL, Shape
from mechanism_sim.export.skeleton import Skeleton, bounds, scale_of, skeleton_of
from mechanism_sim.planar.gaps import SIDES as CORNERS
from mechanism_sim.planar.gaps import gap_name, gaps_of, wall_name
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.mechanism import HigherPair, Joint, Prismatic, Revolute
from mechanism_sim.planar.view import Side
from mechanism_sim.scene import Machine
from mechanism_sim.sensing.joint_view import JointView

SIDES: tuple[Side, Side] = 'left', 'right'

PLAY, HALF = 0.6, 0.6
"""Under a lens, in radii of the bushing or halves of the space between walls: the play to each
side, and half the length of what is between walls."""

_LONGEST = 0.35  # length of an arrow for a force that is rarely exceeded, of the machine's size
_FINE = 100.0  # resolution of points for JSON, in parts of a tenth of a symbol
_RARELY = 98.0  # [%] percentile of forces for the scale of arrows
_SURFACE = 180  # points of a worn surface


@dataclass(frozen=True, eq=False)
class StageFrames:
    """A machine at N instants.

    L moving links, B loose bearings, W other clearances, J joints, K of them higher pairs.
    """

    t: Array  #: (N,) [s]
    #: (N, L, 3 + M) origin [m] and angle [rad, less whole turns] of the links' frames, and elastic
    #: coordinates [m]
    poses: Array
    pins: Array  #: (N, B, 2) [m] centre of the pin minus that of the bushing, in world axes
    #: (N, B, 2) [m/s] rates of `pins`, for Hermite interpolation between instants
    pin_rates: Array
    modes: NDArray[np.uint8]  #: (N, B) contact mode, as in ModeChange; 0 with an oil film
    #: (N, W, 2) [m] distance from the left and the right wall of a clearance, for a block from the
    #: middle of its side; nan without a wall
    walls: Array
    #: (N, W, 2) [m] displacement of the inner part to the right of the walls' middle, and distance
    #: from the left wall of a block's rear minus that of its front
    off: Array
    #: (N, W) 1 for contact with the left wall, 2 with the right one, 3 with both
    touching: NDArray[np.uint8]
    forces: Array  #: (N, J, 2) [N] force of the first on the second link, in world axes
    #: (N, K, 2) [m] points on lines of action of forces without a fixed point of action
    feet: Array
    drive: Array  #: (N,) coordinate of the main drive [rad, m]
    #: (N, F, 3) magnified sway of the F frames on springs [m, rad], see `Skeleton.sways`
    sway: Array

    def acting(self, stage: Stage) -> Array:
        """Points at which the joint forces act, (J, 2, N) [m]."""
        places = []
        for joint in stage.joints:
            if joint in stage.moving:
                places.append(self.feet[:, stage.moving.index(joint)])
            else:
                at = np.array([joint.on_second])
                places.append(stage.skeleton.placed(joint.second, at, self.poses)[:, 0])
        return np.array(places).transpose(0, 2, 1)

    @classmethod
    def joined(cls, parts: Sequence[StageFrames]) -> StageFrames:
        """Several sets of frames, concatenated."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))

    def packed(self) -> dict[str, Any]:
        """All instants, as arrays in base64."""
        single = 'poses', 'pins', 'pin_rates', 'walls', 'off', 'forces', 'feet', 'sway'
        return {
            't': packed(self.t),
            **{name: packed(getattr(self, name).astype('<f4')) for name in single},
            'modes': packed(self.modes),
            'touching': packed(self.touching),
            'drive': packed(self.drive),
        }


@dataclass(frozen=True, eq=False)
class Stage:
    """Animated parts of a machine, and their sizes."""

    machine: Machine
    skeleton: Skeleton
    #: corners (2,) [m] of all moving parts with usual arrows, and a margin
    low: Array
    high: Array
    force_scale: float  #: length of arrows per force [m/N]; 0 without forces
    #: distance [m] of both walls, or largest gap at a single one, by joint of `plays`; for
    #: permanent contact (names in `closed`) a drawn width
    widths: dict[str, float] = field(default_factory=dict)
    closed: set[str] = field(default_factory=set)

    @property
    def links(self) -> list[str]:
        """The moving links, in the order of poses."""
        return [body.name for body in self.machine.mechanism.bodies]

    @cached_property
    def joints(self) -> list[Joint]:
        """Joints whose forces are shown: all, or none if forces are unknown or not requested."""
        machine = self.machine
        shown = machine.physics.has_forces and machine.scene.outputs.forces
        return list(machine.mechanism.joints) if shown else []

    @cached_property
    def bearings(self) -> list[Revolute]:
        """Bearings with a pin loose in a bushing."""
        return self.machine.bearings

    @cached_property
    def plays(self) -> list[HigherPair | Prismatic]:
        """Joints with drawn walls: pins in slots, blocks in guides, teeth, cams with lift-off."""
        joints = self.machine.mechanism.joints
        pairs = [j for j in joints if isinstance(j, HigherPair | Prismatic)]
        return [pair for pair in pairs if pair.equations and self._walls(pair)]

    def _walls(self, pair: HigherPair | Prismatic) -> dict[Side, list[int]]:
        """Indices of the gaps at each wall of a pair: a block has two, at its corners."""
        known, mechanism = self.machine.physics.clearances, self.machine.mechanism
        if isinstance(pair, HigherPair):
            named = [(side, wall_name(mechanism, pair, side)) for side in pair.sides]
        else:
            named = [(side, gap_name(mechanism, pair, f'{end}_{side}')) for end, side in CORNERS]
        found: dict[Side, list[int]] = {}
        for side, name in named:
            if name in known:
                found.setdefault(side, []).append(known.index(name))
        return found

    def _parted(self, o: Observation, pair: HigherPair | Prismatic) -> Array:
        """Distances (2, N) [m] from the left and the right wall of a pair; nan without a wall."""
        gaps = np.full((2, o.position.shape[1]), np.nan)
        for side, numbers in self._walls(pair).items():
            gaps[SIDES.index(side)] = o.gap[numbers].mean(axis=0)
        return gaps

    def _off(self, o: Observation, pair: HigherPair | Prismatic) -> Array:
        """Displacement from the walls' middle, and tilt of a block (2, N) [m]: `StageFrames.off`.

        For a single wall, the middle is that of the wall and the largest gap.
        """
        left, right = self._parted(o, pair)
        two = len(self._walls(pair)) > 1
        middle = 0.5 * (left - right) if two else 0.5 * self.widths.get(pair.name, 0.0) - right
        tilt = np.zeros_like(middle)
        for side, corners in self._walls(pair).items():
            if isinstance(pair, Prismatic):  # either wall has the same tilt
                rear, front = o.gap[corners]
                tilt = rear - front if side == 'left' else front - rear
        return np.array([middle, tilt])

    def struck(self, gap: str) -> tuple[int, int]:
        """Indices of the bearing and the joint of a gap; -1 if there is none."""
        joint = self._joints_of_gaps.get(gap, '')
        bearings, joints = ([j.name for j in known] for known in (self.bearings, self.joints))
        return _index(bearings, joint), _index(joints, joint)

    @cached_property
    def _joints_of_gaps(self) -> dict[str, str]:
        gaps = self.machine.equations.system.gaps if self.machine.level.dynamic else []
        return {gap.name: gap.joint for gap in gaps}

    @cached_property
    def moving(self) -> list[Joint]:
        """Shown joints whose forces have no fixed point of action."""
        return [joint for joint in self.joints if isinstance(joint, HigherPair)]

    def to_json(self) -> dict[str, Any]:
        """All constant data."""
        width = float(self.high[0] - self.low[0])
        return {
            'scene': self.machine.name,
            'title': self.machine.scene.title,
            'bounds': [*self.low.tolist(), *self.high.tolist()],
            'symbol': self.skeleton.symbol,
            'links': self.links,
            'shapes': [written(shape) for shape in self.skeleton.shapes],
            'springs': [[[link, list(at)] for link, at in x] for x in self.skeleton.springs],
            'ropes': [
                [[link, list(at), radius] for (link, at), radius in zip(*string, strict=True)]
                for string in self.skeleton.strings
            ],
            'coil': COIL.tolist(),
            'scale': dict(zip(('length', 'text'), scale_of(self.skeleton, width), strict=True)),
            'bendings': {link: x.to_json() for link, x in self.skeleton.bendings.items()},
            'joints': joints_json(self.joints),
            'force_scale': self.force_scale,
            'lens': {'play': PLAY, 'half': HALF},
            'force': round_below(0.12 * width / self.force_scale) if self.force_scale else 0.0,
            'bearings': [self._bearing(joint) for joint in self.bearings],
            'plays': [self._play(pair) for pair in self.plays],
            'frames': [
                {'name': name, 'cog': list(cog), 'springs': list(springs)}
                for name, (cog, springs) in self.skeleton.mounts.items()
            ],
            'main': self.machine.plan.main,
            'slides': self.machine.plan.main in self.machine.physics.displacements,
        }

    def frames(
        self, t: Array, o: Observation, modes: NDArray[np.uint8], sway: Array | None = None
    ) -> StageFrames:
        """The machine at times t (N,) [s].

        Parameters
        ----------
        o : observation of the machine at these times
        modes : (m, N) modes of its gaps
        sway : (N, F, 3) sway of its frames on springs, see `Swaying`; at rest without it
        """
        physics, bearings = self.machine.physics, self.bearings
        views = {
            joint.name: JointView(self.machine.mechanism, joint, physics, o, modes)
            for joint in (*self.joints, *bearings)
        }
        pins = [
            view.path(j.first, j.on_first) - view.path(j.second, j.on_second)
            for j in bearings
            for view in [views[j.name]]
        ]
        poses = self.skeleton.poses(o.local)
        poses[:, :, 2] = np.mod(poses[:, :, 2] + np.pi, 2.0 * np.pi) - np.pi
        known, count = dict(zip(physics.clearances, modes, strict=True)), len(t)
        touching = np.zeros((count, len(bearings)), np.uint8)
        for k, joint in enumerate(bearings):
            for gap in gaps_of(self.machine.mechanism, joint.name, known):  # none for an oil film
                touching[:, k] = np.maximum(touching[:, k], known[gap])
        walls = np.zeros((count, len(self.plays)), np.uint8)
        for w, pair in enumerate(self.plays):
            for side, numbers in self._walls(pair).items():
                shut = (modes[numbers] > Mode.FREE_FLIGHT).any(axis=0)
                walls[:, w] += np.uint8(1 + SIDES.index(side)) * shut.astype(np.uint8)
        return StageFrames(
            t,
            poses,
            _by_instant([path[0] for path in pins], count),
            _by_instant([path[1] for path in pins], count),
            touching,
            _by_instant([self._parted(o, pair) for pair in self.plays], count),
            _by_instant([self._off(o, x) for x in self.plays], count),
            walls,
            _by_instant([views[j.name].force for j in self.joints], count),
            _by_instant([views[j.name].foot for j in self.moving], count),
            o.position[physics.coordinates.index(self.machine.plan.main)],
            self.drawn(np.zeros((count, len(self.skeleton.mounts), 3)) if sway is None else sway),
        )

    def drawn(self, sway: Array) -> Array:
        """Sway (N, F, 3) [m, rad] of frames on springs, magnified as drawn."""
        sways = self.skeleton.sways
        times = [sways.get(name, 0.0) for name in self.skeleton.mounts]
        return np.asarray(sway * np.array(times)[:, None])

    def tips(self, o: Observation, scale: float, longest: float) -> Array:
        """Tips (J - K, 2, N) [m] of the arrows at fixed points, limited in length.

        Parameters
        ----------
        o : observation of the machine at N instants
        scale : length of arrows per force [m/N]
        longest : largest length of arrows [m]
        """
        physics, none = self.machine.physics, np.zeros((0, o.position.shape[1]), np.uint8)
        found = []
        for joint in self.joints:
            if joint not in self.moving:
                view = JointView(self.machine.mechanism, joint, physics, o, none)
                along = scale * view.force
                along *= longest / np.maximum(np.hypot(*along), longest)
                found.append(view.place(joint.second, joint.on_second) + along)
        return np.array(found)

    def _bearing(self, joint: Joint) -> dict[str, Any]:
        play = self.machine.plan.clearances[joint.name]
        profile = getattr(play, 'profile', None)
        worn = [np.round(x, 9).tolist() for x in profile.depths(_SURFACE)] if profile else None
        return {
            'joint': joint.name,
            'first': joint.first,
            'second': joint.second,
            'on_first': list(joint.on_first),
            'on_second': list(joint.on_second),
            'radial': play.radial,
            **({'worn': worn} if worn else {}),
            'restitution': play.restitution,
            'friction': play.friction,
            'contact': play.contact.law if play.contact else 'rigid',
            'words': self.words(joint),
        }

    def _play(self, pair: HigherPair | Prismatic) -> dict[str, Any]:
        """Clearance of a pair: the link with the walls, and the inner one: follower or block."""
        ends = [pair.second, pair.first]
        within = isinstance(pair, Prismatic) or hasattr(pair, 'cam')
        face, body = reversed(ends) if within else ends
        numbers = {name: k for k, name in enumerate(self.links)}
        return {
            'joint': pair.name,
            'link': pair.second,
            'at': list(pair.on_second),
            'walls': len(self._walls(pair)),
            'width': self.widths[pair.name],
            'parts': pair.name not in self.closed,
            'face': index(numbers.get(face, -1)),
            'body': index(numbers.get(body, -1)),
            'tilts': isinstance(pair, Prismatic),
            'words': self.words(pair),
        }

    def words(self, joint: Joint) -> list[str]:
        """States of a clearance in words, by mode of a bearing, else by the walls in contact."""
        if joint in self.bearings:
            play = self.machine.plan.clearances[joint.name]
            film = play.contact is not None and play.contact.law == 'film'
            rest = [Mode(k).name.replace('_', ' ').lower() for k in sorted(Mode) if k]
            return ['on its oil film' if film else '', *rest]
        if len(self._walls(joint)) > 1:  # type: ignore[arg-type]
            return ['between the walls', 'on the left', 'on the right', 'on both sides']
        return ['lifted off', *['in contact'] * 3]


class Swaying:
    """Frames on springs of a machine, integrated along its motion piece by piece."""

    def __init__(self, machine: Machine) -> None:
        self._frames = [machine.oscillator(name) for name in machine.scene.oscillators]

    def take(self, motion: Motion) -> Callable[[Array], Array]:
        """Advance over a piece of motion that continues that of the last call.

        Returns
        -------
        function of times (N,) [s] of the piece: displacements (N, F, 3) [m, rad] of the F frames
        from their rest positions without the machine
        """
        moved = [frame.take(motion) for frame in self._frames]

        def sway(t: Array) -> Array:
            found = np.zeros((len(t), len(moved), 3))
            for k, move in enumerate(moved):
                place = move(t).position
                found[:, k, : len(place)] = place.T
            return found

        return sway


def joints_json(joints: Sequence[Joint]) -> list[dict[str, Any]]:
    """Points of action of joint forces: on the second link, or index of a moving foot."""
    moving, found = [joint for joint in joints if isinstance(joint, HigherPair)], []
    for joint in joints:
        foot = {'foot': moving.index(joint)} if joint in moving else {}
        named = {'name': joint.name, 'first': joint.first, 'link': joint.second}
        found.append({**named, 'at': list(joint.on_second), **foot})
    return found


def stage_of(machine: Machine, observed: Observation, sway: Array | None = None) -> Stage:
    """The stage of a machine over all of its observed motion.

    Parameters
    ----------
    sway : (N, F, 3) sway of its frames on springs, see `Swaying`; drawn at rest without it
    """
    skeleton = skeleton_of(machine, observed.local)
    if sway is not None:
        skeleton.magnify(sway)
    low, high = bounds(skeleton, skeleton.poses(observed.local))
    if skeleton.mounts:  # the bars of the scale stand below the feet of the springs
        low = low - np.array([0.0, 4.0 * skeleton.symbol])
    stage = Stage(machine, skeleton, low, high, 0.0)
    for pair in stage.plays:  # distance of two walls, else largest gap
        width = float(np.nansum(stage._parted(observed, pair), axis=0).max())
        least = 1e-9 * skeleton.size  # permanent contact: rounding errors only
        stage.widths[pair.name] = width if width > least else 1e-3 * skeleton.symbol
        stage.closed.update([pair.name] if width <= least else [])
    if not stage.joints:
        return stage
    sizes = np.hypot(*observed.reaction.swapaxes(0, 1)).max(axis=0)
    known = np.isfinite(sizes)  # forces may have no limit at a singular position
    usual = float(np.percentile(sizes[known], _RARELY)) if known.any() else 0.0
    if not usual:
        return stage
    longest = _LONGEST * skeleton.size
    tips = stage.tips(observed, longest / usual, longest)
    tips = tips[:, :, known]
    low, high = np.minimum(low, tips.min(axis=(0, 2))), np.maximum(high, tips.max(axis=(0, 2)))
    return replace(stage, low=low, high=high, force_scale=longest / usual)


def packed(rows: NDArray[Any]) -> dict[str, str]:
    """An array in plotly's format: type, bytes in base64, and shape if it has several axes."""
    little = rows.astype(rows.dtype.newbyteorder('<'))
    kind = f'{rows.dtype.kind}{rows.dtype.itemsize}'
    data = base64.b64encode(np.ascontiguousarray(little).tobytes()).decode('ascii')
    shape = {'shape': ', '.join(map(str, rows.shape))} if rows.ndim > 1 else {}
    return {'dtype': kind, 'bdata': data, **shape}


def written(shape: Shape) -> dict[str, Any]:
    """A shape for JSON: curves as x, y, x, y ... in tenths of a symbol, outlines in metres."""
    fine = 10.0 * _FINE / shape.symbol
    return {
        'kind': shape.kind,
        'link': shape.link,
        'label': shape.label,
        'colour': index(shape.number),
        'outline': shape.outline.tolist(),
        'paths': [
            [path.style, [(np.round(fine * c) / _FINE).ravel().tolist() for c in path.curves]]
            for path in shape.paths
        ],
    }


def _index(names: list[str], name: str) -> int:
    return names.index(name) if name in names else -1


def _by_instant(rows: list[Array], count: int) -> Array:
    """Vectors (K, 2, N) as (N, K, 2)."""
    return np.array(rows).reshape(len(rows), 2, count).transpose(2, 0, 1)
