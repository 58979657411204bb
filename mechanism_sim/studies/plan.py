"""Plans of sweeps: from a file to runs, with all scenes checked before the first run."""

from __future__ import annotations

import hashlib
import json
import math
import re
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import combinations, product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim import tables
from mechanism_sim.arguments import listed
from mechanism_sim.catalogue import config_folder, sweep_names
from mechanism_sim.documents import texts_of
from mechanism_sim.errors import InputError, RunWarning, check_known, quoted
from mechanism_sim.joints.contact_keys import is_zero
from mechanism_sim.keys.quantities import Part
from mechanism_sim.numerics.batch_means import BATCHES
from mechanism_sim.output import path_of
from mechanism_sim.results.measure_text import Measure as OwnMeasure
from mechanism_sim.results.measure_text import read_all
from mechanism_sim.scene import Machine, Source, span
from mechanism_sim.scene.build import build
from mechanism_sim.scene.facts import units_at, value_at
from mechanism_sim.scene.files import (
    SceneContent,
    check_scene,
    checked,
    content_of,
    find_file,
    read_yaml,
)
from mechanism_sim.scene.four_bar import FourBarScene
from mechanism_sim.scene.load import started_at, unit_at
from mechanism_sim.scene.schema import Scene
from mechanism_sim.scene.validation import validate_turning
from mechanism_sim.studies import windows
from mechanism_sim.studies.columns import (
    FIGURES,
    RESERVED,
    ResultColumn,
    of_converters,
    of_sensors,
    overloads_of,
    own_columns,
)
from mechanism_sim.studies.runs import Row
from mechanism_sim.studies.schema import DesignPart, SweepFile, WindowsPart
from mechanism_sim.tables import Column
from mechanism_sim.units import (
    QuantityValue,
    common,
    counted,
    plain,
    to_si,
    to_si_like,
    to_si_text,
)

if TYPE_CHECKING:
    from mechanism_sim.studies.design import Factor

SCENE, REPEAT = 'scene', 'repeat'
"""Columns that are no values of a scene."""
_RADIAL = '.clearance.radial'


@dataclass(frozen=True)
class Extent:
    """Length of every run of a sweep: `revolutions`, or a `duration` [s]."""

    revolutions: int | None
    duration: float | None
    skip: float  #: initial part without figures, in the same measure

    def edges(self, machine: Machine) -> tuple[NDArray[np.float64], int]:
        """Ends of the intervals that are counted [s], and how many of the first are left out.

        Intervals are revolutions of the crank, or equal times.
        """
        if self.duration is not None:
            edges = np.linspace(self.skip, self.duration, BATCHES + 1)
            return (np.r_[0.0, edges] if self.skip else edges), int(self.skip > 0.0)
        revolutions = self.revolutions or 1
        times = [span(machine, k, None) for k in range(1, revolutions + 1)]
        return np.array([0.0, *times]), int(self.skip)


@dataclass(frozen=True)
class Run:
    """One run of a sweep."""

    index: int
    name: str
    scene: Scene
    values: Mapping[str, float | str | bool | None]  #: swept values by dotted path, in SI units
    given: Mapping[str, Any]  #: swept values as in the file
    key: str  #: a fingerprint of all that its row follows from
    measures: tuple[str, ...] = ()  #: measures as ``NAME = TEXT`` or ``TEXT``
    #: why the machine cannot be assembled or moved at these values; empty if it can
    refused: str = ''

    @property
    def stem(self) -> str:
        """Stem of the names of its files."""
        return f'run_{self.index:05d}'


class MeasureLimits(NamedTuple):
    """The least and the largest value of a measure, in its SI unit; infinite where not given."""

    low: float
    high: float


