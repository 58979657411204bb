"""Changes of a YAML text that leave all else of it as it is: comments, order, line breaks, quotes.

A library that reads and writes the whole text would set it anew: of the scenes of the package
ruamel.yaml changes every sixth beyond the change, in its comments and line breaks. Here the places
at which PyYAML finds keys and values are replaced, and nothing else.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from typing import Any

import yaml

from mechanism_sim.documents import flow, parse
from mechanism_sim.errors import InputError

WIDTH = 99
"""Width of lines that are written here."""

Path = Sequence[str]
"""Keys, and numbers of entries of lists as text, from the whole to a value."""

_REQUIRED = ('links',), ('joints',)


def with_value(text: str, path: Path, value: Any) -> str:
    """The text with a value (None, bool, number, text, list, dict) at a path, there or not.

    Of a list or a part that is there, only the entries that differ are written.
    """
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    if root is None:
        return f'{text.rstrip()}\n'.lstrip() + '\n'.join(_entry(path[0], _nest(path[1:], value)))
    chain, key = _chain(root, path)
    node, rest = chain[-1], path[len(chain) - 1 :]
    if not rest:
        return _replaced(text, path, node, key, value)
    whole = _nest(rest, value)
    if isinstance(node, yaml.ScalarNode | yaml.MappingNode) and not node.value:
        indent = 2 * (len(chain) - 1)
        flat = key is None or any(x.flow_style for x in chain[:-1]) or len(chain) > 2
        start, end = node.start_mark.index, node.end_mark.index
        rows = [x for k, v in whole.items() for x in _entry(k, v, indent)]
        put = f' {_flow(whole)}' if flat and start == end else _flow(whole)
        if not flat:
            start = text.index(':', key.end_mark.index) + 1 if key is not None else start
            put = '\n' + '\n'.join(rows)
        return _put(text, start, end, put)
    if not isinstance(node, yaml.MappingNode):
        raise InputError(f"'{'.'.join(path)}' cannot be set: a part of this path is a plain value")
    ((name, part),) = whole.items()
    end = _pair_end(text, *node.value[-1]) if node.value else node.start_mark.index + 1
    if node.flow_style:
        more = f'{_flow(name)}: {_flow(part)}'
        column = end - text.rfind('\n', 0, end)
        if column + len(more) > WIDTH - 3:
            first = node.value[0][0].start_mark.column
            return _put(text, end, end, ',\n' + ' ' * first + more)
        return _put(text, end, end, f', {more}' if node.value else more)
    indent = node.value[0][0].start_mark.column
    end = (text + '\n').index('\n', end)
    return _put(text, end, end, '\n' + '\n'.join(_entry(name, part, indent)))


def _replaced(text: str, path: Path, node: Any, key: Any, value: Any) -> str:
    """The text with a value instead of the one at a path, which has this node and key."""
    if _says(node, value):
        return text
    if isinstance(node, yaml.MappingNode) and isinstance(value, dict):
        known = {k.value: None for k, _ in node.value}
        if known.keys() & value.keys() and known.keys() != value.keys():
            for name in known.keys() - value.keys():
                text = without(text, (*path, name))
            for name in [x for x in value if x not in known]:
                text = with_value(text, (*path, name), value[name])
            return with_value(text, path, value)
    if (changes := _changes(text, node, value)) is not None:
        for start, end, new in reversed(changes):
            text = _put(text, start, end, new)
        return text
    if isinstance(node, yaml.ScalarNode) and node.start_mark.index == node.end_mark.index:
        return _put(text, node.start_mark.index, node.start_mark.index, f' {_flow(value)}')
    start, end = _start(text, node), _end(text, node)
    if key is not None and _in_lines(node) and start == node.start_mark.index:
        rows = _entry(key.value, value, key.start_mark.column)
        return _put(text, key.start_mark.index, end, '\n'.join(rows).lstrip())
    return _put(text, start, end, _flow(value))


def without(text: str, path: Path) -> str:
    """The text without a key, or an entry of a list; unchanged if there is none.

    Parts that become empty go too, but for those that every scene has.
    """
    chain, _ = _chain(yaml.compose(text, Loader=yaml.SafeLoader), path)
    if len(chain) <= len(path):
        return text
    parent = chain[-2]
    pairs = [x if isinstance(x, tuple) else (x, x) for x in parent.value]
    i = next(i for i, (key, x) in enumerate(pairs) if (x is chain[-1] and key.value == path[-1])
             or key is x is chain[-1])  # fmt: skip
    if len(pairs) == 1 and len(path) > 1:
        above = tuple(path[:-1])
        return with_value(text, above, {}) if above in _REQUIRED else without(text, above)
    key, node = pairs[i]
    end = _pair_end(text, key, node)
    if parent.flow_style:
        if i:
            return _put(text, _pair_end(text, *pairs[i - 1]), end, '')
        after = pairs[1][0].start_mark.index if len(pairs) > 1 else end
        return _put(text, key.start_mark.index, after, '')
    line = text.rfind('\n', 0, key.start_mark.index) + 1
    if text[line : key.start_mark.index].strip() and i + 1 < len(pairs):  # first key behind a dash
        return _put(text, key.start_mark.index, pairs[i + 1][0].start_mark.index, '')
    return _put(text, line, (text + '\n').index('\n', end) + 1, '')


def renamed(text: str, path: Path, name: str) -> str:
    """The text with another name for the key at a path; unchanged if there is none."""
    chain, key = _chain(yaml.compose(text, Loader=yaml.SafeLoader), path)
    if key is None or len(chain) <= len(path):
        return text
    return _put(text, key.start_mark.index, key.end_mark.index, _flow(name))


def _chain(root: Any, path: Path) -> tuple[list[Any], Any]:
    """The nodes along a path as far as there are any, the root first, and the last one's key."""
    chain, last = [root], None
    for part in path:
        node, found, since = chain[-1], None, chain[-1].start_mark.index
        if isinstance(node, yaml.MappingNode):
            for key, x in node.value:
                if key.value == part:
                    last, found, since = key, x, key.end_mark.index
        elif (
            isinstance(node, yaml.SequenceNode) and part.isdigit() and int(part) < len(node.value)
        ):
            last, found = None, node.value[int(part)]
            since = max([since, *(x.end_mark.index for x in node.value[: int(part)])])
        if found is None:
            break
        if found.start_mark.index < since:
            raise InputError(
                f"'{'.'.join(path)}' is an alias ('*') of a value elsewhere: change it there"
            )
        chain.append(found)
    return chain, last


