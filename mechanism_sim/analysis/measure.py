"""Measures of a run from any source."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from mechanism_sim.analysis.open_run import check_run_of, is_run, run_of_machine
from mechanism_sim.analysis.record import Record
from mechanism_sim.arguments import listed, public
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.errors import InputError, quoted
from mechanism_sim.recording.reader import Bag
from mechanism_sim.results.cycle import Cycle, measures_of
from mechanism_sim.results.measures import Measured, Measurement
from mechanism_sim.results.run import Piece, Solution
from mechanism_sim.results.simulate import Stream
from mechanism_sim.scene import Machine, Source, load_scene
from mechanism_sim.units import argument


@public
def measure(
    run: Source | Piece | Cycle | Stream | Bag | Record,
    *texts: str | Sequence[str] | Mapping[str, str] | Piece | Iterable[Piece],
    since: float | str | None = None,
    until: float | str | None = None,
) -> list[Measured]:
    """Measures of a run of a machine, a list of one for each text.

    >>> import mechanism_sim as ms
    >>> run = ms.simulate('slider_crank', revolutions=1)
    >>> (found,) = ms.measure(run, 'range(position.piston)')
    >>> round(found.value, 9), found.unit
    (0.1, 'm')

    Parameters
    ----------
    run : a solution, a cycle, a stream, a bag or its path, a run that `open_run` opened; or all
        that `load_scene` takes, followed by a run of it or its pieces
    texts : the measures, one by one or as lists, or as a dictionary by name; those of the scene
        without any
    since, until : the window [s] of figures that name none
    """
    begin, end = argument('since', since, 's'), argument('until', until, 's')
    window = 0.0 if begin is None else begin, math.inf if end is None else end
    if isinstance(run, Cycle):
        return measures_of(run, _asked(run.machine, texts), *window)
    history: Motion | None = None
    pieces: Any
    if isinstance(run, Stream):
        machine, pieces = run.machine, run
    elif is_run(run):
        record = run_of_machine(run, 'a measure')  # type: ignore[arg-type]
        machine, pieces, history = record.machine, record.piece, record.history
    else:
        machine, (pieces, *texts) = load_scene(run), [*texts] or ['a measure']  # type: ignore[arg-type, assignment]
    taken = Measurement(machine, _asked(machine, texts), *window)
    for piece in [pieces] if isinstance(pieces, Piece | str) else pieces:
        if not isinstance(piece, Piece):
            raise InputError(f'measure: {quoted(piece)} is of a run: give a solution before it')
        check_run_of(machine, piece)
        taken.add(piece, history)
    found, known = taken.found(), pieces.derivatives if isinstance(pieces, Solution) else {}
    each = dict.fromkeys(m.text for m in found)  # measures of two names may be one text
    slopes = {p: d.measures(*each, window=window) for p, d in known.items() if each}
    return [
        m._replace(derivatives={p: values[m.text] for p, values in slopes.items()}) for m in found
    ]


def _asked(machine: Machine, given: Sequence[Any]) -> dict[str, str] | list[str]:
    """Texts that are given one by one, in lists, or by name; those of the scene if none are."""
    if not given:
        return dict(machine.scene.measures)
    if len(given) == 1 and isinstance(given[0], Mapping):
        return dict(given[0])
    return [text for part in given for text in listed(part, 'measures')]
