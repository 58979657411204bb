"""Values of parameters in YAML, as ``rcl_yaml_param_parser`` reads them.

It is a YAML of its own: 1e-9 is a number, 010 is eight, 1:30 a text, and a key is always a text.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

MARK = 'ros__parameters'
_TRUE = {'y', 'yes', 'true', 'on'}
_FALSE = {'n', 'no', 'false', 'off'}
_INTEGER = re.compile(r'([+-]?)(0[xX][0-9a-fA-F]+|[0-9]+)')
_PLAIN = '!plain'


class _Loader(yaml.SafeLoader):
    """Marks what is not quoted and has no tag; takes no aliases, as ROS."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            name = self.peek_event().anchor  # type: ignore[no-untyped-call]
            raise ValueError(f'ROS has no aliases of values as *{name}: write them out')
        return super().compose_node(parent, index)

    def resolve(self, kind: Any, value: Any, implicit: Any) -> Any:
        if kind is yaml.ScalarNode and implicit[0]:
            return _PLAIN
        return super().resolve(kind, value, implicit)  # type: ignore[no-untyped-call]


class _Dumper(yaml.SafeDumper):
    """Quotes texts that would be read as numbers or truth values."""


def _quoted(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    plain = bool(text) and isinstance(_scalar(text), str)
    return dumper.represent_scalar('tag:yaml.org,2002:str', text, style=None if plain else '"')


_Dumper.add_representer(str, _quoted)


def parse(text: str) -> Any:
    """Mappings, lists and values of a text; ValueError if it is no YAML, or lacks a value."""
    try:
        return _content(_compose(text))
    except RecursionError:
        raise ValueError('its lists or mappings are nested too deep') from None


def parse_value(text: str) -> Any:
    """Value of one parameter; ValueError if no parameter can hold it."""
    value = _held(parse(text))
    if isinstance(value, dict):
        raise ValueError('a parameter holds a value or a list, not a mapping')
    return value


def read_parameters(path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Sections of a file: the node or pattern of nodes it is for, and values by name.

    OSError or ValueError if there is no such file or it is not one of parameters.
    """
    content = _held(parse(Path(path).read_text(encoding='utf-8')))
    if not isinstance(content, dict):
        raise ValueError(f'the file must have the form NODE: {MARK}: NAME: VALUE')
    yield from _sections('', content)


def write_parameters(node: str, values: dict[str, Any]) -> str:
    """Text of a file with values of a node, which `read_parameters` reads."""
    content = {node: {MARK: values}}
    return yaml.dump(
        content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=sys.maxsize
    )


def _sections(prefix: str, content: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for name, below in content.items():
        if not isinstance(below, dict):
            raise ValueError(f'{prefix}{name}: {MARK} is missing above its parameters')
        if name == MARK:
            yield prefix.rstrip('/'), dict(_flat('', below))
        else:
            yield from _sections(f'{prefix}{name}/', below)


def _flat(prefix: str, values: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(f'{prefix}{name}.', value)
        else:
            yield f'{prefix}{name}', value


def _compose(text: str) -> Any:
    try:
        return yaml.compose(text, Loader=_Loader)
    except yaml.YAMLError as error:
        raise ValueError(f'no YAML: {" ".join(str(error).split())}') from error


def _content(node: Any) -> Any:
    if node is None:
        raise ValueError('there is no value')
    if isinstance(node, yaml.MappingNode):
        if not all(isinstance(key, yaml.ScalarNode) for key, _ in node.value):
            raise ValueError('a name is a text')
        return {key.value: _content(value) for key, value in node.value}
    if isinstance(node, yaml.SequenceNode):
        return [_content(item) for item in node.value]
    return _scalar(node.value) if node.tag == _PLAIN else node.value


def _held(value: Any) -> Any:
    """The value, if parameters can hold it: their lists are of one type."""
    if isinstance(value, dict):
        return {name: _held(below) for name, below in value.items()}
    if isinstance(value, list):
        kinds = {type(item) for item in value}
        if len(kinds) > 1 or kinds & {list, dict}:
            raise ValueError(f'a list holds values of one type, not {value}')
    return value


def _scalar(text: str) -> bool | int | float | str:
    if not text:
        raise ValueError('there is no value')
    if text in {form for word in _TRUE | _FALSE for form in _forms(word)}:
        return text.lower() in _TRUE
    whole = _INTEGER.fullmatch(text)
    if whole is not None:
        sign, digits = whole.groups()
        octal = digits.startswith('0') and not digits.lower().startswith('0x')
        try:
            number = int(sign + digits, 8 if octal else 0)
        except ValueError:  # 09: no octal number, but one with a point
            return float(text)
        if -(2**63) <= number < 2**63:
            return number
    if '_' in text:
        return text
    try:
        return float(re.sub(r'^([+-]?)\.(?=[ni])', r'\1', text, flags=re.IGNORECASE))
    except ValueError:
        return text


def _forms(word: str) -> tuple[str, str, str]:
    return word, word.capitalize(), word.upper()
