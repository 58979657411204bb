"""Search and reading of scene files, overrides, and errors with place and advice.

Pydantic's own words never reach a user: every sort of problem has words here, and the rest says of
what the key is.
"""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel, ValidationError

from mechanism_sim import documents
from mechanism_sim.catalogue import config_folder
from mechanism_sim.errors import InputError, nearest, nearest_file, quoted
from mechanism_sim.keys.quantities import Part
from mechanism_sim.output import path_of
from mechanism_sim.scene.facts import COMPONENTS
from mechanism_sim.scene.four_bar import FourBarScene, expanded
from mechanism_sim.scene.problems import sentence
from mechanism_sim.scene.schema import AnyScene, Scene
from mechanism_sim.scene.table_keys import with_files
from mechanism_sim.signal_files import refuse_signals
from mechanism_sim.units import plain

MECHANISMS: dict[str, type[AnyScene]] = {'four_bar': FourBarScene, 'linkage': Scene}

Model = TypeVar('Model', bound=BaseModel)

_ENDINGS = '.yaml', '.yml'
_IMPORTED = '.dxf', '.sdf', '.svg', '.urdf', '.xml'
"""Endings of files of other programs, of which `imports` makes scenes."""
_DOCS = {'scene': 'scenes.md', 'sweep': 'studies.md'}


class SceneContent(NamedTuple):
    """Keys and values of a scene, unchecked, the file that errors name, and its own name.

    Files that it names are below the folder.
    """

    file: str
    name: str
    data: dict[str, Any]
    folder: Path


def content_of(
    source: str | Path | Mapping[str, Any] | Scene | FourBarScene,
    name: str = 'scene',
    overrides: Mapping[str, Any] | Iterable[str] = (),
) -> SceneContent:
    """Content of a scene by name, path or YAML text, as a dictionary or as a `Scene`.

    Parameters
    ----------
    name : name of a scene without one; its files are relative to the current folder
    overrides : overrides of the scene: files that they replace are not read
    """
    replaced = [path for path, _ in _pairs(overrides)]
    if isinstance(source, Scene | FourBarScene):
        return SceneContent(
            name, name, {'mechanism': source.mechanism, **_plain(source)}, Path.cwd()
        )
    if isinstance(source, Mapping):
        data = with_files(name, Path.cwd(), _plain(source), replaced=replaced)
        return SceneContent(name, name, data, Path.cwd())
    if isinstance(source, str) and ('\n' in source or source.lstrip().startswith('{')):
        try:
            data = with_files(name, Path.cwd(), documents.parse(source), replaced=replaced)
        except documents.DocumentError as error:
            raise InputError(f'{name}:{error}') from error
        return SceneContent(name, name, _keys_and_values(name, data, 'scene'), Path.cwd())
    if not isinstance(source, str | Path):
        own = ', as .machine of this run' if hasattr(source, 'machine') else ''
        raise InputError(
            f'{quoted(source)} is not a scene: give a name, a path, YAML as text, a dictionary, '
            f'a Scene or a machine{own}'
        )
    path = find_scene(str(source))
    return SceneContent(path.name, path.stem, read_yaml(path, 'scene', replaced), path.parent)


def _plain(data: Any) -> Any:
    """Data as a file could give them: of parts of scenes what was set, of arrays lists."""
    if isinstance(data, Part):
        data = data.to_document(exclude_unset=True)
    if isinstance(data, Mapping):
        return {key: _plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_plain(value) for value in data]
    return plain(data)


def find_scene(name: str) -> Path:
    """The file of a scene: a path, or the name of one that comes with the package."""
    return find_file(name, 'scene', config_folder(), "'mechanism-sim scenes' lists them")


def find_file(name: str, kind: str, folder: Path, known_by: str) -> Path:
    """The file of a scene, or of another `kind`: a path, or the name of one in `folder`."""
    path = path_of(name)
    if path.suffix == '.mcap':
        raise InputError(
            f"'{path}' is a bag, not a {kind}: 'mechanism-sim analyze' shows its contents"
        )
    try:
        is_file, is_other = path.is_file(), path.exists() and not path.is_dir()
    except (OSError, ValueError):  # longer than the file system allows, or with a null character
        is_file = is_other = False
    if is_file:
        refuse_signals(path, kind)
        if path.suffix.lower() in _IMPORTED:
            raise InputError(
                f"'{path}' is a file of another program, not a {kind}: 'mechanism-sim import "
                f"{path} -o {path.stem}.yaml' makes a scene of it"
            )
        return path
    known = sorted(path.stem for path in folder.glob('*.yaml'))
    if is_other and name not in known:  # a pipe
        raise InputError(f"'{name}' is not a regular file: write the {kind} into one")
    if path.suffix in _ENDINGS:
        raise InputError(f"there is no {kind} file '{name}'{nearest_file(path, _ENDINGS)}")
    if name not in known:
        hint = nearest_file(Path(f'{name}.yaml'), _ENDINGS, alike=False) or nearest(name, known)
        raise InputError(
            f"there is no {kind} '{name}'{hint}; {known_by}, and a path ending in .yaml reads "
            'your own'
        )
    return folder / f'{name}.yaml'


