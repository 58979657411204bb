"""Problems with keys and values of a scene in one sentence: where, what, what is right."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, cast, get_args

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from mechanism_sim.errors import InputError, nearest, other_word, quoted
from mechanism_sim.keys.quantities import Part, named_file
from mechanism_sim.scene.facts import facts_of
from mechanism_sim.units import EXAMPLES

_TYPES = {
    'model_type': 'a list of keys with values',
    'dict_type': 'a list of names with values',
    'int_type': 'a whole number',
    'int_parsing': 'a whole number',
    'int_from_float': 'a whole number',
    'int_parsing_size': 'a whole number of fewer digits',
    'float_type': 'a number',
    'float_parsing': 'a number',
    'string_type': 'text, in quotes if it looks like a number',
    'bool_parsing': 'true or false',
    'bool_type': 'true or false',
    'finite_number': 'finite',
}
"""Right values by the sort of problem."""

_NAMES = 'name', 'id', 'coordinate'
"""Keys by which entries of lists have their names elsewhere, or are said to be of a link."""

_FEW = 3  # paths that a sentence suggests

_BOUNDS = {
    'greater_than': ('gt', 'more than'),
    'greater_than_equal': ('ge', 'at least'),
    'less_than': ('lt', 'less than'),
    'less_than_equal': ('le', 'at most'),
}


if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:  # it has no public name
    ModelMetaclass = type(BaseModel)


class PartMaker(ModelMetaclass):
    """Makes parts of a scene in Python: what is wrong is said as of a file.

    Raises
    ------
    InputError
        From the call of a class of this kind.
    """

    def __call__(self, *args: Any, **keys: Any) -> Any:
        """A part of these keys."""
        try:
            return super().__call__(*args, **keys)
        except ValidationError as error:
            kind = cast('type[BaseModel]', self)
            said = sentence(error.errors(), kind, keys)
            raise InputError(f'{kind.__name__}: {said}') from error


def sentence(problems: Sequence[ErrorDetails], model: type[BaseModel], data: Any) -> str:
    """The first of some problems with `data` as a `model`; unknown keys come before others."""
    unknown = [p for p in problems if p['type'] == 'extra_forbidden']
    problem = next((p for p in unknown if not _names_file(p, model)), [*unknown, *problems][0])
    path, kind, value = _place(problem, data), problem['type'], problem['input']
    where, context = '.'.join(path), problem.get('ctx', {})
    if kind == 'extra_forbidden':
        models, there = _at(model, path[:-1]), _value(data, path[:-1])
        known = _keys(models, there)
        hint = _other_word(models, path[-1])
        hint = hint or nearest(path[-1], known, deeper=deeper(models, path[-1], there))
        return f"unknown key '{where}'{hint}; allowed here: {', '.join(known)}"
    if kind == 'missing':
        return f"'{where}' is missing"
    if kind == 'missing_key':
        return f"'{where}.{context['key']}' is missing"
    if kind == 'invalid_key':
        return f'{where}: names and keys must be text'.lstrip(': ')
    shown = f'{where} = {quoted(value)}' if where else quoted(value)
    if kind == 'value_error':
        return f'{where if isinstance(value, dict) else shown} {context["error"]}'.lstrip()
    if kind == 'literal_error':
        allowed = re.findall(r"'([^']*)'", str(context['expected']))
        word = path[-1] if isinstance(value, Mapping) else str(value)
        hint = _other_word(_at(model, path[:-1]), word) or nearest(word, allowed)
        return f'{shown} is not possible{hint}; allowed: {context["expected"]}'
    if kind in _BOUNDS:
        key, words = _BOUNDS[kind]
        return f'{shown} is out of bounds: it must be {words} {context[key]:g}'
    if kind == 'too_short':
        least = context['min_length']
        few = 'it must not be empty' if least == 1 else f'it must have {least} entries'
        return f'{shown}: {few}'
    # each possible type of a value has a problem of its own
    own = [p for p in problems if _place(p, data) == path]
    if kind == 'model_type' and len(own) == 1:
        models = _at(model, path)
        known = _keys(models, {})
        reads = any(m.of_files for m in models if issubclass(m, Part))
        alone = (reads and named_file(value)) or _instead(models, value)
        must = f'{shown}: it must be {_TYPES[kind]}{alone}'
        return f'{must}; allowed here: {", ".join(known)}'
    if kind == 'dict_type' and isinstance(value, list | tuple):
        return f'{shown}: it must be names with values, not a list: {_named_entry(value)}'
    ways = [_must_be(p, model, path) for p in own]
    return f'{shown}: it must be {", or ".join(dict.fromkeys(filter(None, ways)))}'


def _names_file(problem: ErrorDetails, model: type[BaseModel]) -> bool:
    """True of a key by which a file would be read if there were no others that are unknown."""
    *path, key = map(str, problem['loc'])
    return any(key in m.of_files for m in _at(model, path) if issubclass(m, Part))


def _instead(models: Iterable[type[BaseModel]], value: Any) -> str:
    """Advice on how to write a value that stands alone: under the first key that takes it."""
    listed = isinstance(value, list | tuple)
    alone = ', not of values alone' if listed else ''
    if listed and value and isinstance(value[0], dict):
        names = {str(key) for key in value[0]}
        for key, field in ((k, f) for model in models for k, f in model.model_fields.items()):
            if any(names <= {*_keys([part], {})} for part in _models(field.annotation)):
                return f': write {{{field.alias or key}: [...]}}'
        return ', not a list of them'
    if isinstance(value, str) and not re.match(r'[-+.]?\d', value):
        return alone  # some keys take any word
    for key, field in ((k, x) for model in models for k, x in model.model_fields.items()):
        if not facts_of(field).quantities:
            continue
        annotated: Any = Annotated[field.annotation, '', *field.metadata]
        try:
            TypeAdapter(annotated).validate_python(value)
        except ValidationError:
            continue
        return f'{alone}: write {{{field.alias or key}: {"[...]" if listed else value}}}'
    return alone


def _named_entry(entries: Sequence[Any]) -> str:
    """Advice on how to write the first entry of a list below its name."""
    first = entries[0] if entries and isinstance(entries[0], Mapping) else {}
    named = next((key for key in _NAMES if isinstance(first.get(key), str)), '')
    rest = next((f'{key}: ...' for key in first if key != named), '...')
    return f'each entry needs a name before it, as {first.get(named, "NAME")}: {{{rest}}}'


def _must_be(problem: ErrorDetails, model: type[BaseModel], path: list[str]) -> str:
    """Right values by one problem."""
    kind, context = problem['type'], problem.get('ctx', {})
    if kind in _TYPES:
        return _TYPES[kind]
    facts = [facts_of(field) for field in _fields(model, path)]
    quantities = [q for f in facts for q in f.quantities]
    if kind in ('tuple_type', 'list_type', 'too_long'):
        pair = kind == 'tuple_type' or context.get('max_length') == 2
        if not pair:
            return 'a list'
        example = ', '.join(EXAMPLES[q.units[0]] for q in quantities[:2])
        alike = len(quantities) >= 2
        cut = _cut_at_commas(problem.get('input'))
        return f'a list of two{f" quantities, for example [{example}]" if alike else ""}{cut}'
    said = ' or '.join(filter(None, (f.render() for f in facts)))
    return f'of another kind{f" ({said})" if said else ""}'


def _cut_at_commas(value: Any) -> str:
    """Advice on formulas of which YAML made several entries of a list."""
    texts = [x for x in value if isinstance(x, str)] if isinstance(value, list | tuple) else []
    if all(x.count('(') == x.count(')') for x in texts):
        return ''
    return ', and a formula with a comma needs quotes: ["hypot(vx, vy)", ...]'


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
    if isinstance(here, list | tuple):
        there = isinstance(last, int)
    else:
        there = isinstance(here, Mapping) and last in here
    return [*found, str(last)] if there or problem['type'] == 'missing' else found


def _value(data: Any, path: Iterable[str]) -> Any:
    """The value at a path."""
    for part in path:
        inner = enumerate(data) if isinstance(data, list | tuple) else data.items()
        data = {str(key): x for key, x in inner}[part]
    return data


def _keys(models: Iterable[type[BaseModel]], data: Any) -> list[str]:
    """Keys allowed in one of some models, beside those that stand there."""
    known = [
        [*m.keys_for(data), *m.of_files] if issubclass(m, Part) else [*m.model_fields]
        for m in models
    ]
    return list(dict.fromkeys(key for keys in known for key in keys))


def _other_word(models: Iterable[type[BaseModel]], word: str) -> str:
    """A clause on a key, or on a value of one, that has another name in some models."""
    known = {w: s for m in models if issubclass(m, Part) for w, s in m.other_words.items()}
    return other_word(word, known)


def deeper(models: Iterable[type[BaseModel]], key: str, data: Any) -> list[str]:
    """Paths to a key in the parts of some models; none if these are so many that they say little.

    Parts by name are at NAME, the first of a list is at 0.
    """
    found = []
    for above, field in ((k, f) for m in models for k in _keys([m], data) for f in _named([m], k)):
        between = {'': '', 'list': '0.', 'dict': 'NAME.'}[facts_of(field).many]
        if _named(_models(field.annotation), key):
            found.append(f'{above}.{between}{key}')
    return found if len(found) <= _FEW else []


def _walk(
    model: type[BaseModel], path: Iterable[str]
) -> tuple[list[type[BaseModel]], list[list[FieldInfo]]]:
    """The models at a place of the schema, and on the way to it the fields of each key.

    A name of somebody's choice, which may be that of a key elsewhere, and the index of an entry
    have no fields, and lead to no other model.
    """
    here, fields, named = [model], list[list[FieldInfo]](), False
    for part in path:
        fields.append([] if named else _named(here, part))
        named = any(facts_of(field).named for field in fields[-1])
        here = [m for field in fields[-1] for m in _models(field.annotation)] or here
    return here, fields


def _at(model: type[BaseModel], path: Iterable[str]) -> list[type[BaseModel]]:
    """The models at a place of the schema."""
    return _walk(model, path)[0]


def _fields(model: type[BaseModel], path: list[str]) -> list[FieldInfo]:
    """The last keys on the way to a place of the schema."""
    return next(filter(None, reversed(_walk(model, path)[1])), [])


def _named(models: Iterable[type[BaseModel]], key: str) -> list[FieldInfo]:
    return [f for m in models for k, f in m.model_fields.items() if key in (k, f.alias)]


def _models(kind: Any) -> list[type[BaseModel]]:
    """The models that an annotation speaks of."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return [kind]
    return [model for part in get_args(kind) for model in _models(part)]