@dataclass(frozen=True)
class SweepPlan:
    """A sweep to be made."""

    name: str
    title: str
    extent: Extent
    columns: tuple[str, ...]  #: paths that are swept, in the order of the file
    runs: tuple[Run, ...]
    bags: bool
    windows: WindowsPart | None
    #: SI units of swept values by path, where they are known
    units: Mapping[str, str] = field(default_factory=dict)
    #: figures of a row that depend on the scene: of its joints and drives, and measures
    own: tuple[ResultColumn, ...] = ()
    measures: tuple[str, ...] = ()  #: measures as ``NAME = TEXT``
    #: factors and design of `vary`
    factors: tuple[Factor, ...] = ()
    design: DesignPart | None = None
    limits: Mapping[str, MeasureLimits] = field(default_factory=dict)  #: limits by measure

    @property
    def size(self) -> int:
        """Number of different runs."""
        return len({run.key for run in self.runs})

    @property
    def measure_names(self) -> list[str]:
        """The columns of the measures."""
        return [*map(measure_name, self.measures)]

    @property
    def measured(self) -> list[ResultColumn]:
        """The measures, as figures of a row."""
        return [figure for figure in self.own if figure.name in self.measure_names]

    @property
    def fingerprint(self) -> str:
        """Fingerprint of the computation, in a few letters."""
        content: list[Any] = [self.columns, [[run.key, dict(run.values)] for run in self.runs]]
        content += [self.measures] if self.measures else []
        if self.windows:  # what measures does not rule the motion, but the windows
            measured = [_measurement_keys(run.scene) for run in self.runs]
            content += [self.windows.to_document(), measured]
        return _hash(content)

    def labels(self) -> list[Column]:
        """The columns ``run`` and those of the swept values, a value for each run.

        The unit of a number that is written without one is that of its key.
        """
        columns = [Column('run', [run.index for run in self.runs])]
        for name in self.columns:
            values: list[Any] = [run.values[name] for run in self.runs]
            kinds = {type(v) for v in values if v is not None}
            if len(kinds) != 1:  # several, or none
                kinds, values = {str}, [None if v is None else str(v) for v in values]
            unit = self.units.get(name, '') if kinds == {float} else ''
            columns.append(Column(name, values, unit))
        return columns

    def table(self, rows: Sequence[Row]) -> list[Column]:
        """The columns of the table, with a row for each run in the order of the plan.

        Columns: `labels`, `FIGURES`, those of the scene's own joints, drives and measures,
        ``steps``, ``digest``, ``status``, with units and meanings.
        """
        last = (ResultColumn(name, '', '') for name in ('steps', 'digest', 'status'))
        figures = [
            Column(name, [row.get(name) for row in rows], unit, meaning)
            for name, unit, meaning in (*FIGURES, *self.own, *last)
        ]
        return [*self.labels(), *figures]

    def warn(self, rows: Sequence[Row]) -> None:
        """Say of sensors whose samples were cut in how many runs, and where most of them."""
        for sensor in dict.fromkeys(name for run in self.runs for name in run.scene.sensors):
            column = overloads_of(sensor)
            cut = {index: n for index, row in enumerate(rows) if (n := row.get(column))}
            if cut:
                most = max(cut, key=lambda index: cut[index])
                warnings.warn(
                    f'sensor {sensor}: samples were CUT at the end of its range in {len(cut)} of '
                    f'{counted(len(rows), "run")}, {cut[most]:g} of them in run {most}: see the '
                    f'column {column}',
                    RunWarning,
                    stacklevel=3,
                )

    def write(self, file: Path, rows: Sequence[Row]) -> None:
        """Write the table, all at once."""
        tables.write(file, self.table(rows), {'sweep': self.name, 'title': self.title})


