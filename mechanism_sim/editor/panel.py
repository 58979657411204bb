"""The keys of a part of a scene, as the side panel lists them: by the schema, with its help."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, get_args

from mechanism_sim.documents import check, flow, parse
from mechanism_sim.joints.joint_keys import JointKeys
from mechanism_sim.joints.kinds import KINDS
from mechanism_sim.keys.quantities import Part, meanings
from mechanism_sim.scene.facts import Facts, facts_of
from mechanism_sim.scene.files import MECHANISMS
from mechanism_sim.scene.schema import AnyScene
from mechanism_sim.scene.sensor_keys import SensorKeys, sensor_keys_of
from mechanism_sim.scene.sensors import SENSORS

_DEEPEST = 3


def outline(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The sections of a scene that have named parts, with their names."""
    found = []
    for name, field in _model(content).model_fields.items():
        facts = facts_of(field)
        inner = content.get(name)
        listed = facts.many == 'dict' or name in ('links', 'joints')
        if facts.part and listed and isinstance(inner, Mapping) and inner:
            paths = [[name, str(key)] for key in inner]
            found.append({'name': name, 'parts': paths})
        elif name == 'drive' and inner:
            found.append({'name': name, 'parts': [[name]]})
    return found


def rows(content: Mapping[str, Any], path: tuple[str, ...]) -> list[dict[str, Any]]:
    """The keys of the part at a path; of the whole, for an empty path, those that are no parts."""
    model, value = _part(content, path)
    if model is None:
        return []
    return list(_rows(model, value if isinstance(value, Mapping) else {}, path, 0))


def typed(content: Mapping[str, Any], path: tuple[str, ...], text: str) -> Any:
    """The value that a text means in the field of a key: YAML, but where any text may stand.

    Raises
    ------
    DocumentError
    """
    model, _ = _part(content, path[:-1])
    field = _field(model, path[-1]) if model else None
    plain = field is not None and field.annotation in (str, str | None)
    value = text.strip() if plain else parse(text)
    check(value, path)
    return value


def _part(content: Mapping[str, Any], path: tuple[str, ...]) -> tuple[type[Part] | None, Any]:
    """The schema of the part at a path, None if there is none, and its keys and values."""
    model: type[Part] | None = _model(content)
    value: Any = content
    named = False
    for key in path:
        value = value.get(key) if isinstance(value, Mapping) else None
        if named or model is None:
            named = False
            continue
        field = _field(model, key)
        if field is None:
            return None, value
        facts = facts_of(field)
        model, named = facts.part, facts.many == 'dict'
    return None if named else model, value


def _model(content: Mapping[str, Any]) -> type[AnyScene]:
    return MECHANISMS.get(str(content.get('mechanism')), MECHANISMS['linkage'])


def _field(model: type[Part], key: str) -> Any:
    return next((f for k, f in model.model_fields.items() if key in (k, f.alias)), None)


def _rows(
    model: type[Part], value: Mapping[str, Any], path: tuple[str, ...], depth: int
) -> Iterator[dict[str, Any]]:
    help_ = meanings(model)
    for key in _keys(model, value):
        field = model.model_fields[key]
        name, facts = field.alias or key, facts_of(field)
        given = value.get(name)
        whole = depth == 0 and not path
        if whole and (facts.many == 'dict' or name in ('links', 'joints', 'drive', 'mechanism')):
            continue  # selected in the outline
        row = {
            'path': [*path, name],
            'name': name,
            'depth': depth,
            'help': help_.get(name, ''),
            'unit': facts.render() if not facts.part else '',
            'choices': _choices(model, key, facts),
            'text': _text(given),
            'default': '' if given is not None else _default(field, facts),
            'kind': 'value',
        }
        simple = facts.part is not None and not facts.many
        if facts.part is None or facts.many == 'list' or (facts.many and not given):
            yield row
        elif simple and given is None and depth < _DEEPEST:
            yield {**row, 'kind': 'absent'}
        elif simple and isinstance(given, Mapping):
            yield {**row, 'kind': 'part'}
            yield from _rows(facts.part, given, (*path, name), depth + 1)
        elif facts.many == 'dict' and isinstance(given, Mapping):
            yield {**row, 'kind': 'part'}
            for inner, part in given.items():
                sub = {**row, 'path': [*path, name, str(inner)], 'name': str(inner), 'help': '',
                       'depth': depth + 1, 'text': _text(part), 'kind': 'value'}  # fmt: skip
                yield sub
        else:
            yield row


def _choices(model: type[Part], key: str, facts: Facts) -> list[str]:
    if issubclass(model, SensorKeys) and key == 'kind':
        return [*SENSORS]
    return list(facts.choices) if not (facts.part or facts.quantities) else []


def _keys(model: type[Part], value: Mapping[str, Any]) -> list[str]:
    """The keys that have a meaning: of a joint or a sensor those of its kind."""
    if issubclass(model, SensorKeys):
        kind = value.get('kind') or SensorKeys().kind
        return sensor_keys_of(SensorKeys(kind=kind)) if kind in SENSORS else [*model.model_fields]
    if not issubclass(model, JointKeys):
        first = [
            k for k in ('title', 'description', 'length', 'points') if k in model.model_fields
        ]
        return [*dict.fromkeys([*first, *model.model_fields])]
    name, kind = next(
        ((name, kind) for name, kind in KINDS.items() if value.get(name)), ('', model)
    )
    if not name:
        return list(model.model_fields)
    skipped = {'clearance'} if kind.firm else set()
    skipped |= set() if kind.friction_keys else {'friction'}
    return [k for k in dict.fromkeys([name, *kind.model_fields]) if k not in skipped]


def _default(field: Any, facts: Facts) -> str:
    """Default value of a key, if it is a plain one."""
    value = field.default
    if field.is_required():
        return 'needed'
    if value is None or isinstance(value, Part | dict | list | tuple) or get_args(value):
        return ''
    value = getattr(value, 'value', value)
    text = f'{value:g}' if isinstance(value, float) else str(value).lower()
    units = facts.quantities[0].units if facts.quantities and not isinstance(value, str) else ()
    return ' '.join([text, *units[:1]])


def _text(value: Any) -> str:
    """A value as a line of YAML, a text as it is."""
    return value.strip() if isinstance(value, str) else flow(value)
