"""Signatures of the public names for editors: ``python docs/signatures.py`` writes them.

The keys of parts come from the files of their kinds, which editors do not run.
"""

from __future__ import annotations

from pathlib import Path
from typing import get_origin

import mechanism_sim as ms
from mechanism_sim.keys.quantities import Part, meanings
from mechanism_sim.scene.facts import facts_of

FILE = Path(ms.__file__).with_suffix('.pyi')
HEAD = '''\
"""Public names for editors and type checkers, written by `python docs/signatures.py`."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Protocol, TypeAlias

from mechanism_sim.keys.quantities import Part
from mechanism_sim.scene import schema as _schema
'''
TYPES = '''
class _HasUnits(Protocol):
    def to_base_units(self) -> Any: ...

Quantity: TypeAlias = float | str | _HasUnits
"""A number in SI units, text with a unit, or a quantity of pint."""
__version__: str

def __getattr__(name: str) -> Any: ...
'''


def kind(part: type[Part], key: str) -> str:
    """Type of a key's value on input."""
    field = part.model_fields[key]
    facts = facts_of(field)
    public = [name for name in ms.__all__ if getattr(ms, name) is facts.part]
    one = f'{public[0] if public else "Part"} | Mapping[str, Any]'
    if facts.part and (facts.quantities or 'formula' in facts.part.model_fields):
        one += ' | Quantity'  # stands for its part
    if facts.part:
        found = {'dict': f'Mapping[str, {one}]', 'list': f'Sequence[{one}]'}.get(facts.many, one)
    elif set(facts.choices) == {'true', 'false'}:
        found = 'bool'
    elif facts.choices and not facts.quantities:
        found = f'Literal[{", ".join(map(repr, facts.choices))}]'
    elif facts.quantities and get_origin(field.annotation) not in (tuple, list, dict):
        found = 'Quantity'
    elif field.annotation in (str, str | None):
        found = 'str'
    else:
        found = 'Any'
    return found if field.is_required() or found == 'Any' else f'{found} | None = ...'


def of_class(part: type[Part]) -> str:
    """A class with its keys as arguments, and their meanings with units."""
    words = meanings(part)
    keys = sorted(part.model_fields, key=lambda key: not part.model_fields[key].is_required())
    arguments, rows = [], []
    for key in keys:
        field = part.model_fields[key]
        text, facts = ' '.join(words[field.alias or key].split()), facts_of(field).render()
        rows.append(f'        {key} : {text}' + (f' [{facts}]' if facts else ''))
        typed = kind(part, key)
        if typed == 'Any' and not field.is_required():
            typed = 'Any = ...'
        arguments.append(f'        {key}: {typed},')
    title = (part.__doc__ or '').splitlines()[0]
    lines = [f'class {part.__name__}(_schema.{part.__name__}):', f'    """{title}"""', '']
    lines += ['    def __init__(', '        self,', '        *,', *arguments, '    ) -> None:']
    return '\n'.join([*lines, '        r"""', *rows, '        """', ''])


def text() -> str:
    """The whole file."""
    names = {name: getattr(ms, name) for name in sorted(ms.__all__)}
    parts = [of_class(x) for x in names.values() if isinstance(x, type) and issubclass(x, Part)]
    homes = {name: f'mechanism_sim.{home}' for name, home in ms._HOMES.items()}
    imports = [
        f'from {homes[name]} import {name} as {name}\n'
        for name, found in names.items()
        if not isinstance(found, type)
    ]
    return '\n'.join([HEAD + ''.join(imports) + TYPES, *parts])


def main() -> None:
    """Write the file."""
    FILE.write_text(text(), encoding='utf-8')


if __name__ == '__main__':
    main()