def _changes(text: str, node: Any, value: Any) -> list[tuple[int, int, str]] | None:
    """Starts, ends and new texts of what differs in a value; None if its entries are others."""
    if isinstance(node, yaml.MappingNode) and isinstance(value, dict):
        if {k.value for k, _ in node.value} != value.keys():
            return None
        parts = [(x, value[k.value]) for k, x in node.value]
    elif isinstance(node, yaml.SequenceNode) and isinstance(value, list):
        if len(node.value) != len(value):
            return None
        parts = list(zip(node.value, value, strict=True))
    else:
        return None
    found: list[tuple[int, int, str]] = []
    since = node.start_mark.index
    for x, new in parts:
        start, end = _start(text, x), x.end_mark.index
        if x.start_mark.index < since:
            return None  # an alias
        since = end
        if not isinstance(x, yaml.ScalarNode):
            if (inner := _changes(text, x, new)) is None:
                return None
            found += inner
        elif isinstance(new, dict | list) or start == end or _in_lines(x):
            return None
        elif not _says(x, new):
            found.append((start, end, _flow(new)))
    return found


def _says(node: Any, value: Any) -> bool:
    """True if a node means a plain value, however it is written: quotes, digits."""
    if not isinstance(node, yaml.ScalarNode) or isinstance(value, dict | list):
        return False
    if isinstance(value, str):
        return node.tag.endswith(':str') and bool(node.value == value)
    known = None if node.style else parse(node.value)
    return value is not None and type(known) is type(value) and bool(known == value)


def _start(text: str, node: Any) -> int:
    """Index at which the text of a node starts, behind its anchor if it has one, which stays."""
    start: int = node.start_mark.index
    anchor = re.match(r'&\S+\s+', text[start : node.end_mark.index])
    return start + anchor.end() if anchor else start


def _end(text: str, node: Any) -> int:
    """Index at which the text of a node ends; for blocks before the text that follows."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        if not isinstance(last, tuple):
            return _end(text, last)
        return _pair_end(text, *last)
    end: int = node.end_mark.index
    return len(text[:end].rstrip()) if node.start_mark.index < end else end


def _pair_end(text: str, key: Any, node: Any) -> int:
    """Index at which a key with its value, an alias or none, ends, or an entry of a list."""
    if key is node:
        return _end(text, node)
    colon = text.index(':', key.end_mark.index) + 1
    if node.start_mark.index < key.start_mark.index:  # what an alias stands for is elsewhere
        alias = re.compile(r'\s*\*[^\s,\]}]+').match(text, colon)
        return alias.end() if alias else colon
    return max(_end(text, node), colon)


def _in_lines(node: Any) -> bool:
    """True of a block: keys or entries on lines of their own, or a text in lines."""
    if isinstance(node, yaml.ScalarNode):
        return node.style in ('>', '|')
    return not node.flow_style


def _nest(path: Path, value: Any) -> Any:
    for part in reversed(path):
        value = {part: value}
    return value


def _entry(key: str, value: Any, indent: int = 0) -> list[str]:
    """Lines of a key with its value: in one, or by keys where parts have parts or it is long."""
    space = ' ' * indent
    if isinstance(value, str) and (block := _block(value, WIDTH - indent)):
        style, *rows = block
        return [
            f'{space}{_flow(key)}: {style}',
            *(f'{space}  {row}' if row else '' for row in rows),
        ]
    short = f'{space}{_flow(key)}: {_flow(value)}'
    deep = isinstance(value, dict) and any(isinstance(x, dict) for x in value.values())
    if isinstance(value, dict) and value and (len(short) > WIDTH or (deep and not indent)):
        rows = [row for k, x in value.items() for row in _entry(k, x, indent + 2)]
        return [f'{space}{_flow(key)}:', *rows]
    return [short.rstrip()]


def _block(value: str, width: int) -> list[str]:
    """Style and lines of a text in lines, or too long for one, as a block; else empty."""
    text = value.rstrip('\n')
    if '\n' in text:
        rows = text.split('\n')
        plain = all(row.isprintable() for row in rows) and not text.startswith((' ', '\n'))
        return ['|', *rows] if plain else []
    rows = textwrap.wrap(text, width - 2, break_long_words=False, break_on_hyphens=False)
    folds = ' '.join(rows) == text  # no line break replaces several spaces
    return ['>', *rows] if folds and (len(text) > width or text != value) else []


def _flow(value: Any) -> str:
    """A value in one line, as it may stand among others in brackets."""
    return '' if value is None else flow([value])[1:-1]


def _put(text: str, start: int, end: int, new: str) -> str:
    """The text with another part of it, unless aliases stand for what goes with that part."""
    made = text[:start] + new + text[end:]
    for anchor in re.findall(r'&(\S+)\s', text[start:end]):
        try:
            yaml.compose(made, Loader=yaml.SafeLoader)
        except yaml.YAMLError as error:
            raise InputError(
                f"an alias elsewhere ('*{anchor}') stands for what would go: change that first"
            ) from error
    return made