def read_yaml(path: Path, kind: str, replaced: Collection[str] = ()) -> dict[str, Any]:
    """The keys and values of a scene, or of another `kind` of file, unchecked."""
    data = with_files(path.name, path.parent, documents.read(path, kind), replaced=replaced)
    return _keys_and_values(path.name, data, kind)


def _keys_and_values(file: str, data: Any, kind: str) -> dict[str, Any]:
    if not isinstance(data, dict):
        raise InputError(f'{file}: a {kind} is a list of keys with values, see docs/{_DOCS[kind]}')
    return data


def check_scene(
    file: str,
    data: Mapping[str, Any],
    overrides: Mapping[str, Any] | Iterable[str] = (),
    folder: Path | None = None,
) -> Scene:
    """The scene that a file's keys and values make, some `overridden`, in SI units."""
    content = titled(file, overridden(file, data, overrides, folder))
    scene = as_given(file, content)
    if isinstance(scene, FourBarScene):
        return checked(file, Scene, expanded(scene, content))
    assert isinstance(scene, Scene)  # noqa: S101 - there are no others
    return scene


def titled(file: str, content: Mapping[str, Any]) -> dict[str, Any]:
    """Keys and values with a title: the name of their file, if theirs is missing or blank."""
    name, given = Path(file).stem, content.get('title')
    if given is None or (isinstance(given, str) and not given.strip()):
        content = {key: value for key, value in content.items() if key != 'title'}
    return {'title': name.replace('_', ' ').strip().capitalize() or name, **content}


def as_given(file: str, content: Mapping[str, Any]) -> AnyScene:
    """A scene in the form in which it is written, as a four-bar or a linkage."""
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
    file: str,
    data: Mapping[str, Any],
    overrides: Mapping[str, Any] | Iterable[str] = (),
    folder: Path | None = None,
) -> dict[str, Any]:
    """A file's keys and values, some of them replaced, unchecked.

    Parameters
    ----------
    folder : folder of table files in overrides; their points replace others
    """
    content = copy.deepcopy(dict(data))
    try:
        pairs = _pairs(overrides)
        _refuse_contradictions(file, pairs)
        for key, value in pairs:
            documents.check(value, tuple(key.split('.')))
            _override(content, key, copy.deepcopy(value), file)  # a later one may change its parts
    except documents.DocumentError as error:
        raise InputError(f'{file}: {error}') from error
    found: dict[str, Any] = with_files(file, folder, content, instead=True) if folder else content
    return found


def checked(file: str, model: type[Model], data: Mapping[str, Any]) -> Model:
    """The keys and values of a file as a model of it."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise InputError(f'{file}: {sentence(error.errors(), model, data)}') from error


def _pairs(overrides: Mapping[str, Any] | Iterable[str]) -> list[tuple[str, Any]]:
    if isinstance(overrides, Mapping):
        if wrong := [key for key in overrides if not isinstance(key, str)]:
            raise InputError(f"overrides: {quoted(wrong[0])} is no path, as 'drive.speed' is one")
        return [(key, _plain(value)) for key, value in overrides.items()]
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
        if isinstance(place, dict) and place.get(part) is None:
            place[part] = {}
        at = _part(place, part, key, file)
        if isinstance(place[at], tuple):  # from a scene that was read already
            place[at] = [*place[at]]
        place = place[at]
        if not isinstance(place, dict | list):
            raise InputError(f"{file}: '{key}' cannot be set, because '{part}' is a plain value")
    place[_part(place, last, key, file)] = value


def _part(place: dict[str, Any] | list[Any], part: str, key: str, file: str) -> Any:
    """The key, or the index of an element of a list, of two numbers also ``x`` and ``y``."""
    if isinstance(place, dict):
        return part
    if part in COMPONENTS and len(place) == len(COMPONENTS):
        return COMPONENTS.index(part)
    if not (part.isdecimal() and int(part) < len(place)):
        last = len(place) - 1
        raise InputError(
            f"{file}: '{key}' cannot be set: '{part}' is none of 0 to {last} of a list"
        )
    return int(part)
