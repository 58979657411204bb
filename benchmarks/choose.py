"""What can be benchmarked, and what a user's words mean."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mechanism_sim.bench.hard import Case, cases
from mechanism_sim.bench.problem import Problem, problems
from mechanism_sim.errors import InputError, nearest

SCALING, LOOSE_JOINTS, MIDDLEWARE = 'scaling', 'loose_joints', 'middleware'
GRID = 'grid'


def choose(names: Sequence[str]) -> tuple[list[Problem], list[Case], set[str]]:
    """Problems, hard cases and which other measurements, by their names; ``hard``: all cases.

    Raises
    ------
    InputError
        For an unknown name, with the nearest, or for hard cases beside anything else.
    """
    hard, known = {case.name: case for case in cases()}, problems()
    tables = (SCALING, LOOSE_JOINTS, MIDDLEWARE)
    words = ('hard', GRID, *tables, *known, *hard)
    for name in names:
        if name not in words:
            raise InputError(
                f"there is no problem or case '{name}'{nearest(name, words)}; known are: "
                f'{", ".join((*known, *tables))}, grid, hard (all cases), {", ".join(hard)}'
            )
    if GRID in names and set(names) != {GRID}:
        other = next(n for n in names if n != GRID)
        raise InputError(f"the grid is run by itself: leave out '{other}'")
    chosen = list(hard.values()) if 'hard' in names else [hard[n] for n in names if n in hard]
    others = [n for n in dict.fromkeys(names) if n in known or n in tables]
    if chosen and others:
        raise InputError(f"hard cases are run by themselves: leave out '{others[0]}'")
    return [known[n] for n in others if n in known], chosen, {n for n in others if n in tables}


def methods(chosen: Sequence[Problem], text: str | None) -> set[str] | None:
    """Names of methods out of a list with commas; ``None`` for all.

    Raises
    ------
    InputError
        For a name that no chosen problem knows, with the nearest.
    """
    if text is None:
        return None
    known = list(dict.fromkeys(m.name for p in chosen for m in p.methods))
    wanted = _split_names(text, known)
    for name in wanted:
        if name not in known:
            raise InputError(
                f"there is no method '{name}'{nearest(name, known)}; known are: {'; '.join(known)}"
            )
    return set(wanted)


def _split_names(text: str, known: Sequence[str]) -> list[str]:
    """Parts of a text between commas, in which a known name may hold one itself."""
    found, parts = [], [part.strip() for part in text.split(',')]
    while parts:
        for count in range(len(parts), 0, -1):
            name = ', '.join(parts[:count])
            if name in known or count == 1:
                found.append(name)
                del parts[:count]
                break
    return found


def tolerances(text: str | None) -> list[float]:
    """Numbers out of a list with commas.

    Raises
    ------
    InputError
        If one is not a number between 0 and 1.
    """
    found = []
    for part in text.split(',') if text else ():
        try:
            value = float(part)
        except ValueError:
            value = math.nan
        if not 0.0 < value < 1.0:
            raise InputError(f"--tolerances: '{part}' is not a number between 0 and 1")
        found.append(value)
    return found


def listing() -> dict[str, list[dict[str, object]]]:
    """Problems and the methods of each, with the reason where one cannot run here."""
    return {
        'problems': [
            {
                'name': p.name,
                'title': p.title,
                'methods': [{'name': m.name, 'missing': m.missing()} for m in p.methods],
            }
            for p in problems().values()
        ]
    }
