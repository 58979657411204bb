"""The reference of commands, generated from the parser of the command line."""

from __future__ import annotations

import argparse
from typing import Any

from mechanism_sim.cli.entry import make_parser

PAGE = 'docs/commands'


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx: all commands are appended to their page."""
    app.connect('source-read', _append)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _append(_app: Any, page: str, source: list[str]) -> None:
    if page == PAGE:
        source[0] += reference()


def reference() -> str:
    """All commands as Markdown, a section each."""
    return ''.join(_section(name, sub) for name, sub in make_parser().leaves().items())


def _section(name: str, sub: argparse.ArgumentParser) -> str:
    actions = [a for a in sub._actions if not isinstance(a, argparse._HelpAction)]
    given = [a for a in actions if not a.option_strings]
    words = [
        name,
        *(_shown(a) for a in given),
        *(['[OPTION...]'] if len(actions) > len(given) else []),
    ]
    lines = ['', f'## {name}', '', f'{_sentence(sub.description)}', '']
    lines += ['```text', ' '.join(['mechanism-sim', *words]), '```', '']
    if actions:
        lines += ['| | |', '|---|---|', *(_row(a) for a in actions), '']
    return '\n'.join(lines)


def _shown(action: argparse.Action) -> str:
    """Value of an argument in a line of usage."""
    name = action.metavar if isinstance(action.metavar, str) else None
    if name is None:
        name = '|'.join(map(str, action.choices)) if action.choices else action.dest.upper()
    return {'?': f'[{name}]', '*': f'[{name}...]', '+': f'{name}...'}.get(str(action.nargs), name)


def _row(action: argparse.Action) -> str:
    if not action.option_strings:
        return f'| `{_code(_shown(action))}` | {_help(action)} |'
    value = '' if action.nargs == 0 else f' {_shown(action)}'
    names = ', '.join(f'`{option}{_code(value)}`' for option in action.option_strings)
    return f'| {names} | {_help(action)} |'


def _code(text: str) -> str:
    return text.replace('|', '\\|')  # a bar ends a cell, even in code


def _help(action: argparse.Action) -> str:
    text = (action.help or '').replace('|', '\\|').replace('<', '\\<').replace('*', '\\*')
    notes = ['required'] if action.required and action.option_strings else []
    if isinstance(action, argparse._AppendAction):
        notes.append('may be given several times')
    if action.default not in (None, False, [], argparse.SUPPRESS) and action.option_strings:
        notes.append(f'default `{action.default}`')
    return text + (f' ({"; ".join(notes)})' if notes else '')


def _sentence(text: str | None) -> str:
    text = (text or '').strip()
    return f'{text[:1].upper()}{text[1:]}.'
