"""Finding and reading scene files, overrides, and errors that say where and what to do."""

from __future__ import annotations

import difflib
import re
import sysconfig
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, get_args, get_origin

import yaml
from pydantic import BaseModel, ValidationError

from mechanism_sim.errors import InputError
from mechanism_sim.scene.schema import MECHANISMS, FourBarScene


def config_folder() -> Path:
    """Where the scenes of the package are: beside the sources, or where pip put them."""
    beside = Path(__file__).parents[2] / 'config'
    if beside.is_dir():
        return beside
    return Path(sysconfig.get_path('data')) / 'share' / 'mechanism_sim' / 'config'


def scene_names() -> list[str]:
    """Names of the scenes that come with the package."""
    return sorted(path.stem for path in config_folder().glob('*.yaml'))


def find_scene(name: str) -> Path:
    """The file of a scene: a path, or the name of one that comes with the package.

    Raises
    ------
    InputError
        If there is no such file; names the nearest.
    """
    path = Path(name)
    try:
        exists, is_file = path.exists(), path.is_file()
    except (OSError, ValueError):  # longer than the file system allows, or with a null character
        exists = is_file = False
    if path.suffix in ('.yaml', '.yml') or exists:
        if not is_file:
            raise InputError(f"there is no scene file '{name}'")
        return path
    known = scene_names()
    if name not in known:
        hint = nearest(name, known)
        raise InputError(
            f"there is no scene '{name}'{hint}; 'mechanism-sim scenes' lists them, and a path "
            'ending in .yaml reads your own'
        )
    return config_folder() / f'{name}.yaml'


def read_scene(
    name: str, overrides: Mapping[str, Any] | Iterable[str] = ()
) -> tuple[str, FourBarScene]:
    """Name and content of a scene, checked, in SI units.

    Parameters
    ----------
    name : a scene of the package or a path
    overrides : values by dotted path, or texts ``path=value``

    Raises
    ------
    InputError
        One sentence: file, key, value, what is allowed, the nearest valid key.
    """
    path = find_scene(name)
    try:
        data = yaml.load(path.read_text(encoding='utf-8'), _StrictLoader)  # noqa: S506 - a safe one
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        line = f' line {mark.line + 1}' if mark else ''
        problem = getattr(error, 'problem', None) or 'is not readable'
        raise InputError(f'{path.name}:{line} is not valid YAML: {problem}') from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"the scene file '{path}' cannot be read: {error}") from error
    if not isinstance(data, dict):
        raise InputError(f'{path.name}: a scene is a list of keys with values, see docs/scenes.md')
    for key, value in _pairs(overrides):
        _override(data, key, value, path.name)
    kind = data.get('mechanism')
    if not isinstance(kind, str) or kind not in MECHANISMS:
        raise InputError(
            f"{path.name}: mechanism is '{kind}'{nearest(str(kind), MECHANISMS)}; known are: "
            f'{", ".join(MECHANISMS)}'
        )
    try:
        return path.stem, MECHANISMS[kind].model_validate(data)
    except ValidationError as error:
        raise InputError(f'{path.name}: {_first_problem(error, MECHANISMS[kind])}') from error


class _StrictLoader(yaml.SafeLoader):
    """Refuses a key that is written twice, instead of forgetting the first."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """The mapping of a node."""
        seen: set[str] = set()
        for key, _ in node.value:
            if key.value in seen:
                raise yaml.MarkedYAMLError(
                    problem=f"the key '{key.value}' is written twice", problem_mark=key.start_mark
                )
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def nearest(word: str, known: Iterable[str]) -> str:
    """``; did you mean 'X'?`` for the nearest of the known words, or nothing."""
    close = difflib.get_close_matches(word, list(known), 1, 0.5)
    return f"; did you mean '{close[0]}'?" if close else ''


def _pairs(overrides: Mapping[str, Any] | Iterable[str]) -> list[tuple[str, Any]]:
    if isinstance(overrides, Mapping):
        return list(overrides.items())
    pairs = []
    for text in overrides:
        key, sign, value = text.partition('=')
        if not sign or not key.strip():
            raise InputError(
                f"the override '{text}' is not of the form PATH=VALUE, for example "
                "'drive.speed=300 rpm'"
            )
        try:
            pairs.append((key.strip(), yaml.safe_load(value)))
        except yaml.YAMLError as error:
            raise InputError(f"the value of the override '{text}' is not readable") from error
    return pairs


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


def _first_problem(error: ValidationError, model: type[BaseModel]) -> str:
    problems = error.errors()
    problem = next((p for p in problems if p['type'] == 'extra_forbidden'), problems[0])
    path = [str(part) for part in problem['loc']]
    where = '.'.join(path)
    kind, context = problem['type'], problem.get('ctx', {})
    value = problem['input']
    if kind == 'extra_forbidden':
        known = _keys(model, path[:-1])
        hint = nearest(path[-1], known)
        return f"unknown key '{where}'{hint}; allowed here: {', '.join(known)}"
    if kind == 'missing':
        return f"'{where}' is missing"
    if kind == 'value_error':
        return f'{where} = {value!r} {context["error"]}'
    if kind == 'literal_error':
        hint = nearest(str(value), re.findall(r"'([^']*)'", str(context['expected'])))
        return f'{where} = {value!r} is not possible{hint}; allowed: {context["expected"]}'
    expected = {
        'model_type': 'it must be a list of keys with values',
        'dict_type': 'it must be a list of names with values',
        'tuple_type': 'it must be a list of two quantities, for example [0, -9.81 m/s^2]',
        'too_long': 'it must be a list of two quantities, for example [0, -9.81 m/s^2]',
        'string_type': 'it must be text; put it in quotes',
        'bool_parsing': 'it must be true or false',
        'bool_type': 'it must be true or false',
        'finite_number': 'it must be finite',
        'invalid_key': 'keys must be text',
    }
    if kind in expected:
        return f'{where} = {value!r}: {expected[kind]}'
    bounds = {
        'greater_than': ('gt', 'more than'),
        'greater_than_equal': ('ge', 'at least'),
        'less_than': ('lt', 'less than'),
        'less_than_equal': ('le', 'at most'),
    }
    if kind in bounds:
        key, words = bounds[kind]
        return f'{where} = {value!r} is out of bounds: it must be {words} {context[key]:g}'
    return f'{where} = {value!r}: {problem["msg"]}'


def _keys(model: type[BaseModel], path: list[str]) -> list[str]:
    """Keys allowed at a place of the schema."""
    kind: Any = model
    for part in path:
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            kind = kind.model_fields[part].annotation
            if get_origin(kind) is dict:
                continue  # its keys are free, its values are the next part's model
        candidates = [kind, *get_args(kind)]
        kind = next(
            (c for c in reversed(candidates) if isinstance(c, type) and issubclass(c, BaseModel)),
            kind,
        )
    return list(kind.model_fields)