def read_plan(
    source: str | Path | Mapping[str, Any],
    measures: str | Sequence[str] = (),
    show: Callable[[str], None] | None = None,
    scene: Source | None = None,
    called: str = 'sweep',
) -> SweepPlan:
    """The sweep of a file, of one that comes with the package, or of keys and values.

    Parameters
    ----------
    measures : more of them, as ``NAME = TEXT`` or ``TEXT``
    show : callback with the progress
    scene : scene of all runs, if the sweep has none
    called : name of one that is not in a file
    """
    path, content = _content(source, called)
    bases: dict[str, SceneContent] = {}
    if scene is not None:
        if SCENE in content:
            raise InputError(f"{path.name}: the sweep has a 'scene' of its own: keep one")
        shared = _content_of(scene)
        bases[shared.name], content = shared, {**content, SCENE: shared.name}
    content = _with_named_scenes(content, bases)
    file = _by_component(checked(path.name, SweepFile, content))
    extent: Extent | None = None
    columns = _columns(path.name, file)
    runs: list[Run] = []
    grid = [[(key, value) for value in values] for key, values in file.grid.items()]
    taken = _measures(path.name, file, measures)
    factors, drawn = _drawn(path.name, file)
    own: dict[str, ResultColumn] = {}
    measured: dict[tuple[str, ...], tuple[str, ...]] = {}
    listed, total = file.runs or [{}], math.prod(map(len, grid)) * len(drawn) * file.repeat
    for one, point, values_drawn in product(listed, product(*grid), drawn):
        if show:
            show(f'{len(runs)} of {total * len(listed)} runs')
        given = {**one, **dict(point), **values_drawn}
        where = f'{path.name}: run {len(runs)}{_describe(given)}'
        with _in_run(where):
            named = str(given.get(SCENE, file.scene))
            if named not in bases:
                is_path = named.endswith(('.yaml', '.yml'))
                bases[named] = content_of(path.parent / path_of(named) if is_path else named)
            base = bases[named]
            overrides = {k: v for k, v in {**file.set, **given}.items() if k != SCENE}
            overrides, left_out = _without_play(overrides)
            checked_scene = check_scene(base.file, base.data, overrides, base.folder)
        extent = extent or _extent(path.name, file)  # a key that is not known is named first
        with _in_run(where):
            for f in factors if not runs else ():
                f.check_unit(units_at(checked_scene, f.path)[1])
            for repetition in range(file.repeat):
                names_of: dict[str, float | str | None] = {SCENE: base.name, REPEAT: repetition}
                names_of |= {c: _number(left_out[c]) for c in columns if c in left_out}
                try:
                    machine = _machine(base.name, checked_scene, repetition * file.nudge, extent)
                except InputError as error:
                    if not _is_of_numbers(checked_scene, columns):
                        raise
                    values, why = _ordered(checked_scene, columns, names_of), str(error)
                    key = _hash([checked_scene.to_document(), vars(extent), why])
                    run = Run(len(runs), base.name, checked_scene, values, given, key, refused=why)
                    runs.append(run)
                    continue
                nudged = machine.scene
                asked = [*taken, *_of_scene(path.name, machine, taken)]
                read = [] if file.windows else of_sensors(machine, asked)
                kind = named, *machine.plan.clearances  # a joint may be loose in some runs only
                if kind not in measured:
                    measured[kind] = _texts(asked)
                    for column in own_columns(machine, [*asked, *read]):
                        own.setdefault(column.name, column)
                if file.windows:
                    edges, skipped = extent.edges(machine)
                    windows.check(file.windows, machine, edges[skipped], edges[-1])
                    nudged = windows.with_seed(nudged, len(runs), columns)
                for column in of_converters(machine, file.windows):  # ranges may be swept
                    own.setdefault(column.name, column)
                values = _ordered(nudged, columns, names_of)
                ruling: list[Any] = [machine.fingerprint, machine.level.value, vars(extent)]
                texts = (*_texts(asked), *(m.text for m in read))
                ruling += [list(texts)] if texts else []
                figures = (x for m in asked for f in m.figures for x in f.names)
                sensed = read or any(x.startswith('sensors.') for x in figures)
                ruling += [_measurement_keys(nudged)] if sensed else []
                key = _hash(ruling)
                runs.append(Run(len(runs), base.name, nudged, values, given, key, texts))
    _refuse_hopeless(path.name, runs)
    names = dict.fromkeys(measure_name(text) for texts in measured.values() for text in texts)
    limits = _limits(path.name, file, own, names)
    units = _units(columns, runs) | {f.path: f.unit for f in factors}
    design = file.design if factors else None
    return SweepPlan(
        path.stem, file.title, extent or _extent(path.name, file), columns, tuple(runs), file.bags,
        file.windows, units, tuple(own.values()), _of_all(measured.values()), tuple(factors),
        design, limits,
    )  # fmt: skip


