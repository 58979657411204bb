"""One machine in every form of Python, in units of workshops: runs that are equal bit by bit."""

from __future__ import annotations

from typing import Any

import numpy as np

from mechanism_sim.joints.contact_keys import Clearance
from mechanism_sim.results.run import Solution
from mechanism_sim.results.simulate import simulate
from mechanism_sim.scene import Machine, load_scene
from mechanism_sim.scene.schema import Scene
from test.grid.case import Draft, Failure, Family, Random
from test.grid.four_bars import NOT_SEATED, decades
from test.grid.machines import loose

FORMS = ('YAML', 'dict', 'numpy', 'Scene')


def _drawn(random: Random, k: int) -> Draft:
    """A package machine with loose pins, those that are compliant of materials."""
    draft = loose(random, k)
    for joint in draft.scene['joints'].values():
        contact = joint.get('clearance', {}).get('contact')
        if contact and contact.get('law') != 'film':
            del contact['stiffness']
            contact['materials'] = [{'young': f'{decades(random, 0.0, 2.0)!r} MPa'}]
            contact['radii'] = [f'{decades(random, 0.0, 1.0)!r} mm', '-1 ft']
    draft.scene['drive']['speed'] = f'{draft.scene["drive"]["speed"] * 9.5493!r} 1/min'
    return draft


def _judged(_: Random, k: int, machine: Machine, solution: Solution) -> dict[str, float]:
    """Compare the run with that of the same machine in another form, and its stiffness."""
    form, scene = FORMS[k % len(FORMS)], machine.scene
    forms: dict[str, Any] = {
        'YAML': scene.to_yaml(),
        'dict': scene.to_document(exclude_none=True),
        'numpy': _by_numpy(scene.to_document(exclude_none=True)),
        'Scene': Scene(**scene.to_document(exclude_unset=True)),
    }
    other = load_scene(forms[form])
    if other.fingerprint != machine.fingerprint:
        raise Failure('unlike', f'as {form} it is another machine')
    again = simulate(other, duration=solution.duration)
    if again.digest() != solution.digest():
        raise Failure('unlike', f'as {form} it moves otherwise')
    off = 0.0
    for play in machine.plan.clearances.values():
        contact = play.contact
        if isinstance(play, Clearance) and contact and contact.materials and contact.radii:
            a, b = contact.radii  # of one material: 1/E = 2 (1 - nu^2)/E1
            young = contact.materials[0].young / (2.0 * (1.0 - 0.3**2))
            stiffness = 4.0 / 3.0 * young / np.sqrt(1.0 / a + 1.0 / b)
            off = max(off, abs(play.stiffness / stiffness - 1.0))
    if off > 1e-12:
        raise Failure('unlike', f'the stiffness of its materials is off by {off:.2g}')
    return {'stiffness_off': float(off)}


def _by_numpy(data: Any) -> Any:
    """Keys and values whose numbers are those of NumPy, and whose pairs of them are arrays."""
    if isinstance(data, dict):
        return {key: _by_numpy(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        numbers = all(isinstance(x, float) for x in data)
        return np.array(data) if numbers and len(data) == 2 else [_by_numpy(x) for x in data]
    return np.float64(data) if isinstance(data, float) else data


FAMILIES = (Family('spellings', 60, _drawn, NOT_SEATED, judge=_judged),)
