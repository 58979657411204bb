"""Names that a shell completes: commands and options, scenes, bags, joints, points, values.

Only names that need no mechanics, since the shell waits for them.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import argcomplete
from argcomplete.completers import DirectoriesCompleter, FilesCompleter
from argcomplete.finders import safe_actions

from mechanism_sim.catalogue import config_folder, scene_names, sweep_names
from mechanism_sim.errors import InputError
from mechanism_sim.nodes.arguments import Once
from mechanism_sim.nodes.classes import NODE_NAMES

_Completer = Callable[..., Any]

FOUR_BAR: dict[str, dict[str, Any]] = {
    'links': {'ground': {}, 'crank': {}, 'coupler': {}, 'rocker': {}},
    'joints': {'ground_crank': {}, 'crank_coupler': {}, 'coupler_rocker': {}, 'rocker_ground': {}},
}
"""Keys that a four-bar has without saying so."""


def complete(parser: argparse.ArgumentParser, commands: Mapping[str, Any]) -> None:
    """Print completions for the shell, and end; `commands` are the parsers of all commands."""
    safe_actions.add(Once)  # so that completers see earlier arguments, as the scene
    for name, command in commands.items():
        for action in command._actions:
            if action.choices is None and action.nargs != 0:
                action.completer = _completer(name, action)
    argcomplete.autocomplete(parser, always_complete_options=False)


def _completer(command: str, action: argparse.Action) -> _Completer:
    """Completers of arguments, by their names in the help."""
    if (command, action.dest) == ('sweep', 'file'):
        return _either(lambda **_: sweep_names(), FilesCompleter(('yaml', 'yml')))
    if (command, action.dest) == ('node', 'name'):
        return lambda **_: NODE_NAMES
    found = [_COMPLETERS[n] for n in str(action.metavar).split('|') if n in _COMPLETERS]
    return _either(*found)


def _either(*completers: _Completer) -> _Completer:
    return lambda **asked: [name for complete in completers for name in complete(**asked)]


def _joints(parsed_args: Any, **_: Any) -> Iterator[str]:
    return iter(_scene(parsed_args).get('joints', {}))


def _sensors(parsed_args: Any, **_: Any) -> Iterator[str]:
    return iter(_scene(parsed_args).get('sensors', {}))


def _points(parsed_args: Any, **_: Any) -> Iterator[str]:
    for name, link in _scene(parsed_args).get('links', {}).items():
        points = ['end'] if 'length' in link else []
        yield from (f'{name}.{point}' for point in ('start', *points, *link.get('points', {})))


def _values(parsed_args: Any, **_: Any) -> Iterator[str]:
    def leaves(part: Any, path: str) -> Iterator[str]:
        for key, value in part.items():
            if isinstance(value, dict):
                yield from leaves(value, f'{path}{key}.')
            else:
                yield f'{path}{key}='

    return leaves(_scene(parsed_args), '')


def _scene(parsed_args: Any) -> dict[str, Any]:
    """The content of the scene on the command line; empty if it cannot be read."""
    from mechanism_sim import documents  # noqa: PLC0415

    name = str(getattr(parsed_args, 'scene', None))
    file = Path(name) if name.endswith(('.yaml', '.yml')) else config_folder() / f'{name}.yaml'
    try:
        found = documents.read(file, 'scene')
    except InputError:
        return {}
    if not isinstance(found, dict):
        return {}
    return FOUR_BAR | found if found.get('mechanism') == 'four_bar' else found


_COMPLETERS: dict[str, _Completer] = {
    'SCENE': _either(lambda **_: scene_names(), FilesCompleter(('yaml', 'yml'))),
    'BAG': FilesCompleter(('mcap',)),
    'FILE': FilesCompleter(),
    'DIR': DirectoriesCompleter(),
    'JOINT': _joints,
    'SENSOR': _sensors,
    'LINK.POINT': _points,
    'PATH=VALUE': _values,
}
