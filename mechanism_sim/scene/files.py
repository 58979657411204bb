"""Finding and reading scene files, overrides, and errors that say where and what to do."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from mechanism_sim import documents
from mechanism_sim.catalogue import config_folder
from mechanism_sim.errors import InputError, nearest, quoted
from mechanism_sim.scene.four_bar import FourBarScene, expanded
from mechanism_sim.scene.schema import AnyScene, Scene
from mechanism_sim.scene.table_keys import with_files

MECHANISMS: dict[str, type[AnyScene]] = {'four_bar': FourBarScene, 'linkage': Scene}

Model = TypeVar('Model', bound=BaseModel)

_DOCS = {'scene': 'scenes.md', 'sweep': 'studies.md'}


def find_scene(name: str) -> Path:
    """The file of a scene: a path, or the name of one that comes with the package."""
    return find_file(name, 'scene', config_folder(), "'mechanism-sim scenes' lists them")


def find_file(name: str, kind: str, folder: Path, known_by: str) -> Path:
    """The file of a scene, or of another `kind`: a path, or the name of one in `folder`."""
    path = Path(name)
    if path.suffix == '.mcap':
        raise InputError(
            f"'{path}' is a bag, not a {kind}: 'mechanism-sim analyze' says what is in it"
        )
    try:
        is_file = path.is_file()
    except (OSError, ValueError):  # longer than the file system allows, or with a null character
        is_file = False
    if is_file:
        return path
    if path.suffix in ('.yaml', '.yml'):
        raise InputError(f"there is no {kind} file '{name}'")
    known = sorted(path.stem for path in folder.glob('*.yaml'))
    if name not in known:
        hint = nearest(name, known)
        raise InputError(
            f"there is no {kind} '{name}'{hint}; {known_by}, and a path ending in .yaml reads "
            'your own'
        )
    return folder / f'{name}.yaml'


def read_scene(name: str, overrides: Mapping[str, Any] | Iterable[str] = ()) -> tuple[str, Scene]:
    """Name and content of a scene, checked, in SI units.

    Parameters
    ----------
    name : a scene of the package or a path
    overrides : values by dotted path, or texts ``path=value``
    """
    path = find_scene(name)
    return path.stem, check_scene(path.name, read_yaml(path, 'scene'), overrides)


def read_yaml(path: Path, kind: str) -> dict[str, Any]:
    """The keys and values of a scene, or of another `kind` of file, unchecked."""
    data = with_files(path.name, path.parent, documents.read(path, kind))
    if not isinstance(data, dict):
        raise InputError(
            f'{path.name}: a {kind} is a list of keys with values, see docs/{_DOCS[kind]}'
        )
    return data


def check_scene(
    file: str, data: Mapping[str, Any], overrides: Mapping[str, Any] | Iterable[str] = ()
) -> Scene:
    """The scene that a file's keys and values make, some of them overridden, in SI units."""
    content = overridden(file, data, overrides)
    scene = as_given(file, content)
    if isinstance(scene, FourBarScene):
        return checked(file, Scene, expanded(scene, content))
    assert isinstance(scene, Scene)  # noqa: S101 - there are no others
    return scene


def as_given(file: str, content: Mapping[str, Any]) -> AnyScene:
    """The same without overrides, in the form in which it is written."""
    kind = content.get('mechanism')
    if kind is None:
        raise InputError(f"{file}: 'mechanism' is missing; known are: {', '.join(MECHANISMS)}")
    if not isinstance(kind, str) or kind not in MECHANISMS:
        raise InputError(
            f'{file}: mechanism is {quoted(kind)}{nearest(str(kind), MECHANISMS)}; known are: '
            f'{", ".join(MECHANISMS)}'
        )
    return checked(file, MECHANISMS[kind], content)


def overridden(
    file: str, data: Mapping[str, Any], overrides: Mapping[str, Any] | Iterable[str] = ()
) -> dict[str, Any]:
    """A file's keys and values, some of them replaced, unchecked."""
    content = copy.deepcopy(dict(data))
    try:
        pairs = _pairs(overrides)
        _refuse_contradictions(file, pairs)
        for key, value in pairs:
            documents.check(value, tuple(key.split('.')))
            _override(content, key, copy.deepcopy(value), file)  # a later one may change its parts
    except documents.DocumentError as error:
        raise InputError(f'{file}: {error}') from error
    return content


