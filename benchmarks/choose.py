"""Choice of benchmarks, methods and tolerances by a user's words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from benchmarks.problem import Problem, problems
from mechanism_sim.errors import InputError, nearest

SCALING, LOOSE_JOINTS, MIDDLEWARE = 'scaling', 'loose_joints', 'middleware'
TABLES = SCALING, LOOSE_JOINTS, MIDDLEWARE
ALL = 'all'
_TESTS = 'hard', 'grid'


def choose(names: Sequence[str]) -> tuple[list[Problem], set[str]]:
    """Problems, and which other measurements, by their names; ``all``: everything."""
    known = problems()
    words = (*known, *TABLES)
    for name in names:
        if name in _TESTS:
            raise InputError(f"'{name}' is not a benchmark but a test: 'python -m test.{name}'")
        if name not in (*words, ALL):
            raise InputError(
                f"there is no problem '{name}'{nearest(name, words)}; known are: "
                f'{", ".join(words)}, all'
            )
    chosen = words if ALL in names else dict.fromkeys(names)
    return [known[n] for n in chosen if n in known], {n for n in chosen if n in TABLES}


def methods(chosen: Sequence[Problem], text: str | None) -> set[str] | None:
    """Names of methods out of a list with commas; ``None`` for all."""
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
    """Numbers out of a list with commas."""
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