def _machine(name: str, scene: Scene, nudge: float, extent: Extent) -> Machine:
    """The machine of a run, with its drive a little further at the start [rad]."""
    machine = build(name, scene)
    if nudge:
        machine = started_at(machine, machine.drive.start[0] + nudge)
    validate_turning(machine, span(machine, extent.revolutions, extent.duration))
    return machine


def _is_of_numbers(scene: Scene, columns: Iterable[str]) -> bool:
    """True if all that varies is numbers: what only some of them allow is no slip in a name."""
    places = (value_at(scene, c)[0] for c in columns if c not in (SCENE, REPEAT))
    documents = (x.to_document() if isinstance(x, Part) else x for x in places)
    # of a quantity with its unit that is a text of its own
    texts = (text for x in documents for _, text in texts_of(x) if not common(text))
    return all(isinstance(_number(text), float) for text in texts)


def _refuse_hopeless(file: str, runs: Iterable[Run]) -> None:
    """Refuse a sweep of whose runs with one scene none can be made."""
    able = {run.name for run in runs if not run.refused}
    for run in runs:
        if run.name not in able:
            raise InputError(f'{file}: run {run.index}{_describe(run.given)}: {run.refused}')


@contextmanager
def _in_run(where: str) -> Iterator[None]:
    """Errors of a run say which."""
    try:
        yield
    except InputError as error:
        raise InputError(f'{where}: {error}') from error


def _content(source: str | Path | Mapping[str, Any], called: str) -> tuple[Path, dict[str, Any]]:
    """Path and content of a sweep; one that is not in a file is as in the current folder."""
    if isinstance(source, Mapping):
        return Path(called), dict(source)
    if not isinstance(source, str | Path):
        raise InputError(
            f'{quoted(source)} is not a sweep: give a name, a path, or its keys and values as a '
            'dictionary'
        )
    known = ', '.join(sweep_names())
    path = find_file(str(source), 'sweep', config_folder() / 'sweeps', f'known are: {known}')
    return path, read_yaml(path, 'sweep')


def _content_of(scene: Source) -> SceneContent:
    """Content of a scene in any form."""
    if isinstance(scene, Machine):
        return content_of(scene.scene, scene.name)
    return content_of(scene)


def _with_named_scenes(content: dict[str, Any], bases: dict[str, SceneContent]) -> dict[str, Any]:
    """Keys and values of a sweep in which scenes of other forms stand by name, and enter these."""
    texts = set()

    def named(value: Any, key: str, known: dict[str, SceneContent]) -> Any:
        value = plain(value)
        if key == SCENE and isinstance(value, str | Path):
            texts.add(str(value))
            return str(value)
        if key == SCENE and isinstance(value, Mapping | Scene | FourBarScene | Machine):
            found, number = _content_of(value), 1
            name = found.name
            while name in texts or (name in known and known[name].data != found.data):
                number += 1
                name = f'{found.name}_{number}'
            known[name] = found._replace(name=name)
            return name
        if isinstance(value, Mapping):
            return {k: named(x, k, known) for k, x in value.items()}
        return [named(x, key, known) for x in value] if isinstance(value, list | tuple) else value

    named(content, '', {})  # all texts, which are names already
    found: dict[str, Any] = named(content, '', bases)
    return found


def _measures(file: str, sweep: SweepFile, more: str | Sequence[str]) -> list[OwnMeasure]:
    """All measures, those of the command line last."""
    found = read_all(sweep.measures, f'{file}: measures')
    found += read_all(listed(more, 'measures'), '--measure')
    _check_names(file, [m.name for m in found])
    return found