def checked(file: str, model: type[Model], data: Mapping[str, Any]) -> Model:
    """The keys and values of a file as a model of it."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise InputError(f'{file}: {_first_problem(error, model, data)}') from error


def _pairs(overrides: Mapping[str, Any] | Iterable[str]) -> list[tuple[str, Any]]:
    if isinstance(overrides, Mapping):
        return list(overrides.items())
    pairs = []
    for text in overrides:
        key, sign, value = text.partition('=')
        if not sign or not key.strip():
            raise InputError(
                f'the override {quoted(text)} is not of the form PATH=VALUE, for example '
                "'drive.speed=300 rpm'"
            )
        try:
            pairs.append((key.strip(), documents.parse(value)))
        except documents.DocumentError as error:
            raise InputError(
                f'the value of the override {quoted(text)} is not readable:{error}'
            ) from error
    return pairs


def _refuse_contradictions(file: str, pairs: list[tuple[str, Any]]) -> None:
    """InputError where an override would undo an earlier one; it may change parts of its value."""
    earlier: dict[str, Any] = {}
    for key, value in pairs:
        if key in earlier and earlier[key] != value:
            raise InputError(
                f'{file}: {key} is set twice, to {quoted(earlier[key])} and to {quoted(value)}: '
                'keep one'
            )
        if undone := [other for other in earlier if other.startswith(f'{key}.')]:
            raise InputError(
                f"{file}: setting '{key}' would undo that of '{undone[0]}' before it: set "
                f"'{key}' first, or leave one out"
            )
        earlier[key] = value


def _override(data: dict[str, Any], key: str, value: Any, file: str) -> None:
    *path, last = key.split('.')
    place: Any = data
    for part in path:
        if place.get(part) is None:
            place[part] = {}
        place = place[part]
        if not isinstance(place, dict):
            raise InputError(f"{file}: '{key}' cannot be set, because '{part}' is a plain value")
    place[last] = value


def _place(problem: ErrorDetails, data: Any) -> list[str]:
    """Keys that lead to a problem, without what Pydantic calls the kinds that may stand there."""
    *path, last = problem['loc'] or ('',)
    found, here = [], data
    for part in path:
        try:
            here = here[part]
        except (KeyError, IndexError, TypeError):
            continue
        found.append(str(part))
    there = isinstance(here, list | tuple) or (isinstance(here, Mapping) and last in here)
    return [*found, str(last)] if there or problem['type'] == 'missing' else found


def _first_problem(error: ValidationError, model: type[BaseModel], data: Any) -> str:
    problems = error.errors()
    problem = next((p for p in problems if p['type'] == 'extra_forbidden'), problems[0])
    path = _place(problem, data)
    where = '.'.join(path)
    kind, context = problem['type'], problem.get('ctx', {})
    value = problem['input']
    if kind == 'extra_forbidden':
        known = _keys(model, path[:-1])
        hint = nearest(path[-1], known)
        return f"unknown key '{where}'{hint}; allowed here: {', '.join(known)}"
    if kind == 'missing':
        return f"'{where}' is missing"
    if kind == 'missing_key':
        return f"'{where}.{context['key']}' is missing"
    if kind == 'value_error':
        shown = where if isinstance(value, dict) else f'{where} = {quoted(value)}'
        return f'{shown} {context["error"]}'.lstrip()
    if kind == 'literal_error':
        hint = nearest(str(value), re.findall(r"'([^']*)'", str(context['expected'])))
        return f'{where} = {quoted(value)} is not possible{hint}; allowed: {context["expected"]}'
    expected = {
        'model_type': 'it must be a list of keys with values',
        'dict_type': 'it must be a list of names with values',
        'tuple_type': 'it must be a list of two quantities, for example [0, -9.81 m/s^2]',
        'too_long': 'it must be a list of two quantities, for example [0, -9.81 m/s^2]',
        'list_type': 'it must be a list, for example [1, 2, 3]',
        'int_type': 'it must be a whole number',
        'int_parsing': 'it must be a whole number',
        'int_from_float': 'it must be a whole number',
        'float_type': 'it must be a number',
        'string_type': 'it must be text; put it in quotes',
        'bool_parsing': 'it must be true or false',
        'bool_type': 'it must be true or false',
        'finite_number': 'it must be finite',
        'invalid_key': 'keys must be text',
    }
    if kind == 'too_short':
        least = context['min_length']
        few = 'it must not be empty' if least == 1 else f'it must have {least} entries'
        return f'{where} = {quoted(value)}: {few}'
    if kind in expected:
        ways = [expected.get(p['type']) for p in problems if _place(p, data) == path]
        return f'{where} = {quoted(value)}: {", or ".join(dict.fromkeys(filter(None, ways)))}'
    bounds = {
        'greater_than': ('gt', 'more than'),
        'greater_than_equal': ('ge', 'at least'),
        'less_than': ('lt', 'less than'),
        'less_than_equal': ('le', 'at most'),
    }
    if kind in bounds:
        key, words = bounds[kind]
        return f'{where} = {quoted(value)} is out of bounds: it must be {words} {context[key]:g}'
    return f'{where} = {quoted(value)}: {problem["msg"]}'


def _keys(model: type[BaseModel], path: list[str]) -> list[str]:
    """Keys allowed at a place of the schema."""
    here = [model]
    for part in path:
        fields = [f for m in here for k, f in m.model_fields.items() if part in (k, f.alias)]
        # else it is a name, or the index of an entry, and leads to no other model
        here = [m for field in fields for m in _models(field.annotation)] or here
    return list(dict.fromkeys(f.alias or k for m in here for k, f in m.model_fields.items()))


def _models(kind: Any) -> list[type[BaseModel]]:
    """The models that an annotation speaks of."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return [kind]
    return [model for part in get_args(kind) for model in _models(part)]
