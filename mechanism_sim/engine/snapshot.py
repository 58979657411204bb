"""The state between two steps: where a run starts, and what it needs to go on bit by bit."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from mechanism_sim import output, strict_json
from mechanism_sim.errors import InputError
from mechanism_sim.output import path_of
from mechanism_sim.planar.drive import DriveLaw, Law, TorqueLaw


@dataclass(frozen=True)
class State:
    """Initial state of a run, which determines the motion together with the laws."""

    time: Fraction  #: [s], exact
    turns: tuple[int, ...]  #: whole turns of the free coordinates, 0 for displacements
    q: tuple[float, ...]  #: free coordinates [rad, m]
    v: tuple[float, ...]  #: rates of the free coordinates [rad/s, m/s]
    closed: tuple[bool, ...]  #: whether a gap is closed, by gap
    states: tuple[float, ...] = ()  #: states of first order, over their scales


_TIMES = 'tau', 'stabilisation', 'horizon', 'next_base', 'last_event', 'stride'


@dataclass(frozen=True)
class Snapshot:
    """State of a paused run, from which one of the same machine continues bit-identically.

    The time of a snapshot is the end of the last step that is complete, at or before the time up
    to which the run was asked to go: steps are not cut to pause.
    """

    machine: str  #: fingerprint of the mechanical model
    base: Fraction  #: [s] time from which the integrator counts
    tau: float  #: [s] time since the base
    turns: dict[str, int]
    state: tuple[float, ...]  #: free coordinates, their rates, states of first order
    directions: tuple[float, ...]  #: integrated cosines and sines of the steady drives' angles
    since: int  #: number of steps since these were computed from the angles
    modes: tuple[int, ...]
    approach: tuple[float, ...]  #: speeds of initial contact of compliant contacts [m/s]
    switches: tuple[int, ...]  #: present rows of the switches
    touches: tuple[tuple[float, ...], ...]  #: fields of the `OngoingTouch` of each contact
    stabilisation: float  #: rate of Baumgarte's method [1/s]
    horizon: float  #: [s] longest next step
    next_base: float  #: local time after which a new base is due [s]
    laws: tuple[Law, ...]
    coming: tuple[Law, ...]
    last_event: float  #: time of the last event [s]
    events: tuple[int, int]  #: number of events at that time, and in all
    stride: float = 0.0  #: [s] length of regular steps
    rubbing: tuple[float, ...] = ()  #: signs and directions of friction, `Switching.rubbing`

    @property
    def time(self) -> float:
        """Time [s] from which the run goes on."""
        return float(self.base + Fraction(self.tau))

    def save(self, path: str | Path) -> None:
        """Write a JSON file; floats are hexadecimal, so that no digit is lost.

        Raises
        ------
        InputError, RunError
            If it cannot be written there.
        """
        data = asdict(self) | {
            'base': str(self.base),
            'laws': [_law_to_json(law) for law in self.laws],
            'coming': [_law_to_json(law) for law in self.coming],
        }
        data['simultaneous'], data['events'] = self.events
        for key in _TIMES:
            data[key] = float(data[key]).hex()
        for key in ('state', 'directions', 'approach'):
            data[key] = [float(x).hex() for x in data[key]]
        data['touches'] = [[float(x).hex() for x in touch] for touch in self.touches]
        data['checksum'] = _checksum(data)
        output.write_text(path_of(path), strict_json.dumps(data, indent=1))

    @classmethod
    def load(cls, path: str | Path) -> Snapshot:
        """Read what `save` has written."""
        try:
            data = strict_json.loads(path_of(path).read_text(encoding='utf-8'))
            if data.pop('checksum') != _checksum(data):
                raise ValueError('it was damaged or changed after it was written')
            for key in _TIMES:
                data[key] = float.fromhex(data[key])
            data['base'] = Fraction(data['base'])
            data['events'] = data.pop('simultaneous'), data['events']
            for key in ('state', 'directions', 'approach'):
                data[key] = tuple(float.fromhex(x) for x in data[key])
            data['modes'] = tuple(data['modes'])
            data['touches'] = tuple(tuple(map(float.fromhex, x)) for x in data['touches'])
            data['switches'] = tuple(data['switches'])
            data['rubbing'] = tuple(data['rubbing'])
            data['laws'] = tuple(_law_from_json(law) for law in data['laws'])
            data['coming'] = tuple(_law_from_json(law) for law in data['coming'])
            return cls(**data)
        except OSError as error:
            raise InputError(f"the snapshot '{path}' cannot be read: {error.strerror}") from error
        except ValueError as error:
            raise InputError(f"'{path}' is not a snapshot of a run: {error}") from error
        except (KeyError, TypeError, AttributeError, ArithmeticError) as error:
            raise InputError(f"'{path}' is no snapshot, as --save writes it") from error


def _checksum(data: dict[str, Any]) -> str:
    """Checksum over all digits, since the engine uses a snapshot unchecked."""
    return hashlib.sha256(strict_json.dumps(data).encode()).hexdigest()


def _law_to_json(law: Law) -> dict[str, Any]:
    data = asdict(law) | {'kind': type(law).__name__}
    data['coefficients'] = [float(c).hex() for c in law.coefficients]
    return data


def _law_from_json(data: dict[str, Any]) -> Law:
    kinds: dict[str, Any] = {'DriveLaw': DriveLaw, 'TorqueLaw': TorqueLaw}
    kind = kinds[data.pop('kind')]
    data['coefficients'] = tuple(float.fromhex(c) for c in data['coefficients'])
    law: Law = kind(**data)
    return law