def _check_names(file: str, names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1 or name in RESERVED:
            raise InputError(f"{file}: a column '{name}' is there already: choose another name")


def _of_scene(file: str, machine: Machine, taken: Sequence[OwnMeasure]) -> list[OwnMeasure]:
    """The measures of the scene itself; one of the sweep by the same name is taken instead."""
    names = {m.name for m in taken}
    own = {name: text for name, text in machine.scene.measures.items() if name not in names}
    _check_names(f'{file}: measures of {machine.name}', [*own])
    return read_all(own, f'{machine.name}: measures')


def _texts(measures: Iterable[OwnMeasure]) -> tuple[str, ...]:
    """Measures as ``NAME = TEXT``, or as ``TEXT`` which is its own name."""
    return tuple(f'{m.name} = {m.text}' if m.name != m.text else m.text for m in measures)


def measure_name(text: str) -> str:
    """The column of a measure."""
    return text.partition(' = ')[0]


def _of_all(measured: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
    """The measures that all scenes have."""
    first, *others = measured
    return tuple(text for text in first if all(text in other for other in others))


def _by_component(sweep: SweepFile) -> SweepFile:
    """A sweep with each component of a point that has a tolerance as a factor of its own."""
    if not sweep.vary:
        return sweep
    from mechanism_sim.studies import design  # noqa: PLC0415 - statistics are slow to import

    vary, fixed = design.by_component(sweep.vary)
    return sweep.model_copy(update={'vary': vary, 'set': {**sweep.set, **fixed}})


def _drawn(file: str, sweep: SweepFile) -> tuple[list[Factor], list[dict[str, float]]]:
    """The factors of `vary`, and their values in each run; one run without any."""
    if not sweep.vary:
        if sweep.design != DesignPart():
            raise InputError(f"{file}: 'design' needs 'vary', which says what varies")
        return [], [{}]
    from mechanism_sim.studies import design  # noqa: PLC0415 - statistics are slow to import

    try:
        factors = [design.factor(path, given) for path, given in sweep.vary.items()]
        how = sweep.design
        rows = design.points(factors, how.kind, how.samples, how.seed)
    except InputError as error:
        raise InputError(f'{file}: {error}') from error
    paths = [f.path for f in factors]
    return factors, [dict(zip(paths, row, strict=True)) for row in rows.tolist()]


def _limits(
    file: str,
    sweep: SweepFile,
    own: Mapping[str, ResultColumn],
    names: Collection[str],
) -> dict[str, MeasureLimits]:
    """The limits in the units of their measures."""
    found = {}
    for name, text in sweep.limits.items():
        wrong = f'{file}: limits.{name}: there is no such measure'
        check_known(name, names, wrong, 'measures:')
        try:
            found[name] = _read_limits(text, own[name].unit)
        except ValueError as error:
            raise InputError(f'{file}: limits.{name} = {text!r} {error}') from error
    return found


def _read_limits(given: str | float | list[str | float | None], unit: str) -> MeasureLimits:
    """Limits as a sweep file has them: ``HIGH``, ``< HIGH``, ``> LOW`` or ``[LOW, HIGH]``."""
    if not isinstance(given, list):
        sign, text = re.findall(r'\A\s*([<>]?)=?(.*)', str(given), re.DOTALL)[0]
        pair = [text, None] if sign == '>' else [None, text if sign else given]
        return _read_limits(pair, unit)
    if len(given) != 2 or given == [None, None]:
        raise ValueError("is not a limit: write HIGH, '> LOW' or [LOW, HIGH]")
    low, high = (None if x is None else to_si_like(x, unit) for x in given)
    found = MeasureLimits(-math.inf if low is None else low, math.inf if high is None else high)
    if not found.low < found.high:
        raise ValueError('must be numbers that rise')
    return found


def _without_play(overrides: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Overrides with joints ideal whose radial clearance is 0, and those which that leaves out."""
    found, left_out = dict(overrides), dict[str, Any]()
    for path, value in overrides.items():
        if path.startswith('joints.') and path.endswith(_RADIAL) and is_zero(value):
            play = path.removesuffix('.radial')
            left_out |= {k: v for k, v in overrides.items() if k.startswith(f'{play}.')}
            found = {k: v for k, v in found.items() if k not in left_out and k != play}
            found[play] = None
    return found, left_out


def _number(given: Any) -> float | str | None:
    """A value as it is given, in SI units."""
    try:
        return to_si_text(given).value
    except ValueError:
        return None if given is None else str(given)


def _units(columns: Sequence[str], runs: Sequence[Run]) -> dict[str, str]:
    """SI units of swept values as they are written, else of their keys, if all runs agree."""
    found: dict[str, str] = {}
    for column in columns:
        units, plain = set(), None
        for run in runs:
            try:
                unit = to_si_text(run.given.get(column)).unit
            except ValueError:
                unit = ''
            place, own = value_at(run.scene, column)
            if unit or own:
                units.add(unit or own)
            elif place is not None:  # of a joint without play nothing is known
                plain = plain or run.scene
        if plain and not units:
            units.add(unit_at(plain, column))
        if len(units) == 1 and (unit := units.pop()):
            found[column] = unit
    return found


def _extent(file: str, sweep: SweepFile) -> Extent:
    if sweep.revolutions is None and sweep.duration is None:
        raise InputError(
            f"{file}: the length of the runs is missing: give 'revolutions' or 'duration', for "
            "example 'revolutions: 1'"
        )
    if sweep.revolutions is not None and sweep.duration is not None:
        raise InputError(f"{file}: give either 'revolutions' or 'duration', and not both")
    limit = sweep.revolutions or sweep.duration or 0.0
    try:
        skip = to_si(sweep.skip, 's' if sweep.duration is not None else '')
    except ValueError as error:
        raise InputError(f'{file}: skip = {sweep.skip!r} {error}') from error
    if not (0.0 <= skip < limit):
        raise InputError(f'{file}: skip = {skip:g} must be at least 0 and less than {limit:g}')
    if sweep.revolutions and skip != math.floor(skip):
        raise InputError(f'{file}: skip = {skip:g} must be a whole number of revolutions')
    return Extent(sweep.revolutions, sweep.duration, skip)


def _columns(file: str, sweep: SweepFile) -> tuple[str, ...]:
    """Paths that are swept; a path may stand in one place of the file only."""
    listed = dict.fromkeys(key for one in sweep.runs for key in one)
    places = {'set': sweep.set, 'grid': sweep.grid, 'runs': listed, 'vary': sweep.vary}
    for a, b in combinations(places, 2):
        for key in places[a]:
            if key in places[b]:
                raise InputError(f"{file}: '{key}' stands in both '{a}' and '{b}': keep one")
    swept = (*listed, *sweep.grid, *sweep.vary)
    everywhere = SCENE in sweep.grid or (sweep.runs and all(SCENE in one for one in sweep.runs))
    if SCENE in sweep.set or (sweep.scene is None and not everywhere):
        raise InputError(
            f"{file}: 'scene' is missing: the name of a scene of the package, or the path of one"
        )
    return (*swept, REPEAT) if sweep.repeat > 1 else swept


def _ordered(
    scene: Scene, columns: Iterable[str], others: Mapping[str, float | str | None]
) -> dict[str, float | str | bool | None]:
    """Values in the columns of a run, including those that differ from the scene."""
    return {c: others[c] if c in others else _value(scene, c) for c in columns}


def _value(scene: Scene, path: str) -> float | str | bool | None:
    """Value at a dotted path of a scene; lists and parts as JSON."""
    place, _ = value_at(scene, path)
    if place is None or isinstance(place, bool | str | float | int):
        return place
    if isinstance(place, QuantityValue):
        return place.value
    return json.dumps(place, default=Part.to_document)


def _measurement_keys(scene: Scene) -> dict[str, Any]:
    """Keys of a scene about its measurements."""
    return scene.to_document(include={'sensors', 'oscillators'})


def _describe(given: Mapping[str, Any]) -> str:
    parts = (f'{k} = {v if isinstance(v, str) else quoted(v)}' for k, v in given.items())
    return f' ({", ".join(parts)})' if given else ''


def _hash(content: object) -> str:
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]
