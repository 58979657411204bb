"""The whole grid, and parts of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml

from mechanism_sim import output
from mechanism_sim.errors import InputError, nearest
from test.grid import (
    cams,
    coordinates,
    elastic,
    four_bars,
    linkages,
    loads,
    machines,
    position_laws,
    ropes,
    rotors,
    rubbing,
    spellings,
    states,
    stops,
    tilted,
    trains,
)
from test.grid.case import Family, GridCase

SEED = 19

FAMILIES: tuple[Family, ...] = tuple(
    family
    for module in (
        four_bars,
        machines,
        linkages,
        cams,
        trains,
        elastic,
        rotors,
        tilted,
        rubbing,
        loads,
        position_laws,
        states,
        stops,
        ropes,
        spellings,
        coordinates,
    )
    for family in module.FAMILIES
)


def grid(seed: int = SEED, only: Sequence[str] = (), sample: int | None = None) -> list[GridCase]:
    """Cases of the grid: all, those of some families or names, and of these a sample.

    Raises
    ------
    InputError
        For a name that is neither a family nor a case.
    """
    # one structure after the other
    numbers = {f: sorted(range(f.count), key=lambda k: k % f.structures) for f in FAMILIES}
    cases = [GridCase(f, k, seed) for f in FAMILIES for k in numbers[f]]
    names = {f.name for f in FAMILIES} | {case.name for case in cases}
    for name in only:
        if name not in names:
            raise InputError(
                f"the grid has no family or case '{name}'{nearest(name, names)}; families: "
                f'{", ".join(f.name for f in FAMILIES)}'
            )
    if only:
        cases = [case for case in cases if case.name in only or case.family.name in only]
    if sample is not None and sample < len(cases):
        chosen = np.random.default_rng(seed).permutation(len(cases))[:sample]
        cases = [cases[i] for i in sorted(chosen.tolist())]
    return cases


def write_scenes(cases: Sequence[GridCase], folder: Path) -> None:
    """Write the scene of every case as ``NAME.yaml``, with its length in the first line.

    Raises
    ------
    InputError
        If it cannot be written there.
    """
    with output.errors_as_sentences(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for case in cases:
            scene, revolutions, duration = case.draft()
            length = f'--duration {duration!r}' if duration else f'--revolutions {revolutions!r}'
            asked = length if duration or revolutions else ''
            head = f'# mechanism-sim solve {case.name}.yaml {asked}\n'
            text = yaml.safe_dump(scene, sort_keys=False, default_flow_style=None)
            (folder / f'{case.name}.yaml').write_text(head + text, encoding='utf-8')
